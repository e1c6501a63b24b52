//! Plain geometry over remembered solids: outlines seen from above, tops, overlaps.

use acm_concept::{
    pose::Pose,
    solid::{Enclosure, PlacedSolid},
    template::YawSymmetry,
};
use acm_memory::{MemoryView, entry::ObjectEntry};
use glam::{DVec2, DVec3};

/// Corners of the polygon that stands for a circle.
const CIRCLE_CORNERS: u32 = 12;

/// Solids of an object whose main part's base frame is at `base`, in the world.
pub(crate) fn solids_at(view: &dyn MemoryView, entry: &ObjectEntry, base: &Pose) -> Vec<PlacedSolid> {
    let Some(main) = entry.pose() else { return Vec::new() };
    let shift = *base * main.inverse();
    let mut placed = Vec::new();
    for part in &entry.parts {
        // A template file is checked when it is read; an expression that still has no value bounds nothing.
        for solid in view.library().solids_of(part).unwrap_or_default() {
            placed.push(PlacedSolid { solid: solid.solid, pose: shift * part.pose.pose * solid.pose });
        }
    }
    placed
}

/// What an object takes up: convex outlines seen from above, with lowest and highest z.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Extent {
    pub outlines: Vec<Vec<DVec2>>,
    pub low: f64,
    pub high: f64,
}

impl Extent {
    /// Of an object as if its base frame were at `base`; `None` without solids.
    pub fn at(view: &dyn MemoryView, entry: &ObjectEntry, base: &Pose) -> Option<Extent> {
        let solids = solids_at(view, entry, base);
        let outlines: Vec<Vec<DVec2>> = solids.iter().map(outline).collect();
        let (low, high) = solids.iter().map(z_range).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        Some(Extent { outlines, low, high })
    }
    /// Where it stands now; `None` without solids.
    pub fn now(view: &dyn MemoryView, entry: &ObjectEntry) -> Option<Extent> {
        Extent::at(view, entry, &entry.pose()?)
    }
    /// Distance between two extents seen from above, metres; negative where they overlap.
    pub fn gap(&self, other: &Extent) -> f64 {
        let pairs = self.outlines.iter().flat_map(|a| other.outlines.iter().map(move |b| separation(a, b)));
        pairs.fold(f64::INFINITY, f64::min)
    }
    /// How far the two share heights, metres; negative where one ends below the other.
    pub fn shared_height(&self, other: &Extent) -> f64 {
        self.high.min(other.high) - self.low.max(other.low)
    }
    /// Whether a point lies inside an outline.
    pub fn covers(&self, point: DVec2) -> bool {
        self.outlines.iter().any(|outline| separation(outline, &[point]) <= 0.0)
    }
    /// Length along an axis seen from above, metres; zero without outlines.
    pub fn span(&self, axis: DVec2) -> f64 {
        let along = self.outlines.iter().flatten().map(|corner| corner.dot(axis));
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        (high - low).max(0.0)
    }
    /// Largest half extent seen from above, from the middle of the corners, metres.
    pub fn radius(&self) -> f64 {
        let corners: Vec<DVec2> = self.outlines.iter().flatten().copied().collect();
        let middle = corners.iter().sum::<DVec2>() / corners.len().max(1) as f64;
        corners.iter().map(|corner| corner.distance(middle)).fold(0.0, f64::max)
    }
}

/// The place on top of an object at its middle, as the pose of what would stand there, turned like the object.
pub(crate) fn top_centre(view: &dyn MemoryView, entry: &ObjectEntry) -> Option<Pose> {
    let pose = entry.pose()?;
    let extent = Extent::now(view, entry)?;
    Some(Pose::from_yaw(DVec3::new(pose.translation.x, pose.translation.y, extent.high), pose.yaw()))
}

/// Volume of an object's solids, cubic metres.
pub(crate) fn volume(view: &dyn MemoryView, entry: &ObjectEntry) -> f64 {
    let volume_of = |placed: &PlacedSolid| placed.solid.volume();
    entry.pose().map_or(0.0, |pose| solids_at(view, entry, &pose).iter().map(volume_of).sum())
}

/// How the headings of an object's main part are equivalent.
pub(crate) fn symmetry(view: &dyn MemoryView, entry: &ObjectEntry) -> YawSymmetry {
    let part = entry.parts.first();
    let template = part.and_then(|part| Some((part, view.library().get(&part.template)?)));
    template.and_then(|(part, template)| template.yaw_symmetry(&part.values()).ok()).unwrap_or(YawSymmetry::Fold(1))
}

fn outline(placed: &PlacedSolid) -> Vec<DVec2> {
    let flat = |point: DVec3| placed.pose.transform_point(point).truncate();
    match placed.solid.enclosure() {
        Enclosure::Box { size } => {
            let half = size * 0.5;
            // A box tilted about its y axis is seen from above as long as the shadow of both its length and height.
            let shadow = |axis: DVec3, half: f64| placed.pose.transform_vector(axis).truncate() * half;
            let along = shadow(DVec3::X, half.x);
            let reach = (along.length() + shadow(DVec3::Z, half.z).length()) / along.length().max(1e-9);
            [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
                .map(|(x, y)| flat(DVec3::new(x * half.x * reach, y * half.y, 0.0)))
                .to_vec()
        }
        Enclosure::Cylinder { radius, .. } => (0..CIRCLE_CORNERS)
            .map(|corner| {
                let angle = f64::from(corner) * std::f64::consts::TAU / f64::from(CIRCLE_CORNERS);
                flat(DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.0))
            })
            .collect(),
    }
}

fn z_range(placed: &PlacedSolid) -> (f64, f64) {
    let half = placed.half_extents().z;
    (placed.pose.translation.z - half, placed.pose.translation.z + half)
}

/// Largest gap between two convex polygons over the normals of their sides: the true distance where two sides
/// face each other, a lower bound where two corners do, negative where they overlap.
fn separation(a: &[DVec2], b: &[DVec2]) -> f64 {
    let normals = |polygon: &[DVec2]| -> Vec<DVec2> {
        let next = polygon.iter().cycle().skip(1);
        polygon.iter().zip(next).filter_map(|(p, q)| (*q - *p).perp().try_normalize()).collect()
    };
    let project = |polygon: &[DVec2], axis: DVec2| {
        polygon.iter().map(|p| p.dot(axis)).fold((f64::INFINITY, f64::NEG_INFINITY), |r, v| (r.0.min(v), r.1.max(v)))
    };
    let mut largest = f64::NEG_INFINITY;
    for axis in normals(a).into_iter().chain(normals(b)) {
        let ((a_low, a_high), (b_low, b_high)) = (project(a, axis), project(b, axis));
        largest = largest.max((a_low - b_high).max(b_low - a_high));
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::solid::Solid;
    use proptest::prelude::*;

    fn square(x: f64, y: f64, half: f64, yaw: f64) -> Vec<DVec2> {
        outline(&PlacedSolid {
            solid: Solid::Box { size: DVec3::splat(2.0 * half) },
            pose: Pose::from_yaw(DVec3::new(x, y, 0.0), yaw),
        })
    }

    #[test]
    fn facing_squares_are_as_far_apart_as_their_sides() {
        assert!((separation(&square(0.0, 0.0, 0.02, 0.0), &square(0.1, 0.0, 0.02, 0.0)) - 0.06).abs() < 1e-12);
        assert!((separation(&square(0.0, 0.0, 0.02, 0.0), &square(0.03, 0.0, 0.02, 0.0)) + 0.01).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn separation_is_symmetric_and_never_above_the_corner_distance(
            x in -0.2..0.2f64, y in -0.2..0.2f64, yaw in -3.0..3.0f64, half in 0.01..0.05f64,
        ) {
            let (a, b) = (square(0.0, 0.0, 0.03, 0.3), square(x, y, half, yaw));
            let gap = separation(&a, &b);
            prop_assert!((gap - separation(&b, &a)).abs() < 1e-12);
            let corners = a.iter().flat_map(|p| b.iter().map(move |q| p.distance(*q))).fold(f64::INFINITY, f64::min);
            prop_assert!(gap <= corners + 1e-12);
            let centre_inside = separation(&a, &[DVec2::new(x, y)]) <= 0.0;
            prop_assert!(!centre_inside || gap < 0.0);
        }
    }
}
