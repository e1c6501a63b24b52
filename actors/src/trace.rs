//! The trace of a run: every message, every effect and every change of memory in one file.
//!
//! Messages go through the runtime's [`TraceJournal`]; this module adds what only the robot's side can say. The file is
//! described in docs/trace.md.
//!
//! | module | adds |
//! |---|---|
//! | [`frames`] | the frames that the camera gave, by hash, and their pixels as far as they are wanted |
//! | [`delta`] | what memory appended, with what was believed before and after |
//! | [`words`] | one line for a person on every message |
//! | [`points`] | a frame as a cloud of points |
//! | [`viewer`] | images, clouds, calibration, transforms and lines in the form that robot viewers read |

pub mod delta;
pub mod frames;
pub mod points;
pub mod viewer;
pub mod words;

use crate::{memory::MemoryObserver, message::Message};
use acm_concept::{camera::CameraSource, embodiment::RobotDescription, task::TaskSpec};
use acm_memory::Memory;
use acm_planner::Decision;
use acm_runtime::{
    envelope::Envelope,
    journal::{Handled, Journal, JournalError},
    trace::{Channel, TraceError, TraceJournal, TraceWriter, journal::json_schema},
};
use delta::{Deltas, Keyframe};
pub use frames::FrameDetail;
use serde::Serialize;
use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};
use viewer::Viewer;

/// Schema of effect records: what was asked of the world outside the messages, and what came.
const EFFECT_SCHEMA: &str = r#"{
  "$schema": "https://json-schema.org/draft/2020-12/schema",
  "title": "acm.Effect",
  "description": "Something that came from outside: a camera frame, a random draw.",
  "type": "object",
  "required": ["seq"],
  "properties": {
    "seq": {"type": "integer", "description": "the message whose handling caused it; 0 before the first"}
  }
}"#;

/// Writes a run into a trace. It is the journal of its messages, stands between agent and camera, and is told of every
/// change of memory. The agent's behaviour is the same without it.
pub struct Trace {
    writer: Arc<TraceWriter>,
    journal: TraceJournal,
    detail: FrameDetail,
    viewer: Viewer,
    draws: Channel,
    frames: Channel,
    changes: Channel,
    keyframes: Channel,
    /// The last message that was written: with one request in flight, the one that is being handled.
    seq: AtomicU64,
    time_ns: AtomicU64,
    deltas: Mutex<Deltas>,
    /// Wall time that writing took so far, nanoseconds.
    spent_ns: AtomicU64,
}

impl Trace {
    /// A trace into `writer`, which is open; what belongs to the whole run may be written to it before and after.
    pub fn new(writer: Arc<TraceWriter>, detail: FrameDetail) -> Result<Trace, TraceError> {
        let effect = |topic: &str| writer.channel(topic, &json_schema("acm.Effect", EFFECT_SCHEMA));
        let (frames, draws) = (effect("/effect/frame")?, effect("/effect/draw")?);
        let changes = writer.channel("/memory/delta", &json_schema("acm.MemoryDelta", delta::SCHEMA))?;
        let keyframes =
            writer.channel("/memory/keyframe", &json_schema("acm.MemoryKeyframe", delta::KEYFRAME_SCHEMA))?;
        Ok(Trace {
            journal: TraceJournal::new(Arc::clone(&writer)),
            viewer: Viewer::new(&writer)?,
            writer,
            detail,
            draws,
            frames,
            changes,
            keyframes,
            seq: AtomicU64::new(0),
            time_ns: AtomicU64::new(0),
            deltas: Mutex::default(),
            spent_ns: AtomicU64::new(0),
        })
    }

    /// The file.
    pub fn writer(&self) -> &TraceWriter {
        &self.writer
    }

    /// Wall time that all writing took so far: what the trace costs.
    pub fn spent(&self) -> Duration {
        Duration::from_nanos(self.spent_ns.load(Ordering::Relaxed))
    }

    /// Counts the time that some work takes.
    fn counted<T>(&self, work: impl FnOnce() -> T) -> T {
        #[allow(clippy::disallowed_methods, reason = "goes to the report of costs, never to a core or into the file")]
        let began = Instant::now();
        let done = work();
        self.spent_ns.fetch_add(began.elapsed().as_nanos() as u64, Ordering::Relaxed);
        done
    }

    /// Writes down what the agent is told before it begins, and takes note of what memory believes already.
    pub fn begin(&self, task: &TaskSpec, robot: &RobotDescription, memory: &dyn Memory) -> Result<(), JournalError> {
        self.writer.attach("task.json", "application/json", &json(task)?)?;
        self.writer.attach("robot.json", "application/json", &json(robot)?)?;
        let mut deltas = self.deltas.lock().unwrap_or_else(PoisonError::into_inner);
        deltas.begin(memory);
        self.keyframe(deltas.keyframe(0, memory))?;
        Ok(self.writer.flush()?)
    }

    /// A camera whose frames are written down on their way to the agent.
    pub fn cameras(self: &Arc<Self>, cameras: Box<dyn CameraSource>) -> Box<dyn CameraSource> {
        Box::new(frames::TracedCamera::new(cameras, Arc::clone(self)))
    }

    /// Writes down all that memory believes, so that nobody has to add up its changes from the beginning.
    fn keyframe(&self, keyframe: Keyframe) -> Result<(), JournalError> {
        let (seq, time_ns) = (self.seq.load(Ordering::Relaxed), self.time_ns.load(Ordering::Relaxed));
        Ok(self.writer.put(self.keyframes, seq, time_ns, &json(&keyframe)?)?)
    }

    /// Guesses are random draws: what was drawn goes beside the decision that rests on it.
    fn draw(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let Message::Decided { decision, .. } = &message.body else { return Ok(()) };
        let Decision::Act { step, explanation } = &**decision else { return Ok(()) };
        if !step.guessed {
            return Ok(());
        }
        let drawn: Vec<_> = explanation.references.iter().filter(|reference| reference.guessed).collect();
        let record = serde_json::json!({ "seq": message.seq, "step": step.to_string(), "drawn": drawn });
        Ok(self.writer.put(self.draws, message.seq, message.time_ns, &json(&record)?)?)
    }
}

impl Journal<Message> for Trace {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        self.counted(|| {
            self.seq.store(message.seq, Ordering::Relaxed);
            self.time_ns.store(message.time_ns, Ordering::Relaxed);
            self.viewer.message(&self.writer, message)?;
            self.draw(message)?;
            // Last, since it hands what was written to the operating system.
            self.journal.record(message)
        })
    }
    fn keeps_states(&self) -> bool {
        Journal::<Message>::keeps_states(&self.journal)
    }
    fn handled(&self, handled: &Handled) -> Result<(), JournalError> {
        self.counted(|| Journal::<Message>::handled(&self.journal, handled))
    }
}

impl MemoryObserver for Trace {
    fn changed(&self, memory: &dyn Memory) -> Result<(), JournalError> {
        self.counted(|| {
            let (seq, time_ns) = (self.seq.load(Ordering::Relaxed), self.time_ns.load(Ordering::Relaxed));
            let mut deltas = self.deltas.lock().unwrap_or_else(PoisonError::into_inner);
            for delta in deltas.take(seq, memory) {
                self.writer.put(self.changes, seq, time_ns, &json(&delta)?)?;
            }
            match deltas.keyframe_is_due() {
                true => self.keyframe(deltas.keyframe(seq, memory)),
                false => Ok(()),
            }
        })
    }
}

fn json(value: &impl Serialize) -> Result<Vec<u8>, JournalError> {
    serde_json::to_vec(value).map_err(|e| JournalError(format!("a record of the trace has no JSON: {e}")))
}
