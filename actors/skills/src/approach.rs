//! Approaches from any side: where the hand must be to act at a frame, which of several ways is the freest among
//! perceived solids, and how to get there.

use crate::{
    clearance::{FREE_M, SAFETY_M},
    controller::StartError,
    geometry::{hand_radius_m, top_of},
    hand::Hand,
    motion::{Pace, Path},
};
use acm_concept::{embodiment::RobotDescription, pose::Pose, solid::{PlacedSolid, Solid}};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Distance between sample points on the hand's solids, metres; most of them along an edge.
const SPACING_M: f64 = 0.012;
const MAX_SAMPLES: u32 = 24;
/// Distance between the poses of a motion at which the room is looked at, metres; most of them.
const STEP_M: f64 = 0.02;
const MAX_STEPS: u32 = 40;

/// The TCP pose that acts at a frame: the approach direction goes against the frame's z axis, which points out of the
/// part, and the fingers close along its y axis.
pub(crate) fn facing(frame: &Pose) -> Pose {
    *frame * Pose::new(DVec3::ZERO, DQuat::from_rotation_x(PI))
}

/// The same grasp with the hand tilted about the direction in which the fingers close; radians.
pub(crate) fn tilted(tcp: &Pose, angle: f64) -> Pose {
    *tcp * Pose::new(DVec3::ZERO, DQuat::from_rotation_y(angle))
}

/// The same grasp with the fingers exchanged.
pub(crate) fn turned_about(tcp: &Pose) -> Pose {
    *tcp * Pose::new(DVec3::ZERO, DQuat::from_rotation_z(PI))
}

/// The TCP pose drawn back against its approach direction, metres.
pub(crate) fn drawn_back(tcp: &Pose, distance_m: f64) -> Pose {
    *tcp * Pose::from_translation(-distance_m * DVec3::Z)
}

/// What the hand must keep clear of: perceived solids, and everything below a height.
#[derive(Debug, Clone)]
pub(crate) struct Surroundings {
    pub obstacles: Vec<PlacedSolid>,
    pub floor_m: f64,
}

impl Surroundings {
    /// Room of the whole hand at a pose: metres, negative inside something, at most [`FREE_M`].
    pub fn room_m(&self, robot: &RobotDescription, tcp: &Pose, opening_m: f64) -> f64 {
        let mut room_m = FREE_M;
        for part in robot.solids(tcp, opening_m) {
            for point in surface(&part) {
                room_m = room_m.min(point.z - self.floor_m);
                for obstacle in &self.obstacles {
                    room_m = room_m.min(obstacle.signed_distance(point));
                }
            }
        }
        room_m
    }
    /// Least room on a straight motion between two poses.
    pub fn room_between_m(&self, robot: &RobotDescription, from: &Pose, to: &Pose, opening_m: f64) -> f64 {
        let length_m = from.translation.distance(to.translation) + 0.1 * from.angle_to(to);
        let steps = ((length_m / STEP_M).ceil() as u32).clamp(1, MAX_STEPS);
        let at = |step: u32| from.interpolate(to, f64::from(step) / f64::from(steps));
        (0..=steps).map(|step| self.room_m(robot, &at(step), opening_m)).fold(FREE_M, f64::min)
    }
    /// The height that clears everything.
    fn top_m(&self) -> f64 {
        self.obstacles.iter().map(top_of).fold(self.floor_m, f64::max)
    }
}

/// The freest of some ways to act at a pose after coming `standoff_m` straight up to it; the first with enough room is
/// taken, so the best-liked come first. An overlap up to `tolerated_m` is accepted where nothing is freer.
pub(crate) fn choose(
    hand: &Hand,
    what: &'static str,
    candidates: impl IntoIterator<Item = Pose>,
    opening_m: f64,
    standoff_m: f64,
    around: &Surroundings,
    [roomy_m, tolerated_m]: [f64; 2],
) -> Result<Pose, StartError> {
    let (mut best, mut refusal): (Option<(Pose, f64)>, _) = (None, None);
    for pose in candidates {
        let before = drawn_back(&pose, standoff_m);
        let outside = [pose, before].into_iter().find(|at| !hand.robot.reaches(at.translation));
        if let Some(outside) = outside {
            refusal.get_or_insert(outside.translation);
            continue;
        }
        let room_m = around.room_between_m(&hand.robot, &before, &pose, opening_m);
        if room_m >= roomy_m {
            return Ok(pose);
        }
        if best.is_none_or(|(_, best_m)| room_m > best_m) {
            best = Some((pose, room_m));
        }
    }
    match (best, refusal) {
        (Some((pose, room_m)), _) if room_m >= -tolerated_m => Ok(pose),
        (Some((_, room_m)), _) => Err(StartError::Blocked { what, overlap_m: -room_m }),
        (None, Some(position)) => {
            let (min, max) = (hand.robot.workspace_min, hand.robot.workspace_max);
            Err(StartError::OutOfReach { what, position, min, max })
        }
        (None, None) => Err(StartError::Blocked { what, overlap_m: f64::INFINITY }),
    }
}

/// A way through free space: straight if that is free, else up, across and down again; from the height that clears
/// everything perceived, as far as the workspace has it.
pub(crate) fn way(hand: &Hand, to: Pose, around: &Surroundings, pace: Pace) -> Path {
    let (from, robot) = (hand.command.tcp, &hand.robot);
    let opening_m = hand.command.opening_m.max(0.5 * robot.max_opening_m);
    if around.room_between_m(robot, &from, &to, opening_m) > 0.5 * SAFETY_M {
        return Path::through(from, &[to], pace, robot.tick_s);
    }
    let level_m = from.translation.z.max(to.translation.z);
    let clear_m = around.top_m() + hand_radius_m(robot) + SAFETY_M;
    for height_m in [level_m, level_m.max(0.5 * (level_m + clear_m))] {
        let height_m = height_m.min(robot.workspace_max.z);
        let corners = [Pose::new(from.translation.with_z(height_m), from.rotation), Pose::new(to.translation.with_z(height_m), to.rotation)];
        let legs = [(from, corners[0]), (corners[0], corners[1]), (corners[1], to)];
        if legs.iter().all(|(a, b)| around.room_between_m(robot, a, b, opening_m) > 0.0) {
            return Path::through(from, &[corners[0], corners[1], to], pace, robot.tick_s);
        }
    }
    Path::over(from, to, clear_m.max(level_m).min(robot.workspace_max.z), pace, robot.tick_s)
}

/// World points on all faces of a solid.
fn surface(part: &PlacedSolid) -> Vec<DVec3> {
    let half = part.solid.half_extents();
    let count = |half: f64| ((2.0 * half / SPACING_M).ceil() as u32).clamp(1, MAX_SAMPLES);
    let counts = [count(half.x), count(half.y), count(half.z)];
    let at = |index: u32, count: u32, half: f64| half * (2.0 * f64::from(index) / f64::from(count) - 1.0);
    let mut points = Vec::new();
    for i in 0..=counts[0] {
        for j in 0..=counts[1] {
            for k in 0..=counts[2] {
                let inner = |index: u32, count: u32| index > 0 && index < count;
                if inner(i, counts[0]) && inner(j, counts[1]) && inner(k, counts[2]) {
                    continue;
                }
                let mut point = DVec3::new(at(i, counts[0], half.x), at(j, counts[1], half.y), at(k, counts[2], half.z));
                if let Solid::Cylinder { radius, .. } = part.solid {
                    let flat = point.truncate().clamp_length_max(radius);
                    point = flat.extend(point.z);
                }
                points.push(part.pose.transform_point(point));
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::downward;

    #[test]
    fn the_hand_looks_against_the_frame_and_closes_along_it() {
        let up = facing(&Pose::from_yaw(DVec3::X, 0.4));
        let down = downward(DVec3::X, 0.4);
        assert!(up.angle_to(&down) < 1e-9 && up.translation == DVec3::X);
        let front = Pose::new(DVec3::ZERO, DQuat::from_rotation_x(0.5 * PI));
        let tcp = facing(&front);
        assert!(tcp.transform_vector(DVec3::Z).distance(DVec3::Y) < 1e-9);
        assert!((drawn_back(&tcp, 0.1).translation.y + 0.1).abs() < 1e-12);
    }
}
