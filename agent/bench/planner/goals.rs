//! Published goals, given with what holds at first.

use crate::{
    bench::{
        BenchResult, Row,
        bddl::{Problem, archive},
    },
    cli::BenchArgs,
};
use anyhow::Context;

/// Where the tabletop tasks lie in the folder of outside data.
const TABLETOP: &str = "libero_tasks/bddl_files.tar.xz";
/// Where the household activities lie.
const HOUSEHOLD: &str = "bddl_activities/activities.tar.xz";

/// Measures. Without the outside data its rows say that they were skipped.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    for name in [TABLETOP, HOUSEHOLD] {
        match archive::find(name) {
            Err(reason) => result.rows.push(Row::skipped(name, reason)),
            Ok(path) => {
                let mut read = 0;
                for (file, text) in archive::texts(&path, ".bddl")?.iter().take(args.episodes.unwrap_or(usize::MAX)) {
                    Problem::parse(text).with_context(|| format!("{file} of {name}"))?;
                    read += 1;
                }
                result.rows.push(Row::new(name, [("read", f64::from(read))]));
            }
        }
    }
    Ok(())
}
