//! `move-to`: carry what is held until its base is at the destination, in the air, and keep it.
//!
//! No arguments. It is put down by `place-upright`.

use super::held::CarryHeld;
use crate::{controller::StartError, hand::Hand};
use acm_concept::skill::SkillInvocation;

/// What carries it.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<CarryHeld, StartError> {
    CarryHeld::to_destination(invocation, hand)
}
