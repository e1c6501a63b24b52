//! `slide-close`: press closed finger tips against a part and slide it shut.
//!
//! The frame lies on the face that is pressed, z out of it. Arguments: `travel`, how far it stands open, metres;
//! `axis_x`, `axis_y`, `axis_z`, the direction of opening in the frame (its z axis if absent). It must be stopped in the
//! end: what nothing stops is not shut.

use super::{
    argument,
    articulated::{Drive, DriveKind, Felt, joint},
};
use crate::{controller::StartError, hand::Hand};
use acm_concept::skill::SkillInvocation;
use glam::DVec3;

/// What moves the drawer.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<Drive, StartError> {
    let kind = DriveKind {
        what: "shut it",
        joint: joint(invocation, DVec3::Z),
        travel: -argument(invocation, "travel")?,
        to_stop: true,
        felt: Felt::Closed,
    };
    Drive::plan(invocation, hand, kind)
}
