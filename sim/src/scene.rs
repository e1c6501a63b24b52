//! The world as a scene for the renderer.

use crate::{
    convert::from_engine,
    model::{Piece, shape::Shape},
    world::World,
};
use acm_concept::{
    pose::Pose,
    solid::{Enclosure, Solid},
};
use acm_render::{Instance, Material, Mesh, MeshError, Scene};
use glam::{DVec3, Vec3};
use std::sync::Arc;

const BACKGROUND: [u8; 3] = [200, 200, 205];
const HAND_COLOR: [u8; 3] = [235, 235, 235];
const FINGER_COLOR: [u8; 3] = [60, 60, 66];

/// Meshes of a world's scene.
#[derive(Debug)]
pub(crate) struct Stage {
    cuboid: Arc<Mesh>,
    cylinder: Arc<Mesh>,
    ball: Arc<Mesh>,
    /// A bevelled box has its own mesh, because scaling would distort the bevel: object, link, piece, mesh.
    bevelled: Vec<([usize; 3], Arc<Mesh>)>,
}

impl Stage {
    pub(crate) fn new(world: &World) -> Result<Stage, MeshError> {
        let mut bevelled = Vec::new();
        for (object, body) in world.bodies.iter().enumerate() {
            for (link, piece, at) in pieces(body.placed.links.iter().map(|link| &link.pieces)) {
                if let (Shape::Solid(Solid::Box { size }), true) = (&at.shape, at.bevel_m > 0.0) {
                    bevelled.push(([object, link, piece], Arc::new(bevelled_box(*size, at.bevel_m)?)));
                }
            }
        }
        let (cuboid, cylinder) = (Arc::new(Mesh::unit_box()), Arc::new(Mesh::unit_cylinder()));
        Ok(Stage { cuboid, cylinder, ball: Arc::new(unit_ball()?), bevelled })
    }

    /// The scene as the world stands now.
    pub(crate) fn scene(&self, world: &World) -> Scene {
        let mut scene = Scene { instances: Vec::new(), lights: world.lighting.clone(), background: BACKGROUND };
        let ids = Ids::of(world);
        for (index, (_, surface)) in world.surfaces.iter().enumerate() {
            let solid = Solid::Box { size: surface.size };
            let pose = Pose::from_translation(surface.position);
            let pattern = world.textures.get(index).copied().flatten();
            let material = Material { color: surface.color.0, pattern };
            scene.instances.push(self.instance(&solid, pose, material, ids.surface(index)));
        }
        for (index, body) in world.bodies.iter().enumerate() {
            let poses: Vec<Pose> =
                (0..body.placed.links.len()).map(|link| body.link_pose(&world.physics, link)).collect();
            for (link, place, piece) in pieces(body.placed.links.iter().map(|link| &link.pieces)) {
                if piece.shown {
                    let color = body.color(piece, &world.state);
                    // What a lamp shows is not painted over.
                    let pattern = body.placed.texture.filter(|_| piece.lamp.is_none());
                    let material = Material { color, pattern };
                    self.add_piece(&mut scene, [index, link, place], piece, poses[link], material, ids.object(index));
                }
            }
        }
        self.add_robot(world, &mut scene, ids.hand());
        scene
    }

    fn add_robot(&self, world: &World, scene: &mut Scene, id: u32) {
        for (part, is_finger) in world.robot.seen(&world.physics) {
            let color = if is_finger { FINGER_COLOR } else { HAND_COLOR };
            scene.instances.push(self.instance(&part.solid, part.pose, Material::plain(color), id));
        }
    }

    fn add_piece(&self, scene: &mut Scene, at: [usize; 3], piece: &Piece, link: Pose, material: Material, id: u32) {
        let pose = link * piece.pose;
        let mut add = |mesh: &Arc<Mesh>, pose: Pose, scale: DVec3| {
            scene.instances.push(Instance { mesh: mesh.clone(), pose, scale, material, id });
        };
        match &piece.shape {
            Shape::Solid(solid) => match self.bevelled.iter().find(|(known, _)| *known == at) {
                Some((_, mesh)) => add(mesh, pose, DVec3::ONE),
                None => scene.instances.push(self.instance(solid, pose, material, id)),
            },
            Shape::Capsule { radius, height } => {
                add(&self.cylinder, pose, DVec3::new(*radius, *radius, *height));
                for end in [-0.5, 0.5] {
                    add(&self.ball, pose * Pose::from_translation(DVec3::Z * (end * height)), DVec3::splat(*radius));
                }
            }
            Shape::Ball { radius } => add(&self.ball, pose, DVec3::splat(*radius)),
            Shape::Surface { mesh, scale } => add(mesh, pose, *scale),
            // What is felt alone has no surface to draw.
            Shape::Hull(_) => {}
        }
    }

    fn instance(&self, solid: &Solid, pose: Pose, material: Material, id: u32) -> Instance {
        let (mesh, scale) = match solid.enclosure() {
            Enclosure::Box { size } => (&self.cuboid, size),
            Enclosure::Cylinder { radius, height } => (&self.cylinder, DVec3::new(radius, radius, height)),
        };
        Instance { mesh: mesh.clone(), pose, scale, material, id }
    }
}

/// All pieces of some links: link, place within it, piece.
fn pieces<'a>(links: impl Iterator<Item = &'a Vec<Piece>>) -> impl Iterator<Item = (usize, usize, &'a Piece)> {
    links.enumerate().flat_map(|(link, pieces)| pieces.iter().enumerate().map(move |(at, piece)| (link, at, piece)))
}

/// Numbers of what can be seen: surfaces first, then objects, then the hand.
pub(crate) struct Ids {
    surfaces: u32,
    objects: u32,
}

impl Ids {
    pub(crate) fn of(world: &World) -> Ids {
        Ids { surfaces: world.surfaces.len() as u32, objects: world.bodies.len() as u32 }
    }
    fn surface(&self, index: usize) -> u32 {
        1 + index as u32
    }
    fn object(&self, index: usize) -> u32 {
        1 + self.surfaces + index as u32
    }
    fn hand(&self) -> u32 {
        1 + self.surfaces + self.objects
    }
    pub(crate) fn legend(&self, world: &World) -> Vec<(u32, String)> {
        let surfaces = world.surfaces.iter().enumerate().map(|(i, (_, s))| (self.surface(i), s.name.clone()));
        let objects = world.bodies.iter().enumerate().map(|(i, b)| (self.object(i), b.placed.name.clone()));
        surfaces.chain(objects).chain([(self.hand(), "hand".to_string())]).collect()
    }
}

/// A box whose edges are cut at 45 degrees, `bevel` metres wide along each face. Metres.
fn bevelled_box(size: DVec3, bevel: f64) -> Result<Mesh, MeshError> {
    let half = (size * 0.5).as_vec3();
    let inner = half - Vec3::splat(bevel as f32);
    // Each corner of the box becomes three: one on each face that meets there.
    let sign = |corner: usize, axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
    let vertex = |corner: usize, face: usize| (3 * corner + face) as u32;
    let mut positions = Vec::new();
    for corner in 0..8 {
        for face in 0..3 {
            let reach = |axis: usize| sign(corner, axis) * if axis == face { half[axis] } else { inner[axis] };
            positions.push(Vec3::new(reach(0), reach(1), reach(2)));
        }
    }
    let mut triangles = Vec::new();
    let mut quad = |corners: [u32; 4]| add_outward(&positions, &mut triangles, &corners);
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in 0..2 {
            let at = |a: usize, b: usize| side << axis | a << u | b << v;
            quad([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| vertex(at(a, b), axis)));
            // The edge along `axis` at one corner of the other two axes, once for each of its four places.
            for other in 0..2 {
                let [from, to] = [0, 1].map(|end| end << axis | side << u | other << v);
                quad([vertex(from, u), vertex(to, u), vertex(to, v), vertex(from, v)]);
            }
        }
    }
    for corner in 0..8 {
        add_outward(&positions, &mut triangles, &[0, 1, 2].map(|face| vertex(corner, face)));
    }
    Mesh::from_triangles("bevelled box", &positions, &triangles)
}

const BALL_RINGS: u32 = 16;
const BALL_SEGMENTS: u32 = 32;

/// A ball of radius 1 about the origin.
pub(crate) fn unit_ball() -> Result<Mesh, MeshError> {
    let point = |ring: u32, step: u32| {
        let (across, up) = (ring as f32 / BALL_RINGS as f32 * std::f32::consts::PI).sin_cos();
        let (sine, cosine) = (step as f32 / BALL_SEGMENTS as f32 * std::f32::consts::TAU).sin_cos();
        Vec3::new(across * cosine, across * sine, up)
    };
    let mut positions = vec![Vec3::Z, Vec3::NEG_Z];
    positions.extend((1..BALL_RINGS).flat_map(|ring| (0..BALL_SEGMENTS).map(move |step| point(ring, step))));
    let at = |ring: u32, step: u32| match ring {
        0 => 0,
        BALL_RINGS => 1,
        ring => 2 + (ring - 1) * BALL_SEGMENTS + step % BALL_SEGMENTS,
    };
    let mut triangles = Vec::new();
    for ring in 0..BALL_RINGS {
        for step in 0..BALL_SEGMENTS {
            let [a, b] = [at(ring, step), at(ring, step + 1)];
            let [c, d] = [at(ring + 1, step), at(ring + 1, step + 1)];
            let faces = [[a, c, d], [a, d, b]];
            triangles.extend(faces.into_iter().filter(|[a, b, c]| a != b && b != c && a != c));
        }
    }
    Mesh::from_triangles("unit ball", &positions, &triangles)
}

/// Adds a flat convex polygon as triangles that look away from the origin.
fn add_outward(positions: &[Vec3], triangles: &mut Vec<[u32; 3]>, corners: &[u32]) {
    let point = |index: u32| positions[index as usize];
    for step in 1..corners.len() - 1 {
        let [a, b, c] = [corners[0], corners[step], corners[step + 1]];
        let normal = (point(b) - point(a)).cross(point(c) - point(a));
        triangles.push(if normal.dot(point(a)) > 0.0 { [a, b, c] } else { [a, c, b] });
    }
}

/// Poses of every body, for comparing worlds bit by bit.
pub(crate) fn state_hash(world: &World) -> u64 {
    let bytes = world.physics.bodies.iter().flat_map(|(_, body)| {
        let pose = from_engine(body.position());
        let numbers = pose.translation.to_array().into_iter().chain(pose.rotation.to_array());
        numbers.flat_map(|number| number.to_bits().to_le_bytes()).collect::<Vec<u8>>()
    });
    fnv(bytes)
}

/// FNV-1a, 64 bits.
pub(crate) fn fnv(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    #[test]
    fn a_bevelled_box_is_closed_and_keeps_its_size() {
        let mesh = bevelled_box(DVec3::new(0.04, 0.05, 0.03), 0.002).unwrap();
        let (low, high) = mesh.bounds();
        assert!((high - low - Vec3::new(0.04, 0.05, 0.03)).length() < 1e-6);
        assert!(mesh.is_closed());
        assert_eq!(mesh.triangle_count(), 6 * 2 + 12 * 2 + 8);
    }

    #[test]
    fn a_ball_is_closed_and_round() {
        let mesh = unit_ball().unwrap();
        assert!(mesh.is_closed());
        assert!(mesh.positions().iter().zip(mesh.normals()).all(|(p, n)| p.length() > 0.99 && p.dot(*n) > 0.98));
    }
}
