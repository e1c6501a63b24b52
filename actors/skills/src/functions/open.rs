//! `hinge-open` and `slide-open`: take a handle or an edge between the fingers, lead the part along its joint, let go.
//!
//! The frame lies in the handle, z out of the part, y across it. Arguments: `grip_width`, the handle's width along y,
//! metres, and those of the joint, in the frame:
//! - `hinge-open`: `angle`, how far to swing the part, radians; `hinge_x`, `hinge_y`, `hinge_z`, a point of the hinge's
//!   axis, metres, and `axis_x`, `axis_y`, `axis_z`, its direction, about which opening turns right-handed;
//! - `slide-open`: `travel`, how far to draw the part, metres; `axis_x`, `axis_y`, `axis_z`, the direction of opening
//!   (the z axis if absent: a drawer; another one for a sliding door).
//!
//! Without `grip_width` the part has no handle: the frame lies on the narrow face at its free edge, z out of that face, and
//! closed finger tips press on it and drag the part along.

use super::{
    argument,
    articulated::{Draw, DrawKind, Felt, Jointed, joint},
    drag::Drag,
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};

/// What draws the part by its handle.
pub(crate) fn draw(invocation: &SkillInvocation, hand: &Hand, jointed: Jointed) -> Result<Draw, StartError> {
    Draw::plan(invocation, hand, kind(invocation, jointed)?)
}

/// What drags the part by its edge.
pub(crate) fn drag(invocation: &SkillInvocation, hand: &Hand, jointed: Jointed) -> Result<Drag, StartError> {
    Drag::plan(invocation, hand, kind(invocation, jointed)?)
}

fn kind(invocation: &SkillInvocation, jointed: Jointed) -> Result<DrawKind, StartError> {
    Ok(DrawKind {
        what: "open it",
        primitive: Primitive::Pull,
        joint: joint(invocation, jointed.axis),
        travel: argument(invocation, jointed.travel)?,
        attached: true,
        to_stop: false,
        felt: Felt::Open,
    })
}
