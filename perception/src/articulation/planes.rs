//! Flat faces of what moved.

use super::view::View;
use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const DRAWS: usize = 60;
/// A face has at least this share of the points, and so many.
const LEAST_SHARE: f64 = 0.15;
const LEAST_POINTS: usize = 60;
/// Most points that are looked at.
const MOST: usize = 1500;

/// A flat face: `normal . p = offset`, the normal towards the camera.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub normal: DVec3,
    pub offset: f64,
    pub points: Vec<DVec3>,
}

/// The largest flat faces of some pixels, the largest first.
pub(super) fn faces(view: &View, pixels: &[usize], most: usize) -> Vec<Face> {
    let step = pixels.len().div_ceil(MOST).max(1);
    let mut left: Vec<(DVec3, f64)> =
        pixels.iter().step_by(step).map(|pixel| (view.point(*pixel), f64::from(view.sigma[*pixel]))).collect();
    let least = ((LEAST_SHARE * left.len() as f64) as usize).max(LEAST_POINTS);
    // Seeded by a constant: the same frames give the same faces.
    let mut rng = ChaCha8Rng::seed_from_u64(0xfa_ce);
    let mut found = Vec::new();
    while found.len() < most && left.len() >= least {
        let Some(face) = largest(&left, view.camera.translation, &mut rng) else { break };
        if face.points.len() < least {
            break;
        }
        left.retain(|(point, sigma)| (face.normal.dot(*point) - face.offset).abs() > 3.0 * sigma + 0.003);
        found.push(face);
    }
    found
}

fn largest(points: &[(DVec3, f64)], eye: DVec3, rng: &mut ChaCha8Rng) -> Option<Face> {
    let mut best: (usize, Option<(DVec3, f64)>) = (0, None);
    for _ in 0..DRAWS {
        let [a, b, c] = [(); 3].map(|()| points[rng.random_range(0..points.len())].0);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let offset = normal.dot(a);
        let count = points.iter().filter(|(p, sigma)| (normal.dot(*p) - offset).abs() < 2.0 * sigma).count();
        if count > best.0 {
            best = (count, Some((normal, offset)));
        }
    }
    let (mut normal, mut offset) = best.1?;
    let mut inliers = Vec::new();
    for _ in 0..3 {
        inliers =
            points.iter().filter(|(p, sigma)| (normal.dot(*p) - offset).abs() < 2.5 * sigma).map(|(p, _)| *p).collect();
        (normal, offset) = fit(&inliers)?;
    }
    if (eye - normal * offset).dot(normal) < 0.0 {
        (normal, offset) = (-normal, -offset);
    }
    Some(Face { normal, offset, points: inliers })
}

/// The plane of least squares through some points.
fn fit(points: &[DVec3]) -> Option<(DVec3, f64)> {
    if points.len() < 3 {
        return None;
    }
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut scatter = nalgebra::Matrix3::<f64>::zeros();
    for point in points {
        let d = nalgebra::Vector3::from((*point - middle).to_array());
        scatter += d * d.transpose();
    }
    let eigen = scatter.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let column = eigen.eigenvectors.column(least);
    let normal = DVec3::new(column[0], column[1], column[2]).try_normalize()?;
    Some((normal, normal.dot(middle)))
}
