//! What a real arm takes and reports, and the traits of the outside world.
//!
//! The tool centre point (TCP) frame has z along the approach direction, out of the hand, and y along the
//! direction in which the two fingers close; its origin lies between the finger pads.

use crate::{pose::Pose, solid::PlacedSolid, time::Time};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A two-finger hand and the limits within which it may be commanded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotDescription {
    /// Name of the robot model.
    pub name: String,
    /// The hand's solids in the TCP frame, without the fingers.
    pub hand: Vec<PlacedSolid>,
    /// One finger's solids in a frame parallel to the TCP frame whose origin lies on the pad's surface, with the
    /// finger on its +y side; the other finger is the mirror image. Fingers move along y with the opening.
    pub finger: Vec<PlacedSolid>,
    /// Largest distance between the pads, metres.
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
    /// Whether a TCP position lies in the workspace box.
    pub fn reaches(&self, position: DVec3) -> bool {
        position.cmpge(self.workspace_min).all() && position.cmple(self.workspace_max).all()
    }
}

/// What the arm is asked to do during one control tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Where the TCP shall be at the end of the tick.
    pub tcp: Pose,
    /// Commanded distance between the pads, metres.
    pub opening_m: f64,
    /// Force with which the fingers may close, newtons.
    pub grip_force_n: f64,
}

/// What the arm reports after a tick: nothing that a real arm could not measure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
        };
        let solids = robot.solids(&Pose::IDENTITY, 0.06);
        assert!((solids[0].pose.translation.y - 0.035).abs() < 1e-12);
        assert!((solids[1].pose.translation.y + 0.035).abs() < 1e-12);
    }
}
