//! From language and memory to goals and verified steps: the planner `rules`.
//!
//! Deterministic, synchronous, without state of its own: [`Planner::decide`] reads everything from a
//! [`MemoryView`](acm_memory::MemoryView). It knows no task, no scenario and no object by name; verbs, colours and
//! phrases are data in `lexicon/`, nouns and skills come from the template library.
//!
//! | module | holds |
//! |---|---|
//! | [`language`] | instruction to [`Task`]: words, phrases, clauses, anaphora |
//! | [`hybrid`] | the same by a language model: what it is asked, and a task out of its answer |
//! | [`lexicon`] | the data that the language rules run on |
//! | [`task`] | goals over references |
//! | `ground` | references to objects and places, against memory |
//! | `search` | means-ends search over the skills that memory offers |
//! | `decide` | the order of questions before each step; groups one by one, trials, searches; limits |
//! | [`classical`] | planning over operators that are data: goals with quantifiers, heuristic search, plans that are checked |
//! | [`counsel`] | decisions about which a language model may be asked: which way to take, how to go on after a failure |
//! | [`bind`] | a step with perceived geometry, ready for a controller |
//! | [`decision`], [`explanation`] | the answers and their reasons |

pub mod bind;
pub mod classical;
pub mod counsel;
mod decide;
pub mod decision;
pub mod explanation;
mod ground;
pub mod hybrid;
pub mod language;
pub mod lexicon;
mod planner;
mod prompt_file;
mod search;
pub mod task;

pub use bind::BindError;
pub use counsel::{Choice, Question};
pub use decision::{Decision, GiveUpCause, PlanOptions, Situation, Step, Unknown};
pub use explanation::{Explanation, Grounds, Rejected, ResolvedReference};
pub use hybrid::TaskPrompt;
pub use language::ParseError;
pub use lexicon::{Lexicon, LexiconError};
pub use planner::{Planner, embedded_lexicon};
pub use task::{Condition, Destination, Goal, ObjectReference, Span, Subtask, Task, Times};
