//! The hand: two fingers on a force-limited wrist that follows a commanded pose.
//!
//! A kinematic body takes the commanded pose; motors of limited force on all six axes pull the real, dynamic hand
//! after it. So the hand can be stopped by what it touches, and what it presses with is bounded.

use crate::{
    convert::{from_engine, to_engine, vector},
    layout::shape,
};
use acm_concept::{
    embodiment::RobotDescription,
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::{DQuat, DVec3};
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

/// Where the tool centre point waits if the scenario does not say otherwise: behind and above the table, outside of
/// the opening angle of a camera that looks down at the table from the front.
pub(crate) const HOME: DVec3 = DVec3::new(0.0, 0.25, 1.12);
/// The workspace if the scenario does not say otherwise: smallest and largest coordinates.
pub(crate) const WORKSPACE: [DVec3; 2] = [DVec3::new(-0.55, -0.4, 0.745), DVec3::new(0.55, 0.4, 1.35)];

const MAX_OPENING_M: f64 = 0.08;
const MAX_GRIP_N: f64 = 40.0;
const PAD_FRICTION: f32 = 1.0;
/// Fingers reach this far beyond the tool centre point.
const TIP_M: f64 = 0.011;
const FINGER_M: DVec3 = DVec3::new(0.022, 0.012, 0.048);
const HAND_M: DVec3 = DVec3::new(0.06, 0.2, 0.066);

const HAND_KG: f32 = 0.7;
/// A finger and its share of the drive's inertia. Light fingers between stiff contacts let what they hold creep: with half
/// of this it creeps twice as far.
const FINGER_KG: f32 = 0.4;
/// Stiffness and damping of the wrist for shifts, N/m and N s/m, and the force it can bear, N.
const WRIST_SHIFT: [f32; 3] = [8000.0, 300.0, 60.0];
/// The same for turns, N m/rad, N m s/rad, N m.
const WRIST_TURN: [f32; 3] = [200.0, 8.0, 10.0];
const FINGER_STIFFNESS: f32 = 8_000.0;
const FINGER_DAMPING: f32 = 40.0;
/// Speed of each finger, metres per second.
const FINGER_SPEED: f64 = 0.1;

/// Control tick of the robot, seconds.
pub(crate) const TICK_S: f64 = 0.02;

/// What is known of the robot in advance, the agent's side of the hand built here.
pub(crate) fn description(home: DVec3, workspace: [DVec3; 2]) -> RobotDescription {
    let block = |size, centre| PlacedSolid { solid: Solid::Box { size }, pose: Pose::from_translation(centre) };
    let finger_top = TIP_M - FINGER_M.z;
    RobotDescription {
        name: "floating-gripper".into(),
        hand: vec![block(HAND_M, DVec3::new(0.0, 0.0, finger_top - 0.5 * HAND_M.z))],
        finger: vec![block(FINGER_M, DVec3::new(0.0, 0.5 * FINGER_M.y, TIP_M - 0.5 * FINGER_M.z))],
        max_opening_m: MAX_OPENING_M,
        max_grip_force_n: MAX_GRIP_N,
        pad_half_length_m: TIP_M,
        workspace_min: workspace[0],
        workspace_max: workspace[1],
        max_speed_m_s: 0.5,
        max_turn_rad_s: 3.0,
        tick_s: TICK_S,
        home: Pose::new(home, DQuat::from_rotation_x(std::f64::consts::PI)),
    }
}

/// What the fingers are to do.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Grip {
    pub(crate) opening_m: f64,
    pub(crate) force_n: f64,
}

/// The hand's bodies and joints in the engine.
#[derive(Debug, Clone)]
pub(crate) struct Gripper {
    follow: RigidBodyHandle,
    hand: RigidBodyHandle,
    fingers: [RigidBodyHandle; 2],
    /// The finger's colliders, +y side first: the pads.
    pub(crate) pads: [ColliderHandle; 2],
    joints: [ImpulseJointHandle; 2],
    /// Where the fingers' controller is on its way to the commanded opening, metres each finger has closed.
    pub(crate) setpoint: f64,
}

impl Gripper {
    pub(crate) fn build(world: &mut PhysicsWorld, robot: &RobotDescription) -> Gripper {
        let home = to_engine(&robot.home);
        let follow = world.insert_body(RigidBodyBuilder::kinematic_position_based().pose(home));
        let hand = world.insert_body(free_body(home).additional_mass_properties(MassProperties::new(
            Vector::ZERO,
            HAND_KG,
            Vector::new(0.002, 0.002, 0.002),
        )));
        world.insert_impulse_joint(follow, hand, wrist());
        for part in &robot.hand {
            let (turn, shape) = shape(&part.solid, 0.0);
            let collider = ColliderBuilder::new(shape).position(to_engine(&(part.pose * turn))).density(0.0);
            world.insert_collider(collider, Some(hand));
        }
        let side = |side: f64, world: &mut PhysicsWorld| finger(world, robot, hand, side);
        let (first, first_pad, first_joint) = side(1.0, world);
        let (second, second_pad, second_joint) = side(-1.0, world);
        Gripper {
            follow,
            hand,
            fingers: [first, second],
            pads: [first_pad, second_pad],
            joints: [first_joint, second_joint],
            setpoint: 0.0,
        }
    }

    /// Drives wrist and fingers for one physics step.
    pub(crate) fn drive(&mut self, world: &mut PhysicsWorld, target: &Pose, grip: Grip) {
        if let Some(body) = world.bodies.get_mut(self.follow) {
            body.set_next_kinematic_position(to_engine(target));
        }
        let step = FINGER_SPEED * f64::from(world.integration_parameters.dt);
        let wanted = 0.5 * (MAX_OPENING_M - grip.opening_m);
        self.setpoint += (wanted - self.setpoint).clamp(-step, step);
        let closed = 0.5 * (MAX_OPENING_M - self.opening(world));
        let pull = f64::from(FINGER_STIFFNESS) * (self.setpoint - closed);
        // Both fingers hang on one drive: it moves their middle with limited force and always holds them symmetric.
        let limited = pull.clamp(-MAX_GRIP_N, grip.force_n);
        let target = if pull == limited { self.setpoint } else { closed + limited / f64::from(FINGER_STIFFNESS) };
        for joint in self.joints {
            if let Some(joint) = world.impulse_joints.get_mut(joint, true) {
                joint.data.set_motor_position(JointAxis::LinX, target as f32, FINGER_STIFFNESS, FINGER_DAMPING);
            }
        }
    }

    /// All its bodies.
    pub(crate) fn bodies(&self) -> [RigidBodyHandle; 4] {
        [self.follow, self.hand, self.fingers[0], self.fingers[1]]
    }

    /// Measured pose of the tool centre point.
    pub(crate) fn tcp(&self, world: &PhysicsWorld) -> Pose {
        world.bodies.get(self.hand).map_or(Pose::IDENTITY, |hand| from_engine(hand.position()))
    }

    /// Measured distance between the pads, metres.
    pub(crate) fn opening(&self, world: &PhysicsWorld) -> f64 {
        let axis = self.tcp(world).transform_vector(DVec3::Y);
        let [first, second] = self.fingers.map(|finger| position(world, finger));
        (first - second).dot(axis).max(0.0)
    }

    /// Poses of the two fingers' frames (origin on the pad, finger at +y of the first and -y of the second).
    pub(crate) fn finger_poses(&self, world: &PhysicsWorld) -> [Pose; 2] {
        self.fingers.map(|finger| world.bodies.get(finger).map_or(Pose::IDENTITY, |body| from_engine(body.position())))
    }

    /// Force of the outside world on the hand, from the deflection of the wrist's motors, world frame, newtons.
    pub(crate) fn wrist_force(&self, world: &PhysicsWorld) -> DVec3 {
        let (Some(follow), Some(hand)) = (world.bodies.get(self.follow), world.bodies.get(self.hand)) else {
            return DVec3::ZERO;
        };
        let shift = (hand.translation() - follow.translation()).as_dvec3();
        let speed = (hand.linvel() - follow.linvel()).as_dvec3();
        let [stiffness, damping, limit] = WRIST_SHIFT.map(f64::from);
        (shift * stiffness + speed * damping).clamp(DVec3::splat(-limit), DVec3::splat(limit))
    }
}

fn position(world: &PhysicsWorld, body: RigidBodyHandle) -> DVec3 {
    world.bodies.get(body).map_or(DVec3::ZERO, |body| body.translation().as_dvec3())
}

fn free_body(pose: rapier3d::math::Pose) -> RigidBodyBuilder {
    // The arm carries the hand's own weight.
    RigidBodyBuilder::dynamic().pose(pose).gravity_scale(0.0).can_sleep(false)
}

fn wrist() -> GenericJointBuilder {
    let mut joint = GenericJointBuilder::new(JointAxesMask::empty());
    let shifts = [JointAxis::LinX, JointAxis::LinY, JointAxis::LinZ].map(|axis| (axis, WRIST_SHIFT));
    let turns = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ].map(|axis| (axis, WRIST_TURN));
    for (axis, [stiffness, damping, limit]) in shifts.into_iter().chain(turns) {
        joint = joint
            .motor_model(axis, MotorModel::ForceBased)
            .motor_position(axis, 0.0, stiffness, damping)
            .motor_max_force(axis, limit);
    }
    joint
}

fn finger(
    world: &mut PhysicsWorld,
    robot: &RobotDescription,
    hand: RigidBodyHandle,
    side: f64,
) -> (RigidBodyHandle, ColliderHandle, ImpulseJointHandle) {
    let anchor = DVec3::Y * (side * 0.5 * MAX_OPENING_M);
    let pose = robot.home * Pose::from_translation(anchor);
    let body = world.insert_body(free_body(to_engine(&pose)));
    let mut pad = ColliderHandle::invalid();
    for part in &robot.finger {
        // The other finger is the mirror image; its frame here stays parallel to the hand's.
        let turn = if side > 0.0 { Pose::IDENTITY } else { Pose::from_yaw(DVec3::ZERO, std::f64::consts::PI) };
        let (local, shape) = shape(&part.solid, 0.0);
        let collider = ColliderBuilder::new(shape)
            .position(to_engine(&(turn * part.pose * local)))
            .mass(FINGER_KG)
            .friction(PAD_FRICTION)
            .friction_combine_rule(CoefficientCombineRule::Max)
            .collision_groups(fingers_pass_each_other());
        pad = world.insert_collider(collider, Some(body));
    }
    let joint = PrismaticJointBuilder::new(vector(DVec3::NEG_Y * side))
        .local_anchor1(vector(anchor))
        .local_anchor2(Vector::ZERO)
        .limits([0.0, (0.5 * MAX_OPENING_M) as f32])
        .contacts_enabled(false)
        .motor_model(MotorModel::ForceBased)
        .motor_position(0.0, FINGER_STIFFNESS, FINGER_DAMPING);
    (body, pad, world.insert_impulse_joint(hand, body, joint))
}

/// The joint limits stop the fingers where they meet; a contact between them would be felt as a held object.
fn fingers_pass_each_other() -> InteractionGroups {
    InteractionGroups::new(Group::GROUP_2, Group::ALL.difference(Group::GROUP_2), InteractionTestMode::And)
}
