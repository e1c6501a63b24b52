//! Goals and conditions with connectives and quantifiers.

use super::sexpr::{Expression, ExpressionError};
use acm_concept::literal::{Literal, Term};
use std::fmt;

/// Every object is of this kind.
pub const THING: &str = "thing";

/// A quantified variable: it runs over the objects of a kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Variable {
    /// Name without the `?`.
    pub name: String,
    /// A type, a type above it, or what an object affords; [`THING`] for all.
    pub kind: String,
}

/// A condition on a state. Written as in PDDL, with the counting quantifiers of BDDL.
#[derive(Debug, Clone, PartialEq)]
pub enum Formula {
    /// A literal.
    Literal(Literal),
    /// `(and A B ...)`: every one holds; of none, true.
    All(Vec<Formula>),
    /// `(or A B ...)`: one of them holds; of none, false.
    Any(Vec<Formula>),
    /// `(not A)`.
    Not(Box<Formula>),
    /// `(imply A B)`: the second holds, or the first does not.
    Implies(Box<(Formula, Formula)>),
    /// `(forall (?x - kind) A)`.
    ForAll(Variable, Box<Formula>),
    /// `(exists (?x - kind) A)`.
    Exists(Variable, Box<Formula>),
    /// `(forn (N) (?x - kind) A)`: for N objects, no more and no fewer.
    Exactly(usize, Variable, Box<Formula>),
    /// `(forpairs (?x - kind) (?y - kind) A)` and `(fornpairs (N) ...)`: at least N of the first have a second with which
    /// A holds, and at least N of the second a first; N is the smaller number of objects unless it is given.
    /// An object makes no pair with itself.
    Pairs(Option<usize>, Variable, Variable, Box<Formula>),
}

impl Formula {
    /// Reads a formula. Connectives may be written in capitals; a word with `?` is a variable, every other one is the
    /// name of an object.
    ///
    /// # Errors
    /// A connective is not known or has other arguments than it takes.
    ///
    /// ```
    /// # use acm_planner::classical::formula::Formula;
    /// let text = "(forall (?cup - cup) (exists (?tray - tray) (on ?cup ?tray)))";
    /// assert_eq!(Formula::parse(text).unwrap().to_string(), text);
    /// ```
    pub fn parse(text: &str) -> Result<Formula, ExpressionError> {
        match Expression::parse(text)?.as_slice() {
            [one] => Formula::read(one),
            [_, second, ..] => Err(second.error("one formula is expected, not two")),
            [] => Err(ExpressionError::Empty),
        }
    }
    /// Reads a formula that stands in a larger text.
    ///
    /// # Errors
    /// See [`Formula::parse`].
    pub fn read(expression: &Expression) -> Result<Formula, ExpressionError> {
        let (head, rest) = expression.expect_headed("a formula such as (on ?cup ?table)")?;
        let each = |rest: &[Expression]| rest.iter().map(Formula::read).collect::<Result<Vec<_>, _>>();
        let boxed = |body: &Expression| Formula::read(body).map(Box::new);
        match (head.to_ascii_lowercase().as_str(), rest) {
            ("and", rest) => Ok(Formula::All(each(rest)?)),
            ("or", rest) => Ok(Formula::Any(each(rest)?)),
            ("not", [body]) => Ok(Formula::Not(boxed(body)?)),
            ("imply", [first, second]) => {
                Ok(Formula::Implies(Box::new((Formula::read(first)?, Formula::read(second)?))))
            }
            ("forall", [variable, body]) => Ok(Formula::ForAll(Variable::read(variable)?, boxed(body)?)),
            ("exists", [variable, body]) => Ok(Formula::Exists(Variable::read(variable)?, boxed(body)?)),
            ("forn", [n, variable, body]) => Ok(Formula::Exactly(count(n)?, Variable::read(variable)?, boxed(body)?)),
            ("forpairs", [first, second, body]) => {
                Ok(Formula::Pairs(None, Variable::read(first)?, Variable::read(second)?, boxed(body)?))
            }
            ("fornpairs", [n, first, second, body]) => {
                Ok(Formula::Pairs(Some(count(n)?), Variable::read(first)?, Variable::read(second)?, boxed(body)?))
            }
            ("not" | "imply" | "forall" | "exists" | "forn" | "forpairs" | "fornpairs", _) => {
                Err(expression.error(format!("`{head}` has {} arguments, which is not what it takes", rest.len())))
            }
            (_, rest) => {
                let terms = rest.iter().map(|term| Ok(read_term(term.expect_word("an object or a variable")?)));
                Ok(Formula::Literal(Literal::new(head, terms.collect::<Result<_, ExpressionError>>()?)))
            }
        }
    }
    /// The formula with every literal replaced by what `change` makes of it.
    ///
    /// # Errors
    /// The first of `change`.
    pub fn map<E>(&self, change: &mut dyn FnMut(&Literal) -> Result<Formula, E>) -> Result<Formula, E> {
        let mut each = |list: &[Formula]| list.iter().map(|item| item.map(change)).collect::<Result<Vec<_>, E>>();
        Ok(match self {
            Formula::Literal(literal) => change(literal)?,
            Formula::All(list) => Formula::All(each(list)?),
            Formula::Any(list) => Formula::Any(each(list)?),
            Formula::Not(body) => Formula::Not(Box::new(body.map(change)?)),
            Formula::Implies(both) => Formula::Implies(Box::new((both.0.map(change)?, both.1.map(change)?))),
            Formula::ForAll(variable, body) => Formula::ForAll(variable.clone(), Box::new(body.map(change)?)),
            Formula::Exists(variable, body) => Formula::Exists(variable.clone(), Box::new(body.map(change)?)),
            Formula::Exactly(n, variable, body) => Formula::Exactly(*n, variable.clone(), Box::new(body.map(change)?)),
            Formula::Pairs(n, first, second, body) => {
                Formula::Pairs(*n, first.clone(), second.clone(), Box::new(body.map(change)?))
            }
        })
    }
    /// Every literal, in the order in which they stand.
    pub fn literals(&self) -> Vec<&Literal> {
        match self {
            Formula::Literal(literal) => vec![literal],
            Formula::All(list) | Formula::Any(list) => list.iter().flat_map(Formula::literals).collect(),
            Formula::Implies(both) => both.0.literals().into_iter().chain(both.1.literals()).collect(),
            Formula::Not(body)
            | Formula::ForAll(_, body)
            | Formula::Exists(_, body)
            | Formula::Exactly(_, _, body)
            | Formula::Pairs(_, _, _, body) => body.literals(),
        }
    }
}

impl Variable {
    /// Reads `(?x - kind)`; without a kind it runs over everything.
    ///
    /// # Errors
    /// It is written in another way.
    pub fn read(expression: &Expression) -> Result<Variable, ExpressionError> {
        let words: Option<Vec<&str>> = expression.list().map(|list| list.iter().filter_map(Expression::word).collect());
        let (name, kind) = match words.as_deref() {
            Some([name]) => (*name, THING),
            Some([name, "-", kind]) => (*name, *kind),
            _ => return Err(expression.error(format!("(?x - kind) is expected, not `{expression:.60}`"))),
        };
        match name.strip_prefix('?') {
            Some(name) => Ok(Variable { name: name.into(), kind: kind.into() }),
            None => Err(expression.error(format!("a variable begins with `?`: `{name}`"))),
        }
    }
}

fn read_term(word: &str) -> Term {
    match word.strip_prefix('?') {
        Some(name) => Term::Variable(name.into()),
        None => Term::Symbol(word.into()),
    }
}

/// Reads `(3)` or `3`.
fn count(expression: &Expression) -> Result<usize, ExpressionError> {
    let word = match expression.list() {
        Some([one]) => one.word(),
        Some(_) => None,
        None => expression.word(),
    };
    word.and_then(|word| word.parse().ok())
        .ok_or_else(|| expression.error(format!("a number such as (2) is expected, not `{expression:.60}`")))
}

impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "(?{} - {})", self.name, self.kind)
    }
}

impl fmt::Display for Formula {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let joined = |list: &[Formula]| list.iter().map(|item| format!(" {item}")).collect::<String>();
        match self {
            Formula::Literal(literal) => {
                let terms: String = literal.arguments.iter().map(|term| format!(" {term}")).collect();
                match literal.negated {
                    true => write!(f, "(not ({}{terms}))", literal.predicate),
                    false => write!(f, "({}{terms})", literal.predicate),
                }
            }
            Formula::All(list) => write!(f, "(and{})", joined(list)),
            Formula::Any(list) => write!(f, "(or{})", joined(list)),
            Formula::Not(body) => write!(f, "(not {body})"),
            Formula::Implies(both) => write!(f, "(imply {} {})", both.0, both.1),
            Formula::ForAll(variable, body) => write!(f, "(forall {variable} {body})"),
            Formula::Exists(variable, body) => write!(f, "(exists {variable} {body})"),
            Formula::Exactly(n, variable, body) => write!(f, "(forn ({n}) {variable} {body})"),
            Formula::Pairs(None, first, second, body) => write!(f, "(forpairs {first} {second} {body})"),
            Formula::Pairs(Some(n), first, second, body) => write!(f, "(fornpairs ({n}) {first} {second} {body})"),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn every_connective_is_written_as_it_was_read() {
        for text in [
            "(and (on ?a table) (or (open box) (not (open bin))))",
            "(imply (inside ?a ?b) (hand-empty))",
            "(forn (2) (?x - cup) (exists (?y - thing) (on ?x ?y)))",
            "(forpairs (?x - cup) (?y - tray) (on ?x ?y))",
            "(fornpairs (3) (?x - cup) (?y - tray) (on ?x ?y))",
        ] {
            assert_eq!(Formula::parse(text).unwrap().to_string(), text);
        }
        let capitals = Formula::parse("(And (On a b))").unwrap();
        assert_eq!(capitals.to_string(), "(and (On a b))");
    }

    #[test]
    fn what_is_no_formula_is_said() {
        for (text, word) in [
            ("(not a b)", "`not` has 2 arguments"),
            ("(forall ?x (on ?x a))", "(?x - kind) is expected"),
            ("(forn (many) (?x - cup) (open ?x))", "a number such as (2)"),
            ("(on (a) b)", "an object or a variable is expected"),
            ("word", "a formula such as"),
            ("(open a) (open b)", "one formula is expected"),
        ] {
            let error = Formula::parse(text).unwrap_err().to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
