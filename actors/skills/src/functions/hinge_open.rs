//! `hinge-open`: take a handle or an edge between the fingers, swing the part about its hinge, let go.
//!
//! The frame lies in the handle, z out of the part, y across it. Arguments: `grip_width`, the handle's width along y,
//! metres; `angle`, how far to swing it, radians; `hinge_x`, `hinge_y`, `hinge_z`, a point of the hinge's axis, metres,
//! and `axis_x`, `axis_y`, `axis_z`, its direction, about which opening turns right-handed; both in the frame.

use super::{
    argument,
    articulated::{Draw, DrawKind, Felt, joint},
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};
use glam::DVec3;

/// What moves the door.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<Draw, StartError> {
    let kind = DrawKind {
        what: "open it",
        primitive: Primitive::Pull,
        joint: joint(invocation, DVec3::X),
        travel: argument(invocation, "angle")?,
        attached: true,
        to_stop: false,
        felt: Felt::Open,
    };
    Draw::plan(invocation, hand, kind)
}
