//! Which object a description means.

use super::{
    Grounder, MAX_DEPTH, Meant, Stuck,
    geometry::{Extent, volume},
    history::place_at,
};
use crate::{
    decision::GiveUpCause,
    explanation::ResolvedReference,
    task::{Destination, Direction, Goal, ObjectReference, Quantity, Rank, ReferenceIndex, Size},
};
use acm_concept::{
    ids::{ObjectId, PartId},
    object::GroundedPart,
    task::OnUnknown,
};
use acm_memory::{
    entry::{HistoryEntry, Moment, ObjectEntry, PlaceCause, Presence},
    moves::departures,
    query::{ObjectQuery, PlaceReference, Retrieval},
};
use glam::{DVec2, DVec3};
use rand::Rng;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

/// A hit stays in contention while its score is at least this share of the best one's.
const CONTENTION: f64 = 0.4;
/// Objects that differ by less along a direction are at the same rank, metres.
const RANK_MARGIN_M: f64 = 0.015;
/// Volumes within this ratio are the same size.
const SIZE_RATIO: f64 = 1.2;
/// How near to a described spot an object stood to be the one meant, metres.
const NEAR_M: f64 = 0.05;

impl<'a> Grounder<'a> {
    /// The object that a reference means. It may be held or missing: what that means is the caller's business.
    pub fn object(&self, index: ReferenceIndex) -> Result<Meant<ObjectId>, Stuck> {
        self.object_at(index, 0)
    }

    pub(super) fn object_at(&self, index: ReferenceIndex, depth: u32) -> Result<Meant<ObjectId>, Stuck> {
        if let Some(value) = self.turn(index) {
            return Ok(Meant { value, guessed: false });
        }
        let reference = self.reference(index)?;
        // A part is acted on through its object.
        if depth <= MAX_DEPTH
            && let Some(whole) = self.whole_of_part(index, depth)?
        {
            return Ok(Meant { value: whole, guessed: false });
        }
        let (retrieval, mut contenders) = self.contenders(index, reference, depth)?;
        if reference.quantity == Quantity::TheOne {
            contenders = self.confirmed(contenders)?;
        }
        let (chosen, how, guessed) = match contenders.as_slice() {
            [] => return Err(self.none_fits(reference, &retrieval)),
            [only] => (only.id, format!("{}: nothing else fits", only.id), false),
            several if reference.quantity == Quantity::AnyOne => {
                let chosen = self.any_one(index, reference, several);
                (chosen, format!("{chosen}: any one will do"), false)
            }
            several => {
                let names = several.iter().map(|entry| entry.id.to_string()).collect::<Vec<_>>();
                if self.options.on_unknown == OnUnknown::Abstain {
                    let text = format!("which is {}? {} fit equally", reference.phrase, names.join(" and "));
                    return Err(Stuck::give_up(GiveUpCause::Identity, text));
                }
                let draw = self.draw(reference.subtask, index).random_range(0..several.len());
                let chosen = several.get(draw).map_or(ObjectId(0), |entry| entry.id);
                (chosen, format!("{chosen}: drawn among {}", names.join(", ")), true)
            }
        };
        self.keep(ResolvedReference {
            phrase: reference.phrase.clone(),
            object: Some(chosen),
            place: None,
            retrieval: Some(retrieval),
            recall: None,
            how,
            guessed,
        });
        Ok(Meant { value: chosen, guessed })
    }

    pub(super) fn reference(&self, index: ReferenceIndex) -> Result<&'a ObjectReference, Stuck> {
        let text = || format!("the task has no reference {index}; read the instruction again");
        self.task.references.get(index).ok_or_else(|| Stuck::give_up(GiveUpCause::Plan, text()))
    }

    /// A generator that gives the same draws for the same seed, subtask and reference.
    pub(super) fn draw(&self, subtask: u32, index: ReferenceIndex) -> ChaCha8Rng {
        let salt = (u64::from(subtask) << 32) ^ index as u64;
        ChaCha8Rng::seed_from_u64(self.options.seed ^ salt.wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    pub(super) fn contenders(
        &self,
        index: ReferenceIndex,
        reference: &ObjectReference,
        depth: u32,
    ) -> Result<(Retrieval, Vec<&'a ObjectEntry>), Stuck> {
        if depth > MAX_DEPTH {
            let text = format!("{} is described by too many other things", reference.phrase);
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        }
        let retrieval = self.view.retrieve(&ObjectQuery {
            nouns: reference.noun.iter().cloned().collect(),
            affordance: reference.affordance.clone(),
            function: reference.function.clone(),
            color: reference.color.as_ref().map(|term| (term.lab, term.delta_e)),
            near: None,
            exclude: self.excluded(index, reference, depth)?,
            include_missing: true,
        });
        let best = retrieval.hits.iter().map(|hit| hit.score).fold(0.0, f64::max);
        let in_contention = retrieval.hits.iter().filter(|hit| hit.score >= CONTENTION * best);
        let mut contenders: Vec<&ObjectEntry> = in_contention.filter_map(|hit| self.view.object(hit.object)).collect();
        contenders.sort_by_key(|entry| entry.id);

        let began = self.began(reference.subtask);
        self.keep_best_named(reference, &mut contenders);
        keep_if_any(&mut contenders, |entry| known_at(entry, began));
        keep_if_any(&mut contenders, |entry| !gone_at(entry, began));
        if self.presupposes_move(index) {
            keep_if_any(&mut contenders, |entry| moved_by(entry, began));
        }
        self.keep_described(reference, &mut contenders, began, depth)?;
        if let Some(destination) = &reference.located {
            contenders = self.located(&contenders, destination, began, depth)?;
        }
        if reference.free {
            contenders.retain(|entry| self.was_free(entry.id, began));
        }
        if let Some(size) = reference.size {
            self.keep_size(&mut contenders, size);
        }
        if let Some(rank) = reference.rank {
            keep_rank(&mut contenders, rank, began);
        }
        Ok((retrieval, contenders))
    }

    /// "Put the cube back where it was" speaks of a cube that has been moved, unless the instruction itself has it moved
    /// before.
    fn presupposes_move(&self, index: ReferenceIndex) -> bool {
        let moving =
            self.task.subtasks.iter().map(|subtask| &subtask.goal).find(|g| g.object() == Some(index) && g.moves());
        let back = PlaceReference::BeforeMoved;
        matches!(moving, Some(Goal::At { destination: Destination::History { object, reference }, .. })
            if *object == index && *reference == back)
    }

    /// What "the other one" and "do not touch" rule out.
    fn excluded(&self, index: ReferenceIndex, reference: &ObjectReference, depth: u32) -> Result<Vec<ObjectId>, Stuck> {
        let mut excluded = Vec::new();
        for &other in &reference.other_than {
            excluded.push(self.object_at(other, depth + 1)?.value);
        }
        if depth == 0 && reference.function.is_some() && !self.task.untouched.contains(&index) {
            excluded.extend(self.untouched());
        }
        Ok(excluded)
    }

    /// The objects that must not be acted on, as far as they can be told.
    pub fn untouched(&self) -> Vec<ObjectId> {
        let meant = |&index: &ReferenceIndex| self.object_at(index, 1).ok().map(|meant| meant.value);
        self.task.untouched.iter().filter_map(meant).collect()
    }

    /// Among surfaces within a colour's reach, those that no other colour word names better.
    fn keep_best_named(&self, reference: &ObjectReference, contenders: &mut Vec<&ObjectEntry>) {
        if let Some(term) = &reference.color {
            keep_if_any(contenders, |entry| {
                self.lexicon.nearest_color(&entry.appearance.mean).is_some_and(|nearest| nearest.name == term.name)
            });
        }
    }

    fn located(
        &self,
        contenders: &[&'a ObjectEntry],
        destination: &Destination,
        began: Option<Moment>,
        depth: u32,
    ) -> Result<Vec<&'a ObjectEntry>, Stuck> {
        if let Destination::In { reference } = destination
            && let Some(part) = self.part_at(*reference, depth + 1)?
        {
            return Ok(self.inside_part(contenders, part, began));
        }
        if let Destination::On { reference } | Destination::In { reference } = destination {
            let under: Vec<(ObjectId, Option<Extent>)> = match self.reference(*reference)?.quantity {
                Quantity::Group | Quantity::Count(_) if self.turn(*reference).is_none() => {
                    self.group(*reference, depth + 1)?.iter().map(|e| (e.id, Extent::now(self.view, e))).collect()
                }
                _ => {
                    let id = self.object_at(*reference, depth + 1)?.value;
                    vec![(id, self.view.object(id).and_then(|entry| Extent::now(self.view, entry)))]
                }
            };
            let stands = |entry: &&&ObjectEntry| {
                place_at(entry, began).is_some_and(|(pose, support)| {
                    under.iter().any(|(id, outline)| {
                        let inside = || outline.as_ref().is_some_and(|o| o.covers(pose.translation.truncate()));
                        entry.id != *id && (support == Some(*id) || inside())
                    })
                })
            };
            return Ok(contenders.iter().filter(stands).copied().collect());
        }
        if let Destination::Beside { reference, side } = destination {
            return self.beside_it(contenders, *reference, *side, began, depth);
        }
        if matches!(destination, Destination::Middle { of: None })
            && self.spot(destination, ObjectId(0), depth + 1).is_err()
        {
            // Without places to be in the middle of, it is the middle one of its kind.
            let mut middle = contenders.to_vec();
            keep_rank(&mut middle, Rank::Middle, began);
            return Ok(middle);
        }
        let mut near = Vec::new();
        for entry in contenders {
            let spot = self.spot(destination, entry.id, depth + 1)?.value.pose.translation.truncate();
            let stood = place_at(entry, began);
            if stood.is_some_and(|(pose, _)| pose.translation.truncate().distance(spot) < NEAR_M) {
                near.push(*entry);
            }
        }
        Ok(near)
    }

    /// Those nearest to a thing, on a side of it where one is said.
    fn beside_it(
        &self,
        contenders: &[&'a ObjectEntry],
        of: ReferenceIndex,
        side: Option<Direction>,
        began: Option<Moment>,
        depth: u32,
    ) -> Result<Vec<&'a ObjectEntry>, Stuck> {
        let of = self.object_at(of, depth + 1)?.value;
        let Some((spot, _)) = self.view.object(of).and_then(|entry| place_at(entry, began)) else {
            return Ok(Vec::new());
        };
        let away = |entry: &ObjectEntry| {
            let (pose, _) = place_at(entry, began)?;
            let away = pose.translation - spot.translation;
            let sided = side.is_none_or(|side| away.dot(side.vector()) > 0.5 * away.length());
            (entry.id != of && sided).then(|| away.truncate().length())
        };
        let nearest = contenders.iter().filter_map(|entry| away(entry)).fold(f64::INFINITY, f64::min);
        let near = |entry: &&&ObjectEntry| away(entry).is_some_and(|distance| distance < nearest + RANK_MARGIN_M);
        Ok(contenders.iter().filter(near).copied().collect())
    }

    /// Those that lie in a part: nearest to it of all parts of its name.
    fn inside_part(&self, contenders: &[&'a ObjectEntry], part: PartId, began: Option<Moment>) -> Vec<&'a ObjectEntry> {
        let Some(whole) = self.view.object(part.object) else { return Vec::new() };
        let template = whole.parts.get(part.index as usize).map(|part| part.template.as_str());
        let top = Extent::now(self.view, whole).map_or(f64::INFINITY, |extent| extent.high);
        let alike = |(_, other): &(usize, &GroundedPart)| Some(other.template.as_str()) == template;
        let inside = |entry: &&&ObjectEntry| {
            place_at(entry, began).is_some_and(|(pose, support)| {
                let distance = |other: &GroundedPart| other.pose.pose.translation.distance(pose.translation);
                let nearest =
                    whole.parts.iter().enumerate().filter(alike).min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
                support == Some(whole.id)
                    && pose.translation.z < top - RANK_MARGIN_M
                    && nearest.is_some_and(|(number, _)| number == part.index as usize)
            })
        };
        contenders.iter().filter(inside).copied().collect()
    }

    fn was_free(&self, id: ObjectId, began: Option<Moment>) -> bool {
        let stands_on_it = |entry: &ObjectEntry| {
            entry.id != id && place_at(entry, began).is_some_and(|(_, support)| support == Some(id))
        };
        !self.view.objects().iter().any(stands_on_it)
    }

    fn keep_size(&self, contenders: &mut Vec<&ObjectEntry>, size: Size) {
        let volumes: Vec<f64> = contenders.iter().map(|entry| volume(self.view, entry)).collect();
        let (low, high) = volumes.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
        let mut volume = volumes.into_iter();
        contenders.retain(|_| {
            volume.next().is_some_and(|v| match size {
                Size::Large => v * SIZE_RATIO >= high,
                Size::Small => v <= low * SIZE_RATIO,
            })
        });
    }

    /// Any one: the one already worked on, or else the first that is there.
    fn any_one(&self, index: ReferenceIndex, reference: &ObjectReference, several: &[&ObjectEntry]) -> ObjectId {
        // Of two that change places the other one is worked on too: which is which must not turn on it.
        let exchanged = |goal: &Goal| matches!(goal, Goal::At { object, destination: Destination::Exchanged { .. } } if *object == index);
        if let (Some(first), true) = (several.first(), self.task.subtasks.iter().any(|s| exchanged(&s.goal))) {
            return first.id;
        }
        let worked_on = |entry: &&&ObjectEntry| {
            let own =
                |t: &acm_memory::entry::Transition| t.subtask == Some(reference.subtask) && t.object() == entry.id;
            entry.presence == Presence::Held || self.view.transitions().iter().any(own)
        };
        let present = |entry: &&&ObjectEntry| entry.presence == Presence::Present;
        let chosen = several.iter().find(worked_on).or_else(|| several.iter().find(present)).or(several.first());
        chosen.map_or(ObjectId(0), |entry| entry.id)
    }

    pub(super) fn none_fits(&self, reference: &ObjectReference, retrieval: &Retrieval) -> Stuck {
        let considered = retrieval.hits.len() + retrieval.dropped.len();
        let text = match considered {
            0 => format!("I see nothing that could be {}", reference.phrase),
            1 => format!("I see no {}: the one object I know does not fit", bare(&reference.phrase)),
            _ => format!("I see no {}: none of {considered} objects fits", bare(&reference.phrase)),
        };
        Stuck::absent(text)
    }
}

/// The phrase without its article.
fn bare(phrase: &str) -> &str {
    phrase.split_once(' ').filter(|(first, _)| ["the", "a", "an"].contains(first)).map_or(phrase, |(_, rest)| rest)
}

/// Drops what does not fit, unless nothing fits.
fn keep_if_any(contenders: &mut Vec<&ObjectEntry>, fits: impl Fn(&ObjectEntry) -> bool) {
    if contenders.iter().any(|entry| fits(entry)) {
        contenders.retain(|entry| fits(entry));
    }
}

/// Whether an object was known when the subtask that speaks of it began: what turned up later is not meant.
fn known_at(entry: &ObjectEntry, began: Option<Moment>) -> bool {
    began.is_none_or(|began| entry.history.first().is_none_or(|first| first.moment <= began))
}

/// Whether an object was known to be no longer in its place, and nowhere else, when a subtask began.
fn gone_at(entry: &ObjectEntry, began: Option<Moment>) -> bool {
    let known = |h: &&HistoryEntry| began.is_none_or(|began| h.moment <= began);
    entry
        .history
        .iter()
        .rev()
        .find(known)
        .is_some_and(|last| last.place.is_none() && !matches!(last.cause, PlaceCause::Grasped(_)))
}

/// Whether an object was known to have left a place when a subtask began.
fn moved_by(entry: &ObjectEntry, began: Option<Moment>) -> bool {
    departures(entry).iter().any(|departure| began.is_none_or(|began| departure.by.moment <= began))
}

fn keep_rank(contenders: &mut Vec<&ObjectEntry>, rank: Rank, began: Option<Moment>) {
    let at = |entry: &ObjectEntry| place_at(entry, began).map_or(DVec3::ZERO, |(pose, _)| pose.translation);
    let spot = |entry: &ObjectEntry| at(entry).truncate();
    let heights = contenders.iter().map(|entry| at(entry).z);
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
    // Among things that lie side by side the top one is the one at the back, as in a picture.
    let side_of = |side: Direction| match side {
        Direction::Up if high - low < RANK_MARGIN_M => Direction::Back,
        Direction::Down if high - low < RANK_MARGIN_M => Direction::Front,
        side => side,
    };
    let key = |entry: &ObjectEntry, middle: DVec2| match rank {
        Rank::FromSide(_, side) => -at(entry).dot(side_of(side).vector()),
        Rank::Middle => spot(entry).distance(middle),
    };
    let middle = contenders.iter().map(|entry| spot(entry)).sum::<DVec2>() / contenders.len().max(1) as f64;
    let mut keys: Vec<f64> = contenders.iter().map(|entry| key(entry, middle)).collect();
    keys.sort_by(f64::total_cmp);
    let number = match rank {
        Rank::FromSide(number, _) => number as usize,
        Rank::Middle => 0,
    };
    match keys.get(number) {
        Some(&wanted) => contenders.retain(|entry| (key(entry, middle) - wanted).abs() < RANK_MARGIN_M),
        None => contenders.clear(),
    }
}
