//! The function kinds: manipulation functions as sequences of primitives.

pub(crate) mod grasp_from_above;
pub(crate) mod place_upright;
pub(crate) mod press_down;
pub(crate) mod suck_from_above;

use crate::{
    controller::StartError,
    hand::{Hand, holds_something},
};
use acm_concept::{embodiment::Feedback, skill::SkillInvocation};

/// Room that a hand should have to every perceived neighbour, metres.
pub(crate) const ROOMY_M: f64 = 0.005;
/// How far perceived geometry may be off: an overlap up to this is tried, carefully; metres.
pub(crate) const PERCEPTION_ERROR_M: f64 = 0.008;

/// A named argument that must be finite and positive.
pub(crate) fn argument(invocation: &SkillInvocation, name: &'static str) -> Result<f64, StartError> {
    let value = invocation.arguments.get(name).copied();
    value.filter(|value| value.is_finite() && *value > 0.0).ok_or_else(|| StartError::Argument {
        kind: invocation.kind.clone(),
        argument: name,
        got: value.map_or_else(|| "nothing".into(), |value| value.to_string()),
    })
}

/// Refuses a hand in which something is.
pub(crate) fn require_empty_hand(invocation: &SkillInvocation, feedback: &Feedback) -> Result<(), StartError> {
    if holds_something(feedback) {
        return Err(StartError::HandNotEmpty { kind: invocation.kind.clone(), opening_m: feedback.opening_m });
    }
    Ok(())
}

/// Height of a rise from where the hand is to at least `height_m`, inside the workspace.
pub(crate) fn within_ceiling(hand: &Hand, height_m: f64) -> f64 {
    height_m.min(hand.robot.workspace_max.z)
}
