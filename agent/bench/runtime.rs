//! `acm bench runtime`: what it costs to hand something over, to write it down, and to replace an actor.
//!
//! | module | measures |
//! |---|---|
//! | [`frames`] | frames between processes, beside three peers |
//! | [`peer`] | (the other process) |
//! | [`messages`] | questions and answers between two actors, with and without a trace; a replaced actor |
//! | [`tracing`] | messages written in a second, beside plain MCAP; a trace's share of an episode |

pub mod frames;
pub mod messages;
pub mod peer;
pub mod tracing;

use super::{BenchResult, Row};
use crate::{cli::BenchArgs, statistics::median_and};
use acm_runtime::frame_bus::run_id;
use anyhow::Context;
use std::{
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

/// Measures everything. What this machine cannot do is a row that says why.
pub fn measure(args: &BenchArgs) -> anyhow::Result<BenchResult> {
    let mut result = BenchResult::new("runtime", "d435");
    let folder = Scratch::new()?;
    frames::measure(args.quick, &folder, &mut result)?;
    messages::measure(args.quick, &folder, &mut result)?;
    tracing::measure(args, &folder, &mut result)?;
    Ok(result)
}

/// A folder for the files of a measurement; removed at the end.
pub struct Scratch(PathBuf);

impl Scratch {
    fn new() -> anyhow::Result<Scratch> {
        let path = std::env::temp_dir().join(format!("acm-bench-{}", run_id()));
        std::fs::create_dir(&path).with_context(|| format!("the folder {} cannot be made", path.display()))?;
        Ok(Scratch(path))
    }
    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_dir_all(&self.0) {
            eprintln!("acm: the folder {} could not be removed: {error}", self.0.display());
        }
    }
}

/// Wall-clock time that two processes of one machine agree on, nanoseconds.
#[allow(clippy::disallowed_methods, reason = "a bench measures wall time; nothing of it reaches an actor's core")]
pub fn now_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64)
}

/// Median and 99th percentile of times as a row.
fn row(name: impl Into<String>, group: &str, times_us: &[f64]) -> Row {
    let (p50, p99) = median_and(0.99, times_us);
    let row = Row::new(name, [("p50_us", p50), ("p99_us", p99), ("repetitions", times_us.len() as f64)]);
    Row { group: Some(group.into()), ..row }
}
