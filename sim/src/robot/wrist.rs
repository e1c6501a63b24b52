//! The wrist: pulls the hand after a commanded pose with limited force.
//!
//! A kinematic body takes the commanded pose; motors of limited force on all six axes pull the real, dynamic hand
//! after it. So the hand can be stopped by what it touches, and what it presses with is bounded in every direction alike.
//! What is held up is not left behind: the body waits for it, and catches up no faster than the robot moves. Otherwise a
//! hand that comes free would be flung across the way that it was commanded meanwhile.

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

/// The motors of the shifts; and the share of the wrist's force that each has at least.
const SHIFTS: [JointAxis; 3] = [JointAxis::LinX, JointAxis::LinY, JointAxis::LinZ];
const LEAST_SHARE: f64 = 0.02;

/// Collision groups of the robot's parts. Everything else is in all groups.
pub(crate) const FINGERS: Group = Group::GROUP_2;
pub(crate) const LINKS: Group = Group::GROUP_3;
pub(crate) const HANDS: Group = Group::GROUP_4;

/// The hand's body and what pulls it.
#[derive(Debug, Clone)]
pub(crate) struct Wrist {
    pub(super) follow: RigidBodyHandle,
    pub(crate) hand: RigidBodyHandle,
    joint: ImpulseJointHandle,
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
        let joint = world.insert_impulse_joint(follow, hand, spring(SHIFT, TURN));
        for part in &robot.hand {
            let (turn, shape) = shape(&part.solid, 0.0);
            let collider = ColliderBuilder::new(shape)
                .position(to_engine(&(part.pose * turn)))
                .density(0.0)
                .collision_groups(InteractionGroups::new(HANDS, Group::ALL, InteractionTestMode::And));
            world.insert_collider(collider, Some(hand));
        }
        Wrist { follow, hand, joint }
    }

    /// Sets the pose that the hand is pulled to at the end of the next physics step: the commanded one, if the hand is near
    /// it.
    pub(crate) fn drive(&self, world: &mut PhysicsWorld, target: &Pose, robot: &RobotDescription) {
        self.limit(world);
        let step_s = f64::from(world.integration_parameters.dt);
        let hand = self.tcp(world);
        let Some(body) = world.bodies.get_mut(self.follow) else { return };
        let at = from_engine(body.position());
        let due = towards(&at, target, [robot.max_speed_m_s * step_s, robot.max_turn_rad_s * step_s]);
        let next = towards(&hand, &due, LEAD);
        body.set_next_kinematic_position(to_engine(&next));
    }

    /// The motors are limited one by one; where together they would pull with more than the wrist bears, each gets its share
    /// of that.
    fn limit(&self, world: &mut PhysicsWorld) {
        let (wanted, most) = (self.wanted(world), f64::from(SHIFT[2]));
        let shares = if wanted.length() > most {
            let frame = world.bodies.get(self.follow).map_or(Pose::IDENTITY, |follow| from_engine(follow.position()));
            frame.inverse().transform_vector(wanted).abs() / wanted.length()
        } else {
            DVec3::ONE
        };
        if let Some(joint) = world.impulse_joints.get_mut(self.joint, false) {
            for (axis, share) in SHIFTS.into_iter().zip(shares.to_array()) {
                joint.data.set_motor_max_force(axis, (most * share.max(LEAST_SHARE)) as f32);
            }
        }
    }

    /// Measured pose of the tool centre point.
    pub(crate) fn tcp(&self, world: &PhysicsWorld) -> Pose {
        world.bodies.get(self.hand).map_or(Pose::IDENTITY, |hand| from_engine(hand.position()))
    }

    /// Force of the outside world on the hand, from the deflection of the wrist's motors, world frame, newtons.
    pub(crate) fn force(&self, world: &PhysicsWorld) -> DVec3 {
        self.wanted(world).clamp_length_max(f64::from(SHIFT[2]))
    }

    /// With what the motors would resist the hand's deflection if they could pull with any force.
    fn wanted(&self, world: &PhysicsWorld) -> DVec3 {
        let (Some(follow), Some(hand)) = (world.bodies.get(self.follow), world.bodies.get(self.hand)) else {
            return DVec3::ZERO;
        };
        let shift = (hand.translation() - follow.translation()).as_dvec3();
        let speed = (hand.linvel() - follow.linvel()).as_dvec3();
        let [stiffness, damping, _] = SHIFT.map(f64::from);
        shift * stiffness + speed * damping
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
    let shifts = SHIFTS.map(|axis| (axis, shift));
    let turns = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ].map(|axis| (axis, turn));
    for (axis, [stiffness, damping, limit]) in shifts.into_iter().chain(turns) {
        joint = joint
            .motor_model(axis, MotorModel::ForceBased)
            .motor_position(axis, 0.0, stiffness, damping)
            .motor_max_force(axis, limit);
    }
    joint
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::{profile::PhysicsProfile, robot::open};

    #[test]
    fn the_wrist_bears_as_much_in_every_direction() {
        let robot = open("floating-gripper", None, None).unwrap().description;
        for direction in [DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::ONE, DVec3::new(-1.0, 2.0, 0.5)] {
            let mut world = PhysicsWorld::new();
            world.integration_parameters = PhysicsProfile::DEFAULT.parameters();
            let wrist = Wrist::build(&mut world, &robot);
            // Near enough that what pulls it does not wait, far enough that the motors give their all.
            let aside = 0.012 * direction.normalize();
            let hand = world.bodies.get_mut(wrist.hand).unwrap();
            hand.set_translation(hand.translation() + aside.as_vec3(), true);
            let felt = wrist.force(&world);
            assert!((felt.length() - 60.0).abs() < 1e-3 && felt.angle_between(aside) < 1e-3, "{felt}");
            wrist.drive(&mut world, &robot.home, &robot);
            world.step();
            let hand = world.bodies.get(wrist.hand).unwrap();
            let pull = hand.linvel().as_dvec3() * f64::from(hand.mass()) / PhysicsProfile::DEFAULT.step_s();
            assert!(pull.length() < 60.01 && pull.length() > 20.0, "{} N along {direction}", pull.length());
            assert!(pull.angle_between(-aside) < 0.1, "{pull} N against {direction}");
        }
    }
}
