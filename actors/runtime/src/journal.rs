//! Where messages are written down before they are handled.

use crate::envelope::{Envelope, Payload, Role};
use std::{
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};
use thiserror::Error;

/// A message that could not be written down.
#[derive(Debug, Error)]
#[error("the journal cannot be written: {0}")]
pub struct JournalError(pub String);

/// A message whose handler has returned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Handled {
    /// Number of the message.
    pub seq: u64,
    /// Who handled it.
    pub by: Role,
    /// Virtual time of its sending, nanoseconds.
    pub time_ns: u64,
    /// Wall time that its handler took.
    pub took: Duration,
    /// What the handler's actor keeps from then on, as JSON: where the journal keeps states, the actor has one, and the
    /// message is none of a long series.
    pub state: Option<String>,
}

/// Takes every delivered message before its handler runs, so that the last entry of a crashed run is the culprit.
pub trait Journal<M>: Send + Sync {
    /// Writes one message down.
    fn record(&self, message: &Envelope<M>) -> Result<(), JournalError>;
    /// Whether it wants to know what actors keep between messages.
    fn keeps_states(&self) -> bool {
        false
    }
    /// Is told that a message was handled. Wall time differs between equal runs: whoever keeps it keeps it apart.
    fn handled(&self, _: &Handled) -> Result<(), JournalError> {
        Ok(())
    }
}

/// Writes to two journals, one after the other.
pub struct Both<M>(pub Arc<dyn Journal<M>>, pub Arc<dyn Journal<M>>);

impl<M: Send> Journal<M> for Both<M> {
    fn record(&self, message: &Envelope<M>) -> Result<(), JournalError> {
        self.0.record(message)?;
        self.1.record(message)
    }
    fn keeps_states(&self) -> bool {
        self.0.keeps_states() || self.1.keeps_states()
    }
    fn handled(&self, handled: &Handled) -> Result<(), JournalError> {
        self.0.handled(handled)?;
        self.1.handled(handled)
    }
}

/// Writes nothing.
#[derive(Debug, Default, Clone, Copy)]
pub struct NoJournal;

impl<M> Journal<M> for NoJournal {
    fn record(&self, _: &Envelope<M>) -> Result<(), JournalError> {
        Ok(())
    }
}

/// One line of a [`MemoryJournal`]: what two equal runs have in common.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Number of the message.
    pub seq: u64,
    /// The message that caused it.
    pub cause: Option<u64>,
    /// Sender.
    pub from: Role,
    /// Receiver.
    pub to: Role,
    /// Kind of body.
    pub kind: &'static str,
    /// Virtual time, nanoseconds.
    pub time_ns: u64,
    /// Body as JSON.
    pub body: Vec<u8>,
}

/// Keeps messages in memory, to compare runs.
#[derive(Debug, Default, Clone)]
pub struct MemoryJournal {
    entries: Arc<Mutex<Vec<Entry>>>,
}

impl MemoryJournal {
    /// What was written so far.
    pub fn entries(&self) -> Vec<Entry> {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl<M: Payload> Journal<M> for MemoryJournal {
    fn record(&self, message: &Envelope<M>) -> Result<(), JournalError> {
        let entry = Entry {
            seq: message.seq,
            cause: message.cause,
            from: message.from,
            to: message.to,
            kind: message.body.kind(),
            time_ns: message.time_ns,
            body: message.body.to_json().map_err(|e| JournalError(e.to_string()))?,
        };
        self.entries.lock().unwrap_or_else(PoisonError::into_inner).push(entry);
        Ok(())
    }
}
