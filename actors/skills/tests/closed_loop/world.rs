//! A small world of its own for these tests: a hand of 0.8 kg on a wrist spring, a table, one box, one button.
//!
//! It is no physics engine: things stand upright, contacts are stiff springs along the vertical, a box between
//! closing pads is shoved to the middle and then held. What it shares with a real arm is what controllers must cope
//! with: lag, transients, noise, a wrist that yields, and surfaces that are not where they were perceived. It refuses
//! any command beyond the robot's limits.

use acm_concept::{
    embodiment::{Command, Embodiment, EmbodimentError, Feedback, RobotDescription},
    pose::{Pose, wrap_angle},
    solid::{PlacedSolid, Solid},
    time::Time,
};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

pub const TABLE_M: f64 = 0.74;
const SUBSTEPS: u32 = 20;
const MASS_KG: f64 = 0.8;
const WRIST_N_M: f64 = 8000.0;
const WRIST_NS_M: f64 = 300.0;
const CONTACT_N_M: f64 = 40_000.0;
const CONTACT_NS_M: f64 = 60.0;
/// Speed of the gap, m/s.
const GAP_M_S: f64 = 0.2;
const GRAVITY: f64 = 9.81;
/// How far pads and block give way together under the gripping force, m/N.
const DENT_M_N: f64 = 0.0004;
const PAD_HALF_WIDTH_M: f64 = 0.011;
const FINGER_M: f64 = 0.012;
const TIP_M: f64 = 0.011;

/// A box that stands on the table or is held.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    pub size: DVec3,
    /// Base pose.
    pub pose: Pose,
    pub mass_kg: f64,
}

/// A round cap on a spring.
#[derive(Debug, Clone, Copy)]
pub struct Button {
    pub center: DVec2,
    pub radius: f64,
    pub top_m: f64,
    pub preload_n: f64,
    pub spring_n_m: f64,
    pub stroke_m: f64,
}

#[derive(Debug, Clone)]
pub struct World {
    robot: RobotDescription,
    pub block: Option<Block>,
    pub button: Option<Button>,
    /// Presses counted as a button does: down at 5 mm, armed again at 1 mm.
    pub presses: u32,
    /// Deepest the cap was pressed, metres.
    pub deepest_m: f64,
    /// An unseen wall that stops the hand at this x.
    pub wall_x: Option<f64>,
    /// After letting go, one pad goes on reporting a force until the hand is above this height.
    pub leaning_below_m: f64,
    /// Base of the block in the TCP frame while it is held.
    pub held: Option<Pose>,
    /// How far the block fell when it was let go, metres.
    pub fell_m: f64,
    pub commands: Vec<Command>,
    /// Largest upward force of a contact so far, newtons.
    pub peak_n: f64,
    armed: bool,
    target: Pose,
    command: Command,
    tcp: Pose,
    velocity: DVec3,
    gap_m: f64,
    wrist_n: DVec3,
    noise: u64,
    ticks: u64,
}

pub fn robot() -> RobotDescription {
    let block = |size, centre| PlacedSolid { solid: Solid::Box { size }, pose: Pose::from_translation(centre) };
    RobotDescription {
        name: "test-hand".into(),
        hand: vec![block(DVec3::new(0.06, 0.2, 0.066), DVec3::new(0.0, 0.0, -0.07))],
        finger: vec![block(DVec3::new(2.0 * PAD_HALF_WIDTH_M, FINGER_M, 0.048), DVec3::new(0.0, 0.006, TIP_M - 0.024))],
        max_opening_m: 0.08,
        max_grip_force_n: 40.0,
        pad_half_length_m: 0.011,
        workspace_min: DVec3::new(-0.55, -0.4, TABLE_M + 0.003),
        workspace_max: DVec3::new(0.55, 0.4, 1.35),
        max_speed_m_s: 0.5,
        max_turn_rad_s: 3.0,
        tick_s: 0.02,
        home: Pose::new(DVec3::new(0.0, 0.25, 1.12), DQuat::from_rotation_x(PI)),
        ..RobotDescription::default()
    }
}

impl World {
    pub fn new() -> World {
        let robot = robot();
        World {
            block: None,
            button: None,
            presses: 0,
            deepest_m: 0.0,
            wall_x: None,
            leaning_below_m: 0.0,
            held: None,
            fell_m: 0.0,
            commands: Vec::new(),
            peak_n: 0.0,
            armed: true,
            target: robot.home,
            command: Command::hand(robot.home, robot.max_opening_m, 20.0),
            tcp: robot.home,
            velocity: DVec3::ZERO,
            gap_m: robot.max_opening_m,
            wrist_n: DVec3::ZERO,
            noise: 1,
            ticks: 0,
            robot,
        }
    }

    pub fn with_block(size: DVec3, center: DVec2, yaw: f64) -> World {
        let pose = Pose::from_yaw(center.extend(TABLE_M), yaw);
        World { block: Some(Block { size, pose, mass_kg: 0.045 }), ..World::new() }
    }

    pub fn with_button(button: Button) -> World {
        World { button: Some(button), ..World::new() }
    }

    /// Starts with the hand elsewhere.
    pub fn place_hand(&mut self, tcp: Pose) {
        (self.tcp, self.target, self.command.tcp) = (tcp, tcp, tcp);
    }

    /// Takes the block away, wherever it is.
    pub fn steal(&mut self) {
        (self.block, self.held) = (None, None);
    }

    fn refuse(&self, command: &Command) -> Result<(), EmbodimentError> {
        let refuse = |reason: String| Err(EmbodimentError::Refused { reason });
        let (robot, step) = (&self.robot, command.tcp.translation - self.target.translation);
        let (step_m, turn_rad) = (step.length(), self.target.angle_to(&command.tcp));
        if !command.tcp.is_valid() || !robot.reaches(command.tcp.translation) {
            return refuse(format!("TCP {:?} outside the workspace", command.tcp.translation));
        }
        if step_m > robot.max_speed_m_s * robot.tick_s || turn_rad > robot.max_turn_rad_s * robot.tick_s {
            return refuse(format!("a step of {step_m} m and {turn_rad} rad"));
        }
        if !(0.0..=robot.max_opening_m).contains(&command.opening_m)
            || !(0.0..=robot.max_grip_force_n).contains(&command.grip_force_n)
        {
            return refuse(format!("opening {} m, force {} N", command.opening_m, command.grip_force_n));
        }
        Ok(())
    }

    /// Even noise in +-1 from a multiplicative generator.
    fn noise(&mut self) -> f64 {
        self.noise = self.noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.noise >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// The block's centre and extents in the hand's plane: along TCP x and y.
    fn block_in_hand(&self, block: &Block) -> (DVec2, DVec2) {
        let base = self.tcp.inverse().transform_point(block.pose.translation).truncate();
        let turn = wrap_angle(block.pose.yaw() - self.tcp.yaw());
        let crossed = (turn.abs() - FRAC_PI_2).abs() < PI / 4.0;
        let size = if crossed { DVec2::new(block.size.y, block.size.x) } else { block.size.truncate() };
        (base, size)
    }

    fn move_fingers(&mut self, seconds: f64) {
        let step = GAP_M_S * seconds;
        let wanted = self.gap_m + (self.command.opening_m - self.gap_m).clamp(-step, step);
        let Some(mut block) = self.block else {
            self.gap_m = wanted;
            return;
        };
        let (center, size) = self.block_in_hand(&block);
        let tip_m = self.tcp.translation.z - TIP_M;
        let beside = tip_m < block.pose.translation.z + block.size.z - 0.002
            && center.x.abs() < 0.5 * size.x + PAD_HALF_WIDTH_M
            && (self.held.is_some() || center.y.abs() < 0.5 * self.gap_m);
        self.gap_m = if beside { wanted.max(size.y - DENT_M_N * self.command.grip_force_n) } else { wanted };
        if beside && wanted <= size.y + 1e-9 && self.held.is_none() {
            // Both pads meet it: its faces turn to them and it is held.
            let turn = wrap_angle(block.pose.yaw() - self.tcp.yaw());
            let aligned = (turn / FRAC_PI_2).round() * FRAC_PI_2;
            let height = self.tcp.translation.z - block.pose.translation.z;
            let flat = Pose::from_yaw(self.tcp.translation, self.tcp.yaw() + aligned);
            let mut held = self.tcp.inverse() * flat;
            held.translation = DVec3::new(center.x, 0.0, height);
            self.held = Some(held);
        } else if beside && self.held.is_none() {
            let room = 0.5 * (self.gap_m - size.y).max(0.0);
            let shoved = DVec3::new(center.x, center.y.clamp(-room, room), 0.0);
            let at = self.tcp.transform_point(shoved).with_z(block.pose.translation.z);
            block.pose.translation = at;
            self.block = Some(block);
        }
        if self.held.is_some() && self.gap_m > size.y + 0.0005 {
            self.held = None;
            self.fell_m = block.pose.translation.z - TABLE_M;
            block.pose = Pose::from_yaw(block.pose.translation.with_z(TABLE_M), block.pose.yaw());
            self.block = Some(block);
        }
    }

    /// Upward force on the hand at its present height.
    fn contact_n(&mut self) -> f64 {
        let tip_m = self.tcp.translation.z - TIP_M;
        let damping = -CONTACT_NS_M * self.velocity.z.min(0.0);
        let rigid = |depth: f64| if depth > 0.0 { CONTACT_N_M * depth + damping } else { 0.0 };
        let mut force = rigid(TABLE_M - tip_m);
        if let Some(block) = self.block {
            if self.held.is_some() {
                force += rigid(TABLE_M - block.pose.translation.z);
            } else {
                let (center, size) = self.block_in_hand(&block);
                let inner = [1.0, -1.0].map(|side| side * 0.5 * self.gap_m);
                let lands = inner.iter().any(|&inner| {
                    let finger = [inner, inner + inner.signum() * FINGER_M];
                    let (low, high) = (finger[0].min(finger[1]), finger[0].max(finger[1]));
                    center.x.abs() < 0.5 * size.x + PAD_HALF_WIDTH_M
                        && low < center.y + 0.5 * size.y - 1e-6
                        && high > center.y - 0.5 * size.y + 1e-6
                });
                if lands {
                    force += rigid(block.pose.translation.z + block.size.z - tip_m);
                }
            }
        }
        if let Some(button) = self.button {
            let reach = button.radius + 0.5 * self.gap_m + FINGER_M;
            let over = self.tcp.translation.truncate().distance(button.center) < reach;
            let depth = button.top_m - tip_m;
            if over && depth > 0.0 {
                force += button.preload_n + button.spring_n_m * depth + rigid(depth - button.stroke_m);
            }
            self.count_press(if over { depth.clamp(0.0, button.stroke_m) } else { 0.0 });
        }
        force
    }

    fn count_press(&mut self, depth_m: f64) {
        self.deepest_m = self.deepest_m.max(depth_m);
        if self.armed && depth_m > 0.005 {
            self.presses += 1;
            self.armed = false;
        }
        self.armed |= depth_m < 0.001;
    }

    fn substep(&mut self, from: Pose, fraction: f64, seconds: f64) {
        let target_velocity = (self.command.tcp.translation - from.translation) / self.robot.tick_s;
        self.target = from.interpolate(&self.command.tcp, fraction);
        let weight = if self.held.is_some() { self.block.map_or(0.0, |block| block.mass_kg * GRAVITY) } else { 0.0 };
        let contact = self.contact_n();
        self.peak_n = self.peak_n.max(contact);
        let mut outside = DVec3::new(0.0, 0.0, contact - weight);
        if let Some(wall) = self.wall_x {
            outside.x -= CONTACT_N_M * (self.tcp.translation.x - wall).max(0.0);
        }
        let pull = WRIST_N_M * (self.target.translation - self.tcp.translation);
        let limited = |force: DVec3| force.clamp(DVec3::splat(-60.0), DVec3::splat(60.0));
        // The damper is taken implicitly, so that the wrist is stable at this step.
        let drive =
            limited(pull + WRIST_NS_M * target_velocity - WRIST_NS_M * self.velocity) + WRIST_NS_M * self.velocity;
        self.velocity =
            (self.velocity + seconds * (drive + outside) / MASS_KG) / (1.0 + seconds * WRIST_NS_M / MASS_KG);
        self.tcp.translation += seconds * self.velocity;
        self.tcp.rotation = self.tcp.rotation.slerp(self.target.rotation, 0.2).normalize();
        self.wrist_n = WRIST_N_M * (self.tcp.translation - self.target.translation)
            + WRIST_NS_M * (self.velocity - target_velocity);
        self.move_fingers(seconds);
        if let (Some(held), Some(block)) = (self.held, &mut self.block) {
            block.pose = self.tcp * held;
        }
    }
}

impl Embodiment for World {
    fn description(&self) -> &RobotDescription {
        &self.robot
    }
    fn feedback(&self) -> Feedback {
        let squeezed = self.held.is_some() && self.command.opening_m < self.gap_m - 0.0005;
        let pad =
            |side: f64| if squeezed { DVec3::new(0.0, side * self.command.grip_force_n, 0.0) } else { DVec3::ZERO };
        let leans = self.held.is_none() && self.tcp.translation.z < self.leaning_below_m;
        let second = if leans { DVec3::new(0.0, -5.0, 0.0) } else { pad(-1.0) };
        Feedback {
            time: Time(self.ticks * 20_000_000),
            tcp: self.tcp,
            joints: vec![],
            opening_m: self.gap_m,
            commanded_opening_m: self.command.opening_m,
            pad_force_n: [pad(1.0), second],
            wrist_force_n: self.wrist_n,
            ..Feedback::default()
        }
    }
    fn command(&mut self, command: &Command) -> Result<Feedback, EmbodimentError> {
        self.refuse(command)?;
        self.commands.push(*command);
        let from = self.target;
        self.command = *command;
        let seconds = self.robot.tick_s / f64::from(SUBSTEPS);
        for substep in 1..=SUBSTEPS {
            self.substep(from, f64::from(substep) / f64::from(SUBSTEPS), seconds);
        }
        self.ticks += 1;
        let noise = DVec3::new(self.noise(), self.noise(), self.noise());
        self.wrist_n += 0.4 * noise;
        Ok(self.feedback())
    }
    fn stop(&mut self) {}
}
