//! The pure logic of an actor.

use crate::envelope::{Envelope, Role};
use thiserror::Error;

/// Why a core could not handle a message. Domain failures are ordinary replies; this is for broken contracts,
/// after which the actor is restarted.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct CoreError(pub String);

/// An actor's logic: synchronous, over its own state and one message. It has no clock, no randomness and no
/// input or output of its own; what it wants done in the world it asks for by a message to a port.
pub trait Core<M>: Send {
    /// Handles one message; answers and requests go to the outbox and are sent after the call returns.
    fn handle(&mut self, message: Envelope<M>, outbox: &mut Outbox<M>) -> Result<(), CoreError>;
    /// What it keeps between messages, as one JSON document, for the keyframes of a trace; `None` for a core that keeps
    /// nothing. It is asked only where somebody writes it down.
    fn state(&self) -> Option<String> {
        None
    }
}

/// Messages that a core wants sent.
#[derive(Debug)]
pub struct Outbox<M> {
    time_ns: u64,
    messages: Vec<(Role, M)>,
}

impl<M> Outbox<M> {
    /// Most messages that the handling of one message may send.
    pub const LIMIT: usize = 64;

    /// An empty outbox at the given virtual time.
    pub fn new(time_ns: u64) -> Outbox<M> {
        Outbox { time_ns, messages: Vec::new() }
    }
    /// Sends `body` to `to`.
    pub fn send(&mut self, to: Role, body: M) {
        assert!(self.messages.len() < Self::LIMIT, "a core may send {} messages at a time", Self::LIMIT);
        self.messages.push((to, body));
    }
    /// Moves the virtual time forward: for ports, which learn it from the world. It never goes back.
    pub fn advance(&mut self, time_ns: u64) {
        self.time_ns = self.time_ns.max(time_ns);
    }
    /// The virtual time.
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }
    /// What was sent, in order, with the time it was sent at.
    pub fn into_messages(self) -> (u64, Vec<(Role, M)>) {
        (self.time_ns, self.messages)
    }
}
