//! Which place a destination means.

use super::{
    Grounder, HEADING_TOLERANCE_RAD, MAX_DEPTH, Meant, PLACE_TOLERANCE_M, Stuck,
    carrier::{FLOOR_M, in_its_carrier, like_places, surface_under},
    geometry::{Extent, symmetry, top_centre},
    history::place_at,
    missing,
};
use crate::{
    decision::GiveUpCause,
    task::{Destination, Direction, ReferenceIndex},
};
use acm_concept::{ids::ObjectId, literal::Place, pose::Pose, task::OnUnknown};
use acm_memory::entry::{ObjectEntry, Presence};
use glam::{DVec2, DVec3};
use rand::Rng;

/// Free space left between things that are put beside each other, metres.
const BESIDE_GAP_M: f64 = 0.03;

impl Grounder<'_> {
    /// Where `moved` shall stand for a destination, as the given subtask means it.
    pub fn destination(&self, destination: &Destination, moved: ObjectId, subtask: u32) -> Result<Meant<Place>, Stuck> {
        match destination {
            Destination::History { object, reference } => {
                let of = self.object(*object)?;
                let place = self.remembered(*object, of.value, *reference, subtask)?;
                Ok(Meant { value: in_its_carrier(self.view, place.value, moved), guessed: place.guessed || of.guessed })
            }
            Destination::Exchanged { with, first, heading } => {
                let mut place = self.exchanged(*with, *first, moved, subtask)?;
                place.value = in_its_carrier(self.view, place.value, moved);
                if let (true, Some(yaw)) = (heading, self.stood(*with, *first, subtask)?.map(|(pose, _)| pose.yaw())) {
                    place.value.pose = Pose::from_yaw(place.value.pose.translation, yaw);
                    place.value.heading_tolerance_rad = Some(HEADING_TOLERANCE_RAD);
                }
                Ok(place)
            }
            other => self.spot(other, moved, 0),
        }
    }

    /// Destinations that depend on the present alone.
    pub(super) fn spot(&self, destination: &Destination, moved: ObjectId, depth: u32) -> Result<Meant<Place>, Stuck> {
        if depth > MAX_DEPTH {
            let text = "the destination is described by too many other things".to_owned();
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        }
        match destination {
            Destination::On { reference } => self.on(*reference, moved, depth),
            Destination::In { reference } => self.inside(*reference, moved, depth),
            Destination::Under { reference } => self.under(*reference, moved, depth),
            Destination::Middle { of } => self.middle(*of, moved, depth),
            Destination::Between { first, second } => {
                let (a, b) = (self.object_at(*first, depth)?, self.object_at(*second, depth)?);
                let (_, at) = self.present(a.value, self.phrase(*first))?;
                let (_, other) = self.present(b.value, self.phrase(*second))?;
                let spot = 0.5 * (at.translation + other.translation).truncate();
                Ok(Meant { value: self.standing_at(spot, moved), guessed: a.guessed || b.guessed })
            }
            Destination::Beside { reference, side } => self.beside(*reference, *side, moved, depth),
            Destination::History { .. } | Destination::Exchanged { .. } => {
                let text = "a thing cannot be told apart by where it was once".to_owned();
                Err(Stuck::give_up(GiveUpCause::Plan, text))
            }
        }
    }

    /// Where a thing stood when its exchange with another began: the second half of it looks one subtask farther back.
    fn exchanged(
        &self,
        with: ReferenceIndex,
        first: bool,
        moved: ObjectId,
        subtask: u32,
    ) -> Result<Meant<Place>, Stuck> {
        let (other, phrase) = (self.object(with)?, self.phrase(with));
        if other.value == moved {
            let text = format!("{phrase} is {moved} itself: nothing changes places with itself");
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        }
        let (pose, support) = self.stood(with, first, subtask)?.ok_or_else(|| missing(other.value, phrase))?;
        if support == Some(moved) {
            let text = format!("{phrase} ({}) stands on {moved}: the two cannot change places", other.value);
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        }
        let own_yaw = self.view.object(moved).and_then(ObjectEntry::pose).map_or(0.0, |pose| pose.yaw());
        let carrier = support.and_then(|id| self.view.object(id));
        let yaw = carrier.map_or(own_yaw, |carrier| self.aligned_yaw(carrier, moved));
        let place = Place {
            support,
            pose: Pose::from_yaw(pose.translation, yaw),
            tolerance_m: PLACE_TOLERANCE_M,
            heading_tolerance_rad: None,
        };
        Ok(Meant { value: place, guessed: other.guessed })
    }

    /// Where a thing stood, and what carried it, when its exchange with another began.
    fn stood(
        &self,
        with: ReferenceIndex,
        first: bool,
        subtask: u32,
    ) -> Result<Option<(Pose, Option<ObjectId>)>, Stuck> {
        let began = if first { Some(subtask) } else { subtask.checked_sub(1) }.and_then(|since| self.began(since));
        let other = self.object(with)?.value;
        Ok(self.view.object(other).and_then(|entry| place_at(entry, began)))
    }

    fn on(&self, reference: ReferenceIndex, moved: ObjectId, depth: u32) -> Result<Meant<Place>, Stuck> {
        let under = self.object_at(reference, depth)?;
        let phrase = self.phrase(reference);
        if under.value == moved {
            let text = format!("{phrase} is {moved} itself: nothing can stand on itself");
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        }
        let (entry, _) = self.present(under.value, phrase)?;
        let top = top_centre(self.view, entry)
            .ok_or_else(|| Stuck::look(GiveUpCause::Perception, format!("I do not know the shape of {phrase}")))?;
        let yaw = self.aligned_yaw(entry, moved);
        let pose = Pose::from_yaw(top.translation, yaw);
        let place =
            Place { support: Some(entry.id), pose, tolerance_m: PLACE_TOLERANCE_M, heading_tolerance_rad: None };
        Ok(Meant { value: place, guessed: under.guessed })
    }

    /// On the floor of what contains, at its middle; all of the floor counts as there.
    fn inside(&self, reference: ReferenceIndex, moved: ObjectId, depth: u32) -> Result<Meant<Place>, Stuck> {
        let around = self.object_at(reference, depth)?;
        let phrase = self.phrase(reference);
        if around.value == moved {
            let text = format!("{phrase} is {moved} itself: nothing can be inside itself");
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        }
        let (entry, pose) = self.present(around.value, phrase)?;
        let extent = Extent::now(self.view, entry)
            .ok_or_else(|| Stuck::look(GiveUpCause::Perception, format!("I do not know the shape of {phrase}")))?;
        let own = self.view.object(moved).and_then(|moved| Extent::now(self.view, moved)).map_or(0.0, |e| e.radius());
        let place = Place {
            support: Some(entry.id),
            pose: Pose::from_yaw(
                pose.translation.truncate().extend(extent.low + FLOOR_M),
                self.aligned_yaw(entry, moved),
            ),
            tolerance_m: (extent.radius() - own).max(PLACE_TOLERANCE_M),
            heading_tolerance_rad: None,
        };
        Ok(Meant { value: place, guessed: around.guessed })
    }

    /// On what carries the thing, below its middle.
    fn under(&self, reference: ReferenceIndex, moved: ObjectId, depth: u32) -> Result<Meant<Place>, Stuck> {
        let over = self.object_at(reference, depth)?;
        let (entry, pose) = self.present(over.value, self.phrase(reference))?;
        let (support, height) = match (entry.support, self.view.support()) {
            (Some(support), _) => (Some(support), pose.translation.z),
            (None, Some(plane)) => (None, plane.height_at(pose.translation.x, pose.translation.y)),
            (None, None) => (None, pose.translation.z),
        };
        let place = Place {
            support,
            pose: Pose::from_yaw(pose.translation.truncate().extend(height), self.aligned_yaw(entry, moved)),
            tolerance_m: PLACE_TOLERANCE_M,
            heading_tolerance_rad: None,
        };
        Ok(Meant { value: place, guessed: over.guessed })
    }

    /// The heading of what carries it, turned by as little as its symmetry allows.
    fn aligned_yaw(&self, carrier: &ObjectEntry, moved: ObjectId) -> f64 {
        let Some((entry, pose)) = self.view.object(moved).and_then(|entry| Some((entry, entry.pose()?))) else {
            return 0.0;
        };
        let carrier_yaw = carrier.pose().map_or(0.0, |pose| pose.yaw());
        let along = symmetry(self.view, carrier).nearest(carrier_yaw, pose.yaw());
        symmetry(self.view, entry).nearest(along, pose.yaw())
    }

    fn middle(&self, of: Option<ReferenceIndex>, moved: ObjectId, depth: u32) -> Result<Meant<Place>, Stuck> {
        let (group, guessed) = match of {
            Some(reference) => (self.group(reference, depth)?, false),
            None => self.largest_group(moved)?,
        };
        let spots: Vec<DVec2> = group
            .iter()
            .filter(|entry| entry.id != moved)
            .filter_map(|entry| Some(entry.pose()?.translation.truncate()))
            .collect();
        if spots.len() < 2 {
            let what = of.map_or("like places", |reference| self.phrase(reference));
            let text = format!("I do not know where the middle is: I see {} of {what}, and need two", spots.len());
            return Err(Stuck::look(GiveUpCause::Perception, text));
        }
        let middle = spots.iter().sum::<DVec2>() / spots.len() as f64;
        Ok(Meant { value: self.standing_at(middle, moved), guessed })
    }

    fn largest_group(&self, moved: ObjectId) -> Result<(Vec<&ObjectEntry>, bool), Stuck> {
        let groups = like_places(self.view, moved);
        let largest = groups.first().map_or(0, Vec::len);
        let rivals: Vec<&Vec<&ObjectEntry>> = groups.iter().filter(|group| group.len() == largest).collect();
        if rivals.len() <= 1 || largest < 2 {
            return Ok((self.confirmed(groups.into_iter().next().unwrap_or_default())?, false));
        }
        if self.options.on_unknown == OnUnknown::Abstain {
            let text = format!("which middle? {} groups of {largest} like places fit equally", rivals.len());
            return Err(Stuck::give_up(GiveUpCause::Identity, text));
        }
        let chosen = self.draw(0, usize::MAX >> 1).random_range(0..rivals.len());
        Ok((rivals.get(chosen).map(|group| (*group).clone()).unwrap_or_default(), true))
    }

    fn beside(
        &self,
        reference: ReferenceIndex,
        side: Option<Direction>,
        moved: ObjectId,
        depth: u32,
    ) -> Result<Meant<Place>, Stuck> {
        let of = self.object_at(reference, depth)?;
        let (entry, pose) = self.present(of.value, self.phrase(reference))?;
        let radius = |entry: Option<&ObjectEntry>| {
            entry.and_then(|entry| Extent::now(self.view, entry)).map_or(0.03, |extent| extent.radius())
        };
        let moved_entry = self.view.object(moved);
        let distance = radius(Some(entry)) + radius(moved_entry) + BESIDE_GAP_M;
        let spot = |side: Direction| pose.translation.truncate() + side.vector().truncate() * distance;
        let others = |spot: DVec2| {
            let far = |entry: &&ObjectEntry| {
                entry.id != moved
                    && entry.presence == Presence::Present
                    && entry.pose().is_some_and(|p| p.translation.truncate().distance(spot) < distance * 0.9)
            };
            self.view.objects().iter().filter(far).count()
        };
        let sides = match side {
            Some(side) => vec![side],
            None => vec![Direction::Right, Direction::Left, Direction::Front, Direction::Back],
        };
        let best = sides.into_iter().map(spot).min_by_key(|spot| others(*spot)).unwrap_or_default();
        Ok(Meant { value: self.standing_at(best, moved), guessed: of.guessed })
    }

    /// A spot seen from above as a place for `moved`, in its present heading.
    fn standing_at(&self, spot: DVec2, moved: ObjectId) -> Place {
        let pose = self.view.object(moved).and_then(ObjectEntry::pose).unwrap_or_default();
        let (support, height) = surface_under(self.view, spot, moved);
        let height = height.unwrap_or(pose.translation.z);
        Place {
            support,
            pose: Pose::from_yaw(DVec3::new(spot.x, spot.y, height), pose.yaw()),
            tolerance_m: PLACE_TOLERANCE_M,
            heading_tolerance_rad: None,
        }
    }
}
