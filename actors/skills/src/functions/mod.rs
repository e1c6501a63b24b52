//! The function kinds: manipulation functions as sequences of primitives.

pub(crate) mod articulated;
mod ending;
mod held;

pub(crate) mod close;
pub(crate) mod drag;
pub(crate) mod flip;
pub(crate) mod grasp_along;
pub(crate) mod grasp_from_above;
pub(crate) mod insert_along;
pub(crate) mod move_to;
pub(crate) mod open;
pub(crate) mod place_upright;
pub(crate) mod press;
pub(crate) mod press_down;
pub(crate) mod pull_along;
pub(crate) mod push_along;
pub(crate) mod reach;
pub(crate) mod release;
pub(crate) mod rotate;
pub(crate) mod suck_from_above;
pub(crate) mod turn;

use crate::{
    controller::StartError,
    hand::{Hand, holds_something},
};
use acm_concept::{embodiment::Feedback, skill::SkillInvocation};

/// A named argument that must be finite and positive.
pub(crate) fn argument(invocation: &SkillInvocation, name: &'static str) -> Result<f64, StartError> {
    let value = invocation.arguments.get(name).copied();
    value.filter(|value| value.is_finite() && *value > 0.0).ok_or_else(|| StartError::Argument {
        kind: invocation.kind.clone(),
        argument: name,
        got: value.map_or_else(|| "nothing".into(), |value| value.to_string()),
    })
}

/// A named number that may have any sign; the default where it is not bound or not finite.
pub(crate) fn number(invocation: &SkillInvocation, name: &str, default: f64) -> f64 {
    invocation.arguments.get(name).copied().filter(|value| value.is_finite()).unwrap_or(default)
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
