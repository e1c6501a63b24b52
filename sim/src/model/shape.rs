//! The shapes that links are made of: what they measure, how they scale, what the engine collides.

use crate::convert::vector;
use acm_concept::{
    pose::Pose,
    solid::{Enclosure, PlacedSolid, Solid},
};
use acm_render::Mesh;
use glam::{DQuat, DVec3, Vec3};
use rapier3d::parry::shape::SharedShape;
use std::{f64::consts::PI, fmt, sync::Arc};

/// A shape about its own origin. Metres.
#[derive(Debug, Clone)]
pub(crate) enum Shape {
    /// A box or a cylinder about z.
    Solid(Solid),
    /// Two half balls about z, `height` apart.
    Capsule { radius: f64, height: f64 },
    /// A ball.
    Ball { radius: f64 },
    /// A convex body that is felt and not seen.
    Hull(Arc<Hull>),
    /// A surface that is seen and not felt.
    Surface { mesh: Arc<Mesh>, scale: DVec3 },
}

/// The convex hull of some points.
#[derive(Clone)]
pub(crate) struct Hull {
    pub(crate) points: Vec<Vec3>,
    pub(crate) volume_m3: f64,
    shape: SharedShape,
}

impl fmt::Debug for Hull {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Hull of {} points", self.points.len())
    }
}

impl Hull {
    /// `None` for points that enclose no volume.
    pub(crate) fn new(points: &[Vec3]) -> Option<Hull> {
        let shape = SharedShape::convex_hull(points)?;
        let points = shape.as_convex_polyhedron()?.points().to_vec();
        let volume_m3 = f64::from(shape.mass_properties(1.0).mass());
        (volume_m3.is_finite() && volume_m3 > 0.0).then_some(Hull { points, volume_m3, shape })
    }
}

impl Shape {
    /// Stretched along its own axes; a cylinder, capsule or ball keeps its kind.
    pub(crate) fn scaled(&self, scale: DVec3) -> Shape {
        if scale == DVec3::ONE {
            return self.clone();
        }
        let across = (scale.x * scale.y).sqrt();
        match self {
            Shape::Solid(solid) => Shape::Solid(match solid.enclosure() {
                Enclosure::Box { size } => Solid::Box { size: size * scale },
                Enclosure::Cylinder { radius, height } => {
                    Solid::Cylinder { radius: radius * across, height: height * scale.z }
                }
            }),
            Shape::Capsule { radius, height } => Shape::Capsule { radius: radius * across, height: height * scale.z },
            Shape::Ball { radius } => Shape::Ball { radius: radius * scale.element_product().cbrt() },
            Shape::Hull(hull) => {
                let points: Vec<Vec3> = hull.points.iter().map(|point| *point * scale.as_vec3()).collect();
                // A stretched body of some volume still has some.
                Shape::Hull(Hull::new(&points).map_or_else(|| hull.clone(), Arc::new))
            }
            Shape::Surface { mesh, scale: old } => Shape::Surface { mesh: mesh.clone(), scale: *old * scale },
        }
    }

    /// Smallest and largest coordinates when it stands at a pose.
    pub(crate) fn bounds(&self, pose: &Pose) -> (DVec3, DVec3) {
        let around = |half: DVec3| (pose.translation - half, pose.translation + half);
        match self {
            Shape::Solid(solid) => around(PlacedSolid { solid: *solid, pose: *pose }.half_extents()),
            Shape::Capsule { radius, height } => {
                let along = pose.transform_vector(DVec3::Z).abs() * (0.5 * height);
                around(along + DVec3::splat(*radius))
            }
            Shape::Ball { radius } => around(DVec3::splat(*radius)),
            Shape::Hull(hull) => bounds(hull.points.iter().map(|point| pose.transform_point(point.as_dvec3()))),
            Shape::Surface { mesh, scale } => {
                bounds(mesh.positions().iter().map(|point| pose.transform_point(point.as_dvec3() * *scale)))
            }
        }
    }

    /// Volume in cubic metres; 0 for a mere surface.
    pub(crate) fn volume(&self) -> f64 {
        match self {
            Shape::Solid(solid) => solid.volume(),
            Shape::Capsule { radius, height } => PI * radius * radius * (height + 4.0 / 3.0 * radius),
            Shape::Ball { radius } => 4.0 / 3.0 * PI * radius.powi(3),
            Shape::Hull(hull) => hull.volume_m3,
            Shape::Surface { .. } => 0.0,
        }
    }

    /// The engine's shape and its frame in this one; `None` for a mere surface. `bevel_m` cuts a box's edges.
    pub(crate) fn collision(&self, bevel_m: f64) -> Option<(Pose, SharedShape)> {
        Some(match self {
            Shape::Solid(solid) => shape(solid, bevel_m),
            Shape::Capsule { radius, height } => {
                let half = vector(DVec3::Z * (0.5 * height));
                (Pose::IDENTITY, SharedShape::capsule(-half, half, *radius as f32))
            }
            Shape::Ball { radius } => (Pose::IDENTITY, SharedShape::ball(*radius as f32)),
            Shape::Hull(hull) => (Pose::IDENTITY, hull.shape.clone()),
            Shape::Surface { .. } => return None,
        })
    }
}

/// Smallest and largest coordinates of some points.
pub(crate) fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points.fold(start, |(low, high), point| (low.min(point), high.max(point)))
}

/// The collision shape of a solid, and the shape's own frame in the solid's: the engine's cylinders stand along y.
pub(crate) fn shape(solid: &Solid, bevel_m: f64) -> (Pose, SharedShape) {
    match solid.enclosure() {
        Enclosure::Box { size } => {
            let half = (size * 0.5 - DVec3::splat(bevel_m)).as_vec3();
            let shape = if bevel_m > 0.0 {
                SharedShape::round_cuboid(half.x, half.y, half.z, bevel_m as f32)
            } else {
                SharedShape::cuboid(half.x, half.y, half.z)
            };
            (Pose::IDENTITY, shape)
        }
        Enclosure::Cylinder { radius, height } => {
            let z_up = Pose::new(DVec3::ZERO, DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2));
            (z_up, SharedShape::cylinder((height * 0.5) as f32, radius as f32))
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    fn cube() -> Hull {
        let corner = |at: usize, axis: usize| if at >> axis & 1 == 1 { 0.1 } else { -0.1 };
        let points: Vec<Vec3> = (0..8).map(|at| Vec3::new(corner(at, 0), corner(at, 1), corner(at, 2))).collect();
        Hull::new(&points).unwrap()
    }

    #[test]
    fn a_hull_knows_its_volume_and_stretches() {
        let hull = Shape::Hull(Arc::new(cube()));
        assert!((hull.volume() - 0.008).abs() < 1e-6, "{}", hull.volume());
        let long = hull.scaled(DVec3::new(2.0, 1.0, 0.5));
        assert!((long.volume() - 0.008).abs() < 1e-6);
        let (low, high) = long.bounds(&Pose::from_translation(DVec3::Z));
        assert!((high - low).distance(DVec3::new(0.4, 0.2, 0.1)) < 1e-6 && (high.z - 1.05).abs() < 1e-6);
        assert!(Hull::new(&[Vec3::ZERO, Vec3::X, Vec3::Y]).is_none(), "a triangle has no volume");
    }

    #[test]
    fn a_capsule_that_lies_is_long_and_low() {
        let lying = Pose::new(DVec3::ZERO, DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2));
        let (low, high) = Shape::Capsule { radius: 0.01, height: 0.1 }.bounds(&lying);
        assert!((high - low).distance(DVec3::new(0.12, 0.02, 0.02)) < 1e-9);
    }
}
