//! `hinge-close` and `slide-close`: press closed finger tips against the outside of a part and lead it shut.
//!
//! The frame lies on the face that is pressed (of a hinged part far from the hinge), z out of it. Arguments: how far the
//! part stands open, `angle` in radians or `travel` in metres, and the joint as for [`open`](super::open). With
//! `grip_width` the frame lies in the handle as for the opening, and the hand draws the part shut by it. It must be
//! stopped in the end: what nothing stops is not shut.

use super::{
    argument,
    articulated::{Draw, DrawKind, Drive, DriveKind, Felt, Jointed, joint},
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::{primitive::Primitive, skill::SkillInvocation};

/// What pushes the part.
pub(crate) fn push(invocation: &SkillInvocation, hand: &Hand, jointed: Jointed) -> Result<Drive, StartError> {
    let kind = DriveKind {
        what: "shut it",
        joint: joint(invocation, jointed.axis),
        travel: -argument(invocation, jointed.travel)?,
        to_stop: true,
        felt: Felt::Closed,
    };
    Drive::plan(invocation, hand, kind)
}

/// What draws it by its handle.
pub(crate) fn draw(invocation: &SkillInvocation, hand: &Hand, jointed: Jointed) -> Result<Draw, StartError> {
    let kind = DrawKind {
        what: "shut it",
        primitive: Primitive::Pull,
        joint: joint(invocation, jointed.axis),
        travel: -argument(invocation, jointed.travel)?,
        attached: true,
        to_stop: true,
        felt: Felt::Closed,
    };
    Draw::plan(invocation, hand, kind)
}
