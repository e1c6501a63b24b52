//! Real labelled frames are cut into objects and compared with the hand labels, one group of frames left out at a time.

use super::timed;
use crate::{
    bench::{BenchResult, Row, progress},
    cli::BenchArgs,
    perceive::input,
    statistics::median_and,
};
use acm_concept::{camera::RgbdFrame, expectation::Expectation, ids::FrameId, time::Time};
use acm_perception::{Grounder, GrounderConfig, frames, labels, metrics};
use anyhow::{Context, bail};
use serde::Deserialize;
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Where the frames lie in the folder of outside data.
const FRAMES: &str = "rgbd_mosd/frames";
/// What is measured of frames.
const MEASURED: [&str; 3] = ["mosd_overlap_f", "mosd_boundary_f", "mosd_objects_over_075"];

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
        result.rows.extend(MEASURED.map(|name| Row::skipped(name, &reason)));
        return Ok(());
    };
    let frames = read(&folder, args.episodes.unwrap_or(usize::MAX))?;
    let library = Arc::new(acm_memory::default_library()?);
    let settings = settings();
    let bar = progress("real frames", (settings.len() * frames.len()) as u64);
    let mut scores: Vec<Vec<Scored>> = Vec::new();
    for setting in &settings {
        let grounder = Grounder::new(Arc::clone(&library), setting.config.clone());
        if let (true, Some(first)) = (scores.is_empty(), frames.first()) {
            // Tables are built at the first call.
            grounder.ground(&first.frame, &Expectation::default());
        }
        let score = |labelled: &Labelled| {
            bar.inc(1);
            labelled.score(&grounder)
        };
        scores.push(frames.iter().map(score).collect());
    }
    bar.finish_and_clear();
    tell(&frames, &settings, &scores, result);
    Ok(())
}

/// Values of the constants by which frames are cut into segments. The first is the one that is shipped; of the others
/// each differs from it in one constant.
struct Setting {
    name: &'static str,
    config: GrounderConfig,
}

fn settings() -> Vec<Setting> {
    let usual = GrounderConfig::default;
    let setting = |name, config| Setting { name, config };
    vec![
        setting("as shipped", usual()),
        setting("depth_step_m 0.003", GrounderConfig { depth_step_m: 0.003, ..usual() }),
        setting("depth_step_m 0.008", GrounderConfig { depth_step_m: 0.008, ..usual() }),
        setting("smooth_border_share 0.5", GrounderConfig { smooth_border_share: 0.5, ..usual() }),
        setting("smooth_border_share 0.8", GrounderConfig { smooth_border_share: 0.8, ..usual() }),
        setting("min_height_m 0.004", GrounderConfig { min_height_m: 0.004, ..usual() }),
        setting("min_height_m 0.009", GrounderConfig { min_height_m: 0.009, ..usual() }),
        setting("min_segment_px 80", GrounderConfig { min_segment_px: 80, ..usual() }),
        setting("min_segment_px 180", GrounderConfig { min_segment_px: 180, ..usual() }),
    ]
}

/// A frame with its hand labels.
struct Labelled {
    stem: String,
    group: String,
    frame: RgbdFrame,
    truth: Vec<u16>,
}

/// What one setting makes of one frame.
struct Scored {
    overlap_f: f64,
    boundary_f: f64,
    over_075: f64,
    objects: f64,
    found: f64,
    ms: f64,
}

impl Labelled {
    fn score(&self, grounder: &Grounder) -> Scored {
        let (percepts, ms) = timed(grounder, &self.frame, &Expectation::default());
        let width = self.frame.header.intrinsics.width as usize;
        let score = metrics::score(&labels::draw(&percepts).into_raw(), &self.truth, width);
        Scored {
            overlap_f: score.overlap_f,
            boundary_f: score.boundary_f,
            over_075: (score.share_over_75 * score.truth as f64).round(),
            objects: score.truth as f64,
            found: score.predicted as f64,
            ms,
        }
    }
}

fn read(folder: &Path, most: usize) -> anyhow::Result<Vec<Labelled>> {
    let described = describe(folder)?;
    let calibration = &described.intrinsics;
    let intrinsics = (calibration.fx, calibration.fy, calibration.cx, calibration.cy);
    let pairs = input::pairs_in(folder)?.into_iter().take(most).enumerate();
    let labelled = |(number, pair): (usize, input::FramePair)| {
        let id = FrameId(number as u64);
        let frame =
            frames::read_pair(&pair.color, &pair.depth, intrinsics, described.depth_unit_m, None, id, Time::ZERO)?;
        let truth = truth(&folder.join(format!("{}_label.png", pair.stem)), &frame)?;
        let known = described.frames.iter().find(|d| pair.stem.parse() == Ok(d.index));
        let group = known.map_or_else(|| "other".into(), |known| known.group.clone());
        Ok(Labelled { stem: pair.stem, group, frame, truth })
    };
    pairs.map(labelled).collect()
}

/// Each group is scored with the setting that is best on all other groups; the figures are over all frames so scored.
fn tell(frames: &[Labelled], settings: &[Setting], scores: &[Vec<Scored>], result: &mut BenchResult) {
    let groups: BTreeSet<&str> = frames.iter().map(|labelled| labelled.group.as_str()).collect();
    let mut held_out: Vec<&Scored> = Vec::new();
    let mut summary: Vec<Row> = Vec::new();
    for &group in &groups {
        let of = |setting: usize, own: bool| -> Vec<&Scored> {
            let both = frames.iter().zip(&scores[setting]);
            both.filter(|(labelled, _)| (labelled.group == group) == own).map(|(_, scored)| scored).collect()
        };
        // The first of the best; with no other group what is shipped.
        let mut chosen = 0;
        for setting in 1..settings.len() {
            if worth(&of(setting, false)) > worth(&of(chosen, false)) {
                chosen = setting;
            }
        }
        let name = |what: &str| format!("{what} ({})", settings[chosen].name);
        let own = of(chosen, true);
        summary.push(Row { group: Some(group.into()), ..Row::new(name("left out"), values(&own)) });
        held_out.extend(own);
    }
    for (labelled, scored) in frames.iter().zip(&scores[0]) {
        let values = [
            ("overlap_f", scored.overlap_f),
            ("boundary_f", scored.boundary_f),
            ("objects_over_075", scored.over_075),
            ("objects", scored.objects),
            ("found", scored.found),
            ("ms", scored.ms),
        ];
        result.rows.push(Row { group: Some(labelled.group.clone()), ..Row::new(labelled.stem.clone(), values) });
    }
    for (setting, scores) in settings.iter().zip(scores) {
        let all: Vec<&Scored> = scores.iter().collect();
        summary.push(Row { group: Some("all groups".into()), ..Row::new(setting.name, values(&all)) });
    }
    for (name, value) in MEASURED.into_iter().zip(means(&held_out)) {
        result.figure(name, value);
    }
    result.rows.extend(summary);
    result.notes.push(format!(
        "Real frames: each group is scored with the constants that are best on the others, out of {} settings; the rules \
         themselves were made while all frames were looked at.",
        settings.len()
    ));
}

/// By what settings are compared: the sum of the three figures.
fn worth(scored: &[&Scored]) -> f64 {
    means(scored).iter().sum()
}

/// In the order of [`MEASURED`]: mean overlap F and boundary F of the frames, share of all their objects over 0.75.
fn means(scored: &[&Scored]) -> [f64; 3] {
    let sum = |value: fn(&Scored) -> f64| scored.iter().map(|one| value(one)).sum::<f64>();
    let frames = scored.len().max(1) as f64;
    [sum(|s| s.overlap_f) / frames, sum(|s| s.boundary_f) / frames, sum(|s| s.over_075) / sum(|s| s.objects).max(1.0)]
}

/// The figures, and the median time.
fn values(scored: &[&Scored]) -> Vec<(&'static str, f64)> {
    let (ms, _) = median_and(0.5, &scored.iter().map(|one| one.ms).collect::<Vec<_>>());
    MEASURED.into_iter().zip(means(scored)).chain([("frames", scored.len() as f64), ("ms", ms)]).collect()
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
