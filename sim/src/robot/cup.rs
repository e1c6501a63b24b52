//! A suction cup: holds what it is pressed on flatly, as long as the pull stays below what the vacuum bears.

use super::wrist::{Wrist, spring};
use crate::convert::{from_engine, to_engine};
use acm_concept::{embodiment::SuctionCup, pose::Pose};
use glam::DVec3;
use rapier3d::{parry::query::Ray, prelude::*};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Places on the rim that must all lie on the face.
const RIM_PROBES: u32 = 12;
/// A probe begins this far inside the cup and reaches this far beyond its rim, metres.
const PROBE_M: [f64; 2] = [0.002, 0.003];
/// The pump's vacuum while the cup is open, as a share of its best.
const OPEN_SHARE: f64 = 0.1;
/// A seal holds what it is on from this share on.
const HOLDING_SHARE: f64 = 0.5;
/// The seal is broken when what is held has been pulled this far from where it was taken, metres, radians.
const TORN: (f64, f64) = (0.004, 0.08);
/// Stiffness and damping of the cup for shifts, N/m and N s/m, and for turns, N m/rad and N m s/rad.
const SHIFT: [f32; 2] = [15_000.0, 60.0];
const TURN: [f32; 2] = [60.0, 0.3];

/// The cup's state.
#[derive(Debug, Clone)]
pub(crate) struct Cup {
    model: SuctionCup,
    evacuation_s: f64,
    venting_s: f64,
    /// The vacuum as a share of the pump's best.
    pub(crate) vacuum: f64,
    pub(super) seal: Option<Seal>,
}

/// What the cup holds.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Seal {
    body: RigidBodyHandle,
    collider: ColliderHandle,
    joint: ImpulseJointHandle,
    /// Pose of the body in the hand when it was taken.
    taken: Pose,
}

impl Cup {
    pub(crate) fn new(model: SuctionCup, evacuation_s: f64, venting_s: f64) -> Cup {
        Cup { model, evacuation_s, venting_s, vacuum: 0.0, seal: None }
    }

    /// The collider that it holds.
    pub(crate) fn holds(&self) -> Option<ColliderHandle> {
        self.seal.as_ref().map(|seal| seal.collider)
    }

    /// Pump, seal and tear for one physics step.
    pub(crate) fn drive(&mut self, world: &mut PhysicsWorld, wrist: &Wrist, pump: bool) {
        let dt = f64::from(world.integration_parameters.dt);
        let torn = self.seal.as_ref().is_some_and(|seal| seal.is_torn(world, wrist));
        let face = if pump && !torn && self.seal.is_none() { self.sealed_face(world, wrist) } else { None };
        let closed = pump && !torn && (self.seal.is_some() || face.is_some());
        let (wanted, time_s) = match (pump, closed) {
            (true, true) => (1.0, self.evacuation_s),
            (true, false) => (OPEN_SHARE, self.venting_s),
            (false, _) => (0.0, self.venting_s),
        };
        self.vacuum += (wanted - self.vacuum).clamp(-dt / time_s, dt / time_s);
        if torn || self.vacuum < OPEN_SHARE {
            self.let_go(world);
        }
        if let (Some((collider, body)), true) = (face, self.vacuum >= HOLDING_SHARE) {
            self.take(world, wrist, collider, body);
        }
    }

    fn take(&mut self, world: &mut PhysicsWorld, wrist: &Wrist, collider: ColliderHandle, body: RigidBodyHandle) {
        let Some(there) = world.bodies.get(body).map(|body| from_engine(body.position())) else { return };
        let taken = wrist.tcp(world).inverse() * there;
        let force = self.model.max_force_n as f32;
        // What the rim bears to the side and as a moment follows from its radius.
        let moment = force * self.model.radius_m as f32;
        let joint = spring([SHIFT[0], SHIFT[1], force], [TURN[0], TURN[1], moment])
            .local_frame1(Default::default())
            .local_frame2(to_engine(&taken.inverse()))
            .contacts_enabled(false);
        let joint = world.insert_impulse_joint(wrist.hand, body, joint);
        self.seal = Some(Seal { body, collider, joint, taken });
    }

    fn let_go(&mut self, world: &mut PhysicsWorld) {
        if let Some(seal) = self.seal.take() {
            world.remove_impulse_joint(seal.joint);
        }
    }

    /// The body that closes the whole rim, if one does: flat enough, near enough, not too tilted.
    fn sealed_face(&self, world: &PhysicsWorld, wrist: &Wrist) -> Option<(ColliderHandle, RigidBodyHandle)> {
        let tcp = wrist.tcp(world);
        let axis = tcp.transform_vector(DVec3::Z);
        let mut face = None;
        for probe in 0..RIM_PROBES {
            let angle = TAU * f64::from(probe) / f64::from(RIM_PROBES);
            let rim = 0.9 * self.model.radius_m * DVec3::new(angle.cos(), angle.sin(), 0.0);
            let origin = tcp.transform_point(rim - PROBE_M[0] * DVec3::Z);
            let ray = Ray::new(origin.as_vec3(), axis.as_vec3());
            let filter = QueryFilter::default().exclude_rigid_body(wrist.hand).exclude_sensors();
            let reach = (PROBE_M[0] + PROBE_M[1]) as f32;
            let (collider, hit) = world.cast_ray_and_get_normal(&ray, reach, true, filter)?;
            let tilt = hit.normal.as_dvec3().angle_between(-axis);
            if face.is_some_and(|known| known != collider) || tilt > self.model.max_tilt_rad {
                return None;
            }
            face = Some(collider);
        }
        let collider = face?;
        Some((collider, world.colliders.get(collider)?.parent()?))
    }
}

impl Seal {
    fn is_torn(&self, world: &PhysicsWorld, wrist: &Wrist) -> bool {
        let Some(body) = world.bodies.get(self.body) else { return true };
        let now = wrist.tcp(world).inverse() * from_engine(body.position());
        now.translation.distance(self.taken.translation) > TORN.0 || now.angle_to(&self.taken) > TORN.1
    }
}
