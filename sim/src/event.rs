//! What third parties do: they carry objects from place to place, whether a camera sees it or not.

use crate::{
    body::Body,
    convert::to_engine,
    layout::{Layout, LayoutError, number, vector},
    oracle::Watch,
    scenario::WorldSpec,
};
use acm_concept::pose::Pose;
use glam::DVec3;
use rapier3d::prelude::{PhysicsWorld, RigidBodyType};

/// A scripted carry.
#[derive(Debug, Clone)]
pub(crate) struct Event {
    when: Option<Watch>,
    after_s: f64,
    body: usize,
    to: Pose,
    over_s: f64,
    lift_m: f64,
    phase: Phase,
}

#[derive(Debug, Clone, Copy)]
enum Phase {
    Waiting,
    /// The timer runs until this moment.
    Timed(f64),
    /// Carried from this pose since this moment.
    Carrying(Pose, f64),
    Done,
}

/// The events of a world, their places in it looked up.
pub(crate) fn build(spec: &WorldSpec, layout: &Layout, variables: &[String]) -> Result<Vec<Event>, LayoutError> {
    let event = |event: &crate::scenario::EventSpec| {
        let carried = &layout.find(spec, &event.carry)?.name;
        let scope = layout.scope();
        let to = vector(&event.name, &event.to, &scope)?;
        Ok(Event {
            when: event.when.as_ref().map(|when| Watch::new(when, variables)),
            after_s: event.after_s,
            // The name was just taken from this list.
            body: layout.objects.iter().position(|object| object.name == *carried).unwrap_or_default(),
            to: Pose::from_yaw(to, number(&event.name, &event.yaw, &scope)?),
            over_s: event.over_s,
            lift_m: event.lift_m,
            phase: Phase::Waiting,
        })
    };
    spec.events.iter().map(event).collect()
}

impl Event {
    /// Goes on by one physics step.
    pub(crate) fn step(&mut self, world: &mut PhysicsWorld, bodies: &mut [Body], state: &[f64], now_s: f64) {
        let Some(body) = bodies.get(self.body) else { return };
        self.phase = match self.phase {
            Phase::Waiting if self.when.as_ref().is_none_or(|when| when.holds(state)) => {
                Phase::Timed(now_s + self.after_s)
            }
            Phase::Timed(at) if now_s >= at - 1e-9 => {
                take(world, body, true);
                Phase::Carrying(body.pose(world), now_s)
            }
            Phase::Carrying(from, since) => {
                let share = ((now_s - since) / self.over_s).min(1.0);
                carry(world, body, &self.on_the_way(&from, share));
                if share < 1.0 { Phase::Carrying(from, since) } else { self.let_go(world, body) }
            }
            other => other,
        };
    }

    /// Straight from pose to pose with an arch of height `lift_m`, slow at both ends.
    fn on_the_way(&self, from: &Pose, share: f64) -> Pose {
        let eased = share * share * (3.0 - 2.0 * share);
        let arch = DVec3::Z * (self.lift_m * (std::f64::consts::PI * eased).sin());
        Pose::from_translation(arch) * from.interpolate(&self.to, eased)
    }

    fn let_go(&self, world: &mut PhysicsWorld, body: &Body) -> Phase {
        take(world, body, false);
        put(world, body, &self.to);
        Phase::Done
    }
}

fn take(world: &mut PhysicsWorld, body: &Body, taken: bool) {
    let kind = match (taken, body.placed.fixed) {
        (true, _) => RigidBodyType::KinematicPositionBased,
        (false, true) => RigidBodyType::Fixed,
        (false, false) => RigidBodyType::Dynamic,
    };
    if let Some(body) = world.bodies.get_mut(body.handle) {
        body.set_body_type(kind, true);
    }
}

fn carry(world: &mut PhysicsWorld, body: &Body, pose: &Pose) {
    if let Some(body) = world.bodies.get_mut(body.handle) {
        body.set_next_kinematic_position(to_engine(pose));
    }
}

/// Sets an object down at rest.
pub(crate) fn put(world: &mut PhysicsWorld, body: &Body, pose: &Pose) {
    if let Some(body) = world.bodies.get_mut(body.handle) {
        body.set_position(to_engine(pose), true);
        body.set_linvel(Default::default(), true);
        body.set_angvel(Default::default(), true);
    }
}
