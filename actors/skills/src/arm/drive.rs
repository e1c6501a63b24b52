//! The running arm: follows the commanded TCP with its joints, plans long motions, and says what it cannot do.

use super::{
    kinematics::{margin_rad, miss, solutions, track},
    plan::connect,
    scene::Scene,
    timing::timed,
};
use crate::{clearance::PERCEPTION_ERROR_M, motion::Path};
use acm_concept::{
    arm::{ArmDescription, Joints},
    embodiment::RobotDescription,
    pose::Pose,
};
use glam::DVec3;
use std::collections::VecDeque;

/// How far a planned way stays from what is perceived, unless it begins or ends nearer; metres.
const MARGIN_M: f64 = 0.02;
/// What is left of a smaller distance at an end, metres.
const SLACK_M: f64 = 0.002;
/// A configuration from which the hand can go on along its approach by this much is preferred, metres.
const APPROACH_M: f64 = 0.09;
/// There its links must stay this far from the floor, metres: a tick's way and a wrist's height are not known better.
const FLOOR_M: f64 = 0.01;
/// Steps in which that is tried, metres.
const APPROACH_STEP_M: f64 = 0.01;
/// Configurations for the end of a way that are compared, and starts from which they are looked for.
const WANTED: usize = 8;
const TRIES: usize = 32;
/// A joint nearer to its limit than this makes a configuration a poor one, radians.
const POOR_RAD: f64 = 0.1;
/// The joints may move this share of their fastest while they follow.
const FASTEST: f64 = 0.98;
/// The arm may lag behind what it is told by this much, metres, and for so long, seconds.
const LAG_M: f64 = 0.03;
const LAG_S: f64 = 0.5;
/// While a way is tried out in thought, every so many ticks are checked for collisions.
const CHECK_EVERY: u32 = 3;

/// An arm under command.
#[derive(Debug, Clone)]
pub(crate) struct Drive {
    scene: Scene,
    limits: Limits,
    /// Where the joints were last told to be.
    joints: Joints,
    /// A planned way, tick by tick; empty where the hand's straight path is followed.
    planned: VecDeque<Joints>,
    /// Where the planned way puts the joints in this tick.
    next: Option<Joints>,
    lag_ticks: u32,
}

#[derive(Debug, Clone, Copy)]
struct Limits {
    step_m: f64,
    turn_rad: f64,
    tick_s: f64,
    floor_m: f64,
}

impl Drive {
    /// An arm whose joints are measured to be at `joints`; `None` if those are not as many as it has.
    pub fn new(robot: &RobotDescription, scene: Scene, joints: &[f64]) -> Option<Drive> {
        let joints = Joints::new(joints).filter(|joints| joints.len() == scene.arm().joints.len())?;
        let limits = Limits {
            step_m: robot.max_speed_m_s * robot.tick_s,
            turn_rad: robot.max_turn_rad_s * robot.tick_s,
            tick_s: robot.tick_s,
            floor_m: robot.workspace_min.z,
        };
        // A measured joint may be a hair beyond its limit.
        let arm = scene.arm();
        let joints = joints.map(|i| joints[i].clamp(arm.joints[i].min_rad, arm.joints[i].max_rad));
        Some(Drive { scene, limits, joints, planned: VecDeque::new(), next: None, lag_ticks: 0 })
    }

    /// Decides how the arm gets along a path that begins where it is, before anything moves: along the path itself, or
    /// another way to its end where any will do.
    ///
    /// # Errors
    /// In words, why it cannot.
    pub fn prepare(&mut self, path: &Path) -> Result<(), String> {
        self.planned.clear();
        if !path.travels() {
            return self.rehearse(path, None);
        }
        if self.scene.holding && self.keeps_clear_along(path) {
            return Ok(());
        }
        match self.plan(path) {
            Ok(planned) => {
                self.planned = planned;
                Ok(())
            }
            Err(_) if !self.scene.holding && self.keeps_clear_along(path) => Ok(()),
            Err(reason) => Err(reason),
        }
    }

    /// Takes the next tick of a planned way and tells where it puts the TCP; `None` when there is no more of it.
    pub fn advance(&mut self) -> Option<Pose> {
        self.next = self.planned.pop_front();
        self.next.map(|joints| self.scene.arm().tcp(&joints))
    }

    /// Whether a planned way is being followed.
    pub fn is_planned(&self) -> bool {
        self.next.is_some() || !self.planned.is_empty()
    }

    /// The joints for this tick, and where they put the TCP: along the planned way, or after the commanded TCP as fast as
    /// the joints can.
    ///
    /// # Errors
    /// In words, why the arm does not get to where it is told to be.
    pub fn follow(&mut self, tcp: &Pose) -> Result<(Joints, Pose), String> {
        let (joints, there) = match self.next.take() {
            Some(joints) => (joints, true),
            None => self.towards(tcp),
        };
        let arm = self.scene.arm();
        if !self.scene.is_untangled(&joints) {
            return Err(format!("{}: the arm would run into itself", at(tcp)));
        }
        let reached = arm.tcp(&joints);
        self.joints = joints;
        self.lag_ticks = if there { 0 } else { self.lag_ticks + 1 };
        let lag_m = reached.translation.distance(tcp.translation);
        if lag_m > LAG_M || f64::from(self.lag_ticks) * self.limits.tick_s > LAG_S {
            return Err(format!("{}: the arm stays {:.1} mm behind, {}", at(tcp), 1e3 * lag_m, self.why_short()));
        }
        Ok((joints, reached))
    }

    /// The joints where they stay for a tick, and where they put the TCP.
    pub fn hold(&self) -> (Joints, Pose) {
        (self.joints, self.scene.arm().tcp(&self.joints))
    }

    /// As near to a TCP pose as the joints come in a tick, and whether that is there.
    fn towards(&self, tcp: &Pose) -> (Joints, bool) {
        let arm = self.scene.arm();
        let (wanted, there) = track(arm, tcp, &self.joints);
        let fastest = arm.joints.iter().zip(wanted.iter().zip(self.joints.iter()));
        let over = fastest.map(|(joint, (to, from))| (to - from).abs() / (joint.max_speed_rad_s * self.limits.tick_s));
        let (from, to) = (arm.tcp(&self.joints), arm.tcp(&wanted));
        let shift = from.translation.distance(to.translation) / self.limits.step_m;
        let over = over.fold(shift.max(from.angle_to(&to) / self.limits.turn_rad), f64::max) / FASTEST;
        if over <= 1.0 { (wanted, there) } else { (self.joints.lerp(&wanted, 1.0 / over), false) }
    }

    /// Flies a path in thought. With a margin, everything perceived must stay that far away.
    fn rehearse(&self, path: &Path, margin_m: Option<f64>) -> Result<(), String> {
        let (mut thought, mut path) = (self.clone(), path.clone());
        let mut ticks = 0;
        while let Some(tcp) = path.advance() {
            thought.follow(&tcp)?;
            ticks += 1;
            let checked = ticks % CHECK_EVERY == 0;
            if let Some(margin_m) =
                margin_m.filter(|margin_m| checked && !self.scene.is_clear(&thought.joints, *margin_m))
            {
                return Err(format!("{}: less than {:.0} mm from something", at(&tcp), 1e3 * margin_m));
            }
        }
        let (_, end) = thought.hold();
        let short_m = end.translation.distance(path.end().translation);
        if short_m > LAG_M {
            return Err(format!(
                "{}: the arm ends {:.1} mm short, {}",
                at(&path.end()),
                1e3 * short_m,
                thought.why_short()
            ));
        }
        Ok(())
    }

    fn keeps_clear_along(&self, path: &Path) -> bool {
        let mut thought = self.clone();
        let margin_m = MARGIN_M.min(self.scene.clearance(&self.joints) - SLACK_M);
        if self.rehearse(path, Some(margin_m)).is_err() {
            return false;
        }
        // Where it ends, the work begins: the hand must get on from there.
        let mut flown = path.clone();
        while let Some(tcp) = flown.advance() {
            if thought.follow(&tcp).is_err() {
                return false;
            }
        }
        thought.can_approach(&path.end(), &thought.joints)
    }

    /// A way to the path's end round all that is perceived.
    fn plan(&self, path: &Path) -> Result<VecDeque<Joints>, String> {
        let (arm, goal) = (self.scene.arm(), path.end());
        let mut ends = solutions(arm, &goal, &self.joints, WANTED, TRIES);
        if miss(arm, &arm.home, &goal) <= 1.0 {
            ends = vec![arm.home];
        }
        if ends.is_empty() {
            return Err(format!("{}: out of the arm's reach", at(&goal)));
        }
        let reached = ends.len();
        ends.retain(|end| self.scene.is_untangled(end) && self.scene.clearance(end) > -PERCEPTION_ERROR_M);
        ends.sort_by(|a, b| self.cost(a).total_cmp(&self.cost(b)));
        let (able, unable): (Vec<_>, Vec<_>) = ends.into_iter().partition(|end| self.can_approach(&goal, end));
        if able.is_empty() {
            let why = if unable.is_empty() { "it would touch something there" } else { "it cannot go on from there" };
            return Err(format!("{}: of {reached} ways to hold the arm none will do, {why}", at(&goal)));
        }
        let start_m = self.scene.clearance(&self.joints);
        for end in &able {
            let margin_m = MARGIN_M.min(start_m - SLACK_M).min(self.scene.clearance(end) - SLACK_M);
            if let Some(way) = connect(&self.scene, &self.joints, end, margin_m) {
                return Ok(timed(arm, &way, &path.pace(), self.limits.tick_s));
            }
        }
        Err(format!("{}: no way there past what is perceived", at(&goal)))
    }

    /// How far an end is from where the joints are; one with a joint near its limit is worse, one in what is perceived
    /// the last choice.
    fn cost(&self, end: &Joints) -> f64 {
        let poor = if margin_rad(self.scene.arm(), end) < POOR_RAD { 3.0 } else { 0.0 };
        let inside = if self.scene.clearance(end) < 0.0 { 10.0 } else { 0.0 };
        self.joints.farthest(end) + poor + inside
    }

    /// Whether the hand can go on straight along its approach direction from a configuration, as far as the workspace's
    /// floor lets it.
    fn can_approach(&self, goal: &Pose, from: &Joints) -> bool {
        let (arm, direction) = (self.scene.arm(), goal.transform_vector(DVec3::Z));
        let mut joints = *from;
        for step in 1..=(APPROACH_M / APPROACH_STEP_M).round() as u32 {
            let translation = goal.translation + APPROACH_STEP_M * f64::from(step) * direction;
            if translation.z < self.limits.floor_m {
                break;
            }
            let (next, there) = track(arm, &Pose { translation, ..*goal }, &joints);
            let touches = !self.scene.is_untangled(&next) || self.scene.above_floor(&next) < FLOOR_M;
            if !there || next.farthest(&joints) > 0.25 || touches {
                return false;
            }
            joints = next;
        }
        true
    }

    /// What keeps the arm from getting farther.
    fn why_short(&self) -> String {
        let arm: &ArmDescription = self.scene.arm();
        let at_limit = arm
            .joints
            .iter()
            .zip(self.joints.iter())
            .find(|(joint, at)| (**at - joint.min_rad).min(joint.max_rad - **at) < 0.01);
        at_limit
            .map_or_else(|| "stretched out or too fast".into(), |(joint, _)| format!("{} is at its limit", joint.name))
    }
}

fn at(tcp: &Pose) -> String {
    let at = tcp.translation;
    format!("the hand cannot get to ({:.3}, {:.3}, {:.3}) m", at.x, at.y, at.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        arm::scene::tests::{panda, robot},
        geometry::downward,
        motion::Pace,
    };
    use acm_concept::solid::{PlacedSolid, Solid};

    fn drive(held: &[PlacedSolid], obstacles: &[PlacedSolid]) -> Drive {
        let (robot, arm) = (robot(), panda());
        let scene = Scene::new(&robot, &arm, 0.06, held, obstacles);
        Drive::new(&robot, scene, &arm.home).unwrap()
    }

    fn over(x: f64, y: f64, z: f64) -> Path {
        let robot = robot();
        Path::over(robot.home, downward(DVec3::new(x, y, z), 0.3), 0.35, Pace::free(&robot), robot.tick_s)
    }

    /// Flies a path to its end; the joints of every tick.
    fn fly(drive: &mut Drive, path: &mut Path) -> Vec<Joints> {
        drive.prepare(path).unwrap();
        let mut flown = vec![drive.joints];
        let planned = drive.is_planned();
        while let Some(tcp) = if planned { drive.advance() } else { path.advance() } {
            let (joints, _) = drive.follow(&tcp).unwrap();
            flown.push(joints);
        }
        flown
    }

    #[test]
    fn a_long_motion_ends_where_it_should_within_every_limit() {
        let (mut drive, mut path, arm) = (drive(&[], &[]), over(0.45, -0.25, 0.06), panda());
        let flown = fly(&mut drive, &mut path);
        assert!(miss(&arm, &drive.joints, &path.end()) < 2.0);
        for pair in flown.windows(2) {
            let (a, b) = (arm.tcp(&pair[0]), arm.tcp(&pair[1]));
            assert!(a.translation.distance(b.translation) <= 0.5 * 0.02 && a.angle_to(&b) <= 3.0 * 0.02);
            assert!(arm.limit_broken(&pair[1], 0.0).is_none());
        }
    }

    #[test]
    fn a_wall_on_the_way_is_flown_round_with_and_without_something_in_the_hand() {
        let wall = PlacedSolid {
            solid: Solid::Box { size: DVec3::new(0.4, 0.02, 0.5) },
            pose: Pose::from_translation(DVec3::new(0.5, -0.13, 0.25)),
        };
        let rod = PlacedSolid {
            solid: Solid::Cylinder { radius: 0.02, height: 0.12 },
            pose: Pose::from_translation(DVec3::Z * 0.02),
        };
        for held in [vec![], vec![rod]] {
            let mut drive = drive(&held, &[wall]);
            let flown = fly(&mut drive, &mut over(0.45, -0.3, 0.12));
            let nearest = flown.iter().map(|joints| drive.scene.clearance(joints)).fold(1.0, f64::min);
            assert!(nearest > 0.01, "{nearest} m from the wall with {} in the hand", held.len());
        }
    }

    #[test]
    fn what_cannot_be_reached_is_refused_before_anything_moves() {
        let mut drive = drive(&[], &[]);
        let rest = drive.joints;
        let error = drive.prepare(&over(0.85, 0.0, 0.05)).unwrap_err();
        assert!(error.contains("the hand cannot get to (0.850, 0.000, 0.050) m"), "{error}");
        // Straight down beside the base and straight up beyond the arm's length.
        let robot = robot();
        let up = Path::vertical(robot.home, 1.6, Pace::free(&robot), robot.tick_s);
        assert!(drive.prepare(&up).is_err());
        assert_eq!(drive.joints, rest);
    }

    #[test]
    fn an_arm_that_is_told_to_jump_says_that_it_lags() {
        let mut drive = drive(&[], &[]);
        let far = Pose { translation: robot().home.translation + DVec3::X * 0.1, ..robot().home };
        let error = drive.follow(&far).unwrap_err();
        assert!(error.contains("mm behind"), "{error}");
    }
}
