//! Which part of an object a description means: the top drawer of the cabinet.

use super::{Grounder, Stuck};
use crate::{
    decision::GiveUpCause,
    task::{Direction, ObjectReference, Quantity, Rank, ReferenceIndex},
};
use acm_concept::{
    ids::{ObjectId, PartId},
    object::GroundedPart,
};
use acm_memory::entry::{ObjectEntry, Presence};
use glam::DVec3;

/// Parts that differ by less along a direction are at the same rank, metres.
const RANK_MARGIN_M: f64 = 0.01;

impl<'a> Grounder<'a> {
    /// The part that a reference means; `None` where it means whole objects.
    ///
    /// A thing is described as a part where its whole is named, or where no object but only parts are called so.
    pub fn part(&self, index: ReferenceIndex) -> Result<Option<PartId>, Stuck> {
        self.part_at(index, 0)
    }

    pub(super) fn part_at(&self, index: ReferenceIndex, depth: u32) -> Result<Option<PartId>, Stuck> {
        let reference = self.reference(index)?;
        let Some(noun) = &reference.noun else { return Ok(None) };
        let wholes: Vec<&ObjectEntry> = match reference.part_of {
            Some(whole) => self.view.object(self.object_at(whole, depth + 1)?.value).into_iter().collect(),
            None => self.view.objects().iter().filter(|entry| entry.presence == Presence::Present).collect(),
        };
        let called = |entry: &&ObjectEntry| entry.categories.iter().any(|(name, _)| name == noun);
        let able = |part: &GroundedPart| {
            let affordance = reference.affordance.as_ref().is_none_or(|a| part.affordances.contains(a));
            affordance && reference.function.as_ref().is_none_or(|f| part.functions.contains(f))
        };
        let whole_fits = |entry: &&ObjectEntry| called(entry) && entry.parts.iter().any(able);
        if reference.part_of.is_none() && reference.rank.is_none() && wholes.iter().any(whole_fits) {
            return Ok(None);
        }
        let named = |part: &GroundedPart| self.view.library().with_noun(noun).any(|t| t.name == part.template);
        let mut parts: Vec<(PartId, &GroundedPart)> = Vec::new();
        for entry in wholes {
            for (number, part) in entry.parts.iter().enumerate() {
                if part.name != acm_concept::template::WHOLE && named(part) && able(part) {
                    parts.push((PartId { object: entry.id, index: number as u32 }, part));
                }
            }
        }
        if parts.is_empty() {
            return self.no_part(reference);
        }
        if let Some(rank) = reference.rank {
            keep_rank(&mut parts, rank);
        }
        match parts.as_slice() {
            [] => self.no_part(reference),
            [(only, _)] => Ok(Some(*only)),
            [(first, _), ..] if reference.quantity == Quantity::AnyOne => Ok(Some(*first)),
            several => {
                let names = several.iter().map(|(id, _)| id.to_string()).collect::<Vec<_>>().join(" and ");
                let text = format!("which is {}? {names} fit equally", reference.phrase);
                Err(Stuck::give_up(GiveUpCause::Identity, text))
            }
        }
    }

    fn no_part(&self, reference: &ObjectReference) -> Result<Option<PartId>, Stuck> {
        match reference.part_of {
            None => Ok(None),
            Some(whole) => {
                let text = format!("I see no {} of {}", reference.phrase, self.phrase(whole));
                Err(Stuck::look(GiveUpCause::Perception, text))
            }
        }
    }

    /// The object of which a reference means a part; `None` where it means whole objects.
    pub(super) fn whole_of_part(&self, index: ReferenceIndex, depth: u32) -> Result<Option<ObjectId>, Stuck> {
        Ok(self.part_at(index, depth)?.map(|part| part.object))
    }
}

fn keep_rank(parts: &mut Vec<(PartId, &GroundedPart)>, rank: Rank) {
    let spot = |part: &GroundedPart| part.pose.pose.translation;
    let middle = parts.iter().map(|(_, part)| spot(part)).sum::<DVec3>() / parts.len().max(1) as f64;
    let key = |part: &GroundedPart| match rank {
        Rank::FromSide(_, side) => -spot(part).dot(Direction::vector(side)),
        Rank::Middle => spot(part).distance(middle),
    };
    let mut keys: Vec<f64> = parts.iter().map(|(_, part)| key(part)).collect();
    keys.sort_by(f64::total_cmp);
    let number = if let Rank::FromSide(number, _) = rank { number as usize } else { 0 };
    match keys.get(number) {
        Some(&wanted) => parts.retain(|(_, part)| (key(part) - wanted).abs() < RANK_MARGIN_M),
        None => parts.clear(),
    }
}
