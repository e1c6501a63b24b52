//! Groups: their members in order, and whose turn it is.

use super::{Grounder, Stuck, history::place_at};
use crate::{
    decision::GiveUpCause,
    explanation::ResolvedReference,
    task::{Direction, ObjectReference, Ordering, Quantity, ReferenceIndex},
};
use acm_concept::ids::ObjectId;
use acm_memory::{
    entry::{ObjectEntry, Presence},
    query::Retrieval,
};

impl<'a> Grounder<'a> {
    /// What a closure gives while a group's reference means one of its members.
    pub fn bound<T>(&self, group: ReferenceIndex, member: ObjectId, then: impl FnOnce() -> T) -> T {
        let before = self.turns.borrow_mut().insert(group, member);
        let given = then();
        match before {
            Some(before) => self.turns.borrow_mut().insert(group, before),
            None => self.turns.borrow_mut().remove(&group),
        };
        given
    }

    /// The member whose turn it is, for a group in the middle of one.
    pub(super) fn turn(&self, group: ReferenceIndex) -> Option<ObjectId> {
        self.turns.borrow().get(&group).copied()
    }

    /// The members of a group as the subtask that speaks of it found them, in the order in which they are taken.
    pub fn members(&self, group: ReferenceIndex, order: &Ordering) -> Result<Vec<ObjectId>, Stuck> {
        if let Ordering::Named(members) = order {
            return members.iter().map(|member| Ok(self.object(*member)?.value)).collect();
        }
        let reference = self.reference(group)?;
        let (retrieval, contenders) = self.contenders(group, reference, 0)?;
        let mut members = self.confirmed(contenders)?;
        if let Ordering::From(side) = order {
            let began = self.began(reference.subtask);
            let along = |entry: &&ObjectEntry| {
                place_at(entry, began).map_or(0.0, |(pose, _)| pose.translation.dot(Direction::vector(*side)))
            };
            members.sort_by(|a, b| along(b).total_cmp(&along(a)));
        }
        if let Quantity::Count(wanted) = reference.quantity {
            if (members.len() as u32) < wanted {
                let text = format!("I see {} of {}, and {wanted} are asked for", members.len(), reference.phrase);
                return Err(Stuck::look(GiveUpCause::Perception, text));
            }
            members.truncate(wanted as usize);
        }
        if members.is_empty() {
            return Err(self.none_fits(reference, &retrieval));
        }
        self.keep_group(reference, retrieval, &members);
        Ok(members.iter().map(|entry| entry.id).collect())
    }

    /// The members of a group that are present now.
    pub(super) fn group(&self, index: ReferenceIndex, depth: u32) -> Result<Vec<&'a ObjectEntry>, Stuck> {
        let reference = self.reference(index)?;
        let (retrieval, contenders) = self.contenders(index, reference, depth)?;
        let present = contenders.into_iter().filter(|entry| entry.presence == Presence::Present).collect();
        let present = self.confirmed(present)?;
        self.keep_group(reference, retrieval, &present);
        Ok(present)
    }

    fn keep_group(&self, reference: &ObjectReference, retrieval: Retrieval, members: &[&ObjectEntry]) {
        self.keep(ResolvedReference {
            phrase: reference.phrase.clone(),
            object: None,
            place: None,
            retrieval: Some(retrieval),
            recall: None,
            how: members.iter().map(|entry| entry.id.to_string()).collect::<Vec<_>>().join(", "),
            guessed: false,
        });
    }
}
