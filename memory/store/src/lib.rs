//! The engine under memory. It knows ids, symbols, columns and bytes; what they mean is its caller's.
//!
//! What is true is a log of [`Event`]s: each says when it was so, where it comes from, how sure that is and what it
//! rests on, and holds the [`Op`]s that it makes. Everything else is derived from the log by one function,
//! [`State::apply`]: columns and bitsets in blocks, the space index, the chains of changes, relations and regions.
//!
//! | module | holds |
//! |---|---|
//! | [`disk`], [`log`], [`manifest`] | files, records, segments, commits; which files count |
//! | [`event`], [`symbols`] | the schema: events, operations, words |
//! | [`block`], [`page`], [`cow`], [`table`] | columns and bitsets, copied when they are written while a reader has them |
//! | [`history`] | chains of changes: `as_of(valid, known)`, histories, Allen's relations |
//! | [`space`] | the nearest things |
//! | [`relation`], [`region`] | what is related to what; what was searched when |
//! | [`query`], [`execute`], [`explain`] | what can be asked, how it is answered, and why so |
//! | [`condition`], [`fork`] | what holds: yes, no or unknown; what would hold |
//! | [`snapshot`], [`store`] | one writer, readers that never wait |
//! | [`forget`], [`compact`] | what must leave no byte behind, and what nobody will ask for |

pub mod block;
pub mod chain;
pub mod compact;
pub mod condition;
pub mod cow;
pub mod disk;
pub mod event;
pub mod execute;
pub mod explain;
pub mod forget;
pub mod fork;
pub mod history;
pub mod log;
pub mod manifest;
pub mod map;
pub mod page;
pub mod query;
pub mod region;
pub mod relation;
pub mod snapshot;
pub mod space;
pub mod state;
pub mod store;
pub mod symbols;
pub mod table;
#[cfg(any(test, feature = "testing"))]
pub mod testing;

pub use condition::{Condition, Truth};
pub use event::{Event, Evidence, Object, Op, Part, Sure};
pub use query::{Hit, Query};
pub use state::State;
pub use store::{Reader, Store, StoreError};
pub use symbols::{Kind, Symbol};

/// An object's number. Ids are given by the caller, without large gaps, and never twice.
pub type Id = u32;
/// Largest id.
pub const MAX_ID: Id = (1 << 28) - 1;
/// Nanoseconds on the caller's own time axis.
pub type Nanos = u64;
/// No object.
pub const NONE: Id = u32::MAX;
