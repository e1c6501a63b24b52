//! The hand as a controller knows it: its description, what it was last told, and what it feels.

use crate::{
    arm::{Drive, Scene},
    geometry,
    motion::Path,
};
use acm_concept::{
    embodiment::{Command, Feedback, RobotDescription},
    pose::Pose,
    skill::SkillInvocation,
    solid::PlacedSolid,
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
/// A cup with more than this share of the pump's best vacuum under it is sealed.
pub(crate) const SEALED: f64 = 0.5;
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
    /// The arm's joints, where there is an arm.
    drive: Option<Drive>,
    /// Why the arm does not get to where it is told to be.
    fault: Option<String>,
    filtered_n: DVec3,
    baseline_n: DVec3,
}

impl Hand {
    /// The hand of the arm that was commanded last. Begins where it is and takes the force it feels now as its baseline.
    pub fn new(robot: &RobotDescription, feedback: &Feedback) -> Hand {
        let arm = feedback.arm;
        Hand::among(&robot.only(arm), feedback, &[], &other_arms(robot, feedback, arm))
    }
    /// The hand of one arm, for a skill: the arm keeps clear of all that the invocation knows, with what is held in the
    /// hand, and of the robot's other arms.
    pub fn for_skill(invocation: &SkillInvocation, robot: &RobotDescription, feedback: &Feedback, arm: usize) -> Hand {
        let mut obstacles = other_arms(robot, feedback, arm);
        obstacles.extend(invocation.obstacles.iter().map(|(_, solid)| *solid));
        let (robot, feedback) = (&robot.only(arm), feedback.of_arm(arm).unwrap_or(feedback));
        let in_tcp = invocation.held.as_ref().map_or(Pose::IDENTITY, |(_, base, _)| *base);
        let place = |part: &PlacedSolid| PlacedSolid { solid: part.solid, pose: in_tcp * part.pose };
        let held: Vec<PlacedSolid> = invocation.held_solids.iter().map(place).collect();
        Hand::among(robot, feedback, &held, &obstacles)
    }
    fn among(robot: &RobotDescription, feedback: &Feedback, held: &[PlacedSolid], obstacles: &[PlacedSolid]) -> Hand {
        let drive = robot.arm.as_ref().and_then(|arm| {
            let mut scene = Scene::new(robot, arm, robot.max_opening_m.max(feedback.opening_m), held, obstacles);
            scene.holding |= holds_something(feedback);
            Drive::new(robot, scene, &feedback.joints)
        });
        // The joints say where the arm was told to be; a yielding wrist is measured a little beside it.
        let told = drive.as_ref().map_or(feedback.tcp, |drive| drive.hold().1);
        let mut hand = Hand {
            command: Command {
                arm: feedback.arm,
                vacuum: feedback.vacuum > SEALED,
                ..Command::hand(
                    told,
                    feedback.commanded_opening_m.clamp(0.0, robot.max_opening_m),
                    GRIP_FORCE_N.min(robot.max_grip_force_n),
                )
            },
            drive,
            fault: None,
            tip_reach_m: geometry::tip_reach_m(robot),
            filtered_n: feedback.wrist_force_n,
            baseline_n: feedback.wrist_force_n,
            robot: robot.clone(),
        };
        // A yielding wrist may be measured a hair outside the box in which commands are taken.
        hand.command.tcp.translation = hand.inside(told.translation);
        hand
    }
    /// The command to send. Interpolation may leave the workspace by a rounding error; robots refuse even that. An arm that
    /// does not get there is held where it is, and [`Hand::fault`] says so.
    pub fn command(&mut self) -> Command {
        let tcp = Pose::new(self.inside(self.command.tcp.translation), self.command.tcp.rotation);
        let Some(drive) = &mut self.drive else { return Command { tcp, ..self.command } };
        let (joints, reached) = match drive.follow(&tcp) {
            Ok(there) => there,
            Err(reason) => {
                self.fault.get_or_insert(reason);
                drive.hold()
            }
        };
        Command { tcp: reached, joints: Some(joints), ..self.command }
    }
    /// Flies a path for one tick; false once it is done. An arm that cannot fly it does not set out, and
    /// [`Hand::fault`] says why.
    pub fn follow(&mut self, path: &mut Path) -> bool {
        if let Some(drive) = &mut self.drive {
            if path.begin() {
                match drive.prepare(path) {
                    Ok(()) if drive.is_planned() => path.finish(),
                    Ok(()) => {}
                    Err(reason) => {
                        self.fault.get_or_insert(reason);
                        return true;
                    }
                }
            }
            if let Some(tcp) = drive.advance() {
                self.command.tcp = tcp;
                return true;
            }
        }
        let next = path.advance();
        self.command.tcp = next.unwrap_or(self.command.tcp);
        next.is_some()
    }
    /// Takes the reason why the arm did not get to where it was told to be, if it did not. From then on the hand is
    /// commanded from where it is.
    pub fn fault(&mut self) -> Option<String> {
        let fault = self.fault.take()?;
        if let Some(drive) = &self.drive {
            self.command.tcp = drive.hold().1;
        }
        Some(fault)
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
    /// Measured height of the finger tips, metres.
    pub fn tip_height_m(&self, tcp: &Pose) -> f64 {
        tcp.translation.z - self.tip_reach_m
    }
}

/// What the arms but one fill in the world.
fn other_arms(robot: &RobotDescription, feedback: &Feedback, arm: usize) -> Vec<PlacedSolid> {
    let mut solids = Vec::new();
    for other in (0..robot.arms()).filter(|other| *other != arm) {
        let (Some(robot), Some(felt)) = (robot.of_arm(other), feedback.of_arm(other)) else { continue };
        solids.extend(robot.solids(&felt.tcp, felt.opening_m));
        solids.extend(robot.arm.iter().flat_map(|links| links.solids(&felt.joints)));
    }
    solids
}

/// Whether each pad has something on it.
pub(crate) fn pads_in_contact(feedback: &Feedback) -> [bool; 2] {
    feedback.pad_force_n.map(|force| force.length() >= PAD_CONTACT_N)
}

/// Whether the fingers are kept apart by something that both pads feel, or something closes the cup.
pub(crate) fn holds_something(feedback: &Feedback) -> bool {
    let kept_apart = pads_in_contact(feedback) == [true, true]
        && feedback.opening_m > CLOSED_M
        && feedback.opening_m > feedback.commanded_opening_m + BLOCKED_BY_M;
    kept_apart || feedback.vacuum > SEALED
}
