//! Solids of which parts are made, with the queries that fitting and grasping need.

use crate::pose::Pose;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A convex solid centred on its own origin. Metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "shape")]
pub enum Solid {
    /// A cuboid with full edge lengths along x, y, z.
    Box {
        /// Edge lengths, metres.
        size: DVec3,
    },
    /// A cylinder about z.
    Cylinder {
        /// Radius, metres.
        radius: f64,
        /// Full height, metres.
        height: f64,
    },
}

impl Solid {
    /// Signed distance from `point` (in the solid's frame) to the surface, negative inside. Metres.
    ///
    /// ```
    /// # use acm_concept::solid::Solid;
    /// # use glam::DVec3;
    /// let cube = Solid::Box { size: DVec3::splat(0.04) };
    /// assert!((cube.signed_distance(DVec3::new(0.05, 0.0, 0.0)) - 0.03).abs() < 1e-12);
    /// assert!((cube.signed_distance(DVec3::ZERO) + 0.02).abs() < 1e-12);
    /// ```
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        match *self {
            Solid::Box { size } => {
                let q = point.abs() - size * 0.5;
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
            }
            Solid::Cylinder { radius, height } => {
                let radial = point.x.hypot(point.y) - radius;
                let axial = point.z.abs() - height * 0.5;
                radial.max(axial).min(0.0) + radial.max(0.0).hypot(axial.max(0.0))
            }
        }
    }

    /// Distances along the ray at which it enters and leaves the solid, or `None` if it misses it. The ray is
    /// given in the solid's frame; `direction` need not have unit length and distances are in its multiples.
    /// An entry behind the origin is negative.
    pub fn intersect_ray(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let slab = |o: f64, d: f64, half: f64| -> Option<(f64, f64)> {
            if d.abs() < 1e-12 {
                return (o.abs() <= half).then_some((f64::NEG_INFINITY, f64::INFINITY));
            }
            let (a, b) = ((-half - o) / d, (half - o) / d);
            Some((a.min(b), a.max(b)))
        };
        let (enter, leave) = match *self {
            Solid::Box { size } => {
                let h = size * 0.5;
                let (x, y, z) = (
                    slab(origin.x, direction.x, h.x)?,
                    slab(origin.y, direction.y, h.y)?,
                    slab(origin.z, direction.z, h.z)?,
                );
                (x.0.max(y.0).max(z.0), x.1.min(y.1).min(z.1))
            }
            Solid::Cylinder { radius, height } => {
                let z = slab(origin.z, direction.z, height * 0.5)?;
                let a = direction.x.powi(2) + direction.y.powi(2);
                let b = origin.x * direction.x + origin.y * direction.y;
                let c = origin.x.powi(2) + origin.y.powi(2) - radius * radius;
                let side = if a < 1e-18 {
                    (c <= 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY))?
                } else {
                    let discriminant = b * b - a * c;
                    if discriminant < 0.0 {
                        return None;
                    }
                    let root = discriminant.sqrt();
                    ((-b - root) / a, (-b + root) / a)
                };
                (z.0.max(side.0), z.1.min(side.1))
            }
        };
        (enter <= leave && leave >= 0.0).then_some((enter, leave))
    }

    /// Half of the extents of the axis-aligned box round the solid. Metres.
    pub fn half_extents(&self) -> DVec3 {
        match *self {
            Solid::Box { size } => size * 0.5,
            Solid::Cylinder { radius, height } => DVec3::new(radius, radius, height * 0.5),
        }
    }
    /// Radius of the sphere round the solid. Metres.
    pub fn bounding_radius(&self) -> f64 {
        match *self {
            Solid::Box { size } => size.length() * 0.5,
            Solid::Cylinder { radius, height } => radius.hypot(height * 0.5),
        }
    }
    /// Volume in cubic metres.
    pub fn volume(&self) -> f64 {
        match *self {
            Solid::Box { size } => size.x * size.y * size.z,
            Solid::Cylinder { radius, height } => std::f64::consts::PI * radius * radius * height,
        }
    }
}

/// A solid with a pose in some parent frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlacedSolid {
    /// The solid.
    pub solid: Solid,
    /// Pose of the solid's centre frame in the parent.
    pub pose: Pose,
}

impl PlacedSolid {
    /// Signed distance from a point of the parent frame, negative inside. Metres.
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        self.solid.signed_distance(self.pose.inverse().transform_point(point))
    }
    /// Half of the extents, along the parent's axes, of the smallest box round the solid. Metres.
    ///
    /// ```
    /// # use acm_concept::{pose::Pose, solid::{PlacedSolid, Solid}};
    /// # use glam::{DQuat, DVec3};
    /// let turn = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    /// let lying = PlacedSolid {
    ///     solid: Solid::Cylinder { radius: 0.03, height: 0.1 },
    ///     pose: Pose::new(DVec3::ZERO, turn),
    /// };
    /// assert!(lying.half_extents().distance(DVec3::new(0.03, 0.05, 0.03)) < 1e-12);
    /// ```
    pub fn half_extents(&self) -> DVec3 {
        let axis = |unit: DVec3| self.pose.transform_vector(unit);
        match self.solid {
            Solid::Box { size } => {
                let half = size * 0.5;
                axis(DVec3::X).abs() * half.x + axis(DVec3::Y).abs() * half.y + axis(DVec3::Z).abs() * half.z
            }
            Solid::Cylinder { radius, height } => {
                let along = axis(DVec3::Z);
                let round = (DVec3::ONE - along * along).max(DVec3::ZERO).map(f64::sqrt);
                round * radius + along.abs() * (0.5 * height)
            }
        }
    }
    /// As [`Solid::intersect_ray`], with the ray in the parent frame.
    pub fn intersect_ray(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let inverse = self.pose.inverse();
        self.solid.intersect_ray(inverse.transform_point(origin), inverse.transform_vector(direction))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_ray_enters_on_the_surface(
            x in -0.3..0.3f64, y in -0.3..0.3f64, z in 0.2..0.5f64, tx in -0.05..0.05f64, ty in -0.05..0.05f64,
            cylinder in any::<bool>(),
        ) {
            let solid = if cylinder { Solid::Cylinder { radius: 0.06, height: 0.1 } } else { Solid::Box { size: DVec3::new(0.12, 0.14, 0.1) } };
            let (origin, target) = (DVec3::new(x, y, z), DVec3::new(tx * 0.8, ty * 0.8, 0.0));
            let (enter, leave) = solid.intersect_ray(origin, target - origin).unwrap();
            for t in [enter, leave] {
                prop_assert!(solid.signed_distance(origin + (target - origin) * t).abs() < 1e-9);
            }
            prop_assert!(solid.signed_distance(origin + (target - origin) * (0.5 * (enter + leave))) < 0.0);
        }
    }

    #[test]
    fn a_ray_that_points_away_misses() {
        let solid = Solid::Box { size: DVec3::splat(0.1) };
        assert_eq!(solid.intersect_ray(DVec3::new(0.0, 0.0, 1.0), DVec3::Z), None);
        assert_eq!(solid.intersect_ray(DVec3::new(0.2, 0.0, 1.0), -DVec3::Z), None);
    }
}
