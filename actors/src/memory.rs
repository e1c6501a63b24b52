//! The memory actor: the single writer of the memory.

use crate::message::{EPISODE, Message, PERCEPTION, View};
use acm_concept::{camera::RgbdFrame, time::Time};
use acm_memory::{Memory, event::Event, observation::Observation};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
    frame_bus::FrameBus,
    journal::JournalError,
};
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Is told after each call that may have changed memory.
pub trait MemoryObserver: Send + Sync {
    /// Looks at what changed. An error ends the episode: what happened could not be written down.
    fn changed(&self, memory: &dyn Memory) -> Result<(), JournalError>;
}

/// The memory actor. The memory itself outlives the actor: after a restart the new one goes on with the same store.
/// It belongs to the agent alone, so that with the agent it is closed at once, and not when the last actor is gone.
pub struct MemoryActor {
    memory: Weak<Mutex<Box<dyn Memory>>>,
    bus: Arc<dyn FrameBus<RgbdFrame>>,
    observer: Option<Arc<dyn MemoryObserver>>,
    donated: Arc<[Event]>,
}

impl MemoryActor {
    /// An actor that writes `memory` and finds the frames behind percepts on `bus`.
    pub fn new(memory: Weak<Mutex<Box<dyn Memory>>>, bus: Arc<dyn FrameBus<RgbdFrame>>) -> MemoryActor {
        MemoryActor { memory, bus, observer: None, donated: Arc::default() }
    }
    /// What another memory came to, for the fault that puts it in this one's place.
    pub fn donated(self, donated: Arc<[Event]>) -> MemoryActor {
        MemoryActor { donated, ..self }
    }
    /// Tells `observer` of every change.
    pub fn observed_by(self, observer: Option<Arc<dyn MemoryObserver>>) -> MemoryActor {
        MemoryActor { observer, ..self }
    }
}

impl Core<Message> for MemoryActor {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        let memory = self.memory.upgrade().ok_or_else(|| CoreError("the agent that owns the memory is gone".into()))?;
        let mut memory = memory.lock().unwrap_or_else(PoisonError::into_inner);
        if let Message::Look { nouns, .. } = message.body {
            let expectation = acm_concept::expectation::Expectation { nouns, ..memory.expect(Time(message.time_ns)) };
            outbox.send(PERCEPTION, Message::Expected(expectation));
            return Ok(());
        }
        let kept = match message.body {
            Message::Percepts { percepts, feedback } => {
                let frame = self.bus.get(percepts.frame.id.0).map_err(|e| CoreError(e.to_string()))?;
                let observation = Observation { percepts: &percepts, frame: &frame, feedback: &feedback };
                memory.observe(&observation).map(|grounding| Message::Updated {
                    grounding,
                    blindness: percepts.blindness,
                    feedback,
                    view: View(memory.view()),
                })
            }
            Message::Note(note) => memory.note(&note).map(|()| kept(&**memory, None)),
            Message::Wipe => memory.wipe().map(|()| kept(&**memory, None)),
            Message::Transplant => memory.transplant(&self.donated).map(|()| kept(&**memory, None)),
            Message::Record(executed) => memory.record(&executed).map(|id| kept(&**memory, Some(id))),
            Message::Settle { transition, verdict } => {
                memory.settle(transition, &verdict).map(|()| kept(&**memory, Some(transition)))
            }
            other => return Err(CoreError(format!("memory cannot handle {other:?}"))),
        };
        let seen = self.observer.as_ref().map_or(Ok(()), |observer| observer.changed(&**memory));
        if let Err(error) = seen {
            outbox.send(EPISODE, Message::Broken { reason: error.to_string() });
            return Ok(());
        }
        // A store that cannot be written ends the episode: going on would act on what is not kept.
        outbox.send(EPISODE, kept.unwrap_or_else(|error| Message::Broken { reason: error.to_string() }));
        Ok(())
    }
}

fn kept(memory: &dyn Memory, transition: Option<acm_concept::ids::TransitionId>) -> Message {
    Message::Kept { transition, view: View(memory.view()) }
}
