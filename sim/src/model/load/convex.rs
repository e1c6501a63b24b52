//! A mesh as a few convex bodies, which is what the engine collides well.
//!
//! Pieces that hang together by their triangles are taken one by one. A piece that nearly fills its convex hull is
//! that hull; another one is cut by parry's V-HACD, whose parts are the hulls of the triangles they hold, so that no
//! voxel shows. All of it is deterministic.

use super::mesh::Triangles;
use crate::model::shape::Hull;
use glam::{DVec3, Vec3};
use rapier3d::parry::transformation::{
    vhacd::{VHACD, VHACDParameters},
    voxelization::FillMode,
};
use std::{collections::BTreeMap, sync::Arc};

/// A piece that fills more than this share of its hull is taken as convex.
const NEARLY_CONVEX: f64 = 0.9;
/// A piece that is smaller than this in every direction is taken as convex, metres.
const SMALL_M: f32 = 0.015;
/// Most hulls of one piece.
const MAX_PARTS: u32 = 24;
/// Most hulls of one mesh; more are put together.
const MAX_HULLS: usize = 96;
/// Most corners of a hull: the engine's cost grows with them.
const MAX_POINTS: usize = 48;

/// Convex bodies that together are about the mesh. Coordinates in metres.
pub(super) fn decompose(mesh: &Triangles) -> Vec<Arc<Hull>> {
    let mut hulls: Vec<Hull> = Vec::new();
    let parts = connected(mesh);
    let small_share = parts.len() > MAX_HULLS;
    for part in parts {
        hulls.extend(if small_share { hull(&part.positions).into_iter().collect() } else { split(&part) });
    }
    // The largest ones matter most.
    hulls.sort_by(|a, b| b.volume_m3.total_cmp(&a.volume_m3));
    hulls.truncate(MAX_HULLS);
    hulls.into_iter().map(Arc::new).collect()
}

fn split(part: &Triangles) -> Vec<Hull> {
    let (low, high) = bounds(&part.positions);
    let size = high - low;
    let whole = hull(&part.positions);
    let Some(whole) = whole else { return thicken(part, low, high).into_iter().collect() };
    let filled = volume(part) / whole.volume_m3;
    if filled > NEARLY_CONVEX || size.max_element() < SMALL_M {
        return vec![whole];
    }
    let parameters = VHACDParameters {
        // A voxel of about 5 mm.
        resolution: ((size.max_element() / 0.005) as u32).clamp(24, 64),
        concavity: 0.001,
        max_convex_hulls: MAX_PARTS,
        fill_mode: FillMode::FloodFill { detect_cavities: false },
        ..VHACDParameters::default()
    };
    let found = VHACD::decompose(&parameters, &part.positions, &part.corners, true);
    let cut = found.compute_exact_convex_hulls(&part.positions, &part.corners);
    let parts: Vec<Hull> = cut.iter().filter_map(|(points, _)| hull(points)).collect();
    if parts.is_empty() { vec![whole] } else { parts }
}

/// The hull with few corners.
fn hull(points: &[Vec3]) -> Option<Hull> {
    let full = Hull::new(points)?;
    if full.points.len() <= MAX_POINTS {
        return Some(full);
    }
    // The farthest points in directions that are spread evenly over a ball.
    let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
    let mut kept: Vec<Vec3> = Vec::new();
    for at in 0..MAX_POINTS {
        let up = 1.0 - 2.0 * (at as f32 + 0.5) / MAX_POINTS as f32;
        let (sine, cosine) = (golden * at as f32).sin_cos();
        let across = (1.0 - up * up).sqrt();
        let direction = Vec3::new(across * cosine, across * sine, up);
        let far = full.points.iter().copied().max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)));
        kept.extend(far.filter(|point| !kept.contains(point)));
    }
    let (low, high) = bounds(&full.points);
    for axis in 0..3 {
        for end in [low, high] {
            let near = full.points.iter().copied().find(|point| point[axis] == end[axis]);
            kept.extend(near.filter(|point| !kept.contains(point)));
        }
    }
    Hull::new(&kept).or(Some(full))
}

/// A sheet without thickness is made 1 mm thick.
fn thicken(part: &Triangles, low: Vec3, high: Vec3) -> Option<Hull> {
    let size = high - low;
    let axis = (0..3).min_by(|a, b| size[*a].total_cmp(&size[*b]))?;
    let mut up = Vec3::ZERO;
    up[axis] = 0.0005;
    let points: Vec<Vec3> = part.positions.iter().flat_map(|point| [*point - up, *point + up]).collect();
    hull(&points)
}

/// Volume inside of a surface that is closed; less for one that is not.
fn volume(mesh: &Triangles) -> f64 {
    let centre = mesh.positions.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / mesh.positions.len().max(1) as f64;
    let point = |corner: u32| mesh.positions[corner as usize].as_dvec3() - centre;
    let of = |corners: &[u32; 3]| point(corners[0]).dot(point(corners[1]).cross(point(corners[2]))) / 6.0;
    mesh.corners.iter().map(of).sum::<f64>().abs()
}

fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
}

/// The pieces of a mesh that share no corner. Corners at the same place are one.
fn connected(mesh: &Triangles) -> Vec<Triangles> {
    let mut places: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let mut points: Vec<Vec3> = Vec::new();
    let mut weld = |corner: u32| {
        let point = mesh.positions[corner as usize] + Vec3::ZERO;
        *places.entry(point.to_array().map(f32::to_bits)).or_insert_with(|| {
            points.push(point);
            points.len() as u32 - 1
        })
    };
    let faces: Vec<[u32; 3]> = mesh.corners.iter().map(|corners| corners.map(&mut weld)).collect();
    let mut group: Vec<u32> = (0..points.len() as u32).collect();
    for [a, b, c] in &faces {
        let root = find(&mut group, *a);
        for other in [*b, *c] {
            let other = find(&mut group, other);
            group[other as usize] = root.min(other);
            group[root as usize] = root.min(other);
        }
    }
    let mut parts: BTreeMap<u32, (BTreeMap<u32, u32>, Triangles)> = BTreeMap::new();
    for face in &faces {
        let root = find(&mut group, face[0]);
        let (known, part) = parts.entry(root).or_default();
        let corners = face.map(|corner| {
            *known.entry(corner).or_insert_with(|| {
                part.positions.push(points[corner as usize]);
                part.positions.len() as u32 - 1
            })
        });
        part.corners.push(corners);
    }
    parts.into_values().map(|(_, part)| part).collect()
}

fn find(group: &mut [u32], of: u32) -> u32 {
    let mut root = of;
    while group[root as usize] != root {
        // Halving the path keeps it short.
        group[root as usize] = group[group[root as usize] as usize];
        root = group[root as usize];
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    fn add_box(mesh: &mut Triangles, low: Vec3, high: Vec3) {
        let first = mesh.positions.len() as u32;
        for at in 0..8 {
            let pick = |axis: usize| if at >> axis & 1 == 1 { high[axis] } else { low[axis] };
            mesh.positions.push(Vec3::new(pick(0), pick(1), pick(2)));
        }
        for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            mesh.corners.extend([[a, b, c], [a, c, d]].map(|face: [u32; 3]| face.map(|corner| corner + first)));
        }
    }

    #[test]
    fn separate_boxes_stay_boxes() {
        let mut mesh = Triangles::default();
        add_box(&mut mesh, Vec3::ZERO, Vec3::new(0.4, 0.3, 0.02));
        add_box(&mut mesh, Vec3::new(0.0, 0.0, 0.05), Vec3::new(0.02, 0.3, 0.07));
        let hulls = decompose(&mesh);
        assert_eq!(hulls.len(), 2);
        assert!((hulls[0].volume_m3 - 0.0024).abs() < 1e-6 && hulls[0].points.len() == 8);
    }

    /// An open box of one piece: five slabs that share their edges.
    #[test]
    fn a_hollow_stays_hollow() {
        let mut mesh = Triangles::default();
        let (outer, inner) = (Vec3::new(0.2, 0.2, 0.2), Vec3::new(0.18, 0.18, 0.2));
        add_box(&mut mesh, -outer, outer);
        // The top is opened and the inside put in, its faces turned round, and a rim joins the two.
        mesh.corners.retain(|face| !face.iter().all(|corner| mesh.positions[*corner as usize].z > 0.0));
        let first = mesh.positions.len();
        let mut inside = Triangles::default();
        add_box(&mut inside, Vec3::new(-inner.x, -inner.y, -0.18), inner);
        inside.corners.retain(|face| !face.iter().all(|corner| inside.positions[*corner as usize].z > 0.0));
        mesh.positions.extend(inside.positions);
        mesh.corners.extend(inside.corners.iter().map(|[a, b, c]| [*a, *c, *b].map(|corner| corner + first as u32)));
        for [a, b] in [[4, 5], [5, 7], [7, 6], [6, 4]] {
            let (c, d) = (a + first as u32, b + first as u32);
            mesh.corners.extend([[a, b, d], [a, d, c]]);
        }
        let hulls = decompose(&mesh);
        assert!(hulls.len() > 1, "{hulls:?}");
        let total: f64 = hulls.iter().map(|hull| hull.volume_m3).sum();
        assert!(total < 0.5 * 0.064, "the hollow is filled: {total} m3 of 0.064");
        let again = decompose(&mesh);
        assert!(hulls.iter().zip(&again).all(|(a, b)| a.points == b.points), "equal meshes give equal hulls");
    }
}
