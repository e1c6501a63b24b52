//! Objects in the engine: a body for each part that moves, and what can be known of them.

use crate::{
    articulation::{Articulation, ArticulationState, let_pass},
    contact::Contacts,
    convert::{from_engine, to_engine, vector},
    model::{
        Link, Piece, Weight,
        joint::{Follows, Joint, JointKind},
        variables::OF_OBJECT,
    },
    oracle::Watch,
    placed::Placed,
};
use acm_concept::pose::{Pose, wrap_angle};
use glam::DVec3;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

/// What drifts more slowly for half a second is at rest, in tenths of a metre per second. At the engine's own value, a
/// quarter of this, what the solver leaves of a tower's jitter keeps it awake now and then, and it walks by millimetres.
const RESTS_BELOW: f32 = 0.2;

/// An object in the engine. Its frame is the object's base frame.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    pub(crate) placed: Placed,
    /// Of its base.
    pub(crate) handle: RigidBodyHandle,
    /// Of the body with which each link moves, in the order of the links.
    carriers: Vec<RigidBodyHandle>,
    /// Of all links.
    pub(crate) colliders: Vec<ColliderHandle>,
    /// Links and their joints, in the order of the links.
    pub(crate) joints: Vec<(usize, Articulation)>,
    /// Names of lamps and gauges, and what they show.
    shows: Vec<(String, Watch)>,
    /// Whether it is one of several copies, which the judge cannot name.
    pub(crate) is_copy: bool,
    /// Where it stood when the episode began.
    pub(crate) start: Pose,
}

impl Body {
    pub(crate) fn insert(world: &mut PhysicsWorld, placed: Placed, is_copy: bool) -> Body {
        let builder = if placed.fixed { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic() };
        let handle = world.insert_body(builder.pose(to_engine(&placed.pose)));
        if let Some(body) = world.bodies.get_mut(handle) {
            body.activation_mut().normalized_linear_threshold = RESTS_BELOW;
        }
        let mut body = Body {
            handle,
            carriers: Vec::new(),
            colliders: Vec::new(),
            joints: Vec::new(),
            shows: Vec::new(),
            is_copy,
            start: placed.pose,
            placed,
        };
        let starts = body.placed.start_poses();
        for (at, start) in starts.iter().enumerate() {
            body.insert_link(world, at, start);
        }
        for (first, second) in &body.placed.passing {
            let_pass(world, body.carriers[*first], body.carriers[*second]);
        }
        body
    }

    fn insert_link(&mut self, world: &mut PhysicsWorld, at: usize, start: &Pose) {
        let link = &self.placed.links[at];
        let parent = self.carriers.get(link.parent).copied().unwrap_or(self.handle);
        let carrier = match &link.joint {
            None => parent,
            Some(joint) => {
                let pose = to_engine(&(self.placed.pose * *start));
                let builder = RigidBodyBuilder::dynamic().pose(pose).can_sleep(!Articulation::is_alive(joint));
                let more = inertia(link, joint, Articulation::armature(joint, world));
                world.insert_body(builder.additional_mass_properties(more))
            }
        };
        self.colliders.extend(insert_pieces(world, link, carrier));
        if let Some(joint) = &link.joint {
            self.joints.push((at, Articulation::insert(world, parent, carrier, joint, middle(link))));
        }
        self.carriers.push(carrier);
    }

    /// Gives its lamps and gauges what they show.
    pub(crate) fn set_shows(&mut self, shows: Vec<(String, Watch)>) {
        self.shows = shows;
    }

    /// Pose of its base frame.
    pub(crate) fn pose(&self, world: &PhysicsWorld) -> Pose {
        world.bodies.get(self.handle).map_or(self.placed.pose, |body| from_engine(body.position()))
    }
    /// Pose of a link's frame.
    pub(crate) fn link_pose(&self, world: &PhysicsWorld, link: usize) -> Pose {
        let body = self.carriers.get(link).and_then(|handle| world.bodies.get(*handle));
        body.map_or_else(|| self.pose(world), |body| from_engine(body.position()))
    }
    /// Speed in metres per second and spin in radians per second.
    pub(crate) fn speed(&self, world: &PhysicsWorld) -> (f64, f64) {
        let Some(body) = world.bodies.get(self.handle) else { return (0.0, 0.0) };
        (f64::from(body.linvel().length()), f64::from(body.angvel().length()))
    }
    /// Handles of the bodies that move with it: its base and its links.
    pub(crate) fn handles(&self) -> impl Iterator<Item = RigidBodyHandle> {
        let links = self.placed.links.iter().zip(&self.carriers).filter(|(link, _)| link.joint.is_some());
        std::iter::once(self.handle).chain(links.map(|(_, handle)| *handle))
    }

    /// The body with which a link moves.
    #[cfg(test)]
    pub(crate) fn carrier(&self, link: usize) -> RigidBodyHandle {
        self.carriers[link]
    }

    /// The joint of a link.
    pub(crate) fn joint(&self, link: usize) -> Option<&Articulation> {
        self.joints.iter().find(|(at, _)| *at == link).map(|(_, joint)| joint)
    }
    /// The joint of a link.
    pub(crate) fn joint_mut(&mut self, link: usize) -> Option<&mut Articulation> {
        self.joints.iter_mut().find(|(at, _)| *at == link).map(|(_, joint)| joint)
    }

    /// Lets its mechanisms act before a physics step. `state` holds the judge's variables.
    pub(crate) fn act(&self, world: &mut PhysicsWorld, state: &[f64]) {
        let position = |link: usize| self.joints.iter().find(|(at, _)| *at == link).map_or(0.0, |(_, j)| j.position);
        for (link, joint) in &self.joints {
            let target = match joint.joint.follows {
                Some(Follows::Expression(_)) => self.shown(&self.placed.links[*link].name, state),
                _ => joint.follows(position),
            };
            joint.act(world, target);
        }
    }

    /// Reads where its joints are after a physics step.
    pub(crate) fn measure(&mut self, world: &PhysicsWorld) {
        for (_, joint) in &mut self.joints {
            joint.measure(world);
        }
    }

    /// What a lamp or a gauge shows now.
    fn shown(&self, name: &str, state: &[f64]) -> Option<f64> {
        let (_, watch) = self.shows.iter().find(|(known, _)| known == name)?;
        watch.value(state)
    }

    /// Colour of a piece now.
    pub(crate) fn color(&self, piece: &Piece, state: &[f64]) -> [u8; 3] {
        let Some(lamp) = &piece.lamp else { return piece.color };
        let value = self.shown(&lamp.name, state).unwrap_or(0.0);
        // A value below 1 is off; one beyond the colours shows the last.
        let place = (value.floor().max(0.0) as usize).min(lamp.colors.len());
        place.checked_sub(1).and_then(|place| lamp.colors.get(place)).copied().unwrap_or(piece.color)
    }

    /// Writes the values of its variables, in the order of [`crate::model::variables::own`].
    pub(crate) fn values(&self, world: &PhysicsWorld, contacts: &Contacts, values: &mut Vec<f64>) {
        let pose = self.pose(world);
        let (speed, spin) = self.speed(world);
        let up = pose.transform_vector(DVec3::Z);
        let of_object: [f64; OF_OBJECT.len()] = [
            pose.translation.x,
            pose.translation.y,
            pose.translation.z,
            speed,
            spin,
            up.z.clamp(-1.0, 1.0).acos(),
            wrap_angle(2.0 * pose.rotation.z.atan2(pose.rotation.w)),
            pose.translation.distance(self.start.translation),
            wrap_angle(pose.yaw() - self.start.yaw()).abs(),
            contacts.pads_touching(&self.colliders) as f64,
        ];
        values.extend(of_object);
        let number = |truth: bool| f64::from(u8::from(truth));
        if let Some((_, counter)) = self.joints.iter().find(|(_, joint)| joint.joint.press.is_some()) {
            values.extend([number(counter.pressed), f64::from(counter.presses), counter.depth()]);
        }
        for (_, joint) in &self.joints {
            values.extend([joint.position, joint.speed, joint.joint.opened(joint.position)]);
            if joint.joint.press.is_some() {
                values.extend([number(joint.pressed), f64::from(joint.presses)]);
            }
            if joint.joint.latch.is_some() {
                values.push(number(joint.is_latched()));
            }
        }
    }
}

/// What an object changes while the world runs, apart from its bodies.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct BodyState {
    start: Pose,
    joints: Vec<ArticulationState>,
}

impl Body {
    pub(crate) fn state(&self) -> BodyState {
        BodyState { start: self.start, joints: self.joints.iter().map(|(_, joint)| joint.state()).collect() }
    }
    pub(crate) fn set_state(&mut self, state: BodyState) {
        self.start = state.start;
        for ((_, joint), saved) in self.joints.iter_mut().zip(state.joints) {
            joint.set_state(saved);
        }
    }
}

/// The middle of a link's pieces, in its frame.
fn middle(link: &Link) -> DVec3 {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let bounds = link.pieces.iter().map(|piece| piece.bounds(&Pose::IDENTITY));
    let (low, high) = bounds.fold(start, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    if low.is_finite() { 0.5 * (low + high) } else { DVec3::ZERO }
}

/// What a link has besides the mass of what is felt of it: the joint's armature, and 10 g for one that is only seen, such
/// as a burner's glow.
fn inertia(link: &Link, joint: &Joint, armature: f64) -> MassProperties {
    let (ghost_kg, ghost_kg_m2) = if link.volume() > 0.0 { (0.0, 0.0) } else { (0.01, 1e-5) };
    let (mass, turn) = match joint.kind {
        JointKind::Hinge => (ghost_kg, ghost_kg_m2 + armature),
        JointKind::Slider => (ghost_kg + armature, ghost_kg_m2),
    };
    MassProperties::new(vector(middle(link)), mass as f32, Vector::splat(turn as f32))
}

fn insert_pieces(world: &mut PhysicsWorld, link: &Link, body: RigidBodyHandle) -> Vec<ColliderHandle> {
    let volume = link.volume();
    let insert = |piece: &Piece| {
        let (turn, shape) = piece.shape.collision(piece.bevel_m)?;
        let collider =
            ColliderBuilder::new(shape).position(to_engine(&(piece.pose * turn))).friction(link.friction as f32);
        let collider = match link.weight {
            Weight::Density(density) => collider.density(density as f32),
            Weight::Mass(mass) => collider.mass((mass * piece.shape.volume() / volume) as f32),
        };
        Some(world.insert_collider(collider, Some(body)))
    };
    link.pieces.iter().filter(|piece| piece.solid).filter_map(insert).collect()
}
