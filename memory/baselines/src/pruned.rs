//! A memory that keeps less than everything.

use crate::{
    first_frame::FirstFrame,
    keeping::{Frames, Keeping},
    prune::{self, Content},
    sights::{Sight, Sights, looks},
};
use acm_concept::{expectation::Expectation, ids::TransitionId, template::TemplateLibrary, time::Time};
use acm_memory::{
    AcmMemory, Memory, MemoryError, MemoryView, Snapshot,
    event::{Believed, Event},
    observation::{Executed, Grounding, Note, Observation, Outcome, Verdict},
};
use std::sync::Arc;

/// The shared machinery, from which after every call is dropped what the method does not keep. Objects' ids go on from
/// frame to frame while something looks alike and is near, or is felt in the hand. It begins each run anew.
#[derive(Debug)]
pub struct Pruned {
    keeping: Keeping,
    memory: AcmMemory,
    library: Arc<TemplateLibrary>,
    sights: Sights,
    /// Frames taken in this run.
    taken: u32,
    /// Whether something happened after the last frame that makes the next one worth to be kept.
    eventful: bool,
    /// What is read of what is kept, where that is less.
    read: Option<Snapshot>,
}

impl Pruned {
    pub(crate) fn new(keeping: Keeping, library: Arc<TemplateLibrary>) -> Pruned {
        let memory = AcmMemory::in_memory(Arc::clone(&library));
        Pruned { keeping, memory, library, sights: Sights::new(keeping.frames), taken: 0, eventful: true, read: None }
    }

    fn remember(&mut self, observation: &Observation<'_>, grounding: &Grounding) {
        let content = Content::of(self.memory.digest());
        let present = self.memory.present_in_last_frame();
        let shown = content.objects.iter().filter(|object| present.contains(&object.believed.entry.id));
        let changed = !grounding.missing.is_empty()
            || !grounding.moved.is_empty()
            || grounding.resolved.iter().any(|resolved| resolved.new);
        self.sights.add(Sight {
            number: self.taken,
            frame: observation.percepts.frame.id,
            moment: content.rest_moment(),
            shown: shown.map(|object| (object.believed.entry.id, object.believed.clone())).collect(),
            gone: content.missing_now(observation.percepts.frame.id),
            looks: if matches!(self.keeping.frames, Frames::Bank { .. }) {
                looks(observation.frame)
            } else {
                Vec::new()
            },
            stands_for: Vec::new(),
        });
        self.taken += 1;
        if std::mem::take(&mut self.eventful) || changed {
            self.sights.nominate_last();
        }
    }

    /// What is left of the content if only some frames are kept.
    fn pruned(&self, kept: &[&Sight], looked: bool) -> Vec<Event> {
        let present = self.memory.present_in_last_frame();
        let reach = prune::Reach {
            keeping: &self.keeping,
            kept,
            window: self.sights.window_began(),
            present: &present,
            looked,
        };
        prune::prune(Content::of(self.memory.digest()), &reach, &self.library)
    }

    /// Drops what is not kept; `looked` after a frame, which tells what is in sight.
    fn drop_rest(&mut self, looked: bool) -> Result<(), MemoryError> {
        let kept = self.pruned(&self.sights.kept(), looked);
        if kept != self.memory.digest() {
            self.memory.transplant(&kept)?;
        }
        if matches!(self.keeping.frames, Frames::Bank { .. }) {
            let mut read = AcmMemory::in_memory(Arc::clone(&self.library));
            read.transplant(&self.pruned(&self.sights.read(), looked))?;
            self.read = Some(read.snapshot());
        }
        Ok(())
    }

    /// The present view with what only the machinery can be asked.
    pub fn snapshot(&self) -> Snapshot {
        self.memory.snapshot()
    }
}

impl Memory for Pruned {
    fn name(&self) -> &str {
        self.keeping.name
    }
    fn expect(&self, now: Time) -> Expectation {
        self.memory.expect(now)
    }
    fn observe(&mut self, observation: &Observation<'_>) -> Result<Grounding, MemoryError> {
        let grounding = self.memory.observe(observation)?;
        // A run's first frame is the first one that shows something.
        if observation.percepts.blindness.is_none() || self.taken > 0 {
            self.remember(observation, &grounding);
        }
        self.drop_rest(true)?;
        Ok(grounding)
    }
    fn record(&mut self, executed: &Executed) -> Result<TransitionId, MemoryError> {
        let id = self.memory.record(executed)?;
        self.eventful = true;
        self.drop_rest(false)?;
        Ok(id)
    }
    fn settle(&mut self, transition: TransitionId, verdict: &Verdict) -> Result<(), MemoryError> {
        self.memory.settle(transition, verdict)?;
        // The frame that has shown the outcome is one to be kept.
        if verdict.outcome == Outcome::Verified {
            self.sights.nominate_last();
        }
        self.drop_rest(false)
    }
    fn note(&mut self, note: &Note) -> Result<(), MemoryError> {
        match note {
            Note::EpisodeBegan => *self = Pruned::new(self.keeping, Arc::clone(&self.library)),
            Note::Instructed { .. } | Note::SubtaskDone { .. } => self.sights.nominate_last(),
        }
        self.memory.note(note)?;
        self.drop_rest(false)
    }
    fn wipe(&mut self) -> Result<(), MemoryError> {
        // The run's frames go on being counted: what is seen after a wipe is not the first one.
        self.taken = self.taken.max(1);
        self.sights.clear();
        self.read = None;
        self.memory.wipe()
    }
    fn view(&self) -> Arc<dyn MemoryView> {
        let now = self.read.clone().unwrap_or_else(|| self.snapshot());
        let kept = self.sights.kept();
        match kept.first().filter(|sight| self.keeping.frames == Frames::First && sight.number == 0) {
            Some(first) => {
                let place = |believed: &Believed| Some((believed.entry.id, believed.entry.place()?));
                let places = first.shown.values().filter_map(place).collect();
                Arc::new(FirstFrame::new(now, first.frame, places))
            }
            None => Arc::new(now),
        }
    }
}
