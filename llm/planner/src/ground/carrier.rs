//! What carries things: the surfaces and containers of a scene, and where on them things stand.

use super::{
    geometry::{Extent, top_centre},
    has_effect,
};
use crate::language::CONTAINS;
use acm_concept::{ids::ObjectId, literal::Place, pose::Pose};
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Presence},
};
use glam::DVec2;
use std::f64::consts::FRAC_PI_2;

/// Thickness that the floor of a container is taken to have, metres.
pub(super) const FLOOR_M: f64 = 0.004;
/// What the names of frames begin with at which things belong into a thing.
const SLOT: &str = "slot";
/// Colours within this delta E (CIE76) count as alike.
const LIKE_COLOR: f64 = 30.0;
/// Areas within this ratio count as alike.
const LIKE_AREA: f64 = 2.0;
/// Existence below which a remembered object does not count towards a group, 0-1.
const MIN_CONFIDENCE: f64 = 0.3;
/// What stood so near to a container's floor stood in it, and a container that is found so near to where it was first seen
/// has not been moved, metres.
const ON_FLOOR_M: f64 = 0.015;
const UNMOVED_M: f64 = 0.02;

/// A remembered place on the bare surface as the place in the container that stands there, if that has always stood there:
/// it was not told from what stood in it when the place was remembered.
pub(super) fn in_its_carrier(view: &dyn MemoryView, place: Place, moved: ObjectId) -> Place {
    let at = place.pose.translation;
    let stands_round = |entry: &&ObjectEntry| {
        let first = entry.history.iter().find_map(|known| known.place);
        let unmoved =
            |first: Place| entry.pose().is_some_and(|now| now.translation.distance(first.pose.translation) < UNMOVED_M);
        let round = |extent: Extent| extent.covers(at.truncate()) && (extent.low - at.z).abs() < ON_FLOOR_M;
        entry.id != moved
            && entry.presence == Presence::Present
            && contains(entry)
            && first.is_some_and(unmoved)
            && Extent::now(view, entry).is_some_and(round)
    };
    match view.objects().iter().find(stands_round) {
        Some(carrier) if place.support.is_none() => Place { support: Some(carrier.id), ..place },
        _ => place,
    }
}

fn contains(entry: &ObjectEntry) -> bool {
    entry.parts.iter().any(|part| part.affordances.iter().any(|affordance| affordance == CONTAINS))
}

/// Where things stand on a thing or in it, at its middle: the floor of what contains, else the top.
pub(crate) fn carrying_centre(view: &dyn MemoryView, entry: &ObjectEntry) -> Option<Pose> {
    if !contains(entry) {
        return top_centre(view, entry);
    }
    let (pose, extent) = (entry.pose()?, Extent::now(view, entry)?);
    Some(Pose::from_yaw(pose.translation.truncate().extend(extent.low + FLOOR_M), pose.yaw()))
}

/// Where `count` things belong in a thing: at the frames of its template that are slots, or, where it has fewer, side by
/// side along its longer side, each lying across.
pub(crate) fn slots(view: &dyn MemoryView, holder: &ObjectEntry, count: usize) -> Option<Vec<Pose>> {
    let mut slots = Vec::new();
    for part in &holder.parts {
        let template = view.library().get(&part.template)?;
        for name in template.frame_names().filter(|name| name.starts_with(SLOT)) {
            slots.extend(template.frame(name, &part.values()).ok()?.map(|local| part.pose.pose * local));
        }
    }
    if slots.len() >= count {
        return Some(slots);
    }
    let centre = carrying_centre(view, holder)?;
    let extent = Extent::now(view, holder)?;
    let axis = |turn: f64| DVec2::from_angle(centre.yaw() + turn);
    let turn = if extent.span(axis(0.0)) >= extent.span(axis(FRAC_PI_2)) { 0.0 } else { FRAC_PI_2 };
    let (along, long) = (axis(turn), extent.span(axis(turn)));
    let place = |index: usize| {
        let offset = long * ((index as f64 + 0.5) / count as f64 - 0.5);
        let spot = centre.translation.truncate() + along * offset;
        Pose::from_yaw(spot.extend(centre.translation.z), centre.yaw() + turn + FRAC_PI_2)
    };
    Some((0..count).map(place).collect())
}

/// What carries a spot: the highest thing that is made to carry and cannot be taken away, or else the support
/// plane; with its height in the world, `None` if no plane is known.
pub(crate) fn surface_under(view: &dyn MemoryView, spot: DVec2, moved: ObjectId) -> (Option<ObjectId>, Option<f64>) {
    let mut best: Option<(ObjectId, f64)> = None;
    for entry in view.objects().iter().filter(|entry| entry.id != moved && is_place(view, entry)) {
        let Some(extent) = Extent::now(view, entry).filter(|extent| extent.covers(spot)) else { continue };
        if best.is_none_or(|(_, high)| extent.high > high) {
            best = Some((entry.id, extent.high));
        }
    }
    match best {
        Some((id, height)) => (Some(id), Some(height)),
        None => (None, view.support().map(|plane| plane.height_at(spot.x, spot.y))),
    }
}

/// Whether an object is a place: it carries things and is not itself to be picked up.
fn is_place(view: &dyn MemoryView, entry: &ObjectEntry) -> bool {
    entry.presence == Presence::Present
        && entry.parts.iter().any(|part| part.affordances.iter().any(|affordance| affordance == "supportive"))
        && !has_effect(view, entry, "holding")
}

/// Places that are alike (template, colour, area) in groups, the largest first.
pub(crate) fn like_places(view: &dyn MemoryView, moved: ObjectId) -> Vec<Vec<&ObjectEntry>> {
    let mut groups: Vec<Vec<&ObjectEntry>> = Vec::new();
    let counts = |entry: &&ObjectEntry| entry.id != moved && entry.confidence >= MIN_CONFIDENCE;
    for entry in view.objects().iter().filter(|entry| is_place(view, entry)).filter(counts) {
        let (joined, mut rest): (Vec<_>, Vec<_>) =
            groups.into_iter().partition(|group| group.iter().any(|member| alike(view, member, entry)));
        let mut group: Vec<&ObjectEntry> = joined.into_iter().flatten().collect();
        group.push(entry);
        rest.push(group);
        groups = rest;
    }
    for group in &mut groups {
        group.sort_by_key(|entry| entry.id);
    }
    groups.sort_by_key(|group| (std::cmp::Reverse(group.len()), group.first().map(|entry| entry.id)));
    groups
}

fn alike(view: &dyn MemoryView, a: &ObjectEntry, b: &ObjectEntry) -> bool {
    let template = |entry: &ObjectEntry| entry.parts.first().map(|part| part.template.clone());
    let area = |entry: &ObjectEntry| Extent::now(view, entry).map_or(0.0, |extent| extent.radius().powi(2));
    let (small, large) = (area(a).min(area(b)), area(a).max(area(b)));
    template(a) == template(b)
        && a.appearance.mean.distance(&b.appearance.mean) < LIKE_COLOR
        && large <= small * LIKE_AREA
}
