//! A trace as trace events of Chrome: Perfetto and `chrome://tracing` draw it.
//!
//! The clock is that of the run's wall time, since virtual time stands still while the agent thinks; virtual time stands
//! beside each message. Each actor is a track, each handled message a slice as long as its handling took, and each cause
//! an arrow from the slice in which a message was sent to the slice in which it was handled.

use crate::trace::run_file::{Entry, RunFile};
use acm_runtime::trace::{Item, TraceReader};
use serde::Deserialize;
use serde_json::{Value, json};
use std::{collections::BTreeMap, io::Write, path::Path};

/// When and how long each message was handled, by its number.
pub type Took = BTreeMap<u64, Wall>;

/// A record on `/wall`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub struct Wall {
    seq: u64,
    ended_unix_ns: u64,
    took_ns: u64,
}

/// Reads how long everything took.
///
/// # Errors
/// The trace cannot be read.
pub fn wall(trace: &Path) -> anyhow::Result<Took> {
    let mut reader = TraceReader::open(trace)?;
    let mut took = Took::new();
    while let Some(item) = reader.next_item() {
        if let Item::Message(message) = item
            && message.topic() == "/wall"
            && let Ok(wall) = serde_json::from_slice::<Wall>(&message.data)
        {
            took.insert(wall.seq, wall);
        }
    }
    Ok(took)
}

/// When the first message was handled, nanoseconds since 1970.
pub fn begun(took: &Took) -> Option<u64> {
    took.values().map(|wall| wall.ended_unix_ns.saturating_sub(wall.took_ns)).min()
}

/// How long the handling of a message took, nanoseconds.
pub fn took_ns(took: &Took, seq: u64) -> Option<u64> {
    Some(took.get(&seq)?.took_ns)
}

/// Writes the events as one JSON object.
///
/// # Errors
/// They cannot be written.
pub fn write(run: &RunFile, took: &Took, out: &mut dyn Write) -> anyhow::Result<()> {
    let clock = Clock { took, begun: begun(took).unwrap_or(0) };
    let mut tracks: BTreeMap<&str, usize> = BTreeMap::new();
    for entry in &run.entries {
        let next = tracks.len() + 1;
        tracks.entry(&entry.header.to).or_insert(next);
    }
    let mut events = vec![
        json!({ "ph": "M", "pid": 1, "name": "process_name", "args": { "name": format!("{} seed {}", run.about("scenario"), run.about("seed")) } }),
    ];
    events.extend(tracks.iter().map(
        |(actor, track)| json!({ "ph": "M", "pid": 1, "tid": track, "name": "thread_name", "args": { "name": actor } }),
    ));
    let mut last_us = 0.0;
    for entry in &run.entries {
        let track = tracks.get(entry.header.to.as_str()).copied().unwrap_or(0);
        let slice = clock.slice(entry.header.seq).unwrap_or((last_us, 0.0));
        last_us = slice.0 + slice.1;
        events.push(event(entry, track, slice, took.contains_key(&entry.header.seq)));
        let cause = entry.header.cause.and_then(|cause| Some((cause, clock.slice(cause)?)));
        let sender = tracks.get(entry.header.from.as_str());
        if let (Some((_, (began, length))), Some(sender)) = (cause, sender) {
            let flow = |phase: &str, track: usize, at: f64| json!({ "ph": phase, "bp": "e", "cat": "cause", "name": "cause", "id": entry.header.seq, "pid": 1, "tid": track, "ts": at });
            // Within the slice: an arrow that begins at its very end belongs to none.
            events.push(flow("s", *sender, began + 0.999 * length));
            events.push(flow("f", track, slice.0));
        }
    }
    let whole = json!({
        "displayTimeUnit": "ms",
        "otherData": { "run": run.about, "result": run.result, "clock": "wall time since the first message" },
        "traceEvents": events,
    });
    serde_json::to_writer(&mut *out, &whole).map_err(std::io::Error::from)?;
    Ok(())
}

struct Clock<'a> {
    took: &'a Took,
    begun: u64,
}

impl Clock<'_> {
    /// When a message's handling began and how long it took, microseconds.
    fn slice(&self, seq: u64) -> Option<(f64, f64)> {
        let wall = self.took.get(&seq)?;
        let began = wall.ended_unix_ns.saturating_sub(wall.took_ns).saturating_sub(self.begun);
        Some((began as f64 * 1e-3, wall.took_ns as f64 * 1e-3))
    }
}

fn event(entry: &Entry, track: usize, (began, length): (f64, f64), handled: bool) -> Value {
    let header = &entry.header;
    let mut event = json!({
        "ph": "X", "pid": 1, "tid": track, "ts": began, "dur": length, "cat": header.from, "name": header.kind,
        "args": { "seq": header.seq, "cause": header.cause, "virtual_s": entry.seconds(), "line": entry.line },
    });
    if !handled && let Some(fields) = event.as_object_mut() {
        // What was sent and never handled to its end has no length: it is a mark.
        fields.insert("ph".into(), "i".into());
        fields.insert("s".into(), "t".into());
        fields.remove("dur");
    }
    event
}
