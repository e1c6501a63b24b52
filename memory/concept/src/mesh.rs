//! Solids as triangles, for whoever knows nothing else.

use crate::solid::{PlacedSolid, Solid};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Sides of the prism that stands for a cylinder, and of all that is round. With 32 its corners lie on the circle and its
/// sides at most half a per cent of the radius inside it.
const SIDES: u32 = 32;
/// A corner of a profile that is nearer to the axis lies on it.
const ON_AXIS_M: f64 = 1e-9;

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
                Solid::Ellipsoid { size } => ellipsoid(size),
                Solid::Revolved { profile } => revolved(profile.corners()),
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

/// What a closed profile of (radius, height), counter-clockwise, sweeps about z: a ring a corner, a point where the corner
/// lies on the axis.
fn revolved(profile: &[DVec2]) -> Surface {
    let (mut vertices, mut rings): (Vec<DVec3>, Vec<(u32, u32)>) = (Vec::new(), Vec::new());
    for corner in profile {
        let sides = if corner.x > ON_AXIS_M { SIDES } else { 1 };
        rings.push((vertices.len() as u32, sides));
        let at = |i: u32| DVec2::from_angle(std::f64::consts::TAU * f64::from(i) / f64::from(SIDES)) * corner.x;
        vertices.extend((0..sides).map(|i| at(i).extend(corner.y)));
    }
    let corner = |(first, sides): (u32, u32), i: u32| first + i % sides;
    let band = |(&low, &high): (&(u32, u32), &(u32, u32))| {
        let quad = move |i: u32| [corner(low, i), corner(low, i + 1), corner(high, i + 1), corner(high, i)];
        let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
        (0..SIDES).map(quad).flat_map(halves).filter(|[a, b, c]| a != b && b != c && c != a).collect::<Vec<_>>()
    };
    let triangles = rings.iter().zip(rings.iter().cycle().skip(1)).flat_map(band).collect();
    (vertices, triangles)
}

fn cylinder(radius: f64, height: f64) -> Surface {
    let half = 0.5 * height;
    revolved(&[(0.0, -half), (radius, -half), (radius, half), (0.0, half)].map(DVec2::from))
}

fn ellipsoid(size: DVec3) -> Surface {
    let angle = |i: u32| std::f64::consts::PI * (f64::from(i) / f64::from(SIDES / 2) - 0.5);
    let half_circle: Vec<DVec2> = (0..=SIDES / 2).map(|i| 0.5 * DVec2::from_angle(angle(i))).collect();
    let (vertices, triangles) = revolved(&half_circle);
    (vertices.into_iter().map(|vertex| vertex * size).collect(), triangles)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // A failed step is a failed test.
    use super::*;
    use crate::pose::Pose;

    #[test]
    fn what_is_round_is_closed_and_a_little_smaller() {
        let cup = [(0.0, -0.05), (0.03, -0.05), (0.04, 0.05), (0.037, 0.05), (0.027, -0.045), (0.0, -0.045)];
        let (cup, _) = Solid::revolved(&cup.map(DVec2::from)).unwrap();
        let ball = Solid::Ellipsoid { size: DVec3::new(0.03, 0.05, 0.08) };
        for solid in [Solid::Cylinder { radius: 0.03, height: 0.1 }, ball, cup] {
            let mesh = Mesh::of(&[PlacedSolid { solid, pose: Pose::from_yaw(DVec3::new(1.0, 2.0, 3.0), 0.4) }]);
            let share = mesh.volume() / solid.volume();
            assert!((0.97..1.0).contains(&share), "{solid:?}: {share}");
            let mut edges: Vec<(u32, u32)> =
                mesh.triangles.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]).collect();
            edges.sort_unstable();
            // Each edge is walked once in each direction.
            assert!(edges.windows(2).all(|pair| pair[0] != pair[1]));
            assert!(edges.iter().all(|(a, b)| edges.binary_search(&(*b, *a)).is_ok()));
        }
    }
}
