//! State literals and three-valued truth.

use crate::ids::{FrameId, ObjectId, PartId, TransitionId};
use crate::pose::Pose;
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// A spot where an object stands or shall stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// What it rests on, where that is a remembered object; `None` for the bare support surface.
    pub support: Option<ObjectId>,
    /// Pose of the object's base frame (origin at the middle of its bottom, z up) in the world.
    pub pose: Pose,
    /// How far from the spot, seen from above, still counts as there; metres.
    pub tolerance_m: f64,
    /// How far from the pose's heading still counts as there, radians, modulo the object's symmetry; `None` where any
    /// heading does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_tolerance_rad: Option<f64>,
}

/// An argument of a literal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Term {
    /// A remembered object.
    Object(ObjectId),
    /// A part of a remembered object.
    Part(PartId),
    /// A spot in the world.
    Place(Place),
    /// A number, in the predicate's unit.
    Number(f64),
    /// A plain word.
    Symbol(String),
    /// A variable such as `?self`, written in library files and bound when a skill is instantiated.
    Variable(String),
}

/// A predicate over terms, possibly negated. The predicates in use are listed in docs/literals.md.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Literal {
    /// Name, in kebab case: `on`, `at`, `holding`, `hand-empty`, `pressed`, ...
    pub predicate: String,
    /// Arguments in order.
    pub arguments: Vec<Term>,
    /// Whether the literal says that the predicate does not hold.
    pub negated: bool,
}

/// A text that is no literal.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("cannot read `{text}` as a literal ({reason}): write it like `not on(?self, ?support)`")]
pub struct ParseLiteralError {
    text: String,
    reason: &'static str,
}

impl Literal {
    /// A positive literal.
    pub fn new(predicate: &str, arguments: Vec<Term>) -> Literal {
        Literal { predicate: predicate.into(), arguments, negated: false }
    }
    /// The same literal with the opposite sign.
    pub fn negate(mut self) -> Literal {
        self.negated = !self.negated;
        self
    }
    /// Reads `predicate(term, ...)` with an optional leading `not`; terms are ids (`O1`, `P1.0`), numbers,
    /// variables (`?x`) or words.
    ///
    /// ```
    /// # use acm_concept::literal::Literal;
    /// assert_eq!(Literal::parse("not on(?self, O3)").unwrap().to_string(), "not on(?self, O3)");
    /// assert!(Literal::parse("on(?self").is_err());
    /// ```
    pub fn parse(text: &str) -> Result<Literal, ParseLiteralError> {
        let error = |reason| ParseLiteralError { text: text.chars().take(80).collect(), reason };
        let trimmed = text.trim();
        let (negated, body) = match trimmed.strip_prefix("not ") {
            Some(rest) => (true, rest.trim()),
            None => (false, trimmed),
        };
        let (predicate, rest) = body.split_once('(').ok_or_else(|| error("no opening bracket"))?;
        let inner = rest.strip_suffix(')').ok_or_else(|| error("no closing bracket"))?;
        if predicate.is_empty() || !predicate.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-')
        {
            return Err(error("the predicate is not in kebab case"));
        }
        let mut arguments = Vec::new();
        for term in inner.split(',').map(str::trim).filter(|_| !inner.trim().is_empty()) {
            arguments.push(Term::parse(term).ok_or_else(|| error("an argument is empty or has odd characters"))?);
        }
        Ok(Literal { predicate: predicate.into(), arguments, negated })
    }
    /// The literal with every variable replaced by what `bind` gives for its name (without the `?`); variables
    /// for which it gives `None` stay.
    pub fn substitute(&self, bind: &dyn Fn(&str) -> Option<Term>) -> Literal {
        let replace = |term: &Term| match term {
            Term::Variable(name) => bind(name).unwrap_or_else(|| term.clone()),
            other => other.clone(),
        };
        Literal { arguments: self.arguments.iter().map(replace).collect(), ..self.clone() }
    }
    /// Whether no variable is left.
    pub fn is_ground(&self) -> bool {
        !self.arguments.iter().any(|term| matches!(term, Term::Variable(_)))
    }
    /// The first argument, where it is an object.
    pub fn subject(&self) -> Option<ObjectId> {
        match self.arguments.first()? {
            Term::Object(id) => Some(*id),
            Term::Part(part) => Some(part.object),
            _ => None,
        }
    }
}

impl Term {
    fn parse(text: &str) -> Option<Term> {
        if let Some(name) = text.strip_prefix('?') {
            return is_word(name).then(|| Term::Variable(name.into()));
        }
        if let Ok(id) = text.parse() {
            return Some(Term::Object(id));
        }
        if let Ok(id) = text.parse() {
            return Some(Term::Part(id));
        }
        if let Ok(number) = text.parse::<f64>() {
            return number.is_finite().then_some(Term::Number(number));
        }
        is_word(text).then(|| Term::Symbol(text.into()))
    }
}

fn is_word(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
}

impl fmt::Display for Term {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Term::Object(id) => id.fmt(f),
            Term::Part(id) => id.fmt(f),
            Term::Place(place) => {
                let at = place.pose.translation;
                match place.support {
                    Some(support) => write!(f, "({:.3}, {:.3}) on {support}", at.x, at.y),
                    None => write!(f, "({:.3}, {:.3})", at.x, at.y),
                }
            }
            Term::Number(number) => number.fmt(f),
            Term::Symbol(word) => word.fmt(f),
            Term::Variable(name) => write!(f, "?{name}"),
        }
    }
}

impl fmt::Display for Literal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let arguments: Vec<String> = self.arguments.iter().map(Term::to_string).collect();
        let sign = if self.negated { "not " } else { "" };
        write!(f, "{sign}{}({})", self.predicate, arguments.join(", "))
    }
}

/// Whether something holds: memory answers *unknown* wherever it has not looked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Truth {
    /// It holds.
    Yes,
    /// It does not hold.
    No,
    /// Not observed, or not decidable from what was.
    Unknown,
}

impl Truth {
    /// The truth of the negation.
    pub fn negate(self) -> Truth {
        match self {
            Truth::Yes => Truth::No,
            Truth::No => Truth::Yes,
            Truth::Unknown => Truth::Unknown,
        }
    }
}

/// Where a belief comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evidence {
    /// Seen in a frame.
    Frame(FrameId),
    /// Felt or measured by the robot during a transition.
    Transition(TransitionId),
    /// Concluded from other beliefs; says how.
    Inferred(String),
}

/// A three-valued belief in a literal with its evidence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Belief {
    /// Whether it holds.
    pub truth: Truth,
    /// Probability that `truth` is right, 0-1; 0 where it is unknown.
    pub confidence: f64,
    /// What it rests on.
    pub evidence: Vec<Evidence>,
    /// One sentence for a person.
    pub reason: String,
}

impl Belief {
    /// A belief that nothing is known, and why.
    pub fn unknown(reason: impl Into<String>) -> Belief {
        Belief { truth: Truth::Unknown, confidence: 0.0, evidence: Vec::new(), reason: reason.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn substitution_binds_variables_and_keeps_the_rest() {
        let literal = Literal::parse("at(?self, ?destination)").unwrap();
        let bound = literal.substitute(&|name| (name == "self").then_some(Term::Object(ObjectId(2))));
        assert_eq!(bound.to_string(), "at(O2, ?destination)");
        assert!(!bound.is_ground());
        assert_eq!(bound.subject(), Some(ObjectId(2)));
    }

    #[test]
    fn literals_without_arguments_and_with_ids_parse() {
        assert!(Literal::parse("hand-empty()").unwrap().arguments.is_empty());
        assert_eq!(Literal::parse("near(P3.1, 0.25)").unwrap().arguments[1], Term::Number(0.25));
        for bad in ["", "On(O1)", "on(O1,)", "on O1", "on(O1, a b)"] {
            assert!(Literal::parse(bad).is_err(), "{bad}");
        }
    }
}
