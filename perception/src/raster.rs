//! Ray-casts solids into the image: predicted depth of what is remembered, pixels of the robot itself.

use crate::{fit::corners, grid::Grid};
use acm_concept::{
    camera::Intrinsics,
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::{DVec2, DVec3};

/// Pixels whose rays meet a set of solids, with the depth (along the optical axis, metres) at which they enter.
#[derive(Debug, Default)]
pub(crate) struct Cast {
    /// Pixel index and depth, ascending by pixel.
    pub hits: Vec<(usize, f64)>,
    /// Share of the solids' bounding spheres' area that falls on the sensor, 0-1.
    pub in_view: f64,
}

/// Casts the rays of a camera with pose `camera` at solids that are given in the same parent frame.
pub(crate) fn cast(intrinsics: &Intrinsics, grid: Grid, camera: &Pose, solids: &[PlacedSolid]) -> Cast {
    let mut hits: Vec<(usize, f64)> = Vec::new();
    let (mut seen_area, mut full_area) = (0.0, 0.0);
    let to_camera = camera.inverse();
    for solid in solids {
        let pose = to_camera * solid.pose;
        let Some(image) = Disc::of(intrinsics, &pose, solid.solid.bounding_radius()) else {
            full_area += 1.0;
            continue;
        };
        full_area += image.area;
        seen_area += image.visible;
        let inverse = pose.inverse();
        let origin = inverse.translation;
        // Rays are linear in the pixel.
        let [across, down, ahead] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| inverse.transform_vector(axis));
        let bounds = tightened(image.bounds, intrinsics, &pose, &solid.solid);
        for row in bounds[1]..bounds[3] {
            let line = ahead + down * ((row as f64 - intrinsics.cy) / intrinsics.fy);
            for column in bounds[0]..bounds[2] {
                let direction = line + across * ((column as f64 - intrinsics.cx) / intrinsics.fx);
                if let Some((enter, _)) = solid.solid.intersect_ray(origin, direction)
                    && enter > 0.0
                {
                    hits.push((grid.index(column, row), enter));
                }
            }
        }
    }
    hits.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    hits.dedup_by_key(|hit| hit.0);
    let in_view = if full_area > 0.0 { seen_area / full_area } else { 0.0 };
    Cast { hits, in_view }
}

/// The square round a sphere's image.
struct Disc {
    /// First column and row and past-the-last column and row, on the sensor.
    bounds: [usize; 4],
    area: f64,
    /// The area on the sensor.
    visible: f64,
}

impl Disc {
    /// `None` if the sphere reaches behind the camera's plane.
    fn of(intrinsics: &Intrinsics, pose: &Pose, radius: f64) -> Option<Disc> {
        let centre: DVec3 = pose.translation;
        if centre.z - radius < 0.02 {
            return None;
        }
        let middle = intrinsics.project(centre)?;
        let reach = 1.05 * radius / (centre.z - radius);
        let reach = DVec2::new(intrinsics.fx * reach + 1.0, intrinsics.fy * reach + 1.0);
        let bounds = on_sensor(intrinsics, middle - reach, middle + reach);
        let visible = (bounds[2] - bounds[0]) as f64 * (bounds[3] - bounds[1]) as f64;
        let area = (2.0 * reach.x + 1.0) * (2.0 * reach.y + 1.0);
        Some(Disc { bounds, area: area.max(visible), visible })
    }
}

/// First column and row and past-the-last column and row of a rectangle of the image, on the sensor.
fn on_sensor(intrinsics: &Intrinsics, low: DVec2, high: DVec2) -> [usize; 4] {
    let clip = |value: f64, limit: u32| value.clamp(0.0, f64::from(limit)) as usize;
    [
        clip(low.x.floor(), intrinsics.width),
        clip(low.y.floor(), intrinsics.height),
        clip(high.x.ceil() + 1.0, intrinsics.width),
        clip(high.y.ceil() + 1.0, intrinsics.height),
    ]
}

/// The part of the bounds of a solid's sphere in which its own corners lie. Corners of what is round lie on it as often as
/// between them it bulges: some are added on every side.
fn tightened(sphere: [usize; 4], intrinsics: &Intrinsics, pose: &Pose, solid: &Solid) -> [usize; 4] {
    const BULGE: f64 = 0.04;
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for corner in corners(solid).into_iter().flatten() {
        let Some(at) = intrinsics.project(pose.transform_point(corner)) else { return sphere };
        (low, high) = (low.min(at), high.max(at));
    }
    let more = (high - low) * BULGE + DVec2::ONE;
    let own = on_sensor(intrinsics, low - more, high + more);
    [sphere[0].max(own[0]), sphere[1].max(own[1]), sphere[2].min(own[2]), sphere[3].min(own[3])]
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTRINSICS: Intrinsics = Intrinsics { width: 64, height: 48, fx: 50.0, fy: 50.0, cx: 31.5, cy: 23.5 };
    const GRID: Grid = Grid { width: 64, height: 48 };

    fn ball_of_box(x: f64, z: f64) -> PlacedSolid {
        PlacedSolid {
            solid: Solid::Box { size: DVec3::splat(0.2) },
            pose: Pose::from_translation(DVec3::new(x, 0.0, z)),
        }
    }

    #[test]
    fn a_box_before_the_camera_fills_the_pixels_of_its_front_face() {
        let cast = cast(&INTRINSICS, GRID, &Pose::IDENTITY, &[ball_of_box(0.0, 1.1)]);
        assert_eq!(cast.hits.len(), 100);
        assert!(cast.hits.iter().all(|(_, depth)| (depth - 1.0).abs() < 1e-9));
        assert!(cast.in_view > 0.99);
    }

    #[test]
    fn a_box_beside_or_behind_the_camera_is_out_of_view() {
        for solid in [ball_of_box(3.0, 1.0), ball_of_box(0.0, -1.0)] {
            let cast = cast(&INTRINSICS, GRID, &Pose::IDENTITY, &[solid]);
            assert!(cast.hits.is_empty() && cast.in_view < 0.01, "{}", cast.in_view);
        }
    }
}
