//! What is measured of a segment before a template is known: rectangles and circles seen from above.

use crate::scene::convex_hull;
use glam::DVec2;

/// The upright rectangle round points seen from above, at a given heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rectangle {
    pub centre: DVec2,
    /// Heading of the longer side, radians.
    pub yaw: f64,
    /// Longer side, metres.
    pub length: f64,
    /// Shorter side, metres.
    pub width: f64,
}

/// The smallest rectangle at heading `yaw` that holds all but `trim` of the points at each side.
pub(crate) fn rectangle_at(points: &[DVec2], yaw: f64, trim: f64) -> Rectangle {
    let (axis, normal) = (DVec2::from_angle(yaw), DVec2::from_angle(yaw).perp());
    let range = |direction: DVec2| {
        let mut along: Vec<f64> = points.iter().map(|p| p.dot(direction)).collect();
        along.sort_by(f64::total_cmp);
        let cut = (along.len() as f64 * trim) as usize;
        let last = along.len().saturating_sub(1 + cut);
        (along.get(cut).copied().unwrap_or(0.0), along.get(last).copied().unwrap_or(0.0))
    };
    let ((x0, x1), (y0, y1)) = (range(axis), range(normal));
    let centre = axis * ((x0 + x1) * 0.5) + normal * ((y0 + y1) * 0.5);
    let (along, across) = ((x1 - x0).max(0.0), (y1 - y0).max(0.0));
    if along >= across {
        Rectangle { centre, yaw, length: along, width: across }
    } else {
        Rectangle { centre, yaw: yaw + std::f64::consts::FRAC_PI_2, length: across, width: along }
    }
}

/// The smallest of the rectangles over a sweep of headings, and all of them.
pub(crate) fn rectangles(points: &[DVec2], step_rad: f64, trim: f64) -> Vec<Rectangle> {
    let count = (std::f64::consts::FRAC_PI_2 / step_rad).round().max(1.0) as usize;
    (0..count).map(|i| rectangle_at(points, i as f64 * step_rad, trim)).collect()
}

/// The rectangle of least area.
pub(crate) fn smallest(rectangles: &[Rectangle]) -> Option<Rectangle> {
    rectangles.iter().copied().min_by(|a, b| (a.length * a.width).total_cmp(&(b.length * b.width)))
}

/// Centre and radius of the circle fitted to the outline of points seen from above: algebraic least squares over
/// the hull, sampled evenly.
pub(crate) fn circle(points: &[DVec2]) -> Option<(DVec2, f64)> {
    let hull = convex_hull(points.to_vec());
    if hull.len() < 5 {
        return None;
    }
    let outline = resample(&hull, 64);
    let mean = outline.iter().sum::<DVec2>() / outline.len() as f64;
    let (mut matrix, mut right) = (nalgebra::Matrix3::zeros(), nalgebra::Vector3::zeros());
    for point in &outline {
        let p = *point - mean;
        let row = nalgebra::Vector3::new(p.x, p.y, 1.0);
        matrix += row * row.transpose();
        right += row * p.length_squared();
    }
    let solution = matrix.lu().solve(&right)?;
    let centre = DVec2::new(solution[0] * 0.5, solution[1] * 0.5);
    let radius2 = solution[2] + centre.length_squared();
    (radius2 > 0.0).then(|| (centre + mean, radius2.sqrt()))
}

fn resample(polygon: &[DVec2], count: usize) -> Vec<DVec2> {
    let edges: Vec<(DVec2, DVec2)> =
        polygon.iter().enumerate().map(|(i, &a)| (a, polygon[(i + 1) % polygon.len()])).collect();
    let total: f64 = edges.iter().map(|(a, b)| a.distance(*b)).sum();
    let step = total / count as f64;
    let (mut samples, mut walked) = (Vec::with_capacity(count), 0.0);
    for (a, b) in edges {
        let length = a.distance(b);
        while samples.len() as f64 * step < walked + length && samples.len() < count {
            let share = (samples.len() as f64 * step - walked) / length.max(1e-12);
            samples.push(a.lerp(b, share));
        }
        walked += length;
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_turned_rectangle_is_found(yaw in 0.0..1.5f64, length in 0.05..0.3f64, share in 0.3..0.95f64) {
            let width = length * share;
            let points: Vec<DVec2> = (0..=20)
                .flat_map(|i| (0..=20).map(move |j| DVec2::new(i as f64 / 20.0 - 0.5, j as f64 / 20.0 - 0.5)))
                .map(|p| DVec2::from_angle(yaw).rotate(p * DVec2::new(length, width)) + DVec2::new(0.3, -0.1))
                .collect();
            let found = smallest(&rectangles(&points, 0.01, 0.0)).unwrap();
            prop_assert!((found.length - length).abs() < 0.02 * length && (found.width - width).abs() < 0.03 * length);
            prop_assert!(found.centre.distance(DVec2::new(0.3, -0.1)) < 1e-2 * length);
        }

        #[test]
        fn an_arc_gives_its_circle(radius in 0.01..0.2f64, start in 0.0..6.0f64) {
            let points: Vec<DVec2> =
                (0..40).map(|i| DVec2::from_angle(start + f64::from(i) * 0.16) * radius + DVec2::new(0.5, 0.2)).collect();
            let (centre, found) = circle(&points).unwrap();
            prop_assert!(centre.distance(DVec2::new(0.5, 0.2)) < 0.02 * radius && (found - radius).abs() < 0.02 * radius);
        }
    }
}
