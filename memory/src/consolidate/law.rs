//! How the numbers that an execution was bound to follow from the part's geometry: no term, one or two, whichever the
//! extended Bayesian information criterion prefers (Chen and Chen 2008): it counts how many laws of a size were tried,
//! so that noise makes none.

use crate::entry::{Law, LawTerm, Transition};
use std::collections::BTreeMap;

/// Fewer executions than these per fitted number prove no law.
const PER_NUMBER: usize = 3;
/// A law that leaves more of the variance than this is not worth having.
const WORTH: f64 = 0.5;
/// A spread of this share of the whole is none: it keeps the criterion finite where a law is exact.
const FLOOR: f64 = 1e-6;

/// The laws of all bound parameters that have one.
pub(super) fn laws(successes: &[&Transition]) -> Vec<Law> {
    let mut names: BTreeMap<&str, Vec<(f64, &Transition)>> = BTreeMap::new();
    for transition in successes {
        for (name, value) in super::bound(transition) {
            names.entry(name).or_default().push((value, transition));
        }
    }
    names.into_iter().filter_map(|(name, rows)| law(name, &rows)).collect()
}

fn law(name: &str, rows: &[(f64, &Transition)]) -> Option<Law> {
    let wanted = Column::of(rows.iter().map(|(value, _)| *value));
    let count = rows.len();
    if wanted.squares <= 1e-18 * (1.0 + wanted.mean * wanted.mean) * count as f64 || count < 2 * PER_NUMBER {
        return None;
    }
    let geometry = geometry(rows);
    let pairs = geometry.len() * geometry.len().saturating_sub(1) / 2;
    let columns: Vec<(&str, &Column)> = geometry.iter().map(|(name, column)| (name.as_str(), column)).collect();
    let mut best = (criterion(wanted.squares, wanted.squares, count, (1, 1)), Vec::new(), wanted.squares);
    for (at, first) in columns.iter().enumerate() {
        let slope = wanted.product(first.1) / first.1.squares;
        let left = wanted.squares - slope * wanted.product(first.1);
        let value = criterion(left, wanted.squares, count, (2, geometry.len()));
        if value < best.0 {
            best = (value, vec![(first.0, slope)], left);
        }
        if count < 3 * PER_NUMBER {
            continue;
        }
        for second in columns.iter().skip(at + 1) {
            let Some([a, b]) = plane(&wanted, first.1, second.1) else { continue };
            let left = wanted.squares - a * wanted.product(first.1) - b * wanted.product(second.1);
            let value = criterion(left, wanted.squares, count, (3, pairs));
            if value < best.0 {
                best = (value, vec![(first.0, a), (second.0, b)], left);
            }
        }
    }
    let (_, terms, left) = best;
    if terms.is_empty() || left > WORTH * wanted.squares {
        return None;
    }
    let mean = |name: &str| geometry.get(name).map_or(0.0, |column| column.mean);
    let constant = wanted.mean - terms.iter().map(|(name, slope)| slope * mean(name)).sum::<f64>();
    let free = count - 1 - terms.len();
    let term = |(name, slope): (&str, f64)| LawTerm { parameter: name.into(), slope };
    Some(Law {
        name: name.into(),
        terms: terms.into_iter().map(term).collect(),
        constant,
        residual: (left.max(0.0) / free as f64).sqrt(),
        count: u32::try_from(count).unwrap_or(u32::MAX),
    })
}

/// Geometric parameters that every part has and that differ between them.
fn geometry(rows: &[(f64, &Transition)]) -> BTreeMap<String, Column> {
    let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (_, transition) in rows {
        for parameter in &transition.report.invocation.target.parameters {
            values.entry(&parameter.name).or_default().push(parameter.value);
        }
    }
    let columns = values.into_iter().filter(|(_, values)| values.len() == rows.len());
    let columns = columns.map(|(name, values)| (name.to_owned(), Column::of(values.into_iter())));
    columns.filter(|(_, column)| column.squares > 1e-12 * (1.0 + column.mean * column.mean)).collect()
}

/// Values less their mean.
struct Column {
    values: Vec<f64>,
    mean: f64,
    squares: f64,
}

impl Column {
    fn of(values: impl Iterator<Item = f64>) -> Column {
        let mut values: Vec<f64> = values.collect();
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.iter_mut().for_each(|value| *value -= mean);
        let squares = values.iter().map(|value| value * value).sum();
        Column { values, mean, squares }
    }
    fn product(&self, other: &Column) -> f64 {
        self.values.iter().zip(&other.values).map(|(a, b)| a * b).sum()
    }
}

/// Least squares over two columns; `None` where they are the same up to a factor.
fn plane(wanted: &Column, a: &Column, b: &Column) -> Option<[f64; 2]> {
    let both = a.product(b);
    let determinant = a.squares * b.squares - both * both;
    if determinant <= 1e-9 * a.squares * b.squares {
        return None;
    }
    let (x, y) = (wanted.product(a), wanted.product(b));
    Some([(x * b.squares - y * both) / determinant, (y * a.squares - x * both) / determinant])
}

/// The criterion of a fit with so many numbers, one of so many fits with as many, that leaves a sum of squares.
fn criterion(left: f64, whole: f64, count: usize, (numbers, fits): (usize, usize)) -> f64 {
    let count = count as f64;
    count * (left.max(FLOOR * whole) / count).ln() + numbers as f64 * count.ln() + 2.0 * (fits as f64).ln()
}
