//! What a real arm takes and reports, and the traits of the outside world.
//!
//! The tool centre point (TCP) frame has z along the approach direction, out of the hand, and y along the
//! direction in which the two fingers close; its origin lies between the finger pads. For a suction cup it lies in the
//! middle of the rim.
//!
//! A robot is a hand that floats, or a hand on an arm, or several arms with a hand each. A skill runs with one arm at a
//! time: [`Command::arm`] names it, the others hold still, and [`RobotDescription::only`] and [`Feedback::of_arm`] show a
//! controller that arm as if it were the whole robot.

use crate::{
    arm::{ArmDescription, Joints},
    pose::Pose,
    solid::PlacedSolid,
    time::Time,
};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A hand, the arm that carries it, and the limits within which they may be commanded.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotDescription {
    /// Name of the robot model.
    pub name: String,
    /// The hand's solids in the TCP frame, without the fingers.
    pub hand: Vec<PlacedSolid>,
    /// One finger's solids in a frame parallel to the TCP frame whose origin lies on the pad's surface, with the
    /// finger on its +y side; the other finger is the mirror image. Fingers move along y with the opening.
    pub finger: Vec<PlacedSolid>,
    /// Largest distance between the pads, metres; 0 for a hand without fingers.
    pub max_opening_m: f64,
    /// Largest closing force, newtons.
    pub max_grip_force_n: f64,
    /// Half of the pads' length along the approach direction, metres: how deep a grasp may be taken.
    pub pad_half_length_m: f64,
    /// Corner of the workspace box with the smallest coordinates, world frame, metres.
    pub workspace_min: DVec3,
    /// Corner of the workspace box with the largest coordinates, world frame, metres.
    pub workspace_max: DVec3,
    /// Fastest TCP translation, metres per second.
    pub max_speed_m_s: f64,
    /// Fastest TCP rotation, radians per second.
    pub max_turn_rad_s: f64,
    /// Length of one control tick, seconds.
    pub tick_s: f64,
    /// Where the TCP waits, out of the cameras' way.
    pub home: Pose,
    /// The arm; `None` for a hand that floats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arm: Option<ArmDescription>,
    /// The suction cup that the hand has in place of fingers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub suction: Option<SuctionCup>,
    /// The robot's further arms, each with a hand of its own and with nothing here. This description is that of arm 0,
    /// the first of these that of arm 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<RobotDescription>,
}

/// A suction cup whose rim lies in the TCP frame's xy plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SuctionCup {
    /// Radius of the rim, metres.
    pub radius_m: f64,
    /// The pull that it withstands at full vacuum, newtons.
    pub max_force_n: f64,
    /// How far a face may be tilted against the rim and still be sealed, radians.
    pub max_tilt_rad: f64,
}

impl RobotDescription {
    /// All solids in the world at a TCP pose and a finger opening in metres.
    pub fn solids(&self, tcp: &Pose, opening_m: f64) -> Vec<PlacedSolid> {
        let place = |frame: Pose, part: &PlacedSolid| PlacedSolid { solid: part.solid, pose: frame * part.pose };
        let mut solids: Vec<PlacedSolid> = self.hand.iter().map(|part| place(*tcp, part)).collect();
        for side in [1.0, -1.0] {
            let turn = if side > 0.0 { 0.0 } else { std::f64::consts::PI };
            let frame = *tcp * Pose::from_yaw(DVec3::new(0.0, side * opening_m * 0.5, 0.0), turn);
            solids.extend(self.finger.iter().map(|part| place(frame, part)));
        }
        solids
    }
    /// All that the cameras may see of the robot at a measurement: hands, and the links of its arms.
    pub fn body(&self, feedback: &Feedback) -> Vec<PlacedSolid> {
        let mut solids = Vec::new();
        for arm in 0..self.arms() {
            let (Some(robot), Some(felt)) = (self.of_arm(arm), feedback.of_arm(arm)) else { continue };
            solids.extend(robot.solids(&felt.tcp, felt.opening_m));
            solids.extend(robot.arm.iter().flat_map(|links| links.solids(&felt.joints)));
        }
        solids
    }
    /// Whether a TCP position lies in the workspace box of an arm that is not farther away than it is long. An arm
    /// may still not reach it in every direction.
    pub fn reaches(&self, position: DVec3) -> bool {
        (0..self.arms()).filter_map(|arm| self.of_arm(arm)).any(|robot| {
            let inside = position.cmpge(robot.workspace_min).all() && position.cmple(robot.workspace_max).all();
            inside && robot.arm.as_ref().is_none_or(|arm| arm.may_reach(position))
        })
    }
    /// How many hands it has.
    pub fn arms(&self) -> usize {
        1 + self.others.len()
    }
    /// The description of one arm and its hand; that of arm 0 still holds the others.
    pub fn of_arm(&self, arm: usize) -> Option<&RobotDescription> {
        if arm == 0 { Some(self) } else { self.others.get(arm - 1) }
    }
    /// One arm and its hand as if it were the whole robot; arm 0 for an arm that there is not.
    pub fn only(&self, arm: usize) -> RobotDescription {
        RobotDescription { others: Vec::new(), ..self.of_arm(arm).unwrap_or(self).clone() }
    }
}

/// What the robot is asked to do during one control tick.
///
/// Fields at their defaults are not written, so that a floating hand with fingers sees `tcp`, `opening_m` and
/// `grip_force_n` alone.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Where the TCP shall be at the end of the tick.
    pub tcp: Pose,
    /// Commanded distance between the pads, metres.
    pub opening_m: f64,
    /// Force with which the fingers may close, newtons.
    pub grip_force_n: f64,
    /// Where the joints of an arm shall be at the end of the tick; the TCP pose above is where they put it. An arm
    /// needs them, a floating hand takes none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joints: Option<Joints>,
    /// Which arm moves; the others hold still.
    #[serde(default, skip_serializing_if = "is_default")]
    pub arm: usize,
    /// Whether the suction cup's pump runs.
    #[serde(default, skip_serializing_if = "is_default")]
    pub vacuum: bool,
}

impl Command {
    /// For a hand with fingers that floats.
    pub fn hand(tcp: Pose, opening_m: f64, grip_force_n: f64) -> Command {
        Command { tcp, opening_m, grip_force_n, ..Command::default() }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// What one arm reports after a tick, and its neighbours: nothing that a real arm could not measure.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Feedback {
    /// When it was measured.
    pub time: Time,
    /// Measured TCP pose in the world.
    pub tcp: Pose,
    /// Joint positions, radians or metres; empty for a robot without an arm.
    pub joints: Vec<f64>,
    /// Measured distance between the pads, metres.
    pub opening_m: f64,
    /// The opening that was last commanded, metres.
    pub commanded_opening_m: f64,
    /// Force on the pad at +y and on the pad at -y, in the TCP frame, newtons.
    pub pad_force_n: [DVec3; 2],
    /// Force of the outside world on the hand as felt at the wrist, world frame, newtons.
    pub wrist_force_n: DVec3,
    /// The vacuum under the suction cup as a share of the pump's best, 0 to 1.
    #[serde(default, skip_serializing_if = "is_default")]
    pub vacuum: f64,
    /// Which arm this is: the one that was commanded last.
    #[serde(default, skip_serializing_if = "is_default")]
    pub arm: usize,
    /// What the robot's other arms measure, with nothing here.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Feedback>,
}

impl Feedback {
    /// What one arm measures.
    pub fn of_arm(&self, arm: usize) -> Option<&Feedback> {
        if self.arm == arm { Some(self) } else { self.others.iter().find(|other| other.arm == arm) }
    }
}

/// Why the robot did not do as told.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EmbodimentError {
    /// The command has numbers that are not finite, or leaves the limits of the description.
    #[error("the command is outside the robot's limits: {reason}")]
    Refused {
        /// Which limit, with the numbers.
        reason: String,
    },
    /// Motion is switched off.
    #[error("motion is disabled: the robot was started with motion off")]
    MotionDisabled,
    /// A stop was commanded.
    #[error("the robot was stopped")]
    Stopped,
    /// The arm met something and stopped by itself, part of the way. It takes the next command from where it is.
    #[error("the arm stopped by itself: {reason}")]
    ProtectiveStop {
        /// What it met, with the numbers.
        reason: String,
    },
    /// The robot or the link to it failed.
    #[error("the robot failed: {reason}")]
    Failed {
        /// What went wrong.
        reason: String,
    },
}

/// An arm or hand that can be commanded tick by tick. The world advances only here and in [`Clock::wait_until`].
pub trait Embodiment: Send {
    /// Geometry and limits.
    fn description(&self) -> &RobotDescription;
    /// The last measurement; does not advance the world.
    fn feedback(&self) -> Feedback;
    /// Performs one control tick of [`RobotDescription::tick_s`] and reports what was measured at its end.
    fn command(&mut self, command: &Command) -> Result<Feedback, EmbodimentError>;
    /// Stops all motion at once; later commands are refused with [`EmbodimentError::Stopped`].
    fn stop(&mut self);
}

/// The episode's clock.
pub trait Clock: Send {
    /// The present moment.
    fn now(&self) -> Time;
    /// Lets the world go on, with the robot holding still, until `moment`; returns the moment reached.
    fn wait_until(&mut self, moment: Time) -> Result<Time, EmbodimentError>;
}

/// A learned policy as a skill's backend: maps a frame and a prompt to a chunk of commands.
pub trait PolicyBackend: Send {
    /// The next commands, at most one control second of them.
    fn act(
        &mut self,
        prompt: &str,
        frame: &crate::camera::RgbdFrame,
        feedback: &Feedback,
    ) -> Result<Vec<Command>, EmbodimentError>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::Solid;

    #[test]
    fn each_arm_is_seen_as_if_it_were_alone() {
        let robot = RobotDescription {
            workspace_min: DVec3::ZERO,
            workspace_max: DVec3::ONE,
            others: vec![RobotDescription { name: "left".into(), ..RobotDescription::default() }],
            ..RobotDescription::default()
        };
        assert_eq!((robot.arms(), robot.only(1).name.as_str(), robot.only(0).arms()), (2, "left", 1));
        assert!(robot.of_arm(2).is_none() && robot.reaches(DVec3::splat(0.5)));
        let left = Feedback { arm: 0, opening_m: 0.03, ..Feedback::default() };
        let felt = Feedback { arm: 1, others: vec![left], ..Feedback::default() };
        assert_eq!(felt.of_arm(0).map(|felt| felt.opening_m), Some(0.03));
        assert!(felt.of_arm(1).is_some() && felt.of_arm(2).is_none());
    }

    #[test]
    fn a_plain_command_is_written_as_before() {
        let command = Command::hand(Pose::IDENTITY, 0.04, 10.0);
        let text = serde_json::to_value(command).unwrap();
        let keys: Vec<_> = text.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["grip_force_n", "opening_m", "tcp"]);
        let joints = Joints::new(&[0.1, 0.2]);
        let full = Command { joints, arm: 1, vacuum: true, ..command };
        assert_eq!(serde_json::from_str::<Command>(&serde_json::to_string(&full).unwrap()).unwrap(), full);
    }

    #[test]
    fn fingers_open_symmetrically() {
        let pad = PlacedSolid {
            solid: Solid::Box { size: DVec3::new(0.02, 0.01, 0.04) },
            pose: Pose::from_translation(DVec3::new(0.0, 0.005, 0.0)),
        };
        let robot = RobotDescription {
            name: "hand".into(),
            hand: vec![],
            finger: vec![pad],
            max_opening_m: 0.08,
            max_grip_force_n: 30.0,
            pad_half_length_m: 0.01,
            workspace_min: DVec3::splat(-1.0),
            workspace_max: DVec3::splat(1.0),
            max_speed_m_s: 1.0,
            max_turn_rad_s: 2.0,
            tick_s: 0.02,
            home: Pose::IDENTITY,
            ..RobotDescription::default()
        };
        let solids = robot.solids(&Pose::IDENTITY, 0.06);
        assert!((solids[0].pose.translation.y - 0.035).abs() < 1e-12);
        assert!((solids[1].pose.translation.y + 0.035).abs() < 1e-12);
    }
}
