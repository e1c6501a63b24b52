//! What third parties do: they carry objects from place to place, whether a camera sees it or not, stand before
//! cameras, stop them, and jam joints.

use crate::{
    body::Body,
    convert::{from_engine, to_engine},
    layout::{Layout, LayoutError, number, vector},
    oracle::Watch,
    scenario::{DeedSpec, EventSpec, WorldSpec},
};
use acm_concept::pose::Pose;
use glam::DVec3;
use rapier3d::prelude::{PhysicsWorld, RigidBodyType};
use serde::{Deserialize, Serialize};

/// A scripted event.
#[derive(Debug, Clone)]
pub(crate) struct Event {
    when: Option<Watch>,
    after_s: f64,
    over_s: f64,
    deed: Deed,
    pub(crate) phase: Phase,
}

#[derive(Debug, Clone)]
enum Deed {
    Carry { body: usize, to: Pose, lift_m: f64 },
    Cover { cameras: Vec<usize> },
    Freeze { cameras: Vec<usize> },
    Jam { body: usize, link: usize },
}

/// How far an event has come: all that it changes while the world runs.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) enum Phase {
    Waiting,
    /// The timer runs until this moment.
    Timed(f64),
    /// Under way since this moment; what is carried came from this pose.
    Acting(Pose, f64),
    Done,
}

/// The events of a world, their places in it looked up.
pub(crate) fn build(spec: &WorldSpec, layout: &Layout, variables: &[String]) -> Result<Vec<Event>, LayoutError> {
    let event = |event: &EventSpec| {
        let deed = match &event.deed {
            DeedSpec::Carry { object, to, yaw, lift_m } => {
                let carried = &layout.find(spec, object)?.name;
                let scope = layout.scope();
                let to = Pose::from_yaw(vector(&event.name, to, &scope)?, number(&event.name, yaw, &scope)?);
                // The name was just taken from this list.
                let body = layout.objects.iter().position(|object| object.name == *carried).unwrap_or_default();
                Deed::Carry { body, to, lift_m: *lift_m }
            }
            DeedSpec::Cover { cameras } => Deed::Cover { cameras: cameras.clone() },
            DeedSpec::Freeze { cameras } => Deed::Freeze { cameras: cameras.clone() },
            DeedSpec::Jam { object, link } => {
                let body = layout.objects.iter().position(|placed| placed.name == *object).unwrap_or_default();
                Deed::Jam { body, link: *link }
            }
        };
        let when = event.when.as_ref().map(|when| Watch::new(when, variables));
        Ok(Event { when, after_s: event.after_s, over_s: event.over_s, deed, phase: Phase::Waiting })
    };
    spec.events.iter().map(event).collect()
}

impl Event {
    /// Makes the world ready for what it may do.
    pub(crate) fn prepare(&self, world: &mut PhysicsWorld, bodies: &mut [Body]) {
        if let Deed::Jam { body, link } = self.deed
            && let Some(joint) = bodies.get_mut(body).and_then(|body| body.joint_mut(link))
        {
            joint.make_jammable(world);
        }
    }

    /// Goes on by one physics step. Says which object it has just set down, if any: its parts were set with it.
    pub(crate) fn step(
        &mut self,
        world: &mut PhysicsWorld,
        bodies: &mut [Body],
        state: &[f64],
        now_s: f64,
    ) -> Option<usize> {
        let was_acting = matches!(self.phase, Phase::Acting(..));
        self.phase = match self.phase {
            Phase::Waiting if self.when.as_ref().is_none_or(|when| when.holds(state)) => {
                Phase::Timed(now_s + self.after_s)
            }
            Phase::Timed(at) if now_s >= at - 1e-9 => Phase::Acting(self.deed.begin(world, bodies), now_s),
            Phase::Acting(from, since) => {
                let share = if self.over_s > 0.0 { ((now_s - since) / self.over_s).min(1.0) } else { 1.0 };
                self.deed.go_on(world, bodies, &from, share);
                if share < 1.0 { Phase::Acting(from, since) } else { Phase::Done }
            }
            other => other,
        };
        match self.deed {
            Deed::Carry { body, .. } if was_acting && matches!(self.phase, Phase::Done) => Some(body),
            _ => None,
        }
    }

    /// Whether it hides the world from a camera now.
    pub(crate) fn covers(&self, camera: usize) -> bool {
        let covered = matches!(&self.deed, Deed::Cover { cameras } if cameras.contains(&camera));
        covered && matches!(self.phase, Phase::Acting(..))
    }
    /// Whether a camera is stuck at its last picture now.
    pub(crate) fn freezes(&self, camera: usize) -> bool {
        let frozen = matches!(&self.deed, Deed::Freeze { cameras } if cameras.contains(&camera));
        frozen && matches!(self.phase, Phase::Acting(..))
    }
}

impl Deed {
    /// Takes what is carried; says where it was.
    fn begin(&self, world: &mut PhysicsWorld, bodies: &[Body]) -> Pose {
        match self {
            Deed::Carry { body, .. } => bodies.get(*body).map_or(Pose::IDENTITY, |body| {
                take(world, body, true);
                body.pose(world)
            }),
            Deed::Jam { .. } => {
                self.jam(world, bodies, true);
                Pose::IDENTITY
            }
            Deed::Cover { .. } | Deed::Freeze { .. } => Pose::IDENTITY,
        }
    }

    fn go_on(&self, world: &mut PhysicsWorld, bodies: &[Body], from: &Pose, share: f64) {
        if share >= 1.0 {
            self.jam(world, bodies, false);
        }
        let Deed::Carry { body, to, lift_m } = self else { return };
        let Some(body) = bodies.get(*body) else { return };
        if share < 1.0 {
            return carry(world, body, &on_the_way(from, to, *lift_m, share));
        }
        take(world, body, false);
        put(world, body, to);
    }

    fn jam(&self, world: &mut PhysicsWorld, bodies: &[Body], jammed: bool) {
        if let Deed::Jam { body, link } = self
            && let Some(joint) = bodies.get(*body).and_then(|body| body.joint(*link))
        {
            joint.jam(world, jammed);
        }
    }
}

/// Straight from pose to pose with an arch of height `lift_m`, slow at both ends.
fn on_the_way(from: &Pose, to: &Pose, lift_m: f64, share: f64) -> Pose {
    let eased = share * share * (3.0 - 2.0 * share);
    let arch = DVec3::Z * (lift_m * (std::f64::consts::PI * eased).sin());
    Pose::from_translation(arch) * from.interpolate(to, eased)
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

/// Sets an object down at rest, its parts as they are to each other.
pub(crate) fn put(world: &mut PhysicsWorld, body: &Body, pose: &Pose) {
    let shift = *pose * body.pose(world).inverse();
    for handle in body.handles() {
        if let Some(part) = world.bodies.get_mut(handle) {
            let moved = if handle == body.handle { *pose } else { shift * from_engine(part.position()) };
            part.set_position(to_engine(&moved), true);
            part.set_linvel(Default::default(), true);
            part.set_angvel(Default::default(), true);
        }
    }
}
