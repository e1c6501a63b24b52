//! What memory is told of a frame and of a skill, and what it answers.

use acm_concept::{
    camera::RgbdFrame,
    embodiment::Feedback,
    ids::ObjectId,
    literal::{Belief, Literal},
    object::Percepts,
    pose::Pose,
    skill::SkillReport,
    time::Time,
};
use serde::{Deserialize, Serialize};

/// One grounded frame with the frame itself: a memory that keeps frames may ask perception about them later.
#[derive(Debug, Clone)]
pub struct Observation<'a> {
    /// What perception says.
    pub percepts: &'a Percepts,
    /// The frame; cloning it copies no pixels.
    pub frame: &'a RgbdFrame,
    /// What the arm reported when the frame was taken.
    pub feedback: &'a Feedback,
}

/// The identity given to one percept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Resolved {
    /// Index into [`Percepts::objects`].
    pub percept: usize,
    /// The identity.
    pub object: ObjectId,
    /// Whether the identity is new.
    pub new: bool,
    /// Probability of this assignment, 0-1.
    pub probability: f64,
    /// Whether memory took the percept over; if not it is kept as unverified until a second view agrees.
    pub accepted: bool,
}

/// What an observation did to memory.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Grounding {
    /// Identities, in the order of the percepts. Percepts held to be false alarms do not appear.
    pub resolved: Vec<Resolved>,
    /// Objects that are now known to be gone from their place.
    pub missing: Vec<ObjectId>,
    /// Objects that were seen to have moved without the robot's doing.
    pub moved: Vec<ObjectId>,
    /// Set where all that is verified seemed to have moved in common: then nothing of it is believed to have moved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displaced: Option<Displaced>,
}

/// A frame that shows all that is verified displaced in common: not the world is elsewhere, the camera's view of it is
/// wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Displaced {
    /// What explains it.
    pub by: Displacement,
    /// How many things that stand apart from each other tell of it.
    pub things: u32,
    /// Root mean square distance of these things from where it takes them, metres.
    pub residual_m: f64,
    /// Whether it was accounted for: the frame was taken as the camera at its nominal pose would have seen it. Otherwise
    /// nothing that the frame shows was taken over.
    pub undone: bool,
}

/// What displaces all that a frame shows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Displacement {
    /// The camera is not where it is said to be: the motion, in the world frame, that takes things from where they are to
    /// where the frame shows them.
    Camera(Pose),
    /// Depths are wrong by this factor.
    Depth(f64),
}

/// A finished skill, to be kept as a transition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Executed {
    /// What the executor reported.
    pub report: SkillReport,
    /// The subtask it served.
    pub subtask: Option<u32>,
    /// The effects that were predicted.
    pub predicted: Vec<Literal>,
}

/// The verifier's answer on one predicted literal or on all of a skill's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Observed as predicted.
    Verified,
    /// Observed otherwise.
    Contradicted,
    /// Not decided by what was observed.
    CannotTell,
}

/// The comparison of a predicted literal with what was observed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LiteralVerdict {
    /// The predicted literal.
    pub literal: Literal,
    /// What memory believes of it after the look.
    pub observed: Belief,
    /// The comparison.
    pub outcome: Outcome,
}

/// The verifier's answer on a skill.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Contradicted if any literal is; else cannot-tell if any literal is; else verified.
    pub outcome: Outcome,
    /// Literal by literal.
    pub literals: Vec<LiteralVerdict>,
    /// One sentence for a person.
    pub reason: String,
}

/// Other things that memory keeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Note {
    /// A run begins; objects of earlier runs stay as beliefs that have to be seen again.
    EpisodeBegan,
    /// The instruction was given; earlier progress ends.
    Instructed {
        /// When.
        time: Time,
        /// The instruction.
        text: String,
    },
    /// A subtask of the instruction was found done.
    SubtaskDone {
        /// When.
        time: Time,
        /// Its index, from 0.
        index: u32,
    },
}
