//! How well each parameter is known: by moving it and letting everything else follow.

use super::{
    evidence::Evidence,
    minimise::{Minimum, refit_others},
    model::Model,
};
use acm_concept::object::Observability;

/// Rise of the cost (negative log likelihood) by which a value is excluded.
const EXCLUDED: f64 = 4.5;
/// A length is observed if moving it by this, or by this share of it, is excluded on both sides.
const STEP_M: f64 = 0.012;
const STEP_SHARE: f64 = 0.12;

/// Observability of every template parameter at a minimum: the profile of the likelihood, not the curvature alone,
/// which is blind to faces that nobody saw.
pub(crate) fn observability(model: &Model, evidence: &Evidence, minimum: &Minimum) -> Vec<Observability> {
    (0..model.template.parameters.len()).map(|parameter| one(model, evidence, minimum, parameter)).collect()
}

fn one(model: &Model, evidence: &Evidence, minimum: &Minimum, parameter: usize) -> Observability {
    let Some(index) = model.parameter_index(parameter) else { return Observability::PriorOnly };
    let spec = &model.template.parameters[parameter];
    let value = minimum.state[index];
    let step = STEP_M.max(STEP_SHARE * value.abs()).min(0.25 * (spec.max - spec.min));
    let excluded = |to: f64| {
        let mut state = minimum.state.clone();
        state[index] = to;
        refit_others(model, evidence, &state, index, 2) - minimum.cost > EXCLUDED
    };
    // A bound of the range is no evidence, but beyond it nothing is asked.
    let is_bounded = |to: f64| to <= spec.min || to >= spec.max || excluded(to);
    if is_bounded(value - step) && is_bounded(value + step) {
        return Observability::Observed;
    }
    let (low, high) = (edge(value, -step, spec.min, &excluded), edge(value, step, spec.max, &excluded));
    if high - low > 0.9 * (spec.max - spec.min) {
        Observability::PriorOnly
    } else {
        Observability::Interval { low, high }
    }
}

/// The farthest value in one direction that is not excluded, found by doubling steps.
fn edge(value: f64, step: f64, bound: f64, excluded: &impl Fn(f64) -> bool) -> f64 {
    let mut reach = step;
    for _ in 0..5 {
        let to = value + reach;
        if (step < 0.0 && to <= bound) || (step > 0.0 && to >= bound) {
            return bound;
        }
        if excluded(to) {
            return to;
        }
        reach *= 2.0;
    }
    bound
}
