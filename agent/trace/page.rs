//! The viewer: a trace as one HTML page that asks for nothing from outside.
//!
//! | file | holds |
//! |---|---|
//! | [`plan`] | what the page tells of each step |
//! | `page/page.html`, `page/style.css` | the page's frame and looks |
//! | `page/model.js` | the data, put in order |
//! | `page/timeline.js` | the lanes, the strip of the whole run |
//! | `page/panels.js` | frame, memory, plan, why, message, model |
//! | `page/control.js` | selection, links, search, keys, light and dark |

pub mod plan;

use super::{
    calls::{self, CallRow},
    decision, picture,
    run_file::{Entry, RunFile},
    show,
    sight::{self, Seen, Sight},
    why::Inquiry,
};
use crate::embed;
use acm_concept::{camera::Intrinsics, ids::FrameId, pose::Pose};
use plan::Step;
use serde::Serialize;
use serde_json::Value;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

/// The page without its data.
const TEMPLATE: &str = concat!(
    include_str!("page/page.html"),
    "<style>\n",
    include_str!("page/style.css"),
    "</style>\n</head>\n",
    include_str!("page/body.html"),
    "<script type=\"application/json\" id=\"data\">{{DATA}}</script>\n<script>\n\"use strict\";\n",
    include_str!("page/model.js"),
    include_str!("page/timeline.js"),
    include_str!("page/panels.js"),
    include_str!("page/control.js"),
    "</script>\n</body>\n</html>\n"
);
/// Most bytes of message bodies on the page; further ones are named and left out.
const MAX_BODY_BYTES: usize = 48 << 20;
/// Most bytes of pictures on the page; further ones are named and left out.
const MAX_PICTURE_BYTES: usize = 48 << 20;
/// Width of pictures that are made of full frames, pixels.
const PICTURE_WIDTH: u32 = 480;
/// Longer lists of numbers, such as the runs of a mask, are counted and not shown.
const MAX_NUMBERS: usize = 32;

/// What the page shows.
#[derive(Debug, Serialize)]
pub struct Page {
    schema: &'static str,
    run: BTreeMap<String, String>,
    result: BTreeMap<String, String>,
    ending: String,
    cut: Option<String>,
    /// What was left out to keep the page at a size that a browser bears.
    left_out: Vec<String>,
    rows: Vec<Row>,
    steps: Vec<Step>,
    frames: Vec<FrameRow>,
    changes: Vec<ChangeRow>,
    calls: Vec<CallRow>,
}

/// A message, or many that take turns.
#[derive(Debug, Serialize)]
struct Row {
    seq: u64,
    last: u64,
    cause: Option<u64>,
    from: String,
    to: String,
    kind: String,
    t: f64,
    line: String,
    body: Option<Value>,
}

#[derive(Debug, Serialize)]
struct FrameRow {
    id: FrameId,
    seq: u64,
    updated: Option<u64>,
    camera: String,
    t: f64,
    intrinsics: Intrinsics,
    pose: Pose,
    seen: Vec<Seen>,
    /// Objects that were expected and not seen, with what the frame says of them.
    unseen: Vec<(String, &'static str)>,
    blindness: Option<String>,
    same_as: Option<FrameId>,
    picture: Option<String>,
}

/// A change of memory that a person would see.
#[derive(Debug, Serialize)]
struct ChangeRow {
    seq: u64,
    event: u64,
    change: String,
    object: Option<String>,
    after: Value,
    words: String,
}

impl Page {
    /// Reads a trace.
    ///
    /// # Errors
    /// It cannot be read, or is no trace.
    pub fn read(trace: &Path) -> anyhow::Result<Page> {
        let run = RunFile::read(trace)?;
        let inquiry = Inquiry::new(&run);
        let mut left_out = Vec::new();
        let mut frames: BTreeMap<FrameId, FrameRow> =
            inquiry.sights().iter().map(|(id, sight)| (*id, frame_row(sight))).collect();
        pictures(trace, &mut frames, &mut left_out)?;
        Ok(Page {
            schema: "acm.trace-page/1",
            rows: rows(&run, &mut left_out),
            steps: plan::steps(&run, &inquiry)?,
            frames: frames.into_values().collect(),
            changes: changes(&run, &inquiry),
            calls: calls::calls(&run.entries)?.into_iter().map(CallRow::from).collect(),
            ending: run.ending(),
            left_out,
            run: run.about,
            result: run.result,
            cut: run.cut,
        })
    }

    /// Why the trace ends too early, if it does.
    pub fn cut(&self) -> Option<&str> {
        self.cut.as_deref()
    }

    /// The page as text.
    ///
    /// # Errors
    /// The data has no JSON.
    pub fn html(&self) -> anyhow::Result<String> {
        Ok(embed::fill(TEMPLATE, &serde_json::to_string(self)?))
    }
}

/// The messages; long series of two that take turns, such as a skill's ticks, are one row without bodies.
fn rows(run: &RunFile, left_out: &mut Vec<String>) -> Vec<Row> {
    let entries: Vec<&Entry> = run.entries.iter().collect();
    let (mut rows, mut at, mut bytes, mut without) = (Vec::new(), 0, 0, None);
    while let Some(first) = entries.get(at) {
        let length = show::series(entries.get(at..).unwrap_or_default());
        let length = if length < show::FOLD_FROM { 1 } else { length };
        let last = entries.get(at + length - 1).unwrap_or(first);
        let mut row = row(first, last, length);
        if length > 1 {
            let kinds: BTreeSet<&str> =
                entries.iter().skip(at).take(2).map(|entry| entry.header.kind.as_str()).collect();
            row.kind = kinds.into_iter().collect::<Vec<_>>().join(", ");
        } else if bytes + first.raw().len() <= MAX_BODY_BYTES {
            row.body = first.record().ok().map(|record| slim(record.body));
            bytes += first.raw().len();
        } else {
            without.get_or_insert(first.header.seq);
        }
        rows.push(row);
        at += length;
    }
    left_out
        .extend(without.map(|seq| format!("bodies of messages from {seq} on: `acm trace show FILE --seq N` has them")));
    rows
}

fn row(first: &Entry, last: &Entry, length: usize) -> Row {
    let header = &first.header;
    let line = if length > 1 { format!("{length} messages; {}", last.line) } else { first.line.clone() };
    Row {
        seq: header.seq,
        last: last.header.seq,
        cause: header.cause,
        from: header.from.clone(),
        to: header.to.clone(),
        kind: header.kind.clone(),
        t: first.seconds(),
        line,
        body: None,
    }
}

/// A body as it is read by a person: numbers with five decimals, long lists of numbers counted.
fn slim(value: Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => {
            number.as_f64().map_or(Value::Null, |number| Value::from((number * 1e5).round() / 1e5 + 0.0))
        }
        Value::Array(items) if items.len() > MAX_NUMBERS && items.iter().all(Value::is_number) => {
            Value::String(format!("({} numbers)", items.len()))
        }
        Value::Array(items) => items.into_iter().map(slim).collect(),
        Value::Object(fields) => fields.into_iter().map(|(name, value)| (name, slim(value))).collect(),
        plain => plain,
    }
}

fn frame_row(sight: &Sight) -> FrameRow {
    let header = &sight.header;
    let unseen = sight.expected.iter().filter(|(object, _)| sight.of(*object).is_none());
    FrameRow {
        id: header.id,
        seq: sight.seq,
        updated: sight.updated,
        camera: header.camera.clone(),
        t: header.time.seconds(),
        intrinsics: header.intrinsics,
        pose: header.camera_pose,
        seen: sight.seen.clone(),
        unseen: unseen.map(|(object, visibility)| (object.to_string(), sight::visibility_word(*visibility))).collect(),
        blindness: sight.blindness.clone(),
        same_as: sight.same_as,
        picture: None,
    }
}

fn pictures(trace: &Path, frames: &mut BTreeMap<FrameId, FrameRow>, left_out: &mut Vec<String>) -> anyhow::Result<()> {
    let (mut bytes, mut without) = (0, 0_usize);
    picture::each(trace, |frame, picture| {
        let Some(row) = frames.get_mut(&frame) else { return Ok(()) };
        let (media_type, picture) = picture.shown(PICTURE_WIDTH)?;
        bytes += picture.len();
        match bytes <= MAX_PICTURE_BYTES {
            true => row.picture = Some(embed::data_uri(media_type, &picture)),
            false => without += 1,
        }
        Ok(())
    })?;
    if without > 0 {
        left_out.push(format!(
            "{without} pictures: `acm trace why FILE SEQ --crops FOLDER` cuts what it needs out of them"
        ));
    }
    Ok(())
}

fn changes(run: &RunFile, inquiry: &Inquiry<'_>) -> Vec<ChangeRow> {
    let mut rows: Vec<ChangeRow> = Vec::new();
    for change in inquiry.beliefs().all() {
        let Some(words) = &change.words else { continue };
        let delta = change.delta;
        rows.push(ChangeRow {
            seq: delta.seq,
            event: delta.event,
            change: delta.change.clone(),
            object: delta.object.clone(),
            after: slim(delta.after.clone()),
            words: words.clone(),
        });
    }
    let of_none = run.deltas.iter().filter(|delta| delta.object.is_none());
    rows.extend(of_none.filter_map(|delta| {
        Some(ChangeRow {
            seq: delta.seq,
            event: delta.event,
            change: delta.change.clone(),
            object: None,
            after: slim(delta.after.clone()),
            words: decision::delta_words(delta)?,
        })
    }));
    rows.sort_by_key(|row| row.event);
    rows
}
