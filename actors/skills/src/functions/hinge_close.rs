//! `hinge-close`: press closed finger tips against the outside of a part and swing it shut about its hinge.
//!
//! The frame lies on the outside, far from the hinge, z out of the part. Arguments: `angle`, how far it stands open,
//! radians; `hinge_x`, `hinge_y`, `hinge_z` and `axis_x`, `axis_y`, `axis_z` as for `hinge-open`. With `grip_width` the frame lies in the
//! handle as for the opening, and the hand draws the part shut by it. It must be stopped in
//! the end: what nothing stops is not shut.

use super::{
    argument,
    articulated::{Draw, DrawKind, Drive, DriveKind, Felt, joint},
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};
use glam::DVec3;

/// What pushes the door.
pub(crate) fn push(invocation: &SkillInvocation, hand: &Hand) -> Result<Drive, StartError> {
    let kind = DriveKind {
        what: "shut it",
        joint: joint(invocation, DVec3::X),
        travel: -argument(invocation, "angle")?,
        to_stop: true,
        felt: Felt::Closed,
    };
    Drive::plan(invocation, hand, kind)
}

/// What draws it by its handle.
pub(crate) fn draw(invocation: &SkillInvocation, hand: &Hand) -> Result<Draw, StartError> {
    let kind = DrawKind {
        what: "shut it",
        primitive: Primitive::Pull,
        joint: joint(invocation, DVec3::X),
        travel: -argument(invocation, "angle")?,
        attached: true,
        to_stop: true,
        felt: Felt::Closed,
    };
    Draw::plan(invocation, hand, kind)
}
