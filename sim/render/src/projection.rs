//! From camera models to clip space.

use acm_concept::camera::Intrinsics;
use glam::{DMat4, DVec3, DVec4};

/// Surfaces nearer than this are cut away, metres.
pub(crate) const NEAR_M: f64 = 0.01;
/// Surfaces farther than this are cut away, metres.
pub(crate) const FAR_M: f64 = 30.0;

/// Clip space (x right, y up, depth 0 at the near plane, 1 at the far plane) from the camera frame.
///
/// The raster samples pixel (column, row) at (column + 0.5, row + 0.5) of its viewport, and our pixel centres are
/// whole numbers: hence the half added to the principal point.
pub(crate) fn clip_from_camera(intrinsics: &Intrinsics) -> DMat4 {
    let (width, height) = (f64::from(intrinsics.width), f64::from(intrinsics.height));
    let range = FAR_M / (FAR_M - NEAR_M);
    DMat4::from_cols(
        DVec4::new(2.0 * intrinsics.fx / width, 0.0, 0.0, 0.0),
        DVec4::new(0.0, -2.0 * intrinsics.fy / height, 0.0, 0.0),
        DVec4::new(2.0 * (intrinsics.cx + 0.5) / width - 1.0, 1.0 - 2.0 * (intrinsics.cy + 0.5) / height, range, 1.0),
        DVec4::new(0.0, 0.0, -NEAR_M * range, 0.0),
    )
}

/// Inward normals of the four planes through the camera's centre that bound the image, in the camera frame.
pub(crate) fn side_planes(intrinsics: &Intrinsics) -> [DVec3; 4] {
    let (right, bottom) = (f64::from(intrinsics.width) - 0.5, f64::from(intrinsics.height) - 0.5);
    [
        DVec3::new(intrinsics.fx, 0.0, intrinsics.cx + 0.5),
        DVec3::new(-intrinsics.fx, 0.0, right - intrinsics.cx),
        DVec3::new(0.0, intrinsics.fy, intrinsics.cy + 0.5),
        DVec3::new(0.0, -intrinsics.fy, bottom - intrinsics.cy),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The raster's viewport transform after our projection is the camera model's own projection.
        #[test]
        fn clip_space_agrees_with_the_camera_model(
            fx in 100.0..900.0f64, fy in 100.0..900.0f64, cx in -50.0..500.0f64, cy in -50.0..400.0f64,
            x in -1.0..1.0f64, y in -1.0..1.0f64, z in 0.02..20.0f64,
        ) {
            let intrinsics = Intrinsics { width: 403, height: 297, fx, fy, cx, cy };
            let point = DVec3::new(x, y, z);
            let clip = clip_from_camera(&intrinsics) * point.extend(1.0);
            let ndc = clip / clip.w;
            let column = (ndc.x + 1.0) * 0.5 * 403.0 - 0.5;
            let row = (1.0 - ndc.y) * 0.5 * 297.0 - 0.5;
            let expected = intrinsics.project(point).ok_or_else(|| TestCaseError::fail("behind the camera"))?;
            prop_assert!((column - expected.x).abs() < 1e-6 && (row - expected.y).abs() < 1e-6);
            prop_assert!(ndc.z > 0.0 && ndc.z < 1.0 && (clip.w - z).abs() < 1e-12);
            let inside = side_planes(&intrinsics).iter().all(|plane| plane.dot(point) >= 0.0);
            prop_assert_eq!(inside, intrinsics.contains(expected));
        }
    }
}
