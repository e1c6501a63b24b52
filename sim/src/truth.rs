//! The world as it truly is: for analysing failures, for drawing, and for executors that are tested without
//! perception. Never for the agent.

use crate::{
    articulation::Articulation,
    body::Body,
    model::{Piece, joint::JointKind, shape::Shape},
    world::World,
};
use acm_concept::{pose::Pose, solid::Solid};
use glam::{DVec3, Vec3};
use rapier3d::prelude::PhysicsWorld;
use serde::Serialize;

/// An object as it truly is. For analysing failures and for drawing; never for the agent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueObject {
    /// Name in the scenario, with `_0`, `_1`, ... for copies.
    pub name: String,
    /// Its model.
    pub model: String,
    /// Pose of its base frame (the middle of its bottom) in the world.
    pub pose: Pose,
    /// Extents along the axes of its base frame, metres, all joints at zero.
    pub size_m: DVec3,
    /// Colour of its first solid, 8-bit sRGB.
    pub color: [u8; 3],
    /// Whether both pads touch it.
    pub held: bool,
    /// Its parts: the base first, parents before their children.
    pub links: Vec<TrueLink>,
}

/// A rigid part of an object as it truly is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueLink {
    /// Its name; the base is called `base`.
    pub name: String,
    /// Index of the link that it hangs on; the base is its own parent.
    pub parent: usize,
    /// Pose of its frame in the world. It lies on the object's base frame when all joints are at zero.
    pub pose: Pose,
    /// Kilograms.
    pub mass_kg: f64,
    /// How it hangs on its parent; `None` for the base and for what is fixed.
    pub joint: Option<TrueJoint>,
    /// What of it can be touched.
    pub pieces: Vec<TruePiece>,
}

/// A joint as it truly is. Positions are radians for a hinge and metres for a slider.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueJoint {
    /// Whether it turns; else it slides.
    pub is_hinge: bool,
    /// A point of its axis now, in the world, metres.
    pub origin: DVec3,
    /// Direction of its axis now, in the world, of length 1: positive positions turn by the right hand about it, or
    /// slide along it.
    pub axis: DVec3,
    /// Smallest and largest position; `None` without end.
    pub range: Option<[f64; 2]>,
    /// Position that counts as closed.
    pub closed: f64,
    /// Where it is.
    pub position: f64,
    /// How fast it moves, per second.
    pub speed: f64,
    /// How far it is open, 0 to 1.
    pub opened: f64,
    /// Dry friction, newton metres or newtons.
    pub friction: f64,
    /// Presses counted, where presses are counted.
    pub presses: Option<u32>,
}

/// A convex piece of a link.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TruePiece {
    /// Its shape.
    pub shape: TrueShape,
    /// Pose of the shape's frame in the link's frame.
    pub pose: Pose,
    /// Smallest corner of the box round it, along the axes of the link's frame, metres.
    pub low: DVec3,
    /// Largest corner.
    pub high: DVec3,
}

/// The shape of a [`TruePiece`], about its own origin. Metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "shape")]
pub enum TrueShape {
    /// A box or a cylinder about z.
    Solid {
        /// It.
        solid: Solid,
    },
    /// Two half balls about z and what lies between them.
    Capsule {
        /// Radius.
        radius: f64,
        /// Distance of the balls' centres; 0 for a ball.
        height: f64,
    },
    /// The convex hull of some points.
    Hull {
        /// The points. Many, so they are left out of what is written down.
        #[serde(skip)]
        points: Vec<Vec3>,
    },
}

pub(crate) fn true_objects(world: &World) -> Vec<TrueObject> {
    let object = |body: &Body| TrueObject {
        name: body.placed.name.clone(),
        model: body.placed.model.model.clone(),
        pose: body.pose(&world.physics),
        size_m: body.placed.size(),
        color: body.placed.color().unwrap_or_default(),
        held: world.contacts.pads_touching(&body.colliders) == 2,
        links: links(body, &world.physics),
    };
    world.bodies.iter().map(object).collect()
}

fn links(body: &Body, physics: &PhysicsWorld) -> Vec<TrueLink> {
    let joint = |at: usize| body.joints.iter().find(|(link, _)| *link == at).map(|(_, joint)| joint);
    let link = |(at, link): (usize, &crate::model::Link)| TrueLink {
        name: link.name.clone(),
        parent: link.parent,
        pose: body.link_pose(physics, at),
        mass_kg: link.mass_kg(),
        joint: joint(at).map(|joint| true_joint(joint, physics)),
        pieces: link.pieces.iter().filter_map(piece).collect(),
    };
    body.placed.links.iter().enumerate().map(link).collect()
}

fn true_joint(made: &Articulation, physics: &PhysicsWorld) -> TrueJoint {
    let joint = &made.joint;
    let (origin, axis) = made.line(physics);
    TrueJoint {
        is_hinge: joint.kind == JointKind::Hinge,
        origin,
        axis,
        range: joint.range,
        closed: joint.closed,
        position: made.position,
        speed: made.speed,
        opened: joint.opened(made.position),
        friction: joint.friction,
        presses: joint.press.map(|_| made.presses),
    }
}

fn piece(piece: &Piece) -> Option<TruePiece> {
    let shape = match &piece.shape {
        _ if !piece.solid => return None,
        Shape::Solid(solid) => TrueShape::Solid { solid: *solid },
        Shape::Capsule { radius, height } => TrueShape::Capsule { radius: *radius, height: *height },
        Shape::Ball { radius } => TrueShape::Capsule { radius: *radius, height: 0.0 },
        Shape::Hull(hull) => TrueShape::Hull { points: hull.points.clone() },
        Shape::Surface { .. } => return None,
    };
    let (low, high) = piece.bounds(&Pose::IDENTITY);
    Some(TruePiece { shape, pose: piece.pose, low, high })
}
