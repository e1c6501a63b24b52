//! Grounds rendered tables with three to six mats at random places through the noisy test camera; prints how often
//! everything was found, the errors, and the times.
//!
//! `cargo run --release -p acm-perception --example time_tabletop -- LIBRARY_FOLDER [WORLDS]`

#[allow(dead_code, clippy::unwrap_used)] // The tests use more of it, and a failed unwrap fails them.
#[path = "../tests/tabletop/sensor.rs"]
mod sensor;
#[allow(dead_code, clippy::unwrap_used)]
#[path = "../tests/tabletop/world.rs"]
mod world;

use acm_concept::{expectation::Expectation, object::GroundedObject, template::TemplateLibrary};
use acm_perception::{Grounder, GrounderConfig};
use glam::DVec2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::{error::Error, path::Path, time::Instant};
use world::{BUTTON, MAT_THICKNESS_M, World, far_camera, head_camera};

#[allow(clippy::disallowed_methods)] // The speed of grounding is what it measures.
fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let library = read_library(Path::new(&arguments.next().ok_or("name the folder with the templates")?))?;
    let worlds: u64 = arguments.next().map_or(Ok(20), |text| text.parse())?;
    let grounder = Grounder::new(library.into(), GrounderConfig::default());
    let nouns = ["cube", "mat", "button", "middle"].map(String::from).to_vec();
    let expectation = Expectation { nouns, ..Expectation::default() };
    let (mut complete, mut errors_mm, mut times_ms) = (0, Vec::new(), Vec::new());
    for seed in 0..worlds {
        let (world, mats, cube) = jittered(&mut ChaCha8Rng::seed_from_u64(seed));
        let camera = if seed % 2 == 0 { head_camera() } else { far_camera() };
        let frame = sensor::Sensor::new(camera).capture(&world, 100 * seed + 1);
        let started = Instant::now();
        let percepts = grounder.ground(&frame, &expectation);
        times_ms.push(started.elapsed().as_secs_f64() * 1e3);
        let places = |category: &str| -> Vec<DVec2> {
            let of = |o: &&GroundedObject| o.category == category;
            percepts.objects.iter().filter(of).filter_map(|o| Some(o.pose()?.pose.translation.truncate())).collect()
        };
        let (found, cubes) = (places("mat"), places("cube"));
        let counts = (found.len(), cubes.len(), places("button").len(), percepts.objects.len());
        if counts == (mats.len(), 1, 1, mats.len() + 2) {
            complete += 1;
        } else {
            println!("world {seed}: {} mats, but (mats, cubes, buttons, all) is {counts:?}", mats.len());
            continue;
        }
        for mat in mats {
            let error = |m: &DVec2| (*m - cubes[0] - (mat - cube)).length() * 1e3;
            errors_mm.push(found.iter().map(error).fold(f64::INFINITY, f64::min));
        }
    }
    errors_mm.sort_by(f64::total_cmp);
    times_ms.sort_by(f64::total_cmp);
    let at =
        |values: &[f64], share: f64| values.get((values.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN);
    println!("{complete} of {worlds} worlds complete and without extras");
    println!("mats relative to the cube: median {:.1} mm, 95 % {:.1} mm", at(&errors_mm, 0.5), at(&errors_mm, 0.95));
    println!("time a frame: median {:.0} ms, slowest {:.0} ms", at(&times_ms, 0.5), at(&times_ms, 0.999));
    Ok(())
}

/// Three to six mats evenly round a centre, moved, turned, a centimetre apart at least; the cube on one or in the middle.
fn jittered(random: &mut ChaCha8Rng) -> (World, Vec<DVec2>, DVec2) {
    let centre = DVec2::new(0.1 + random.random_range(-0.02..0.02), -0.1);
    loop {
        let count = random.random_range(3..=6);
        let (radius, turn) = (random.random_range(0.1..0.14), random.random_range(0.0..std::f64::consts::TAU));
        let place = |i: i32, random: &mut ChaCha8Rng| {
            let angle = turn + f64::from(i) * std::f64::consts::TAU / f64::from(count);
            let shift = DVec2::new(random.random_range(-0.03..0.03), random.random_range(-0.03..0.03));
            centre + DVec2::from_angle(angle) * radius + shift
        };
        let mats: Vec<DVec2> = (0..count).map(|i| place(i, random)).collect();
        let apart = |(i, a): (usize, &DVec2)| mats[i + 1..].iter().all(|b| a.distance(*b) > 0.08 * 1.3 + 0.01);
        if !mats.iter().enumerate().all(apart) || mats.iter().any(|m| m.y.abs() > 0.3) {
            continue;
        }
        let mut world = World::table();
        for mat in &mats {
            world.mat(mat.x, mat.y, random.random_range(-0.26..0.26));
        }
        let button = DVec2::new(BUTTON.0, BUTTON.1) + DVec2::splat(random.random_range(-0.03..0.03));
        world.button(button.x, button.y);
        let on = random.random_range(0..=mats.len());
        let (cube, lift) = mats.get(on).map_or((centre, 0.0), |mat| (*mat, MAT_THICKNESS_M));
        world.cube(cube.x, cube.y, lift, random.random_range(-0.7..0.7));
        return (world, mats, cube);
    }
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
