//! The hand as a controller knows it: its description, what it was last told, and what it feels.

use crate::geometry;
use acm_concept::{
    embodiment::{Command, Feedback, RobotDescription},
    pose::Pose,
};
use glam::DVec3;

/// Share of a new reading in the low-passed wrist force. At 50 ticks a second its time constant is about 30 ms:
/// long enough for a shaking wrist, short enough to stop on a touch.
const FORCE_SHARE: f64 = 0.5;
/// A pad that feels at least this much has something on it, newtons.
const PAD_CONTACT_N: f64 = 0.5;
/// Largest gripping force used, newtons: enough for a few hundred grams at a friction of a half.
const GRIP_FORCE_N: f64 = 20.0;
/// Fingers that meet something stop at least this far from where they were told to be, metres.
const BLOCKED_BY_M: f64 = 0.002;
/// A gap below this is closed fingers, metres.
pub(crate) const CLOSED_M: f64 = 0.004;

/// A robot description, the running command, and the filtered feelings of the wrist.
#[derive(Debug, Clone)]
pub(crate) struct Hand {
    pub robot: RobotDescription,
    /// The last command; primitives edit it and it is sent once a tick.
    pub command: Command,
    /// How far the finger tips reach beyond the TCP, metres.
    pub tip_reach_m: f64,
    filtered_n: DVec3,
    baseline_n: DVec3,
}

impl Hand {
    /// Begins where the hand is and takes the force it feels now as its baseline.
    pub fn new(robot: &RobotDescription, feedback: &Feedback) -> Hand {
        let mut hand = Hand {
            command: Command {
                tcp: feedback.tcp,
                opening_m: feedback.commanded_opening_m.clamp(0.0, robot.max_opening_m),
                grip_force_n: GRIP_FORCE_N.min(robot.max_grip_force_n),
            },
            tip_reach_m: geometry::tip_reach_m(robot),
            filtered_n: feedback.wrist_force_n,
            baseline_n: feedback.wrist_force_n,
            robot: robot.clone(),
        };
        // A yielding wrist may be measured a hair outside the box in which commands are taken.
        hand.command.tcp.translation = hand.inside(feedback.tcp.translation);
        hand
    }
    /// The command to send. Interpolation may leave the workspace by a rounding error; robots refuse even that.
    pub fn command(&self) -> Command {
        let tcp = Pose::new(self.inside(self.command.tcp.translation), self.command.tcp.rotation);
        Command { tcp, ..self.command }
    }
    fn inside(&self, position: DVec3) -> DVec3 {
        position.max(self.robot.workspace_min).min(self.robot.workspace_max)
    }
    /// Takes a new reading into the filter.
    pub fn observe(&mut self, feedback: &Feedback) {
        self.filtered_n += FORCE_SHARE * (feedback.wrist_force_n - self.filtered_n);
    }
    /// Makes a force the new zero: the weight of what is held, or a sensor's offset.
    pub fn tare(&mut self, force_n: DVec3) {
        self.baseline_n = force_n;
        self.filtered_n = force_n;
    }
    /// The force that counts as zero, world frame, newtons.
    pub fn baseline_n(&self) -> DVec3 {
        self.baseline_n
    }
    /// Filtered force on the hand beyond the baseline, world frame, newtons.
    pub fn felt_n(&self) -> DVec3 {
        self.filtered_n - self.baseline_n
    }
    /// Moves the commanded opening towards a target by at most `rate_m_s` for one tick; true once it is there.
    pub fn turn_opening(&mut self, target_m: f64, rate_m_s: f64) -> bool {
        let target_m = target_m.clamp(0.0, self.robot.max_opening_m);
        let step = rate_m_s * self.robot.tick_s;
        self.command.opening_m += (target_m - self.command.opening_m).clamp(-step, step);
        (self.command.opening_m - target_m).abs() < 1e-9
    }
    /// Commands a TCP height, kept inside the workspace.
    pub fn command_height(&mut self, height_m: f64) {
        let (low, high) = (self.robot.workspace_min.z, self.robot.workspace_max.z);
        self.command.tcp.translation.z = height_m.max(low).min(high);
    }
    /// The force with which things are held, newtons.
    pub fn full_grip_n(&self) -> f64 {
        GRIP_FORCE_N.min(self.robot.max_grip_force_n)
    }
    /// How many ticks at least fill a time.
    pub fn ticks(&self, seconds: f64) -> u32 {
        (seconds / self.robot.tick_s).ceil().clamp(1.0, 1e6) as u32
    }
}

/// Whether each pad has something on it.
pub(crate) fn pads_in_contact(feedback: &Feedback) -> [bool; 2] {
    feedback.pad_force_n.map(|force| force.length() >= PAD_CONTACT_N)
}

/// Whether the fingers are kept apart by something that both pads feel.
pub(crate) fn holds_something(feedback: &Feedback) -> bool {
    pads_in_contact(feedback) == [true, true]
        && feedback.opening_m > CLOSED_M
        && feedback.opening_m > feedback.commanded_opening_m + BLOCKED_BY_M
}
