//! Triangle meshes.

use glam::Vec3;
use std::{collections::BTreeMap, f32::consts::TAU};
use thiserror::Error;

/// Most vertices of a mesh that is given as triangles.
pub const MAX_VERTICES: usize = 1_000_000;
/// Most triangles of a mesh.
pub const MAX_MESH_TRIANGLES: usize = 1_000_000;
/// Neighbouring faces that meet at a smaller angle than this are shaded as one smooth surface, radians.
const CREASE_ANGLE: f32 = 0.6;
/// Most faces at a corner that take part in its normals.
const MAX_SMOOTHED: usize = 64;
const CYLINDER_SEGMENTS: u32 = 48;

/// A triangle mesh in its own frame. Fixed once built, so that an upload stays valid; share it in an `Arc`.
///
/// Corners run counter-clockwise seen from outside.
///
/// ```
/// # use acm_render::Mesh;
/// assert_eq!(Mesh::unit_box().triangle_count(), 12);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    name: String,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    indices: Vec<u32>,
    closed: bool,
}

/// Why triangles do not make a mesh.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum MeshError {
    /// More than [`MAX_VERTICES`] or [`MAX_MESH_TRIANGLES`].
    #[error("mesh `{name}` has {count} {what}, the limit is {limit}; simplify it first")]
    TooLarge {
        /// The mesh.
        name: String,
        /// Vertices or triangles.
        what: &'static str,
        /// How many it has.
        count: usize,
        /// How many it may have.
        limit: usize,
    },
    /// A coordinate is infinite or not a number.
    #[error("vertex {vertex} of mesh `{name}` is not finite")]
    NotFinite {
        /// The mesh.
        name: String,
        /// Index of the vertex.
        vertex: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} of mesh `{name}` uses vertex {index}, but there are only {count}")]
    IndexOutOfRange {
        /// The mesh.
        name: String,
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it names.
        index: u32,
        /// Number of vertices.
        count: usize,
    },
    /// No triangle, or none with an area.
    #[error("mesh `{name}` has no triangle with an area")]
    Empty {
        /// The mesh.
        name: String,
    },
}

impl Mesh {
    /// A cube of edge 1, centred on the origin.
    pub fn unit_box() -> Mesh {
        let mut mesh = Mesh::named("unit box");
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            let (u, v) = (Vec3::new(axis.z, axis.x, axis.y), Vec3::new(axis.y, axis.z, axis.x));
            for side in [-1.0, 1.0] {
                let first = mesh.positions.len() as u32;
                for (a, b) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
                    // Swapping the two tangents mirrors the face, which the other side of the box needs.
                    let (a, b) = if side > 0.0 { (a, b) } else { (b, a) };
                    mesh.push(side * 0.5 * axis + a * u + b * v, side * axis);
                }
                mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
            }
        }
        mesh
    }

    /// A cylinder of radius 1 and height 1 about z, centred on the origin, with flat caps. Its side has 48 facets
    /// whose edges lie on the radius.
    pub fn unit_cylinder() -> Mesh {
        let mut mesh = Mesh::named("unit cylinder");
        let rim = |step: u32| {
            let (sine, cosine) = (step as f32 / CYLINDER_SEGMENTS as f32 * TAU).sin_cos();
            Vec3::new(cosine, sine, 0.0)
        };
        for step in 0..=CYLINDER_SEGMENTS {
            let radial = rim(step % CYLINDER_SEGMENTS);
            mesh.push(radial - 0.5 * Vec3::Z, radial);
            mesh.push(radial + 0.5 * Vec3::Z, radial);
        }
        for step in 0..CYLINDER_SEGMENTS {
            mesh.indices.extend([0, 2, 3, 0, 3, 1].map(|corner| 2 * step + corner));
        }
        for side in [-1.0, 1.0] {
            let first = mesh.positions.len() as u32;
            for step in 0..CYLINDER_SEGMENTS {
                mesh.push(rim(step) + side * 0.5 * Vec3::Z, side * Vec3::Z);
            }
            for step in 1..CYLINDER_SEGMENTS - 1 {
                let (a, b) = if side > 0.0 { (step, step + 1) } else { (step + 1, step) };
                mesh.indices.extend([first, first + a, first + b]);
            }
        }
        mesh
    }

    /// A mesh from corner positions (metres, or any unit that the instance's scale puts right) and index triples.
    ///
    /// Normals are made from the faces; edges sharper than about 34 degrees stay sharp. Triangles without an area
    /// are dropped. If the surface is closed and its triangles run counter-clockwise seen from outside, faces that
    /// look away are not drawn; otherwise both sides of every triangle are.
    ///
    /// # Errors
    /// Too many vertices or triangles, coordinates that are not finite, indices out of range, nothing left to draw.
    pub fn from_triangles(
        name: impl Into<String>,
        positions: &[Vec3],
        triangles: &[[u32; 3]],
    ) -> Result<Mesh, MeshError> {
        let mut mesh = Mesh::named(name);
        mesh.check(positions, triangles)?;
        let faces = faces_with_area(positions, triangles);
        if faces.is_empty() {
            return Err(MeshError::Empty { name: mesh.name });
        }
        mesh.closed = is_closed_outward(positions, &faces);
        mesh.add_smoothed(positions, &faces);
        Ok(mesh)
    }

    /// What it is called in error messages.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Corner positions.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }
    /// Unit normals, one a position.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }
    /// Triples of indices into the positions, counter-clockwise seen from outside.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }
    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.indices.len() / 3
    }
    /// Whether the surface encloses a volume with its normals outwards, so that its back is never seen.
    pub fn is_closed(&self) -> bool {
        self.closed
    }
    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        self.positions.iter().fold(start, |(low, high), p| (low.min(*p), high.max(*p)))
    }

    fn named(name: impl Into<String>) -> Mesh {
        Mesh { name: name.into(), positions: Vec::new(), normals: Vec::new(), indices: Vec::new(), closed: true }
    }

    fn push(&mut self, position: Vec3, normal: Vec3) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.positions.len() as u32 - 1
    }

    fn check(&self, positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<(), MeshError> {
        let name = || self.name.clone();
        let sizes = [("vertices", positions.len(), MAX_VERTICES), ("triangles", triangles.len(), MAX_MESH_TRIANGLES)];
        for (what, count, limit) in sizes {
            if count > limit {
                return Err(MeshError::TooLarge { name: name(), what, count, limit });
            }
        }
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite { name: name(), vertex });
        }
        let count = positions.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&index| index as usize >= count) {
                return Err(MeshError::IndexOutOfRange { name: name(), triangle, index, count });
            }
        }
        Ok(())
    }

    /// Adds faces with one vertex for every smooth patch that meets in a corner.
    fn add_smoothed(&mut self, positions: &[Vec3], faces: &[Face]) {
        let mut faces_at = vec![Vec::new(); positions.len()];
        for (index, face) in faces.iter().enumerate() {
            for corner in face.corners {
                faces_at[corner as usize].push(index);
            }
        }
        let mut made = vec![Vec::<(Vec3, u32)>::new(); positions.len()];
        let smooth = CREASE_ANGLE.cos();
        for face in faces {
            for corner in face.corners.map(|corner| corner as usize) {
                // The limit keeps a hub of a million spokes from taking a million squared steps.
                let meeting = faces_at[corner].iter().take(MAX_SMOOTHED).map(|&other| &faces[other]);
                let patch = meeting.filter(|other| other.normal.dot(face.normal) > smooth);
                let normal = patch.map(|other| other.normal * other.area).sum::<Vec3>().normalize_or(face.normal);
                let known = made[corner].iter().find(|(n, _)| n.dot(normal) > 0.9999).map(|(_, index)| *index);
                let index = known.unwrap_or_else(|| {
                    let index = self.push(positions[corner], normal);
                    made[corner].push((normal, index));
                    index
                });
                self.indices.push(index);
            }
        }
    }
}

struct Face {
    corners: [u32; 3],
    normal: Vec3,
    area: f32,
}

fn faces_with_area(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Face> {
    let face = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| positions[corner as usize].as_dvec3());
        // Double precision: the product of two short edges underflows a float.
        let cross = (b - a).cross(c - a);
        let normal = cross.try_normalize()?;
        Some(Face { corners: *corners, normal: normal.as_vec3(), area: (0.5 * cross.length()) as f32 })
    };
    triangles.iter().filter_map(face).collect()
}

/// Whether every edge is shared by exactly two faces that run through it in opposite directions, and the volume
/// they enclose is positive. Corners at the same place count as one.
fn is_closed_outward(positions: &[Vec3], faces: &[Face]) -> bool {
    let mut welded = BTreeMap::new();
    let mut place = |corner: u32| {
        // Adding zero makes -0 and 0 the same place.
        let key = (positions[corner as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
        let next = welded.len() as u32;
        *welded.entry(key).or_insert(next)
    };
    let mut edges = BTreeMap::<(u32, u32), u32>::new();
    let mut volume = 0.0;
    for face in faces {
        let [a, b, c] = face.corners.map(&mut place);
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_default() += 1;
        }
        let [a, b, c] = face.corners.map(|corner| positions[corner as usize].as_dvec3());
        volume += a.dot(b.cross(c));
    }
    volume > 0.0 && edges.iter().all(|(&(a, b), &count)| count == 1 && edges.get(&(b, a)) == Some(&1))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    /// Every triangle of a convex mesh about the origin must face away from it, with matching normals.
    fn assert_faces_outwards(mesh: &Mesh) {
        for triangle in mesh.indices().chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| mesh.positions()[triangle[k] as usize]);
            let normal = (b - a).cross(c - a);
            assert!(normal.dot(a + b + c) > 0.0, "{} {triangle:?} faces inwards", mesh.name());
            for corner in triangle {
                let vertex_normal = mesh.normals()[*corner as usize];
                assert!(vertex_normal.is_normalized() && vertex_normal.dot(normal) > 0.0);
            }
        }
    }

    fn corners_and_triangles(mesh: &Mesh) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        (mesh.positions().to_vec(), mesh.indices().chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect())
    }

    #[test]
    fn unit_shapes_face_outwards_and_fill_their_bounds() {
        for (mesh, half) in [(Mesh::unit_box(), Vec3::splat(0.5)), (Mesh::unit_cylinder(), Vec3::new(1.0, 1.0, 0.5))] {
            assert_faces_outwards(&mesh);
            let (low, high) = mesh.bounds();
            assert!((low + half).length() < 1e-6 && (high - half).length() < 1e-6, "{low} {high}");
            let (positions, triangles) = corners_and_triangles(&mesh);
            assert!(is_closed_outward(&positions, &faces_with_area(&positions, &triangles)), "{}", mesh.name());
        }
    }

    #[test]
    fn a_rebuilt_cylinder_is_smooth_round_its_side_and_sharp_at_its_rim() {
        let (positions, triangles) = corners_and_triangles(&Mesh::unit_cylinder());
        let corners: Vec<Vec3> = positions;
        let rebuilt = Mesh::from_triangles("cylinder", &corners, &triangles).unwrap();
        assert!(rebuilt.is_closed());
        assert_faces_outwards(&rebuilt);
        for (position, normal) in rebuilt.positions().iter().zip(rebuilt.normals()) {
            let radial = Vec3::new(position.x, position.y, 0.0).normalize();
            let cap = normal.z.abs() > 0.999;
            assert!(cap || normal.dot(radial) > 0.99, "{position} {normal}");
        }
    }

    #[test]
    fn an_open_or_inverted_surface_is_not_closed() {
        let (positions, mut triangles) = corners_and_triangles(&Mesh::unit_box());
        let inverted: Vec<[u32; 3]> = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        assert!(!Mesh::from_triangles("inverted", &positions, &inverted).unwrap().is_closed());
        triangles.pop();
        assert!(!Mesh::from_triangles("open", &positions, &triangles).unwrap().is_closed());
    }

    #[test]
    fn bad_triangles_are_refused() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let error =
            |corners: &[Vec3], triangles: &[[u32; 3]]| Mesh::from_triangles("m", corners, triangles).unwrap_err();
        assert!(matches!(error(&corners, &[[0, 1, 3]]), MeshError::IndexOutOfRange { index: 3, triangle: 0, .. }));
        assert!(matches!(error(&corners, &[[0, 1, 1]]), MeshError::Empty { .. }));
        assert!(matches!(error(&corners, &[]), MeshError::Empty { .. }));
        assert!(matches!(error(&[Vec3::ZERO, Vec3::NAN], &[]), MeshError::NotFinite { vertex: 1, .. }));
        let many = vec![[0, 1, 2]; MAX_MESH_TRIANGLES + 1];
        assert!(matches!(error(&corners, &many), MeshError::TooLarge { what: "triangles", .. }));
    }
}
