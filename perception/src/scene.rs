//! The frame seen from its support: points, heights and normals in a frame whose z = 0 is the plane.

use crate::{config::GrounderConfig, grid::Grid, scan::Scan, support::Plane, surface_tint::SurfaceTint};
use acm_concept::pose::Pose;
use glam::{DQuat, DVec2, DVec3, Vec3};
use std::sync::OnceLock;

/// No thing has fewer pixels, however small the image.
const FEW_PX: usize = 40;

/// A frame with its support plane. The *support frame* is the world turned by the plane's small tilt and moved so
/// that z is the height above the plane.
pub(crate) struct Scene<'a> {
    pub scan: &'a Scan,
    pub config: &'a GrounderConfig,
    pub grid: Grid,
    /// Pose of the camera in the support frame.
    pub camera: Pose,
    /// Pose of the support frame in the world.
    pub world: Pose,
    /// How noisy this frame is compared with the sensor model, after smoothing.
    pub noise_ratio: f64,
    /// Point of every pixel in the support frame, from the smoothed depth; NaN where there is none.
    pub point: Vec<Vec3>,
    /// How much a depth of 1 m along the viewing ray of a pixel adds to the height: for one at the image's origin, per
    /// column, per row.
    climb: [f32; 3],
    /// Pixels that belong to the robot itself.
    pub own: Vec<bool>,
    /// Pixels on the plane and within its extent.
    pub in_plane: Vec<bool>,
    /// Pixels of what stands on the plane.
    pub rising: Vec<bool>,
    /// Outline of the surface, counter-clockwise, support frame x and y.
    pub outline: Vec<DVec2>,
    tint: OnceLock<Option<SurfaceTint>>,
}

impl<'a> Scene<'a> {
    pub fn new(
        scan: &'a Scan,
        plane: &Plane,
        camera_pose: &Pose,
        own: Vec<bool>,
        config: &'a GrounderConfig,
    ) -> Scene<'a> {
        let normal = camera_pose.transform_vector(plane.normal);
        let offset = plane.offset + normal.dot(camera_pose.translation);
        let world = Pose::new(normal * offset, DQuat::from_rotation_arc(DVec3::Z, normal));
        let camera = world.inverse() * *camera_pose;
        let noise_ratio = plane.noise_ratio.clamp(0.25, 2.0);
        let (point, climb) = points(scan, &camera);
        let mut scene = Scene {
            scan,
            config,
            grid: scan.grid,
            camera,
            world,
            noise_ratio,
            point,
            climb,
            own,
            in_plane: Vec::new(),
            rising: Vec::new(),
            outline: Vec::new(),
            tint: OnceLock::new(),
        };
        scene.find_surface();
        scene.find_rising();
        scene
    }

    /// The colour of the bare surface; `None` where none is seen.
    pub fn tint(&self) -> Option<&SurfaceTint> {
        self.tint.get_or_init(|| SurfaceTint::measure(self)).as_ref()
    }
    /// Whether a pixel has another colour than the bare surface would have there.
    pub fn is_unlike_surface(&self, pixel: usize) -> bool {
        self.tint().is_some_and(|tint| tint.is_unlike(self, pixel))
    }
    /// Height above which a pixel stands on the plane rather than in it. The share of the distance stands for the
    /// ripples of a structured-light or stereo camera, which no smoothing removes.
    pub fn height_limit_m(&self, pixel: usize) -> f32 {
        let depth = self.scan.smooth[pixel];
        let (column, row) = (self.grid.column(pixel) as f32, self.grid.row(pixel) as f32);
        let climb = (self.climb[0] + self.climb[1] * column + self.climb[2] * row).abs();
        let sigma_m = (self.noise_ratio * self.config.depth_sigma_m(f64::from(depth))) as f32 * climb;
        self.config.min_height_m.max(3.0 * sigma_m).max(0.006 * depth)
    }
    /// Fewest pixels of a thing: the configured number is one of a VGA image.
    pub fn min_segment_px(&self) -> usize {
        const VGA: usize = 640 * 480;
        let scaled = self.config.min_segment_px * self.grid.len() / VGA;
        scaled.clamp(FEW_PX.min(self.config.min_segment_px), self.config.min_segment_px)
    }
    /// Where the viewing ray of an image point meets the plane, support frame x and y.
    pub fn foot_of_ray(&self, pixel: DVec2) -> Option<DVec2> {
        let direction = self.camera.transform_vector(self.scan.intrinsics.ray(pixel.x, pixel.y));
        let along = -self.camera.translation.z / direction.z;
        (direction.z < -1e-6 && along > 0.0).then(|| (self.camera.translation + direction * along).truncate())
    }
    /// Image coordinates of a point of the support frame.
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        self.scan.intrinsics.project(self.camera.inverse().transform_point(point))
    }
    /// Measured (not smoothed) point of a pixel in the support frame.
    pub fn measured(&self, pixel: usize) -> Option<DVec3> {
        let depth = f64::from(self.scan.depth[pixel]);
        (depth > 0.0).then(|| self.camera.transform_point(self.scan.ray(pixel) * depth))
    }
    /// Height over the plane that only the lowest seventieth of some pixels does not reach, metres.
    pub fn lowest_m(&self, pixels: &[usize]) -> f64 {
        let mut heights: Vec<f32> = pixels.iter().filter(|&&i| self.is_known(i)).map(|&i| self.point[i].z).collect();
        heights.sort_by(f32::total_cmp);
        heights.get(heights.len() / 70).map_or(0.0, |h| f64::from(*h))
    }
    pub fn is_known(&self, pixel: usize) -> bool {
        !self.point[pixel].z.is_nan()
    }

    fn find_surface(&mut self) {
        // The limit is never lower than its floor, which most of the surface keeps.
        let within = |i: usize, z: f32| z <= self.config.min_height_m || z <= self.height_limit_m(i);
        let flat = |i: usize| !self.own[i] && self.is_known(i) && within(i, self.point[i].z.abs());
        let mask = self.grid.map(flat);
        // Opened against specks on walls and floors behind, closed over lines of holes.
        let solid = self.grid.dilate(&self.grid.erode(&mask, 1), 3);
        let (labels, sizes) = self.grid.blobs(&solid);
        let largest = (0..sizes.len()).max_by_key(|&l| (sizes[l], std::cmp::Reverse(l)));
        self.in_plane = self.grid.map(|i| mask[i] && Some(labels[i] as usize) == largest);
        // The plane's image is a projective map, which keeps lines straight: the ends of the rows hold the hull.
        let mut feet: Vec<DVec2> = Vec::new();
        for row in 0..self.grid.height {
            let line = self.grid.index(0, row)..self.grid.index(0, row) + self.grid.width;
            let ends = [line.clone().find(|&i| self.in_plane[i]), line.rev().find(|&i| self.in_plane[i])];
            feet.extend(ends.into_iter().flatten().map(|i| self.point[i].truncate().as_dvec2()));
        }
        self.outline = convex_hull(feet);
    }

    fn find_rising(&mut self) {
        let extent = Outline::of(&self.outline);
        let rises = |i: usize| {
            let point = self.point[i];
            !self.own[i]
                && self.is_known(i)
                && point.z > self.config.min_height_m
                && point.z > self.height_limit_m(i)
                && point.z < self.config.max_height_m
                && self.stands_inside(&extent, point.as_dvec3())
        };
        self.rising = self.grid.map(rises);
    }

    /// Whether the foot of a point lies on the surface. Feet that the image does not show get some leave.
    fn stands_inside(&self, extent: &Outline, point: DVec3) -> bool {
        if extent.holds(point.truncate()) {
            return true;
        }
        let outside = extent.distance_outside(point.truncate());
        if outside <= 0.01 {
            return true;
        }
        let seen = self.project(point.with_z(0.0)).is_some_and(|pixel| self.scan.intrinsics.contains(pixel));
        !seen && outside < 0.12
    }
}

/// The point of every pixel, and how viewing rays climb.
fn points(scan: &Scan, camera: &Pose) -> (Vec<Vec3>, [f32; 3]) {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| camera.transform_vector(axis));
    let eye = camera.translation.as_vec3();
    let of = scan.intrinsics;
    let (across, down) = (axes[0] / of.fx, axes[1] / of.fy);
    let first = (axes[2] - across * of.cx - down * of.cy).as_vec3();
    let (across, down) = (across.as_vec3(), down.as_vec3());
    let point = |index: usize| match scan.smooth[index] {
        depth if depth > 0.0 => {
            eye + (first + across * scan.grid.column(index) as f32 + down * scan.grid.row(index) as f32) * depth
        }
        _ => Vec3::NAN,
    };
    (scan.grid.map(point), [first.z, across.z, down.z])
}

/// The convex hull of points, counter-clockwise (Andrew's monotone chain); fewer than three points are returned as
/// they are.
pub(crate) fn convex_hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut hull: Vec<DVec2> = Vec::new();
    let half = |hull: &mut Vec<DVec2>, points: &mut dyn Iterator<Item = DVec2>| {
        let start = hull.len();
        for point in points {
            while hull.len() >= start + 2 {
                let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (b - a).perp_dot(point - a) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
    };
    half(&mut hull, &mut points.iter().copied());
    half(&mut hull, &mut points.iter().rev().copied());
    hull
}

/// A convex polygon ready to be asked for many distances.
pub(crate) struct Outline {
    /// Corner, unit vector to the next corner, and distance to it.
    edges: Vec<(DVec2, DVec2, f64)>,
}

impl Outline {
    /// Of a counter-clockwise polygon.
    pub fn of(polygon: &[DVec2]) -> Outline {
        let edge = |(i, &a): (usize, &DVec2)| {
            let to = polygon[(i + 1) % polygon.len()] - a;
            let length = to.length().max(1e-12);
            (a, to / length, length)
        };
        Outline { edges: polygon.iter().enumerate().map(edge).collect() }
    }
    /// Whether a point lies within, told by few of the edges: the polygon is a fan of triangles round its first corner.
    pub fn holds(&self, point: DVec2) -> bool {
        let Some((first, _, _)) = self.edges.first().filter(|_| self.edges.len() > 2) else { return false };
        let to = point - *first;
        // The spokes that the point lies to the left of.
        let spokes = &self.edges[1..];
        let passed = spokes.partition_point(|(corner, _, _)| (*corner - *first).perp_dot(to) >= 0.0);
        let Some((corner, along, _)) = passed.checked_sub(1).and_then(|at| spokes.get(at)) else { return false };
        passed < spokes.len() && along.perp_dot(point - *corner) >= 0.0
    }
    /// How far a point lies outside; negative inside (distance to the nearest edge).
    pub fn distance_outside(&self, point: DVec2) -> f64 {
        let across = |(a, along, _): &(DVec2, DVec2, f64)| (point - *a).perp_dot(*along);
        let inside = self.edges.iter().map(across).fold(f64::NEG_INFINITY, f64::max);
        if inside <= 0.0 {
            return inside;
        }
        let distance2 = |(a, along, length): &(DVec2, DVec2, f64)| {
            let to = point - *a;
            (to - *along * to.dot(*along).clamp(0.0, *length)).length_squared()
        };
        self.edges.iter().map(distance2).fold(f64::INFINITY, f64::min).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_hull_contains_its_points_and_turns_left(raw in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 3..60)) {
            let points: Vec<DVec2> = raw.into_iter().map(DVec2::from).collect();
            let hull = convex_hull(points.clone());
            prop_assert!(hull.len() >= 3);
            for (i, a) in hull.iter().enumerate() {
                let (b, c) = (hull[(i + 1) % hull.len()], hull[(i + 2) % hull.len()]);
                prop_assert!((b - *a).perp_dot(c - b) > 0.0);
            }
            for point in points {
                let (middle, outline) = (hull.iter().sum::<DVec2>() / hull.len() as f64, Outline::of(&hull));
                let (near, far) = (middle.lerp(point, 0.999), middle + (point - middle) * 3.0);
                prop_assert!(outline.holds(near) || outline.distance_outside(near) > -1e-9);
                prop_assert!(!outline.holds(far) || outline.distance_outside(far) <= 1e-9);
                prop_assert!(Outline::of(&hull).distance_outside(point) <= 1e-9);
            }
        }
    }

    #[test]
    fn the_distance_to_a_square_is_signed() {
        let square = convex_hull([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)].map(DVec2::from).to_vec());
        assert_eq!(Outline::of(&square).distance_outside(DVec2::new(1.0, 1.5)), -0.5);
        assert_eq!(Outline::of(&square).distance_outside(DVec2::new(3.0, 1.0)), 1.0);
        assert_eq!(Outline::of(&square).distance_outside(DVec2::new(5.0, 6.0)), 5.0);
    }
}
