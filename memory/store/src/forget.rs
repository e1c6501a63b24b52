//! Forgetting that leaves no byte: the log is written anew without what is forgotten, and everything else follows from it.

use crate::{
    Event, Id, Nanos,
    event::Op,
    store::{Store, StoreError},
    symbols::Symbol,
};
use std::collections::BTreeSet;

/// What to forget.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Forget {
    /// These objects.
    pub objects: Vec<Id>,
    /// These regions, with every object that was ever in one.
    pub regions: Vec<Symbol>,
    /// Everything that these sources said.
    pub sources: Vec<Symbol>,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Forgotten {
    /// The objects of which nothing is left.
    pub objects: Vec<Id>,
    /// Events that are gone or were shortened.
    pub events: usize,
}

impl Store {
    /// Forgets. `document` gives what stays of an event's document that speaks of a forgotten object: `None` for nothing.
    pub fn forget(
        &mut self,
        what: &Forget,
        mut document: impl FnMut(&Event, &BTreeSet<Id>) -> Option<Vec<u8>>,
    ) -> Result<Forgotten, StoreError> {
        let events = self.events()?;
        let gone = objects(what, &events);
        let mut changed = 0;
        let mut batches: Vec<(Nanos, Vec<Event>)> = Vec::new();
        let mut there: BTreeSet<Id> = BTreeSet::new();
        let mut number: Symbol = 0;
        for (time, mut event) in events {
            let before = (event.ops.len(), event.document.len(), event.about.len());
            let speaks = event.subjects().any(|id| gone.contains(&id));
            let silenced = event.source > 0 && what.sources.contains(&event.source);
            if silenced {
                event.ops.retain(|op| matches!(op, Op::Define(..)));
                event.document.clear();
                event.evidence.clear();
                event.about.clear();
            } else if speaks {
                event.document = document(&event, &gone).unwrap_or_default();
                event.about.retain(|id| !gone.contains(id));
                event.evidence.clear();
            }
            let mut ops = std::mem::take(&mut event.ops);
            ops.retain(|op| !op.subjects().into_iter().flatten().any(|id| gone.contains(&id)));
            ops.retain(|op| !matches!(op, Op::Searched(region, ..) if what.regions.contains(region)));
            // What a silenced source put, others cannot speak of.
            ops.retain(|op| {
                if let Op::Put(object) = op {
                    there.insert(object.id);
                }
                op.subjects().into_iter().flatten().all(|id| there.contains(&id))
            });
            for op in &mut ops {
                if let Op::Define(_, word) = op {
                    number += 1;
                    if what.regions.contains(&number) || what.sources.contains(&number) {
                        // The number stays, so that all others keep theirs; the word goes.
                        *word = format!("forgotten-{number}");
                        changed += 1;
                    }
                }
            }
            event.ops = ops;
            if silenced {
                event.source = 0;
            }
            changed += usize::from(before != (event.ops.len(), event.document.len(), event.about.len()));
            if event.ops.is_empty() && event.document.is_empty() && (silenced || speaks) {
                continue;
            }
            match batches.last_mut() {
                Some((known, batch)) if *known == time => batch.push(event),
                _ => batches.push((time, vec![event])),
            }
        }
        self.rewrite(&batches)?;
        Ok(Forgotten { objects: gone.into_iter().collect(), events: changed })
    }
}

/// The objects to forget: those that are named, and those that ever were in a forgotten region.
fn objects(what: &Forget, events: &[(Nanos, Event)]) -> BTreeSet<Id> {
    let mut gone: BTreeSet<Id> = what.objects.iter().copied().collect();
    for op in events.iter().flat_map(|(_, event)| &event.ops) {
        match op {
            Op::Put(object) if what.regions.contains(&object.region) => {
                gone.insert(object.id);
            }
            Op::Region(id, region) if what.regions.contains(region) => {
                gone.insert(*id);
            }
            _ => {}
        }
    }
    gone
}
