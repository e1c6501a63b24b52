//! The one place where the engine's single-precision poses meet ours.

use acm_concept::pose::Pose;
use glam::{DQuat, DVec3};
use rapier3d::math as engine;

pub(crate) fn to_engine(pose: &Pose) -> engine::Pose {
    engine::Pose::from_parts(vector(pose.translation), pose.rotation.as_quat().normalize())
}

pub(crate) fn from_engine(pose: &engine::Pose) -> Pose {
    let rotation: DQuat = pose.rotation.as_dquat();
    Pose::new(pose.translation.as_dvec3(), rotation.normalize())
}

pub(crate) fn vector(v: DVec3) -> engine::Vector {
    v.as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_survives_single_precision() {
        let pose = Pose::new(DVec3::new(0.1, -0.25, 0.761), DQuat::from_rotation_x(3.0));
        let back = from_engine(&to_engine(&pose));
        assert!(back.translation.distance(pose.translation) < 1e-6 && back.angle_to(&pose) < 1e-3);
    }
}
