//! `acm bench memory`: what the engine under memory costs at a million objects with three parts each, how that grows, and
//! that nothing is lost.
//!
//! | module | measures |
//! |---|---|
//! | [`questions`] | queries, nearest things, the past, preconditions, what-if forks; brute force beside them |
//! | [`durable`] | commits, ingest, recovery, power failures, forgetting |
//! | [`peers`] | SQLite in a Python process, redb and roaring in a program of their own |
//! | [`plot`] | cost against the number of objects, as SVG |

pub mod durable;
pub mod peers;
pub mod plot;
pub mod questions;

use super::{BenchResult, Row};
use crate::{cli::MemoryArgs, statistics::median_and};
use acm_store::{Event, State, Store, testing::worlds::World};
use anyhow::Context;
use rustix::time::{ClockId, clock_gettime};
use std::{path::Path, sync::Arc};

/// Rooms and categories of the worlds.
const ROOMS: usize = 64;
const CATEGORIES: usize = 200;
/// Seed of the worlds.
const SEED: u64 = 1;

/// Measures everything.
pub fn measure(args: &MemoryArgs) -> anyhow::Result<BenchResult> {
    let mut result = BenchResult::new("memory", "synthetic rooms, 3 parts an object");
    result.seeds = vec![SEED];
    let sizes: &[u32] = if args.common.quick { &[10_000, 100_000] } else { &[10_000, 100_000, 1_000_000] };
    result.notes.push("times of questions are processor time of one thread, its clock's 0.2 us with it; ingest, commits and recovery are wall time".into());
    if args.common.quick {
        result.notes.push("--quick: at most 100,000 objects, so the figures are not those of the targets".into());
    }
    for size in sizes {
        let last = Some(size) == sizes.last();
        let (mut world, state) = build(*size)?;
        questions::measure(*size, &mut world, &state, last, &mut result);
        if last {
            peers::measure(*size, &mut world, &state, args.common.quick, &mut result)?;
        }
    }
    let size = sizes.last().copied().unwrap_or_default();
    durable::measure(size, args.common.quick, &mut result)?;
    peers::compare(&mut result);
    match &args.defects {
        Some(path) => defects(path, &mut result)?,
        None => result
            .rows
            .push(Row::skipped("seeded defects", "no --defects: scripts/seeded_bugs.py --json makes the file")),
    }
    if let Some(path) = &args.plot {
        plot::write(&result, path)?;
    }
    Ok(result)
}

/// Takes over what the script found that puts defects into a copy of the engine.
fn defects(path: &Path, result: &mut BenchResult) -> anyhow::Result<()> {
    #[derive(serde::Deserialize)]
    struct Defect {
        defect: String,
        caught: bool,
    }
    #[derive(serde::Deserialize)]
    struct Found {
        defects: Vec<Defect>,
    }
    let text = std::fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
    let found: Found = serde_json::from_slice(&text)
        .with_context(|| format!("{} is not what scripts/seeded_bugs.py --json writes", path.display()))?;
    let caught = found.defects.iter().filter(|defect| defect.caught).count() as f64;
    let values = [("defects", found.defects.len() as f64), ("caught", caught)];
    result.rows.push(Row { group: Some("defects".into()), ..Row::new("seeded defects", values) });
    let missed = found.defects.iter().filter(|defect| !defect.caught);
    result.errors.extend(missed.map(|missed| format!("no test finds the seeded defect `{}`", missed.defect)));
    result.figure("seeded_bugs_caught", caught);
    Ok(())
}

/// A world of so many objects, settled for reading.
fn build(size: u32) -> anyhow::Result<(World, Arc<State>)> {
    let bar = super::progress(&format!("a world of {size}"), u64::from(size));
    let mut store = Store::in_memory();
    let (mut world, words) = World::new(SEED, ROOMS, CATEGORIES);
    store.commit(&[words], 0)?;
    let mut id = 0;
    while id < size {
        let batch: Vec<Event> = (id..(id + 1000).min(size)).map(|id| world.put(id, 1000)).collect();
        id += batch.len() as u32;
        bar.inc(batch.len() as u64);
        store.commit(&batch, 1000)?;
    }
    bar.finish_and_clear();
    Ok((world, store.view()))
}

/// Processor time of this thread, microseconds.
fn cpu_us() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e6 + time.tv_nsec as f64 * 1e-3
}

/// Wall time, microseconds.
fn wall_us() -> f64 {
    let time = clock_gettime(ClockId::Monotonic);
    time.tv_sec as f64 * 1e6 + time.tv_nsec as f64 * 1e-3
}

/// Median and 99th percentile of times as a row of a size.
fn row(name: &str, size: u32, times_us: &[f64]) -> Row {
    let (p50, p99) = median_and(0.99, times_us);
    let values =
        [("p50_us", p50), ("p99_us", p99), ("repetitions", times_us.len() as f64), ("objects", f64::from(size))];
    Row { group: Some(format!("{size}")), ..Row::new(name, values) }
}
