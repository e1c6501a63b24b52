//! Named draws, made in the order of the scenario file, and the values that expressions see.

use super::Stream;
use acm_concept::expression::{Expression, ExpressionError};
use std::collections::BTreeMap;
use thiserror::Error;

/// Most values of one repeated draw, and most copies of one repeated object.
pub(crate) const MAX_COUNT: usize = 64;

/// One named draw.
#[derive(Debug, Clone)]
pub(crate) struct DrawSpec {
    pub(crate) name: String,
    pub(crate) kind: DrawKind,
    /// How many values; `None` is one plain value.
    pub(crate) count: Option<Expression>,
    /// How many values where the file says so with a plain number: each of them then has a name of its own.
    pub(crate) fixed: Option<usize>,
}

/// Name of one value of a list of draws.
pub(crate) fn element(name: &str, place: usize) -> String {
    format!("{name}_{place}")
}

impl DrawSpec {
    /// Names of its plain values.
    pub(crate) fn scalars(&self) -> Vec<String> {
        match (&self.count, self.fixed) {
            (None, _) => vec![self.name.clone()],
            (Some(_), fixed) => (0..fixed.unwrap_or(0)).map(|place| element(&self.name, place)).collect(),
        }
    }
}

#[derive(Debug, Clone)]
pub(crate) enum DrawKind {
    Uniform {
        low: Expression,
        high: Expression,
    },
    Normal {
        mean: Expression,
        deviation: Expression,
    },
    Integer {
        low: Expression,
        high: Expression,
    },
    Choice {
        from: Vec<f64>,
    },
    Permutation,
    /// No draw: a number that follows from others.
    Value {
        is: Expression,
    },
}

/// Why a draw could not be made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DrawError {
    /// An expression failed.
    #[error("{0}")]
    Expression(#[from] ExpressionError),
    /// A count or range that is not usable.
    #[error("draw `{name}`: {reason}")]
    Range {
        /// The draw.
        name: String,
        /// What is wrong.
        reason: String,
    },
}

/// The values drawn so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Draws {
    scalars: BTreeMap<String, f64>,
    lists: BTreeMap<String, Vec<f64>>,
}

/// Values by name as one expression sees them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scope(Vec<(String, f64)>);

impl Scope {
    pub(crate) fn set(&mut self, name: &str, value: f64) {
        self.0.push((name.into(), value));
    }
    pub(crate) fn evaluate(&self, expression: &Expression) -> Result<f64, ExpressionError> {
        let values: Vec<(&str, f64)> = self.0.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        expression.evaluate(&values)
    }
}

impl Draws {
    /// The scope of what is not repeated.
    pub(crate) fn scope(&self) -> Scope {
        Scope(self.scalars.iter().map(|(name, value)| (name.clone(), *value)).collect())
    }
    /// The scope of copy `index` of a repeated object: each list stands for its value at that place; `i` is the
    /// place and `n` the number of copies.
    pub(crate) fn scope_at(&self, index: usize, count: usize) -> Scope {
        let mut scope = self.scope();
        scope.set("i", index as f64);
        scope.set("n", count as f64);
        for (name, values) in &self.lists {
            if let Some(value) = values.get(index) {
                scope.set(name, *value);
            }
        }
        scope
    }
    pub(crate) fn scalars(&self) -> impl Iterator<Item = (&str, f64)> {
        self.scalars.iter().map(|(name, value)| (name.as_str(), *value))
    }

    /// Makes one draw and stores its value or values under its name.
    pub(crate) fn draw(&mut self, spec: &DrawSpec, stream: &mut Stream) -> Result<(), DrawError> {
        let scope = self.scope();
        let count = match &spec.count {
            Some(expression) => Some(count(&spec.name, scope.evaluate(expression)?)?),
            None => None,
        };
        let values = spec.values(count, &scope, stream)?;
        match (count, values.first()) {
            (None, Some(value)) => {
                self.scalars.insert(spec.name.clone(), *value);
            }
            _ => {
                for (place, value) in values.iter().enumerate().take(spec.fixed.unwrap_or(0)) {
                    self.scalars.insert(element(&spec.name, place), *value);
                }
                self.lists.insert(spec.name.clone(), values);
            }
        }
        Ok(())
    }
}

/// A whole number of copies from an expression's value.
pub(crate) fn count(name: &str, value: f64) -> Result<usize, DrawError> {
    let rounded = value.round();
    if !(0.0..=MAX_COUNT as f64).contains(&rounded) || (rounded - value).abs() > 1e-6 {
        let reason = format!("the count {value} is not a whole number from 0 to {MAX_COUNT}");
        return Err(DrawError::Range { name: name.into(), reason });
    }
    Ok(rounded as usize)
}

impl DrawSpec {
    fn values(&self, count: Option<usize>, scope: &Scope, stream: &mut Stream) -> Result<Vec<f64>, DrawError> {
        let times = 0..count.unwrap_or(1);
        Ok(match &self.kind {
            DrawKind::Uniform { low, high } => {
                let (low, high) = (scope.evaluate(low)?, scope.evaluate(high)?);
                times.map(|_| stream.uniform(low, high)).collect()
            }
            DrawKind::Normal { mean, deviation } => {
                let (mean, deviation) = (scope.evaluate(mean)?, scope.evaluate(deviation)?);
                times.map(|_| mean + deviation * stream.normal()).collect()
            }
            DrawKind::Integer { low, high } => {
                let (low, high) = (scope.evaluate(low)?.round(), scope.evaluate(high)?.round());
                if !(low <= high && high - low < f64::from(u32::MAX) && low.abs() < 1e12) {
                    let reason = format!("the range {low} to {high} is empty or too wide");
                    return Err(DrawError::Range { name: self.name.clone(), reason });
                }
                times.map(|_| stream.integer(low as i64, high as i64) as f64).collect()
            }
            DrawKind::Choice { from } => {
                let last = from.len().saturating_sub(1) as i64;
                times.filter_map(|_| from.get(stream.integer(0, last) as usize).copied()).collect()
            }
            DrawKind::Value { is } => vec![scope.evaluate(is)?],
            DrawKind::Permutation => {
                stream.permutation(count.unwrap_or(1)).into_iter().map(|place| place as f64).collect()
            }
        })
    }
}
