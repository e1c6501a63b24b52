//! A thing's points, made independent of place, heading and size, and cut into groups.

use crate::config::Shape;
use glam::{DVec2, DVec3};
use rand::{Rng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

/// Points of one thing's surface. The frame has z up and z = 0 at what the thing stands on; metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Cloud {
    /// Measured points, in any order.
    pub points: Vec<DVec3>,
    /// Where the camera is.
    pub camera: DVec3,
}

/// Fewer points say nothing.
pub const LEAST_POINTS: usize = 32;
/// Share of the points at each end that does not count for place and size: depths at outlines are mixed.
const TRIM: f64 = 0.02;
/// Points farther out than this are left out, in lengths of the thing.
const FAR: f64 = 1.2;
/// Least size, metres.
const LEAST_SIZE_M: f64 = 1e-3;

/// The frame in which a cloud is looked at: its origin is the middle of what is seen, on the support; x points from the
/// camera to it; its unit is the largest extent of what is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normal {
    /// Origin on the support, metres.
    pub origin: DVec2,
    /// Heading of the x axis, radians.
    pub yaw: f64,
    /// The unit, metres.
    pub unit_m: f64,
    /// How the thing is looked at: logarithms of the unit over 0.1 m and of the camera's distance over 1 m, and the sine of
    /// its elevation. They tell how much noise there is to a unit, and what hides.
    pub context: [f32; 3],
}

/// Numbers in [`Normal::context`].
pub const CONTEXT: usize = 3;

impl Cloud {
    /// The frame of the cloud; `None` of too few points.
    pub fn normal(&self) -> Option<Normal> {
        if self.points.len() < LEAST_POINTS || !self.points.iter().all(|point| point.is_finite()) {
            return None;
        }
        let middle = self.points.iter().map(|point| point.truncate()).sum::<DVec2>() / self.points.len() as f64;
        let to = middle - self.camera.truncate();
        let yaw = if to.length() > 1e-6 { to.to_angle() } else { 0.0 };
        let (along, across) = (DVec2::from_angle(yaw), DVec2::from_angle(yaw).perp());
        let (x, y) = (self.range(along), self.range(across));
        let top = self.quantiles(|point| point.z).1;
        let unit_m = x.length().max(y.length()).max(top).max(LEAST_SIZE_M);
        let origin = along * x.middle() + across * y.middle();
        let to_camera = self.camera - origin.extend(0.5 * top);
        let distance = to_camera.length().max(LEAST_SIZE_M);
        let context = [(unit_m / 0.1).ln(), distance.ln(), to_camera.z / distance].map(|number| number as f32);
        Some(Normal { origin, yaw, unit_m, context })
    }

    fn range(&self, direction: DVec2) -> Range {
        let (low, high) = self.quantiles(|point| point.truncate().dot(direction));
        Range { low, high }
    }

    fn quantiles(&self, of: impl Fn(&DVec3) -> f64) -> (f64, f64) {
        let mut numbers: Vec<f64> = self.points.iter().map(of).collect();
        numbers.sort_by(f64::total_cmp);
        let cut = (numbers.len() as f64 * TRIM) as usize;
        let at = |index: usize| numbers.get(index).copied().unwrap_or(0.0);
        (at(cut), at(numbers.len().saturating_sub(1 + cut)))
    }

    /// The points in a frame of the cloud, without those far out.
    pub fn points_in(&self, normal: &Normal) -> Vec<[f32; 3]> {
        let back = DVec2::from_angle(-normal.yaw);
        let own = |point: &DVec3| {
            let flat = back.rotate(point.truncate() - normal.origin);
            flat.extend(point.z) / normal.unit_m
        };
        let near = |point: &DVec3| point.abs().max_element() <= FAR;
        self.points.iter().map(own).filter(near).map(|p| p.as_vec3().to_array()).collect()
    }
}

#[derive(Clone, Copy)]
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    fn middle(self) -> f64 {
        0.5 * (self.low + self.high)
    }
    fn length(self) -> f64 {
        self.high - self.low
    }
}

/// What the network takes of one cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct Groups {
    /// Middles, [groups, 3] row by row.
    pub middles: Vec<f32>,
    /// Points about their group's middle, [groups, group_size, 3].
    pub points: Vec<f32>,
}

/// Cuts points into groups: middles by farthest point sampling, of each its nearest points. `rng` draws which points are
/// taken, with repetition where there are too few, and the first middle. `None` without points.
pub fn group(points: &[[f32; 3]], shape: &Shape, rng: &mut ChaCha8Rng) -> Option<Groups> {
    let drawn = draw(points, shape.points, rng)?;
    let first = rng.random_range(0..drawn.len());
    let mut groups = Groups {
        middles: Vec::with_capacity(3 * shape.groups),
        points: Vec::with_capacity(3 * shape.groups * shape.group_size),
    };
    for middle in farthest(&drawn, first, shape.groups) {
        groups.middles.extend(middle);
        let mut by_distance: Vec<(f32, [f32; 3])> =
            drawn.iter().map(|point| (distance2(point, &middle), difference(point, &middle))).collect();
        let size = shape.group_size.min(by_distance.len());
        if size < by_distance.len() {
            by_distance.select_nth_unstable_by(size, |a, b| a.0.total_cmp(&b.0));
        }
        groups.points.extend(by_distance.iter().take(size).flat_map(|(_, point)| point));
    }
    Some(groups)
}

/// `count` of the points without repetition, or all of them and again.
fn draw(points: &[[f32; 3]], count: usize, rng: &mut ChaCha8Rng) -> Option<Vec<[f32; 3]>> {
    if points.is_empty() {
        return None;
    }
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.shuffle(rng);
    Some(order.iter().cycle().take(count).filter_map(|at| points.get(*at).copied()).collect())
}

/// `count` points, each the farthest from those before it.
fn farthest(points: &[[f32; 3]], first: usize, count: usize) -> Vec<[f32; 3]> {
    let mut distances = vec![f32::INFINITY; points.len()];
    let mut next = points.get(first).copied();
    let mut chosen = Vec::with_capacity(count);
    while let Some(point) = next.filter(|_| chosen.len() < count) {
        chosen.push(point);
        for (distance, other) in distances.iter_mut().zip(points) {
            *distance = distance.min(distance2(other, &point));
        }
        let farthest = distances.iter().zip(points).max_by(|a, b| a.0.total_cmp(b.0));
        next = farthest.map(|(_, point)| *point);
    }
    chosen
}

fn difference(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    let ([ax, ay, az], [bx, by, bz]) = (*a, *b);
    [ax - bx, ay - by, az - bz]
}

fn distance2(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    difference(a, b).iter().map(|d| d * d).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use proptest::prelude::*;
    use rand::SeedableRng;

    fn slab(at: DVec2, yaw: f64, scale: f64) -> Cloud {
        let point = |i: usize| DVec3::new((i % 20) as f64 / 19.0, (i / 20) as f64 / 38.0, 0.3);
        let placed = |p: DVec3| (DVec2::from_angle(yaw).rotate(p.truncate() * scale) + at).extend(p.z * scale);
        let camera = DVec3::new(-4.0, 0.4, 3.0);
        Cloud { points: (0..400).map(point).map(placed).collect(), camera: placed(camera) }
    }

    proptest! {
        #[test]
        fn place_heading_and_size_change_nothing(x in -1.0..1.0f64, y in -1.0..1.0f64, yaw in -3.0..3.0f64, scale in 0.03..0.3f64) {
            let (here, there) = (slab(DVec2::ZERO, 0.0, 0.1), slab(DVec2::new(x, y), yaw, scale));
            let (a, b) = (here.normal().unwrap(), there.normal().unwrap());
            prop_assert!((b.unit_m / a.unit_m - scale / 0.1).abs() < 1e-6);
            for (p, q) in here.points_in(&a).iter().zip(there.points_in(&b)) {
                prop_assert!(distance2(p, &q) < 1e-8, "{p:?} {q:?}");
            }
        }
    }

    #[test]
    fn groups_cover_the_cloud_and_hold_their_nearest() {
        let cloud = slab(DVec2::ZERO, 0.0, 0.1);
        let points = cloud.points_in(&cloud.normal().unwrap());
        let shape = Shape { points: 400, groups: 16, group_size: 8, ..Shape::TINY };
        let groups = group(&points, &shape, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        assert_eq!((groups.middles.len(), groups.points.len()), (16 * 3, 16 * 8 * 3));
        // A grid of 20 by 20 is a fourth of a unit apart when 16 of its points are chosen.
        let middles: Vec<[f32; 3]> = groups.middles.chunks_exact(3).map(|m| m.try_into().unwrap()).collect();
        for point in &points {
            assert!(middles.iter().any(|middle| distance2(point, middle) < 0.2 * 0.2));
        }
        assert!(groups.points.chunks_exact(3).all(|p| p.iter().map(|d| d * d).sum::<f32>() < 0.16 * 0.16));
        let again = group(&points, &shape, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        assert_eq!(groups, again);
    }

    #[test]
    fn a_cloud_of_few_points_is_grouped_with_repetition_and_one_of_fewer_is_refused() {
        let points = vec![[0.1, 0.2, 0.3]; 5];
        let groups = group(&points, &Shape::TINY, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        assert_eq!(groups.points.len(), 3 * Shape::TINY.groups * Shape::TINY.group_size);
        assert!(group(&[], &Shape::TINY, &mut ChaCha8Rng::seed_from_u64(1)).is_none());
        let few = Cloud { points: vec![DVec3::ONE; LEAST_POINTS - 1], camera: DVec3::ZERO };
        assert!(few.normal().is_none());
    }
}
