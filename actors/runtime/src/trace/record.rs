//! What is written of a message.

use crate::envelope::{Envelope, Payload};
use serde::{Deserialize, Serialize};
use std::io::Write;

/// Name of the schema of message records.
pub const NAME: &str = "acm.Message";
/// JSON Schema of message records.
pub const SCHEMA: &str = r#"{
  "$schema": "https://json-schema.org/draft/2020-12/schema",
  "title": "acm.Message",
  "description": "A message between two actors, written before it was handled.",
  "type": "object",
  "required": ["seq", "cause", "episode", "from", "to", "kind", "t", "body"],
  "properties": {
    "seq": {"type": "integer", "minimum": 1, "description": "number in the order of sending, without gaps"},
    "cause": {"type": ["integer", "null"], "description": "seq of the message whose handling sent this one"},
    "episode": {"type": "integer", "minimum": 0},
    "from": {"type": "string", "description": "sender; `outside` is whoever started the run"},
    "to": {"type": "string", "description": "receiver"},
    "kind": {"type": "string", "description": "which message it is"},
    "t": {"type": "integer", "minimum": 0, "description": "virtual time, nanoseconds since the episode began"},
    "body": {"description": "the message's content; its form depends on the kind"}
  }
}"#;

/// A message as a trace keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Number in the order of sending, from 1 and without gaps.
    pub seq: u64,
    /// The message whose handling sent this one.
    pub cause: Option<u64>,
    /// The episode.
    pub episode: u32,
    /// Sender.
    pub from: String,
    /// Receiver.
    pub to: String,
    /// Kind of body.
    pub kind: String,
    /// Virtual time, nanoseconds.
    pub t: u64,
    /// The body.
    pub body: serde_json::Value,
}

/// The topic of a kind of message: its receiver and its kind.
pub fn topic(to: &str, kind: &str) -> String {
    format!("/{to}/{kind}")
}

/// A message as the bytes of a [`Record`]. The body is written once and copied as it stands.
pub fn encode<M: Payload>(message: &Envelope<M>) -> Result<Vec<u8>, serde_json::Error> {
    let body = message.body.to_json()?;
    let mut bytes = Vec::with_capacity(body.len() + 160);
    let text = |text: &str| serde_json::to_string(text);
    let cause = message.cause.map_or_else(|| "null".to_owned(), |cause| cause.to_string());
    let written = write!(
        bytes,
        r#"{{"seq":{},"cause":{cause},"episode":{},"from":{},"to":{},"kind":{},"t":{},"body":"#,
        message.seq,
        message.episode,
        text(message.from.0)?,
        text(message.to.0)?,
        text(message.body.kind())?,
        message.time_ns
    );
    written.map_err(serde_json::Error::io)?;
    bytes.extend_from_slice(&body);
    bytes.push(b'}');
    Ok(bytes)
}
