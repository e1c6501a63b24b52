//! Scene memory: relations between objects, computed from their shapes and never from their names. They are kept
//! for what is not seen now, because they are computed from where things are believed to be.

use crate::{
    draft::Stage,
    entry::{ObjectEntry, PlaceCause, Presence},
    geometry::Body,
    state::State,
};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Term},
    template::TemplateLibrary,
};
use std::collections::BTreeMap;

/// How far a base may be from the top it rests on, metres: what two views of one camera disagree by.
pub const REST_TOLERANCE_M: f64 = 0.015;
/// How far beyond an edge the middle of a base may lie, metres.
const EDGE_TOLERANCE_M: f64 = 0.005;
/// A relation that is already believed holds within this many times the tolerances.
const HYSTERESIS: f64 = 1.5;
/// Outlines with a smaller gap are next to each other, metres.
pub const NEXT_TO_M: f64 = 0.05;
/// What lies in a thing is smaller than this share of it, seen from above, and lies on a floor so thick, metres.
const WITHIN: f64 = 0.7;
const FLOOR_M: f64 = 0.004;
/// Two thinner things are told apart by their outlines, not by their heights, metres.
const THIN_M: f64 = 0.005;

/// Whether `upper` rests on `lower`: the middle of its base lies over the other's outline and at the height of
/// its top, or, in what contains things, of its floor.
pub fn rests_on(upper: &Body, lower: &Body, tolerance: f64) -> bool {
    let lies_in = || {
        let floor_m = lower.base_m + FLOOR_M;
        lower.contains
            && upper.area() < WITHIN * lower.area()
            && (upper.base_m - floor_m).abs() <= tolerance * REST_TOLERANCE_M
            && lower.covers(upper.centre, 0.0)
    };
    stands_on(upper, lower, tolerance) || lies_in()
}

fn stands_on(upper: &Body, lower: &Body, tolerance: f64) -> bool {
    let thin = upper.height() < THIN_M && lower.height() < THIN_M;
    let above =
        if thin { lower.area() > upper.area() } else { upper.base_m + upper.top_m > lower.base_m + lower.top_m };
    above
        && (upper.base_m - lower.top_m).abs() <= tolerance * REST_TOLERANCE_M
        && lower.covers(upper.centre, tolerance * EDGE_TOLERANCE_M)
}

/// What an object rests on: of all that are under the middle of its base at the right height, the highest.
/// `None` means the bare support surface.
pub(crate) fn supporter(entry: &ObjectEntry, body: &Body, others: &BTreeMap<ObjectId, Body>) -> Option<ObjectId> {
    let mut best: Option<(ObjectId, f64)> = None;
    for (id, other) in others {
        let tolerance = if entry.support == Some(*id) { HYSTERESIS } else { 1.0 };
        let higher = best.is_none_or(|(_, top)| other.top_m > top);
        if *id != entry.id && higher && rests_on(body, other, tolerance) {
            best = Some((*id, other.top_m));
        }
    }
    best.map(|(id, _)| id)
}

/// Brings every object's support up to date. A change of support alone is kept in the history too.
pub(crate) fn settle_supports(stage: &mut Stage, state: &State, library: &TemplateLibrary, cause: PlaceCause) {
    let mut bodies = stage.bodies(state, library);
    let entries = stage.entries(state);
    bodies.retain(|id, _| entries.iter().any(|e| e.id == *id && e.presence == Presence::Present));
    let support_of = |entry: &&ObjectEntry| bodies.get(&entry.id).and_then(|body| supporter(entry, body, &bodies));
    let changed: Vec<(ObjectId, Option<ObjectId>)> = entries
        .iter()
        .map(|entry| (entry.id, entry.support, support_of(entry)))
        .filter(|(_, known, now)| known != now)
        .map(|(id, _, now)| (id, now))
        .collect();
    for (id, support) in changed {
        if let Some(staged) = stage.touch(state, id) {
            staged.entry.support = support;
            if staged.entry.presence == Presence::Present && staged.placed.is_none() {
                staged.placed = Some(cause);
            }
        }
    }
}

/// All relations that hold between present objects: `on`, `next-to` (once a pair), `clear`, `holding`.
pub fn relations(objects: &[ObjectEntry], library: &TemplateLibrary) -> Vec<Literal> {
    let object = |id: ObjectId| Term::Object(id);
    let present: Vec<(&ObjectEntry, Option<Body>)> = objects
        .iter()
        .filter(|entry| entry.presence == Presence::Present)
        .map(|entry| (entry, Body::of(&entry.parts, library)))
        .collect();
    let mut relations = Vec::new();
    for (index, (entry, body)) in present.iter().enumerate() {
        relations.extend(entry.support.map(|under| Literal::new("on", vec![object(entry.id), object(under)])));
        if !present.iter().any(|(other, _)| other.support == Some(entry.id)) {
            relations.push(Literal::new("clear", vec![object(entry.id)]));
        }
        for (other, other_body) in present.iter().skip(index + 1) {
            if let (Some(body), Some(other_body)) = (body, other_body)
                && next_to(body, other_body)
            {
                relations.push(Literal::new("next-to", vec![object(entry.id), object(other.id)]));
            }
        }
    }
    let held = objects.iter().filter(|entry| entry.presence == Presence::Held);
    relations.extend(held.map(|entry| Literal::new("holding", vec![object(entry.id)])));
    relations
}

/// Whether two things stand side by side: a small gap between their outlines, at heights that overlap.
pub fn next_to(a: &Body, b: &Body) -> bool {
    let level = a.base_m < b.top_m + REST_TOLERANCE_M && b.base_m < a.top_m + REST_TOLERANCE_M;
    level && a.gap(b) < NEXT_TO_M && !a.covers(b.centre, 0.0) && !b.covers(a.centre, 0.0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use crate::{default_library, staging::Thing};
    use proptest::prelude::*;

    fn body(thing: Thing) -> Body {
        Body::of(&thing.parts(), &default_library().unwrap()).unwrap()
    }

    proptest! {
        #[test]
        fn a_block_is_on_the_mat_under_it_whatever_the_camera_adds(
            dx in -0.03..0.03f64, dy in -0.03..0.03f64, up in -0.01..0.01f64, yaw in -3.0..3.0f64,
        ) {
            let mat = body(Thing::mat(0.1, 0.1).at(0.2, -0.1, 0.0));
            let block = body(Thing::block([0.04, 0.04, 0.04]).at(0.2 + dx, -0.1 + dy, 0.001 + up).turned(yaw));
            prop_assert!(rests_on(&block, &mat, 1.0));
            prop_assert!(!rests_on(&mat, &block, 1.0));
        }
        #[test]
        fn nothing_rests_on_what_rests_on_it(
            x in -0.1..0.1f64, y in -0.1..0.1f64, z in -0.05..0.05f64, a in 0.01..0.1f64, b in 0.01..0.1f64, h in 0.008..0.1f64,
        ) {
            let one = body(Thing::block([a.max(b), a.min(b), h]).at(0.0, 0.0, 0.0));
            let other = body(Thing::block([0.05, 0.04, 0.03]).at(x, y, z));
            prop_assert!(!(rests_on(&one, &other, HYSTERESIS) && rests_on(&other, &one, HYSTERESIS)));
        }
    }

    #[test]
    fn a_block_beside_the_mat_or_high_above_it_is_not_on_it() {
        let mat = body(Thing::mat(0.1, 0.1).at(0.0, 0.0, 0.0));
        assert!(!rests_on(&body(Thing::block([0.04, 0.04, 0.04]).at(0.06, 0.0, 0.001)), &mat, 1.0));
        assert!(!rests_on(&body(Thing::block([0.04, 0.04, 0.04]).at(0.0, 0.0, 0.04)), &mat, 1.0));
    }

    #[test]
    fn neighbours_are_next_to_each_other_and_a_block_on_a_mat_is_not() {
        let block = |x| body(Thing::block([0.04, 0.04, 0.04]).at(x, 0.0, 0.0));
        assert!(next_to(&block(0.0), &block(0.08)));
        assert!(!next_to(&block(0.0), &block(0.12)));
        assert!(!next_to(&block(0.0), &body(Thing::mat(0.1, 0.1).at(0.0, 0.0, 0.0))));
    }
}
