//! `push-along`: shove a thing over what it stands on with closed fingers that point down.
//!
//! The frame lies on the side that is pushed, at half of the thing's height, z level and out of it: the thing goes
//! against z. Arguments: `travel`, how far it shall go, metres. It must be felt until the end of the way, and it must
//! not stop before.

use super::{
    argument,
    articulated::{Drive, DriveKind, Felt},
};
use crate::{articulation::Articulation, controller::StartError, geometry::downward, hand::Hand};
use acm_concept::{pose::Pose, skill::SkillInvocation};
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// Height at which the finger tips stay above the support, metres.
const TIP_CLEARANCE_M: f64 = 0.004;

/// What shoves the thing.
pub(crate) fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<Drive, StartError> {
    let out = invocation.frame.transform_vector(DVec3::Z);
    let level = out.with_z(0.0).normalize_or(DVec3::X);
    let lowest_m = invocation.support_height_m + hand.tip_reach_m + TIP_CLEARANCE_M;
    let height_m = invocation.frame.translation.z.max(lowest_m);
    let heading_rad = (-level.y).atan2(-level.x);
    // The fingers' flat sides first, then their edges.
    let contacts = [0.0, FRAC_PI_2].map(|turn| {
        let half = fingers_half(hand);
        let reach_m = if turn == 0.0 { half.x } else { half.y };
        let at = (invocation.frame.translation + reach_m * level).with_z(height_m);
        downward(at, heading_rad + turn)
    });
    let kind = DriveKind {
        what: "push it",
        joint: Articulation::Prismatic { direction: -level },
        travel: argument(invocation, "travel")?,
        to_stop: false,
        felt: Felt::Nothing,
    };
    Drive::at(invocation, hand, kind, &contacts, DVec3::Z)
}

/// Half of the extents of the closed fingers across the approach direction, metres.
fn fingers_half(hand: &Hand) -> DVec3 {
    let fingers = hand.robot.solids(&Pose::IDENTITY, 0.0);
    let fingers = fingers.iter().skip(hand.robot.hand.len());
    fingers.map(|part| part.pose.translation.abs() + part.half_extents()).fold(DVec3::ZERO, DVec3::max)
}
