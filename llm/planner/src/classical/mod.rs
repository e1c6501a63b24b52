//! Classical planning: operators as data, goals with quantifiers, heuristic search. Pure and deterministic.
//!
//! What can be done is a [`Domain`]: operator schemata with conditions and effects, and predicates that follow from others,
//! read from `operators/`. What is wanted is a [`Problem`]. [`plan()`] gives the steps, each with what forced it;
//! [`simulate()`] follows any plan, whoever made it, and says the first condition that is violated.
//!
//! | module | holds |
//! |---|---|
//! | [`sexpr`] | the bracketed text that formulas are written in |
//! | [`formula`] | literals, connectives, quantifiers |
//! | [`domain`], [`problem`] | what can be done; what is wanted, and how often it was tried |
//! | `instance` | a problem in numbers |
//! | [`simulate`](mod@simulate) | plans followed on the operators themselves |
//! | `node`, `ground` | conditions and operators bound to objects |
//! | `relaxed`, `search` | how far it is to the goal; best-first search |
//! | [`plan`](mod@plan) | the steps and their reasons |
//! | [`pddl`] | a problem for other planners, in STRIPS |

pub mod domain;
pub mod formula;
mod ground;
mod instance;
mod node;
pub mod pddl;
pub mod plan;
pub mod problem;
mod relaxed;
mod search;
pub mod sexpr;
pub mod simulate;

pub use domain::{Domain, DomainError};
pub use formula::Formula;
pub use plan::{NoPlan, Plan, Purpose, Step, plan};
pub use problem::{Call, Problem, ProblemError, Tries};
pub use search::Effort;
pub use simulate::{Violation, holds_at_first, simulate};
