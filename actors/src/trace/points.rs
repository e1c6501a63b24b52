//! A frame as points: the one place in which pixels with a depth become a cloud.

use acm_concept::camera::Intrinsics;
use glam::DVec3;

/// Most points of a cloud in a trace, before pixels without a depth are left out: 16 bytes each are 512 KiB.
pub const MAX_POINTS: u32 = 32_768;

/// A pixel that has a depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Where it is in the camera's frame (x right, y down, z ahead), metres.
    pub at: DVec3,
    /// 8-bit sRGB.
    pub color: [u8; 3],
}

/// Every how many rows and columns a pixel is taken, so that at most [`MAX_POINTS`] are. Pixels are left out rather than
/// averaged: each point of a thin cloud is one that was measured.
pub fn stride(intrinsics: &Intrinsics) -> u32 {
    let taken = |step: u32| u64::from(intrinsics.width.div_ceil(step)) * u64::from(intrinsics.height.div_ceil(step));
    let mut step = 1;
    while taken(step) > u64::from(MAX_POINTS) {
        step += 1;
    }
    step
}

/// The points of every `stride`th row and column that have a depth, by nominal calibration, row by row.
///
/// `color` has 3 bytes a pixel, `depth` metres along the optical axis, 0 where nothing was measured; both row by row
/// without gaps.
pub fn points<'a>(
    intrinsics: &'a Intrinsics,
    color: &'a [u8],
    depth: &'a [f32],
    stride: u32,
) -> impl Iterator<Item = Point> + 'a {
    let (width, step) = (intrinsics.width as usize, stride.max(1) as usize);
    let rows = depth.chunks_exact(width.max(1)).zip(color.as_chunks::<3>().0.chunks_exact(width.max(1)));
    rows.enumerate().step_by(step).flat_map(move |(row, (depths, colors))| {
        depths.iter().zip(colors).enumerate().step_by(step).filter_map(move |(column, (depth, color))| {
            let measured = depth.is_finite() && *depth > 0.0;
            let at = || intrinsics.ray(column as f64, row as f64) * f64::from(*depth);
            measured.then(|| Point { at: at(), color: *color })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(width: u32, height: u32) -> Intrinsics {
        Intrinsics { width, height, fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 }
    }

    #[test]
    fn a_cloud_has_a_largest_size_whatever_the_camera() {
        for (width, height, expected) in [(160, 120, 1), (320, 240, 2), (640, 480, 4), (3840, 2160, 16)] {
            let camera = camera(width, height);
            assert_eq!(stride(&camera), expected, "{width}x{height}");
            assert!(width.div_ceil(expected) * height.div_ceil(expected) <= MAX_POINTS);
        }
    }

    #[test]
    fn a_stride_takes_whole_rows_and_columns_and_only_what_was_measured() {
        let camera = camera(5, 3);
        let color: Vec<u8> = (0..45).collect();
        let mut depth = vec![2.0; 15];
        depth[4] = 0.0;
        let all: Vec<Point> = points(&camera, &color, &depth, 1).collect();
        assert_eq!(all.len(), 14);
        let thin: Vec<Point> = points(&camera, &color, &depth, 2).collect();
        let places: Vec<(f64, f64)> = thin.iter().map(|point| (point.at.x / 2.0, point.at.y / 2.0)).collect();
        assert_eq!(places, [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0), (4.0, 2.0)]);
        assert!(thin.iter().all(|point| all.contains(point)));
        assert_eq!(thin.last().map(|point| point.color), Some([42, 43, 44]));
    }
}
