//! How well each parameter is known: by moving it and letting everything else follow.

use super::{
    evidence::Evidence,
    minimise::{Minimum, refit_others},
    model::Model,
};
use acm_concept::object::Observability;
use glam::DVec2;
use rayon::prelude::*;

/// Rise of the cost (negative log likelihood) by which a value is excluded.
const EXCLUDED: f64 = 4.5;
/// A length is observed if moving it by this, or by this share of it, is excluded on both sides.
const STEP_M: f64 = 0.012;
const STEP_SHARE: f64 = 0.12;

/// What the profiles of the likelihood say of a minimum.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Profile {
    /// How each template parameter is known.
    pub parameters: Vec<Observability>,
    /// Standard deviation of the place, support frame x and y, that the unobserved parameters bring with them: a box
    /// whose far end is hidden may reach farther, and then its middle lies elsewhere. Metres.
    pub drift_m: DVec2,
}

/// Profiles every template parameter at a minimum. The curvature alone is blind to faces that nobody saw.
pub(crate) fn profile(model: &Model, evidence: &Evidence, minimum: &Minimum) -> Profile {
    let of_each = (0..model.template.parameters.len()).into_par_iter().map(|i| one(model, evidence, minimum, i));
    let (parameters, drifts): (Vec<Observability>, Vec<DVec2>) = of_each.unzip();
    let drift2 = drifts.into_iter().map(|drift| drift * drift).sum::<DVec2>();
    Profile { parameters, drift_m: DVec2::new(drift2.x.sqrt(), drift2.y.sqrt()) }
}

fn one(model: &Model, evidence: &Evidence, minimum: &Minimum, parameter: usize) -> (Observability, DVec2) {
    let Some(index) = model.parameter_index(parameter) else { return (Observability::PriorOnly, DVec2::ZERO) };
    let spec = &model.template.parameters[parameter];
    let value = minimum.state[index];
    let step = STEP_M.max(STEP_SHARE * value.abs()).min(0.25 * (spec.max - spec.min));
    // The others follow along the valley, so that the re-fit begins within reach.
    let at = |to: f64, valley: &[f64]| {
        let mut state: Vec<f64> = minimum.state.iter().zip(valley).map(|(v, slope)| v + slope * (to - value)).collect();
        model.clamp(&mut state);
        state[index] = to;
        let (state, cost) = refit_others(model, evidence, &state, index, 2);
        (cost - minimum.cost <= EXCLUDED).then_some(state)
    };
    // At first the valley is what the curvature says, later what the last re-fit found.
    let variance = minimum.covariance[(index, index)].max(1e-12);
    let curved: Vec<f64> = (0..minimum.state.len()).map(|i| minimum.covariance[(i, index)] / variance).collect();
    let slope_to = |state: &[f64]| -> Vec<f64> {
        let run = state[index] - value;
        state.iter().zip(&minimum.state).map(|(to, from)| (to - from) / run).collect()
    };
    let within = |to: f64| to > spec.min && to < spec.max;
    // A bound of the range is no evidence, but beyond it nothing is asked.
    let (below, above) = (value - step, value + step);
    let low_state = if within(below) { at(below, &curved) } else { None };
    let high_state = if within(above) { at(above, &curved) } else { None };
    let Some(moved) = high_state.as_ref().or(low_state.as_ref()) else {
        return (Observability::Observed, DVec2::ZERO);
    };
    let slope = slope_to(moved);
    // The farthest value in one direction that is not excluded, found by doubling steps.
    let edge = |first: Option<&Vec<f64>>, step: f64, bound: f64| {
        let Some(first) = first else { return (value + step).clamp(spec.min, spec.max) };
        let (mut valley, mut reach) = (slope_to(first), 2.0 * step);
        for _ in 0..5 {
            let to = value + reach;
            if !within(to) {
                break;
            }
            let Some(state) = at(to, &valley) else { return to };
            valley = slope_to(&state);
            reach *= 2.0;
        }
        bound
    };
    let low = edge(low_state.as_ref(), -step, spec.min);
    let high = edge(high_state.as_ref(), step, spec.max);
    let drift = DVec2::new(slope[0], slope[1]).abs() * (high - low) / 12f64.sqrt();
    (Observability::Interval { low, high }, drift)
}
