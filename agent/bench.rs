//! `acm bench`: figures measured here and now, printed beside what they are to reach.
//!
//! | module | holds |
//! |---|---|
//! | [`ablation`] | the same episodes with one language model after another |
//! | [`memory`] | the engine under memory at a million objects, beside SQLite, redb and roaring |
//! | [`targets`] | floors and goals, and the comparison with them |
//! | [`bddl`] | reads household activities and tabletop tasks of the outside data |
//! | [`perception`] | real labelled frames, and the fixed rendered suite with its truth |
//! | [`identity`] | twins in a row and household rooms seen twice |
//! | [`rmbench`] | memories side by side on the tasks of RMBench |
//! | [`planner`] | goals of published tasks, plans checked by a simulator of their own |
//! | [`runtime`] | frames and messages from one to the other, the trace, restarts |
//! | [`world`] | physics and pictures beside MuJoCo, grasps and primitives, pace, audit, snapshots |

pub mod ablation;
pub mod bddl;
pub mod identity;
pub mod memory;
pub mod perception;
pub mod planner;
pub mod rmbench;
pub mod runtime;
pub mod targets;
pub mod world;

use crate::cli::{
    AblationArgs, BenchArgs, BenchCommand, Exit, MemoryArgs, PerceptionArgs, PlannerArgs, RmbenchArgs, WorldArgs,
};
use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::{
    collections::BTreeMap,
    io::{self, Write},
    path::Path,
    process::{Command, Stdio},
};
use targets::{Targets, Verdict};

/// One line of a result: what was measured of one frame, seed or setting, or why it was not.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Row {
    /// What the row is about.
    pub name: String,
    /// The larger set that it belongs to, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// The numbers, by name; units last in the names.
    pub values: BTreeMap<String, f64>,
    /// Why nothing was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skipped: Option<String>,
}

impl Row {
    /// A row of numbers.
    pub fn new(name: impl Into<String>, values: impl IntoIterator<Item = (&'static str, f64)>) -> Row {
        let values = values.into_iter().map(|(name, value)| (name.to_string(), value)).collect();
        Row { name: name.into(), values, ..Row::default() }
    }
    /// A row that was not measured.
    pub fn skipped(name: impl Into<String>, reason: impl Into<String>) -> Row {
        Row { name: name.into(), skipped: Some(reason.into()), ..Row::default() }
    }
}

/// What a bench found, as `--json` writes it. The denominator of every figure is what was asked for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchResult {
    /// Always `acm.bench/1`.
    pub schema: &'static str,
    /// The bench's name.
    pub bench: &'static str,
    /// The sensor's profile, or what stands in its place.
    pub profile: String,
    /// `debug` or `release`: times compare only within one.
    pub build: &'static str,
    /// The commit of the sources, with `+` where they were changed since; `unknown` outside of a repository.
    pub commit: String,
    /// First and last seed; empty where nothing is drawn.
    pub seeds: Vec<u64>,
    /// The figures, by the names of the targets.
    pub figures: BTreeMap<String, f64>,
    /// What the figures are made of.
    pub rows: Vec<Row>,
    /// What a reader must know to read the figures right, one sentence each.
    pub notes: Vec<String>,
    /// Parts that ended with an error, and which; their figures are missing.
    pub errors: Vec<String>,
    /// Whether it was interrupted from the keyboard.
    #[serde(skip)]
    pub interrupted: bool,
}

impl BenchResult {
    /// A result without figures yet.
    pub fn new(bench: &'static str, profile: impl Into<String>) -> BenchResult {
        BenchResult {
            schema: "acm.bench/1",
            bench,
            profile: profile.into(),
            build: if cfg!(debug_assertions) { "debug" } else { "release" },
            commit: commit(),
            seeds: Vec::new(),
            figures: BTreeMap::new(),
            rows: Vec::new(),
            notes: Vec::new(),
            errors: Vec::new(),
            interrupted: false,
        }
    }
    /// Adds a figure.
    pub fn figure(&mut self, name: &str, value: f64) {
        self.figures.insert(name.into(), value);
    }

    /// Writes the rows, then each figure beside its target.
    fn print(&self, targets: &Targets, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "acm bench {}: {}, {} build, commit {}", self.bench, self.profile, self.build, self.commit)?;
        for row in &self.rows {
            let label = row.group.as_ref().map_or_else(|| row.name.clone(), |group| format!("{group}/{}", row.name));
            match &row.skipped {
                Some(reason) => writeln!(out, "  {label:<24} skipped: {reason}")?,
                None => {
                    let values: Vec<String> =
                        row.values.iter().map(|(name, value)| format!("{name} {}", short(*value))).collect();
                    writeln!(out, "  {label:<24} {}", values.join("  "))?;
                }
            }
        }
        for note in &self.notes {
            writeln!(out, "  {note}")?;
        }
        for error in &self.errors {
            writeln!(out, "  not measured: {error}")?;
        }
        if self.figures.is_empty() {
            return Ok(());
        }
        writeln!(out, "  {:<44} {:>10} {:>10} {:>10}", "figure", "measured", "must", "goal")?;
        for (name, value) in &self.figures {
            let target = targets.of(self.bench, name);
            let bound = |bound: Option<f64>| bound.map_or_else(|| "-".into(), short);
            let goal = match target.map(|t| (t.min, t.max)) {
                Some((Some(min), Some(max))) => format!("{}..{}", short(min), short(max)),
                Some((Some(min), None)) => format!(">={}", short(min)),
                Some((None, Some(max))) => format!("<={}", short(max)),
                Some((None, None)) | None => "-".into(),
            };
            let must = bound(target.and_then(|t| t.must));
            let verdict = target.map_or("no target", |target| target.verdict(*value).words());
            writeln!(out, "  {name:<44} {:>10} {must:>10} {goal:>10}  {verdict}", short(*value))?;
        }
        Ok(())
    }
}

/// Runs `acm bench`. It ends with 1 if a figure misses its floor or a part could not be measured, with 130 if it was
/// interrupted.
pub fn run(command: &BenchCommand) -> anyhow::Result<Exit> {
    let (BenchCommand::Ablation(AblationArgs { common: args, .. })
    | BenchCommand::Perception(PerceptionArgs { common: args, .. })
    | BenchCommand::Identity(args)
    | BenchCommand::Planner(PlannerArgs { common: args, .. })
    | BenchCommand::Memory(MemoryArgs { common: args, .. })
    | BenchCommand::Rmbench(RmbenchArgs { common: args, .. })
    | BenchCommand::Runtime(args)
    | BenchCommand::World(WorldArgs { common: args, .. })) = command;
    // First, so that a mistake in the file does not cost the measurement.
    let targets = match &args.against {
        Some(path) => Targets::read(path)?,
        None => Targets::own()?,
    };
    let result = match command {
        BenchCommand::Ablation(args) => ablation::measure(args),
        BenchCommand::Perception(args) => perception::measure(args, &targets),
        BenchCommand::Identity(args) => identity::measure(args),
        BenchCommand::Planner(args) => planner::measure(args),
        BenchCommand::Memory(args) => memory::measure(args),
        BenchCommand::Rmbench(args) => rmbench::measure(args),
        BenchCommand::Runtime(args) => runtime::measure(args),
        BenchCommand::World(args) => world::measure(args),
    };
    finish(args, &targets, &result?)
}

/// Prints a result beside its targets, writes it where it is asked for, and says how the process ends.
fn finish(args: &BenchArgs, targets: &Targets, result: &BenchResult) -> anyhow::Result<Exit> {
    result.print(targets, &mut io::stdout().lock())?;
    if let Some(path) = &args.json {
        write_json(path, result)?;
    }
    let misses = |(name, value): (&String, &f64)| {
        targets.of(result.bench, name).is_some_and(|target| target.verdict(*value) == Verdict::BelowFloor)
    };
    if result.interrupted {
        return Ok(Exit::Interrupted);
    }
    Ok(if !result.errors.is_empty() || result.figures.iter().any(misses) { Exit::Failed } else { Exit::Success })
}

pub(crate) fn write_json(path: &Path, result: &BenchResult) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(result)?;
    text.push('\n');
    std::fs::write(path, text).with_context(|| format!("the result {} cannot be written", path.display()))
}

/// A bar on standard error that says how far a part has come.
pub(crate) fn progress(what: &str, length: u64) -> ProgressBar {
    let bar = ProgressBar::new(length);
    let style = ProgressStyle::with_template(&format!("{what} {{bar:30}} {{pos}}/{{len}} {{elapsed}} eta {{eta}}"));
    match style {
        Ok(style) => bar.with_style(style),
        Err(_template) => bar,
    }
}

/// A number in at most four figures after the point.
fn short(value: f64) -> String {
    if value == value.trunc() && value.abs() < 1e9 {
        return format!("{value:.0}");
    }
    let digits = if value.abs() >= 100.0 { 1 } else { 4 };
    format!("{value:.digits$}")
}

/// The commit of the sources that this program was built from, as far as the folder still tells.
fn commit() -> String {
    let git = |arguments: &[&str]| -> Option<String> {
        let output = Command::new("git")
            .args(arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .stderr(Stdio::null())
            .output()
            .ok()
            .filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_string())
    };
    let Some(head) = git(&["rev-parse", "--short=12", "HEAD"]) else { return "unknown".into() };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|list| !list.is_empty());
    format!("{head}{}", if changed { "+" } else { "" })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn a_figure_is_printed_beside_its_target() {
        let targets = Targets::parse("t", "[demo]\nspeed = { max = 5 }\nshare = { must = 0.8, min = 0.9 }\n").unwrap();
        let mut result = BenchResult::new("runtime", "none");
        result.bench = "demo";
        result.figure("speed", 6.5);
        result.figure("share", 0.85);
        result.figure("other", 1.0);
        let mut text = Vec::new();
        result.print(&targets, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let line = |name: &str| text.lines().find(|line| line.trim_start().starts_with(name)).unwrap();
        assert!(line("speed").contains("6.5") && line("speed").contains("<=5") && line("speed").contains("SHORT"));
        assert!(line("share").contains("SHORT OF THE GOAL") && line("other").contains("no target"), "{text}");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([short(3.0), short(0.98765), short(143.26)], ["3", "0.9877", "143.3"]);
    }
}
