//! `hinge-open` and `slide-open`: take a handle or an edge between the fingers, lead the part along its joint, let go.
//!
//! The frame lies in the handle, z out of the part, y across it. Arguments: `grip_width`, the handle's width along y,
//! metres, and those of the joint, in the frame:
//! - `hinge-open`: `angle`, how far to swing the part, radians; `hinge_x`, `hinge_y`, `hinge_z`, a point of the hinge's
//!   axis, metres, and `axis_x`, `axis_y`, `axis_z`, its direction, about which opening turns right-handed;
//! - `slide-open`: `travel`, how far to draw the part, metres; `axis_x`, `axis_y`, `axis_z`, the direction of opening
//!   (the z axis if absent: a drawer; another one for a sliding door).

use super::{
    argument,
    articulated::{Draw, DrawKind, Felt, Jointed, joint},
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};

/// What moves the part.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand, jointed: Jointed) -> Result<Draw, StartError> {
    let kind = DrawKind {
        what: "open it",
        primitive: Primitive::Pull,
        joint: joint(invocation, jointed.axis),
        travel: argument(invocation, jointed.travel)?,
        attached: true,
        to_stop: false,
        felt: Felt::Open,
    };
    Draw::plan(invocation, hand, kind)
}
