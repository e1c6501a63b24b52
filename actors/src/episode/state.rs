//! Where an episode stands between two messages.

use acm_concept::{
    ids::TransitionId,
    skill::{FailureCause, SkillInvocation, SkillReport},
    time::Time,
};
use acm_memory::observation::{Executed, Outcome};
use serde::Serialize;
use std::{collections::BTreeMap, fmt, str::FromStr};
use thiserror::Error;

/// What the loop waits for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Doing {
    Starting,
    Beginning,
    Waiting,
    Looking,
    Parsing,
    Instructing,
    Deciding,
    Noting,
    Retreating,
    Executing,
    Recording,
    Verifying,
    Settling(Outcome),
    Wiping,
    Transplanting,
    Ended,
}

/// A finished skill that waits for its verdict.
pub(super) struct Pending {
    pub transition: Option<TransitionId>,
    pub executed: Executed,
    pub looks: u32,
}

/// What is to befall memory once in an episode, as a fault for tests.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Upheavals {
    /// When everything is forgotten.
    pub wipe_at: Option<FaultEvent>,
    /// When another memory's content takes the place of its own.
    pub transplant_at: Option<FaultEvent>,
}

/// An event at which something befalls memory.
///
/// ```
/// # use acm_actors::episode::FaultEvent;
/// assert_eq!("first-verified-place".parse(), Ok(FaultEvent::FirstVerified("place".into())));
/// assert_eq!("instruction".parse(), Ok(FaultEvent::Instruction));
/// assert!("noon".parse::<FaultEvent>().is_err());
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FaultEvent {
    /// When the instruction has been given.
    Instruction,
    /// When the first skill of this name was verified.
    FirstVerified(String),
}

/// The event at which a run is to end.
///
/// ```
/// # use acm_actors::episode::Until;
/// assert_eq!("instruction".parse(), Ok(Until::Instruction));
/// assert!("noon".parse::<Until>().is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Until {
    /// When the instruction would be given.
    Instruction,
}

impl fmt::Display for Until {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Until::Instruction => f.write_str("instruction"),
        }
    }
}

impl FromStr for Until {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "instruction" => Ok(Until::Instruction),
            _ => Err(format!("`{text}` is no event at which a run can end: write `instruction`")),
        }
    }
}

/// A text that names no event.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("`{0}` is no event: write `instruction` or `first-verified-SKILL`, such as `first-verified-place`")]
pub struct ParseEventError(String);

impl fmt::Display for FaultEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FaultEvent::Instruction => f.write_str("instruction"),
            FaultEvent::FirstVerified(skill) => write!(f, "first-verified-{skill}"),
        }
    }
}

impl FromStr for FaultEvent {
    type Err = ParseEventError;
    fn from_str(text: &str) -> Result<Self, ParseEventError> {
        match (text, text.strip_prefix("first-verified-")) {
            ("instruction", _) => Ok(FaultEvent::Instruction),
            (_, Some(skill)) if !skill.is_empty() => Ok(FaultEvent::FirstVerified(skill.into())),
            _ => Err(ParseEventError(text.into())),
        }
    }
}

/// The report of a skill whose executor is gone.
pub(super) fn lost_report(
    invocation: Box<SkillInvocation>,
    failure: Option<(FailureCause, String)>,
    now: Time,
) -> SkillReport {
    SkillReport {
        invocation: *invocation,
        failure,
        primitives: Vec::new(),
        started: now,
        ended: now,
        measured: BTreeMap::new(),
        felt: Vec::new(),
        left_at: None,
        held: None,
    }
}
