//! `acm bench world`: what results in the simulated world rest on, beside MuJoCo where there is one.
//!
//! | module | measures |
//! |---|---|
//! | [`blocks`] | five cubes grasped, shaken, held and stacked over many seeds: drops, slip, tower |
//! | [`expert`] | (the script that does it, through the robot's commands alone) |
//! | [`physics`] | the cost of a physics step beside MuJoCo's |
//! | [`rendering`] | frames a processor second beside MuJoCo's |
//! | [`pace`] | an episode's pace when the executor alone works, with and without cameras |
//! | [`snapshots`] | whether a world that is put back goes on as before |
//! | [`primitives`] | the nine primitives alone, with exact geometry, over a published table of cases |
//! | [`articulated`] | doors and drawers opened to three quarters and shut again |
//! | [`peer`], [`clock`] | (MuJoCo in a process of its own; processor time) |
//!
//! A module has one function `measure(args, result)` that adds rows and figures to the [`BenchResult`]; [`measure`]
//! calls one after the other. What this machine cannot do is a row that says why. An episode that a module plays is
//! counted with `audited`: the physics audit holds for all of them.

pub mod articulated;
pub mod blocks;
pub mod clock;
pub mod expert;
pub mod pace;
pub mod peer;
pub mod physics;
pub mod primitives;
pub mod rendering;
pub mod snapshots;

use super::{BenchResult, progress};
use crate::cli::{BenchArgs, WorldArgs};
use clap::ValueEnum;

/// A part of the bench: what one module measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum WorldPart {
    /// Steps and simulated seconds a processor second, beside MuJoCo's.
    Physics,
    /// Pictures a processor second, beside MuJoCo's.
    Rendering,
    /// An episode's pace when the executor alone works.
    Pace,
    /// Worlds that are put back.
    Snapshots,
    /// Five cubes grasped, shaken, held and stacked.
    Blocks,
    /// The nine primitives over a table of cases.
    Primitives,
    /// Doors and drawers.
    Articulated,
}

impl WorldPart {
    fn measure(self) -> fn(&BenchArgs, &mut BenchResult) -> anyhow::Result<()> {
        match self {
            WorldPart::Physics => physics::measure,
            WorldPart::Rendering => rendering::measure,
            WorldPart::Pace => pace::measure,
            WorldPart::Snapshots => snapshots::measure,
            WorldPart::Blocks => blocks::measure,
            WorldPart::Primitives => primitives::measure,
            WorldPart::Articulated => articulated::measure,
        }
    }
}

/// Measures the parts that are asked for, or everything.
///
/// # Errors
/// None: a part that ends with an error is told in the result.
pub fn measure(args: &WorldArgs) -> anyhow::Result<BenchResult> {
    let mut result = BenchResult::new("world", "d435");
    if cfg!(debug_assertions) {
        result.notes.push("This is a debug build: its times and ratios of times mean nothing.".into());
    }
    let parts = if args.only.is_empty() { WorldPart::value_variants() } else { &args.only };
    for (index, part) in parts.iter().enumerate() {
        let name = part.to_possible_value().map(|value| value.get_name().to_string()).unwrap_or_default();
        eprintln!("acm bench world: {name}, part {} of {}", index + 1, parts.len());
        // What the other parts have measured is not lost with it.
        if let Err(error) = part.measure()(&args.common, &mut result) {
            result.errors.push(format!("{name}: {error:#}"));
        }
    }
    Ok(result)
}

/// Counts what the physics audit found in the episodes of a module.
fn audited(result: &mut BenchResult, violations: u64) {
    let sum = result.figures.get("audit_violations").copied().unwrap_or(0.0) + violations as f64;
    result.figure("audit_violations", sum);
}
