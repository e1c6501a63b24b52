//! Joints of articulated things that nobody in the project modelled, from two frames of each.
//!
//! A thing of the shared data is drawn in two states of one of its joints, all others at rest: at least 15 degrees or 4 cm
//! apart, 640x480, the sensor `d435` with its errors of calibration, 0.8 to 1.5 m before what the camera looks at. Perception
//! gets the two frames alone.
//!
//! | module | holds |
//! |---|---|
//! | `trial` | a thing in two states, as a camera sees it, with the truth |
//! | `score` | one answer against the truth, and the figures of many |

mod score;
#[cfg(test)]
mod tests;
mod trial;

use crate::{
    bench::{BenchResult, Row, progress},
    cli::PerceptionArgs,
};
use acm_perception::{
    GrounderConfig,
    articulation::{Asked, moved_parts},
};
use acm_render::Renderer;
use acm_sim::Mechanism;
use anyhow::Context;
use score::Tally;
use std::path::{Path, PathBuf};
use trial::{Drawn, LEAST_PIXELS, draw};

/// Seeds of each thing, if it is not said how many.
const SEEDS: usize = 2;
/// The first seed. What is tuned is tuned on seeds below 200.
const FIRST_SEED: u64 = 5000;
/// Every thing has a number of its own, so that things of one seed are drawn apart.
const SEEDS_OF_THINGS: u64 = 1000;

/// A source of things.
#[derive(Debug, Clone)]
pub struct Family {
    /// The source's name.
    pub name: &'static str,
    /// Angle about z of the direction that its things' fronts look to, radians from x.
    pub front_rad: f64,
    /// Its things, as a scenario's `model_file` names them.
    pub things: Vec<String>,
}

/// Measures. Without the outside data its row says that it was skipped.
///
/// # Errors
/// A thing cannot be read or drawn.
pub fn measure(args: &PerceptionArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let Some(data) = std::env::var_os("ACM_DATA").map(PathBuf::from) else {
        result.rows.push(Row::skipped("articulation", "no data: the variable ACM_DATA is not set"));
        return Ok(());
    };
    let mut renderer = match Renderer::new() {
        Ok(renderer) => renderer,
        Err(error) => {
            result.rows.push(Row::skipped("articulation", error.to_string()));
            return Ok(());
        }
    };
    let first = args.seed_from.unwrap_or(FIRST_SEED);
    let count = args.common.episodes.unwrap_or(SEEDS);
    let mut pooled = Tally::default();
    for family in families(&data) {
        if family.things.is_empty() {
            result.rows.push(Row::skipped(format!("articulation, {}", family.name), "ACM_DATA holds none of it"));
            continue;
        }
        let things = if args.common.quick { family.things.len().div_ceil(10) } else { family.things.len() };
        let bar = progress(family.name, (things * count) as u64);
        let mut tally = Tally::default();
        for (at, file) in family.things.iter().take(things).enumerate() {
            let thing = Mechanism::load(file)?;
            for seed in (first..).take(count) {
                let drawn = draw(&mut renderer, &family, &thing, seed * SEEDS_OF_THINGS + at as u64)
                    .with_context(|| format!("{file}, seed {seed}"))?;
                let name = format!("{} {seed}", short(file));
                match drawn {
                    Drawn::ShutIn(joints) => tally.pass_over(joints),
                    Drawn::Trial(trial, shut_in) => {
                        tally.pass_over(shut_in);
                        let [before, after] = &trial.frames;
                        let answer = moved_parts(before, after, &Asked::default(), &GrounderConfig::default());
                        let scored = score::score(&trial, &answer);
                        result.rows.push(Row { group: Some("articulation".into()), ..scored.row(&name, &trial.truth) });
                        tally.add(&scored);
                    }
                }
                bar.inc(1);
            }
        }
        bar.finish_and_clear();
        result.rows.push(tally.row(format!("articulation, {}", family.name)));
        pooled.join(&tally);
    }
    result.rows.push(pooled.row("articulation, all".into()));
    for (name, value) in pooled.figures() {
        result.figure(name, value);
    }
    result.notes.push(format!(
        "Articulation: of {} joints the parts of {} show fewer than {LEAST_PIXELS} pixels: they count for part and joint, not \
         for the axis. {} more were passed over: shut in, their parts would come out through closed doors.",
        pooled.asked(),
        pooled.hidden(),
        pooled.shut_in()
    ));
    result.seeds = vec![first, first + (count as u64).saturating_sub(1)];
    Ok(())
}

/// The things of the shared data, by their source.
fn families(data: &Path) -> Vec<Family> {
    const KITCHEN: &str = "franka_kitchen/kitchen_assets/kitchen_env_model.xml";
    let front = -std::f64::consts::FRAC_PI_2;
    let infinigen = folders(&data.join("infinigen_articulated")).into_iter().flat_map(|category| {
        let kind = name(&category);
        let file = |seed: &PathBuf| format!("data:infinigen_articulated/{kind}/{}/{kind}.urdf", name(seed));
        folders(&category).iter().map(file).collect::<Vec<_>>()
    });
    let there = |file: &str| data.join(file).is_file();
    let kitchen = ["microwave", "hingecabinet", "slidecabinet", "oven"].map(|body| format!("data:{KITCHEN}#{body}"));
    let libero = ["microwave", "wooden_cabinet"].map(|name| format!("libero_articulated/{name}.xml"));
    vec![
        Family { name: "infinigen", front_rad: 0.0, things: infinigen.collect() },
        Family { name: "franka", front_rad: front, things: kitchen.into_iter().filter(|_| there(KITCHEN)).collect() },
        Family {
            name: "libero",
            front_rad: front,
            things: libero.into_iter().filter(|file| there(file)).map(|file| format!("data:{file}")).collect(),
        },
    ]
}

fn folders(path: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(path).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let mut found: Vec<PathBuf> = entries.filter(|path| path.is_dir()).collect();
    found.sort();
    found
}

fn name(path: &Path) -> String {
    path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_string()
}

/// What tells a thing from the others of its source.
fn short(file: &str) -> &str {
    let end = file.rsplit_once('#').map(|(_, body)| body);
    end.or_else(|| file.split_once('/').map(|(_, rest)| rest)).unwrap_or(file)
}
