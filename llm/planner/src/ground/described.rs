//! What a description says beside noun, colour and place: states, contents, twins, and what was done with a thing.

use super::{Grounder, Stuck, geometry::Extent, history::place_at};
use crate::task::{Handled, ObjectReference};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Term, Truth},
    object::Observability,
};
use acm_memory::{
    MemoryView,
    entry::{Moment, ObjectEntry, TransitionResult},
};
use glam::DVec2;
use std::f64::consts::FRAC_PI_2;

/// How far apart the palettes of one thing in two places and lights usually are, in the measure of [`acm_concept::color::Palette::distance`].
const TWIN_PALETTE: f64 = 0.10;
/// How far a length of one thing that was seen whole twice usually is off, as a logarithm of the ratio; and where some of it
/// was cut off or hidden.
const TWIN_LENGTH: f64 = 0.10;
const TWIN_LENGTH_UNSEEN: f64 = 0.30;
/// What is more unlike than this is no twin, in the measure of [`unlikeness`].
const NO_TWIN: f64 = 12.0;
/// What is less alike than another by this much is not meant.
const TWIN_MARGIN: f64 = 1.0;

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
                let unlike = |entry: &ObjectEntry| {
                    unlikeness(self.view, entry, model).filter(|much| *much < NO_TWIN && entry.id != model.id)
                };
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

/// How much two things differ to the eye: half the sum of the squares of what is unlike, each in the measure of what is usual
/// between two views of one thing: the negative logarithm of the likelihood that they are of one make, but for a constant. What
/// template explains them does not count, as a thing that no template was made for may be taken for one or another.
/// `None` without solids.
fn unlikeness(view: &dyn MemoryView, entry: &ObjectEntry, model: &ObjectEntry) -> Option<f64> {
    let palettes = entry.appearance.palette.distance(&model.appearance.palette) / TWIN_PALETTE;
    let whole = [entry, model].iter().all(|entry| {
        let parameters = entry.parts.iter().flat_map(|part| &part.parameters);
        parameters.into_iter().all(|parameter| parameter.observability == Observability::Observed)
    });
    let usual = if whole { TWIN_LENGTH } else { TWIN_LENGTH_UNSEEN };
    let lengths = extents(view, entry)?.into_iter().zip(extents(view, model)?);
    let lengths = lengths.map(|(a, b)| ((a / b).ln() / usual).powi(2)).sum::<f64>();
    Some(0.5 * (palettes.powi(2) + lengths))
}

/// The longer and the shorter side seen from above and the height, metres; `None` for what has none.
fn extents(view: &dyn MemoryView, entry: &ObjectEntry) -> Option<[f64; 3]> {
    let extent = Extent::now(view, entry)?;
    let yaw = entry.pose()?.yaw();
    let [a, b] = [0.0, FRAC_PI_2].map(|turn| extent.span(DVec2::from_angle(yaw + turn)));
    let all = [a.max(b), a.min(b), extent.high - extent.low];
    all.iter().all(|length| *length > 0.0).then_some(all)
}
