//! What a description says beside noun, colour and place: states, contents, twins, and what was done with a thing.

use super::{Grounder, Stuck, geometry::Extent, history::place_at};
use crate::task::{Handled, ObjectReference};
use acm_concept::{
    color::Palette,
    ids::ObjectId,
    literal::{Literal, Term, Truth},
    object::Observability,
};
use acm_memory::{
    MemoryView,
    entry::{Moment, ObjectEntry, Presence, TransitionResult},
};
use glam::DVec2;
use std::f64::consts::FRAC_PI_2;

/// How far apart the palettes of one thing in two places and lights usually are, in the measure of [`acm_concept::color::Palette::distance`].
const TWIN_PALETTE: f64 = 0.10;
/// How far a length of one thing that was seen whole twice usually is off, as a logarithm of the ratio; and where some of it
/// was cut off or hidden.
const TWIN_LENGTH: f64 = 0.10;
const TWIN_LENGTH_UNSEEN: f64 = 0.30;
/// What is more unlike than this is no twin, in the measure of [`unlike`].
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

/// What the eye compares of a thing.
struct Look {
    palette: Palette,
    /// The longer and the shorter side seen from above and the height, metres.
    extents: [f64; 3],
    /// Whether all of that was seen.
    whole: bool,
}

impl Look {
    /// `None` for what has no solids.
    fn of(view: &dyn MemoryView, entry: &ObjectEntry) -> Option<Look> {
        let extent = Extent::now(view, entry)?;
        let yaw = entry.pose()?.yaw();
        let [a, b] = [0.0, FRAC_PI_2].map(|turn| extent.span(DVec2::from_angle(yaw + turn)));
        let extents = [a.max(b), a.min(b), extent.high - extent.low];
        let mut parameters = entry.parts.iter().flat_map(|part| &part.parameters);
        let whole = parameters.all(|parameter| parameter.observability == Observability::Observed);
        let is_solid = extents.iter().all(|length| *length > 0.0);
        is_solid.then_some(Look { palette: entry.appearance.palette, extents, whole })
    }
    /// Of what the camera shows of it: its top and one long side, square metres.
    fn area(&self) -> f64 {
        let [long, short, high] = self.extents;
        long * (short + high)
    }
    /// The look of this with another thing on top of it.
    fn under(&self, upper: &Look) -> Look {
        let share = upper.area() / (self.area() + upper.area());
        let [long, short, high] = self.extents;
        Look {
            palette: self.palette.towards(&upper.palette, share),
            extents: [long, short, high + upper.extents[2]],
            whole: self.whole && upper.whole,
        }
    }
    /// A thing as it is, and with what stands on it: a thing of two parts may be taken for two.
    fn readings(view: &dyn MemoryView, entry: &ObjectEntry) -> Vec<Look> {
        let Some(alone) = Look::of(view, entry) else { return Vec::new() };
        let on_it = |other: &&ObjectEntry| other.support == Some(entry.id) && other.presence == Presence::Present;
        let upper = view.objects().iter().filter(on_it).filter_map(|other| Look::of(view, other));
        let stacked: Vec<Look> = upper.map(|upper| alone.under(&upper)).collect();
        std::iter::once(alone).chain(stacked).collect()
    }
}

/// How much two things differ to the eye, as they are or with what stands on either; `None` without solids.
fn unlikeness(view: &dyn MemoryView, entry: &ObjectEntry, model: &ObjectEntry) -> Option<f64> {
    let models = Look::readings(view, model);
    let pairs = Look::readings(view, entry).into_iter();
    let unlike = pairs.flat_map(|own| models.iter().map(move |model| unlike(&own, model)));
    unlike.min_by(f64::total_cmp)
}

/// Half the sum of the squares of what is unlike, each in the measure of what is usual between two views of one thing: the
/// negative logarithm of the likelihood that they are of one make, but for a constant. What template explains them does not
/// count, as a thing that no template was made for may be taken for one or another.
fn unlike(one: &Look, other: &Look) -> f64 {
    let palettes = one.palette.distance(&other.palette) / TWIN_PALETTE;
    let usual = if one.whole && other.whole { TWIN_LENGTH } else { TWIN_LENGTH_UNSEEN };
    let lengths = one.extents.iter().zip(other.extents).map(|(a, b)| ((a / b).ln() / usual).powi(2)).sum::<f64>();
    0.5 * (palettes.powi(2) + lengths)
}
