//! `slide-open`: take a handle between the fingers, draw the part along its slide, let go.
//!
//! The frame lies in the handle, z out of the part, y across it. Arguments: `grip_width`, the handle's width along y,
//! and `travel`, how far to draw it, metres; `axis_x`, `axis_y`, `axis_z`, the direction of opening in the frame (its z
//! axis if absent: a drawer; another one for a sliding door).

use super::{
    argument,
    articulated::{Draw, DrawKind, Felt, joint},
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};
use glam::DVec3;

/// What moves the drawer.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<Draw, StartError> {
    let kind = DrawKind {
        what: "open it",
        primitive: Primitive::Pull,
        joint: joint(invocation, DVec3::Z),
        travel: argument(invocation, "travel")?,
        attached: true,
        to_stop: false,
        felt: Felt::Open,
    };
    Draw::plan(invocation, hand, kind)
}
