//! Compaction: the log is written anew without what no question about the time since a horizon can ask for. What is
//! answered of that time stays the same, whatever comes to be known later.

use crate::{
    Event, Id, Nanos,
    event::Op,
    history::{CATEGORY, CONFIDENCE, FIRST, Key, POSITION, REGION, ROTATION},
    store::{Store, StoreError},
};
use std::collections::{BTreeMap, BTreeSet};

/// The parts of an object, beside the properties that have a history.
const PARTS: Key = FIRST - 1;

/// What came of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Compacted {
    /// Events before and after.
    pub events: (u64, u64),
    /// Bytes of all files before and after.
    pub bytes: (u64, u64),
}

impl Store {
    /// Folds the events up to the first that is of `horizon` or later, or came to be known then. Of those before it, what
    /// later ones of them supersede is dropped, and so are objects that are gone by then, and all documents. `base` is
    /// given them as they were, and gives what shall stand in the place of their documents: events that follow them.
    ///
    /// Questions about moments from the horizon on, as known from the horizon on, have the answers that they had. What was
    /// before is no longer told.
    ///
    /// # Errors
    /// `base` refuses, or the disk fails: then the old log stays.
    pub fn compact(
        &mut self,
        horizon: Nanos,
        base: impl FnOnce(&[(Nanos, Event)]) -> Result<Vec<Event>, String>,
    ) -> Result<Compacted, StoreError> {
        let (events, bytes) = (self.state().next, self.disk_bytes()?);
        let mut all = self.events()?;
        let cut = all.iter().position(|(known, event)| *known >= horizon || event.valid >= horizon);
        let later = all.split_off(cut.unwrap_or(all.len()));
        let known = all.last().map_or(0, |(known, _)| *known);
        let base = base(&all).map_err(StoreError::Refused)?;
        fold(&mut all);
        let mut batches: Vec<(Nanos, Vec<Event>)> = Vec::new();
        for (known, event) in all.into_iter().chain(base.into_iter().map(|event| (known, event))).chain(later) {
            match batches.last_mut() {
                Some((time, batch)) if *time == known => batch.push(event),
                _ => batches.push((known, vec![event])),
            }
        }
        self.rewrite(&batches)?;
        Ok(Compacted { events: (events, self.state().next), bytes: (bytes, self.disk_bytes()?) })
    }
}

/// Drops superseded operations and all documents, and events of which nothing is left.
fn fold(events: &mut Vec<(Nanos, Event)>) {
    let lives = Lives::of(events);
    // The latest moment of which something was said later on, by property.
    let mut latest: BTreeMap<(Id, Key, Id), Nanos> = BTreeMap::new();
    for (number, (_, event)) in events.iter_mut().enumerate().rev() {
        let valid = event.valid;
        let mut at = event.ops.len();
        let mut keep = Vec::with_capacity(at);
        for op in event.ops.iter().rev() {
            at -= 1;
            let stays = lives.stays((number, at), op).unwrap_or_else(|| {
                let written = written(op);
                let superseded = |key: &(Id, Key, Id)| latest.get(key).is_some_and(|later| *later >= valid);
                let stays = !written.iter().all(superseded);
                for key in written {
                    let later = latest.entry(key).or_insert(valid);
                    *later = valid.max(*later);
                }
                stays
            });
            keep.push(stays);
        }
        event.ops.retain(|_| keep.pop().unwrap_or(true));
        (event.document, event.about) = (Vec::new(), Vec::new());
    }
    events.retain(|(_, event)| !event.ops.is_empty());
}

/// Which objects are there at the end, and since where.
#[derive(Default)]
struct Lives {
    /// The first operation of each object: an object must be put before it can be spoken of.
    first: BTreeMap<Id, (usize, usize)>,
    there: BTreeSet<Id>,
    /// Objects that went and came back: what was said before still counts for what is said after.
    came_back: BTreeSet<Id>,
    /// Where everything was dropped last.
    cleared: Option<(usize, usize)>,
}

impl Lives {
    fn of(events: &[(Nanos, Event)]) -> Lives {
        let mut lives = Lives::default();
        for (number, (_, event)) in events.iter().enumerate() {
            for (at, op) in event.ops.iter().enumerate() {
                match op {
                    Op::Put(object) => {
                        let is_new = lives.there.insert(object.id);
                        let first = *lives.first.entry(object.id).or_insert((number, at));
                        if is_new && first != (number, at) {
                            lives.came_back.insert(object.id);
                        }
                    }
                    Op::Remove(id) => {
                        lives.there.remove(id);
                    }
                    Op::Clear => lives = Lives { cleared: Some((number, at)), ..Lives::default() },
                    _ => {}
                }
            }
        }
        lives
    }
    /// Whether an operation stays, where that does not depend on later ones.
    fn stays(&self, place: (usize, usize), op: &Op) -> Option<bool> {
        if matches!(op, Op::Define(..) | Op::IsA(..)) {
            return Some(true);
        }
        if self.cleared.is_some_and(|cleared| place <= cleared) {
            return Some(false);
        }
        let mut subjects = op.subjects().into_iter().flatten();
        if !subjects.clone().all(|id| self.there.contains(&id)) {
            return Some(false);
        }
        // The first description begins an object, superseded or not.
        let begins = matches!(op, Op::Put(object) if self.first.get(&object.id) == Some(&place));
        let whole = begins || matches!(op, Op::Searched(..)) || subjects.any(|id| self.came_back.contains(&id));
        whole.then_some(true)
    }
}

/// The properties that an operation sets.
fn written(op: &Op) -> Vec<(Id, Key, Id)> {
    match op {
        Op::Put(object) => {
            let own = [POSITION, ROTATION, REGION, CATEGORY, CONFIDENCE, PARTS];
            let states = object.states.iter().map(|state| FIRST + state);
            own.into_iter().chain(states).map(|key| (object.id, key, 0)).collect()
        }
        Op::Move(id, ..) => vec![(*id, POSITION, 0), (*id, ROTATION, 0)],
        Op::Region(id, _) => vec![(*id, REGION, 0)],
        Op::State(id, state, _) => vec![(*id, FIRST + state, 0)],
        Op::Fluent(id, fluent, _) => vec![(*id, FIRST + fluent, 0)],
        Op::Relate(id, relation, other, _) => vec![(*id, FIRST + relation, *other)],
        Op::Confidence(id, _) => vec![(*id, CONFIDENCE, 0)],
        Op::Define(..) | Op::IsA(..) | Op::Remove(_) | Op::Searched(..) | Op::Clear => Vec::new(),
    }
}
