//! Approaches from any side: where the hand must be to act at a frame, which of several ways is the freest among
//! perceived solids, and how to get there.

use crate::{
    clearance::{FREE_M, PERCEPTION_ERROR_M, ROOMY_M, SAFETY_M},
    controller::StartError,
    geometry::{hand_radius_m, top_of},
    hand::Hand,
    motion::{Pace, Path},
};
use acm_concept::{
    embodiment::RobotDescription,
    pose::Pose,
    solid::{Enclosure, PlacedSolid},
};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Distance between sample points on the hand's solids, metres; most of them along an edge.
const SPACING_M: f64 = 0.012;
const MAX_SAMPLES: u32 = 24;
/// Distance between the poses of a motion at which the room is looked at, metres; most of them.
const STEP_M: f64 = 0.02;
const MAX_STEPS: u32 = 60;
/// How far before the goal a way may come to it from, metres.
const VIA_M: [f64; 2] = [0.15, 0.35];

/// Tilts of the hand about the direction in which its fingers close that are tried, radians.
pub(crate) const TILTS: [f64; 5] = [0.0, 0.35, -0.35, 0.7, -0.7];

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
        let near = self.near(from.translation, to.translation, size_m(robot) + FREE_M);
        (0..=steps).map(|step| near.room_m(robot, &at(step), opening_m)).fold(FREE_M, f64::min)
    }
    /// What of it comes within a distance of a line.
    fn near(&self, from: DVec3, to: DVec3, distance_m: f64) -> Surroundings {
        let along = to - from;
        let nearest = |at: DVec3| {
            let share = (at - from).dot(along) / along.length_squared().max(1e-12);
            at.distance(from + share.clamp(0.0, 1.0) * along)
        };
        let is_near =
            |solid: &&PlacedSolid| nearest(solid.pose.translation) < distance_m + solid.solid.bounding_radius();
        Surroundings { obstacles: self.obstacles.iter().filter(is_near).copied().collect(), floor_m: self.floor_m }
    }
    /// The height that clears everything.
    fn top_m(&self) -> f64 {
        self.obstacles.iter().map(top_of).fold(self.floor_m, f64::max)
    }
}

/// How much wider than the part the fingers are on the way to it, the most absorbing first; metres.
const SPREADS_M: [f64; 4] = [0.03, 0.02, 0.012, 0.008];

/// How wide the fingers may be on the way to a part that they close on, widest first; `least_m` is the spread that they
/// need at least.
///
/// # Errors
/// The hand does not open so far.
pub(crate) fn openings(hand: &Hand, width_m: f64, least_m: f64) -> Result<Vec<f64>, StartError> {
    let largest_m = hand.robot.max_opening_m;
    match width_m + least_m > largest_m {
        true => Err(StartError::TooWide { width_m, opening_m: largest_m }),
        false => Ok(SPREADS_M.map(|spread_m| (width_m + spread_m).min(largest_m)).to_vec()),
    }
}

/// The freest of some ways to act at a pose after coming `standoff_m` straight up to it, and how wide the fingers are then.
/// The first with enough room is taken, so the best-liked come first, and fingers close only where wider ones do not fit.
/// An overlap that may be an error of perception is accepted where nothing is freer.
pub(crate) fn choose(
    hand: &Hand,
    what: &'static str,
    candidates: &[Pose],
    openings_m: &[f64],
    standoff_m: f64,
    around: &Surroundings,
) -> Result<(Pose, f64), StartError> {
    let (mut best, mut refusal): (Option<(Pose, f64, f64)>, _) = (None, None);
    let ways = openings_m.iter().flat_map(|opening_m| candidates.iter().map(|pose| (*pose, *opening_m)));
    for (pose, opening_m) in ways {
        let before = drawn_back(&pose, standoff_m);
        let outside = [pose, before].into_iter().find(|at| !hand.robot.reaches(at.translation));
        if let Some(outside) = outside {
            refusal.get_or_insert(outside.translation);
            continue;
        }
        let room_m = around.room_between_m(&hand.robot, &before, &pose, opening_m);
        if room_m >= ROOMY_M {
            return Ok((pose, opening_m));
        }
        if best.is_none_or(|(_, _, best_m)| room_m > best_m) {
            best = Some((pose, opening_m, room_m));
        }
    }
    match (best, refusal) {
        (Some((pose, opening_m, room_m)), _) if room_m >= -PERCEPTION_ERROR_M => Ok((pose, opening_m)),
        (Some((_, _, room_m)), _) => Err(StartError::Blocked { what, overlap_m: -room_m }),
        (None, Some(position)) => {
            let (min, max) = (hand.robot.workspace_min, hand.robot.workspace_max);
            Err(StartError::OutOfReach { what, position, min, max })
        }
        (None, None) => Err(StartError::Blocked { what, overlap_m: f64::INFINITY }),
    }
}

/// A way through free space: straight if that is free, else round by way of a place before the goal, or up, across and
/// down; the first that is free, or the freest.
pub(crate) fn way(hand: &Hand, to: Pose, around: &Surroundings, pace: Pace) -> Path {
    let (from, robot) = (hand.command.tcp, &hand.robot);
    let opening_m = hand.command.opening_m.max(0.5 * robot.max_opening_m);
    let inside =
        |pose: Pose| Pose::new(pose.translation.max(robot.workspace_min).min(robot.workspace_max), pose.rotation);
    let before = VIA_M.map(|distance_m| inside(drawn_back(&to, distance_m)));
    let level_m = from.translation.z.max(to.translation.z);
    let clear_m = (around.top_m() + hand_radius_m(robot) + SAFETY_M).max(level_m);
    let over = |goal: Pose, height_m: f64| {
        let at = |pose: Pose| inside(Pose::new(pose.translation.with_z(height_m), pose.rotation));
        [Pose::new(at(from).translation, from.rotation), at(goal), goal]
    };
    let mut ways = vec![vec![to]];
    ways.extend(before.map(|via| vec![via, to]));
    for height_m in [level_m, clear_m] {
        ways.push(over(to, height_m).to_vec());
        ways.extend(before.map(|via| [over(via, height_m).as_slice(), &[to]].concat()));
    }
    let mut best: Option<(f64, Vec<Pose>)> = None;
    for corners in ways {
        let starts = std::iter::once(&from).chain(&corners);
        let room = |(a, b): (&Pose, &Pose)| around.room_between_m(robot, a, b, opening_m);
        let room_m = starts.zip(&corners).map(room).fold(FREE_M, f64::min);
        if room_m > 0.5 * SAFETY_M {
            return Path::through(from, &corners, pace, robot.tick_s).freely();
        }
        if best.as_ref().is_none_or(|(best_m, _)| room_m > *best_m) {
            best = Some((room_m, corners));
        }
    }
    let corners = best.map_or_else(|| vec![to], |(_, corners)| corners);
    Path::through(from, &corners, pace, robot.tick_s).freely()
}

/// Radius of the ball round the whole hand about the TCP, metres.
fn size_m(robot: &RobotDescription) -> f64 {
    let solids = robot.solids(&Pose::IDENTITY, robot.max_opening_m);
    solids.iter().map(|part| part.pose.translation.length() + part.solid.bounding_radius()).fold(0.0, f64::max)
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
                let mut point =
                    DVec3::new(at(i, counts[0], half.x), at(j, counts[1], half.y), at(k, counts[2], half.z));
                if let Enclosure::Cylinder { radius, .. } = part.solid.enclosure() {
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
