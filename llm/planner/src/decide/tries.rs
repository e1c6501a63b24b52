//! What was tried for the current subtask, and what may be tried again: all of it read from own transitions.

use super::Mind;
use crate::{
    decision::{GiveUpCause, Unknown},
    search::{Limits, brings_about},
    task::MannerKind,
};
use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Evidence, Literal, Truth},
};
use acm_memory::entry::{Moment, Transition, TransitionResult};
use std::collections::BTreeMap;

/// Failures in a row of one skill on one object in one subtask.
const MAX_FAILURES: u32 = 3;
/// Tries of one skill on one object in one subtask, verified ones included, beyond those that the goal asks for.
const MAX_TRIES: u32 = 8;
/// Confidence from which a felt literal stands in for a verdict that could not be given.
const FELT_ENOUGH: f64 = 0.5;

impl Mind<'_> {
    /// When the current subtask began.
    pub(super) fn since(&self) -> Moment {
        self.view.progress().current_since()
    }

    /// Own transitions that serve the current subtask.
    pub(super) fn tries(&self) -> impl Iterator<Item = &Transition> {
        let since = self.since();
        let serves = move |t: &&Transition| t.subtask == Some(self.current) && t.moment >= since;
        self.view.transitions().iter().filter(serves)
    }

    /// Those of them that came after a moment and did what they should.
    pub(super) fn successes(&self, since: Moment) -> impl Iterator<Item = &Transition> {
        self.tries().filter(move |t| t.moment > since && took_effect(t))
    }

    /// When, after a moment, the current subtask first brought a literal about; `None` if it did not.
    pub(super) fn brought_about(&self, literal: &Literal, since: Moment) -> Option<Moment> {
        self.successes(since).find(|t| brings_about(self.view, t, literal)).map(|t| t.moment)
    }

    /// Whether a function was performed on an object often enough since a moment of the subtask.
    pub(super) fn performed(&self, function: &str, object: ObjectId, times: u32, since: Moment) -> Belief {
        let counts = |t: &&Transition| t.skill() == function && t.object() == object;
        let counted: Vec<&Transition> = self.successes(since).filter(counts).collect();
        let done = counted.len() as u32;
        Belief {
            truth: if done >= times { Truth::Yes } else { Truth::No },
            confidence: 1.0,
            evidence: counted.iter().map(|t| Evidence::Transition(t.id)).collect(),
            reason: format!("{done} of {times} verified since the subtask began"),
        }
    }

    /// What the instruction names as a place for what has to be put aside, as far as it can be told.
    fn aside(&self) -> Vec<ObjectId> {
        let named = self.task.manners.iter().filter_map(|manner| match manner.kind {
            MannerKind::Aside(reference) => Some(reference),
            MannerKind::OneAtATime | MannerKind::OneToAPlace => None,
        });
        named.filter_map(|reference| Some(self.ground.object(reference).ok()?.value)).collect()
    }

    /// What may be tried again, from the tries of this subtask; with the last failure.
    pub(super) fn limits(&self, times: u32) -> (Limits, Option<Unknown>) {
        let mut tries: BTreeMap<(String, ObjectId), u32> = BTreeMap::new();
        let mut limits = Limits { untouched: self.ground.untouched(), aside: self.aside(), ..Limits::default() };
        let mut last_failure = None;
        for transition in self.tries() {
            let tried = (transition.skill().to_owned(), transition.object());
            *tries.entry(tried.clone()).or_default() += 1;
            let failures = limits.failures.entry(tried.clone()).or_default();
            if took_effect(transition) {
                *failures = 0;
                continue;
            }
            *failures += 1;
            let (cause, reason) = match &transition.result {
                TransitionResult::Failed { cause, reason } => ((*cause).into(), reason.clone()),
                _ => (GiveUpCause::Perception, "what it brought about could not be told".to_owned()),
            };
            let text = format!("{} of {} did not work in {failures} tries: {reason}", tried.0, tried.1);
            if *failures >= MAX_FAILURES {
                limits.spent.insert(tried, text.clone());
            }
            last_failure = Some(Unknown { cause, text });
        }
        for (tried, count) in tries {
            if count >= MAX_TRIES + times {
                let text = format!("{} of {} was done {count} times without getting there", tried.0, tried.1);
                last_failure.get_or_insert(Unknown { cause: GiveUpCause::Plan, text: text.clone() });
                limits.spent.entry(tried).or_insert(text);
            }
        }
        let left_out = self.avoided.iter().map(|a| ((a.skill.clone(), a.object), a.reason.clone()));
        limits.spent.extend(left_out);
        (limits, last_failure)
    }
}

/// Whether a transition brought about what it should: verified, or not decidable by sight but felt.
pub(super) fn took_effect(transition: &Transition) -> bool {
    match &transition.result {
        TransitionResult::Verified => true,
        TransitionResult::CannotTell | TransitionResult::Pending => {
            let report = &transition.report;
            let felt = |wanted: &Literal| report.felt.iter().any(|(l, c)| l == wanted && *c >= FELT_ENOUGH);
            report.failure.is_none() && !transition.predicted.is_empty() && transition.predicted.iter().all(felt)
        }
        TransitionResult::Failed { .. } => false,
    }
}
