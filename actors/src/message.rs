//! Every message between the actors.

use crate::report::{Counsel, EpisodeReport, Reading};
use acm_concept::{
    camera::FrameHeader,
    embodiment::{Command, Feedback},
    expectation::Expectation,
    ids::TransitionId,
    literal::Literal,
    object::Percepts,
    skill::{SkillInvocation, SkillReport},
};
use acm_llm::{Answer, ChatRequest};
use acm_memory::{
    MemoryView,
    observation::{Executed, Grounding, Note, Verdict},
};
use acm_planner::{Decision, Situation, Task};
use acm_runtime::envelope::{Payload, Role};
use serde::{Serialize, Serializer, ser::SerializeStruct};
use std::{fmt, sync::Arc};

/// The episode loop.
pub const EPISODE: Role = Role("episode");
/// Grounds frames.
pub const PERCEPTION: Role = Role("perception");
/// Keeps and recalls.
pub const MEMORY: Role = Role("memory");
/// Reads the instruction and decides what to do next.
pub const PLANNER: Role = Role("planner");
/// Runs skills tick by tick.
pub const EXECUTOR: Role = Role("executor");
/// Compares what was predicted with what is seen.
pub const VERIFIER: Role = Role("verifier");
/// The port to camera, clock and robot.
pub const HOST: Role = Role("host");
/// The port to a language model; only there where one is used.
pub const LLM: Role = Role("llm");

/// A memory view in a message. Written down as what a reader of the trace needs of it: objects with their places.
#[derive(Clone)]
pub struct View(pub Arc<dyn MemoryView>);

impl fmt::Debug for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "View({} objects)", self.0.objects().len())
    }
}

impl Serialize for View {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let objects: Vec<_> = self.0.objects().iter().map(ObjectLine::new).collect();
        let mut view = serializer.serialize_struct("View", 3)?;
        view.serialize_field("objects", &objects)?;
        view.serialize_field("transitions", &self.0.transitions().len())?;
        view.serialize_field("progress", self.0.progress())?;
        view.end()
    }
}

/// One object of a serialised view.
#[derive(Serialize)]
struct ObjectLine<'a> {
    id: acm_concept::ids::ObjectId,
    category: &'a str,
    presence: acm_memory::entry::Presence,
    at: Option<[f64; 3]>,
    on: Option<acm_concept::ids::ObjectId>,
    verified: bool,
}

impl<'a> ObjectLine<'a> {
    fn new(object: &'a acm_memory::entry::ObjectEntry) -> Self {
        ObjectLine {
            id: object.id,
            category: &object.category,
            presence: object.presence,
            at: object.pose().map(|pose| pose.translation.to_array()),
            on: object.support,
            verified: object.verified,
        }
    }
}

/// A message body. Each variant's doc names sender and receiver. It is written down without its kind, which stands
/// beside it in every journal.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum Message {
    /// outside -> episode: begin.
    Begin,
    /// outside -> episode: end as soon as possible, with the robot stopped.
    Interrupt,

    /// episode -> memory: take a new frame into account; `nouns` are those of the instruction.
    Look {
        /// Why, for the trace.
        reason: String,
        /// Nouns of the instruction.
        nouns: Vec<String>,
    },
    /// memory -> perception: what should be seen.
    Expected(Expectation),
    /// perception -> host: take a frame with the main camera.
    Capture,
    /// host -> perception: a frame is on the bus under its id.
    Frame {
        /// The frame without its pixels.
        header: FrameHeader,
        /// What the arm reported when it was taken.
        feedback: Feedback,
    },
    /// perception -> memory: what the frame shows.
    Percepts {
        /// The grounded frame.
        percepts: Box<Percepts>,
        /// What the arm reported when it was taken.
        feedback: Feedback,
    },
    /// memory -> episode: the frame is taken in.
    Updated {
        /// Identities and absences.
        grounding: Grounding,
        /// Why nothing could be seen, if so.
        blindness: Option<acm_concept::object::Blindness>,
        /// The arm's report with the frame.
        feedback: Feedback,
        /// Memory now.
        view: View,
    },

    /// episode -> memory: keep a note.
    Note(Note),
    /// episode -> memory: forget everything (a fault set for a test).
    Wipe,
    /// episode -> memory: forget everything and believe what another memory came to (a fault set for a test).
    Transplant,
    /// episode -> memory: keep a finished skill.
    Record(Box<Executed>),
    /// episode -> memory: the verifier's answer on a transition.
    Settle {
        /// The transition.
        transition: TransitionId,
        /// The answer.
        verdict: Verdict,
    },
    /// memory -> episode: done; memory now, and the transition that was kept, if one was.
    Kept {
        /// The transition.
        transition: Option<TransitionId>,
        /// Memory now.
        view: View,
    },

    /// episode -> planner: read the instruction.
    Parse {
        /// The instruction.
        instruction: String,
    },
    /// planner -> llm: ask the model.
    AskLlm {
        /// What.
        request: Box<ChatRequest>,
    },
    /// llm -> planner: what the model replied, or why it did not.
    LlmReplied(Box<Answer>),
    /// planner -> episode: the task, or why it cannot be read.
    Parsed {
        /// Either.
        #[serde(flatten)]
        task: Result<Arc<Task>, String>,
        /// What a language model had to do with it, where one was asked.
        #[serde(skip_serializing_if = "Option::is_none")]
        reading: Option<Box<Reading>>,
    },
    /// episode -> planner: what next?
    Decide {
        /// The task.
        task: Arc<Task>,
        /// Time, arm and budget.
        situation: Box<Situation>,
        /// Memory now.
        view: View,
    },
    /// planner -> episode: the decision; with the bound skill where it is to act.
    Decided {
        /// What to do.
        decision: Box<Decision>,
        /// The skill bound to perceived geometry, if the decision is to act.
        invocation: Option<Box<SkillInvocation>>,
        /// What a language model had to do with it, where one was asked.
        #[serde(skip_serializing_if = "Option::is_none")]
        counsel: Option<Box<Counsel>>,
    },

    /// episode -> executor: run a skill.
    Execute(Box<SkillInvocation>),
    /// episode -> executor: bring the hand out of the camera's way.
    Retreat,
    /// executor -> host: what does the arm report?
    Sense,
    /// executor -> host: perform one control tick.
    Command(Command),
    /// host -> executor: the arm's report after a tick.
    Moved(Feedback),
    /// host -> executor: the robot refused or failed.
    Refused {
        /// Why.
        reason: String,
        /// Whether it will never move again.
        fatal: bool,
    },
    /// executor -> episode: a skill ended.
    SkillEnded(Box<SkillReport>),
    /// executor -> episode: the hand is out of the way, or why not.
    Retreated {
        /// Why the hand is not where it should be.
        failure: Option<String>,
    },

    /// episode -> verifier: did it come out as predicted?
    Verify {
        /// The transition.
        transition: TransitionId,
        /// Predicted literals.
        predicted: Vec<Literal>,
        /// The executor's report.
        report: Box<SkillReport>,
        /// Memory now.
        view: View,
    },
    /// verifier -> episode: the answer.
    Verdict {
        /// The transition.
        transition: TransitionId,
        /// The answer.
        verdict: Verdict,
    },

    /// episode -> host: let time pass, in seconds.
    Wait {
        /// How long.
        seconds: f64,
    },
    /// host -> episode: time has passed.
    Waited,
    /// host, perception or memory -> episode: something outside failed for good.
    Broken {
        /// What, in words for the user.
        reason: String,
    },
    /// supervisor -> episode: an actor failed.
    ActorFailed {
        /// Which.
        role: &'static str,
        /// Of what.
        reason: String,
        /// Whether a new one has taken its place.
        restarted: bool,
    },

    /// episode -> outside: the end.
    Ended(Box<EpisodeReport>),
}

impl Payload for Message {
    fn kind(&self) -> &'static str {
        match self {
            Message::Begin => "begin",
            Message::Interrupt => "interrupt",
            Message::Look { .. } => "look",
            Message::Expected(_) => "expected",
            Message::Capture => "capture",
            Message::Frame { .. } => "frame",
            Message::Percepts { .. } => "percepts",
            Message::Updated { .. } => "updated",
            Message::Note(_) => "note",
            Message::Wipe => "wipe",
            Message::Transplant => "transplant",
            Message::Record(_) => "record",
            Message::Settle { .. } => "settle",
            Message::Kept { .. } => "kept",
            Message::Parse { .. } => "parse",
            Message::AskLlm { .. } => "ask-llm",
            Message::LlmReplied(_) => "llm-replied",
            Message::Parsed { .. } => "parsed",
            Message::Decide { .. } => "decide",
            Message::Decided { .. } => "decided",
            Message::Execute(_) => "execute",
            Message::Retreat => "retreat",
            Message::Sense => "sense",
            Message::Command(_) => "command",
            Message::Moved(_) => "moved",
            Message::Refused { .. } => "refused",
            Message::SkillEnded(_) => "skill-ended",
            Message::Retreated { .. } => "retreated",
            Message::Verify { .. } => "verify",
            Message::Verdict { .. } => "verdict",
            Message::Wait { .. } => "wait",
            Message::Waited => "waited",
            Message::Broken { .. } => "broken",
            Message::ActorFailed { .. } => "actor-failed",
            Message::Ended(_) => "ended",
        }
    }
    fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        serde_json::to_vec(self)
    }
    fn routine(&self) -> bool {
        matches!(self, Message::Command(_) | Message::Moved(_))
    }
}
