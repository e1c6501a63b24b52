//! The camera's pose over the dominant plane, for frames whose camera pose nobody knows.

use crate::{
    config::GrounderConfig,
    scan::Scan,
    support::{self, Plane, Upright},
};
use acm_concept::{camera::RgbdFrame, pose::Pose};
use glam::{DMat3, DQuat, DVec3};

/// Finds the dominant plane on which things could stand and returns the camera's pose in the frame that it defines:
/// z = 0 on the plane and z up, x to the camera's right along the plane, the origin under the camera. Metres.
///
/// The camera is taken to be roughly upright, so that a wall is not mistaken for a table; a camera that looks
/// straight down is served by a second search. `None` without enough depth or without a plane.
pub fn level(frame: &RgbdFrame, config: &GrounderConfig) -> Option<Pose> {
    let scan = Scan::read(frame, config).ok()?;
    let excluded = vec![false; scan.grid.len()];
    let search = |up, max_angle_rad| support::find(&scan, &excluded, Upright { up, max_angle_rad }, None, config);
    let plane = search(DVec3::NEG_Y, 75f64.to_radians()).or_else(|| search(DVec3::NEG_Z, 30f64.to_radians()))?;
    pose_over(&plane)
}

/// The camera's pose in the frame of a plane, as [`level`] defines it.
pub(crate) fn pose_over(plane: &Plane) -> Option<Pose> {
    let up = plane.normal;
    let right = (DVec3::X - up * up.x).try_normalize()?;
    let ahead = up.cross(right);
    // Columns are the camera's axes seen from the plane's frame: the transpose of (right, ahead, up).
    let rotation = DQuat::from_mat3(&DMat3::from_cols(right, ahead, up).transpose()).normalize();
    Some(Pose::new(DVec3::new(0.0, 0.0, -plane.offset), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pose_puts_the_plane_at_zero_and_the_camera_above_the_origin() {
        let plane =
            Plane { normal: DVec3::new(0.02, -0.6, -0.8).normalize(), offset: -0.7, residual_m: 0.0, noise_ratio: 1.0 };
        let pose = pose_over(&plane).unwrap();
        let ray = DVec3::new(0.1, 0.2, 1.0);
        let point = pose.transform_point(ray * (plane.offset / plane.normal.dot(ray)));
        assert!(point.z.abs() < 1e-9, "{point}");
        assert!(pose.translation.distance(DVec3::new(0.0, 0.0, 0.7)) < 1e-9);
        let right = pose.transform_vector(DVec3::X);
        assert!(right.y.abs() < 1e-9 && right.x > 0.99);
    }
}
