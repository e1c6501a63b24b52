//! Solids as triangles, for whoever knows nothing else.

use crate::solid::{PlacedSolid, Solid};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Sides of the prism that stands for a cylinder. With 32 its corners lie on the circle and its sides at most half a
/// per cent of the radius inside it.
const SIDES: u32 = 32;

/// A triangle mesh. Solids that touch or overlap stay closed surfaces of their own: they are not united.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Corners, metres.
    pub vertices: Vec<DVec3>,
    /// Indices of corners, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The surfaces of solids, in their parent frame.
    ///
    /// ```
    /// # use acm_concept::{mesh::Mesh, pose::Pose, solid::{PlacedSolid, Solid}};
    /// # use glam::DVec3;
    /// let cube = Solid::Box { size: DVec3::splat(0.04) };
    /// let mesh = Mesh::of(&[PlacedSolid { solid: cube, pose: Pose::from_translation(DVec3::Z) }]);
    /// assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 12));
    /// assert!((mesh.volume() - cube.volume()).abs() < 1e-12);
    /// ```
    pub fn of(solids: &[PlacedSolid]) -> Mesh {
        let mut mesh = Mesh::default();
        for placed in solids {
            let (vertices, triangles) = match placed.solid {
                Solid::Box { size } => cuboid(size),
                Solid::Cylinder { radius, height } => cylinder(radius, height),
            };
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(vertices.into_iter().map(|vertex| placed.pose.transform_point(vertex)));
            mesh.triangles.extend(triangles.into_iter().map(|corners| corners.map(|corner| first + corner)));
        }
        mesh
    }
    /// The volume inside, cubic metres; what two solids share counts twice.
    pub fn volume(&self) -> f64 {
        let corner = |index: u32| self.vertices.get(index as usize).copied().unwrap_or_default();
        let signed = |[a, b, c]: &[u32; 3]| corner(*a).dot(corner(*b).cross(corner(*c))) / 6.0;
        self.triangles.iter().map(signed).sum()
    }
}

type Surface = (Vec<DVec3>, Vec<[u32; 3]>);

fn cuboid(size: DVec3) -> Surface {
    let sign = |bit: u32| if bit == 0 { -0.5 } else { 0.5 };
    let vertices = (0..8u32).map(|i| size * DVec3::new(sign(i & 1), sign(i & 2), sign(i & 4))).collect();
    let faces: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    (vertices, faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// Two rims, then the middles of bottom and top.
fn cylinder(radius: f64, height: f64) -> Surface {
    let at = |i: u32| DVec2::from_angle(std::f64::consts::TAU * f64::from(i) / f64::from(SIDES)) * radius;
    let rim = |z: f64| (0..SIDES).map(move |i| at(i).extend(z));
    let half = 0.5 * height;
    let vertices = rim(-half).chain(rim(half)).chain([DVec3::Z * -half, DVec3::Z * half]).collect();
    let (bottom, top) = (2 * SIDES, 2 * SIDES + 1);
    let side = |i: u32| {
        let next = (i + 1) % SIDES;
        [[i, next, SIDES + next], [i, SIDES + next, SIDES + i], [bottom, next, i], [top, SIDES + i, SIDES + next]]
    };
    (vertices, (0..SIDES).flat_map(side).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Pose;

    #[test]
    fn a_cylinder_is_closed_and_a_little_smaller() {
        let solid = Solid::Cylinder { radius: 0.03, height: 0.1 };
        let mesh = Mesh::of(&[PlacedSolid { solid, pose: Pose::from_yaw(DVec3::new(1.0, 2.0, 3.0), 0.4) }]);
        let share = mesh.volume() / solid.volume();
        assert!((0.99..1.0).contains(&share), "{share}");
        let mut edges: Vec<(u32, u32)> =
            mesh.triangles.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]).collect();
        edges.sort_unstable();
        // Each edge is walked once in each direction.
        assert!(edges.windows(2).all(|pair| pair[0] != pair[1]));
        assert!(edges.iter().all(|(a, b)| edges.binary_search(&(*b, *a)).is_ok()));
    }
}
