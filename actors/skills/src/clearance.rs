//! Free space for the hand among perceived solids: how much room a downward approach leaves, how high to fly.

use crate::{
    controller::StartError,
    geometry::{footprint_radius, hand_radius_m, top_of},
    hand::Hand,
};
use acm_concept::{
    embodiment::RobotDescription,
    ids::ObjectId,
    pose::Pose,
    skill::SkillInvocation,
    solid::{Enclosure, PlacedSolid},
};
use glam::{DVec2, DVec3};

/// Room that a hand should have to every perceived neighbour, metres.
pub(crate) const ROOMY_M: f64 = 0.005;
/// How far perceived geometry may be off: an overlap up to this is tried, carefully; metres.
pub(crate) const PERCEPTION_ERROR_M: f64 = 0.008;
/// Distance between sample points on the hand's solids, metres.
const SPACING_M: f64 = 0.006;
/// Most sample points along one side of a solid.
const MAX_SAMPLES: u32 = 48;
/// What rises above the support by no more than this lies under the hand, not in its way, metres.
const FLAT_M: f64 = 0.006;
/// Room beyond this is all the same, metres.
pub(crate) const FREE_M: f64 = 0.05;
/// Height kept above everything perceived while travelling, metres.
pub(crate) const SAFETY_M: f64 = 0.04;
/// Height above the perceived contact from which the hand goes down guardedly, metres. Covers the error of
/// perceived heights, which is up to 15 mm with a biased depth camera.
pub(crate) const GUARD_M: f64 = 0.02;
/// The least of the safety that is left where the workspace's ceiling is low, metres.
const LEAST_SAFETY_M: f64 = 0.015;

/// The perceived solids that count as obstacles: neither the target, nor what is held, nor flat things on (or the
/// thing that is) the support at `support_m`.
pub(crate) fn obstacles(invocation: &SkillInvocation, support_m: f64) -> Vec<PlacedSolid> {
    let own = |id: &ObjectId| {
        *id == invocation.part.object || invocation.held.as_ref().is_some_and(|(held, _, _)| held == id)
    };
    let rises = |solid: &&(ObjectId, PlacedSolid)| !own(&solid.0) && top_of(&solid.1) > support_m + FLAT_M;
    invocation.obstacles.iter().filter(rises).map(|(_, solid)| *solid).collect()
}

/// Smallest distance between the hand on its way straight down to `tcp` and the obstacles: metres, negative when
/// it would be inside one, at most [`FREE_M`].
///
/// The hand is sampled on the lower faces of its solids; each sample sweeps the vertical line above it. For an
/// upright obstacle the line is nearest at the height of the obstacle's centre, or at the sample if that is higher.
pub(crate) fn approach_clearance(
    robot: &RobotDescription,
    tcp: &Pose,
    opening_m: f64,
    obstacles: &[PlacedSolid],
) -> f64 {
    let mut clearance = FREE_M;
    for part in robot.solids(tcp, opening_m) {
        for point in lower_face(&part) {
            for obstacle in obstacles {
                let swept = point.with_z(point.z.max(obstacle.pose.translation.z));
                clearance = clearance.min(obstacle.signed_distance(swept));
            }
        }
    }
    clearance
}

/// World points on the face of a solid that its own +z axis leaves through, which points down in a downward hand.
fn lower_face(part: &PlacedSolid) -> Vec<DVec3> {
    let half = part.solid.half_extents();
    let count = |half: f64| ((2.0 * half / SPACING_M).ceil() as u32).clamp(1, MAX_SAMPLES);
    let (columns, rows) = (count(half.x), count(half.y));
    let mut points = Vec::with_capacity(((columns + 1) * (rows + 1)) as usize);
    for column in 0..=columns {
        for row in 0..=rows {
            let x = half.x * (2.0 * f64::from(column) / f64::from(columns) - 1.0);
            let y = half.y * (2.0 * f64::from(row) / f64::from(rows) - 1.0);
            let outside =
                matches!(part.solid.enclosure(), Enclosure::Cylinder { radius, .. } if x.hypot(y) > radius + 1e-9);
            if !outside {
                points.push(part.pose.transform_point(DVec3::new(x, y, half.z)));
            }
        }
    }
    points
}

/// A TCP height at which the hand, with something hanging `below_m` under its TCP, can fly from `start` to `goal`
/// over the obstacles near that line and over `floor_m`. Lowered by a little where the workspace's ceiling demands.
pub(crate) fn safe_height(
    hand: &Hand,
    start: DVec3,
    goal: DVec3,
    obstacles: &[PlacedSolid],
    floor_m: f64,
    below_m: f64,
) -> Result<f64, StartError> {
    let margin = hand_radius_m(&hand.robot) + SAFETY_M;
    let near = |solid: &&PlacedSolid| {
        let center = solid.pose.translation.truncate();
        distance_to_line(center, start.truncate(), goal.truncate()) < margin + footprint_radius(solid)
    };
    let top = obstacles.iter().filter(near).map(top_of).fold(floor_m, f64::max);
    let wanted = top + below_m.max(hand.tip_reach_m) + SAFETY_M;
    let ceiling = hand.robot.workspace_max.z;
    if wanted - SAFETY_M + LEAST_SAFETY_M > ceiling {
        return Err(out_of_reach(
            &hand.robot,
            "the height at which the hand clears what it passes",
            goal.with_z(wanted),
        ));
    }
    Ok(wanted.min(ceiling))
}

fn distance_to_line(point: DVec2, start: DVec2, end: DVec2) -> f64 {
    let along = end - start;
    let fraction = if along.length_squared() > 0.0 { (point - start).dot(along) / along.length_squared() } else { 0.0 };
    point.distance(start + along * fraction.clamp(0.0, 1.0))
}

/// As [`within_reach`], for a position that a guarded descent goes down to: it may lie below the workspace by as much
/// as perceived heights may be off, since the descent ends at the workspace's floor.
pub(crate) fn within_guarded_reach(
    robot: &RobotDescription,
    what: &'static str,
    position: DVec3,
) -> Result<(), StartError> {
    let floor_m = robot.workspace_min.z;
    let in_guard = position.z < floor_m && position.z > floor_m - GUARD_M;
    if in_guard && robot.reaches(position.with_z(floor_m)) { Ok(()) } else { within_reach(robot, what, position) }
}

/// Refuses a TCP position outside the workspace.
pub(crate) fn within_reach(robot: &RobotDescription, what: &'static str, position: DVec3) -> Result<(), StartError> {
    if robot.reaches(position) { Ok(()) } else { Err(out_of_reach(robot, what, position)) }
}

fn out_of_reach(robot: &RobotDescription, what: &'static str, position: DVec3) -> StartError {
    StartError::OutOfReach { what, position, min: robot.workspace_min, max: robot.workspace_max }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::downward;
    use acm_concept::solid::Solid;
    use proptest::prelude::*;

    fn robot() -> RobotDescription {
        let finger = PlacedSolid {
            solid: Solid::Box { size: DVec3::new(0.02, 0.01, 0.05) },
            pose: Pose::from_translation(DVec3::new(0.0, 0.005, -0.013)),
        };
        let palm = PlacedSolid {
            solid: Solid::Box { size: DVec3::new(0.06, 0.2, 0.06) },
            pose: Pose::from_translation(DVec3::new(0.0, 0.0, -0.07)),
        };
        RobotDescription {
            name: "hand".into(),
            hand: vec![palm],
            finger: vec![finger],
            max_opening_m: 0.08,
            max_grip_force_n: 40.0,
            pad_half_length_m: 0.01,
            workspace_min: DVec3::new(-1.0, -1.0, 0.0),
            workspace_max: DVec3::new(1.0, 1.0, 0.5),
            max_speed_m_s: 0.5,
            max_turn_rad_s: 2.0,
            tick_s: 0.02,
            home: downward(DVec3::new(0.0, -0.4, 0.4), 0.0),
            ..RobotDescription::default()
        }
    }

    fn cube(x: f64, y: f64, z: f64) -> PlacedSolid {
        PlacedSolid {
            solid: Solid::Box { size: DVec3::splat(0.04) },
            pose: Pose::from_translation(DVec3::new(x, y, z)),
        }
    }

    #[test]
    fn a_neighbour_beside_a_finger_costs_room_only_across_it() {
        // The finger's outer face is at y = 0.03 + 0.01; the neighbour's near face at y = 0.043.
        let neighbour = [cube(0.0, 0.063, 0.02)];
        let across = approach_clearance(&robot(), &downward(DVec3::new(0.0, 0.0, 0.02), 0.0), 0.06, &neighbour);
        assert!((across - 0.003).abs() < 1e-9, "{across}");
        let quarter = std::f64::consts::FRAC_PI_2;
        let along = approach_clearance(&robot(), &downward(DVec3::new(0.0, 0.0, 0.02), quarter), 0.06, &neighbour);
        assert!((along - 0.0239).abs() < 1e-3, "{along}: the palm passes over the neighbour's edge");
    }

    #[test]
    fn what_a_finger_passes_on_its_way_down_counts() {
        // A plate above the finger's last pose, in the way of its descent.
        let plate = [PlacedSolid {
            solid: Solid::Box { size: DVec3::new(0.1, 0.02, 0.01) },
            pose: Pose::from_translation(DVec3::new(0.0, 0.045, 0.4)),
        }];
        assert!(approach_clearance(&robot(), &downward(DVec3::new(0.0, 0.0, 0.02), 0.0), 0.06, &plate) < 0.0);
    }

    #[test]
    fn the_safe_height_looks_only_at_what_lies_near_the_way() {
        let feedback = acm_concept::embodiment::Feedback {
            time: acm_concept::time::Time::ZERO,
            tcp: robot().home,
            joints: vec![],
            opening_m: 0.08,
            commanded_opening_m: 0.08,
            pad_force_n: [DVec3::ZERO; 2],
            wrist_force_n: DVec3::ZERO,
            ..acm_concept::embodiment::Feedback::default()
        };
        let hand = Hand::of_arm(&robot(), &feedback, 0);
        let height = |obstacle| safe_height(&hand, DVec3::ZERO, DVec3::X * 0.3, &[obstacle], 0.0, 0.03);
        assert_eq!(height(cube(0.15, 0.6, 0.2)), Ok(0.07));
        assert_eq!(height(cube(0.15, 0.0, 0.2)), Ok(0.22 + 0.03 + SAFETY_M));
        assert!(matches!(height(cube(0.15, 0.0, 0.45)), Err(StartError::OutOfReach { .. })));
    }

    proptest! {
        #[test]
        fn clearance_never_grows_with_more_obstacles(x in -0.2..0.2f64, y in -0.2..0.2f64, z in 0.0..0.2f64, heading in -3.0..3.0f64) {
            let tcp = downward(DVec3::new(0.0, 0.0, 0.02), heading);
            let one = approach_clearance(&robot(), &tcp, 0.06, &[cube(0.09, 0.0, 0.02)]);
            let two = approach_clearance(&robot(), &tcp, 0.06, &[cube(0.09, 0.0, 0.02), cube(x, y, z)]);
            prop_assert!(two <= one && one <= FREE_M);
        }
    }
}
