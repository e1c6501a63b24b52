//! `rotate`: turn what is held on the spot, and keep it.
//!
//! Arguments: `angle`, radians; `sense`, below 0 to turn the other way; `axis_x`, `axis_y`, `axis_z`, the axis in the TCP
//! frame (the approach direction if absent).

use super::{argument, held::CarryHeld, number};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};

/// What turns it.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<CarryHeld, StartError> {
    let angle = argument(invocation, "angle")?.copysign(number(invocation, "sense", 1.0));
    CarryHeld::turned(invocation, hand, Primitive::Rotate, angle)
}
