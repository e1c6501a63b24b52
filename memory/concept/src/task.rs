//! What the agent is told of its task. Everything else of a scenario stays with the simulator and the judge.

use crate::camera::CameraModel;
use serde::{Deserialize, Serialize};

/// Limits of an episode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Budgets {
    /// Simulated or robot seconds after the instruction.
    pub seconds: f64,
    /// Skills that may be executed.
    pub skills: u32,
    /// Frames that may be perceived.
    pub frames: u32,
}

/// An instruction that follows when the one before it is done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Further {
    /// The instruction in plain language.
    pub instruction: String,
    /// How long the agent watches before it is given, seconds.
    pub after_s: f64,
}

/// The task as the agent gets it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TaskSpec {
    /// The instruction in plain language.
    pub instruction: String,
    /// When the instruction is given, seconds; until then the agent watches.
    pub instruction_at_s: f64,
    /// Limits; each instruction has them anew.
    pub budgets: Budgets,
    /// What is asked for next, each once the one before it is done.
    #[serde(default)]
    pub then: Vec<Further>,
    /// Cameras with nominal calibration; the first is the main one.
    pub cameras: Vec<CameraModel>,
}

/// What the agent does when memory cannot decide.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OnUnknown {
    /// Give up and say what is not known.
    #[default]
    Abstain,
    /// Take one of the candidates by a seeded draw, and say so.
    Guess,
}
