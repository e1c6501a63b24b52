//! Facts that follow from where things stand, and how they are brought about by putting things somewhere.

use super::state::{State, same_atom};
use crate::ground::{
    PLACE_TOLERANCE_M,
    geometry::{Extent, top_centre},
    has_effect, place_at,
};
use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Evidence, Literal, Place, Term, Truth},
    pose::Pose,
};
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Presence, Transition},
};

/// Affordance of what can stand over other things and hide them.
const COVERING: &str = "covering";
/// Affordance of what holds things within its walls.
const CONTAINS: &str = "contains";
/// Affordance of what stands before an inside and can be shut: a door, a lid.
const CLOSABLE: &str = "closable";
/// The colour of a lamp that says yes.
const ASSENT: &str = "green";
/// Covers that are considered for one thing, the nearest first.
const MAX_COVERS: usize = 4;

pub(crate) fn is_cover(entry: &ObjectEntry) -> bool {
    affords(entry, COVERING)
}

/// Whether something may lie behind or in a thing as long as it is shut: a tap is opened too, but hides nothing.
pub(crate) fn shuts(entry: &ObjectEntry) -> bool {
    affords(entry, CONTAINS) || affords(entry, CLOSABLE)
}

fn affords(entry: &ObjectEntry, word: &str) -> bool {
    entry.parts.iter().any(|part| part.affordances.iter().any(|affordance| affordance == word))
}

/// What follows for a positive literal from where things stand; `None` where nothing does.
pub(super) fn concluded(state: &State<'_>, literal: &Literal) -> Option<Belief> {
    if literal.arguments.is_empty() {
        return shown(state.view(), &literal.predicate);
    }
    let subject = literal.subject()?;
    let other = || match literal.arguments.get(1)? {
        Term::Object(id) => Some(*id),
        Term::Part(part) => Some(part.object),
        _ => None,
    };
    match literal.predicate.as_str() {
        "covered" => {
            state.place(subject)?;
            let covers = state.covering(subject);
            let reason = match covers.first() {
                Some(cover) => format!("{cover} stands over {subject}"),
                None => format!("no cover stands over {subject}"),
            };
            Some(inferred(!covers.is_empty(), reason))
        }
        "inside" => {
            let around = other()?;
            let inside = contains(state, around, subject)?;
            let not = if inside { "" } else { "not " };
            Some(inferred(inside, format!("{subject} is {not}between the walls of {around}")))
        }
        "on" => {
            let under = other()?;
            let (_, support) = state.place(subject)?;
            let not = if support == Some(under) { "" } else { "not " };
            Some(inferred(support == Some(under), format!("{subject} does {not}stand on {under} then")))
        }
        _ => None,
    }
}

/// What the things that show something say of the moment: `accepted` by a lamp's colour, `changed` by a needle or whatever
/// else memory saw change. `None` where nothing shows.
fn shown(view: &dyn MemoryView, predicate: &str) -> Option<Belief> {
    // What was last seen before the last own action says nothing of what came of it.
    let acted = view.transitions().last().map(|transition| transition.moment);
    let fresh = |entry: &&ObjectEntry| acted.is_none_or(|acted| entry.last_seen > acted);
    let present = view.objects().iter().filter(|entry| entry.presence == Presence::Present).filter(fresh);
    let said: Vec<(bool, String)> = match predicate {
        "accepted" => {
            present.filter_map(lamp).map(|(id, color)| (color == ASSENT, format!("{id} shows {color}"))).collect()
        }
        "changed" => present
            .filter_map(|entry| {
                let belief = view.belief(&Literal::new("changed", vec![Term::Object(entry.id)]));
                (belief.truth != Truth::Unknown).then(|| (belief.truth == Truth::Yes, belief.reason))
            })
            .collect(),
        _ => return None,
    };
    let told = said.iter().find(|(holds, _)| *holds).or(said.first())?;
    Some(inferred(told.0, told.1.clone()))
}

/// The colour that a thing shows, the last that was read.
fn lamp(entry: &ObjectEntry) -> Option<(ObjectId, &str)> {
    let shows = entry.state.iter().rev().filter(|literal| literal.predicate == "shows" && !literal.negated);
    let mut words = shows.filter_map(|literal| match literal.arguments.get(1) {
        Some(Term::Symbol(word)) => Some(word.as_str()),
        _ => None,
    });
    words.next().map(|word| (entry.id, word))
}

fn inferred(holds: bool, reason: String) -> Belief {
    let truth = if holds { Truth::Yes } else { Truth::No };
    Belief { truth, confidence: 0.9, evidence: vec![Evidence::Inferred(reason.clone())], reason }
}

/// Whether an object is between another one's walls; `None` if one of them stands nowhere.
fn contains(state: &State<'_>, around: ObjectId, object: ObjectId) -> Option<bool> {
    let (outer, (pose, _)) = (state.extent(around)?, state.place(object)?);
    let level = pose.translation.z >= outer.low && pose.translation.z < outer.high;
    Some(outer.covers(pose.translation.truncate()) && level)
}

/// What must be so before a thing can be acted on because something hides it: its cover taken off, what it is inside of
/// open.
pub(super) fn hidden_by(state: &State<'_>, object: ObjectId) -> Vec<Literal> {
    let view = state.view();
    let covered = Literal::new("covered", vec![Term::Object(object)]).negate();
    let mut needed = Vec::new();
    if !state.covering(object).is_empty() {
        needed.push(covered);
    }
    let containers = view.objects().iter().filter(|entry| entry.id != object && affords(entry, CONTAINS));
    for container in containers.filter(|entry| contains(state, entry.id, object) == Some(true)) {
        needed.extend(opened(view, container));
    }
    needed
}

/// The literal that a container is open, if it is one that can be opened.
fn opened(view: &dyn MemoryView, container: &ObjectEntry) -> Option<Literal> {
    has_effect(view, container, "open").then(|| Literal::new("open", vec![Term::Object(container.id)]))
}

/// Ways to bring a literal about by bringing about others, in their order.
pub(super) fn ways(state: &State<'_>, literal: &Literal) -> Vec<Vec<Literal>> {
    let Some(subject) = literal.subject().filter(|_| !literal.negated) else { return Vec::new() };
    let at = |object, place| Literal::new("at", vec![Term::Object(object), Term::Place(place)]);
    let other = || match literal.arguments.get(1) {
        Some(Term::Object(id)) => state.view().object(*id),
        Some(Term::Part(part)) => state.view().object(part.object),
        _ => None,
    };
    match literal.predicate.as_str() {
        "covered" => covers_for(state, subject).into_iter().map(|(cover, place)| vec![at(cover, place)]).collect(),
        "on" => {
            let place = other().and_then(|under| {
                let pose = top_centre(state.view(), under)?;
                Some(Place {
                    support: Some(under.id),
                    pose,
                    tolerance_m: PLACE_TOLERANCE_M,
                    heading_tolerance_rad: None,
                })
            });
            place.map(|place| vec![at(subject, place)]).into_iter().collect()
        }
        "inside" => {
            let way = other().and_then(|around| {
                let (pose, _) = state.place(around.id)?;
                let tolerance_m = state.extent(around.id)?.radius();
                let place = Place { support: Some(around.id), pose, tolerance_m, heading_tolerance_rad: None };
                Some(opened(state.view(), around).into_iter().chain([at(subject, place)]).collect())
            });
            way.into_iter().collect()
        }
        _ => Vec::new(),
    }
}

/// Covers that could be put over a thing and cover nothing yet, with the place where each would stand: the nearest first.
fn covers_for(state: &State<'_>, object: ObjectId) -> Vec<(ObjectId, Place)> {
    let Some((pose, support)) = state.place(object) else { return Vec::new() };
    let at = pose.translation.truncate();
    let busy = |cover: ObjectId| {
        let others =
            state.view().objects().iter().filter(|entry| !is_cover(entry) && entry.presence == Presence::Present);
        others.map(|entry| entry.id).any(|other| state.covering(other).contains(&cover))
    };
    let mut covers: Vec<(f64, ObjectId, Place)> = Vec::new();
    for entry in state.view().objects().iter().filter(|entry| entry.id != object && is_cover(entry)) {
        if busy(entry.id) || entry.presence == Presence::Missing {
            continue;
        }
        let from = state.place(entry.id).map_or(at, |(pose, _)| pose.translation.truncate());
        let yaw = entry.pose().map_or(0.0, |pose| pose.yaw());
        let place = Place {
            support,
            pose: Pose::from_yaw(pose.translation, yaw),
            tolerance_m: PLACE_TOLERANCE_M,
            heading_tolerance_rad: None,
        };
        covers.push((from.distance(at), entry.id, place));
    }
    covers.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    covers.into_iter().take(MAX_COVERS).map(|(_, id, place)| (id, place)).collect()
}

/// Where a cover would stand over a thing; `None` for what covers nothing, or a thing that stands nowhere.
pub(crate) fn place_over(view: &dyn MemoryView, cover: ObjectId, object: ObjectId) -> Option<Place> {
    let entry = view.object(cover).filter(|entry| is_cover(entry))?;
    let (pose, support) = State::now(view).place(object)?;
    let pose = Pose::from_yaw(pose.translation, entry.pose().map_or(0.0, |pose| pose.yaw()));
    Some(Place { support, pose, tolerance_m: PLACE_TOLERANCE_M, heading_tolerance_rad: None })
}

/// Whether a transition that took effect brought a literal about: by its declared effects, or by where it put things.
pub(crate) fn brings_about(view: &dyn MemoryView, transition: &Transition, literal: &Literal) -> bool {
    let declared = |effect: &Literal| effect.negated == literal.negated && same_atom(effect, literal);
    if transition.predicted.iter().any(declared) {
        return true;
    }
    let invocation = &transition.report.invocation;
    let (Some(subject), moved) = (literal.subject(), invocation.part.object) else { return false };
    match (literal.predicate.as_str(), literal.negated, &invocation.destination) {
        ("at", false, Some(put)) => match literal.arguments.get(1) {
            Some(Term::Place(wanted)) => {
                let apart = put.pose.translation.truncate().distance(wanted.pose.translation.truncate());
                moved == subject && apart <= wanted.tolerance_m && wanted.heading_tolerance_rad.is_none()
            }
            _ => false,
        },
        ("covered", false, Some(put)) => stood_over(view, moved, &put.pose, subject, transition),
        ("covered", true, None) => {
            let taken = transition.predicted.iter().any(|effect| effect.predicate == "holding" && !effect.negated);
            let history = view.object(moved).map(|entry| entry.history.as_slice()).unwrap_or_default();
            let stood = history.iter().rev().find(|h| h.moment < transition.moment && h.place.is_some());
            let stood = stood.and_then(|h| h.place);
            taken && stood.is_some_and(|place| stood_over(view, moved, &place.pose, subject, transition))
        }
        _ => false,
    }
}

fn stood_over(view: &dyn MemoryView, cover: ObjectId, at: &Pose, object: ObjectId, transition: &Transition) -> bool {
    let over = view.object(cover).filter(|entry| is_cover(entry)).and_then(|entry| Extent::at(view, entry, at));
    let under = view.object(object).and_then(|entry| place_at(entry, Some(transition.moment)));
    match (over, under) {
        (Some(over), Some((pose, _))) => over.covers(pose.translation.truncate()),
        _ => false,
    }
}
