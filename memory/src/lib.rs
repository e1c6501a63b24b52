//! Six linked memories round analytic concepts: semantic library, template library, object memory, scene
//! memory, transition memory and skill memory (paper, section "Analytic Concept Memory").
//!
//! A plain library: no actors, no async, no simulator. The agent writes through [`Memory`] and reads through
//! immutable [`MemoryView`]s; other memories implement the same two traits to be compared with this one.
//!
//! | module | holds |
//! |---|---|
//! | [`entry`] | what the dynamic memories store: objects with history, transitions, skills, task progress |
//! | [`observation`] | what memory is told, and what it answers about identities |
//! | [`query`] | what memory can be asked, and its answers with their reasons |

pub mod entry;
pub mod observation;
pub mod query;
mod traits;

pub use traits::{Memory, MemoryError, MemoryView};
