//! The outer shape of a grounded object: what relations and comparisons are computed from.

use acm_concept::{
    object::GroundedPart,
    pose::{Pose, wrap_angle},
    solid::{Enclosure, PlacedSolid},
    template::{TemplateLibrary, YawSymmetry},
};
use glam::{DVec2, DVec3};

/// Affordance of what holds things within its walls.
const CONTAINS: &str = "contains";

/// Outline of an object seen from above, round its own centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outline {
    /// A rectangle with the given half sides along the body's own axes, metres.
    Rectangle(DVec2),
    /// A circle with the given radius, metres.
    Disc(f64),
}

/// The upright prism that encloses an object. World frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Centre of the outline, seen from above.
    pub centre: DVec2,
    /// Heading of the outline's axes, radians.
    pub yaw: f64,
    /// The outline.
    pub outline: Outline,
    /// Height of its lowest point, world z.
    pub base_m: f64,
    /// Height of its highest point, world z.
    pub top_m: f64,
    /// Whether things lie within its walls.
    pub contains: bool,
}

impl Body {
    /// Encloses the solids of all parts; `None` where a template is not in the library, cannot be evaluated, or
    /// there are no parts.
    pub fn of(parts: &[GroundedPart], library: &TemplateLibrary) -> Option<Body> {
        let main = parts.first()?.pose.pose;
        let upright = Pose::from_yaw(main.translation, main.yaw());
        let into_main = upright.inverse();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut radius = Some(0.0f64);
        for part in parts {
            for placed in library.solids_of(part)? {
                let pose = into_main * part.pose.pose * placed.pose;
                let ends = PlacedSolid { solid: placed.solid, pose }.bounds();
                (low, high) = (low.min(ends.0), high.max(ends.1));
                radius = match (radius, placed.solid.enclosure()) {
                    (Some(largest), Enclosure::Cylinder { radius, .. })
                        if pose.translation.truncate().length() < 1e-3
                            && pose.transform_vector(DVec3::Z).z.abs() > 0.99 =>
                    {
                        Some(largest.max(radius))
                    }
                    _ => None,
                };
            }
        }
        if !(low.is_finite() && high.is_finite()) {
            return None;
        }
        let middle = upright.transform_point((low + high) * 0.5);
        Some(Body {
            centre: middle.truncate(),
            yaw: upright.yaw(),
            outline: radius.map_or(Outline::Rectangle((high - low).truncate() * 0.5), Outline::Disc),
            base_m: main.translation.z + low.z,
            top_m: main.translation.z + high.z,
            contains: parts.iter().any(|part| part.affordances.iter().any(|affordance| affordance == CONTAINS)),
        })
    }
    /// Longer side, shorter side and height, metres.
    pub fn extents(&self) -> [f64; 3] {
        let (a, b) = match self.outline {
            Outline::Rectangle(half) => (2.0 * half.max_element(), 2.0 * half.min_element()),
            Outline::Disc(radius) => (2.0 * radius, 2.0 * radius),
        };
        [a, b, self.height()]
    }
    /// Height, metres.
    pub fn height(&self) -> f64 {
        self.top_m - self.base_m
    }
    /// Area of the outline, square metres.
    pub fn area(&self) -> f64 {
        match self.outline {
            Outline::Rectangle(half) => 4.0 * half.x * half.y,
            Outline::Disc(radius) => std::f64::consts::PI * radius * radius,
        }
    }
    /// Whether a point seen from above lies in the outline grown by `margin_m`.
    pub fn covers(&self, point: DVec2, margin_m: f64) -> bool {
        let local = DVec2::from_angle(-self.yaw).rotate(point - self.centre);
        match self.outline {
            Outline::Rectangle(half) => local.abs().cmple(half + margin_m).all(),
            Outline::Disc(radius) => local.length() <= radius + margin_m,
        }
    }
    /// Gap between two outlines along the line of their centres, metres; negative where they overlap.
    pub fn gap(&self, other: &Body) -> f64 {
        let between = other.centre - self.centre;
        let Some(direction) = between.try_normalize() else { return -self.reach(DVec2::X) - other.reach(DVec2::X) };
        between.length() - self.reach(direction) - other.reach(direction)
    }
    fn reach(&self, direction: DVec2) -> f64 {
        let local = DVec2::from_angle(-self.yaw).rotate(direction).abs();
        match self.outline {
            Outline::Rectangle(half) => half.dot(local),
            Outline::Disc(radius) => radius,
        }
    }
}

/// What two measurements of one wall differ by, sideways, and of one floor, upwards; metres.
const SAME_WALL_M: f64 = 0.006;
const SAME_FLOOR_M: f64 = 0.003;

/// The share of the solids of `parts` that lies in the solids of `other`, or as near as two measurements of one surface do:
/// of points spread evenly in their boxes. What stands within walls shares nothing with them, and little with the floor.
pub(crate) fn shared(parts: &[GroundedPart], other: &[GroundedPart], library: &TemplateLibrary) -> f64 {
    let solids = |parts: &[GroundedPart]| -> Vec<PlacedSolid> {
        let placed = parts.iter().filter_map(|part| Some((part.pose.pose, library.solids_of(part)?)));
        let own = |(at, own): (Pose, Vec<PlacedSolid>)| {
            own.into_iter().map(move |s| PlacedSolid { solid: s.solid, pose: at * s.pose })
        };
        placed.flat_map(own).collect()
    };
    let others = solids(other);
    let beside = [DVec2::ZERO, DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(|side| side * SAME_WALL_M);
    let is_in = |point: DVec3| {
        let near = |side: &DVec2| others.iter().any(|o| o.signed_distance(point + side.extend(0.0)) < SAME_FLOOR_M);
        beside.iter().any(near)
    };
    let (mut inside, mut all) = (0usize, 0usize);
    for solid in solids(parts) {
        let half = solid.solid.half_extents();
        for step in 0..27 {
            let share = |axis: u32| f64::from((step / 3i32.pow(axis)) % 3 - 1) * 0.8;
            let point = solid.pose.transform_point(DVec3::new(share(0), share(1), share(2)) * half);
            all += 1;
            inside += usize::from(is_in(point));
        }
    }
    inside as f64 / all.max(1) as f64
}

/// The symmetry of a grounded part; a part whose template cannot say is taken to have none.
pub fn symmetry(part: &GroundedPart, library: &TemplateLibrary) -> YawSymmetry {
    library
        .get(&part.template)
        .and_then(|template| template.symmetry_at(&part.values(), part.pose.pose.rotation).ok())
        .unwrap_or(YawSymmetry::Fold(1))
}

/// The rigid motion seen from above that carries `from` to `to`, turning as little as the symmetry allows.
pub fn upright_motion(from: &Pose, to: &Pose, symmetry: YawSymmetry) -> Pose {
    let turn = match symmetry {
        YawSymmetry::Continuous => 0.0,
        fold => wrap_angle(fold.nearest(to.yaw(), from.yaw()) - from.yaw()),
    };
    Pose::from_translation(to.translation)
        * Pose::from_yaw(DVec3::ZERO, turn)
        * Pose::from_translation(-from.translation)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use crate::{default_library, staging::Thing};
    use proptest::prelude::*;

    #[test]
    fn bodies_follow_parameters_pose_and_heading() {
        let library = default_library().unwrap();
        let block = Thing::block([0.06, 0.03, 0.02]).at(0.1, 0.2, 0.0).turned(std::f64::consts::FRAC_PI_2);
        let body = Body::of(&block.parts(), &library).unwrap();
        assert!((body.extents()[0] - 0.06).abs() < 1e-9 && (body.top_m - 0.02).abs() < 1e-9);
        assert!(body.covers(DVec2::new(0.1, 0.229), 0.0) && !body.covers(DVec2::new(0.129, 0.2), 0.0));
        let can = Thing::can(0.03, 0.1).at(0.0, 0.0, 0.0);
        assert_eq!(Body::of(&can.parts(), &library).unwrap().outline, Outline::Disc(0.03));
        assert_eq!(Body::of(&[], &library), None);
    }

    #[test]
    fn the_gap_of_neighbours_is_the_space_between_them() {
        let library = default_library().unwrap();
        let body = |x| Body::of(&Thing::block([0.04, 0.04, 0.04]).at(x, 0.0, 0.0).parts(), &library).unwrap();
        assert!((body(0.0).gap(&body(0.1)) - 0.06).abs() < 1e-9);
        assert!(body(0.0).gap(&body(0.02)) < 0.0);
    }

    proptest! {
        #[test]
        fn the_upright_motion_carries_one_pose_to_the_other(x in -1.0..1.0f64, y in -1.0..1.0f64, a in -3.0..3.0f64, b in -3.0..3.0f64) {
            let (from, to) = (Pose::from_yaw(DVec3::new(x, y, 0.1), a), Pose::from_yaw(DVec3::new(y, x, 0.2), b));
            let carried = upright_motion(&from, &to, YawSymmetry::Fold(1)) * from;
            prop_assert!(carried.translation.distance(to.translation) < 1e-9);
            prop_assert!(carried.angle_to(&to) < 1e-6);
            let folded = upright_motion(&from, &to, YawSymmetry::Fold(4)) * from;
            prop_assert!(YawSymmetry::Fold(4).difference(folded.yaw(), to.yaw()) < 1e-6);
            prop_assert!(folded.angle_to(&from) <= std::f64::consts::FRAC_PI_4 + 1e-6);
        }
    }
}
