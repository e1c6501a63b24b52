//! Reads moves out of an object's history.

use crate::{
    entry::{HistoryEntry, ObjectEntry, PlaceCause},
    observe::MOVED_M,
};
use acm_concept::literal::{Evidence, Place};

/// One departure of an object from a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure<'e> {
    /// The entry of the place that it left.
    pub from: &'e HistoryEntry,
    /// That place.
    pub place: Place,
    /// The entry that tells of the departure.
    pub by: &'e HistoryEntry,
}

/// All departures, oldest first: taken into the hand, seen gone, or found more than 2 cm away from where it was.
/// A change of what it rests on, in the same spot, is no departure.
pub fn departures(entry: &ObjectEntry) -> Vec<Departure<'_>> {
    let mut departures = Vec::new();
    let mut standing: Option<(&HistoryEntry, Place)> = None;
    for by in &entry.history {
        if let Some((from, place)) = standing {
            if by.place.is_some_and(|now| seen_from_above(&now, &place) <= MOVED_M) {
                // Still there: what creeps away in small steps leaves from where it began.
                continue;
            }
            departures.push(Departure { from, place, by });
        }
        standing = by.place.map(|place| (by, place));
    }
    departures
}

/// The first departure in an episode.
pub fn first_departure(entry: &ObjectEntry, episode: u32) -> Option<Departure<'_>> {
    departures(entry).into_iter().find(|departure| departure.by.moment.episode == episode)
}

/// What an entry of a history rests on.
pub fn evidence(entry: &HistoryEntry) -> Evidence {
    match entry.cause {
        PlaceCause::Seen(frame) | PlaceCause::Gone(frame) => Evidence::Frame(frame),
        PlaceCause::Own(transition) | PlaceCause::Grasped(transition) => Evidence::Transition(transition),
    }
}

/// Distance of two places seen from above, metres.
pub(crate) fn seen_from_above(a: &Place, b: &Place) -> f64 {
    a.pose.translation.truncate().distance(b.pose.translation.truncate())
}
