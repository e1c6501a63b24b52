//! The one place where our poses meet nalgebra's types.

use crate::pose::Pose;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

impl From<Pose> for Isometry3<f64> {
    fn from(pose: Pose) -> Self {
        Isometry3::from_parts(
            Translation3::from(nalgebra::Vector3::from(pose.translation)),
            UnitQuaternion::new_normalize(pose.rotation.into()),
        )
    }
}

impl From<Isometry3<f64>> for Pose {
    fn from(isometry: Isometry3<f64>) -> Self {
        Pose::new(isometry.translation.vector.into(), isometry.rotation.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    #[test]
    fn a_pose_survives_the_round_trip() {
        let pose = Pose::new(DVec3::new(0.1, -0.2, 0.3), DQuat::from_rotation_x(0.7));
        let back = Pose::from(Isometry3::from(pose));
        assert!(back.translation.distance(pose.translation) < 1e-12 && back.angle_to(&pose) < 1e-7);
    }
}
