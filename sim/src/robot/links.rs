//! The links of an arm: bodies that go exactly where the joints put them, and stop when they meet too much.
//!
//! The arm is position-controlled, as its maker's is: the joints follow their commands within the limits of speed, and
//! all yielding is in the force-limited wrist between flange and hand. The alternative, a multibody with a force-limited
//! motor in every joint and its weight compensated, was measured with 8 solver substeps at 250 Hz: it picks a cube, shakes
//! it and holds it for 15 s (0.6 mm and 5 mrad of creep), but takes 6,000 physics steps a CPU-second, 24 times real time
//! with one arm.

use super::wrist::{FINGERS, HANDS, LINKS};
use crate::convert::to_engine;
use acm_concept::{
    arm::{ArmDescription, LinkFrames},
    pose::Pose,
};
use glam::DVec3;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

/// A link that is pressed harder than this stops the arm, newtons.
const MOST_N: f32 = 60.0;
/// A link that is this deep in something that cannot give way stops the arm, metres.
const DEPTH_M: f32 = 0.001;
/// Either counts only where it has grown by this factor since the last physics step.
const WORSE: f32 = 1.001;

/// The bodies of the links in the engine, one a capsule.
#[derive(Debug, Clone)]
pub(crate) struct Links {
    parts: Vec<Part>,
}

/// How a link meets its surroundings: how hard it is pressed, newtons, and how deep it is in what stands fast, metres.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Press {
    force: f32,
    depth: f32,
}

#[derive(Debug, Clone)]
struct Part {
    link: usize,
    body: RigidBodyHandle,
    collider: ColliderHandle,
    /// After the last physics step.
    last: Press,
}

impl Links {
    /// The engine's bodies.
    pub(super) fn bodies(&self) -> impl Iterator<Item = RigidBodyHandle> {
        self.parts.iter().map(|part| part.body)
    }
    /// How every link met its surroundings after the last step: all that they change while the world runs.
    pub(super) fn state(&self) -> Vec<Press> {
        self.parts.iter().map(|part| part.last).collect()
    }
    pub(super) fn set_state(&mut self, state: Vec<Press>) {
        for (part, last) in self.parts.iter_mut().zip(state) {
            part.last = last;
        }
    }

    pub(crate) fn build(world: &mut PhysicsWorld, arm: &ArmDescription) -> Links {
        let frames = arm.frames(&arm.home);
        let all_but_the_robot = Group::ALL.difference(FINGERS).difference(HANDS).difference(LINKS);
        let groups = InteractionGroups::new(LINKS, all_but_the_robot, InteractionTestMode::And);
        let parts = arm.capsules.iter().map(|capsule| {
            let pose = frame(&frames, capsule.link);
            let body = world.insert_body(RigidBodyBuilder::kinematic_position_based().pose(to_engine(&pose)));
            let shape = ColliderBuilder::capsule_from_endpoints(
                capsule.from.as_vec3(),
                capsule.to.as_vec3(),
                capsule.radius_m as f32,
            );
            // Tables and walls too: what cannot give way is not pushed, but the contact is found.
            let types = ActiveCollisionTypes::default() | ActiveCollisionTypes::KINEMATIC_FIXED;
            let collider = shape.density(0.0).collision_groups(groups).active_collision_types(types);
            Part {
                link: capsule.link,
                body,
                collider: world.insert_collider(collider, Some(body)),
                last: Press::default(),
            }
        });
        Links { parts: parts.collect() }
    }

    /// Sets where the links are at the end of the next physics step.
    pub(crate) fn drive(&self, world: &mut PhysicsWorld, frames: &LinkFrames) {
        for part in &self.parts {
            if let Some(body) = world.bodies.get_mut(part.body) {
                body.set_next_kinematic_position(to_engine(&frame(frames, part.link)));
            }
        }
    }

    /// Why the arm must stop after this step, in a sentence, if it must. What does not get worse lets it go on, so that it
    /// can leave. The base stands where it stands.
    pub(crate) fn obstructed(&mut self, world: &PhysicsWorld) -> Option<String> {
        let mut reason = None;
        for part in self.parts.iter_mut().filter(|part| part.link > 0) {
            let now = part.press(world);
            let before = std::mem::replace(&mut part.last, now);
            if now.force > MOST_N && now.force > WORSE * before.force {
                reason.get_or_insert(format!("link {} felt {:.0} N, {MOST_N} N are allowed", part.link, now.force));
            } else if now.depth > DEPTH_M && now.depth > WORSE * before.depth {
                reason.get_or_insert(format!("link {} ran against something that stands fast", part.link));
            }
        }
        reason
    }
}

impl Part {
    fn press(&self, world: &PhysicsWorld) -> Press {
        let dt = world.integration_parameters.dt;
        let mut press = Press::default();
        for pair in world.contact_pairs_with(self.collider) {
            press.force += pair.total_impulse_magnitude() / dt;
            let other = if pair.collider1 == self.collider { pair.collider2 } else { pair.collider1 };
            let body = world.colliders.get(other).and_then(|c| c.parent()).and_then(|body| world.bodies.get(body));
            if body.is_none_or(|body| !body.is_dynamic()) {
                let depth = pair.find_deepest_contact().map_or(0.0, |(_, contact)| -contact.dist);
                press.depth = press.depth.max(depth);
            }
        }
        press
    }
}

fn frame(frames: &LinkFrames, link: usize) -> Pose {
    frames.get(link).copied().unwrap_or(Pose::from_translation(DVec3::ZERO))
}
