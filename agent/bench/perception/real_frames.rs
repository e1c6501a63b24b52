//! Real labelled frames are cut into objects and compared with the hand labels.

use super::timed;
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
    perceive::input,
    statistics::median_and,
};
use acm_concept::{camera::RgbdFrame, expectation::Expectation, ids::FrameId, time::Time};
use acm_perception::{Grounder, GrounderConfig, frames, labels, metrics};
use anyhow::{Context, bail};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Where the frames lie in the folder of outside data.
const FRAMES: &str = "rgbd_mosd/frames";
/// What is measured of a group of frames: three figures, and the time that a frame of which nothing is known takes.
const MEASURED: [&str; 4] = ["mosd_overlap_f", "mosd_boundary_f", "mosd_objects_over_075", "ms"];
/// How many of them are figures: the time is the suite's to tell, whose frames are another camera's.
const FIGURES: usize = 3;

/// What the data says of itself.
#[derive(Debug, Deserialize)]
struct Index {
    intrinsics: Calibration,
    depth_unit_m: f64,
    frames: Vec<Described>,
}

#[derive(Debug, Deserialize)]
struct Calibration {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

#[derive(Debug, Deserialize)]
struct Described {
    index: u32,
    group: String,
}

/// Measures. Without the outside data its rows say that they were skipped.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let data = std::env::var_os("ACM_DATA").map(PathBuf::from);
    let Some(folder) = data.map(|data| data.join(FRAMES)).filter(|folder| folder.is_dir()) else {
        let reason = format!("no data: the variable ACM_DATA names no folder that holds {FRAMES}");
        result.rows.extend(MEASURED.iter().take(FIGURES).map(|name| Row::skipped(*name, &reason)));
        return Ok(());
    };
    let described = describe(&folder)?;
    let mut pairs = input::pairs_in(&folder)?;
    pairs.truncate(args.episodes.unwrap_or(usize::MAX));
    let mut rows = Vec::new();
    let grounder = Grounder::new(Arc::new(acm_memory::default_library()?), GrounderConfig::default());
    for (number, pair) in pairs.iter().enumerate() {
        let calibration = &described.intrinsics;
        let intrinsics = (calibration.fx, calibration.fy, calibration.cx, calibration.cy);
        let id = FrameId(number as u64);
        let frame =
            frames::read_pair(&pair.color, &pair.depth, intrinsics, described.depth_unit_m, None, id, Time::ZERO)?;
        if number == 0 {
            // Tables are built at the first call.
            grounder.ground(&frame, &Expectation::default());
        }
        let (percepts, took_ms) = timed(&grounder, &frame, &Expectation::default());
        let truth = truth(&folder.join(format!("{}_label.png", pair.stem)), &frame)?;
        let width = frame.header.intrinsics.width as usize;
        let score = metrics::score(&labels::draw(&percepts).into_raw(), &truth, width);
        let values = [
            ("overlap_f", score.overlap_f),
            ("boundary_f", score.boundary_f),
            ("objects_over_075", (score.share_over_75 * score.truth as f64).round()),
            ("objects", score.truth as f64),
            ("found", score.predicted as f64),
            ("ms", took_ms),
        ];
        let group = described.frames.iter().find(|d| pair.stem.parse() == Ok(d.index)).map(|d| d.group.clone());
        rows.push(Row { group, ..Row::new(pair.stem.clone(), values) });
    }
    summarise(rows, result);
    Ok(())
}

/// The means over all frames, and over each group.
fn summarise(rows: Vec<Row>, result: &mut BenchResult) {
    let mut groups: BTreeMap<String, Vec<&Row>> = BTreeMap::new();
    for row in &rows {
        groups.entry(row.group.clone().unwrap_or_else(|| "other".into())).or_default().push(row);
    }
    let mut summary: Vec<Row> = Vec::new();
    for (group, rows) in groups {
        summary.push(Row { group: Some(group), ..Row::new("mean", MEASURED.into_iter().zip(means(&rows))) });
    }
    let all: Vec<&Row> = rows.iter().collect();
    for (name, value) in MEASURED.into_iter().zip(means(&all)).take(FIGURES) {
        result.figure(name, value);
    }
    result.notes.push(
        "Real frames: the rules that join segments were made while they were looked at; no group is left out yet."
            .into(),
    );
    result.rows.extend(rows);
    result.rows.extend(summary);
}

/// In the order of [`MEASURED`]: mean overlap F and boundary F of the frames, share of all their objects over 0.75, median
/// time.
fn means(rows: &[&Row]) -> [f64; 4] {
    let column = |name: &str| -> Vec<f64> { rows.iter().filter_map(|row| row.values.get(name).copied()).collect() };
    let sum = |name: &str| column(name).iter().sum::<f64>();
    let frames = rows.len().max(1) as f64;
    let (median_ms, _) = median_and(0.5, &column("ms"));
    [
        sum("overlap_f") / frames,
        sum("boundary_f") / frames,
        sum("objects_over_075") / sum("objects").max(1.0),
        median_ms,
    ]
}

fn describe(folder: &Path) -> anyhow::Result<Index> {
    let path = folder.with_file_name("index.json");
    let text = std::fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} cannot be understood", path.display()))
}

/// Hand labels as object numbers: below 20 is the table or nothing, the second digit marks pieces of one object.
fn truth(path: &Path, frame: &RgbdFrame) -> anyhow::Result<Vec<u16>> {
    let image =
        image::open(path).with_context(|| format!("the labels {} cannot be read", path.display()))?.into_luma8();
    let intrinsics = frame.header.intrinsics;
    if image.dimensions() != (intrinsics.width, intrinsics.height) {
        bail!("the labels {} have another size than their frame", path.display());
    }
    let object = |label: u8| if label < 20 { 0 } else { u16::from(label) / 10 };
    Ok(image.into_raw().into_iter().map(object).collect())
}
