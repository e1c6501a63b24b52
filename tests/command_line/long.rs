//! A trace of many steps, made of one run told again and again, with names that would like to be markup.

use acm_runtime::trace::{Channel, Item, Schema, TraceOptions, TraceReader, TraceWriter, reader::TraceMessage};
use serde_json::Value;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

/// What stands in the place of the scenario's name and of an actor's.
pub const HOSTILE: &str = "</script><img src=x onerror=\"document.title='owned'\">";
/// Ticks of a skill that are kept.
const TICKS: usize = 12;

/// One record, still with its old numbers.
struct Record {
    topic: String,
    schema: String,
    time_ns: u64,
    data: Vec<u8>,
    value: Option<Value>,
}

/// Writes the run `times` times into one trace in `folder`.
pub fn write(run: &Path, folder: &Path, times: u64) -> PathBuf {
    let (records, about) = read(run);
    let path = folder.join("long.mcap");
    let mut long = Long {
        writer: Arc::new(TraceWriter::create(&path, TraceOptions::default()).unwrap()),
        channels: BTreeMap::new(),
    };
    long.writer.metadata("acm.run", about.into_iter().chain([("scenario".into(), HOSTILE.into())]).collect()).unwrap();
    let seqs: Vec<u64> =
        records.iter().filter(|r| r.schema == "acm.Message").map(|r| number(r, "seq").unwrap()).collect();
    let frames = records.iter().filter(|record| record.topic == "/effect/frame").count() as u64;
    let events = records.iter().filter_map(|record| number(record, "event")).max().unwrap();
    let end = records.iter().map(|record| record.time_ns).max().unwrap() + 1;
    for time in 0..times {
        // A message that was left out is stood for by the last one before it.
        let seq = |old: u64| time * seqs.len() as u64 + seqs.partition_point(|seq| *seq <= old) as u64;
        for record in &records {
            long.put(record, |value| shift(value, &seq, time * frames, time * events, time * end), time * end);
        }
    }
    let last = times * seqs.len() as u64;
    for (seq, from, to, kind, body) in
        [(last + 1, "planner", "llm", "ask-llm", asked()), (last + 2, "llm", "planner", "llm-replied", replied())]
    {
        let value = serde_json::json!({
            "seq": seq, "cause": seq - 1, "episode": 1, "from": from, "to": to, "kind": kind, "t": times * end, "body": body
        });
        let topic = format!("/{to}/{kind}");
        let record = Record { topic, schema: "acm.Message".into(), time_ns: 0, data: Vec::new(), value: Some(value) };
        long.put(&record, |_| (), times * end);
    }
    long.writer.finish().unwrap();
    path
}

fn asked() -> Value {
    serde_json::json!({ "request": {
        "stage": "parse", "prompt": { "id": "parse", "version": 1 }, "system": "Be brief.",
        "turns": [{ "who": "user", "parts": [{ "text": "Say </script> & <b>bold</b>" }] }],
        "schema": {}, "parameters": { "max_output_tokens": 9 },
    }})
}

fn replied() -> Value {
    serde_json::json!({ "reply": {
        "text": "I say so.", "reasoning": "<i>hm</i>", "usage": { "input": 7, "output": 3, "reasoning": 0, "cached": 0 },
        "end": "complete", "backend": "test", "model": "test",
    }})
}

fn read(run: &Path) -> (Vec<Record>, BTreeMap<String, String>) {
    let mut reader = TraceReader::open(run).unwrap();
    let (mut records, mut about, mut ticks) = (Vec::new(), BTreeMap::new(), 0);
    while let Some(item) = reader.next_item() {
        match item {
            Item::Metadata { name, values } if name == "acm.run" => about = values,
            Item::Message(message) => {
                let record = record(message);
                let kind = record.value.as_ref().and_then(|value| value["kind"].as_str());
                ticks = if matches!(kind, Some("command" | "moved")) {
                    ticks + 1
                } else if kind.is_some() {
                    0
                } else {
                    ticks
                };
                let kept = ["acm.Message", "acm.Effect", "acm.MemoryDelta"].contains(&record.schema.as_str())
                    || record.topic.ends_with("/thumbnail");
                if kept && (ticks <= TICKS || kind.is_none()) {
                    records.push(record);
                }
            }
            _ => {}
        }
    }
    (records, about)
}

fn record(message: TraceMessage) -> Record {
    let value = serde_json::from_slice(&message.data).ok();
    let (topic, schema) = (message.topic().to_owned(), message.channel.schema.clone());
    Record { topic, schema, time_ns: message.time_ns, data: message.data, value }
}

fn number(record: &Record, name: &str) -> Option<u64> {
    record.value.as_ref()?.get(name)?.as_u64()
}

/// Gives a record the numbers of another repetition.
fn shift(value: &mut Value, seq: &impl Fn(u64) -> u64, frames: u64, events: u64, time_ns: u64) {
    for (name, by) in [("t", time_ns), ("event", events)] {
        if let Some(number) = value.get(name).and_then(Value::as_u64) {
            value[name] = (number + by).into();
        }
    }
    for name in ["seq", "cause"] {
        if let Some(number) = value.get(name).and_then(Value::as_u64) {
            value[name] = seq(number).into();
        }
    }
    if value.get("from").and_then(Value::as_str) == Some("outside") {
        value["from"] = HOSTILE.into();
    }
    rename_frames(value, frames);
}

fn rename_frames(value: &mut Value, by: u64) {
    match value {
        Value::String(text) => {
            if let Some(number) = text.strip_prefix('F').and_then(|number| number.parse::<u64>().ok()) {
                *text = format!("F{}", number + by);
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| rename_frames(item, by)),
        Value::Object(fields) => fields.values_mut().for_each(|item| rename_frames(item, by)),
        _ => {}
    }
}

struct Long {
    writer: Arc<TraceWriter>,
    channels: BTreeMap<String, Channel>,
}

impl Long {
    fn put(&mut self, record: &Record, change: impl Fn(&mut Value), time_ns: u64) {
        let json = record.value.is_some();
        let encoding = if json { ("jsonschema", "json") } else { ("protobuf", "protobuf") };
        let schema = Schema { name: &record.schema, encoding: encoding.0, data: b"{}", messages: encoding.1 };
        let writer = &self.writer;
        let channel = self
            .channels
            .entry(record.topic.clone())
            .or_insert_with(|| writer.channel(&record.topic, &schema).unwrap());
        let bytes = match record.value.clone() {
            Some(mut value) => {
                change(&mut value);
                serde_json::to_vec(&value).unwrap()
            }
            None => record.data.clone(),
        };
        self.writer.put(*channel, 0, record.time_ns + time_ns, &bytes).unwrap();
    }
}
