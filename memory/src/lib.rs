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
//! | [`event`] | the events of which memory is the sum; the log's content |
//! | [`geometry`], [`scene`], [`moves`] | shapes, relations between them, moves read out of a history |
//! | [`inspect`] | small summaries for people and tools |
//! | [`FeltJoint`] | a part's hinge or slide as the hand that moved it felt it |
//!
//! [`AcmMemory`] is the implementation, in memory or over a folder; the library of templates comes from
//! [`default_library`], [`library_of`] some groups or [`library_from_dir`].

mod belief;
mod consolidate;
mod constellation;
mod draft;
pub mod entry;
pub mod event;
mod execute;
mod expect;
mod forgetting;
mod fusion;
pub mod geometry;
mod hand;
mod identity;
pub mod inspect;
mod joint;
mod ledger;
mod library;
mod memory;
pub mod moves;
pub mod observation;
mod observe;
mod project;
pub mod query;
mod recall;
mod recent;
mod redact;
mod regroup;
mod retrieve;
pub mod scene;
mod shown;
mod skill;
#[cfg(any(test, feature = "staging"))]
pub mod staging;
mod state;
#[cfg(test)]
mod tests;
mod traits;
mod view;

pub use acm_store::compact::Compacted;
pub use forgetting::Policy;
pub use hand::HandFeeling;
pub use identity::{IdentityRule, MAX_PERCEPTS};
pub use joint::FeltJoint;
pub use ledger::{FORMAT, open_store, read_events, store_time};
pub use library::{
    CORE, LibraryError, MAX_TEMPLATE_FILES, default_library, library_from_dir, library_groups, library_of,
    whole_library,
};
pub use memory::AcmMemory;
pub use project::{CONCLUSIONS, FRAMES, TRANSITIONS, moment, narrow};
pub use recent::{MAX_RECENT, Recent};
pub use state::{MAX_HISTORY, MAX_OBJECTS, MAX_SKILLS, MAX_TRANSITIONS};
pub use traits::{Memory, MemoryError, MemoryView};
pub use view::Snapshot;
