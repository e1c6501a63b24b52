//! The support plane: seeded RANSAC over a sparse sample, the largest connected inlier patch, robust refinement.

use crate::{config::GrounderConfig, grid::Grid, scan::Scan};
use acm_concept::{object::SupportPlane, pose::Pose};
use glam::DVec3;
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Sampling stride over the image, pixels.
const STRIDE: usize = 4;
/// Most planes that are scored.
const MAX_SCORED: usize = 320;
/// Most of the best that are refined.
const MAX_REFINED: usize = 12;
/// Planes whose normals and offsets differ by less are refined to the same one, radians and metres.
const TWIN: (f64, f64) = (0.01, 0.004);
/// Most triples that are drawn.
const MAX_DRAWN: usize = 6000;

/// A plane in the camera frame: points `p` with `normal . p = offset`, normal towards the camera (offset < 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plane {
    pub normal: DVec3,
    pub offset: f64,
    /// Root mean square distance of the inliers, metres.
    pub residual_m: f64,
    /// Root mean square of the inliers' depth error over the sensor model's sigma: 1 where the model fits.
    pub noise_ratio: f64,
}

impl Plane {
    /// A remembered one, seen by a camera.
    pub fn of(support: &SupportPlane, camera: &Pose) -> Plane {
        let normal = camera.rotation.inverse() * support.normal;
        let offset = support.offset_m - support.normal.dot(camera.translation);
        Plane { normal, offset, residual_m: support.residual_m, noise_ratio: 1.0 }
    }
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

/// Which planes may be the support: the unit vector that points up in the camera frame and the largest angle of
/// the normal to it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Upright {
    pub up: DVec3,
    pub max_angle_rad: f64,
}

/// The plane with the largest connected patch of inliers. `known` is where it was before: if it still holds most of what is
/// measured, no other one can hold more, and none is looked for.
pub(crate) fn find(
    scan: &Scan,
    excluded: &[bool],
    upright: Upright,
    known: Option<Plane>,
    config: &GrounderConfig,
) -> Option<Plane> {
    let coarse = Coarse::sample(scan, excluded, config);
    let measured = coarse.points.len();
    if measured < 200 {
        return None;
    }
    if let Some(known) = known.filter(|plane| plane.normal.dot(upright.up) > upright.max_angle_rad.cos()) {
        let refined = refine(&coarse, known, upright);
        if 2 * coarse.largest_patch(&refined).len() > measured {
            return Some(finish(&coarse, refined, upright));
        }
    }
    let mut candidates = draw(&coarse, upright, config);
    candidates.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    let (mut best, mut best_size) = (None, 0);
    candidates.truncate(MAX_REFINED);
    drop_twins(&mut candidates);
    let refine = |(_, plane): (usize, Plane)| {
        let refined = refine(&coarse, plane, upright);
        (coarse.largest_patch(&refined).len(), refined)
    };
    let refined: Vec<(usize, Plane)> = candidates.into_par_iter().map(refine).collect();
    for (size, refined) in refined {
        if size > best_size {
            (best, best_size) = (Some(refined), size);
        }
    }
    let plane = best.filter(|_| best_size as f64 >= config.min_support_fraction * measured as f64)?;
    Some(finish(&coarse, plane, upright))
}

/// A sparse sample of the frame.
struct Coarse {
    grid: Grid,
    points: Vec<DVec3>,
    sigma: Vec<f64>,
    /// For each cell of the coarse grid its point, `u32::MAX` for none.
    cells: Vec<u32>,
}

impl Coarse {
    fn sample(scan: &Scan, excluded: &[bool], config: &GrounderConfig) -> Coarse {
        let grid = Grid { width: scan.grid.width / STRIDE, height: scan.grid.height / STRIDE };
        let (mut points, mut sigma, mut cells) = (Vec::new(), Vec::new(), vec![u32::MAX; grid.len()]);
        for (cell, slot) in cells.iter_mut().enumerate() {
            let pixel = scan.grid.index(grid.column(cell) * STRIDE + 1, grid.row(cell) * STRIDE + 1);
            let depth = f64::from(scan.smooth[pixel]);
            if depth > 0.0 && !excluded[pixel] {
                *slot = points.len() as u32;
                points.push(scan.ray(pixel) * depth);
                sigma.push(config.depth_sigma_m(depth));
            }
        }
        Coarse { grid, points, sigma, cells }
    }
    fn is_inlier(&self, plane: &Plane, index: usize) -> bool {
        plane.distance(self.points[index]).abs() < 0.003 + 2.0 * self.sigma[index]
    }
    /// Indices of the largest connected set of inliers.
    fn largest_patch(&self, plane: &Plane) -> Vec<usize> {
        let inlier = |&cell: &u32| cell != u32::MAX && self.is_inlier(plane, cell as usize);
        // Grown by one cell, so that lines of holes do not cut a table into pieces.
        let mask: Vec<bool> = self.cells.iter().map(inlier).collect();
        let (labels, _) = self.grid.blobs(&self.grid.dilate(&mask, 1));
        let count = labels.iter().filter(|l| **l != u32::MAX).max().map_or(0, |l| *l as usize + 1);
        let mut sizes = vec![0usize; count];
        for cell in (0..mask.len()).filter(|&c| mask[c]) {
            sizes[labels[cell] as usize] += 1;
        }
        let Some(largest) = (0..count).max_by_key(|&l| (sizes[l], std::cmp::Reverse(l))) else { return Vec::new() };
        let inside = |&cell: &usize| mask[cell] && labels[cell] as usize == largest;
        (0..mask.len()).filter(inside).map(|cell| self.cells[cell] as usize).collect()
    }
}

fn draw(coarse: &Coarse, upright: Upright, config: &GrounderConfig) -> Vec<(usize, Plane)> {
    let mut random = ChaCha8Rng::seed_from_u64(config.seed);
    let count = coarse.points.len();
    let thinning = (count / 3000).max(1);
    let cosine = upright.max_angle_rad.cos();
    let mut planes = Vec::new();
    for _ in 0..MAX_DRAWN {
        if planes.len() >= MAX_SCORED {
            break;
        }
        let [a, b, c] = [(); 3].map(|()| coarse.points[random.random_range(0..count)]);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let normal = if normal.dot(a) > 0.0 { -normal } else { normal };
        let spread = (b - a).length().min((c - a).length()).min((c - b).length());
        if normal.dot(upright.up) < cosine || spread < 0.03 {
            continue;
        }
        planes.push(Plane { normal, offset: normal.dot(a), residual_m: 0.0, noise_ratio: 1.0 });
    }
    let score = |plane: &Plane| (0..count).step_by(thinning).filter(|&i| coarse.is_inlier(plane, i)).count();
    planes.into_par_iter().with_min_len(16).map(|plane| (score(&plane), plane)).collect()
}

/// Leaves of planes that are nearly the same the first.
fn drop_twins(candidates: &mut Vec<(usize, Plane)>) {
    let twins = |a: &Plane, b: &Plane| a.normal.distance(b.normal) < TWIN.0 && (a.offset - b.offset).abs() < TWIN.1;
    let mut kept: Vec<(usize, Plane)> = Vec::new();
    for candidate in candidates.drain(..) {
        if !kept.iter().any(|other| twins(&other.1, &candidate.1)) {
            kept.push(candidate);
        }
    }
    *candidates = kept;
}

/// A few rounds of weighted least squares over the inliers.
fn refine(coarse: &Coarse, mut plane: Plane, upright: Upright) -> Plane {
    for _ in 0..3 {
        let inliers: Vec<usize> =
            (0..coarse.points.len()).step_by(2).filter(|&i| coarse.is_inlier(&plane, i)).collect();
        plane = least_squares(coarse, &inliers, &plane, upright).unwrap_or(plane);
    }
    plane
}

/// The last refinement: only the largest patch, with bisquare weights; measures the residual.
fn finish(coarse: &Coarse, mut plane: Plane, upright: Upright) -> Plane {
    let mut inliers = Vec::new();
    for _ in 0..4 {
        inliers = coarse.largest_patch(&plane);
        plane = least_squares(coarse, &inliers, &plane, upright).unwrap_or(plane);
    }
    let (mut squares, mut ratios) = (0.0, 0.0);
    for &i in &inliers {
        let distance = plane.distance(coarse.points[i]);
        let ray = coarse.points[i] / coarse.points[i].z;
        let along = distance / plane.normal.dot(ray).abs().max(0.1);
        squares += distance * distance;
        ratios += (along / coarse.sigma[i]).powi(2);
    }
    let count = inliers.len().max(1) as f64;
    Plane { residual_m: (squares / count).sqrt(), noise_ratio: (ratios / count).sqrt(), ..plane }
}

fn least_squares(coarse: &Coarse, inliers: &[usize], old: &Plane, upright: Upright) -> Option<Plane> {
    if inliers.len() < 50 {
        return None;
    }
    let (mut total, mut centre) = (0.0, DVec3::ZERO);
    let weight = |i: usize| {
        let reduced = old.distance(coarse.points[i]) / (0.004 + 3.0 * coarse.sigma[i]);
        (1.0 - reduced * reduced).max(0.0).powi(2) / (coarse.sigma[i] * coarse.sigma[i])
    };
    for &i in inliers {
        total += weight(i);
        centre += coarse.points[i] * weight(i);
    }
    if total <= 0.0 {
        return None;
    }
    centre /= total;
    let mut scatter = Matrix3::zeros();
    for &i in inliers {
        let d = coarse.points[i] - centre;
        let v = Vector3::new(d.x, d.y, d.z);
        scatter += v * v.transpose() * (weight(i) / total);
    }
    let eigen = scatter.symmetric_eigen();
    let smallest = eigen.eigenvalues.imin();
    let column = eigen.eigenvectors.column(smallest);
    let normal = DVec3::new(column[0], column[1], column[2]).try_normalize()?;
    let normal = if normal.dot(centre) > 0.0 { -normal } else { normal };
    let tilted = normal.dot(upright.up) < upright.max_angle_rad.cos();
    (!tilted).then(|| Plane { normal, offset: normal.dot(centre), ..*old })
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::{
        camera::{FrameHeader, Intrinsics, RgbdFrame},
        ids::FrameId,
        pose::Pose,
        time::Time,
    };
    use proptest::prelude::{ProptestConfig, prop_assert, proptest};

    /// A frame that shows a plane, a nearer wall in its left third, and noise.
    fn frame(normal: DVec3, offset: f64, noise_m: f64) -> RgbdFrame {
        let intrinsics = Intrinsics::from_vertical_fov(160, 120, 0.9);
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let depth: Vec<f32> = (0..intrinsics.pixels())
            .map(|i| {
                let ray = intrinsics.ray((i % 160) as f64, (i / 160) as f64);
                let depth = if i % 160 < 50 { 0.6 } else { offset / normal.dot(ray) };
                (depth + noise_m * random.random_range(-1.0..1.0)) as f32
            })
            .collect();
        let header = FrameHeader {
            id: FrameId(0),
            camera: "test".into(),
            time: Time::ZERO,
            intrinsics,
            camera_pose: Pose::IDENTITY,
        };
        RgbdFrame::new(header, vec![90; 3 * intrinsics.pixels()].into(), depth.into()).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn a_noisy_plane_is_found_beside_a_wall(pitch in 0.7..1.2f64, roll in -0.05..0.05f64, height in 0.5..1.2f64) {
            let normal = DVec3::new(roll, -pitch.cos(), -pitch.sin()).normalize();
            let config = GrounderConfig::default();
            let scan = Scan::read(&frame(normal, -height, 0.004), &config).ok().unwrap();
            let upright = Upright { up: DVec3::new(0.0, -pitch.cos(), -pitch.sin()), max_angle_rad: 0.15 };
            let plane = find(&scan, &vec![false; scan.grid.len()], upright, None, &config).unwrap();
            prop_assert!(plane.normal.angle_between(normal) < 0.006, "{:?}", plane);
            prop_assert!((plane.offset + height).abs() < 0.003, "{:?}", plane);
        }
    }

    #[test]
    fn where_a_known_plane_still_holds_most_it_is_refined_and_where_it_does_not_another_is_found() {
        let config = GrounderConfig::default();
        let normal = DVec3::new(0.0, -(0.9f64.cos()), -(0.9f64.sin()));
        let scan = Scan::read(&frame(normal, -0.8, 0.004), &config).ok().unwrap();
        let upright = Upright { up: normal, max_angle_rad: 0.15 };
        let find = |known| find(&scan, &vec![false; scan.grid.len()], upright, known, &config).unwrap();
        let drawn = find(None);
        for offset in [-0.805, -0.7] {
            let known = find(Some(Plane { normal, offset, residual_m: 0.0, noise_ratio: 1.0 }));
            let off = known.normal.angle_between(drawn.normal);
            assert!(off < 1e-3 && (known.offset - drawn.offset).abs() < 5e-4, "{known:?} {drawn:?}");
        }
    }

    #[test]
    fn a_wall_is_no_support() {
        let config = GrounderConfig::default();
        let scan = Scan::read(&frame(DVec3::NEG_Z, -0.9, 0.002), &config).ok().unwrap();
        let upright = Upright { up: DVec3::NEG_Y, max_angle_rad: 0.2 };
        assert_eq!(find(&scan, &vec![false; scan.grid.len()], upright, None, &config), None);
    }
}
