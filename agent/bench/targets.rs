//! What figures are to reach: tables `[bench]` of `name = { must, min, max }`.

use anyhow::Context;
use serde::Deserialize;
use std::{collections::BTreeMap, path::Path};

/// Largest file of targets, bytes.
const MAX_BYTES: u64 = 1024 * 1024;

/// Floor and goal of one figure.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// The floor: below it the figure fails.
    pub must: Option<f64>,
    /// The goal, from below.
    pub min: Option<f64>,
    /// The goal, from above.
    pub max: Option<f64>,
}

/// How a figure stands to its target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The goal is reached.
    Reached,
    /// The floor, if there is one, is held, but not the goal.
    ShortOfGoal,
    /// The floor is missed.
    BelowFloor,
}

impl Verdict {
    /// For a table.
    pub fn words(self) -> &'static str {
        match self {
            Verdict::Reached => "ok",
            Verdict::ShortOfGoal => "SHORT OF THE GOAL",
            Verdict::BelowFloor => "BELOW THE FLOOR",
        }
    }
}

impl Target {
    /// Floors and goals from below `factor` times as high, goals from above as much higher.
    pub fn loosened(&self, factor: f64) -> Target {
        let below = |bound: Option<f64>| bound.map(|bound| bound * factor);
        Target { must: below(self.must), min: below(self.min), max: self.max.map(|bound| bound / factor) }
    }
    /// Compares a figure with the target. A number that is none reaches nothing.
    pub fn verdict(&self, value: f64) -> Verdict {
        let holds = |bound: Option<f64>, test: fn(f64, f64) -> bool| bound.is_none_or(|bound| test(value, bound));
        if !holds(self.must, |value, must| value >= must) {
            return Verdict::BelowFloor;
        }
        let reached = holds(self.min, |value, min| value >= min) && holds(self.max, |value, max| value <= max);
        if reached && value.is_finite() { Verdict::Reached } else { Verdict::ShortOfGoal }
    }
}

/// All targets, by bench and figure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Targets(BTreeMap<String, BTreeMap<String, Target>>);

impl Targets {
    /// The project's own.
    pub fn own() -> anyhow::Result<Targets> {
        Targets::parse("agent/figures.toml", include_str!("../figures.toml"))
    }
    /// Those of a file.
    pub fn read(path: &Path) -> anyhow::Result<Targets> {
        let cannot_read = || format!("the targets {} cannot be read; check the path", path.display());
        let bytes = std::fs::metadata(path).with_context(cannot_read)?.len();
        if bytes > MAX_BYTES {
            anyhow::bail!("{} is too large: {bytes} bytes, at most {MAX_BYTES}", path.display());
        }
        Targets::parse(&path.display().to_string(), &std::fs::read_to_string(path).with_context(cannot_read)?)
    }
    /// Reads the text of a file.
    pub fn parse(file: &str, text: &str) -> anyhow::Result<Targets> {
        toml::from_str(text).map(Targets).with_context(|| format!("the targets {file} cannot be understood"))
    }
    /// The target of a figure, if there is one.
    pub fn of(&self, bench: &str, figure: &str) -> Option<&Target> {
        self.0.get(bench)?.get(figure)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn the_own_targets_can_be_read() {
        let own = Targets::own().unwrap();
        assert_eq!(own.of("perception", "mosd_overlap_f").unwrap().must, Some(0.90));
        assert!(own.of("runtime", "frame_handover_p50_us").unwrap().max.is_some());
        assert_eq!(own.of("runtime", "no_such_figure"), None);
    }

    #[test]
    fn floors_and_goals_are_told_apart() {
        let target = Target { must: Some(0.8), min: Some(0.9), max: None };
        assert_eq!(
            [0.95, 0.85, 0.7].map(|v| target.verdict(v)),
            [Verdict::Reached, Verdict::ShortOfGoal, Verdict::BelowFloor]
        );
        assert_eq!(target.verdict(f64::NAN), Verdict::BelowFloor);
        let between = Target { min: Some(1.0), max: Some(2.0), ..Target::default() };
        assert_eq!([1.5, 2.5, f64::NAN].map(|v| between.verdict(v) == Verdict::Reached), [true, false, false]);
    }
}
