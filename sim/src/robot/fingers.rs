//! Two fingers on one drive of limited force.

use super::wrist::{FINGERS, Wrist, free_body};
use crate::{
    convert::{from_engine, to_engine, vector},
    model::shape::shape,
    profile::SUBSTEPS,
};
use acm_concept::{embodiment::RobotDescription, pose::Pose};
use glam::DVec3;
use rapier3d::prelude::*;

const PAD_FRICTION: f32 = 1.0;
/// A finger and its share of the drive's inertia. Light fingers between stiff contacts let what they hold creep: with half
/// of this it creeps twice as far.
const FINGER_KG: f32 = 0.4;
const STIFFNESS: f32 = 8_000.0;
const DAMPING: f32 = 40.0;
/// Speed of each finger, metres per second.
const SPEED: f64 = 0.1;

/// The fingers' bodies and joints in the engine.
#[derive(Debug, Clone)]
pub(crate) struct Fingers {
    pub(super) fingers: [RigidBodyHandle; 2],
    /// The finger's colliders, +y side first: the pads.
    pub(crate) pads: [ColliderHandle; 2],
    joints: [ImpulseJointHandle; 2],
    max_opening_m: f64,
    max_force_n: f64,
    /// Where the fingers' controller is on its way to the commanded opening, metres each finger has closed.
    pub(super) setpoint: f64,
}

impl Fingers {
    pub(crate) fn build(world: &mut PhysicsWorld, robot: &RobotDescription, wrist: &Wrist) -> Fingers {
        let side = |side: f64, world: &mut PhysicsWorld| finger(world, robot, wrist.hand, side);
        let (first, first_pad, first_joint) = side(1.0, world);
        let (second, second_pad, second_joint) = side(-1.0, world);
        Fingers {
            fingers: [first, second],
            pads: [first_pad, second_pad],
            joints: [first_joint, second_joint],
            max_opening_m: robot.max_opening_m,
            max_force_n: robot.max_grip_force_n,
            setpoint: 0.0,
        }
    }

    /// Drives the fingers for one physics step towards an opening in metres with a force in newtons.
    pub(crate) fn drive(&mut self, world: &mut PhysicsWorld, wrist: &Wrist, opening_m: f64, force_n: f64) {
        let step = SPEED * f64::from(world.integration_parameters.dt);
        let wanted = 0.5 * (self.max_opening_m - opening_m);
        self.setpoint += (wanted - self.setpoint).clamp(-step, step);
        let closed = 0.5 * (self.max_opening_m - self.opening(world, wrist));
        let pull = f64::from(STIFFNESS) * (self.setpoint - closed);
        // Both fingers hang on one drive: it moves their middle with limited force and always holds them symmetric.
        let limited = pull.clamp(-self.max_force_n, force_n);
        let target = if pull == limited { self.setpoint } else { closed + limited / f64::from(STIFFNESS) };
        for joint in self.joints {
            if let Some(joint) = world.impulse_joints.get_mut(joint, true) {
                joint.data.set_motor_position(JointAxis::LinX, target as f32, STIFFNESS, DAMPING);
            }
        }
    }

    /// Measured distance between the pads, metres.
    pub(crate) fn opening(&self, world: &PhysicsWorld, wrist: &Wrist) -> f64 {
        let axis = wrist.tcp(world).transform_vector(DVec3::Y);
        let position = |finger| world.bodies.get(finger).map_or(DVec3::ZERO, |body| body.translation().as_dvec3());
        let [first, second] = self.fingers.map(position);
        (first - second).dot(axis).max(0.0)
    }

    /// What the drive pressed the fingers together with in the last physics step, newtons; below 0 while it opens them.
    pub(crate) fn grip_n(&self, world: &PhysicsWorld) -> f64 {
        let motor = |joint| {
            world.impulse_joints.get(joint).map_or(0.0, |joint| joint.data.motors[JointAxis::LinX as usize].impulse)
        };
        let impulse = self.joints.iter().map(|joint| f64::from(motor(*joint))).sum::<f64>();
        // The engine keeps the impulse of the last substep alone.
        0.5 * impulse * SUBSTEPS as f64 / f64::from(world.integration_parameters.dt)
    }

    /// Poses of the two fingers' frames (origin on the pad, finger at +y of the first and -y of the second).
    pub(crate) fn poses(&self, world: &PhysicsWorld) -> [Pose; 2] {
        self.fingers.map(|finger| world.bodies.get(finger).map_or(Pose::IDENTITY, |body| from_engine(body.position())))
    }
}

fn finger(
    world: &mut PhysicsWorld,
    robot: &RobotDescription,
    hand: RigidBodyHandle,
    side: f64,
) -> (RigidBodyHandle, ColliderHandle, ImpulseJointHandle) {
    let anchor = DVec3::Y * (side * 0.5 * robot.max_opening_m);
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
        .limits([0.0, (0.5 * robot.max_opening_m) as f32])
        .contacts_enabled(false)
        .motor_model(MotorModel::ForceBased)
        .motor_position(0.0, STIFFNESS, DAMPING);
    (body, pad, world.insert_impulse_joint(hand, body, joint))
}

/// The joint limits stop the fingers where they meet; a contact between them would be felt as a held object.
fn fingers_pass_each_other() -> InteractionGroups {
    InteractionGroups::new(FINGERS, Group::ALL.difference(FINGERS), InteractionTestMode::And)
}
