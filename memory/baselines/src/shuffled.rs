//! Everything is kept, but each thing has another one's past.

use crate::prune::Content;
use acm_concept::{
    expectation::Expectation,
    ids::{ObjectId, PartId, TransitionId},
    literal::{Literal, Place, Term},
    template::TemplateLibrary,
    time::Time,
};
use acm_memory::{
    AcmMemory, Memory, MemoryError, MemoryView, Snapshot,
    entry::HistoryEntry,
    observation::{Executed, Grounding, Note, Observation, Verdict},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

/// The whole memory as a control: what it believes now is right, but among things of one template each has the next one's
/// past, and past places on such things are on the next one. A decision that rests on the past goes wrong with it.
#[derive(Debug)]
pub struct Shuffled {
    memory: AcmMemory,
    library: Arc<TemplateLibrary>,
    read: Snapshot,
}

impl Shuffled {
    /// Shuffles what a memory says.
    pub fn new(memory: AcmMemory, library: Arc<TemplateLibrary>) -> Shuffled {
        let read = memory.snapshot();
        Shuffled { memory, library, read }
    }

    fn shuffle(&mut self) -> Result<(), MemoryError> {
        let mut content = Content::of(self.memory.digest());
        shuffle(&mut content);
        let mut read = AcmMemory::in_memory(Arc::clone(&self.library));
        read.transplant(&content.into_events())?;
        self.read = read.snapshot();
        Ok(())
    }
}

/// Each thing's successor among those of its template, in the order of their ids.
fn successors(content: &Content) -> BTreeMap<ObjectId, ObjectId> {
    let mut kinds: BTreeMap<&str, Vec<ObjectId>> = BTreeMap::new();
    for object in &content.objects {
        let entry = &object.believed.entry;
        let template = entry.parts.first().map_or("", |part| part.template.as_str());
        kinds.entry(template).or_default().push(entry.id);
    }
    kinds.into_values().flat_map(|ids| ids.clone().into_iter().zip(ids.into_iter().cycle().skip(1))).collect()
}

fn shuffle(content: &mut Content) {
    let next = successors(content);
    let of = |id: ObjectId| next.get(&id).copied().unwrap_or(id);
    let mut spots = BTreeMap::new();
    for object in &content.objects {
        spots.extend(object.believed.entry.pose().map(|pose| (object.believed.entry.id, pose)));
    }
    let carried = |place: Place| -> Place {
        let Some(support) = place.support else { return place };
        let other = of(support);
        let (Some(from), Some(to)) = (spots.get(&support), spots.get(&other)) else { return place };
        let mut pose = place.pose;
        pose.translation += to.translation - from.translation;
        Place { support: Some(other), pose, ..place }
    };
    let pasts: BTreeMap<ObjectId, Vec<HistoryEntry>> = content
        .objects
        .iter_mut()
        .map(|object| {
            let now = object.history.pop();
            let past = std::mem::replace(&mut object.history, now.into_iter().collect());
            (object.believed.entry.id, past)
        })
        .collect();
    for object in &mut content.objects {
        let past = pasts.get(&of(object.believed.entry.id)).cloned().unwrap_or_default();
        let first = object.history.first().map(|now| now.moment);
        let before = past.into_iter().filter(|entry| first.is_none_or(|first| entry.moment <= first));
        let past = before.map(|entry| HistoryEntry { place: entry.place.map(carried), ..entry });
        object.history = past.chain(object.history.drain(..)).collect();
    }
    // The deed under way is no past.
    let deeds = content.transitions.len().saturating_sub(1);
    let known: BTreeSet<ObjectId> = next.keys().copied().collect();
    for transition in content.transitions.iter_mut().take(deeds) {
        let invocation = &mut transition.report.invocation;
        if known.contains(&invocation.part.object) {
            invocation.part = PartId { object: of(invocation.part.object), ..invocation.part };
        }
        for literal in transition.predicted.iter_mut().chain(&mut transition.after) {
            rename(literal, &of);
        }
        transition.report.felt.iter_mut().for_each(|(literal, _)| rename(literal, &of));
    }
}

fn rename(literal: &mut Literal, of: &impl Fn(ObjectId) -> ObjectId) {
    for term in &mut literal.arguments {
        match term {
            Term::Object(id) => *id = of(*id),
            Term::Part(part) => part.object = of(part.object),
            _ => {}
        }
    }
}

impl Memory for Shuffled {
    fn name(&self) -> &str {
        "shuffled"
    }
    fn expect(&self, now: Time) -> Expectation {
        self.memory.expect(now)
    }
    fn observe(&mut self, observation: &Observation<'_>) -> Result<Grounding, MemoryError> {
        let grounding = self.memory.observe(observation)?;
        self.shuffle()?;
        Ok(grounding)
    }
    fn record(&mut self, executed: &Executed) -> Result<TransitionId, MemoryError> {
        let id = self.memory.record(executed)?;
        self.shuffle()?;
        Ok(id)
    }
    fn settle(&mut self, transition: TransitionId, verdict: &Verdict) -> Result<(), MemoryError> {
        self.memory.settle(transition, verdict)?;
        self.shuffle()
    }
    fn note(&mut self, note: &Note) -> Result<(), MemoryError> {
        self.memory.note(note)?;
        self.shuffle()
    }
    fn wipe(&mut self) -> Result<(), MemoryError> {
        self.memory.wipe()?;
        self.shuffle()
    }
    fn view(&self) -> Arc<dyn MemoryView> {
        Arc::new(self.read.clone())
    }
}
