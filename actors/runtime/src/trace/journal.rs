//! Messages on their way into a trace.

use super::{Channel, Schema, TraceError, TraceWriter, record};
use crate::{
    envelope::{Envelope, Payload, Role},
    journal::{Handled, Journal, JournalError},
};
use std::{
    collections::BTreeMap,
    fmt::Write,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicU32, Ordering},
    },
    time::{SystemTime, UNIX_EPOCH},
};

/// Routine messages that may wait in memory for their chunk to be closed. All others are handed to the operating
/// system before they are handled.
pub const MAX_HELD: u32 = 64;

const WALL_SCHEMA: &str = r#"{
  "$schema": "https://json-schema.org/draft/2020-12/schema",
  "title": "acm.Wall",
  "description": "Wall-clock times of one handled message. They differ between equal runs.",
  "type": "object",
  "required": ["seq", "actor", "ended_unix_ns", "took_ns"],
  "properties": {
    "seq": {"type": "integer", "minimum": 1, "description": "the message"},
    "actor": {"type": "string", "description": "who handled it"},
    "ended_unix_ns": {"type": "integer", "description": "when its handling ended, nanoseconds since 1970"},
    "took_ns": {"type": "integer", "minimum": 0, "description": "how long it was handled, nanoseconds"}
  }
}"#;

/// Name of the schema of what an actor keeps.
pub const ACTOR_STATE: &str = "acm.ActorState";

const STATE_SCHEMA: &str = r#"{
  "$schema": "https://json-schema.org/draft/2020-12/schema",
  "title": "acm.ActorState",
  "description": "What an actor keeps after a message, wherever that is not what it kept before.",
  "type": "object",
  "required": ["seq", "actor", "state"],
  "properties": {
    "seq": {"type": "integer", "minimum": 1, "description": "the message"},
    "actor": {"type": "string", "description": "who handled it"},
    "state": {"type": "object", "description": "what it keeps from then on"}
  }
}"#;

/// Writes each message to the channel of its receiver and kind before it is handled, and afterwards how long that
/// took. The last message of a crashed run stands without a time.
pub struct TraceJournal {
    writer: Arc<TraceWriter>,
    channels: Mutex<BTreeMap<(Role, &'static str), Channel>>,
    wall: OnceLock<Channel>,
    /// Channel and last state of each actor that has one.
    states: Mutex<BTreeMap<Role, (Channel, String)>>,
    held: AtomicU32,
}

impl TraceJournal {
    /// A journal that writes to `writer`, which stays open for others.
    pub fn new(writer: Arc<TraceWriter>) -> TraceJournal {
        TraceJournal {
            writer,
            channels: Mutex::default(),
            wall: OnceLock::new(),
            states: Mutex::default(),
            held: AtomicU32::new(0),
        }
    }

    fn channel(&self, to: Role, kind: &'static str) -> Result<Channel, TraceError> {
        let mut channels = self.channels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(channel) = channels.get(&(to, kind)) {
            return Ok(*channel);
        }
        let schema = json_schema(record::NAME, record::SCHEMA);
        let channel = self.writer.channel(&record::topic(to.0, kind), &schema)?;
        channels.insert((to, kind), channel);
        Ok(channel)
    }

    /// Writes a state down that is not the actor's last one.
    fn state(&self, handled: &Handled, state: &str) -> Result<(), TraceError> {
        let (seq, by) = (handled.seq, handled.by);
        let mut states = self.states.lock().unwrap_or_else(PoisonError::into_inner);
        let channel = match states.get(&by) {
            Some((_, last)) if last == state => return Ok(()),
            Some((channel, _)) => *channel,
            None => self.writer.channel(&format!("/actor/{by}"), &json_schema(ACTOR_STATE, STATE_SCHEMA))?,
        };
        let text = format!(r#"{{"seq":{seq},"actor":"{by}","state":{state}}}"#);
        self.writer.put(channel, seq, handled.time_ns, text.as_bytes())?;
        states.insert(by, (channel, state.to_owned()));
        Ok(())
    }

    fn wall(&self) -> Result<Channel, TraceError> {
        if let Some(channel) = self.wall.get() {
            return Ok(*channel);
        }
        let channel = self.writer.channel("/wall", &json_schema("acm.Wall", WALL_SCHEMA))?;
        Ok(*self.wall.get_or_init(|| channel))
    }
}

impl<M: Payload> Journal<M> for TraceJournal {
    fn record(&self, message: &Envelope<M>) -> Result<(), JournalError> {
        let bytes = record::encode(message).map_err(|e| JournalError(format!("a message has no JSON: {e}")))?;
        let channel = self.channel(message.to, message.body.kind())?;
        self.writer.put(channel, message.seq, message.time_ns, &bytes)?;
        if message.body.routine() && self.held.fetch_add(1, Ordering::Relaxed) < MAX_HELD {
            return Ok(());
        }
        self.held.store(0, Ordering::Relaxed);
        Ok(self.writer.flush()?)
    }

    fn keeps_states(&self) -> bool {
        true
    }

    fn handled(&self, handled: &Handled) -> Result<(), JournalError> {
        if let Some(state) = &handled.state {
            self.state(handled, state)?;
        }
        if !self.writer.options().wall {
            return Ok(());
        }
        // The one place where a trace reads the clock: the figure stays on a channel of its own.
        #[allow(clippy::disallowed_methods)]
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
        let mut text = String::with_capacity(96);
        let (seq, actor, took) = (handled.seq, handled.by, handled.took.as_nanos());
        let written = write!(text, r#"{{"seq":{seq},"actor":"{actor}","ended_unix_ns":{now},"took_ns":{took}}}"#);
        written.map_err(|e| JournalError(e.to_string()))?;
        Ok(self.writer.put(self.wall()?, seq, handled.time_ns, text.as_bytes())?)
    }
}

impl From<TraceError> for JournalError {
    fn from(error: TraceError) -> Self {
        JournalError(error.to_string())
    }
}

/// A channel of JSON with its schema.
pub fn json_schema<'a>(name: &'a str, schema: &'a str) -> Schema<'a> {
    Schema { name, encoding: "jsonschema", data: schema.as_bytes(), messages: "json" }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;
    use crate::trace::{Item, Record, TraceOptions, TraceReader};
    use std::{path::Path, time::Duration};

    struct Word(&'static str, bool);
    impl Payload for Word {
        fn kind(&self) -> &'static str {
            "word"
        }
        fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
            serde_json::to_vec(self.0)
        }
        fn routine(&self) -> bool {
            self.1
        }
    }

    fn envelope(seq: u64, word: &'static str, routine: bool) -> Envelope<Word> {
        let body = Word(word, routine);
        Envelope { seq, cause: None, episode: 1, from: Role("a"), to: Role("b"), time_ns: seq * 10, body }
    }

    fn write(path: &Path, wall: bool, routine: bool, finish: bool) -> Arc<TraceWriter> {
        let writer = Arc::new(TraceWriter::create(path, TraceOptions { wall, ..TraceOptions::default() }).unwrap());
        let journal = TraceJournal::new(Arc::clone(&writer));
        for seq in 1..=200 {
            journal.record(&envelope(seq, "tick \"tock\"", routine)).unwrap();
            let handled = Handled { seq, by: Role("b"), time_ns: seq * 10, took: Duration::from_nanos(7), state: None };
            Journal::<Word>::handled(&journal, &handled).unwrap();
        }
        if finish {
            writer.finish().unwrap();
        }
        writer
    }

    /// The words of a trace and whether it is cut.
    fn read(path: &Path) -> (Vec<Record>, usize, bool) {
        let mut reader = TraceReader::open(path).unwrap();
        let (mut records, mut walls) = (Vec::new(), 0);
        while let Some(item) = reader.next_item() {
            match item {
                Item::Message(message) if message.topic() == "/wall" => walls += 1,
                Item::Message(message) => records.push(serde_json::from_slice(&message.data).unwrap()),
                _ => {}
            }
        }
        (records, walls, reader.cut().is_some())
    }

    #[test]
    fn every_message_comes_back_in_order_with_its_header() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.mcap");
        write(&path, true, true, true);
        let (records, walls, cut) = read(&path);
        assert_eq!((records.len(), walls, cut), (200, 200, false));
        assert!(records.iter().zip(1..).all(|(r, seq)| r.seq == seq && r.t == seq * 10 && r.to == "b"));
        assert_eq!(records[0].body, "tick \"tock\"");
    }

    #[test]
    fn equal_runs_give_equal_files_where_no_wall_clock_is_kept() {
        let dir = tempfile::tempdir().unwrap();
        let paths = ["1.mcap", "2.mcap"].map(|name| dir.path().join(name));
        for path in &paths {
            write(path, false, true, true);
        }
        let [first, second] = paths.map(|path| std::fs::read(path).unwrap());
        assert_eq!(first, second);
    }

    #[test]
    fn a_process_that_ends_at_once_leaves_all_but_a_few_routine_messages() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.mcap");
        for (routine, least) in [(false, 200), (true, 200 - MAX_HELD as usize)] {
            let writer = write(&path, false, routine, false);
            let now = dir.path().join("copy.mcap");
            // What another process would see while this one is being ended.
            std::fs::copy(&path, &now).unwrap();
            let (records, _, cut) = read(&now);
            assert!(cut && records.len() >= least, "{routine}: {} of 200", records.len());
            writer.finish().unwrap();
        }
    }

    #[test]
    fn a_file_cut_anywhere_is_read_as_far_as_it_goes() {
        let dir = tempfile::tempdir().unwrap();
        let (path, part) = (dir.path().join("t.mcap"), dir.path().join("part.mcap"));
        write(&path, true, false, true);
        let bytes = std::fs::read(&path).unwrap();
        let mut before = 0;
        for end in (0..bytes.len()).step_by(97) {
            std::fs::write(&part, &bytes[..end]).unwrap();
            let Ok(mut reader) = TraceReader::open(&part) else {
                assert!(end < 60, "{end} bytes are enough for a header");
                continue;
            };
            let messages = std::iter::from_fn(|| reader.next_item()).filter(|i| matches!(i, Item::Message(_))).count();
            assert!(messages >= before, "{end} bytes hold {messages} messages, fewer bytes held {before}");
            assert!(reader.cut().is_some(), "{end} of {} bytes are not the whole file", bytes.len());
            before = messages;
        }
        assert_eq!(before, 400);
    }
}
