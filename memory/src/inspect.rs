//! Small summaries of a memory for people and tools: what `acm memory stats` and `history` print.

use crate::{
    entry::{HistoryEntry, Presence, TransitionResult},
    geometry::Body,
    scene,
    traits::MemoryView,
};
use acm_concept::{ids::ObjectId, literal::Literal};
use serde::Serialize;

/// How much a memory holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stats {
    /// Layout of this summary.
    pub schema: &'static str,
    /// Objects, whatever their whereabouts.
    pub objects: usize,
    /// Objects confirmed by two views or an own action.
    pub verified: usize,
    /// Objects in the hand.
    pub held: usize,
    /// Objects whose whereabouts are unknown.
    pub missing: usize,
    /// Objects that may be another one.
    pub ambiguous: usize,
    /// Entries of all histories.
    pub history_entries: usize,
    /// Transitions.
    pub transitions: usize,
    /// Transitions that were verified.
    pub transitions_verified: usize,
    /// Transitions that failed.
    pub transitions_failed: usize,
    /// Skill entries.
    pub skills: usize,
    /// Subtasks of the instruction that are done.
    pub subtasks_done: usize,
    /// Frames of the present run that showed something.
    pub frames_seen: u32,
}

/// Counts what a memory holds.
pub fn stats(view: &dyn MemoryView) -> Stats {
    let objects = view.objects();
    let with = |presence| objects.iter().filter(|entry| entry.presence == presence).count();
    let results = || view.transitions().iter().map(|transition| &transition.result);
    Stats {
        schema: "acm.memory-stats/1",
        objects: objects.len(),
        verified: objects.iter().filter(|entry| entry.verified).count(),
        held: with(Presence::Held),
        missing: with(Presence::Missing),
        ambiguous: objects.iter().filter(|entry| !entry.ambiguous_with.is_empty()).count(),
        history_entries: objects.iter().map(|entry| entry.history.len()).sum(),
        transitions: view.transitions().len(),
        transitions_verified: results().filter(|result| **result == TransitionResult::Verified).count(),
        transitions_failed: results().filter(|result| matches!(result, TransitionResult::Failed { .. })).count(),
        skills: view.skills().len(),
        subtasks_done: view.progress().done.len(),
        frames_seen: view.frames_seen(),
    }
}

/// One object in a few words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectSummary {
    /// Its id.
    pub object: ObjectId,
    /// Its most likely category.
    pub category: String,
    /// Longer side, shorter side and height, metres; `None` where its template is not in the library.
    pub size_m: Option<[f64; 3]>,
    /// Middle of its base, world frame, metres; `None` without parts.
    pub position_m: Option<[f64; 3]>,
    /// Whether it is there, held or missing.
    pub presence: Presence,
    /// What it rests on.
    pub support: Option<ObjectId>,
    /// Probability that it exists as described.
    pub confidence: f64,
    /// Whether two views or an own action confirmed it.
    pub verified: bool,
    /// Where it was, oldest first.
    pub history: Vec<HistoryEntry>,
}

/// One line an object, in the order of ids.
pub fn objects(view: &dyn MemoryView) -> Vec<ObjectSummary> {
    let summary = |entry: &crate::entry::ObjectEntry| ObjectSummary {
        object: entry.id,
        category: entry.category.clone(),
        size_m: Body::of(&entry.parts, view.library()).map(|body| body.extents()),
        position_m: entry.pose().map(|pose| pose.translation.to_array()),
        presence: entry.presence,
        support: entry.support,
        confidence: entry.confidence,
        verified: entry.verified,
        history: entry.history.clone(),
    };
    view.objects().iter().map(summary).collect()
}

/// The scene graph's edges between present objects.
pub fn relations(view: &dyn MemoryView) -> Vec<Literal> {
    scene::relations(view.objects(), view.library())
}
