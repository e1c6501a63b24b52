//! Joints in the engine. Whatever acts along a joint's axis - friction, spring, latch, detents, another joint, a
//! gauge's value - is a motor of limited force on that axis, so that everything is solved together with the contacts.
//!
//! Joints of the engine's impulse kind, not multibodies: a multibody's root does not follow a third party who carries
//! it. What 60 N pull across the axis at 0.4 m gives way by less than half a millimetre this way too.

use crate::{
    convert::{from_engine, vector},
    model::joint::{Follows, Joint, JointKind},
};
use acm_concept::pose::{Pose, wrap_angle};
use glam::{DQuat, DVec3};
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

/// How far dry friction gives way before it slips, metres or radians. Below its force it holds like a stiff spring:
/// a mere brake lets a load creep by millimetres per second, because the solver's passes over one step are few.
const GIVE: f64 = 2e-4;
/// What follows another joint or an expression is pulled with this stiffness, damping and force: hinge, slider.
const FOLLOW: [[f64; 3]; 2] = [[20.0, 1.0, 5.0], [5000.0, 100.0, 50.0]];
/// Most that what acts along a joint changes its speed in a substep: hinge, slider.
const CHANGE: [f64; 2] = [0.5, 0.1];
/// Share of a latch's or detent's reach in which its force rises to the full one.
const RISE: f64 = 0.25;

/// A joint between two bodies, and what it counts.
#[derive(Debug, Clone)]
pub(crate) struct Articulation {
    pub(crate) joint: Joint,
    parent: RigidBodyHandle,
    child: RigidBodyHandle,
    /// Position at which the engine reads zero: it tells angles apart within half a turn to either side.
    middle: f64,
    brake: Option<ImpulseJointHandle>,
    /// Where the brake holds.
    anchor: f64,
    latch: Option<ImpulseJointHandle>,
    detents: Option<ImpulseJointHandle>,
    follower: Option<ImpulseJointHandle>,
    /// Holds everything while it is jammed; only joints that may jam have it.
    jam: Option<ImpulseJointHandle>,
    pub(crate) position: f64,
    pub(crate) speed: f64,
    pub(crate) pressed: bool,
    pub(crate) presses: u32,
    armed: bool,
}

impl Articulation {
    /// Joins two bodies whose frames lie on each other when the joint is at zero. `middle` is about the child's centre of
    /// mass: a light part that is held far from there is more than the solver can do.
    pub(crate) fn insert(
        world: &mut PhysicsWorld,
        parent: RigidBodyHandle,
        child: RigidBodyHandle,
        joint: &Joint,
        middle: DVec3,
    ) -> Articulation {
        let anchor = match joint.kind {
            JointKind::Slider => middle,
            JointKind::Hinge => joint.origin + joint.axis * (middle - joint.origin).dot(joint.axis),
        };
        let joint = &Joint { origin: anchor, ..joint.clone() };
        let middle = match (joint.kind, joint.range) {
            (JointKind::Hinge, Some([low, high])) => 0.5 * (low + high),
            _ => 0.0,
        };
        let mut made = Articulation {
            joint: joint.clone(),
            parent,
            child,
            middle,
            brake: None,
            anchor: joint.start,
            latch: None,
            detents: None,
            follower: None,
            jam: None,
            position: joint.start,
            speed: 0.0,
            pressed: false,
            presses: 0,
            armed: true,
        };
        // One that starts pressed has not been pressed.
        made.pressed = joint.press.is_some_and(|press| made.depth() > press.pressed);
        made.armed = !made.pressed;
        made.insert_guide(world);
        if joint.friction > 0.0 {
            let stiffness = joint.friction / GIVE;
            let at = made.read(joint.start);
            let brake = made.drive().motor_position(made.axis(), at, stiffness as f32, (0.01 * stiffness) as f32);
            made.brake = Some(made.insert_drive(world, brake, joint.friction));
        }
        if let Some(latch) = joint.latch {
            let (stiffness, damping) = made.hold(latch.force, latch.within);
            let catch = made.drive().motor_position(made.axis(), made.read(joint.closed), stiffness, damping);
            made.latch = Some(made.insert_drive(world, catch, latch.force));
        }
        if let Some(detents) = &joint.detents {
            let (notch, half) = detents.at.nearest(joint.start);
            let (stiffness, damping) = made.hold(detents.force, half);
            let notch = made.drive().motor_position(made.axis(), made.read(notch), stiffness, damping);
            made.detents = Some(made.insert_drive(world, notch, detents.force));
        }
        if joint.follows.is_some() {
            let [stiffness, damping, force] = FOLLOW[usize::from(joint.kind == JointKind::Slider)];
            let start = made.read(joint.start);
            let pull = made.drive().motor_position(made.axis(), start, stiffness as f32, damping as f32);
            made.follower = Some(made.insert_drive(world, pull, force));
        }
        made
    }

    /// What is added to the inertia of what hangs on it: kg m2 for a hinge, kg for a slider. Where friction could stop a
    /// light knob a hundred times in a substep, the solver would make it chatter; with this the joint changes its speed
    /// by 0.5 rad/s or 0.1 m/s at most.
    pub(crate) fn armature(joint: &Joint, world: &PhysicsWorld) -> f64 {
        let parameters = &world.integration_parameters;
        let substep_s = f64::from(parameters.dt) / parameters.num_solver_iterations as f64;
        let kind = usize::from(joint.kind == JointKind::Slider);
        let holds = joint.latch.map_or(0.0, |latch| latch.force) + joint.detents.as_ref().map_or(0.0, |d| d.force);
        let pulls = if joint.follows.is_some() { FOLLOW[kind][2] } else { 0.0 };
        (joint.friction + holds + pulls) * substep_s / CHANGE[kind]
    }

    /// Whether it must be watched even when nothing moves.
    pub(crate) fn is_alive(joint: &Joint) -> bool {
        joint.spring.is_some() || joint.latch.is_some() || joint.detents.is_some() || joint.follows.is_some()
    }

    /// The joint proper: what is left free, how far, and the spring.
    fn insert_guide(&self, world: &mut PhysicsWorld) {
        let locked = match self.joint.kind {
            JointKind::Hinge => JointAxesMask::LOCKED_REVOLUTE_AXES,
            JointKind::Slider => JointAxesMask::LOCKED_PRISMATIC_AXES,
        };
        let axis = self.axis();
        let mut guide = self.frames(GenericJointBuilder::new(locked));
        if let Some(range) = self.joint.range {
            guide = guide.limits(axis, range.map(|end| self.read(end)));
        }
        if self.joint.spring.is_some() || self.joint.damping > 0.0 {
            let spring = self.joint.spring.map(|spring| (spring.free(&self.joint), spring.stiffness));
            let (free, stiffness) = spring.unwrap_or((self.middle, 0.0));
            guide = guide.motor_model(axis, MotorModel::ForceBased).motor_position(
                axis,
                self.read(free),
                stiffness as f32,
                self.joint.damping as f32,
            );
        }
        world.insert_impulse_joint(self.parent, self.child, guide);
    }

    fn axis(&self) -> JointAxis {
        match self.joint.kind {
            JointKind::Hinge => JointAxis::AngX,
            JointKind::Slider => JointAxis::LinX,
        }
    }

    /// A position as the engine reads it.
    fn read(&self, position: f64) -> f32 {
        (position - self.middle) as f32
    }

    fn frames(&self, joint: GenericJointBuilder) -> GenericJointBuilder {
        let along = DQuat::from_rotation_arc(DVec3::X, self.joint.axis);
        let frame = |turn: f64| {
            rapier3d::math::Pose::from_parts(
                vector(self.joint.origin),
                (along * DQuat::from_rotation_x(turn)).as_quat().normalize(),
            )
        };
        joint.local_frame1(frame(self.middle)).local_frame2(frame(0.0)).contacts_enabled(false)
    }

    /// A joint that holds nothing, for one motor.
    fn drive(&self) -> GenericJointBuilder {
        self.frames(GenericJointBuilder::new(JointAxesMask::empty())).motor_model(self.axis(), MotorModel::ForceBased)
    }

    fn insert_drive(&self, world: &mut PhysicsWorld, drive: GenericJointBuilder, force: f64) -> ImpulseJointHandle {
        world.insert_impulse_joint(self.parent, self.child, drive.motor_max_force(self.axis(), force as f32))
    }

    /// Stiffness and damping of something that holds with a force over a reach.
    fn hold(&self, force: f64, reach: f64) -> (f32, f32) {
        let stiffness = force / (RISE * reach);
        (stiffness as f32, (0.02 * stiffness) as f32)
    }

    /// Gives it what can hold it fast.
    pub(crate) fn make_jammable(&mut self, world: &mut PhysicsWorld) {
        let mut all = GenericJointBuilder::new(JointAxesMask::LOCKED_FIXED_AXES).contacts_enabled(false).build();
        all.set_enabled(false);
        self.jam = Some(world.insert_impulse_joint(self.parent, self.child, all));
    }

    /// Holds it fast where it is, or lets it go again.
    pub(crate) fn jam(&self, world: &mut PhysicsWorld, jammed: bool) {
        let (Some(parent), Some(child)) = (world.bodies.get(self.parent), world.bodies.get(self.child)) else { return };
        let at = parent.position().inverse() * child.position();
        let Some(joint) = self.jam.and_then(|handle| world.impulse_joints.get_mut(handle, true)) else { return };
        joint.data.local_frame1 = at;
        joint.data.set_enabled(jammed);
    }

    /// Sets what depends on where the joint is. `target` is where it is to follow to, if it follows anything.
    pub(crate) fn act(&self, world: &mut PhysicsWorld, target: Option<f64>) {
        let axis = self.axis();
        let motor = |world: &mut PhysicsWorld, handle: Option<ImpulseJointHandle>, to: f64, force: f64| {
            let Some(handle) = handle else { return };
            let Some(joint) = world.impulse_joints.get_mut(handle, false) else { return };
            joint.data.motors[axis as usize].target_pos = self.read(to);
            joint.data.motors[axis as usize].max_force = force as f32;
        };
        motor(world, self.brake, self.anchor, self.joint.friction);
        if let Some(latch) = self.joint.latch {
            let force = if self.is_latched() { latch.force } else { 0.0 };
            motor(world, self.latch, self.joint.closed, force);
        }
        if let Some(detents) = &self.joint.detents {
            motor(world, self.detents, detents.at.nearest(self.position).0, detents.force);
        }
        if let Some(target) = target {
            let [_, _, force] = FOLLOW[usize::from(self.joint.kind == JointKind::Slider)];
            motor(world, self.follower, self.joint.clamp(target), force);
        }
    }

    /// Measures where the joint is after a physics step, and counts presses.
    pub(crate) fn measure(&mut self, world: &PhysicsWorld) {
        let (Some(parent), Some(child)) = (world.bodies.get(self.parent), world.bodies.get(self.child)) else { return };
        let (of_parent, of_child) = (from_engine(parent.position()), from_engine(child.position()));
        let relative = of_parent.inverse() * of_child;
        let (axis, origin) = (self.joint.axis, self.joint.origin);
        let along = of_parent.transform_vector(axis);
        match self.joint.kind {
            JointKind::Slider => {
                self.position = (relative.transform_point(origin) - origin).dot(axis);
                let at = vector(of_child.transform_point(origin));
                let shift = child.velocity_at_point(at) - parent.velocity_at_point(at);
                self.speed = shift.as_dvec3().dot(along);
            }
            JointKind::Hinge => {
                let turn = relative.rotation;
                let angle = 2.0 * turn.xyz().dot(axis).atan2(turn.w);
                // Within half a turn of the last position, so that a free turn is counted on.
                self.position += wrap_angle(angle - self.position);
                self.speed = (child.angvel() - parent.angvel()).as_dvec3().dot(along);
            }
        }
        self.anchor = self.anchor.clamp(self.position - GIVE, self.position + GIVE);
        self.count();
    }

    /// Counts a press when the joint has gone far enough since it was last back.
    fn count(&mut self) {
        let Some(press) = self.joint.press else { return };
        let depth = self.depth();
        if self.armed && depth > press.pressed {
            self.armed = false;
            self.pressed = true;
            self.presses += 1;
        } else if depth < press.rearmed {
            self.armed = true;
            self.pressed = false;
        }
    }

    /// How far it is from closed.
    pub(crate) fn depth(&self) -> f64 {
        (self.position - self.joint.closed).abs()
    }

    /// Whether its latch holds it.
    pub(crate) fn is_latched(&self) -> bool {
        self.joint.latch.is_some_and(|latch| self.depth() < latch.within)
    }

    /// Where the joint it follows wants it, given the positions of all joints by link.
    pub(crate) fn follows(&self, position: impl Fn(usize) -> f64) -> Option<f64> {
        match self.joint.follows {
            Some(Follows::Joint { link, ratio, offset }) => Some(ratio * position(link) + offset),
            _ => None,
        }
    }

    /// A point of the axis, and its direction, in the world.
    pub(crate) fn line(&self, world: &PhysicsWorld) -> (DVec3, DVec3) {
        let parent = world.bodies.get(self.parent).map_or(Pose::IDENTITY, |body| from_engine(body.position()));
        (parent.transform_point(self.joint.origin), parent.transform_vector(self.joint.axis))
    }
}

/// All that a joint changes while the world runs, apart from its bodies and motors.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct ArticulationState {
    anchor: f64,
    position: f64,
    speed: f64,
    pressed: bool,
    presses: u32,
    armed: bool,
}

impl Articulation {
    pub(crate) fn state(&self) -> ArticulationState {
        let Articulation { anchor, position, speed, pressed, presses, armed, .. } = *self;
        ArticulationState { anchor, position, speed, pressed, presses, armed }
    }
    pub(crate) fn set_state(&mut self, state: ArticulationState) {
        (self.anchor, self.position, self.speed) = (state.anchor, state.position, state.speed);
        (self.pressed, self.presses, self.armed) = (state.pressed, state.presses, state.armed);
    }
}

/// Keeps two bodies from feeling each other.
pub(crate) fn let_pass(world: &mut PhysicsWorld, first: RigidBodyHandle, second: RigidBodyHandle) {
    let nothing = GenericJointBuilder::new(JointAxesMask::empty()).contacts_enabled(false);
    world.insert_impulse_joint(first, second, nothing);
}

#[cfg(test)]
mod tests;
