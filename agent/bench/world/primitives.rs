//! The nine primitives alone, with exact geometry, over a published table of cases.

pub mod rig;
pub mod table;
pub mod trial;

use super::{audited, progress};
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
};
use acm_concept::primitive::Primitive;
use anyhow::Result;
use std::collections::BTreeMap;
use table::{Cell, Table};
use trial::Trial;

/// Seeds of a cell, and of one where it is only to be seen that it works.
const SEEDS: u64 = 40;
const QUICK_SEEDS: u64 = 4;
/// Most reasons that are told of a cell.
const REASONS: usize = 3;

/// Runs the whole table.
///
/// # Errors
/// The table is malformed, or a world cannot be built.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> Result<()> {
    let table = Table::own()?;
    let seeds = args.episodes.map_or(if args.quick { QUICK_SEEDS } else { SEEDS }, |episodes| episodes as u64);
    let mut results = Vec::new();
    let bar = progress("primitives", table.cell.len() as u64);
    for cell in &table.cell {
        let found = run_cell(&table, cell, 0..seeds)?;
        bar.inc(1);
        let values = [
            ("right", found.right as f64),
            ("tried", found.tried as f64),
            ("false_done", found.false_done as f64),
            ("most_n", found.most_n),
        ];
        result.rows.push(Row { group: Some(cell.primitive.to_string()), ..Row::new(cell.name.as_str(), values) });
        for reason in found.words.keys().take(REASONS) {
            result.notes.push(format!("{} / {}: {reason}", cell.primitive, cell.name));
        }
        audited(result, found.violations);
        results.push(found);
    }
    for (robot, cells) in table.by_robot() {
        robot_row(&table, robot, &cells, result)?;
    }
    let sum = figures(&results);
    result.seeds = vec![0, seeds.saturating_sub(1)];
    result.figure("primitive_success", sum.primitive_success);
    result.figure("insertion_success_1mm", sum.insertion[0]);
    result.figure("insertion_success_05mm", sum.insertion[1]);
    result.figure("primitive_false_done", sum.false_done as f64);
    result.notes.push(format!("worst cell: {}", sum.worst.trim()));
    Ok(())
}

/// One row for a robot: how many cells it does right, each once; a note names the others.
fn robot_row(table: &Table, robot: &str, cells: &[Cell], result: &mut BenchResult) -> Result<()> {
    let bar = progress(robot, cells.len() as u64);
    let (mut right, mut others) = (0, Vec::new());
    for cell in cells {
        let found = run_cell(table, cell, 0..1)?;
        bar.inc(1);
        right += found.right;
        audited(result, found.violations);
        let what = || format!("{} / {}", cell.primitive, cell.name);
        others.extend(found.words.keys().map(|words| format!("{}: {words}", what())));
    }
    let values = [("right", right as f64), ("tried", cells.len() as f64)];
    result.rows.push(Row { group: Some("every robot".into()), ..Row::new(robot, values) });
    result.notes.extend(others.into_iter().map(|other| format!("{robot}: {other}")));
    Ok(())
}

/// What came of a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CellResult {
    /// The cell.
    pub cell: Cell,
    /// Seeds tried.
    pub tried: usize,
    /// Seeds with the right end: done and truly so, or a fault that was said.
    pub right: usize,
    /// Seeds in which the skill said done and it was not so.
    pub false_done: usize,
    /// Greatest force at the wrist, newtons.
    pub most_n: f64,
    /// What the physics audit found in all of them.
    pub violations: u64,
    /// What was said, or was wrong, where it did not end right; with how often.
    pub words: BTreeMap<String, usize>,
}

impl CellResult {
    /// Share of the seeds with the right end.
    pub fn share(&self) -> f64 {
        self.right as f64 / self.tried.max(1) as f64
    }
    /// One line.
    pub fn line(&self) -> String {
        let label = format!("{} / {}", self.cell.primitive, self.cell.name);
        let (right, tried) = (self.right, self.tried);
        format!("{label:<36} {right:>4} of {tried:<4} false done {}  most {:.0} N", self.false_done, self.most_n)
    }
}

/// Figures over all cells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figures {
    /// Mean over the nine of the share of cases without a fault that were done and right.
    pub primitive_success: f64,
    /// The same of insertion at 1.0 and at 0.5 mm.
    pub insertion: [f64; 2],
    /// How often a skill said done and it was not so.
    pub false_done: usize,
    /// The worst cell without a fault.
    pub worst: String,
}

/// Runs a cell over seeds.
///
/// # Errors
/// A world cannot be built.
pub fn run_cell(table: &Table, cell: &Cell, seeds: std::ops::Range<u64>) -> Result<CellResult> {
    let (of, words) = (cell.clone(), BTreeMap::new());
    let mut result = CellResult { cell: of, tried: 0, right: 0, false_done: 0, most_n: 0.0, violations: 0, words };
    for seed in seeds {
        let Trial { done, right, words, most_n, audit } = trial::run(cell, &table.draw(cell, seed), seed)?;
        let as_it_should = if cell.fault.is_some() { !done && !words.is_empty() } else { done && right };
        // What has no cause voids the case.
        let good = as_it_should && audit.violations == 0;
        result.violations += audit.violations;
        result.tried += 1;
        result.right += usize::from(good);
        result.false_done += usize::from(done && !right);
        result.most_n = result.most_n.max(most_n);
        if !good {
            let words = audit.first.iter().fold(words, |words, told| format!("{words} audit: {told}"));
            *result.words.entry(format!("{words} (seed {seed})")).or_default() += 1;
        }
    }
    Ok(result)
}

/// Sums up.
pub fn figures(results: &[CellResult]) -> Figures {
    let sound: Vec<&CellResult> = results.iter().filter(|result| result.cell.fault.is_none()).collect();
    let mut by_kind: BTreeMap<Primitive, Vec<f64>> = BTreeMap::new();
    for result in &sound {
        by_kind.entry(result.cell.primitive).or_default().push(result.share());
    }
    let mean = |shares: &[f64]| shares.iter().sum::<f64>() / shares.len().max(1) as f64;
    let means: Vec<f64> = by_kind.values().map(|shares| mean(shares)).collect();
    let insertion = |clearance: &str| {
        let cells = sound.iter().filter(|r| r.cell.primitive == Primitive::Insert && r.cell.name.ends_with(clearance));
        mean(&cells.map(|r| r.share()).collect::<Vec<_>>())
    };
    let worst = sound.iter().min_by(|a, b| a.share().total_cmp(&b.share()));
    Figures {
        primitive_success: mean(&means),
        insertion: [insertion("1.0 mm"), insertion("0.5 mm")],
        false_done: results.iter().map(|result| result.false_done).sum(),
        worst: worst.map(|result| result.line()).unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    #[test]
    fn every_primitive_does_its_work_and_never_says_done_for_nothing() {
        let table = Table::own().unwrap();
        for cell in &table.cell {
            let result = run_cell(&table, cell, 1..2).unwrap();
            assert_eq!((result.right, result.false_done), (1, 0), "{} {:?}", result.line(), result.words);
        }
    }

    #[test]
    fn an_untrue_done_is_counted() {
        // A block that is put down 20 mm from where the judge wants it.
        let table = Table::parse(
            "t.toml",
            "[[cell]]\nprimitive = 'release'\nname = 'far'\nwidth_mm = 40\ndepth_mm = 40\nheight_mm = 40\nmass_g = 50\ndensest_kg_m3 = 11300\n\
             friction = 0.5\nx_mm = -80\ny_mm = 0\nbelieved_off_mm = 20\n",
        )
        .unwrap();
        let result = run_cell(&table, &table.cell[0], 0..1).unwrap();
        assert_eq!((result.right, result.false_done), (0, 1), "{:?}", result.words);
    }
}
