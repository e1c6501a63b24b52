//! The trace: every message of a run, and whatever else its writer wants kept, in one MCAP file.
//!
//! The file is described in docs/trace.md. This crate knows bytes only: the crate above says what a body means, what
//! effects there are and which other channels it writes.
//!
//! | module | holds |
//! |---|---|
//! | [`writer`] | the file being written: channels, limits, flushing, the end |
//! | [`record`] | what is written of a message, as JSON with a schema |
//! | [`journal`] | a [`Journal`](crate::journal::Journal) that writes messages ahead of their handling |
//! | [`reader`] | reads a file from its beginning as far as it goes |

pub mod journal;
pub mod reader;
pub mod record;
pub mod writer;

pub use journal::TraceJournal;
pub use reader::{Item, TraceReadError, TraceReader};
pub use record::Record;
pub use writer::{Channel, Schema, TraceError, TraceOptions, TraceWriter};

/// The BLAKE3 hash of some bytes, in hexadecimal.
///
/// ```
/// assert!(acm_runtime::trace::hash(b"").starts_with("af1349b9f5f9a1a6"));
/// ```
pub fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}
