//! A trace read back.

use super::recording::{RESULT, RUN};
use acm_actors::trace::viewer;
use acm_concept::literal::Evidence;
use acm_runtime::trace::{Item, Record, TraceReader, journal::ACTOR_STATE, reader::TraceMessage, record};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, path::Path};

/// Most bytes of message bodies that are held at a time; of a larger trace the rest is left out, and that is said.
const MAX_HELD_BYTES: usize = 1 << 30;

/// A message's header.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Header {
    /// Number.
    pub seq: u64,
    /// The message that caused it.
    pub cause: Option<u64>,
    /// Sender.
    pub from: String,
    /// Receiver.
    pub to: String,
    /// Kind.
    pub kind: String,
    /// Virtual time, nanoseconds.
    pub t: u64,
}

/// A message of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Its header.
    pub header: Header,
    /// One line for a person.
    pub line: String,
    raw: Vec<u8>,
}

impl Entry {
    /// A message from the bytes of its record; none for bytes of another form.
    pub fn parse(raw: Vec<u8>) -> Option<Entry> {
        let header = serde_json::from_slice::<Header>(&raw).ok()?;
        Some(Entry { header, line: String::new(), raw })
    }
    /// All of it.
    pub fn record(&self) -> anyhow::Result<Record> {
        Ok(serde_json::from_slice(&self.raw)?)
    }
    /// The bytes as they were written.
    pub fn raw(&self) -> &[u8] {
        &self.raw
    }
    /// Virtual time, seconds.
    pub fn seconds(&self) -> f64 {
        self.header.t as f64 * 1e-9
    }
}

/// A change of memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Delta {
    /// The message whose handling changed memory.
    pub seq: u64,
    /// Number of the event since memory was opened, from 1.
    pub event: u64,
    /// What the change rests on.
    pub evidence: Vec<Evidence>,
    /// Kind of event.
    pub change: String,
    /// The object concerned.
    pub object: Option<String>,
    /// What was believed.
    pub before: serde_json::Value,
    /// What is believed from now on.
    pub after: serde_json::Value,
}

/// Something that came from outside: a frame, a random draw, a model's reply.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// What came: the end of its topic, such as `frame`.
    pub kind: String,
    /// The message whose handling asked for it.
    pub seq: u64,
    /// The record.
    pub record: serde_json::Value,
}

/// What an actor keeps from a message on.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ActorState {
    /// The message.
    pub seq: u64,
    /// The actor.
    pub actor: String,
    /// What it keeps.
    pub state: serde_json::Value,
}

/// All that memory believes after a message.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Keyframe {
    /// The message; 0 before the first.
    pub seq: u64,
    /// Number of the last event since memory was opened.
    pub event: u64,
    /// Each object by its id.
    pub objects: BTreeMap<String, serde_json::Value>,
}

/// A trace as far as it could be read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RunFile {
    /// What was run.
    pub about: BTreeMap<String, String>,
    /// How it ended; empty where the run did not come to its end.
    pub result: BTreeMap<String, String>,
    /// The messages in the order of their numbers.
    pub entries: Vec<Entry>,
    /// Changes of memory, in order.
    pub deltas: Vec<Delta>,
    /// What came from outside, in order.
    pub effects: Vec<Effect>,
    /// What actors keep between messages, in order.
    pub states: Vec<ActorState>,
    /// What memory believes, in order.
    pub keyframes: Vec<Keyframe>,
    /// Size of the file.
    pub bytes: u64,
    /// Messages on all channels.
    pub messages: u64,
    /// Why it ends too early, if it does.
    pub cut: Option<String>,
}

impl RunFile {
    /// Reads a trace. What was cut off is missing and said; a file that is no trace is an error.
    pub fn read(path: &Path) -> anyhow::Result<RunFile> {
        let mut reader = TraceReader::open(path)?;
        let mut run = RunFile { bytes: reader.bytes(), ..RunFile::default() };
        let (mut lines, mut held) = (BTreeMap::new(), 0);
        while let Some(item) = reader.next_item() {
            match item {
                Item::Metadata { name, values } if name == RUN => run.about = values,
                Item::Metadata { name, values } if name == RESULT => run.result = values,
                Item::Metadata { .. } | Item::Attachment { .. } => {}
                Item::Message(message) => {
                    run.messages += 1;
                    held += message.data.len();
                    if held > MAX_HELD_BYTES {
                        run.cut = Some(format!("only the first {} messages are shown", run.messages));
                        break;
                    }
                    run.take(message, &mut lines);
                }
            }
        }
        run.cut = run.cut.or_else(|| reader.cut().map(str::to_owned));
        run.entries.sort_by_key(|entry| entry.header.seq);
        for entry in &mut run.entries {
            entry.line = lines.remove(&entry.header.seq).unwrap_or_default();
        }
        Ok(run)
    }

    /// Takes over what is shown; frames, transforms and the like are for viewers.
    fn take(&mut self, message: TraceMessage, lines: &mut BTreeMap<u64, String>) {
        match message.channel.schema.as_str() {
            record::NAME => self.entries.extend(Entry::parse(message.data)),
            "acm.MemoryDelta" => self.deltas.extend(serde_json::from_slice::<Delta>(&message.data)),
            "acm.Effect" => self.effects.extend(effect(&message)),
            ACTOR_STATE => self.states.extend(serde_json::from_slice::<ActorState>(&message.data)),
            "acm.MemoryKeyframe" => self.keyframes.extend(serde_json::from_slice::<Keyframe>(&message.data)),
            "foxglove.Log" => lines.extend(viewer::read_line(&message.data)),
            _ => {}
        }
    }

    /// A value of what is known of the run; `?` where it is not.
    pub fn about(&self, name: &str) -> &str {
        self.about.get(name).map_or("?", String::as_str)
    }

    /// What each actor that keeps something kept when a message came to be handled.
    pub fn states_before(&self, seq: u64) -> BTreeMap<&str, &ActorState> {
        let before = self.states.iter().filter(|state| state.seq < seq);
        before.map(|state| (state.actor.as_str(), state)).collect()
    }

    /// The message of a number.
    pub fn entry(&self, seq: u64) -> Option<&Entry> {
        self.entries.get(self.entries.binary_search_by_key(&seq, |entry| entry.header.seq).ok()?)
    }

    /// The message of a number, which somebody asked for.
    pub fn asked(&self, seq: u64) -> anyhow::Result<&Entry> {
        self.entry(seq).with_context(|| match (self.entries.first(), self.entries.last()) {
            (Some(first), Some(last)) => {
                format!("there is no message {seq}: the trace has {} to {}", first.header.seq, last.header.seq)
            }
            _ => format!("there is no message {seq}: the trace has no message"),
        })
    }

    /// How the run ended: what the result says, else what the last message shows.
    pub fn ending(&self) -> String {
        let result = |name: &str| self.result.get(name).cloned();
        if let Some(ending) = result("ending") {
            return match result("solved").as_deref() {
                Some("true") => "solved".into(),
                _ if ending == "done" => "done, NOT SOLVED".into(),
                _ => ending,
            };
        }
        if let Some(error) = result("error") {
            return format!("error: {error}");
        }
        match self.entries.last() {
            Some(last) => format!("ends at message {} ({})", last.header.seq, last.header.kind),
            None => "no message".into(),
        }
    }
}

fn effect(message: &TraceMessage) -> Option<Effect> {
    let record: serde_json::Value = serde_json::from_slice(&message.data).ok()?;
    let kind = message.topic().rsplit('/').next().unwrap_or_default().to_owned();
    Some(Effect { kind, seq: record.get("seq")?.as_u64()?, record })
}
