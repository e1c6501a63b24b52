//! What a description says beside noun, colour and place: states, contents, twins, and what was done with a thing.

use super::{Grounder, Stuck, history::place_at};
use crate::task::{Handled, ObjectReference};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Term, Truth},
};
use acm_memory::entry::{Moment, ObjectEntry, TransitionResult};

/// Surfaces within this delta E (CIE76) look alike.
const TWIN_COLOR: f64 = 18.0;
/// Lengths within this ratio look alike.
const TWIN_LENGTH: f64 = 1.25;
/// What is less alike than another by this much, in the measure of [`unlikeness`], is not meant.
const TWIN_MARGIN: f64 = 0.3;

impl<'a> Grounder<'a> {
    /// Keeps those that fit what else the description says.
    pub(super) fn keep_described(
        &self,
        reference: &ObjectReference,
        contenders: &mut Vec<&'a ObjectEntry>,
        began: Option<Moment>,
        depth: u32,
    ) -> Result<(), Stuck> {
        if let Some(model) = reference.twin_of {
            let model = self.object_at(model, depth + 1)?.value;
            if let Some(model) = self.view.object(model) {
                let unlike = |entry: &ObjectEntry| unlikeness(entry, model).filter(|_| entry.id != model.id);
                let least = contenders.iter().filter_map(|entry| unlike(entry)).fold(f64::INFINITY, f64::min);
                contenders.retain(|entry| unlike(entry).is_some_and(|much| much <= least + TWIN_MARGIN));
            }
        }
        for &content in &reference.contains {
            let content = self.object_at(content, depth + 1)?.value;
            let carrier = self.view.object(content).and_then(|entry| place_at(entry, began)).and_then(|(_, on)| on);
            contenders.retain(|entry| Some(entry.id) == carrier);
        }
        for (predicate, holds) in &reference.states {
            // What is not decided is not excluded: a state that must hold may be brought about first.
            let wrong = if *holds { Truth::No } else { Truth::Yes };
            let fits = |entry: &&ObjectEntry| {
                let literal = Literal::new(predicate, vec![Term::Object(entry.id)]);
                self.view.belief(&literal).truth != wrong
            };
            if contenders.iter().any(fits) {
                contenders.retain(fits);
            }
        }
        if let Some(handled) = &reference.handled {
            let meant = self.handled(handled);
            contenders.retain(|entry| Some(entry.id) == meant);
        }
        Ok(())
    }

    /// The object that was the n-th of those with which the agent brought something about since it was instructed.
    fn handled(&self, handled: &Handled) -> Option<ObjectId> {
        let instructed = self.view.progress().instructed;
        let mut objects: Vec<ObjectId> = Vec::new();
        for transition in self.view.transitions().iter().filter(|transition| transition.moment >= instructed) {
            let failed = matches!(transition.result, TransitionResult::Failed { .. });
            let brought = transition.predicted.iter().any(|l| l.predicate == handled.effect && !l.negated);
            if brought && !failed && !objects.contains(&transition.object()) {
                objects.push(transition.object());
            }
        }
        let number = match usize::try_from(handled.rank) {
            Ok(rank) => rank,
            Err(_) => objects.len().checked_sub(handled.rank.unsigned_abs() as usize)?,
        };
        objects.get(number).copied()
    }
}

/// How much two things of one make differ: the largest difference, of colour or of a parameter, over what still looks alike.
/// `None` for things of different makes, or that differ by more.
fn unlikeness(entry: &ObjectEntry, model: &ObjectEntry) -> Option<f64> {
    if entry.parts.len() != model.parts.len() {
        return None;
    }
    let mut most = entry.appearance.mean.distance(&model.appearance.mean) / TWIN_COLOR;
    for (part, like) in entry.parts.iter().zip(&model.parts) {
        if part.template != like.template {
            return None;
        }
        for parameter in &part.parameters {
            let other = like.value(&parameter.name)?;
            let (low, high) = (parameter.value.abs().min(other.abs()), parameter.value.abs().max(other.abs()));
            if high > 0.0 {
                most = most.max((high / low.max(f64::MIN_POSITIVE)).ln() / TWIN_LENGTH.ln());
            }
        }
    }
    (most <= 1.0).then_some(most)
}
