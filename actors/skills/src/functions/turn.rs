//! `turn`: take a knob, a tap or a dial between the fingers, turn it about its axis, let go.
//!
//! The frame lies in the knob on its axis, z out of the part along the axis, y across the knob. Arguments: `grip_width`,
//! the knob's width along y, metres; `angle`, how far to turn it, radians; `sense`, below 0 for clockwise as seen by who
//! looks at the knob (1 if absent).

use super::{
    argument,
    articulated::{Draw, DrawKind, Felt},
    number,
};
use crate::{articulation::Articulation, controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};
use glam::DVec3;

/// What turns the knob.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<Draw, StartError> {
    let axis = invocation.frame.transform_vector(DVec3::Z);
    let kind = DrawKind {
        what: "turn it",
        primitive: Primitive::Rotate,
        joint: Articulation::Revolute { point: invocation.frame.translation, axis },
        travel: argument(invocation, "angle")?.copysign(number(invocation, "sense", 1.0)),
        attached: true,
        to_stop: false,
        felt: Felt::Nothing,
    };
    Draw::plan(invocation, hand, kind)
}
