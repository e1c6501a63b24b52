//! `pull-along`: take a thing that stands freely between the fingers, draw it over what it stands on, let go.
//!
//! The frame lies where the fingers close, z out of the thing, y across it. Arguments: `grip_width`, the thing's width
//! along y, and `travel`, how far to draw it, metres; `axis_x`, `axis_y`, `axis_z`, the direction in the frame (its x axis
//! if absent).

use super::{
    argument,
    articulated::{Draw, DrawKind, Felt, joint},
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};
use glam::DVec3;

/// What draws the thing.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<Draw, StartError> {
    let kind = DrawKind {
        what: "pull it",
        primitive: Primitive::Pull,
        joint: joint(invocation, DVec3::X),
        travel: argument(invocation, "travel")?,
        attached: false,
        to_stop: false,
        felt: Felt::Nothing,
    };
    Draw::plan(invocation, hand, kind)
}
