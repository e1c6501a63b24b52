//! Solids that are a little off: rounded edges, a draft, a dent.

use super::plan::{PerturbationPlan, Range};
use acm_concept::solid::Solid;
use acm_render::{Mesh, MeshError};
use glam::{DVec2, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::{
    collections::BTreeMap,
    f64::consts::{PI, TAU},
};

/// Lines of the grid over a surface are this near to each other, metres.
const GRID_M: f64 = 0.004;
/// Sides of a round solid, as many as the exact one has.
const SEGMENTS: u32 = 48;
/// A dent is felt by the surface that looks as its middle does, to this cosine.
const SAME_SIDE: f64 = 0.5;

/// How a solid differs from its exact shape. Metres; 0 for none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Deviation {
    bevel_m: f64,
    draft_m: f64,
    dent: Option<Dent>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Dent {
    /// Where, seen from the solid's centre.
    direction: DVec3,
    depth_m: f64,
    radius_m: f64,
}

impl Deviation {
    /// Draws each of the three with the plan's share, and one at least.
    pub fn draw(plan: &PerturbationPlan, rng: &mut ChaCha8Rng) -> Deviation {
        let mut chosen = [0; 3].map(|_: i32| rng.random_bool(plan.share));
        chosen[rng.random_range(0..3)] = true;
        let mut draw = |range: Range<f64>| rng.random_range(range[0]..=range[1]);
        let (bevel, draft, depth) = (draw(plan.bevel_m), draw(plan.draft_m), draw(plan.dent_m));
        let (radius_m, turn, up) = (draw(plan.dent_radius_m), draw([0.0, TAU]), draw([0.0, 1.0]));
        let direction = if up < 0.3 { DVec3::Z } else { DVec3::new(turn.cos(), turn.sin(), up - 0.5) };
        Deviation {
            bevel_m: if chosen[0] { bevel } else { 0.0 },
            draft_m: if chosen[1] { draft } else { 0.0 },
            dent: chosen[2].then_some(Dent { direction, depth_m: depth, radius_m }),
        }
    }
    /// Without a draft, which would part the solids of one thing.
    pub fn without_draft(self) -> Deviation {
        Deviation { draft_m: 0.0, ..self }
    }
    /// The surface of such a solid, in the solid's frame. No deviation is more than `most` of its thinnest extent.
    pub fn mesh(&self, solid: &Solid, most: f64) -> Result<Mesh, MeshError> {
        let limit = most * 2.0 * solid.half_extents().min_element();
        let own = Deviation {
            bevel_m: self.bevel_m.min(limit),
            draft_m: self.draft_m.min(limit),
            dent: self.dent.map(|dent| Dent { depth_m: dent.depth_m.min(limit), ..dent }),
        };
        let (points, triangles) = match *solid {
            Solid::Box { size } => boxed(size, own.bevel_m),
            Solid::Cylinder { radius, height } => round(radius, height, own.bevel_m),
            Solid::Revolved { profile } => swept(profile.corners()),
            Solid::Ellipsoid { size } => {
                let half_circle = |step: u32| DVec2::from_angle(PI * (f64::from(step) / f64::from(SEGMENTS / 2) - 0.5));
                let ball: Vec<DVec2> = (0..=SEGMENTS / 2).map(|step| 0.5 * half_circle(step)).collect();
                let (points, triangles) = swept(&ball);
                (points.into_iter().map(|point| point * size).collect(), triangles)
            }
        };
        let moved: Vec<glam::Vec3> = points.iter().map(|point| own.moved(solid, *point).as_vec3()).collect();
        Mesh::from_triangles("perturbed solid", &moved, &triangles)
    }

    /// Where a point of the exact surface goes.
    fn moved(&self, solid: &Solid, point: DVec3) -> DVec3 {
        let mut moved = self.rounded(solid, point);
        if let Some(dent) = &self.dent {
            let leaves = solid.intersect_ray(DVec3::ZERO, dent.direction).map_or(0.0, |(_, leaves)| leaves);
            let middle = dent.direction * leaves;
            let out = outward(solid, middle);
            if outward(solid, point).dot(out) > SAME_SIDE {
                let away = (point - middle).length() / (0.5 * dent.radius_m);
                moved -= out * (dent.depth_m * (-0.5 * away * away).exp());
            }
        }
        let half = solid.half_extents();
        // Wider below by half the draft, narrower above.
        let grow = DVec3::new(1.0 / half.x, 1.0 / half.y, 0.0) * (-0.25 * self.draft_m * point.z / half.z);
        moved * (DVec3::ONE + grow)
    }

    /// Edges rounded: what is within the bevel of an edge lies on a ball about a shrunken solid.
    fn rounded(&self, solid: &Solid, point: DVec3) -> DVec3 {
        let inner = match *solid {
            Solid::Box { size } => {
                let half = size * 0.5 - DVec3::splat(self.bevel_m);
                point.clamp(-half, half)
            }
            Solid::Cylinder { radius, height } => {
                let (across, tall) = (radius - self.bevel_m, 0.5 * height - self.bevel_m);
                let plan = point.truncate();
                (plan * (across / plan.length().max(1e-12)).min(1.0)).extend(point.z.clamp(-tall, tall))
            }
            // Round already, or as sharp as its profile says.
            Solid::Ellipsoid { .. } | Solid::Revolved { .. } => return point,
        };
        inner + (point - inner).normalize_or_zero() * self.bevel_m
    }
}

/// Direction out of a solid at a point of its surface.
fn outward(solid: &Solid, point: DVec3) -> DVec3 {
    let step = 1e-5;
    let along = |axis: DVec3| solid.signed_distance(point + axis * step) - solid.signed_distance(point - axis * step);
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).normalize_or_zero()
}

/// Grid lines from one end to the other, denser where the edges are rounded.
fn lines(from: f64, to: f64, bevel_m: f64) -> Vec<f64> {
    let count = (((to - from) / GRID_M).ceil() as usize).clamp(2, 60);
    let mut all: Vec<f64> = (0..=count).map(|at| from + (to - from) * at as f64 / count as f64).collect();
    if bevel_m > 0.0 {
        let near = [0.3, 0.7, 1.0].map(|share| share * bevel_m);
        all.extend(near.iter().flat_map(|step| [from + step, to - step]).filter(|at| *at > from && *at < to));
    }
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    all
}

/// The surface of a box as a grid: points, and triangles that look outwards.
fn boxed(size: DVec3, bevel_m: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let grid = size.to_array().map(|extent| lines(-0.5 * extent, 0.5 * extent, bevel_m));
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    let mut known: BTreeMap<[usize; 3], u32> = BTreeMap::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for end in [0, grid[axis].len() - 1] {
            let mut corner = |i: usize, j: usize| {
                let mut at = [0; 3];
                (at[axis], at[u], at[v]) = (end, i, j);
                *known.entry(at).or_insert_with(|| {
                    points.push(DVec3::new(grid[0][at[0]], grid[1][at[1]], grid[2][at[2]]));
                    points.len() as u32 - 1
                })
            };
            for i in 1..grid[u].len() {
                for j in 1..grid[v].len() {
                    let [a, b, c, d] = [corner(i - 1, j - 1), corner(i, j - 1), corner(i, j), corner(i - 1, j)];
                    let faces = if end == 0 { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] };
                    triangles.extend(faces);
                }
            }
        }
    }
    (points, triangles)
}

/// The surface of a cylinder as rings from the middle of the bottom to that of the top.
fn round(radius: f64, height: f64, bevel_m: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let half = 0.5 * height;
    let across: Vec<f64> = lines(-radius, radius, bevel_m).into_iter().filter(|r| *r > 1e-6).collect();
    let mut profile: Vec<(f64, f64)> = across.iter().map(|r| (*r, -half)).collect();
    profile.extend(lines(-half, half, bevel_m).into_iter().filter(|z| z.abs() < half - 1e-9).map(|z| (radius, z)));
    profile.extend(across.iter().rev().map(|r| (*r, half)));
    let mut points = vec![DVec3::Z * -half, DVec3::Z * half];
    for (r, z) in &profile {
        points.extend((0..SEGMENTS).map(|step| {
            let (sine, cosine) = (f64::from(step) / f64::from(SEGMENTS) * TAU).sin_cos();
            DVec3::new(r * cosine, r * sine, *z)
        }));
    }
    let at = |ring: usize, step: u32| 2 + ring as u32 * SEGMENTS + step % SEGMENTS;
    let mut triangles = Vec::new();
    for step in 0..SEGMENTS {
        triangles.push([0, at(0, step + 1), at(0, step)]);
        triangles.push([1, at(profile.len() - 1, step), at(profile.len() - 1, step + 1)]);
        for ring in 1..profile.len() {
            let [a, b] = [at(ring - 1, step), at(ring - 1, step + 1)];
            let [c, d] = [at(ring, step), at(ring, step + 1)];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    (points, triangles)
}

/// The surface that a closed profile (radius, height), counter-clockwise, sweeps about z. Corners on the axis are one point.
fn swept(profile: &[DVec2]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut points, mut rings) = (Vec::new(), Vec::new());
    for corner in profile {
        let steps = if corner.x > 1e-9 { SEGMENTS } else { 1 };
        rings.push((points.len() as u32, steps));
        points.extend((0..steps).map(|step| {
            let turn = DVec2::from_angle(f64::from(step) / f64::from(SEGMENTS) * TAU);
            (turn * corner.x).extend(corner.y)
        }));
    }
    let at = |(first, steps): (u32, u32), step: u32| first + step % steps;
    let mut triangles = Vec::new();
    for (low, high) in rings.iter().zip(rings.iter().cycle().skip(1)) {
        for step in 0..SEGMENTS {
            let [a, b, c, d] = [at(*low, step), at(*low, step + 1), at(*high, step), at(*high, step + 1)];
            triangles.extend([[a, b, d], [a, d, c]].into_iter().filter(|[p, q, r]| p != q && q != r && r != p));
        }
    }
    (points, triangles)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn a_perturbed_solid_is_closed_and_off_by_no_more_than_it_says() {
        let dent = Dent { direction: DVec3::new(1.0, 0.2, 0.1), depth_m: 0.006, radius_m: 0.02 };
        let deviation = Deviation { bevel_m: 0.004, draft_m: 0.008, dent: Some(dent) };
        let solids = [Solid::Box { size: DVec3::new(0.12, 0.08, 0.05) }, Solid::Cylinder { radius: 0.04, height: 0.1 }];
        let corners = [(0.0, 0.0), (0.04, 0.0), (0.05, 0.1), (0.046, 0.1), (0.036, 0.004), (0.0, 0.004)];
        let corners = corners.map(|(radius, height)| DVec2::new(radius, height));
        for solid in [Solid::Ellipsoid { size: DVec3::new(0.1, 0.08, 0.05) }, Solid::revolved(&corners).unwrap().0] {
            let mesh = Deviation::default().mesh(&solid, 0.25).unwrap();
            assert!(mesh.is_closed(), "{solid:?}");
            let far = |point: &glam::Vec3| solid.signed_distance(point.as_dvec3()).abs();
            assert!(mesh.positions().iter().all(|point| far(point) < 1e-6), "{solid:?}");
        }
        for solid in solids {
            let mesh = deviation.mesh(&solid, 0.25).unwrap();
            assert!(mesh.is_closed(), "{solid:?}");
            let distances: Vec<f64> =
                mesh.positions().iter().map(|point| solid.signed_distance(point.as_dvec3())).collect();
            let (least, most) = distances.iter().fold((0.0f64, 0.0f64), |(a, b), d| (a.min(*d), b.max(*d)));
            // A dent of 6 mm and a draft of 2 mm inwards on one side; 2 mm outwards below.
            assert!((-0.0085..-0.005).contains(&least) && (0.001..0.0025).contains(&most), "{solid:?}: {least} {most}");
        }
        let exact = Deviation { bevel_m: 0.0, draft_m: 0.0, dent: None }.mesh(&solids[0], 0.25).unwrap();
        let (low, high) = exact.bounds();
        assert!((high - low).as_dvec3().distance(DVec3::new(0.12, 0.08, 0.05)) < 1e-6);
    }
}
