//! The table of cases: a data file whose cells are primitives under conditions.

use acm_concept::primitive::Primitive;
use anyhow::{Context, Result, ensure};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use std::collections::BTreeMap;

/// The table that ships with the bench.
const OWN: &str = include_str!("table.toml");
/// Most cells of a table.
const MAX_CELLS: usize = 200;

/// What the world holds that the executor was not told of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// The thing is not there.
    Missing,
    /// Something unseen stands in the way, or the thing cannot move.
    Block,
    /// The thing is taken away in the middle of the skill.
    Slip,
}

/// A value, or the span that it is drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Span {
    /// Always the same.
    Fixed(f64),
    /// Evenly between two bounds.
    Even([f64; 2]),
}

/// A primitive under some conditions.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Cell {
    /// Which of the nine.
    pub primitive: Primitive,
    /// What is special about it.
    pub name: String,
    /// What goes wrong, if anything.
    #[serde(default)]
    pub fault: Option<Fault>,
    /// The robot that does it; the floating gripper with a roomy workspace if none is named.
    #[serde(default)]
    pub robot: Option<String>,
    /// Its values.
    #[serde(flatten)]
    spans: BTreeMap<String, Span>,
}

/// All cells.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Values of every cell that does not give its own.
    #[serde(default)]
    spans: BTreeMap<String, Span>,
    /// Robots that try every cell without a fault once, where they stand.
    #[serde(default)]
    robots: Vec<String>,
    /// The cells.
    pub cell: Vec<Cell>,
}

/// The values that a seed draws.
#[derive(Debug, Clone, PartialEq)]
pub struct Values(BTreeMap<String, f64>);

impl Table {
    /// The table that ships with the bench.
    ///
    /// # Errors
    /// The file is malformed.
    pub fn own() -> Result<Table> {
        Table::parse("table.toml", OWN)
    }
    /// Reads a table.
    ///
    /// # Errors
    /// One line that names the file and what is wrong in it.
    pub fn parse(file: &str, text: &str) -> Result<Table> {
        let table: Table = toml::from_str(text).with_context(|| format!("the table of cases {file} cannot be read"))?;
        ensure!(table.cell.len() <= MAX_CELLS, "{file}: more than {MAX_CELLS} cells");
        let spans = table.spans.iter().chain(table.cell.iter().flat_map(|cell| &cell.spans));
        for (name, span) in spans {
            let sound = match span {
                Span::Fixed(value) => value.is_finite(),
                Span::Even([low, high]) => low.is_finite() && high.is_finite() && low <= high,
            };
            ensure!(sound, "{file}: `{name}` must be a number or a span [low, high]");
        }
        Ok(table)
    }
    /// For every robot of the table, its name and the cells that it tries.
    pub fn by_robot(&self) -> impl Iterator<Item = (&str, Vec<Cell>)> {
        let sound = || self.cell.iter().filter(|cell| cell.fault.is_none());
        let given =
            move |robot: &String| sound().map(|cell| Cell { robot: Some(robot.clone()), ..cell.clone() }).collect();
        self.robots.iter().map(move |robot| (robot.as_str(), given(robot)))
    }
    /// The values of a cell for a seed. Cells draw apart from each other.
    pub fn draw(&self, cell: &Cell, seed: u64) -> Values {
        let mut spans = self.spans.clone();
        spans.extend(cell.spans.clone());
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let draw = |(name, span): (String, Span)| {
            let share: f64 = rng.random();
            let value = match span {
                Span::Fixed(value) => value,
                Span::Even([low, high]) => low + share * (high - low),
            };
            (name, value)
        };
        let mut values: BTreeMap<String, f64> = spans.into_iter().map(draw).collect();
        values.insert("turn".into(), rng.random::<f64>() * std::f64::consts::TAU);
        Values(values)
    }
}

impl Values {
    /// A value, 0 if the cell has none of that name.
    pub fn get(&self, name: &str) -> f64 {
        self.0.get(name).copied().unwrap_or(0.0)
    }
    /// A length that the table gives in millimetres, in metres.
    pub fn metres(&self, name: &str) -> f64 {
        1e-3 * self.get(&format!("{name}_mm"))
    }
    /// Whether a switch is on.
    pub fn is(&self, name: &str) -> bool {
        self.get(name) > 0.5
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    #[test]
    fn the_table_has_every_primitive_and_draws_within_its_spans() {
        let table = Table::own().unwrap();
        let kinds: std::collections::BTreeSet<Primitive> = table.cell.iter().map(|cell| cell.primitive).collect();
        assert_eq!(kinds.len(), 9);
        for cell in &table.cell {
            let values = table.draw(cell, 3);
            assert!((0.3..=0.9).contains(&values.get("friction")) && values == table.draw(cell, 3), "{}", cell.name);
        }
    }

    #[test]
    fn a_span_that_is_none_is_refused() {
        let text = "[[cell]]\nprimitive = 'grasp'\nname = 'a'\nwidth_mm = [3, 1]\n";
        assert!(Table::parse("t.toml", text).unwrap_err().to_string().contains("width_mm"));
    }
}
