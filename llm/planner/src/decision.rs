//! What the planner is told of the moment, and what it answers.

use crate::explanation::{Explanation, Grounds};
use acm_concept::{embodiment::Feedback, skill::FailureCause, task::OnUnknown, time::Time};
use acm_memory::query::{Prediction, SkillCandidate};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The moment of a decision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Situation {
    /// Now.
    pub time: Time,
    /// What the arm reports.
    pub feedback: Feedback,
    /// Looks taken in a row without acting in between.
    pub looks: u32,
    /// When the instruction's time is over.
    pub deadline: Time,
    /// Skills that may still be executed.
    pub skills_left: u32,
}

/// How the planner behaves where memory does not decide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanOptions {
    /// Give up and say so, or draw among the candidates.
    pub on_unknown: OnUnknown,
    /// Seed of the draws; with the same seed and memory the same is drawn.
    pub seed: u64,
}

impl Default for PlanOptions {
    fn default() -> Self {
        PlanOptions { on_unknown: OnUnknown::Abstain, seed: 0 }
    }
}

/// What to do next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(
    clippy::large_enum_variant,
    reason = "one decision at a time: matching without a box is worth more than its size"
)]
pub enum Decision {
    /// Run a skill.
    Act {
        /// The skill.
        step: Step,
        /// Why this one.
        explanation: Explanation,
    },
    /// Observe again before deciding. Bounded by the planner: it counts [`Situation::looks`].
    Look {
        /// What the look is for.
        reason: String,
        /// What it rests on.
        #[serde(default)]
        grounds: Grounds,
    },
    /// The current subtask is done; memory should note it.
    SubtaskDone {
        /// Its index.
        index: u32,
        /// Why it counts as done.
        reason: String,
        /// What it rests on.
        #[serde(default)]
        grounds: Grounds,
    },
    /// The whole instruction is done.
    Done {
        /// Why it counts as done.
        reason: String,
    },
    /// Nothing honest is left to do.
    GiveUp {
        /// What is not known or not possible.
        unknown: Unknown,
        /// What it rests on.
        #[serde(default)]
        grounds: Grounds,
    },
}

/// A skill to run now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The skill on its part.
    pub candidate: SkillCandidate,
    /// The subtask it serves.
    pub subtask: u32,
    /// Failed tries of this skill on this object in this subtask so far: each asks for other parameters.
    pub attempt: u32,
    /// What memory expects of it.
    pub prediction: Prediction,
    /// Whether its object or destination was drawn because memory did not decide.
    pub guessed: bool,
}

/// Why the agent gives up.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unknown {
    /// Kind of reason.
    pub cause: GiveUpCause,
    /// One sentence that names what the agent does not know or cannot do.
    pub text: String,
}

/// Kinds of reason for giving up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GiveUpCause {
    /// Something that is needed was not seen.
    Perception,
    /// It is not decided which object is meant, or which one it is.
    Identity,
    /// Memory does not hold what the instruction refers to.
    Memory,
    /// No sequence of skills leads there.
    Plan,
    /// Repeated grasps failed.
    Grasp,
    /// Repeated placing failed.
    Place,
    /// Repeated presses failed.
    Press,
    /// Repeated motions failed.
    Motion,
    /// Time or skills ran out.
    Budget,
}

impl GiveUpCause {
    /// The word used in tables.
    pub fn word(self) -> &'static str {
        match self {
            GiveUpCause::Perception => "perception",
            GiveUpCause::Identity => "identity",
            GiveUpCause::Memory => "memory",
            GiveUpCause::Plan => "plan",
            GiveUpCause::Grasp => "grasp",
            GiveUpCause::Place => "place",
            GiveUpCause::Press => "press",
            GiveUpCause::Motion => "motion",
            GiveUpCause::Budget => "budget",
        }
    }
}

impl From<FailureCause> for GiveUpCause {
    fn from(cause: FailureCause) -> Self {
        match cause {
            FailureCause::Perception => GiveUpCause::Perception,
            FailureCause::Identity => GiveUpCause::Identity,
            FailureCause::Plan => GiveUpCause::Plan,
            FailureCause::Grasp => GiveUpCause::Grasp,
            FailureCause::Place => GiveUpCause::Place,
            FailureCause::Press => GiveUpCause::Press,
            FailureCause::Motion => GiveUpCause::Motion,
        }
    }
}

impl fmt::Display for GiveUpCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.text, self.cause)
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&crate::explanation::step_words(&self.candidate))?;
        if self.attempt > 0 {
            write!(f, ", attempt {}", self.attempt + 1)?;
        }
        if self.guessed { f.write_str(", guessed") } else { Ok(()) }
    }
}
