//! What a plan is asked for: objects, what holds at first, the goal, and what is known of earlier tries.

use super::formula::{Formula, THING};
use acm_concept::literal::{Literal, Term};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};
use thiserror::Error;

/// Most objects of a problem.
pub const MAX_OBJECTS: usize = 2000;
/// Most literals that hold at first.
pub const MAX_FACTS: usize = 50_000;

/// Objects with their kinds, what holds at first, and the goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// The objects by name, each with its types and what it affords.
    pub objects: BTreeMap<String, BTreeSet<String>>,
    /// What holds at first; nothing else does. Positive literals over the objects.
    pub init: Vec<Literal>,
    /// What shall hold in the end.
    pub goal: Formula,
    /// Tries of an operator on its first argument, by both their names. What was never tried is expected to succeed every second time.
    pub experience: BTreeMap<(String, String), Tries>,
}

/// How often something was tried, and how often it succeeded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tries {
    /// Tries so far.
    pub tries: u32,
    /// Successes so far.
    pub successes: u32,
}

/// A problem that cannot be planned for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ProblemError {
    /// More objects or facts than are taken.
    #[error("the problem has {number} {what}; at most {limit} are taken")]
    TooLarge {
        /// Objects or facts.
        what: &'static str,
        /// How many there are.
        number: usize,
        /// How many are taken.
        limit: usize,
    },
    /// A name that no object has.
    #[error("{literal} names `{object}`, which is none of the objects")]
    UnknownObject {
        /// Where it stands.
        literal: String,
        /// The name.
        object: String,
    },
    /// A variable that nothing quantifies.
    #[error("?{variable} in {literal} is quantified by nothing")]
    Unbound {
        /// Where it stands.
        literal: String,
        /// Its name.
        variable: String,
    },
    /// What holds at first is no fact.
    #[error("{literal} cannot hold at first: {problem}")]
    Fact {
        /// The literal.
        literal: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A predicate with a number of arguments that it has not.
    #[error("{literal} has {found} arguments; {expected} are expected")]
    Arity {
        /// Where it stands.
        literal: String,
        /// How many it has.
        found: usize,
        /// How many the predicate has elsewhere, or at most.
        expected: usize,
    },
    /// More ways to bind the operators than are considered.
    #[error("`{operator}` can be bound in more than {limit} ways: fewer objects or narrower kinds are needed")]
    TooManyActions {
        /// The operator.
        operator: String,
        /// How many are considered.
        limit: usize,
    },
    /// A condition that falls into too many cases.
    #[error("the condition of `{name}` falls into more than {limit} cases")]
    TooManyCases {
        /// Operator or derived predicate.
        name: String,
        /// How many are considered.
        limit: usize,
    },
}

/// An operator with its arguments: one step of a plan.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Call {
    /// Name of the operator.
    pub operator: String,
    /// The objects that its parameters stand for.
    pub arguments: Vec<String>,
}

impl Problem {
    /// A problem without experience.
    pub fn new(objects: BTreeMap<String, BTreeSet<String>>, init: Vec<Literal>, goal: Formula) -> Problem {
        Problem { objects, init, goal, experience: BTreeMap::new() }
    }
    /// What a step costs: one, and more the less often it succeeds: the negative logarithm of the expected share of
    /// successes, (successes + 1) / (tries + 2), as skill memory has it.
    pub fn cost(&self, call: &Call) -> f64 {
        let tried =
            call.arguments.first().and_then(|first| self.experience.get(&(call.operator.clone(), first.clone())));
        match tried {
            Some(Tries { tries, successes }) => {
                1.0 - (f64::from(successes + 1) / f64::from(tries.max(successes) + 2)).ln()
            }
            None => 1.0 + std::f64::consts::LN_2,
        }
    }
    /// Whether an object is of a kind.
    pub fn is(&self, object: &str, kind: &str) -> bool {
        self.objects.get(object).is_some_and(|kinds| kind == THING || kinds.contains(kind))
    }
}

/// The name that a term stands for in a problem.
pub(super) fn name_of(term: &Term) -> String {
    match term {
        Term::Variable(name) => format!("?{name}"),
        other => other.to_string(),
    }
}

impl fmt::Display for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}({})", self.operator, self.arguments.join(", "))
    }
}
