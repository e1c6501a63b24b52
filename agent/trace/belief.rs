//! What memory believed of each object at any message, and the changes by which it came to that.

use super::{
    decision,
    run_file::{Delta, Keyframe, RunFile},
};
use acm_concept::{
    ids::{FrameId, ObjectId, TransitionId},
    literal::Evidence,
};
use serde_json::Value;
use std::collections::BTreeMap;

/// The changes of a run's memory by object.
#[derive(Debug, Default)]
pub struct Beliefs<'a> {
    of: BTreeMap<ObjectId, Vec<Change<'a>>>,
    keyframes: &'a [Keyframe],
}

/// A change of what is believed of an object.
#[derive(Debug, Clone)]
pub struct Change<'a> {
    /// As it was written.
    pub delta: &'a Delta,
    /// In a line; none where a person would see no difference from the last change that has one.
    pub words: Option<String>,
}

impl<'a> Beliefs<'a> {
    /// Puts a run's changes in order.
    pub fn new(run: &'a RunFile) -> Beliefs<'a> {
        let mut of: BTreeMap<ObjectId, Vec<Change<'a>>> = BTreeMap::new();
        let mut shown: BTreeMap<ObjectId, &Value> = BTreeMap::new();
        for delta in &run.deltas {
            let Some(object) = delta.object.as_deref().and_then(|id| id.parse().ok()) else { continue };
            let words = if delta.change == "object" {
                // Compared with what was told last, so that a slow drift is told too.
                let before = shown.get(&object).copied().unwrap_or(&delta.before);
                let words = match before.is_null() {
                    true => Some(format!("new {object} {}", entry_words(&delta.after))),
                    false => decision::delta_words(&Delta { before: before.clone(), ..delta.clone() }),
                };
                if words.is_some() {
                    shown.insert(object, &delta.after);
                }
                words
            } else {
                decision::delta_words(delta)
            };
            of.entry(object).or_default().push(Change { delta, words });
        }
        Beliefs { of, keyframes: &run.keyframes }
    }

    /// All changes, object by object.
    pub fn all(&self) -> impl Iterator<Item = &Change<'a>> {
        self.of.values().flatten()
    }

    /// The changes of an object before a message, oldest first.
    pub fn before(&self, object: ObjectId, seq: u64) -> &[Change<'a>] {
        let changes = self.of.get(&object).map_or(&[][..], Vec::as_slice);
        changes.get(..changes.partition_point(|change| change.delta.seq < seq)).unwrap_or_default()
    }

    /// What was believed of an object just before a message; none where the trace does not say.
    pub fn at(&self, object: ObjectId, seq: u64) -> Option<&'a Value> {
        let changes = self.before(object, seq);
        let changed = changes.iter().rev().find(|change| change.delta.change == "object");
        changed.map(|change| &change.delta.after).or_else(|| self.framed(object, seq))
    }

    /// What the last keyframe before a message says of an object: it may have been known before the trace began.
    fn framed(&self, object: ObjectId, seq: u64) -> Option<&'a Value> {
        let before = self.keyframes.get(..self.keyframes.partition_point(|keyframe| keyframe.seq < seq))?;
        before.last()?.objects.get(&object.to_string())
    }

    /// Whether memory knew an object before the trace began: then frames of an earlier run may stand behind it.
    pub fn inherited(&self, object: ObjectId) -> bool {
        let first = self.of.get(&object).and_then(|changes| changes.iter().find(|c| c.delta.change == "object"));
        first.is_none_or(|change| !change.delta.before.is_null())
    }

    /// The change that wrote a transition down.
    pub fn transition(&self, id: TransitionId, seq: u64) -> Option<(ObjectId, &Change<'a>)> {
        let name = id.to_string();
        let is = |change: &Change<'_>| {
            change.delta.change == "transition" && change.delta.after.get("transition") == Some(&Value::from(&*name))
        };
        self.of.keys().find_map(|&object| Some((object, self.before(object, seq).iter().find(|change| is(change))?)))
    }
}

impl Change<'_> {
    /// The frames on which it rests.
    pub fn frames(&self) -> impl Iterator<Item = FrameId> {
        self.delta.evidence.iter().filter_map(|evidence| match evidence {
            Evidence::Frame(frame) => Some(*frame),
            _ => None,
        })
    }
}

/// A believed place, world frame, metres.
pub fn place(entry: &Value) -> Option<glam::DVec3> {
    serde_json::from_value(entry.get("at")?.clone()).ok()
}

/// An entry in a line: category, presence, place, support, state, confidence.
pub fn entry_words(entry: &Value) -> String {
    let text = |name: &str| entry.get(name).and_then(Value::as_str);
    let mut words: Vec<String> =
        ["category", "presence"].iter().filter_map(|name| text(name)).map(Into::into).collect();
    words.extend(place(entry).map(|at| format!("at ({:.3}, {:.3}, {:.3})", at.x + 0.0, at.y + 0.0, at.z + 0.0)));
    words.extend(text("on").map(|on| format!("on {on}")));
    let state = entry.get("state").and_then(Value::as_array).into_iter().flatten();
    words.extend(state.filter_map(Value::as_str).map(Into::into));
    words.extend(match entry.get("verified").and_then(Value::as_bool) {
        Some(true) => Some("verified".to_owned()),
        Some(false) => Some("NOT VERIFIED".to_owned()),
        None => None,
    });
    words.extend(entry.get("confidence").and_then(Value::as_f64).map(|value| format!("confidence {value:.2}")));
    let may_be = entry.get("may_be").and_then(Value::as_array).filter(|list| !list.is_empty());
    words.extend(may_be.map(|list| format!("may be {}", decision::shortened(&Value::Array(list.clone())))));
    words.join(", ")
}
