//! Arithmetic over a template's named parameters, as written in library files.

use std::collections::BTreeSet;
use std::fmt;
use thiserror::Error;

use exmex::{Express, FlatEx};

/// Longest expression text that is accepted, in characters.
pub const MAX_EXPRESSION_LENGTH: usize = 400;

/// An expression such as `height - min(0.02, height / 2)`, or a condition such as `length < 1.3 * width`,
/// whose value is 1 where it holds and 0 where it does not.
///
/// Operators: `+ - * / ^`, `< <= > >=`, `&&`, `||`, `min(a, b)`, `max(a, b)` and the usual functions of one number.
///
/// ```
/// # use acm_concept::expression::Expression;
/// let e = Expression::parse("height - min(0.02, height / 2)", &["height"]).unwrap();
/// assert!((e.evaluate(&[("height", 0.05)]).unwrap() - 0.03).abs() < 1e-12);
/// let c = Expression::parse("a < 2 * b && b < 1", &["a", "b"]).unwrap();
/// assert_eq!(c.evaluate(&[("a", 0.5), ("b", 0.3)]).unwrap(), 1.0);
/// ```
#[derive(Clone)]
pub struct Expression {
    text: String,
    /// Boxed: it keeps room for its first operands in itself, almost 20 kB.
    compiled: Box<FlatEx<f64, Operators>>,
}

/// Why an expression of a library file was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ExpressionError {
    /// The text does not parse.
    #[error("cannot read the expression `{text}`: {reason}")]
    Syntax {
        /// The text as written.
        text: String,
        /// The parser's complaint.
        reason: String,
    },
    /// A name that is no parameter.
    #[error("the expression `{text}` names `{name}`, which is not a parameter here (known: {known})")]
    UnknownName {
        /// The text as written.
        text: String,
        /// The name that is not known.
        name: String,
        /// The names that are.
        known: String,
    },
    /// A parameter without a value.
    #[error("the expression `{text}` needs a value for `{name}`")]
    MissingValue {
        /// The text as written.
        text: String,
        /// The parameter that has no value.
        name: String,
    },
}

/// What is added to the priorities of arithmetic, to leave room below for comparisons, `&&` and `||`.
const ARITHMETIC_PRIORITY: i64 = 3;

#[derive(Clone, Debug)]
struct Operators;

impl exmex::MakeOperators<f64> for Operators {
    fn make<'a>() -> Vec<exmex::Operator<'a, f64>> {
        fn as_number(holds: bool) -> f64 {
            if holds { 1.0 } else { 0.0 }
        }
        // A sign before brackets is lost if an operator inside has a priority below 0; so arithmetic moves up instead.
        let mut operators: Vec<_> = exmex::FloatOpsFactory::<f64>::make().into_iter().map(raised).collect();
        let binary = |apply: fn(f64, f64) -> f64, prio: i64| exmex::BinOp { apply, prio, is_commutative: false };
        operators.extend([
            exmex::Operator::make_bin("<", binary(|a, b| as_number(a < b), 2)),
            exmex::Operator::make_bin("<=", binary(|a, b| as_number(a <= b), 2)),
            exmex::Operator::make_bin(">", binary(|a, b| as_number(a > b), 2)),
            exmex::Operator::make_bin(">=", binary(|a, b| as_number(a >= b), 2)),
            exmex::Operator::make_bin("&&", binary(|a, b| as_number(a != 0.0 && b != 0.0), 1)),
            exmex::Operator::make_bin("||", binary(|a, b| as_number(a != 0.0 || b != 0.0), 0)),
        ]);
        operators
    }
}

/// An arithmetic operator that binds tighter than comparisons and conditions.
fn raised(operator: exmex::Operator<'_, f64>) -> exmex::Operator<'_, f64> {
    match (operator.bin(), operator.unary()) {
        (Ok(binary), unary) => {
            let binary = exmex::BinOp { prio: binary.prio + ARITHMETIC_PRIORITY, ..binary };
            match unary {
                Ok(unary) => exmex::Operator::make_bin_unary(operator.repr(), binary, unary),
                Err(_) => exmex::Operator::make_bin(operator.repr(), binary),
            }
        }
        (Err(_), _) => operator,
    }
}

impl Expression {
    /// Reads an expression that may use the given parameter names.
    pub fn parse(text: &str, names: &[&str]) -> Result<Expression, ExpressionError> {
        let syntax = |reason: String| ExpressionError::Syntax { text: text.chars().take(80).collect(), reason };
        if text.len() > MAX_EXPRESSION_LENGTH {
            return Err(syntax(format!("longer than {MAX_EXPRESSION_LENGTH} characters")));
        }
        let compiled = FlatEx::<f64, Operators>::parse(text).map_err(|e| syntax(e.msg().to_string()))?;
        if let Some(unknown) = compiled.var_names().iter().find(|name| !names.contains(&name.as_str())) {
            return Err(ExpressionError::UnknownName {
                text: text.into(),
                name: unknown.clone(),
                known: names.join(", "),
            });
        }
        Ok(Expression { text: text.into(), compiled: Box::new(compiled) })
    }

    /// The value under the given parameter values; names that the expression does not use are ignored.
    pub fn evaluate(&self, values: &[(&str, f64)]) -> Result<f64, ExpressionError> {
        let mut arguments = Vec::with_capacity(self.compiled.var_names().len());
        for name in self.compiled.var_names() {
            let value = values.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
            arguments.push(
                value.ok_or_else(|| ExpressionError::MissingValue { text: self.text.clone(), name: name.clone() })?,
            );
        }
        self.compiled
            .eval(&arguments)
            .map_err(|e| ExpressionError::Syntax { text: self.text.clone(), reason: e.msg().to_string() })
    }

    /// The parameters that the expression uses.
    pub fn names(&self) -> BTreeSet<&str> {
        self.compiled.var_names().iter().map(String::as_str).collect()
    }
    /// The text as written.
    pub fn text(&self) -> &str {
        &self.text
    }
}

impl fmt::Debug for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Expression({:?})", self.text)
    }
}
impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_names_and_bad_syntax_are_refused() {
        assert!(
            matches!(Expression::parse("height + wdth", &["height", "width"]), Err(ExpressionError::UnknownName { name, .. }) if name == "wdth")
        );
        assert!(matches!(Expression::parse("height +", &["height"]), Err(ExpressionError::Syntax { .. })));
        assert!(Expression::parse(&"1+".repeat(300), &[]).is_err());
    }

    #[test]
    fn a_sign_before_brackets_holds_for_conditions_too() {
        for (text, value) in [("-(a > 0)", -1.0), ("-(a > 0 && a < 1)", 0.0), ("2 - (a > 0)", 1.0), ("-(a + 1)", -3.0)]
        {
            let e = Expression::parse(text, &["a"]).unwrap();
            assert_eq!(e.evaluate(&[("a", 2.0)]).unwrap(), value, "{text}");
        }
    }

    #[test]
    fn comparisons_bind_looser_than_arithmetic() {
        let e = Expression::parse("max(a, b) < 1.3 * min(a, b)", &["a", "b"]).unwrap();
        assert_eq!(e.evaluate(&[("a", 1.0), ("b", 1.2)]).unwrap(), 1.0);
        assert_eq!(e.evaluate(&[("a", 1.0), ("b", 1.4)]).unwrap(), 0.0);
    }
}
