//! What each segment stands on: the plane, a patch or a thing below it, or nothing that is seen.

use crate::{
    fit::{Base, Evidence},
    hypotheses::Hypothesis,
    scene::Scene,
};
use acm_concept::{pose::Pose, solid::PlacedSolid};
use glam::{DVec2, DVec3};

/// Things that were grounded already, as solids in the support frame.
#[derive(Debug, Default)]
pub(super) struct Bodies {
    tops: Vec<(Vec<PlacedSolid>, f64)>,
}

/// A segment whose lowest points are higher than this does not visibly reach the plane.
pub(super) const OFF_THE_PLANE_M: f64 = 0.022;
/// How well the bottom of a thing meets the top of what carries it.
const MEETS_M: f64 = 0.015;

impl Bodies {
    pub fn add(&mut self, ranked: &[Hypothesis]) {
        let Some(best) = ranked.first() else { return };
        let solids = best.model.solids(&best.minimum.state);
        let top = solids.iter().map(|s| s.pose.translation.z + s.half_extents().z).fold(0.0, f64::max);
        self.tops.push((solids, top));
    }

    /// Something flat that memory knows, with its solids in the world: it lies on the plane, wherever that is found.
    pub fn add_lying(&mut self, scene: &Scene, solids: &[PlacedSolid]) {
        let from_world = scene.world.inverse();
        let place = |s: &PlacedSolid| PlacedSolid { solid: s.solid, pose: from_world * s.pose };
        let placed: Vec<PlacedSolid> = solids.iter().map(place).collect();
        let top = placed.iter().map(|s| 2.0 * s.half_extents().z).fold(0.0, f64::max);
        let lift = top - placed.iter().map(|s| s.pose.translation.z + s.half_extents().z).fold(0.0, f64::max);
        let lifted = |s: PlacedSolid| PlacedSolid { pose: Pose::from_translation(DVec3::Z * lift) * s.pose, ..s };
        self.tops.push((placed.into_iter().map(lifted).collect(), top));
    }

    /// The surface under a segment with the given plan and lowest height.
    pub fn base_under(&self, plan: &[DVec2], lowest_m: f64, evidence: &Evidence) -> Base {
        let carries = |(solids, top): &&(Vec<PlacedSolid>, f64)| {
            let below = |p: &&DVec2| solids.iter().any(|s| s.signed_distance(p.extend(top - 1e-4)) < 0.003);
            let share = plan.iter().filter(below).count() as f64 / plan.len().max(1) as f64;
            share > 0.3 && (top - lowest_m).abs() < MEETS_M + 0.5 * OFF_THE_PLANE_M
        };
        let carrier = self.tops.iter().filter(carries).map(|(_, top)| *top).fold(0.0, f64::max);
        if lowest_m < OFF_THE_PLANE_M {
            // Only flat patches lie this low.
            return Base::At(if carrier < OFF_THE_PLANE_M { carrier } else { 0.0 });
        }
        if carrier > 0.0 && (carrier - lowest_m).abs() < MEETS_M {
            return Base::At(carrier);
        }
        if bottom_is_own(evidence) { Base::Free(lowest_m) } else { Base::At(0.0) }
    }
}

/// Whether the lower edge of a segment is seen against something farther, as it is when it hangs in the air.
fn bottom_is_own(evidence: &Evidence) -> bool {
    let Some(middle) = evidence.points.iter().map(|p| p.position).reduce(|a, b| a + b) else { return false };
    let middle = middle / evidence.points.len() as f64;
    let Some(centre) = evidence.intrinsics.project(evidence.camera.inverse().transform_point(middle)) else {
        return false;
    };
    let down = evidence.camera.inverse().transform_vector(DVec3::NEG_Z);
    let down = DVec2::new(down.x, down.y).normalize_or(DVec2::Y);
    let is_lower = |pixel: DVec2| {
        let to = pixel - centre;
        to.dot(down) > 0.7 * to.length()
    };
    let (mut own, mut all) = (0usize, 0usize);
    for point in evidence.outline.iter().filter(|p| is_lower(p.pixel)) {
        all += 1;
        own += usize::from(point.falls_off);
    }
    all > 4 && own * 2 > all
}
