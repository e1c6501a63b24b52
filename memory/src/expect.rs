//! What a camera should see now, from all that is believed.

use crate::{
    entry::{PlaceCause, Presence},
    identity::predict::predicted_parts,
    state::State,
};
use acm_concept::{
    expectation::{Expectation, ExpectedObject},
    time::Time,
};
use glam::DVec3;

/// Positions become less sure while a thing is not looked at: metres per square root of a second, up to a limit.
const DRIFT_M: f64 = 0.001;
const DRIFT_LIMIT_M: f64 = 0.02;
/// What is held may slip in the hand, metres.
const HELD_SIGMA_M: f64 = 0.01;

/// The expectation at `now`. Missing objects are not expected anywhere.
pub(crate) fn expect(state: &State, now: Time) -> Expectation {
    let was_put = |entry: &crate::entry::ObjectEntry| {
        entry.history.last().is_some_and(|last| last.place.is_some() && matches!(last.cause, PlaceCause::Own(_)))
    };
    let expected = |entry: &crate::entry::ObjectEntry| {
        let held = entry.presence == Presence::Held;
        let track = state.track(entry.id);
        let (mut parts, _) = predicted_parts(state, entry, &track);
        let earlier_run = entry.last_seen.episode < state.next.episode;
        let unseen_s = now.seconds_since(entry.last_seen.time);
        let drift = if earlier_run { DRIFT_LIMIT_M } else { (DRIFT_M * unseen_s.sqrt()).min(DRIFT_LIMIT_M) };
        let added = DVec3::splat(drift + if held { HELD_SIGMA_M } else { 0.0 });
        for part in &mut parts {
            let sigma = part.pose.position_sigma_m;
            part.pose.position_sigma_m =
                DVec3::new(sigma.x.hypot(added.x), sigma.y.hypot(added.y), sigma.z.hypot(added.z));
        }
        ExpectedObject {
            id: entry.id,
            category: entry.category.clone(),
            parts,
            appearance: entry.appearance,
            confidence: entry.confidence,
            // What may be another object is measured anew, not by what it is taken for.
            views: if track.doubt.is_some() { 0 } else { entry.views },
            held,
            was_put: !held && !earlier_run && track.doubt.is_none() && was_put(entry),
        }
    };
    let there = state.objects.iter().filter(|entry| entry.presence != Presence::Missing);
    Expectation {
        time: now,
        objects: there.map(expected).collect(),
        support: state.support,
        robot: Vec::new(),
        nouns: Vec::new(),
    }
}
