//! Grounding of real camera frames, which are found through the variable ACM_DATA.
#![allow(clippy::unwrap_used)] // A failed unwrap is a failed test.

use acm_concept::{
    expectation::Expectation,
    ids::FrameId,
    object::{Observability, Percepts},
    template::TemplateLibrary,
    time::Time,
};
use acm_perception::{Grounder, GrounderConfig, frames, labels, metrics};
use std::{path::PathBuf, sync::Arc};

fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("ACM_DATA").map(|data| PathBuf::from(data).join("rgbd_mosd/frames"));
    let found = folder.filter(|folder| folder.is_dir());
    if found.is_none() {
        println!("skipped: ACM_DATA names no folder with rgbd_mosd/frames");
    }
    found
}

fn library() -> Arc<TemplateLibrary> {
    let files = [
        ("box.toml", include_str!("../../memory/library/box.toml")),
        ("button.toml", include_str!("../../memory/library/button.toml")),
        ("cylinder.toml", include_str!("../../memory/library/cylinder.toml")),
        ("mat.toml", include_str!("../../memory/library/mat.toml")),
    ];
    Arc::new(TemplateLibrary::parse(files).unwrap())
}

fn ground(folder: &std::path::Path, stem: &str) -> (Percepts, metrics::SegmentationScore) {
    let path = |kind: &str| folder.join(format!("{stem}_{kind}.png"));
    let intrinsics = (525.0, 525.0, 319.5, 239.5);
    let frame =
        frames::read_pair(&path("color"), &path("depth"), intrinsics, 0.001, None, FrameId(0), Time::ZERO).unwrap();
    let percepts = Grounder::new(library(), GrounderConfig::default()).ground(&frame, &Expectation::default());
    let truth: Vec<u16> = image::open(path("label"))
        .unwrap()
        .to_luma8()
        .into_raw()
        .into_iter()
        .map(|label| if label < 20 { 0 } else { u16::from(label) / 10 })
        .collect();
    let score = metrics::score(&labels::draw(&percepts).into_raw(), &truth, 640);
    (percepts, score)
}

#[test]
fn two_cereal_boxes_are_two_boxes_and_nothing_else() {
    let Some(folder) = folder() else { return };
    for stem in ["00", "01", "02", "03", "04"] {
        let (percepts, score) = ground(&folder, stem);
        assert_eq!(percepts.objects.len(), 2, "frame {stem}");
        assert!(percepts.objects.iter().all(|o| o.parts[0].template == "box" && o.confidence > 0.5), "frame {stem}");
        assert!(score.overlap_f > 0.95 && score.share_over_75 == 1.0, "frame {stem}: {score:?}");
    }
}

#[test]
fn the_same_box_has_the_same_size_from_every_side() {
    let Some(folder) = folder() else { return };
    // One box stands in frames 03 and 04; the sizes are compared with each other, not with a tape measure.
    let sizes = |stem: &str| {
        let (percepts, _) = ground(&folder, stem);
        let mut sizes: Vec<f64> = percepts
            .objects
            .iter()
            .flat_map(|o| o.parts[0].parameters.iter())
            .filter(|p| p.observability == Observability::Observed)
            .map(|p| p.value)
            .collect();
        sizes.sort_by(f64::total_cmp);
        sizes
    };
    let (one, other) = (sizes("03"), sizes("04"));
    assert_eq!((one.len(), other.len()), (6, 6));
    for (a, b) in one.iter().zip(&other) {
        assert!((a - b).abs() < 0.012, "{one:.3?} {other:.3?}");
    }
}

#[test]
fn things_in_other_frames_are_cut_out_well() {
    let Some(folder) = folder() else { return };
    for stem in ["17", "20", "26", "28", "33", "36"] {
        let (percepts, score) = ground(&folder, stem);
        assert!(score.overlap_f > 0.87, "frame {stem}: {score:?}");
        assert_eq!(percepts.objects.len(), score.truth, "frame {stem}");
    }
}
