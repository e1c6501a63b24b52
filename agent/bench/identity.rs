//! `acm bench identity`: who is who when a scene is seen again.
//!
//! | module | holds |
//! |---|---|
//! | [`scene`] | a scene shown to a fresh memory twice |
//! | [`twins`] | six identical things in a row |
//! | [`rooms`] | household rooms with identical copies |

pub mod rooms;
pub mod scene;
pub mod twins;

use super::{BenchResult, Row, bddl::archive, progress};
use crate::cli::BenchArgs;
use acm_concept::template::TemplateLibrary;
use acm_memory::IdentityRule;
use anyhow::Context;
use scene::{Answer, Change};
use serde::Deserialize;
use std::{collections::BTreeMap, sync::Arc};

/// Scenes of twins for each setting.
const SCENES: u64 = 2000;
/// Household rooms for each setting.
const ROOMS: usize = 400;
/// Bins of equal width in which stated probabilities are compared with the share that is right.
const BINS: usize = 10;
/// Rooms and their things.
const EPISODES: &str = "alfred_episodes/episodes.jsonl.xz";
/// Sizes of things.
const ASSETS: &str = "ai2thor_scene_graphs/asset-database.json.xz";

/// Measures.
///
/// # Errors
/// The library that ships cannot be read, or a memory takes no frame.
pub fn measure(args: &BenchArgs) -> anyhow::Result<BenchResult> {
    let mut result = BenchResult::new("identity", "positions with Gaussian noise, sizes and colours with their own");
    let library = Arc::new(acm_memory::default_library()?);
    let share = |whole: usize| args.episodes.unwrap_or(if args.quick { whole.div_ceil(10) } else { whole });
    rows_of_twins(share(SCENES as usize) as u64, &library, &mut result)?;
    match (archive::find(EPISODES), archive::find(ASSETS)) {
        (Ok(episodes), Ok(assets)) => {
            let sizes = sizes(&archive::text(&assets)?).context(ASSETS)?;
            let rooms = rooms::rooms(&archive::text(&episodes)?, &sizes, share(ROOMS)).context(EPISODES)?;
            rows_of_rooms(&rooms, &library, &mut result)?;
        }
        (episodes, assets) => {
            let reason = episodes.err().or(assets.err()).unwrap_or_default();
            result.rows.push(Row::skipped("household rooms", reason));
        }
    }
    Ok(result)
}

fn rows_of_twins(scenes: u64, library: &Arc<TemplateLibrary>, result: &mut BenchResult) -> anyhow::Result<()> {
    let bar = progress("settings", twins::SETTINGS.len() as u64);
    for (noise_m, change) in twins::SETTINGS {
        let global = twins::answers((noise_m, change), IdentityRule::Global, scenes, library)?;
        let paper = twins::answers((noise_m, change), IdentityRule::Paper, scenes, library)?;
        let name = format!("twins, noise {:.0} cm, {:.0} % missed and new", noise_m * 100.0, change * 100.0);
        result.rows.push(row(name, &global, &paper));
        if (noise_m, change) == (0.04, 0.0) {
            result.figure("twins_accuracy_noise04", right(&global));
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    result.seeds = vec![0, scenes.saturating_sub(1)];
    Ok(())
}

fn rows_of_rooms(
    rooms: &[Vec<scene::Item>],
    library: &Arc<TemplateLibrary>,
    result: &mut BenchResult,
) -> anyhow::Result<()> {
    let settings = [(0.2, 0.0), (0.4, 0.0), (0.4, 0.2)];
    let bar = progress("settings", settings.len() as u64);
    let mut ambiguous = Vec::new();
    for (noise, share) in settings {
        let change = Change { missed: share, newcomers: share };
        let global = rooms::seen(rooms, noise, change, IdentityRule::Global, library)?;
        let paper = rooms::seen(rooms, noise, change, IdentityRule::Paper, library)?;
        let name = |what: &str| format!("{what}, noise {noise} of spacing, {:.0} % missed and new", share * 100.0);
        result.rows.push(row(name("copies"), &global.copies, &paper.copies));
        result.rows.push(row(name("single things"), &global.singles, &paper.singles));
        let gain = right(&global.copies) - right(&paper.copies);
        match (noise, share) {
            (0.2, _) => {
                let all: Vec<Answer> = global.copies.iter().chain(&global.singles).copied().collect();
                result.figure("alfred_idf1_noise02", right(&all));
            }
            (_, 0.0) => result.figure("alfred_idf1_gain_noise04", gain),
            _ => result.figure("alfred_idf1_gain_noise04_misses20", gain),
        }
        ambiguous.extend(global.copies);
        bar.inc(1);
    }
    bar.finish_and_clear();
    result.figure("ambiguity_calibration_error", calibration_error(&ambiguous));
    let (things, copies): (usize, usize) = rooms.iter().fold((0, 0), |(things, copies), room| {
        (things + room.len(), copies + rooms::spacing(room).iter().flatten().count())
    });
    result.notes.push(format!(
        "{} rooms with {things} things, {copies} of which have identical copies. The noise of each is a share of the \
         distance to its nearest copy. Each room is seen twice by a fresh memory and the second frame is scored: with one \
         answer a thing, IDF1 is the share of right answers. Newcomers are copies of things of the scene, anywhere within \
         30 cm about it",
        rooms.len()
    ));
    Ok(())
}

fn row(name: String, global: &[Answer], paper: &[Answer]) -> Row {
    let doubled = |answers: &[Answer]| share(answers.iter().filter(|a| a.doubled).count(), answers.len());
    let values = [
        ("answers", global.len() as f64),
        ("right", right(global)),
        ("right_by_the_papers_rule", right(paper)),
        ("given_twice_by_the_papers_rule", doubled(paper)),
        ("calibration_error", calibration_error(global)),
    ];
    Row::new(name, values)
}

fn right(answers: &[Answer]) -> f64 {
    share(answers.iter().filter(|answer| answer.right).count(), answers.len())
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}

/// Expected calibration error: the mean distance between the stated probability and the share that is right, over bins.
fn calibration_error(answers: &[Answer]) -> f64 {
    let mut bins = [(0.0, 0.0); BINS];
    for answer in answers {
        let index = ((answer.probability * BINS as f64) as usize).min(BINS - 1);
        if let Some((stated, right)) = bins.get_mut(index) {
            *stated += answer.probability;
            *right += f64::from(u8::from(answer.right));
        }
    }
    bins.iter().map(|(stated, right)| (stated - right).abs()).sum::<f64>() / answers.len().max(1) as f64
}

#[derive(Deserialize)]
struct Asset {
    #[serde(rename = "boundingBox")]
    bounds: Option<Bounds>,
}

#[derive(Deserialize, Clone, Copy)]
struct Bounds {
    x: f64,
    y: f64,
    z: f64,
}

/// The median extents of each kind of thing, z up.
fn sizes(text: &str) -> anyhow::Result<rooms::Sizes> {
    let assets: BTreeMap<String, Vec<Asset>> = serde_json::from_str(text)?;
    let median = |bounds: &[Bounds], axis: fn(&Bounds) -> f64| {
        let mut values: Vec<f64> = bounds.iter().map(axis).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default().max(0.005)
    };
    let size = |(kind, assets): (String, Vec<Asset>)| {
        let bounds: Vec<Bounds> = assets.iter().filter_map(|asset| asset.bounds).collect();
        let size = [median(&bounds, |b| b.x), median(&bounds, |b| b.z), median(&bounds, |b| b.y)];
        (!bounds.is_empty()).then_some((kind.to_lowercase(), size))
    };
    Ok(assets.into_iter().filter_map(size).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(right: bool, probability: f64) -> Answer {
        Answer { truth: Some(0), right, probability, doubled: false }
    }

    #[test]
    fn who_says_nine_tenths_and_is_right_in_half_is_off_by_two_fifths() {
        let answers = [answer(true, 0.9), answer(false, 0.9)];
        assert!((calibration_error(&answers) - 0.4).abs() < 1e-12);
        assert!((calibration_error(&[answer(true, 0.5), answer(false, 0.5)])).abs() < 1e-12);
    }

    #[test]
    fn a_quick_bench_finds_twins_better_than_the_papers_rule() {
        let library = Arc::new(acm_memory::default_library().expect("the library ships"));
        let mut result = BenchResult::new("identity", "test");
        rows_of_twins(40, &library, &mut result).expect("memory takes frames");
        assert!(result.figures["twins_accuracy_noise04"] > 0.88);
        for row in &result.rows {
            assert!(row.values["right"] > row.values["right_by_the_papers_rule"] - 0.03, "{row:?}");
        }
    }
}
