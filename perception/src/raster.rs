//! Ray-casts solids into the image: predicted depth of what is remembered, pixels of the robot itself.

use crate::grid::Grid;
use acm_concept::{camera::Intrinsics, pose::Pose, solid::PlacedSolid};
use glam::DVec3;

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
        let Some((bounds, area, visible)) = bounds(intrinsics, &pose, solid.solid.bounding_radius()) else {
            full_area += 1.0;
            continue;
        };
        full_area += area;
        seen_area += visible;
        let inverse = pose.inverse();
        let origin = inverse.translation;
        for row in bounds[1]..bounds[3] {
            for column in bounds[0]..bounds[2] {
                let direction = inverse.transform_vector(intrinsics.ray(column as f64, row as f64));
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

/// First column and row and past-the-last column and row of the square round a sphere's image, its area and the
/// area on the sensor; `None` if the sphere reaches behind the camera's plane.
fn bounds(intrinsics: &Intrinsics, pose: &Pose, radius: f64) -> Option<([usize; 4], f64, f64)> {
    let centre: DVec3 = pose.translation;
    if centre.z - radius < 0.02 {
        return None;
    }
    let middle = intrinsics.project(centre)?;
    let reach = 1.05 * radius / (centre.z - radius);
    let (rx, ry) = (intrinsics.fx * reach + 1.0, intrinsics.fy * reach + 1.0);
    let clip = |value: f64, limit: u32| value.clamp(0.0, f64::from(limit)) as usize;
    let box_px = [
        clip((middle.x - rx).floor(), intrinsics.width),
        clip((middle.y - ry).floor(), intrinsics.height),
        clip((middle.x + rx).ceil() + 1.0, intrinsics.width),
        clip((middle.y + ry).ceil() + 1.0, intrinsics.height),
    ];
    let visible = (box_px[2] - box_px[0]) as f64 * (box_px[3] - box_px[1]) as f64;
    let area = (2.0 * rx + 1.0) * (2.0 * ry + 1.0);
    Some((box_px, area.max(visible), visible))
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::solid::Solid;

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
