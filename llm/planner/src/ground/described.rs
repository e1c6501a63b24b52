//! What a description says beside noun, colour and place: states, contents, twins, and what was done with a thing.

use super::{Grounder, Stuck, geometry::volume, history::place_at};
use crate::task::{Handled, ObjectReference};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Term, Truth},
};
use acm_memory::entry::{Moment, ObjectEntry, TransitionResult};

/// Surfaces within this delta E (CIE76) look alike.
const TWIN_COLOR: f64 = 18.0;
/// Volumes within this ratio look alike.
const TWIN_VOLUME: f64 = 1.5;

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
                contenders.retain(|entry| entry.id != model.id && self.looks_like(entry, model));
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

    fn looks_like(&self, entry: &ObjectEntry, model: &ObjectEntry) -> bool {
        let template = |entry: &ObjectEntry| entry.parts.first().map(|part| part.template.clone());
        let (a, b) = (volume(self.view, entry), volume(self.view, model));
        template(entry) == template(model)
            && entry.appearance.mean.distance(&model.appearance.mean) < TWIN_COLOR
            && a.max(b) <= TWIN_VOLUME * a.min(b)
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
