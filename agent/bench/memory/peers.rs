//! The same questions to others: SQLite with indexes in a Python process, redb and roaring in a program of their own.

use super::{BenchResult, Row, SEED};
use crate::bench::{progress, world::peer::python};
use acm_store::{Id, Query, State, execute, testing::worlds::World};
use anyhow::{Context, bail};
use serde_json::{Value, json};
use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
    process::Command,
};

/// The SQLite peer; it needs Python alone.
const SQLITE: &str = include_str!("../../../scripts/peers/sqlite_memory.py");

/// Measures the peers at one size. One that is not there is a row that says why.
pub fn measure(
    size: u32,
    world: &mut World,
    state: &State,
    quick: bool,
    result: &mut BenchResult,
) -> anyhow::Result<()> {
    let queries: Vec<Query> = (0..if quick { 200 } else { 1000 }).map(|_| world.scoped()).collect();
    match sqlite(state, &queries) {
        Ok(told) => {
            let number = |name: &str| told[name].as_f64().unwrap_or(f64::NAN);
            let values = [
                ("p50_us", number("p50_us")),
                ("p99_us", number("p99_us")),
                ("repetitions", queries.len() as f64),
                ("objects", f64::from(size)),
                ("answers_equal_fraction", number("equal")),
            ];
            result.rows.push(Row { group: Some(format!("{size}")), ..Row::new("SQLite, scoped", values) });
            let version = told["version"].as_str().unwrap_or("?");
            result
                .notes
                .push(format!("SQLite {version} in memory: an index on (category, region), masks, math functions"));
            if number("equal") < 1.0 {
                result.errors.push(format!(
                    "SQLite gives other answers for {:.1} % of the questions",
                    100.0 * (1.0 - number("equal"))
                ));
            }
        }
        Err(error) => result.rows.push(Row::skipped("SQLite, scoped", format!("{error:#}"))),
    }
    match program(size, quick) {
        Ok(told) => {
            for row in told["rows"].as_array().into_iter().flatten() {
                let values = row["values"].as_object().into_iter().flatten();
                let values = values.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect();
                let name = row["name"].as_str().unwrap_or("?").to_owned();
                result.rows.push(Row { name, group: Some(format!("{size}")), values, skipped: None });
            }
        }
        Err(error) => result.rows.push(Row::skipped("redb and roaring", format!("{error:#}"))),
    }
    Ok(())
}

/// Ratios to what was measured of the peers in this run.
pub fn compare(result: &mut BenchResult) {
    let of = |result: &BenchResult, name: &str, value: &str| -> Option<f64> {
        result.rows.iter().find(|row| row.name == name).and_then(|row| row.values.get(value).copied())
    };
    if let (Some(other), Some(own)) =
        (of(result, "SQLite, scoped", "p50_us"), result.figures.get("scoped_query_p50_us").copied())
    {
        result.figure("scoped_query_times_faster_than_sqlite", other / own);
    }
    let own = result.figures.get("durable_events_per_s").copied();
    if let (Some(other), Some(own)) = (of(result, "redb, 1,000 puts a transaction", "events_per_s"), own) {
        result.figure("durable_over_redb", own / other);
    }
}

fn sqlite(state: &State, queries: &[Query]) -> anyhow::Result<Value> {
    let folder = tempfile::tempdir()?;
    let rows = folder.path().join("rows");
    write_rows(state, &rows)?;
    let mask = |words: &[u16]| -> u64 { words.iter().fold(0, |mask, word| mask | 1 << (word % 64)) };
    let questions: Vec<Value> = queries
        .iter()
        .map(|query| {
            let near = query.near.map_or(([0.0; 3], 1.0), |near| (near.at, near.scale_m));
            let ids: Vec<Id> = execute::answer(state, query).hits.iter().map(|hit| hit.id).collect();
            let states: Vec<u16> = query.states.iter().map(|(word, _)| *word).collect();
            json!({
                "category": query.categories.first(), "region": query.region,
                "affordances": mask(&query.affordances) as i64, "states": mask(&states) as i64,
                "at": near.0, "scale": near.1, "ids": ids,
            })
        })
        .collect();
    let task = folder.path().join("task");
    std::fs::write(&task, serde_json::to_vec(&questions)?)?;
    let bar = progress("SQLite", 1);
    let output = Command::new(python())
        .args(["-c", SQLITE])
        .arg(&rows)
        .arg(&task)
        .output()
        .context("Python cannot be started")?;
    bar.finish_and_clear();
    if !output.status.success() {
        bail!("{}", String::from_utf8_lossy(&output.stderr).lines().last().unwrap_or("it ended without a word"));
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// One row an object: id, category, region, position, weight, affordances and states as masks; 44 bytes.
fn write_rows(state: &State, path: &Path) -> anyhow::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    for id in state.ids() {
        let Some(object) = state.object(id) else { continue };
        let Some((block, row)) = state.row(id).and_then(|row| state.table.at(row)) else { continue };
        let affordances = object.parts.iter().flat_map(|part| part.affordances).filter(|word| *word > 0);
        let affordances = affordances.fold(0u64, |mask, word| mask | 1 << (word % 64));
        let states = object.states.iter().fold(0u64, |mask, word| mask | 1 << (word % 64));
        out.write_all(&id.to_le_bytes())?;
        out.write_all(&object.category.to_le_bytes())?;
        out.write_all(&object.region.to_le_bytes())?;
        for value in object.position.iter().chain([&block.hot.get().weight[row]]) {
            out.write_all(&value.to_le_bytes())?;
        }
        out.write_all(&affordances.to_le_bytes())?;
        out.write_all(&states.to_le_bytes())?;
    }
    Ok(out.flush()?)
}

/// Where `scripts/peers.sh` puts the program with the other peers.
fn program(size: u32, quick: bool) -> anyhow::Result<Value> {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| PathBuf::from("target"), PathBuf::from);
    let program = target.join("peers/memory/release/memory-peers");
    if !program.is_file() {
        bail!("no {}: scripts/peers.sh builds it", program.display());
    }
    let bar = progress("redb and roaring", 1);
    let output = Command::new(&program).args([size.to_string(), SEED.to_string(), quick.to_string()]).output()?;
    bar.finish_and_clear();
    if !output.status.success() {
        bail!("{}", String::from_utf8_lossy(&output.stderr).lines().last().unwrap_or("it ended without a word"));
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}
