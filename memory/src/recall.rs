//! Recalls places: now, before a move, at the start. What was neither seen nor done is unknown, and said so.

use crate::{
    entry::{Moment, ObjectEntry, PlaceCause, Presence, Transition},
    geometry::{Body, symmetry, upright_motion},
    moves::{Departure, departures, evidence, first_departure},
    query::{PlaceReference, Recall},
    state::State,
};
use acm_concept::{
    ids::ObjectId,
    literal::{Evidence, Place},
    pose::Pose,
    template::TemplateLibrary,
};
use glam::DVec3;
use std::collections::BTreeMap;

/// Below this probability of being the object asked for, the answer is open between the identities.
const SURE_IDENTITY: f64 = 0.95;
/// A place counts as able to carry a thing if it is at least this large, relative to the thing's base.
const CARRIES: f64 = 0.8;
/// How far from a recalled place still counts as there, metres.
const TOLERANCE_M: f64 = 0.03;

/// A place in an object's present or past.
pub(crate) fn recall_place(
    state: &State,
    library: &TemplateLibrary,
    object: ObjectId,
    reference: PlaceReference,
) -> Recall<Place> {
    let Some(entry) = state.object(object) else {
        return Recall::Unknown { reason: format!("I know of no object {object}"), candidates: Vec::new() };
    };
    let own = 1.0 - entry.ambiguous_with.iter().map(|(_, probability)| probability).sum::<f64>();
    let answer = recall_one(state, library, entry, reference);
    if own >= SURE_IDENTITY || reference == PlaceReference::Now {
        return scaled(answer, own.max(0.0));
    }
    let mut candidates: Vec<(Place, f64)> = Vec::new();
    for (id, probability) in entry.ambiguous_with.iter().copied().chain([(object, own.max(0.0))]) {
        let other = state.object(id).map(|other| recall_one(state, library, other, reference));
        if let Some(Recall::Known { value, .. }) = other {
            candidates.push((value, probability));
        }
    }
    candidates.sort_by(|a, b| b.1.total_cmp(&a.1));
    let names: Vec<String> = entry.ambiguous_with.iter().map(|(id, _)| id.to_string()).collect();
    let reason = format!("{object} looks the same as {}: I cannot tell which of them it is", names.join(", "));
    Recall::Unknown { reason, candidates }
}

fn scaled(answer: Recall<Place>, factor: f64) -> Recall<Place> {
    match answer {
        Recall::Known { value, confidence, evidence } => {
            Recall::Known { value, confidence: confidence * factor, evidence }
        }
        unknown => unknown,
    }
}

fn recall_one(
    state: &State,
    library: &TemplateLibrary,
    entry: &ObjectEntry,
    reference: PlaceReference,
) -> Recall<Place> {
    match reference {
        PlaceReference::Now => now(entry),
        PlaceReference::BeforeMoved => before_moved(state, library, entry),
        PlaceReference::AtStart => at_start(state, library, entry),
    }
}

fn now(entry: &ObjectEntry) -> Recall<Place> {
    let last = entry.history.iter().rev().find_map(|past| past.place);
    match (entry.presence, entry.place()) {
        (Presence::Present, Some(value)) => Recall::Known {
            value,
            confidence: entry.confidence,
            evidence: entry
                .history
                .last()
                .map(evidence)
                .into_iter()
                .chain(entry.last_frame.map(Evidence::Frame))
                .collect(),
        },
        (Presence::Held, _) => {
            Recall::Unknown { reason: format!("{} is in my hand: it stands nowhere", entry.id), candidates: Vec::new() }
        }
        _ => Recall::Unknown {
            reason: format!("{} is not where I last saw it: I do not know where it is", entry.id),
            candidates: last.map(|place| (place, 0.1)).into_iter().collect(),
        },
    }
}

fn before_moved(state: &State, library: &TemplateLibrary, entry: &ObjectEntry) -> Recall<Place> {
    let (made_now, before): (Vec<_>, Vec<_>) =
        departures(entry).into_iter().partition(|d| is_made_now(state, entry, d));
    let first_in = |episode: u32| before.iter().copied().find(|d| d.by.moment.episode == episode);
    let earlier = || before.last().map(|last| last.by.moment.episode);
    let departure = moved_for_earlier_subtask(state, entry)
        .or_else(|| first_in(state.next.episode))
        .or_else(|| earlier().and_then(first_in))
        .or_else(|| made_now.first().copied());
    match departure {
        Some(departure) => known(state, library, entry, &departure),
        None => Recall::Unknown {
            reason: format!(
                "I have not seen {0} being moved and did not move it: I do not know where it came from",
                entry.id
            ),
            candidates: free_places(state, library, entry),
        },
    }
}

/// Whether a departure is the robot's own deed for the subtask that is under way: "where it came from" means a move
/// before that, if there was one.
fn is_made_now(state: &State, entry: &ObjectEntry, departure: &Departure<'_>) -> bool {
    let (PlaceCause::Own(id) | PlaceCause::Grasped(id)) = departure.by.cause else { return false };
    let (instructed, current) = (state.progress.instructed, state.progress.current());
    let is_current = |t: &Transition| t.moment >= instructed && t.subtask == Some(current) && t.object() == entry.id;
    state.transitions.iter().any(|t| t.id == id && is_current(t))
}

/// The first departure since an earlier subtask of the running instruction began to act on the object: "bring it
/// here, ..., return it to where it came from" speaks of that move, whatever moved the object before. A grasp that
/// lost the object on the way counts too.
fn moved_for_earlier_subtask<'e>(state: &State, entry: &'e ObjectEntry) -> Option<Departure<'e>> {
    let (instructed, current) = (state.progress.instructed, state.progress.current());
    let serves = |t: &&Transition| {
        t.object() == entry.id && t.moment >= instructed && t.subtask.is_some_and(|subtask| subtask < current)
    };
    let first = state.transitions.iter().find(serves)?;
    // Time stands still while the agent thinks: what was seen at the very moment it began was seen before.
    let began = Moment { time: first.report.started, ..first.moment };
    departures(entry).into_iter().find(|departure| departure.by.moment > began)
}

fn at_start(state: &State, library: &TemplateLibrary, entry: &ObjectEntry) -> Recall<Place> {
    let episode = state.next.episode;
    if let Some(departure) =
        first_departure(entry, episode).filter(|departure| was_there_at_start(state, departure.from))
    {
        return known(state, library, entry, &departure);
    }
    let stayed = first_departure(entry, episode).is_none() && entry.presence == Presence::Present;
    let first = entry.history.iter().rev().find(|past| past.moment.episode < episode).or(entry.history.first());
    if stayed
        && entry.last_seen.episode == episode
        && let Some(first) = first.filter(|first| was_there_at_start(state, first))
        && let Some(place) = entry.place()
    {
        return Recall::Known {
            value: place,
            confidence: if first.verified { 0.95 } else { 0.7 },
            evidence: vec![evidence(first)],
        };
    }
    Recall::Unknown {
        reason: format!("I did not see {} when this run began: I do not know where it was then", entry.id),
        candidates: free_places(state, library, entry),
    }
}

/// Whether a history's entry speaks of the run's beginning: memory goes back to it, and nothing was done before.
fn was_there_at_start(state: &State, entry: &crate::entry::HistoryEntry) -> bool {
    let episode = state.next.episode;
    let acted_before = || state.transitions.iter().any(|t| t.moment.episode == episode && t.moment < entry.moment);
    entry.moment.episode < episode || (state.from_start && !acted_before())
}

fn known(state: &State, library: &TemplateLibrary, entry: &ObjectEntry, departure: &Departure<'_>) -> Recall<Place> {
    let mut rests_on = vec![evidence(departure.from), evidence(departure.by)];
    rests_on.dedup();
    let place = Place { tolerance_m: TOLERANCE_M, ..departure.place };
    let certain = if departure.from.verified { 0.95 } else { 0.7 };
    let (value, certain) = match anchored(state, library, place, departure.by.moment) {
        Anchored::Unmoved => (place, certain),
        Anchored::Moved(moved, note) => {
            rests_on.push(Evidence::Inferred(note));
            (moved, 0.95 * certain)
        }
        Anchored::Lost(note) => {
            rests_on.push(Evidence::Inferred(note));
            (place, 0.5 * certain)
        }
    };
    Recall::Known { value, confidence: certain * entry.confidence.max(0.5), evidence: rests_on }
}

enum Anchored {
    /// What it rested on is where it was.
    Unmoved,
    /// What it rested on moved, and the place with it.
    Moved(Place, String),
    /// Nobody knows where that is now.
    Lost(String),
}

/// Carries a place along with what it was on: from where that was at `moment` to where it is now.
fn anchored(state: &State, library: &TemplateLibrary, place: Place, moment: Moment) -> Anchored {
    let Some(support) = place.support.and_then(|id| state.object(id)) else { return Anchored::Unmoved };
    let then = support.history.iter().rev().find(|past| past.moment <= moment).or(support.history.first());
    let then = then.and_then(|past| past.place);
    match (then, support.place(), support.parts.first()) {
        (Some(then), Some(now), Some(part)) => {
            if crate::moves::seen_from_above(&then, &now) <= crate::observe::MOVED_M {
                return Anchored::Unmoved;
            }
            let motion: Pose = upright_motion(&then.pose, &now.pose, symmetry(part, library));
            let moved = Place { pose: motion * place.pose, ..place };
            Anchored::Moved(moved, format!("{}, on which it was, was moved; the place moved with it", support.id))
        }
        _ => Anchored::Lost(format!("{}, on which it was, is not where it was", support.id)),
    }
}

/// Free places on which the object could have stood: the tops of the most common kind of supportive thing, with
/// equal probabilities.
pub fn free_places(state: &State, library: &TemplateLibrary, entry: &ObjectEntry) -> Vec<(Place, f64)> {
    let Some(base) = Body::of(&entry.parts, library).map(|body| body.extents()) else { return Vec::new() };
    let is_free = |other: &&ObjectEntry| {
        let carries = other.parts.iter().any(|part| part.affordances.iter().any(|word| word == "supportive"));
        let occupied = state.objects.iter().any(|o| o.support == Some(other.id) && o.presence == Presence::Present);
        other.id != entry.id && other.presence == Presence::Present && carries && !occupied
    };
    let mut kinds: BTreeMap<&str, Vec<Place>> = BTreeMap::new();
    for other in state.objects.iter().filter(is_free) {
        let (Some(part), Some(body)) = (other.parts.first(), Body::of(&other.parts, library)) else { continue };
        let top = body.extents();
        if top[0] < CARRIES * base[0] || top[1] < CARRIES * base[1] || entry.support == Some(other.id) {
            continue;
        }
        let rotation = entry.pose().map(|pose| pose.rotation).unwrap_or_default();
        let pose = Pose::new(DVec3::new(body.centre.x, body.centre.y, body.top_m), rotation);
        let place = Place { support: Some(other.id), pose, tolerance_m: TOLERANCE_M, heading_tolerance_rad: None };
        kinds.entry(part.template.as_str()).or_default().push(place);
    }
    // The first of equally common kinds, in the order of the objects' ids and not of the kinds' names.
    let first_id = |places: &[Place]| places.first().and_then(|place| place.support);
    let most = kinds.into_values().max_by(|a, b| a.len().cmp(&b.len()).then(first_id(b).cmp(&first_id(a))));
    let places = most.unwrap_or_default();
    let share = 1.0 / places.len().max(1) as f64;
    places.into_iter().map(|place| (place, share)).collect()
}
