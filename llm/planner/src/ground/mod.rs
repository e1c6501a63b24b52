//! References of a task grounded in memory: phrases to objects and places, with the reasons kept.

mod carrier;
mod described;
pub(crate) mod geometry;
mod group;
mod history;
mod object;
mod part;
mod place;

use crate::{
    decision::{GiveUpCause, PlanOptions, Unknown},
    explanation::ResolvedReference,
    lexicon::Lexicon,
    task::{ReferenceIndex, Task},
};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Term, Truth},
    pose::Pose,
    template::Template,
};
use acm_memory::{
    MemoryView,
    entry::{Moment, ObjectEntry, Presence},
};
use std::{
    cell::{Cell, RefCell},
    collections::BTreeMap,
};

pub(crate) use carrier::{carrying_centre, like_places, slots, surface_under};
pub(crate) use history::place_at;

/// Confidence from which a thing was clearly seen, though once.
const CLEARLY_SEEN: f64 = 0.4;
/// How far from a destination still counts as there, metres.
pub(crate) const PLACE_TOLERANCE_M: f64 = 0.03;
/// How far from a wanted heading still counts as right, radians.
pub(crate) const HEADING_TOLERANCE_RAD: f64 = 0.26;
/// Descriptions within descriptions that are followed.
const MAX_DEPTH: u32 = 6;

/// Why a reference has no answer.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stuck {
    /// Whether another look may help.
    pub look: bool,
    /// Whether a thing is not there to be seen: something may hide it.
    pub absent: bool,
    /// What to say if it does not.
    pub unknown: Unknown,
}

impl Stuck {
    pub fn look(cause: GiveUpCause, text: String) -> Stuck {
        Stuck { look: true, absent: false, unknown: Unknown { cause, text } }
    }
    /// A thing is not there to be seen.
    pub fn absent(text: String) -> Stuck {
        Stuck { look: true, absent: true, unknown: Unknown { cause: GiveUpCause::Perception, text } }
    }
    pub fn give_up(cause: GiveUpCause, text: String) -> Stuck {
        Stuck { look: false, absent: false, unknown: Unknown { cause, text } }
    }
}

/// An answer with whether it was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Meant<T> {
    pub value: T,
    pub guessed: bool,
}

/// Grounds the references of one task in one view; keeps what it found for the explanation.
pub(crate) struct Grounder<'a> {
    pub lexicon: &'a Lexicon,
    pub task: &'a Task,
    pub view: &'a dyn MemoryView,
    pub options: &'a PlanOptions,
    /// Whether another look may still be taken.
    pub may_look: bool,
    /// Whether what is asked about was moved earlier in the same subtask because the subtask asks for that.
    pub moved_before: Cell<bool>,
    found: RefCell<Vec<ResolvedReference>>,
    /// The members of groups whose turn it is.
    turns: RefCell<BTreeMap<ReferenceIndex, ObjectId>>,
}

impl<'a> Grounder<'a> {
    pub fn new(
        lexicon: &'a Lexicon,
        task: &'a Task,
        view: &'a dyn MemoryView,
        options: &'a PlanOptions,
        may_look: bool,
    ) -> Grounder<'a> {
        Grounder {
            lexicon,
            task,
            view,
            options,
            may_look,
            moved_before: Cell::new(false),
            found: RefCell::default(),
            turns: RefCell::default(),
        }
    }
    /// What the phrases were taken to mean, each once, in the order of asking.
    pub fn found(&self) -> Vec<ResolvedReference> {
        self.found.borrow().clone()
    }
    pub(super) fn keep(&self, reference: ResolvedReference) {
        let mut found = self.found.borrow_mut();
        if !found.iter().any(|known| known.phrase == reference.phrase && known.recall == reference.recall) {
            found.push(reference);
        }
    }
    pub fn phrase(&self, index: ReferenceIndex) -> &str {
        self.task.references.get(index).map_or("it", |reference| reference.phrase.as_str())
    }
    /// Where some of several things are confirmed and others are not: looks as long as looks are left, then goes
    /// by those that are. A plan may rest on what is unconfirmed only where nothing better exists, or where it was clearly
    /// seen and is hidden now, so that no look can confirm it.
    pub(super) fn confirmed<'e>(&self, entries: Vec<&'e ObjectEntry>) -> Result<Vec<&'e ObjectEntry>, Stuck> {
        let stands = |entry: &&ObjectEntry| entry.verified || self.is_hidden(entry);
        let (confirmed, others): (Vec<_>, Vec<_>) = entries.iter().copied().partition(stands);
        match (confirmed.is_empty(), others.first()) {
            (false, Some(other)) if self.may_look => {
                let text = format!("{} {} is not confirmed by a second view yet", other.category, other.id);
                Err(Stuck::look(GiveUpCause::Perception, text))
            }
            (false, Some(_)) => Ok(confirmed),
            _ => Ok(entries),
        }
    }
    /// Whether a thing that was clearly seen is behind something or outside the view now.
    fn is_hidden(&self, entry: &ObjectEntry) -> bool {
        let visible = Literal::new("visible", vec![Term::Object(entry.id)]);
        let clear = entry.presence == Presence::Present && entry.confidence >= CLEARLY_SEEN;
        clear && self.view.belief(&visible).truth == Truth::No
    }
    /// When a subtask began; `None` for one that has not.
    pub fn began(&self, subtask: u32) -> Option<Moment> {
        let progress = self.view.progress();
        match subtask.checked_sub(1) {
            None => Some(progress.instructed),
            Some(before) => progress.done.iter().find(|(index, _)| *index == before).map(|(_, moment)| *moment),
        }
    }
    /// An object with its place known now, or why it has none.
    pub(super) fn present(&self, id: ObjectId, phrase: &str) -> Result<(&'a ObjectEntry, Pose), Stuck> {
        let entry = self.view.object(id);
        match entry.and_then(|entry| Some((entry, entry.pose()?))) {
            Some((entry, pose)) if entry.presence == Presence::Present => Ok((entry, pose)),
            Some((entry, _)) if entry.presence == Presence::Held => {
                Err(Stuck::give_up(GiveUpCause::Plan, format!("{phrase} ({id}) is in the hand and is nowhere")))
            }
            _ => Err(missing(id, phrase)),
        }
    }
}

/// The answer where an object's whereabouts are unknown.
pub(crate) fn missing(id: ObjectId, phrase: &str) -> Stuck {
    Stuck::absent(format!("I do not know where {phrase} ({id}) is"))
}

/// Whether some part of an object has a function that declares this effect.
pub(crate) fn has_effect(view: &dyn MemoryView, entry: &ObjectEntry, predicate: &str) -> bool {
    let declares = |template: &Template| {
        template.functions.iter().any(|f| f.effects.iter().any(|e| e.predicate == predicate && !e.negated))
    };
    entry.parts.iter().filter_map(|part| view.library().get(&part.template)).any(declares)
}
