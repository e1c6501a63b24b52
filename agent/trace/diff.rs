//! `acm trace diff`: where two runs part.
//!
//! Two traces are equal when their ordered lists of (topic, virtual time, bytes) are, without `/wall`, the metadata and
//! the attachments. The first pair that differs is told, field by field, with what memory had become in each.

use super::run_file::{Entry, RunFile};
use crate::cli::{Exit, trace::TraceDiffArgs};
use acm_runtime::trace::{Item, TraceReader, reader::TraceMessage, record};
use serde::Serialize;
use serde_json::Value;
use std::{
    collections::BTreeSet,
    io::{self, Write},
    path::Path,
};

/// Most fields that are told of a message.
const MAX_FIELDS: usize = 20;
/// Longest value that is told, characters.
const MAX_VALUE: usize = 120;
/// The channel on which equal runs differ.
const WALL: &str = "/wall";

/// Runs `acm trace diff`.
pub fn run(args: &TraceDiffArgs) -> anyhow::Result<Exit> {
    let found = first_difference(&args.a, &args.b)?;
    let out = &mut io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut *out, &found)?;
        writeln!(out)?;
    } else {
        match &found {
            None => writeln!(out, "equal")?,
            Some(difference) => {
                tell(difference, out)?;
                memory(&args.a, &args.b, difference, out)?;
            }
        }
    }
    Ok(if found.is_none() { Exit::Success } else { Exit::Failed })
}

/// The first place where two traces differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// How many records were equal before it.
    pub equal_before: u64,
    /// What stands there in the first trace; `None` where it has ended.
    pub a: Option<Side>,
    /// What stands there in the second trace.
    pub b: Option<Side>,
    /// The fields that differ, where both have a record of the same topic.
    pub fields: Vec<FieldDifference>,
}

/// A record of a trace.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Side {
    /// Its topic.
    pub topic: String,
    /// Virtual time, nanoseconds.
    pub time_ns: u64,
    /// Number of the message that it is, or that caused it; 0 where it says none.
    pub seq: u64,
}

/// A field that differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldDifference {
    /// JSON pointer to it.
    pub field: String,
    /// Its value in the first trace.
    pub a: Value,
    /// Its value in the second.
    pub b: Value,
}

/// Compares two traces record by record.
///
/// # Errors
/// A file is no trace, or is cut: what is missing cannot be compared.
pub fn first_difference(a: &Path, b: &Path) -> anyhow::Result<Option<Difference>> {
    let (mut first, mut second) = (Compared::open(a)?, Compared::open(b)?);
    let mut equal_before = 0;
    loop {
        let (a, b) = (first.next()?, second.next()?);
        match (a, b) {
            (None, None) => return Ok(None),
            (Some(a), Some(b)) if a.topic() == b.topic() && a.time_ns == b.time_ns && a.data == b.data => {
                equal_before += 1;
            }
            (a, b) => {
                let fields = match (&a, &b) {
                    (Some(a), Some(b)) if a.topic() == b.topic() => field_differences(&a.data, &b.data),
                    _ => Vec::new(),
                };
                let side = |message: &TraceMessage| Side {
                    topic: message.topic().into(),
                    time_ns: message.time_ns,
                    seq: u64::from(message.sequence),
                };
                return Ok(Some(Difference { equal_before, a: a.as_ref().map(side), b: b.as_ref().map(side), fields }));
            }
        }
    }
}

/// The records of a trace that equal runs have in common.
struct Compared {
    reader: TraceReader,
    name: String,
}

impl Compared {
    fn open(path: &Path) -> anyhow::Result<Compared> {
        Ok(Compared { reader: TraceReader::open(path)?, name: path.display().to_string() })
    }
    fn next(&mut self) -> anyhow::Result<Option<TraceMessage>> {
        while let Some(item) = self.reader.next_item() {
            match item {
                Item::Message(message) if message.topic() != WALL => return Ok(Some(message)),
                _ => {}
            }
        }
        match self.reader.cut() {
            None => Ok(None),
            Some(cut) => anyhow::bail!("{}: {cut}; `acm trace repair` keeps what stands before", self.name),
        }
    }
}

/// The fields in which two JSON texts differ, in the order of the first; none for what is no JSON.
pub fn field_differences(a: &[u8], b: &[u8]) -> Vec<FieldDifference> {
    let (Ok(a), Ok(b)) = (serde_json::from_slice::<Value>(a), serde_json::from_slice::<Value>(b)) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    walk(String::new(), &a, &b, &mut found);
    found
}

fn walk(at: String, a: &Value, b: &Value, found: &mut Vec<FieldDifference>) {
    if a == b {
        return;
    }
    match (a, b) {
        (Value::Object(first), Value::Object(second)) => {
            let names: BTreeSet<&String> = first.keys().chain(second.keys()).collect();
            for name in names {
                let escaped = name.replace('~', "~0").replace('/', "~1");
                let value = |of: &serde_json::Map<String, Value>| of.get(name).cloned().unwrap_or(Value::Null);
                walk(format!("{at}/{escaped}"), &value(first), &value(second), found);
            }
        }
        (Value::Array(first), Value::Array(second)) => {
            for index in 0..first.len().max(second.len()) {
                let value = |of: &[Value]| of.get(index).cloned().unwrap_or(Value::Null);
                walk(format!("{at}/{index}"), &value(first), &value(second), found);
            }
        }
        _ => found.push(FieldDifference { field: at, a: a.clone(), b: b.clone() }),
    }
}

/// Tells a difference in words.
pub fn tell(difference: &Difference, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "they part after {} equal records", difference.equal_before)?;
    for (name, side) in [("A", &difference.a), ("B", &difference.b)] {
        match side {
            Some(side) => {
                let seconds = side.time_ns as f64 * 1e-9;
                writeln!(out, "  {name}  {:<28} message {:<6} t {seconds:.2} s", side.topic, side.seq)?;
            }
            None => writeln!(out, "  {name}  has ended")?,
        }
    }
    tell_fields(&difference.fields, out)
}

/// Tells the fields that differ, the first of them if there are many.
pub fn tell_fields(fields: &[FieldDifference], out: &mut impl Write) -> io::Result<()> {
    for field in fields.iter().take(MAX_FIELDS) {
        writeln!(out, "  {}: {} -> {}", field.field, shortened(&field.a), shortened(&field.b))?;
    }
    match fields.len().saturating_sub(MAX_FIELDS) {
        0 => Ok(()),
        more => writeln!(out, "  and {more} further fields"),
    }
}

fn shortened(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(MAX_VALUE) {
        Some((end, _)) => format!("{}...", text.get(..end).unwrap_or_default()),
        None => text,
    }
}

/// What each run's memory did at the message where they part, and the messages round it.
fn memory(a: &Path, b: &Path, difference: &Difference, out: &mut impl Write) -> anyhow::Result<()> {
    for (name, path, side) in [("A", a, &difference.a), ("B", b, &difference.b)] {
        let Some(side) = side else { continue };
        let run = RunFile::read(path)?;
        let seq = match run.entries.iter().find(|entry| is_at(entry, side)) {
            Some(entry) => entry.header.seq,
            None => side.seq,
        };
        let round = run.entries.iter().filter(|entry| entry.header.seq + 2 >= seq && entry.header.seq <= seq + 1);
        for entry in round {
            let header = &entry.header;
            writeln!(out, "  {name}  {:>6}  {} -> {}  {}", header.seq, header.from, header.to, entry.line)?;
        }
        let changes = run.deltas.iter().filter(|delta| delta.seq + 1 >= seq && delta.seq <= seq);
        for delta in changes.filter_map(super::decision::delta_words) {
            writeln!(out, "  {name}  memory  {delta}")?;
        }
    }
    Ok(())
}

fn is_at(entry: &Entry, side: &Side) -> bool {
    record::topic(&entry.header.to, &entry.header.kind) == side.topic && entry.header.seq == side.seq
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_that_differ_are_pointed_at() {
        let a = br#"{"x": 1, "y": {"a/b": [1, 2]}, "z": null}"#;
        let b = br#"{"x": 1, "y": {"a/b": [1, 3, 4]}, "w": true}"#;
        let found: Vec<String> = field_differences(a, b).into_iter().map(|field| field.field).collect();
        assert_eq!(found, ["/w", "/y/a~1b/1", "/y/a~1b/2"]);
        assert!(field_differences(a, a).is_empty() && field_differences(b"no", b"json").is_empty());
    }
}
