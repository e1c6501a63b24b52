//! Every frame of the run, perceived again once it is known what is asked for.

use crate::{Pruned, keeping::FULL_HISTORY};
use acm_concept::{
    camera::RgbdFrame, embodiment::Feedback, expectation::Expectation, ids::TransitionId, object::Percepts,
    template::TemplateLibrary, time::Time,
};
use acm_memory::{
    Memory, MemoryError, MemoryView,
    observation::{Executed, Grounding, Note, Observation, Verdict},
};
use std::{fmt, sync::Arc};

/// Perception of a stored frame: the frame, what the arm reported when it was taken, and what is expected.
pub type Perceive = Arc<dyn Fn(&RgbdFrame, &Feedback, &Expectation) -> Percepts + Send + Sync>;

/// Keeps all frames and what they showed, and all deeds, which a film of the whole run would show too. When an instruction is given, the frames
/// before it are perceived again with its words; those that follow are perceived with them at once, and perceiving them
/// again would give the same. Once something was done, frames are no longer perceived anew: things have their names by then.
pub struct FullHistory {
    kept: Pruned,
    perceive: Option<Perceive>,
    /// The frames before the first deed, in their order.
    frames: Vec<(RgbdFrame, Feedback)>,
    acted: bool,
}

impl fmt::Debug for FullHistory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FullHistory")
            .field("kept", &self.kept)
            .field("frames", &self.frames.len())
            .finish_non_exhaustive()
    }
}

impl FullHistory {
    /// An empty memory; without perception the frames stay as they were perceived first.
    pub fn new(library: Arc<TemplateLibrary>, perceive: Option<Perceive>) -> FullHistory {
        FullHistory { kept: Pruned::new(FULL_HISTORY, library), perceive, frames: Vec::new(), acted: false }
    }

    /// The frames so far, understood anew with the words of what is asked for.
    fn perceive_again(&mut self, text: &str) -> Result<(), MemoryError> {
        let Some(perceive) = self.perceive.clone().filter(|_| !self.acted) else { return Ok(()) };
        let words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
        let nouns: Vec<String> = words.map(str::to_lowercase).collect();
        self.kept.note(&Note::EpisodeBegan)?;
        for (frame, feedback) in &self.frames {
            let expectation = Expectation { nouns: nouns.clone(), ..self.kept.expect(frame.header.time) };
            let percepts = perceive(frame, feedback, &expectation);
            self.kept.observe(&Observation { percepts: &percepts, frame, feedback })?;
        }
        Ok(())
    }
}

impl Memory for FullHistory {
    fn name(&self) -> &str {
        FULL_HISTORY.name
    }
    fn expect(&self, now: Time) -> Expectation {
        self.kept.expect(now)
    }
    fn observe(&mut self, observation: &Observation<'_>) -> Result<Grounding, MemoryError> {
        if self.perceive.is_some() && !self.acted {
            self.frames.push((observation.frame.clone(), observation.feedback.clone()));
        }
        self.kept.observe(observation)
    }
    fn record(&mut self, executed: &Executed) -> Result<TransitionId, MemoryError> {
        self.acted = true;
        self.frames.clear();
        self.kept.record(executed)
    }
    fn settle(&mut self, transition: TransitionId, verdict: &Verdict) -> Result<(), MemoryError> {
        self.kept.settle(transition, verdict)
    }
    fn note(&mut self, note: &Note) -> Result<(), MemoryError> {
        match note {
            Note::EpisodeBegan => (self.frames, self.acted) = (Vec::new(), false),
            Note::Instructed { text, .. } => self.perceive_again(text)?,
            Note::SubtaskDone { .. } => {}
        }
        self.kept.note(note)
    }
    fn wipe(&mut self) -> Result<(), MemoryError> {
        // After a wipe there is nothing that could be perceived again.
        (self.frames, self.acted) = (Vec::new(), true);
        self.kept.wipe()
    }
    fn view(&self) -> Arc<dyn MemoryView> {
        self.kept.view()
    }
}
