//! What memory appended, with what was believed before and after.

use acm_concept::ids::ObjectId;
use acm_concept::literal::{Evidence, Literal};
use acm_memory::{
    Memory, MemoryView,
    entry::{Moment, ObjectEntry, TransitionResult},
    event::{Change, Event, Source},
};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// JSON Schema of the records on `/memory/delta`.
pub(super) const SCHEMA: &str = r#"{
  "$schema": "https://json-schema.org/draft/2020-12/schema",
  "title": "acm.MemoryDelta",
  "description": "One event that memory appended, and what it changed.",
  "type": "object",
  "required": ["seq", "event", "moment", "source", "evidence", "change", "object", "before", "after"],
  "properties": {
    "seq": {"type": "integer", "description": "the message whose handling changed memory"},
    "event": {"type": "integer", "description": "number of the event since memory was opened, from 1"},
    "moment": {"type": "object", "description": "episode of this memory, and virtual time in it"},
    "source": {"description": "camera, robot or agent"},
    "evidence": {"type": "array", "description": "what the change rests on"},
    "change": {"type": "string", "description": "kind of event"},
    "object": {"type": ["string", "null"], "description": "the object concerned, such as O3"},
    "before": {"description": "what was believed of it; null where nothing was"},
    "after": {"description": "what is believed of it from now on; null where nothing is"}
  }
}"#;

/// JSON Schema of the records on `/memory/keyframe`.
pub(super) const KEYFRAME_SCHEMA: &str = r#"{
  "$schema": "https://json-schema.org/draft/2020-12/schema",
  "title": "acm.MemoryKeyframe",
  "description": "All that memory believes at a moment: what the changes before add up to.",
  "type": "object",
  "required": ["seq", "event", "objects", "transitions", "skills", "progress"],
  "properties": {
    "seq": {"type": "integer", "description": "the message whose handling changed memory last; 0 before the first"},
    "event": {"type": "integer", "description": "number of the last event since memory was opened; 0 before the first"},
    "objects": {"type": "object", "description": "each object by its id, as on /memory/delta"},
    "transitions": {"type": "integer", "description": "transitions that memory keeps"},
    "skills": {"type": "integer", "description": "skill entries"},
    "progress": {"type": "object", "description": "where the agent is in its instruction"}
  }
}"#;

/// Most changes between two keyframes.
const KEYFRAME_EVERY: u64 = 64;

/// All that memory believes, as it is written down.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Keyframe {
    seq: u64,
    event: u64,
    objects: BTreeMap<ObjectId, Value>,
    transitions: usize,
    skills: usize,
    progress: Value,
}

/// A change of memory as it is written down.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Delta {
    seq: u64,
    event: u64,
    moment: Moment,
    source: Source,
    evidence: Vec<Evidence>,
    change: &'static str,
    object: Option<ObjectId>,
    before: Value,
    after: Value,
}

/// Turns events into deltas: remembers what each object was when it was last told of.
#[derive(Debug, Default)]
pub(super) struct Deltas {
    known: u64,
    /// Events up to the last keyframe, and whether one is due at once.
    framed: u64,
    turned: bool,
    objects: BTreeMap<ObjectId, Value>,
}

impl Deltas {
    /// Takes note of what a memory that is opened again believes already.
    pub(super) fn begin(&mut self, memory: &dyn Memory) {
        self.known = memory.events_since(u64::MAX).total;
        self.reread(&*memory.view());
    }

    /// What a memory appended since the last call.
    pub(super) fn take(&mut self, seq: u64, memory: &dyn Memory) -> Vec<Delta> {
        let recent = memory.events_since(self.known);
        self.known = recent.total;
        let first = recent.total - recent.events.len() as u64 + 1;
        let view = memory.view();
        recent.events.into_iter().zip(first..).map(|(event, number)| self.delta(seq, number, event, &*view)).collect()
    }

    /// Whether so much changed since the last keyframe that another one is due: many events, or one after which most is
    /// otherwise than before.
    pub(super) fn keyframe_is_due(&self) -> bool {
        self.turned || self.known >= self.framed + KEYFRAME_EVERY
    }

    /// All that memory believes.
    pub(super) fn keyframe(&mut self, seq: u64, memory: &dyn Memory) -> Keyframe {
        (self.framed, self.turned) = (self.known, false);
        let view = memory.view();
        Keyframe {
            seq,
            event: self.known,
            objects: view.objects().iter().map(|entry| (entry.id, short(entry))).collect(),
            transitions: view.transitions().len(),
            skills: view.skills().len(),
            progress: json!(view.progress()),
        }
    }

    fn reread(&mut self, view: &dyn MemoryView) {
        self.objects = view.objects().iter().map(|entry| (entry.id, short(entry))).collect();
    }

    fn delta(&mut self, seq: u64, number: u64, event: Event, view: &dyn MemoryView) -> Delta {
        let (change, object, before, after) = self.change(&event.change, view);
        self.turned |= matches!(change, "instructed" | "subtask-done" | "forgotten" | "regrouped" | "wiped");
        let Event { moment, source, evidence, .. } = event;
        Delta { seq, event: number, moment, source, evidence, change, object, before, after }
    }

    fn change(&mut self, change: &Change, view: &dyn MemoryView) -> (&'static str, Option<ObjectId>, Value, Value) {
        match change {
            Change::EpisodeBegan => {
                self.reread(view);
                ("episode-began", None, Value::Null, Value::Null)
            }
            Change::Instructed { text } => ("instructed", None, Value::Null, json!({ "text": text })),
            Change::SubtaskDone { index } => ("subtask-done", None, Value::Null, json!({ "index": index })),
            Change::Frame(glance) => {
                let visibility: BTreeMap<String, _> =
                    glance.visibility.iter().map(|(id, seen)| (id.to_string(), seen)).collect();
                let after = json!({ "frame": glance.frame, "showed": glance.showed, "hand": glance.hand, "visibility": visibility });
                ("frame", None, Value::Null, after)
            }
            Change::Support(plane) => ("support", None, Value::Null, json!(plane)),
            Change::Object(believed) => {
                let (id, after) = (believed.entry.id, short(&believed.entry));
                let before = self.objects.insert(id, after.clone()).unwrap_or(Value::Null);
                ("object", Some(id), before, after)
            }
            Change::History { object, entry } => {
                let after = json!({
                    "at": entry.place.map(|place| place.pose.translation.to_array()),
                    "on": entry.place.and_then(|place| place.support),
                    "cause": entry.cause,
                    "verified": entry.verified,
                });
                ("history", Some(*object), Value::Null, after)
            }
            Change::Transition(transition) => {
                let after = json!({
                    "transition": transition.id,
                    "skill": transition.skill(),
                    "predicted": words(&transition.predicted),
                    "result": result_words(&transition.result),
                });
                ("transition", Some(transition.object()), Value::Null, after)
            }
            Change::Settled { transition, result, after } => {
                let object = view.transitions().iter().rev().find(|t| t.id == *transition).map(|t| t.object());
                let before = json!({ "transition": transition, "result": "pending" });
                let after = json!({ "transition": transition, "result": result_words(result), "after": words(after) });
                ("settled", object, before, after)
            }
            Change::Skill(skill) => {
                let after = json!({
                    "skill": skill.id,
                    "name": skill.skill,
                    "template": skill.template,
                    "tries": skill.tries,
                    "successes": skill.successes,
                });
                ("skill", None, Value::Null, after)
            }
            Change::TakenBack { transitions, restored } => {
                let after = json!({ "transitions": transitions, "restored": restored });
                ("taken-back", None, Value::Null, after)
            }
            Change::Forgotten(forget) => {
                let before = json!(forget.objects);
                self.reread(view);
                ("forgotten", None, before, json!(forget))
            }
            Change::Regrouped(regrouping) => {
                self.reread(view);
                ("regrouped", None, Value::Null, json!({ "number": regrouping.number, "what": regrouping.what }))
            }
            Change::Compacted(_) => {
                self.reread(view);
                ("compacted", None, Value::Null, Value::Null)
            }
            Change::Wiped(_) => {
                let before = json!(std::mem::take(&mut self.objects).into_keys().collect::<Vec<_>>());
                ("wiped", None, before, Value::Null)
            }
        }
    }
}

/// An object in the few numbers by which a person knows it.
fn short(entry: &ObjectEntry) -> Value {
    json!({
        "category": entry.category,
        "presence": entry.presence,
        "at": entry.pose().map(|pose| pose.translation.to_array()),
        "yaw_deg": entry.pose().map(|pose| pose.yaw().to_degrees()),
        "on": entry.support,
        "verified": entry.verified,
        "confidence": entry.confidence,
        "views": entry.views,
        "state": words(&entry.state),
        "may_be": entry.ambiguous_with,
    })
}

fn words(literals: &[Literal]) -> Vec<String> {
    literals.iter().map(Literal::to_string).collect()
}

fn result_words(result: &TransitionResult) -> String {
    match result {
        TransitionResult::Pending => "pending".into(),
        TransitionResult::Verified => "verified".into(),
        TransitionResult::Failed { cause, reason } => format!("failed ({}): {reason}", cause.word()),
        TransitionResult::CannotTell => "cannot tell".into(),
    }
}
