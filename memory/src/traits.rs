//! The two traits behind which every memory stands.

use crate::{
    entry::{ObjectEntry, SkillEntry, TaskProgress, Transition},
    event::Event,
    joint::{self, FeltJoint},
    observation::{Executed, Grounding, Note, Observation, Verdict},
    query::{Applicability, ObjectQuery, PlaceReference, Prediction, Recall, Retrieval, SkillCandidate},
    recent::Recent,
};
use acm_concept::{
    expectation::Expectation,
    ids::{ObjectId, PartId, SkillId, TransitionId},
    literal::{Belief, Literal, Place},
    object::SupportPlane,
    template::TemplateLibrary,
    time::Time,
};
use std::{path::PathBuf, sync::Arc};
use thiserror::Error;

/// Why memory could not take or give something.
#[derive(Debug, Error)]
pub enum MemoryError {
    /// The memory folder cannot be read or written.
    #[error("memory folder {path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's complaint.
        source: std::io::Error,
    },
    /// The folder was written by a program with another format number.
    #[error(
        "memory folder {path} has format {found}, this program reads format {known}: use another folder, or the program that wrote it"
    )]
    Format {
        /// The file that says so.
        path: PathBuf,
        /// The number found.
        found: u32,
        /// The number that is read.
        known: u32,
    },
    /// A record that is whole by its checksum but has no meaning.
    #[error("memory log {path}, record {record}: {reason}")]
    Record {
        /// The log.
        path: PathBuf,
        /// Number of the record, from 0.
        record: u64,
        /// What is wrong.
        reason: String,
    },
    /// Another process writes this memory.
    #[error("memory folder {path} is in use by another process")]
    Locked {
        /// The folder.
        path: PathBuf,
    },
    /// A folder that holds no memory.
    #[error("{path} holds no memory: it has no file FORMAT")]
    Missing {
        /// The folder.
        path: PathBuf,
    },
    /// A memory that is no sum of events.
    #[error("the memory `{0}` cannot take another one's content")]
    NotTransplantable(String),
    /// A transition that memory does not know.
    #[error("there is no transition {0}")]
    UnknownTransition(TransitionId),
    /// Identities that cannot be merged, split or undone so.
    #[error("{0}")]
    Regrouping(String),
    /// A skill that memory does not know.
    #[error("there is no skill {0}")]
    UnknownSkill(SkillId),
}

/// A memory that an agent writes to. One writer; readers take views.
pub trait Memory: Send {
    /// Name of the method, as `--method` takes it.
    fn name(&self) -> &str;
    /// What a camera should see at `now`. The caller adds the robot's solids and the instruction's nouns.
    fn expect(&self, now: Time) -> Expectation;
    /// Takes a grounded frame: resolves identities, updates objects and scene.
    fn observe(&mut self, observation: &Observation<'_>) -> Result<Grounding, MemoryError>;
    /// Keeps a finished skill as a transition and applies its predicted effects as beliefs to be verified.
    fn record(&mut self, executed: &Executed) -> Result<TransitionId, MemoryError>;
    /// Takes the verifier's answer on a transition; verified ones are consolidated into skill memory.
    fn settle(&mut self, transition: TransitionId, verdict: &Verdict) -> Result<(), MemoryError>;
    /// Keeps a note.
    fn note(&mut self, note: &Note) -> Result<(), MemoryError>;
    /// Forgets everything dynamic: objects, scene, transitions, skills, progress.
    fn wipe(&mut self) -> Result<(), MemoryError>;
    /// Forgets everything dynamic and believes what another memory of this kind came to by its events, as a fault for
    /// tests; see [`read_events`](crate::read_events). Nothing is begun by it: the caller notes the run and the
    /// instruction anew.
    fn transplant(&mut self, _events: &[Event]) -> Result<(), MemoryError> {
        Err(MemoryError::NotTransplantable(self.name().into()))
    }
    /// An immutable view of the present state; cheap to take.
    fn view(&self) -> Arc<dyn MemoryView>;
    /// The events that came after the first `known` ones since this memory was opened: what changed, for whoever
    /// writes it down. A memory that is no sum of events gives none.
    fn events_since(&self, _known: u64) -> Recent {
        Recent::default()
    }
}

/// What can be read from a memory. Views do not change while the writer goes on.
pub trait MemoryView: Send + Sync {
    /// The semantic and template libraries.
    fn library(&self) -> &TemplateLibrary;
    /// All objects, in the order of their ids.
    fn objects(&self) -> &[ObjectEntry];
    /// All transitions that this memory keeps, oldest first.
    fn transitions(&self) -> &[Transition];
    /// All skill entries.
    fn skills(&self) -> &[SkillEntry];
    /// Where the agent is in its instruction.
    fn progress(&self) -> &TaskProgress;
    /// The surface on which things stand, once seen.
    fn support(&self) -> Option<&SupportPlane>;
    /// Frames observed so far in this episode that showed something.
    fn frames_seen(&self) -> u32;

    /// Objects that fit a description, coarse to fine.
    fn retrieve(&self, query: &ObjectQuery) -> Retrieval;
    /// A place in an object's present or past.
    fn recall_place(&self, object: ObjectId, reference: PlaceReference) -> Recall<Place>;
    /// What is believed of a ground literal.
    fn belief(&self, literal: &Literal) -> Belief;
    /// The skills that could act on an object, best success first.
    fn skill_candidates(&self, object: ObjectId, destination: Option<Place>) -> Vec<SkillCandidate>;
    /// Whether preconditions hold.
    fn applicable(&self, preconditions: &[Literal]) -> Applicability {
        Applicability { conditions: preconditions.iter().map(|l| (l.clone(), self.belief(l))).collect() }
    }
    /// What a skill is expected to bring about, from declared effects and past transitions.
    fn predict(&self, candidate: &SkillCandidate) -> Prediction;

    /// The hinge or slide of a part as the last hand that moved it felt it, in the part's frame.
    fn felt_joint(&self, part: PartId) -> Option<FeltJoint> {
        joint::felt_joint(self, part)
    }

    /// One object.
    fn object(&self, id: ObjectId) -> Option<&ObjectEntry> {
        self.objects().iter().find(|object| object.id == id)
    }
    /// The object in the hand.
    fn held(&self) -> Option<&ObjectEntry> {
        self.objects().iter().find(|object| object.presence == crate::entry::Presence::Held)
    }
}
