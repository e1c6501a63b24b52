//! What is left of an event once some objects are forgotten: nothing of what they are, where they were, or what was done
//! to them.

use crate::{
    event::{Change, Event},
    project::mentioned,
};
use acm_concept::{
    ids::{ObjectId, TransitionId},
    literal::{Evidence, Literal, Place, Term},
};
use serde::Serialize;
use std::collections::BTreeSet;

/// The forgotten objects, and the transitions that go with them.
#[derive(Debug)]
pub(crate) struct Dropped<'a> {
    objects: &'a BTreeSet<ObjectId>,
    transitions: BTreeSet<TransitionId>,
}

impl<'a> Dropped<'a> {
    pub(crate) fn new(objects: &'a BTreeSet<ObjectId>) -> Dropped<'a> {
        Dropped { objects, transitions: BTreeSet::new() }
    }
    fn has(&self, id: ObjectId) -> bool {
        self.objects.contains(&id)
    }
    /// Whether a value speaks of a forgotten object anywhere.
    fn speaks_of(&self, value: &impl Serialize) -> bool {
        let text = serde_json::to_vec(value).unwrap_or_default();
        mentioned(&text).into_iter().any(|id| self.has(ObjectId(id.into())))
    }
    fn literals(&self, literals: &mut Vec<Literal>) {
        literals.retain(|literal| !self.speaks_of(literal));
    }
    fn place(&self, place: &mut Place) {
        place.support = place.support.filter(|id| !self.has(*id));
    }
}

/// The event without what is forgotten; `None` if nothing is left of it.
pub(crate) fn event(mut event: Event, dropped: &mut Dropped<'_>) -> Option<Event> {
    event.evidence.retain(|evidence| match evidence {
        Evidence::Inferred(text) => !dropped.speaks_of(text),
        Evidence::Transition(id) => !dropped.transitions.contains(id),
        Evidence::Frame(_) => true,
    });
    match &mut event.change {
        Change::Object(believed) => {
            let (entry, track) = (&mut believed.entry, &mut believed.track);
            if dropped.has(entry.id) {
                return None;
            }
            entry.support = entry.support.filter(|id| !dropped.has(*id));
            entry.ambiguous_with.retain(|(id, _)| !dropped.has(*id));
            dropped.literals(&mut entry.state);
            track.unconfirmed = track.unconfirmed.filter(|id| !dropped.transitions.contains(id));
            if track.doubt.as_ref().is_some_and(|doubt| dropped.speaks_of(doubt)) {
                track.doubt = None;
            }
        }
        Change::History { object, entry } => {
            if dropped.has(*object) {
                return None;
            }
            if let Some(place) = &mut entry.place {
                dropped.place(place);
            }
        }
        Change::Transition(transition) => {
            let report = &mut transition.report;
            let part = report.invocation.part.object;
            let held = report.held.map(|(id, _)| id).or(report.invocation.held.as_ref().map(|(id, ..)| *id));
            if dropped.has(part) || held.is_some_and(|id| dropped.has(id)) {
                dropped.transitions.insert(transition.id);
                return None;
            }
            report.invocation.obstacles.retain(|(id, _)| !dropped.has(*id));
            if let Some(place) = &mut report.invocation.destination {
                dropped.place(place);
            }
            report.felt.retain(|(literal, _)| !dropped.speaks_of(literal));
            for literals in [&mut transition.before, &mut transition.predicted, &mut transition.after] {
                dropped.literals(literals);
            }
        }
        Change::Settled { transition, after, .. } => {
            if dropped.transitions.contains(transition) {
                return None;
            }
            dropped.literals(after);
        }
        Change::TakenBack { transitions, .. } => transitions.retain(|id| !dropped.transitions.contains(id)),
        Change::Skill(skill) => {
            skill.transitions.retain(|id| !dropped.transitions.contains(id));
            skill.failures.retain(|id| !dropped.transitions.contains(id));
            skill.preconditions.retain(|literal| {
                !literal.arguments.iter().any(|term| match term {
                    Term::Object(id) => dropped.has(*id),
                    Term::Part(part) => dropped.has(part.object),
                    _ => false,
                })
            });
        }
        Change::Frame(glance) => glance.visibility.retain(|(id, _)| !dropped.has(*id)),
        // A merge or split in which one took part could not be undone without it: it stays for what it came to.
        Change::Regrouped(regrouping) => {
            regrouping.before = crate::event::Slice::default();
            let after = &mut regrouping.after;
            after.objects.retain(|whole| !dropped.has(whole.entry.id) && !dropped.speaks_of(whole));
            after.transitions.retain(|transition| !dropped.speaks_of(transition));
        }
        Change::Compacted(rest) => {
            rest.regrouped.retain(|regrouping| !dropped.speaks_of(regrouping));
            if let Some(glance) = &mut rest.glance {
                glance.visibility.retain(|(id, _)| !dropped.has(*id));
            }
        }
        Change::Forgotten(forget) => forget.objects.retain(|id| !dropped.has(*id)),
        Change::EpisodeBegan
        | Change::Instructed { .. }
        | Change::SubtaskDone { .. }
        | Change::Support(_)
        | Change::Wiped(_) => {}
    }
    // Sentences of failures and verdicts may name it too: an event that still does goes as a whole.
    if dropped.speaks_of(&event) {
        if let Change::Transition(transition) = &event.change {
            dropped.transitions.insert(transition.id);
        }
        return None;
    }
    Some(event)
}
