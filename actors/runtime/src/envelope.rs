//! What every message carries beside its body.

use serde::Serialize;
use std::fmt;

/// The stable name of an actor, which is also its address. Actor ids of the underlying library are never
/// written down, since they differ between runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct Role(pub &'static str);

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

/// The address of whoever started the system: what is sent there leaves it.
pub const OUTSIDE: Role = Role("outside");

/// A message body.
pub trait Payload: Send + 'static {
    /// The kind, by which traces are filtered.
    fn kind(&self) -> &'static str;
    /// The body as one JSON document.
    fn to_json(&self) -> Result<Vec<u8>, serde_json::Error>;
    /// Whether it is one of a long series, such as control ticks. A journal may hold a few of these back in memory;
    /// all others it hands to the operating system before they are handled.
    fn routine(&self) -> bool {
        false
    }
}

/// A delivered message.
#[derive(Debug)]
pub struct Envelope<M> {
    /// Number in the order of sending, from 1 and without gaps.
    pub seq: u64,
    /// The message whose handling sent this one; `None` for messages from outside.
    pub cause: Option<u64>,
    /// The episode it belongs to.
    pub episode: u32,
    /// Sender.
    pub from: Role,
    /// Receiver.
    pub to: Role,
    /// Virtual time of sending, nanoseconds since the episode began.
    pub time_ns: u64,
    /// The body.
    pub body: M,
}
