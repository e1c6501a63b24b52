//! Rigid motions in double precision.

use glam::{DAffine3, DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::ops;

/// A rigid motion, or the pose of a frame in its parent: first rotate, then translate. Metres.
///
/// ```
/// # use acm_concept::pose::Pose;
/// # use glam::DVec3;
/// let quarter_turn = Pose::from_yaw(DVec3::new(1.0, 0.0, 0.0), std::f64::consts::FRAC_PI_2);
/// assert!(quarter_turn.transform_point(DVec3::X).distance(DVec3::new(1.0, 1.0, 0.0)) < 1e-12);
/// assert!((quarter_turn.inverse() * quarter_turn).translation.length() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Origin of the frame, metres.
    pub translation: DVec3,
    /// Unit quaternion (x, y, z, w).
    pub rotation: DQuat,
}

impl Pose {
    /// No motion.
    pub const IDENTITY: Pose = Pose { translation: DVec3::ZERO, rotation: DQuat::IDENTITY };

    /// A pose from its two parts.
    pub fn new(translation: DVec3, rotation: DQuat) -> Pose {
        Pose { translation, rotation }
    }
    /// A pure translation.
    pub fn from_translation(translation: DVec3) -> Pose {
        Pose { translation, rotation: DQuat::IDENTITY }
    }
    /// An upright pose turned about z by `yaw` radians.
    pub fn from_yaw(translation: DVec3, yaw: f64) -> Pose {
        Pose { translation, rotation: DQuat::from_rotation_z(yaw) }
    }
    /// The motion that undoes this one.
    #[inline]
    pub fn inverse(&self) -> Pose {
        let rotation = self.rotation.inverse();
        Pose { translation: -(rotation * self.translation), rotation }
    }
    /// A point of this frame expressed in the parent.
    #[inline]
    pub fn transform_point(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }
    /// A direction of this frame expressed in the parent.
    #[inline]
    pub fn transform_vector(&self, vector: DVec3) -> DVec3 {
        self.rotation * vector
    }
    /// Heading of the frame's x axis seen from above, radians in (-pi, pi]; of its y axis less a quarter turn where x
    /// points straight up or down and has none.
    ///
    /// ```
    /// # use acm_concept::pose::Pose;
    /// # use glam::{DQuat, DVec3};
    /// let on_end = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2);
    /// assert!((Pose::new(DVec3::ZERO, on_end).yaw() - 0.4).abs() < 1e-9);
    /// ```
    pub fn yaw(&self) -> f64 {
        let x = self.rotation * DVec3::X;
        if x.truncate().length() < 0.05 {
            let y = self.rotation * DVec3::Y;
            return (-y.x).atan2(y.y);
        }
        x.y.atan2(x.x)
    }
    /// Angle of the shortest rotation to `other`, radians in [0, pi].
    pub fn angle_to(&self, other: &Pose) -> f64 {
        self.rotation.angle_between(other.rotation)
    }
    /// Straight-line and shortest-arc interpolation; `fraction` 0 is `self`, 1 is `other`.
    pub fn interpolate(&self, other: &Pose, fraction: f64) -> Pose {
        Pose {
            translation: self.translation.lerp(other.translation, fraction),
            rotation: self.rotation.slerp(other.rotation, fraction),
        }
    }
    /// Whether every number is finite and the quaternion has unit length.
    pub fn is_valid(&self) -> bool {
        self.translation.is_finite() && self.rotation.is_finite() && self.rotation.is_normalized()
    }
    /// The same motion as an affine matrix.
    pub fn to_affine(&self) -> DAffine3 {
        DAffine3::from_rotation_translation(self.rotation, self.translation)
    }
}

impl Default for Pose {
    fn default() -> Self {
        Pose::IDENTITY
    }
}

impl ops::Mul for Pose {
    type Output = Pose;
    fn mul(self, inner: Pose) -> Pose {
        Pose {
            translation: self.transform_point(inner.translation),
            rotation: (self.rotation * inner.rotation).normalize(),
        }
    }
}

/// The angle in (-pi, pi] that equals `angle` modulo a full turn.
pub fn wrap_angle(angle: f64) -> f64 {
    let wrapped = angle.rem_euclid(std::f64::consts::TAU);
    if wrapped > std::f64::consts::PI { wrapped - std::f64::consts::TAU } else { wrapped }
}
