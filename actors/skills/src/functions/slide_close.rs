//! `slide-close`: press closed finger tips against a part and slide it shut.
//!
//! The frame lies on the face that is pressed, z out of it. Arguments: `travel`, how far it stands open, metres;
//! `axis_x`, `axis_y`, `axis_z`, the direction of opening in the frame (its z axis if absent). With `grip_width` the frame lies in the
//! handle as for the opening, and the hand draws the part shut by it. It must be stopped in the
//! end: what nothing stops is not shut.

use super::{
    argument,
    articulated::{Draw, DrawKind, Drive, DriveKind, Felt, joint},
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};
use glam::DVec3;

/// What pushes the drawer.
pub(crate) fn push(invocation: &SkillInvocation, hand: &Hand) -> Result<Drive, StartError> {
    let kind = DriveKind {
        what: "shut it",
        joint: joint(invocation, DVec3::Z),
        travel: -argument(invocation, "travel")?,
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
        joint: joint(invocation, DVec3::Z),
        travel: -argument(invocation, "travel")?,
        attached: true,
        to_stop: true,
        felt: Felt::Closed,
    };
    Draw::plan(invocation, hand, kind)
}
