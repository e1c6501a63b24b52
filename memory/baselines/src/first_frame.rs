//! The last frame, and the first.

use crate::{Reactive, last_frame::LastFrame};
use acm_concept::{expectation::Expectation, ids::TransitionId, template::TemplateLibrary, time::Time};
use acm_memory::{
    Memory, MemoryError, MemoryView, Recent,
    entry::ObjectEntry,
    observation::{Executed, Grounding, Note, Observation, Verdict},
};
use std::sync::Arc;

/// [`Reactive`] with the objects of the run's first frame beside it, kept as they were seen. Where something was
/// before is where the first frame shows what looks like it, moved since or not.
#[derive(Debug)]
pub struct FirstFrame {
    last: Reactive,
    first: Arc<Vec<ObjectEntry>>,
    /// Whether the run's first frame is still to come.
    waiting: bool,
}

impl FirstFrame {
    /// An empty memory.
    pub fn new(library: Arc<TemplateLibrary>) -> FirstFrame {
        FirstFrame { last: Reactive::new(library), first: Arc::default(), waiting: true }
    }
}

impl Memory for FirstFrame {
    fn name(&self) -> &str {
        "first-frame"
    }
    fn expect(&self, now: Time) -> Expectation {
        self.last.expect(now)
    }
    fn observe(&mut self, observation: &Observation<'_>) -> Result<Grounding, MemoryError> {
        let grounding = self.last.observe(observation)?;
        let snapshot = self.last.snapshot();
        if self.waiting && snapshot.frames_seen() > 0 {
            (self.first, self.waiting) = (Arc::new(snapshot.objects().to_vec()), false);
        }
        Ok(grounding)
    }
    fn record(&mut self, executed: &Executed) -> Result<TransitionId, MemoryError> {
        self.last.record(executed)
    }
    fn settle(&mut self, transition: TransitionId, verdict: &Verdict) -> Result<(), MemoryError> {
        self.last.settle(transition, verdict)
    }
    fn note(&mut self, note: &Note) -> Result<(), MemoryError> {
        if *note == Note::EpisodeBegan {
            (self.first, self.waiting) = (Arc::default(), true);
        }
        self.last.note(note)
    }
    fn wipe(&mut self) -> Result<(), MemoryError> {
        self.last.wipe()?;
        // The first frame of a run comes once. What is seen after a wipe is not it.
        (self.first, self.waiting) = (Arc::default(), false);
        Ok(())
    }
    fn events_since(&self, known: u64) -> Recent {
        self.last.events_since(known)
    }
    fn view(&self) -> Arc<dyn MemoryView> {
        Arc::new(LastFrame::new(self.last.snapshot(), Arc::clone(&self.first)))
    }
}
