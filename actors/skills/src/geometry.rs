//! Where the hand must be: downward poses, headings, and how far hand and solids reach along the vertical.

use acm_concept::{
    embodiment::RobotDescription,
    pose::{Pose, wrap_angle},
    solid::PlacedSolid,
};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Widest angle between the hand's approach direction and straight down that still counts as pointing down.
const DOWNWARD_TOLERANCE_RAD: f64 = 0.1;

/// A TCP pose whose approach direction is straight down and whose x axis has the given heading.
pub(crate) fn downward(position: DVec3, heading_rad: f64) -> Pose {
    Pose::new(position, DQuat::from_rotation_z(heading_rad) * DQuat::from_rotation_x(PI))
}

/// Whether the approach direction is straight down, within tolerance.
pub(crate) fn points_down(tcp: &Pose) -> bool {
    tcp.transform_vector(DVec3::Z).angle_between(-DVec3::Z) < DOWNWARD_TOLERANCE_RAD
}

/// The heading that looks the same to a two-finger hand (it is symmetric under half a turn) and needs the
/// smallest turn from `reference_rad`.
pub(crate) fn nearest_heading(heading_rad: f64, reference_rad: f64) -> f64 {
    let difference = wrap_angle(heading_rad - reference_rad);
    let folded = difference - (difference / PI).round() * PI;
    wrap_angle(reference_rad + folded)
}

/// How far a solid reaches from its centre along a unit direction of its parent frame, metres.
fn reach_along(part: &PlacedSolid, direction: DVec3) -> f64 {
    part.solid.reach(part.pose.rotation.inverse() * direction)
}

/// World height of a solid's highest point, metres.
pub(crate) fn top_of(part: &PlacedSolid) -> f64 {
    part.pose.translation.z + reach_along(part, DVec3::Z)
}

/// Radius of the circle round a solid seen from above, metres. Never too small.
pub(crate) fn footprint_radius(part: &PlacedSolid) -> f64 {
    reach_along(part, DVec3::X).hypot(reach_along(part, DVec3::Y)).min(part.solid.bounding_radius())
}

/// How far the finger tips reach beyond the TCP along the approach direction, metres.
pub(crate) fn tip_reach_m(robot: &RobotDescription) -> f64 {
    let lowest = |part: &PlacedSolid| part.pose.translation.z + reach_along(part, DVec3::Z);
    robot.finger.iter().map(lowest).fold(robot.pad_half_length_m, f64::max)
}

/// Radius of the upright cylinder round the whole hand with open fingers, about the TCP's axis, metres.
pub(crate) fn hand_radius_m(robot: &RobotDescription) -> f64 {
    let solids = robot.solids(&Pose::IDENTITY, robot.max_opening_m);
    solids.iter().map(|part| part.pose.translation.truncate().length() + footprint_radius(part)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::solid::Solid;
    use proptest::prelude::*;

    #[test]
    fn the_hand_points_down_and_closes_across_its_heading() {
        let tcp = downward(DVec3::ZERO, 0.3);
        assert!(points_down(&tcp) && (tcp.yaw() - 0.3).abs() < 1e-12);
        let closing = tcp.transform_vector(DVec3::Y);
        assert!(closing.dot(DVec3::new(0.3f64.cos(), 0.3f64.sin(), 0.0)).abs() < 1e-12);
        assert!(!points_down(&Pose::IDENTITY));
    }

    #[test]
    fn a_tilted_box_reaches_its_diagonal() {
        let cube = Solid::Box { size: DVec3::splat(0.1) };
        let tilted = PlacedSolid { solid: cube, pose: Pose::new(DVec3::Z, DQuat::from_rotation_x(PI / 4.0)) };
        assert!((top_of(&tilted) - 1.0 - 0.05 * 2f64.sqrt()).abs() < 1e-12);
        let upright = PlacedSolid { solid: Solid::Cylinder { radius: 0.03, height: 0.2 }, pose: Pose::IDENTITY };
        assert!((top_of(&upright) - 0.1).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn the_nearest_heading_is_equivalent_and_within_a_quarter_turn(heading in -9.0..9.0f64, reference in -9.0..9.0f64) {
            let nearest = nearest_heading(heading, reference);
            prop_assert!(wrap_angle(nearest - reference).abs() <= PI / 2.0 + 1e-9);
            prop_assert!((2.0 * (nearest - heading)).sin().abs() < 1e-9 && (2.0 * (nearest - heading)).cos() > 0.99);
        }
    }
}
