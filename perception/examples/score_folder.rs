//! Grounds every frame of a folder of labelled RGB-D images (`NN_color.png`, `NN_depth.png` in millimetres,
//! `NN_label.png`), prints segmentation scores and times, and draws overlays.
//!
//! `cargo run --release -p acm-perception --example score_folder -- FOLDER LIBRARY_FOLDER [OVERLAY_FOLDER]`

use acm_concept::{expectation::Expectation, ids::FrameId, template::TemplateLibrary, time::Time};
use acm_perception::{Grounder, GrounderConfig, frames, labels, metrics, overlay};
use std::{error::Error, path::Path, time::Instant};

#[allow(clippy::disallowed_methods)] // The speed of grounding is what it measures.
fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("name the folder with the frames")?;
    let library = read_library(Path::new(&arguments.next().ok_or("name the folder with the templates")?))?;
    let overlays = arguments.next();
    let grounder = Grounder::new(library.clone().into(), GrounderConfig::default());
    let mut stems: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(&folder)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        stems.extend(name.strip_suffix("_color.png").map(str::to_string));
    }
    stems.sort();
    let (mut sums, mut frames_scored, mut objects) = ([0.0; 4], 0.0, 0.0);
    for (number, stem) in stems.iter().enumerate() {
        let path = |kind: &str| Path::new(&folder).join(format!("{stem}_{kind}.png"));
        let kinect = (525.0, 525.0, 319.5, 239.5);
        let frame =
            frames::read_pair(&path("color"), &path("depth"), kinect, 0.001, None, FrameId(number as u64), Time::ZERO)?;
        let started = Instant::now();
        let percepts = grounder.ground(&frame, &Expectation::default());
        let took_ms = started.elapsed().as_secs_f64() * 1e3;
        let truth: Vec<u16> = image::open(path("label"))?
            .to_luma8()
            .into_raw()
            .into_iter()
            // The second digit marks pieces of one object.
            .map(|label| if label < 20 { 0 } else { u16::from(label) / 10 })
            .collect();
        let width = frame.header.intrinsics.width as usize;
        let score = metrics::score(&labels::draw(&percepts).into_raw(), &truth, width);
        println!(
            "{stem}: overlap F {:.3}, boundary F {:.3}, {:.0} % over 0.75, {} of {} objects, {took_ms:.0} ms",
            score.overlap_f,
            score.boundary_f,
            score.share_over_75 * 100.0,
            score.predicted,
            score.truth
        );
        for object in &percepts.objects {
            let part = &object.parts[0];
            let sizes: Vec<String> = part
                .parameters
                .iter()
                .map(|p| format!("{} {:.0}+-{:.0} mm {:?}", p.name, p.value * 1e3, p.sigma * 1e3, p.observability))
                .collect();
            println!(
                "    {} {:.2}, {} px: {}",
                object.category,
                object.confidence,
                object.support.count,
                sizes.join(", ")
            );
        }
        if let Some(folder) = &overlays {
            overlay::draw(&frame, &percepts, &[], &library).save(Path::new(folder).join(format!("{stem}.png")))?;
        }
        for (sum, value) in sums.iter_mut().zip([score.overlap_f, score.boundary_f, took_ms]) {
            *sum += value;
        }
        sums[3] += score.share_over_75 * score.truth as f64;
        objects += score.truth as f64;
        frames_scored += 1.0;
    }
    println!(
        "mean of {frames_scored} frames: overlap F {:.3}, boundary F {:.3}, {:.0} % of {objects} objects over 0.75, {:.0} ms",
        sums[0] / frames_scored,
        sums[1] / frames_scored,
        100.0 * sums[3] / objects,
        sums[2] / frames_scored
    );
    Ok(())
}

fn read_library(folder: &Path) -> Result<TemplateLibrary, Box<dyn Error>> {
    let mut texts = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "toml") {
            texts.push((path.display().to_string(), std::fs::read_to_string(&path)?));
        }
    }
    texts.sort();
    Ok(TemplateLibrary::parse(texts.iter().map(|(name, text)| (name.as_str(), text.as_str())))?)
}
