//! Solids of which parts are made, with the queries that fitting and grasping need.

mod ellipsoid;
mod profile;

pub use profile::{PROFILE_CORNERS, Profile};

use crate::pose::Pose;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A solid centred on its own origin. Metres.
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
    /// An ellipsoid; a ball if its three sizes are equal.
    Ellipsoid {
        /// Full lengths of its axes along x, y, z.
        size: DVec3,
    },
    /// What a profile sweeps when it turns about z. It may be hollow.
    Revolved {
        /// The profile, radius and height.
        profile: Profile,
    },
}

/// A plain convex solid round another one, with the same centre and axes: for whoever reckons with plain ones alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Enclosure {
    /// A cuboid with full edge lengths along x, y, z. Metres.
    Box {
        /// Edge lengths, metres.
        size: DVec3,
    },
    /// A cylinder about z. Metres.
    Cylinder {
        /// Radius, metres.
        radius: f64,
        /// Full height, metres.
        height: f64,
    },
}

impl Solid {
    /// A cone cut off by two level planes, of these radii at its lower and upper end. Metres.
    ///
    /// ```
    /// # use acm_concept::solid::Solid;
    /// # use glam::DVec3;
    /// let cone = Solid::cone(0.04, 0.02, 0.1);
    /// assert!(cone.signed_distance(DVec3::new(0.03, 0.0, 0.0)).abs() < 1e-12);
    /// assert_eq!(cone.half_extents(), DVec3::new(0.04, 0.04, 0.05));
    /// ```
    pub fn cone(radius_bottom: f64, radius_top: f64, height: f64) -> Solid {
        let corner = |r, z| DVec2::new(r, z * height);
        let corners = [corner(0.0, -0.5), corner(radius_bottom, -0.5), corner(radius_top, 0.5), corner(0.0, 0.5)];
        Solid::revolved(&corners).map_or(Solid::Cylinder { radius: radius_bottom, height }, |(solid, _)| solid)
    }
    /// The solid that corners (radius, height) sweep about z, and the height at which its centre lies; `None` for fewer or
    /// more corners than [`PROFILE_CORNERS`].
    pub fn revolved(corners: &[DVec2]) -> Option<(Solid, f64)> {
        Profile::centred(corners).map(|(profile, middle)| (Solid::Revolved { profile }, middle))
    }
    /// The smallest box or upright cylinder round the solid.
    pub fn enclosure(&self) -> Enclosure {
        match *self {
            Solid::Box { size } | Solid::Ellipsoid { size } => Enclosure::Box { size },
            Solid::Cylinder { radius, height } => Enclosure::Cylinder { radius, height },
            Solid::Revolved { profile } => Enclosure::Cylinder { radius: profile.radius(), height: profile.height() },
        }
    }
    /// Signed distance from `point` (in the solid's frame) to the surface, negative inside. Metres.
    ///
    /// ```
    /// # use acm_concept::solid::Solid;
    /// # use glam::DVec3;
    /// let cube = Solid::Box { size: DVec3::splat(0.04) };
    /// assert!((cube.signed_distance(DVec3::new(0.05, 0.0, 0.0)) - 0.03).abs() < 1e-12);
    /// assert!((cube.signed_distance(DVec3::ZERO) + 0.02).abs() < 1e-12);
    /// ```
    #[inline]
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
            Solid::Ellipsoid { size } => ellipsoid::signed_distance(size * 0.5, point),
            Solid::Revolved { profile } => profile.signed_distance(DVec2::new(point.x.hypot(point.y), point.z)),
        }
    }

    /// Distances along the ray at which it enters and leaves the solid, or `None` if it misses it. The ray is
    /// given in the solid's frame; `direction` need not have unit length and distances are in its multiples.
    /// An entry behind the origin is negative. Of a hollow solid it is the first stretch that does not end behind the
    /// origin.
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
            Solid::Ellipsoid { size } => {
                // In units of its half axes it is a ball.
                let (from, way) = (origin * 2.0 / size, direction * 2.0 / size);
                let (a, b, c) = (way.length_squared(), from.dot(way), from.length_squared() - 1.0);
                let discriminant = b * b - a * c;
                if discriminant < 0.0 || a <= 0.0 {
                    return None;
                }
                ((-b - discriminant.sqrt()) / a, (-b + discriminant.sqrt()) / a)
            }
            Solid::Revolved { profile } => {
                // The plain cylinder round it is missed by most rays.
                let round = Solid::Cylinder { radius: profile.radius(), height: profile.height() };
                round.intersect_ray(origin, direction)?;
                profile.intersect_ray(origin, direction)?
            }
        };
        (enter <= leave && leave >= 0.0).then_some((enter, leave))
    }

    /// Half of the extents of the axis-aligned box round the solid. Metres.
    pub fn half_extents(&self) -> DVec3 {
        match self.enclosure() {
            Enclosure::Box { size } => size * 0.5,
            Enclosure::Cylinder { radius, height } => DVec3::new(radius, radius, height * 0.5),
        }
    }
    /// Radius of the sphere round the solid. Metres.
    pub fn bounding_radius(&self) -> f64 {
        match *self {
            Solid::Box { size } => size.length() * 0.5,
            Solid::Cylinder { radius, height } => radius.hypot(height * 0.5),
            Solid::Ellipsoid { size } => size.max_element() * 0.5,
            Solid::Revolved { profile } => profile.corners().iter().map(|c| c.length()).fold(0.0, f64::max),
        }
    }
    /// How far the solid reaches from its centre along a unit direction of its own frame. Metres.
    pub fn reach(&self, direction: DVec3) -> f64 {
        let across = direction.x.hypot(direction.y);
        match *self {
            Solid::Box { size } => (direction.abs() * size * 0.5).element_sum(),
            Solid::Cylinder { radius, height } => across * radius + direction.z.abs() * height * 0.5,
            Solid::Ellipsoid { size } => (direction * size * 0.5).length(),
            Solid::Revolved { profile } => {
                profile.corners().iter().map(|c| across * c.x + direction.z * c.y).fold(f64::NEG_INFINITY, f64::max)
            }
        }
    }
    /// Volume in cubic metres.
    pub fn volume(&self) -> f64 {
        match *self {
            Solid::Box { size } => size.x * size.y * size.z,
            Solid::Cylinder { radius, height } => std::f64::consts::PI * radius * radius * height,
            Solid::Ellipsoid { size } => std::f64::consts::PI / 6.0 * size.element_product(),
            Solid::Revolved { profile } => profile.volume(),
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
    #[inline]
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        self.solid.signed_distance(self.pose.inverse().transform_point(point))
    }
    /// The lowest and highest coordinates of the solid along the parent's axes. Metres.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let reach = |unit: DVec3| self.solid.reach(self.pose.rotation.inverse() * unit);
        let low = DVec3::new(reach(-DVec3::X), reach(-DVec3::Y), reach(-DVec3::Z));
        let high = DVec3::new(reach(DVec3::X), reach(DVec3::Y), reach(DVec3::Z));
        (self.pose.translation - low, self.pose.translation + high)
    }
    /// Half of the extents, along the parent's axes, of the smallest box about the solid's centre that holds it. Metres.
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
        let along = |unit: DVec3| {
            let unit = self.pose.rotation.inverse() * unit;
            self.solid.reach(unit).max(self.solid.reach(-unit))
        };
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
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

    fn revolved(corners: &[(f64, f64)]) -> Solid {
        let corners: Vec<DVec2> = corners.iter().map(|(r, z)| DVec2::new(*r, *z)).collect();
        Solid::revolved(&corners).unwrap().0
    }
    /// One of each kind, all about as large.
    fn solids() -> [Solid; 7] {
        [
            Solid::Box { size: DVec3::new(0.12, 0.14, 0.1) },
            Solid::Cylinder { radius: 0.06, height: 0.1 },
            Solid::Ellipsoid { size: DVec3::new(0.14, 0.1, 0.06) },
            Solid::cone(0.07, 0.02, 0.1),
            Solid::cone(0.05, 0.0, 0.12),
            // A cup, drawn clockwise, and a ring.
            revolved(&[(0.0, 0.005), (0.035, 0.005), (0.045, 0.1), (0.05, 0.1), (0.04, 0.0), (0.0, 0.0)]),
            revolved(&[(0.03, 0.0), (0.06, 0.0), (0.06, 0.02), (0.03, 0.02)]),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]
        #[test]
        fn rays_and_distances_agree(
            kind in 0..7usize, from in prop::array::uniform3(-0.3..0.3f64), to in prop::array::uniform3(-0.08..0.08f64),
        ) {
            let solid = solids()[kind];
            let (origin, way) = (DVec3::from(from), DVec3::from(to) - DVec3::from(from));
            prop_assume!(way.length() > 0.01);
            let along = |t: f64| solid.signed_distance(origin + way * t);
            let met = solid.intersect_ray(origin, way);
            if let Some((enter, leave)) = met {
                prop_assert!(along(enter).abs() < 1e-8 && along(leave).abs() < 1e-8, "{} {}", along(enter), along(leave));
                prop_assert!(along(0.5 * (enter + leave)) <= 1e-12 && leave >= 0.0);
            }
            // Up to where it enters, and for ever if it does not, the way is free.
            let free_to = met.map_or(3.0, |(enter, _)| enter);
            for step in (0..200).take_while(|_| free_to > 0.0) {
                let t = free_to * f64::from(step) / 200.0;
                prop_assert!(along(t) > -1e-9, "inside by {} at {t}", -along(t));
            }
        }

        #[test]
        fn distances_change_no_faster_than_places(
            kind in 0..7usize, a in prop::array::uniform3(-0.1..0.1f64), b in prop::array::uniform3(-0.1..0.1f64),
        ) {
            let (solid, a, b) = (solids()[kind], DVec3::from(a), DVec3::from(b));
            let (at_a, at_b) = (solid.signed_distance(a), solid.signed_distance(b));
            prop_assert!((at_a - at_b).abs() <= a.distance(b) + 1e-7);
            // From outside the nearest surface is as far as the distance says: a step of that length along its gradient ends there.
            let slope = |axis: DVec3| solid.signed_distance(a + axis * 1e-6) - solid.signed_distance(a - axis * 1e-6);
            let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)) / 2e-6;
            if at_a > 1e-3 && (gradient.length() - 1.0).abs() < 1e-4 {
                prop_assert!(solid.signed_distance(a - gradient * at_a).abs() < 1e-4);
            }
        }

        #[test]
        fn a_turned_solid_touches_all_sides_of_its_bounds(kind in 0..7usize, turn in prop::array::uniform3(-3.0..3.0f64)) {
            let pose = Pose::new(DVec3::new(0.1, 0.2, 0.3), glam::DQuat::from_scaled_axis(turn.into()));
            let placed = PlacedSolid { solid: solids()[kind], pose };
            let (low, high) = placed.bounds();
            // Rays from far away, parallel to x: the first that any of them meets is at the bound.
            let mut first = f64::INFINITY;
            for (i, j) in (0..=60).flat_map(|i| (0..=60).map(move |j| (f64::from(i) / 60.0, f64::from(j) / 60.0))) {
                let from = DVec3::new(-1.0, low.y + i * (high.y - low.y), low.z + j * (high.z - low.z));
                if let Some((enter, _)) = placed.intersect_ray(from, DVec3::X) {
                    first = first.min(enter - 1.0);
                }
            }
            prop_assert!(first >= low.x - 1e-9 && first < low.x + 6e-3, "{first} for {}", low.x);
        }
    }

    #[test]
    fn volumes_are_those_of_the_formulas() {
        use std::f64::consts::PI;
        let near = |solid: Solid, volume: f64| assert!((solid.volume() / volume - 1.0).abs() < 1e-9, "{solid:?}");
        near(Solid::cone(0.05, 0.0, 0.12), PI * 0.05 * 0.05 * 0.12 / 3.0);
        near(Solid::Ellipsoid { size: DVec3::splat(0.1) }, PI * 0.001 / 6.0);
        near(revolved(&[(0.03, 0.0), (0.06, 0.0), (0.06, 0.02), (0.03, 0.02)]), PI * (0.0036 - 0.0009) * 0.02);
    }

    #[test]
    fn a_profile_is_written_as_its_corners_and_checked_when_read() {
        let [.., ring] = solids();
        let text = serde_json::to_string(&ring).unwrap();
        assert!(text.starts_with("{\"shape\":\"revolved\",\"profile\":[["), "{text}");
        assert_eq!(serde_json::from_str::<Solid>(&text).unwrap(), ring);
        let wrong = serde_json::from_str::<Solid>("{\"shape\":\"revolved\",\"profile\":[[0.0,0.0]]}");
        assert!(wrong.unwrap_err().to_string().contains("3 to 12"));
    }

    #[test]
    fn a_ray_that_points_away_misses() {
        let solid = Solid::Box { size: DVec3::splat(0.1) };
        assert_eq!(solid.intersect_ray(DVec3::new(0.0, 0.0, 1.0), DVec3::Z), None);
        assert_eq!(solid.intersect_ray(DVec3::new(0.2, 0.0, 1.0), -DVec3::Z), None);
    }
}
