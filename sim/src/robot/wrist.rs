//! The wrist: pulls the hand after a commanded pose with limited force.
//!
//! A kinematic body takes the commanded pose; motors of limited force on all six axes pull the real, dynamic hand
//! after it. So the hand can be stopped by what it touches, and what it presses with is bounded. What is held up is not
//! left behind: the body waits for it, and catches up no faster than the robot moves. Otherwise a hand that comes free
//! would be flung across the way that it was commanded meanwhile.

use crate::{
    convert::{from_engine, to_engine},
    model::shape::shape,
};
use acm_concept::{embodiment::RobotDescription, pose::Pose};
use glam::DVec3;
use rapier3d::prelude::*;

const HAND_KG: f32 = 0.7;
/// Stiffness and damping of the wrist for shifts, N/m and N s/m, and the force it can bear, N.
const SHIFT: [f32; 3] = [8000.0, 300.0, 60.0];
/// The same for turns, N m/rad, N m s/rad, N m.
const TURN: [f32; 3] = [200.0, 8.0, 10.0];
/// How far the hand is held up before what pulls it waits: twice the deflection at which the motors give their all, metres
/// and radians.
const LEAD: [f64; 2] = [0.015, 0.1];

/// Collision groups of the robot's parts. Everything else is in all groups.
pub(crate) const FINGERS: Group = Group::GROUP_2;
pub(crate) const LINKS: Group = Group::GROUP_3;
pub(crate) const HANDS: Group = Group::GROUP_4;

/// The hand's body and what pulls it.
#[derive(Debug, Clone)]
pub(crate) struct Wrist {
    pub(super) follow: RigidBodyHandle,
    pub(crate) hand: RigidBodyHandle,
}

impl Wrist {
    pub(crate) fn build(world: &mut PhysicsWorld, robot: &RobotDescription) -> Wrist {
        let home = to_engine(&robot.home);
        let follow = world.insert_body(RigidBodyBuilder::kinematic_position_based().pose(home));
        let hand = world.insert_body(free_body(home).additional_mass_properties(MassProperties::new(
            Vector::ZERO,
            HAND_KG,
            Vector::new(0.002, 0.002, 0.002),
        )));
        world.insert_impulse_joint(follow, hand, spring(SHIFT, TURN));
        for part in &robot.hand {
            let (turn, shape) = shape(&part.solid, 0.0);
            let collider = ColliderBuilder::new(shape)
                .position(to_engine(&(part.pose * turn)))
                .density(0.0)
                .collision_groups(InteractionGroups::new(HANDS, Group::ALL, InteractionTestMode::And));
            world.insert_collider(collider, Some(hand));
        }
        Wrist { follow, hand }
    }

    /// Sets the pose that the hand is pulled to at the end of the next physics step: the commanded one, if the hand is near
    /// it.
    pub(crate) fn drive(&self, world: &mut PhysicsWorld, target: &Pose, robot: &RobotDescription) {
        let step_s = f64::from(world.integration_parameters.dt);
        let hand = self.tcp(world);
        let Some(body) = world.bodies.get_mut(self.follow) else { return };
        let at = from_engine(body.position());
        let due = towards(&at, target, [robot.max_speed_m_s * step_s, robot.max_turn_rad_s * step_s]);
        let next = towards(&hand, &due, LEAD);
        body.set_next_kinematic_position(to_engine(&next));
    }

    /// Measured pose of the tool centre point.
    pub(crate) fn tcp(&self, world: &PhysicsWorld) -> Pose {
        world.bodies.get(self.hand).map_or(Pose::IDENTITY, |hand| from_engine(hand.position()))
    }

    /// Force of the outside world on the hand, from the deflection of the wrist's motors, world frame, newtons.
    pub(crate) fn force(&self, world: &PhysicsWorld) -> DVec3 {
        let (Some(follow), Some(hand)) = (world.bodies.get(self.follow), world.bodies.get(self.hand)) else {
            return DVec3::ZERO;
        };
        let shift = (hand.translation() - follow.translation()).as_dvec3();
        let speed = (hand.linvel() - follow.linvel()).as_dvec3();
        let [stiffness, damping, limit] = SHIFT.map(f64::from);
        (shift * stiffness + speed * damping).clamp(DVec3::splat(-limit), DVec3::splat(limit))
    }
}

/// A pose no farther from `from` than some metres and radians, as near to `to` as that allows.
fn towards(from: &Pose, to: &Pose, [way_m, turn_rad]: [f64; 2]) -> Pose {
    let share = |limit: f64, whole: f64| if whole > limit { limit / whole } else { 1.0 };
    let way = share(way_m, from.translation.distance(to.translation));
    let turn = share(turn_rad, from.angle_to(to));
    Pose::new(from.translation.lerp(to.translation, way), from.rotation.slerp(to.rotation, turn))
}

/// A body whose own weight the arm carries.
pub(crate) fn free_body(pose: rapier3d::math::Pose) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().pose(pose).gravity_scale(0.0).can_sleep(false)
}

/// A joint that holds two frames together with limited force: stiffness, damping and limit of shifts and of turns.
pub(crate) fn spring(shift: [f32; 3], turn: [f32; 3]) -> GenericJointBuilder {
    let mut joint = GenericJointBuilder::new(JointAxesMask::empty());
    let shifts = [JointAxis::LinX, JointAxis::LinY, JointAxis::LinZ].map(|axis| (axis, shift));
    let turns = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ].map(|axis| (axis, turn));
    for (axis, [stiffness, damping, limit]) in shifts.into_iter().chain(turns) {
        joint = joint
            .motor_model(axis, MotorModel::ForceBased)
            .motor_position(axis, 0.0, stiffness, damping)
            .motor_max_force(axis, limit);
    }
    joint
}
