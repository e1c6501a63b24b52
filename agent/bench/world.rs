//! `acm bench world`: what results in the simulated world rest on, beside MuJoCo where there is one.
//!
//! | module | measures |
//! |---|---|
//! | [`blocks`] | five cubes grasped, shaken, held and stacked over many seeds: drops, slip, tower |
//! | [`expert`] | (the script that does it, through the robot's commands alone) |
//!
//! A module has one function `measure(args, result)` that adds rows and figures to the [`BenchResult`]; [`measure`]
//! calls one after the other. What this machine cannot do is a row that says why.

pub mod blocks;
pub mod expert;

use super::BenchResult;
use crate::cli::BenchArgs;
use indicatif::{ProgressBar, ProgressStyle};

/// Measures everything.
pub fn measure(args: &BenchArgs) -> anyhow::Result<BenchResult> {
    let mut result = BenchResult::new("world", "d435");
    if cfg!(debug_assertions) {
        result.notes.push("This is a debug build: its times and ratios of times mean nothing.".into());
    }
    blocks::measure(args, &mut result)?;
    Ok(result)
}

/// A bar on standard error that says how far a part has come.
fn progress(what: &'static str, length: u64) -> ProgressBar {
    let bar = ProgressBar::new(length);
    let style = ProgressStyle::with_template(&format!("{what} {{bar:30}} {{pos}}/{{len}} {{elapsed}} eta {{eta}}"));
    match style {
        Ok(style) => bar.with_style(style),
        Err(_template) => bar,
    }
}
