//! What touches the pads, and with which force.

use crate::{
    profile::SUBSTEPS,
    robot::{Robot, Touching},
};
use glam::DVec3;
use rapier3d::prelude::{ColliderHandle, ContactPair, PhysicsWorld};
use serde::{Deserialize, Serialize};

/// Contacts of every hand's two pads after one physics step. A suction cup counts as two pads on what it holds.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Contacts {
    hands: Vec<[PadContacts; 2]>,
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct PadContacts {
    partners: Vec<ColliderHandle>,
    /// Force on the pad, world frame, newtons.
    force: DVec3,
}

impl Contacts {
    pub(crate) fn read(&mut self, world: &PhysicsWorld, robot: &Robot) {
        let dt = f64::from(world.integration_parameters.dt);
        self.hands.resize_with(robot.description.arms(), Default::default);
        for (pads, touching) in self.hands.iter_mut().zip(robot.touching()) {
            match touching {
                Touching::Pads(colliders) => read_pads(pads, colliders, world, dt),
                Touching::Cup(held) => {
                    for pad in pads {
                        *pad = PadContacts { partners: held.into_iter().collect(), force: DVec3::ZERO };
                    }
                }
            }
        }
    }
    /// How many pads of one hand touch one of these colliders; the hand that has the most.
    pub(crate) fn pads_touching(&self, colliders: &[ColliderHandle]) -> usize {
        let touches = |pad: &&PadContacts| pad.partners.iter().any(|partner| colliders.contains(partner));
        self.hands.iter().map(|pads| pads.iter().filter(touches).count()).max().unwrap_or(0)
    }
    /// How many pads of one hand touch anything; the hand that has the most.
    pub(crate) fn pads_in_contact(&self) -> usize {
        let touches = |pad: &&PadContacts| !pad.partners.is_empty();
        self.hands.iter().map(|pads| pads.iter().filter(touches).count()).max().unwrap_or(0)
    }
}

fn read_pads(pads: &mut [PadContacts; 2], colliders: [ColliderHandle; 2], world: &PhysicsWorld, dt: f64) {
    for (pad, collider) in pads.iter_mut().zip(colliders) {
        pad.partners.clear();
        pad.force = DVec3::ZERO;
        for pair in world.contact_pairs_with(collider) {
            let impulse = impulse_on(pair, collider);
            if pair.total_impulse_magnitude() > 0.0 {
                pad.force += impulse / dt;
                pad.partners.push(if pair.collider1 == collider { pair.collider2 } else { pair.collider1 });
            }
        }
    }
}

/// Impulse of one step on a collider of a pair, world frame.
fn impulse_on(pair: &ContactPair, collider: ColliderHandle) -> DVec3 {
    // Normals point from the first collider to the second, which pushes the first one back. Friction is stored in
    // the world frame as it acts on the first collider, for the last substep alone.
    let on_first = pair.solver_manifolds().iter().fold(DVec3::ZERO, |sum, manifold| {
        let normal = manifold.data.normal.as_dvec3();
        manifold.points.iter().fold(sum, |sum, point| {
            let friction = point.data.warmstart_tangent_world.as_dvec3() * SUBSTEPS as f64;
            sum - normal * f64::from(point.data.impulse) + friction
        })
    });
    if pair.collider1 == collider { on_first } else { -on_first }
}

/// Forces summed over the steps of a control tick.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct TickForces {
    pads: [DVec3; 2],
    wrist: DVec3,
    steps: u32,
}

impl TickForces {
    /// Takes what the pads of one hand and its wrist feel.
    pub(crate) fn add(&mut self, contacts: &Contacts, hand: usize, wrist: DVec3) {
        for (sum, pad) in self.pads.iter_mut().zip(contacts.hands.get(hand).into_iter().flatten()) {
            *sum += pad.force;
        }
        self.wrist += wrist;
        self.steps += 1;
    }
    /// Mean forces on the pads and at the wrist, world frame, newtons.
    pub(crate) fn mean(&self) -> ([DVec3; 2], DVec3) {
        let share = 1.0 / f64::from(self.steps.max(1));
        (self.pads.map(|force| force * share), self.wrist * share)
    }
}
