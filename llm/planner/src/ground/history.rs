//! Where things were: in an object's own history, and in memory's answers about the past.

use super::{Grounder, Meant, Stuck, geometry::top_centre, like_places};
use crate::{
    decision::GiveUpCause,
    explanation::ResolvedReference,
    task::{ReferenceIndex, history_phrase},
};
use acm_concept::{
    ids::{ObjectId, TransitionId},
    literal::{Evidence, Place},
    pose::Pose,
    task::OnUnknown,
};
use acm_memory::{
    MemoryView,
    entry::{HistoryEntry, Moment, ObjectEntry, PlaceCause, Transition},
    query::{PlaceReference, Recall},
};
use glam::DVec2;
use rand::Rng;

/// A shift seen between two views that is a move and not noise, metres.
const MOVED_M: f64 = 0.02;
/// Direction from which candidates are counted round their middle, radians: odd, so that places in a row or a
/// cross do not lie on it and keep their order under noise.
const FIRST_ANGLE_RAD: f64 = 1.0;

/// Where an object was at a moment (now, for `None`): its last place known by then, or the first known later.
pub(crate) fn place_at(entry: &ObjectEntry, moment: Option<Moment>) -> Option<(Pose, Option<ObjectId>)> {
    let now = || entry.pose().map(|pose| (pose, entry.support));
    let Some(moment) = moment else { return now() };
    let places = entry.history.iter().filter_map(|h| h.place.map(|place| (h.moment, (place.pose, place.support))));
    let (by_then, later): (Vec<_>, Vec<_>) = places.partition(|(known, _)| *known <= moment);
    by_then.last().or(later.first()).map(|(_, place)| *place).or_else(now)
}

/// The own transition that first moved an object in this episode, if its first move was an own one.
fn first_own_move(view: &dyn MemoryView, entry: &ObjectEntry) -> Option<TransitionId> {
    let episode = view.objects().iter().map(|entry| entry.last_seen.episode).max()?;
    let mut stood: Option<Pose> = None;
    for HistoryEntry { place, cause, .. } in entry.history.iter().filter(|h| h.moment.episode == episode) {
        match (cause, place) {
            (PlaceCause::Grasped(transition) | PlaceCause::Own(transition), _) => return Some(*transition),
            (PlaceCause::Gone(_), _) | (PlaceCause::Seen(_), None) => return None,
            (PlaceCause::Seen(_), Some(place)) => {
                let at = place.pose.translation.truncate();
                if stood.is_some_and(|pose| pose.translation.truncate().distance(at) > MOVED_M) {
                    return None;
                }
                stood = Some(place.pose);
            }
        }
    }
    None
}

impl Grounder<'_> {
    /// Memory's answer on an object's past as the given subtask means it. "Where it came from" is relative to a
    /// move before the subtask: a move made for the subtask itself answers nothing.
    pub fn recall(&self, object: ObjectId, reference: PlaceReference, subtask: u32) -> Recall<Place> {
        let recall = self.view.recall_place(object, reference);
        let own = self.view.object(object).and_then(|entry| first_own_move(self.view, entry));
        let instructed = self.view.progress().instructed;
        let transition =
            own.and_then(|id| self.view.transitions().iter().find(|t| t.id == id && t.moment >= instructed));
        // Only an answer that rests on that move is no answer: a place that a frame shows stands by itself.
        let made_for = |evidence: &[Evidence]| {
            transition.filter(|t| evidence.contains(&Evidence::Transition(t.id))).and_then(|t| t.subtask)
        };
        match recall {
            Recall::Known { ref evidence, .. }
                if reference == PlaceReference::BeforeMoved
                    && !self.moved_before.get()
                    && made_for(evidence) == Some(subtask) =>
            {
                let reason = format!("I moved {object} only for this, and saw no move before");
                Recall::Unknown { reason, candidates: Vec::new() }
            }
            other => other,
        }
    }

    /// The place that a history phrase means: known, or drawn among the candidates where that is allowed.
    pub(super) fn remembered(
        &self,
        index: ReferenceIndex,
        object: ObjectId,
        reference: PlaceReference,
        subtask: u32,
    ) -> Result<Meant<Place>, Stuck> {
        let recall = self.recall(object, reference, subtask);
        let (place, how, guessed) = match &recall {
            Recall::Known { value, confidence, .. } => {
                (*value, format!("remembered with confidence {confidence:.2}"), false)
            }
            Recall::Unknown { .. } if self.options.on_unknown == OnUnknown::Abstain => {
                return Err(self.unknown_past(index, object, reference, recall));
            }
            Recall::Unknown { reason, candidates } => {
                if let Some(place) = self.drawn_before(object, subtask) {
                    return Ok(Meant { value: place, guessed: true });
                }
                let candidates = self.candidates(object, candidates, subtask);
                let fraction: f64 = self.draw(subtask, index).random();
                match choose(&candidates, fraction) {
                    Some(place) => (place, format!("drawn among {} places: {reason}", candidates.len()), true),
                    None => return Err(self.unknown_past(index, object, reference, recall)),
                }
            }
        };
        self.keep(ResolvedReference {
            phrase: history_phrase(reference, self.phrase(index)),
            object: Some(object),
            place: Some(place),
            retrieval: None,
            recall: Some(recall),
            how,
            guessed,
        });
        Ok(Meant { value: place, guessed })
    }

    /// Where an earlier step of the subtask brought the object: a guess is not drawn anew because the guess itself
    /// changed what is free.
    fn drawn_before(&self, object: ObjectId, subtask: u32) -> Option<Place> {
        let since = self.began(subtask)?;
        let of_subtask = |t: &&Transition| t.subtask == Some(subtask) && t.object() == object && t.moment >= since;
        self.view.transitions().iter().rev().filter(of_subtask).find_map(|t| t.report.invocation.destination)
    }

    /// The sentence for a past that memory does not hold; its answer is kept with what was found.
    pub fn unknown_past(
        &self,
        index: ReferenceIndex,
        object: ObjectId,
        reference: PlaceReference,
        recall: Recall<Place>,
    ) -> Stuck {
        let reason = match &recall {
            Recall::Unknown { reason, .. } => reason.as_str(),
            Recall::Known { .. } => "memory does not decide",
        };
        let name = format!("{} ({object})", self.phrase(index));
        let text = format!("I do not know {}: {reason}", history_phrase(reference, &name));
        self.keep(ResolvedReference {
            phrase: history_phrase(reference, self.phrase(index)),
            object: Some(object),
            place: None,
            retrieval: None,
            recall: Some(recall),
            how: "not known".into(),
            guessed: false,
        });
        Stuck::give_up(GiveUpCause::Memory, text)
    }

    /// Memory's candidates, or else the tops of the like places that are seen, but for the one it stood on when the
    /// subtask began.
    fn candidates(&self, object: ObjectId, known: &[(Place, f64)], subtask: u32) -> Vec<(Place, f64)> {
        if !known.is_empty() {
            return known.to_vec();
        }
        let groups = like_places(self.view, object);
        // Only what was known by then: what the guess itself changed must not change the guess.
        let known = |entry: &ObjectEntry| {
            let began = self.began(subtask)?;
            entry.history.iter().rev().filter(|h| h.moment <= began).find_map(|h| h.place)?.support
        };
        let stood = self.view.object(object).and_then(known);
        let top = |entry: &&ObjectEntry| {
            let place = Place {
                support: Some(entry.id),
                pose: top_centre(self.view, entry)?,
                tolerance_m: super::PLACE_TOLERANCE_M,
                heading_tolerance_rad: None,
            };
            Some((place, 1.0))
        };
        groups.first().into_iter().flatten().filter(|entry| Some(entry.id) != stood).filter_map(top).collect()
    }
}

/// The candidate at a fraction of the summed probability. They are ordered by their direction from their middle,
/// not by id or rank, so that the same fraction means the same place when the scene is perceived anew.
fn choose(candidates: &[(Place, f64)], fraction: f64) -> Option<Place> {
    let spot = |place: &Place| place.pose.translation.truncate();
    let middle = candidates.iter().map(|(place, _)| spot(place)).sum::<DVec2>() / candidates.len().max(1) as f64;
    let angle = |place: &Place| ((spot(place) - middle).to_angle() - FIRST_ANGLE_RAD).rem_euclid(std::f64::consts::TAU);
    let mut ordered: Vec<&(Place, f64)> = candidates.iter().filter(|(_, weight)| *weight > 0.0).collect();
    ordered.sort_by(|(a, _), (b, _)| angle(a).total_cmp(&angle(b)));
    let mut left = fraction * ordered.iter().map(|(_, weight)| weight).sum::<f64>();
    for (place, weight) in &ordered {
        if left < *weight {
            return Some(*place);
        }
        left -= weight;
    }
    ordered.last().map(|(place, _)| *place)
}
