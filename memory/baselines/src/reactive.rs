//! A memory without a past: the last frame is all there is.

use crate::last_frame::LastFrame;
use acm_concept::{
    expectation::Expectation,
    ids::{ObjectId, TransitionId},
    template::TemplateLibrary,
    time::Time,
};
use acm_memory::{
    AcmMemory, Memory, MemoryError, MemoryView, Recent, Snapshot,
    event::Forget,
    observation::{Executed, Grounding, Note, Observation, Verdict},
};
use std::sync::Arc;

/// Keeps the last frame's objects (ids go on from frame to frame while something looks alike and is near), what
/// the hand holds by its own feeling, the last action, and how far the instruction is done. No history, no
/// skills, nothing that is not in sight.
#[derive(Debug)]
pub struct Reactive {
    memory: AcmMemory,
    library: Arc<TemplateLibrary>,
}

impl Reactive {
    /// An empty memory.
    pub fn new(library: Arc<TemplateLibrary>) -> Reactive {
        Reactive { memory: AcmMemory::in_memory(Arc::clone(&library)), library }
    }
    /// The view of the last frame.
    pub fn snapshot(&self) -> Snapshot {
        self.memory.snapshot()
    }
    /// Drops all that is older than the last frame and the last action.
    fn drop_past(&mut self, objects: Vec<ObjectId>) -> Result<(), MemoryError> {
        let last = self.memory.snapshot().transitions().last().map(|transition| transition.id);
        self.memory.forget(&Forget { objects, histories: true, transitions_before: last, skills: true })
    }
}

impl Memory for Reactive {
    fn name(&self) -> &str {
        "reactive"
    }
    fn expect(&self, now: Time) -> Expectation {
        self.memory.expect(now)
    }
    fn observe(&mut self, observation: &Observation<'_>) -> Result<Grounding, MemoryError> {
        let grounding = self.memory.observe(observation)?;
        let kept = self.memory.present_in_last_frame();
        let all = self.memory.snapshot();
        let unseen = all.objects().iter().map(|entry| entry.id).filter(|id| !kept.contains(id)).collect();
        self.drop_past(unseen)?;
        Ok(grounding)
    }
    fn record(&mut self, executed: &Executed) -> Result<TransitionId, MemoryError> {
        let id = self.memory.record(executed)?;
        self.drop_past(Vec::new())?;
        Ok(id)
    }
    fn settle(&mut self, transition: TransitionId, verdict: &Verdict) -> Result<(), MemoryError> {
        self.memory.settle(transition, verdict)?;
        self.drop_past(Vec::new())
    }
    fn note(&mut self, note: &Note) -> Result<(), MemoryError> {
        if *note == Note::EpisodeBegan {
            self.memory = AcmMemory::in_memory(Arc::clone(&self.library));
        }
        self.memory.note(note)
    }
    fn wipe(&mut self) -> Result<(), MemoryError> {
        self.memory.wipe()
    }
    fn events_since(&self, known: u64) -> Recent {
        self.memory.events_since(known)
    }
    fn view(&self) -> Arc<dyn MemoryView> {
        Arc::new(LastFrame::new(self.snapshot(), Arc::default()))
    }
}
