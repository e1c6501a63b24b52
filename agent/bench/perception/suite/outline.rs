//! Outlines of things in horizontal slices: how far things are apart, and what has room on what.

use acm_concept::pose::Pose;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// Height of a slice, metres.
const SLICE_M: f64 = 0.005;
/// Points of a surface are this near to each other, so that no slice lacks them, metres.
const STEP_M: f64 = 0.004;
/// What is this near to the highest point is the top, metres.
const TOP_M: f64 = 0.001;

/// A thing's convex outlines, slice by slice from its bottom, in its base frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outlines {
    slices: BTreeMap<i64, Vec<DVec2>>,
    top: Vec<DVec2>,
    low: DVec3,
    high: DVec3,
}

impl Outlines {
    /// Of the triangles of a surface, in the base frame.
    pub fn of(triangles: impl Iterator<Item = [DVec3; 3]>) -> Outlines {
        let mut points = Vec::new();
        triangles.for_each(|triangle| sample(triangle, &mut points));
        let (low, high) = points
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| (low.min(*point), high.max(*point)));
        let mut slices: BTreeMap<i64, Vec<DVec2>> = BTreeMap::new();
        for point in &points {
            slices.entry(slice(point.z)).or_default().push(point.truncate());
        }
        let top = points.iter().filter(|point| point.z > high.z - TOP_M).map(|point| point.truncate()).collect();
        let slices = slices.into_iter().map(|(at, points)| (at, hull(points))).collect();
        Outlines { slices, top: hull(top), low, high }
    }
    /// Smallest and largest coordinates in the base frame, metres.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        (self.low, self.high)
    }
    /// The outline of the whole, in the base frame.
    pub fn footprint(&self) -> Vec<DVec2> {
        hull(self.slices.values().flatten().copied().collect())
    }
    /// Radius of the circle about the base frame's axis that holds it, metres.
    pub fn radius(&self) -> f64 {
        self.slices.values().flatten().map(|point| point.length()).fold(0.0, f64::max)
    }
    /// Smallest horizontal distance between two upright things at the same height, metres: 0 where they overlap,
    /// infinite where one is wholly above the other.
    pub fn gap(&self, pose: &Pose, other: &Outlines, other_pose: &Pose) -> f64 {
        let shift = slice(pose.translation.z - other_pose.translation.z);
        let mut least = f64::INFINITY;
        for (at, own) in &self.slices {
            if let Some(theirs) = other.slices.get(&(at + shift)) {
                least = least.min(distance(&placed(own, pose), &placed(theirs, other_pose)));
            }
        }
        least
    }
    /// Whether it can carry another thing: its top is flat, and holds the inner half of the other's bottom.
    pub fn carries(&self, pose: &Pose, other: &Outlines, other_pose: &Pose) -> bool {
        let flat = area(&self.top) > 0.6 * area(&self.footprint());
        let bottom = other.slices.values().next().cloned().unwrap_or_default();
        let centre = bottom.iter().sum::<DVec2>() / bottom.len().max(1) as f64;
        let inner: Vec<DVec2> = bottom.iter().map(|point| centre.lerp(*point, 0.5)).collect();
        let top = placed(&self.top, pose);
        flat && placed(&inner, other_pose).iter().all(|point| holds(&top, *point))
    }
}

fn slice(z: f64) -> i64 {
    (z / SLICE_M).round() as i64
}

/// Points of a triangle, [`STEP_M`] apart.
fn sample([a, b, c]: [DVec3; 3], points: &mut Vec<DVec3>) {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let steps = ((longest / STEP_M).ceil() as usize).clamp(1, 200);
    for i in 0..=steps {
        for j in 0..=steps - i {
            let (u, v) = (i as f64 / steps as f64, j as f64 / steps as f64);
            points.push(a + (b - a) * u + (c - a) * v);
        }
    }
}

fn cross(o: DVec2, a: DVec2, b: DVec2) -> f64 {
    (a - o).perp_dot(b - o)
}

/// The convex hull, counter-clockwise (Andrew's monotone chain).
fn hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = &DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for point in points {
            while let [.., a, b] = chain.as_slice() {
                if cross(*a, *b, *point) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(*point);
        }
        chain.pop();
        chain
    };
    let mut outline = half(&mut points.iter());
    outline.extend(half(&mut points.iter().rev()));
    if outline.is_empty() { points } else { outline }
}

fn placed(outline: &[DVec2], pose: &Pose) -> Vec<DVec2> {
    outline.iter().map(|point| pose.transform_point(point.extend(0.0)).truncate()).collect()
}

fn sides(outline: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    outline.iter().copied().zip(outline.iter().copied().cycle().skip(1))
}

fn area(outline: &[DVec2]) -> f64 {
    0.5 * sides(outline).map(|(a, b)| a.perp_dot(b)).sum::<f64>()
}

fn holds(outline: &[DVec2], point: DVec2) -> bool {
    outline.len() > 2 && sides(outline).all(|(a, b)| cross(a, b, point) >= 0.0)
}

/// Distance of two convex outlines, 0 where they overlap.
fn distance(a: &[DVec2], b: &[DVec2]) -> f64 {
    // An axis along a side of either separates them, or nothing does.
    let apart = |own: &[DVec2], theirs: &[DVec2]| {
        sides(own).any(|(from, to)| theirs.iter().all(|point| cross(from, to, *point) < 0.0))
    };
    if !apart(a, b) && !apart(b, a) {
        return 0.0;
    }
    let to_side = |point: DVec2, (from, to): (DVec2, DVec2)| {
        let along = to - from;
        let share = ((point - from).dot(along) / along.length_squared().max(1e-18)).clamp(0.0, 1.0);
        point.distance(from + along * share)
    };
    let least = |own: &[DVec2], theirs: &[DVec2]| {
        own.iter().flat_map(|p| sides(theirs).map(|s| to_side(*p, s))).fold(f64::INFINITY, f64::min)
    };
    least(a, b).min(least(b, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_render::Mesh;

    fn cuboid(size: DVec3) -> Outlines {
        let mesh = Mesh::unit_box();
        let point = |index: u32| mesh.positions()[index as usize].as_dvec3() * size + DVec3::Z * 0.5 * size.z;
        Outlines::of(mesh.indices().chunks_exact(3).map(|c| [point(c[0]), point(c[1]), point(c[2])]))
    }

    #[test]
    fn gaps_are_those_of_the_nearest_sides() {
        let (a, b) = (cuboid(DVec3::new(0.1, 0.06, 0.05)), cuboid(DVec3::splat(0.04)));
        let at = |x: f64, z: f64, yaw: f64| Pose::from_yaw(DVec3::new(x, 0.0, z), yaw);
        let gap = |x: f64, z: f64, yaw: f64| a.gap(&at(0.0, 0.0, 0.0), &b, &at(x, z, yaw));
        assert!((gap(0.1, 0.0, 0.0) - 0.03).abs() < 1e-9);
        // Turned by 45 degrees its corner is nearest.
        assert!((gap(0.1, 0.0, std::f64::consts::FRAC_PI_4) - (0.05 - 0.02 * 2f64.sqrt())).abs() < 1e-9);
        assert_eq!(gap(0.05, 0.0, 0.0), 0.0);
        assert_eq!(gap(0.05, 0.2, 0.0), f64::INFINITY);
        let on = at(0.02, 0.05, 0.0);
        assert!(a.carries(&at(0.0, 0.0, 0.0), &b, &on) && !a.carries(&at(0.1, 0.0, 0.0), &b, &on));
        let (low, high) = a.bounds();
        assert!(
            (high - low).distance(DVec3::new(0.1, 0.06, 0.05)) < 1e-9
                && (a.radius() - 0.05f64.hypot(0.03)).abs() < 1e-9
        );
    }
}
