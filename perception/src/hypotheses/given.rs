//! First guess and fit of one template that is given, upright.

use super::{Approach, Measured, Starts, YAW_STEP, canonical};
use crate::{
    fit::{Evidence, Model, approach, cost, minimise},
    given::Estimate,
    measure,
};
use acm_concept::template::Template;

pub(crate) fn guess(template: &Template, measured: &Measured, evidence: &Evidence) -> Option<Estimate> {
    let (model, state) = starts(template, measured, evidence)?.starts.into_iter().next()?;
    Some(read(&model, &state))
}

pub(crate) fn fit(template: &Template, measured: &Measured, evidence: &Evidence) -> Option<Estimate> {
    finish(starts(template, measured, evidence)?.near(evidence).into_iter().next()?, evidence)
}

pub(crate) fn fit_from(
    template: &Template,
    measured: &Measured,
    evidence: &Evidence,
    start: &Estimate,
) -> Option<Estimate> {
    let (model, start) = write(template, measured, start)?;
    let state = approach(&model, evidence, &start);
    finish(Approach { cost: cost(&model, evidence, &state), model, state }, evidence)
}

pub(crate) fn cost_of(
    template: &Template,
    measured: &Measured,
    evidence: &Evidence,
    estimate: &Estimate,
) -> Option<f64> {
    let (model, state) = write(template, measured, estimate)?;
    Some(cost(&model, evidence, &state))
}

fn starts<'a>(template: &'a Template, measured: &Measured, evidence: &Evidence) -> Option<Starts<'a>> {
    let rectangles = measure::rectangles(&measured.plan, YAW_STEP, 0.01);
    Starts::of((template, None), measured, &rectangles, measure::circle(&measured.plan), evidence)
}

/// The fit, under values that the template admits where the same solids have such.
fn finish(Approach { model, state, .. }: Approach, evidence: &Evidence) -> Option<Estimate> {
    let minimum = minimise(&model, evidence, &state);
    let state = canonical(&model, minimum.clone(), evidence).map_or(minimum.state, |canonical| canonical.state);
    Some(read(&model, &state))
}

/// An estimate as a model and its state.
fn write<'a>(template: &'a Template, measured: &Measured, estimate: &Estimate) -> Option<(Model<'a>, Vec<f64>)> {
    let model = Model::new(template, estimate.values.clone(), measured.base)?;
    let mut state = model.start(estimate.pose.translation.truncate(), estimate.pose.yaw());
    model.clamp(&mut state);
    Some((model, state))
}

fn read(model: &Model, state: &[f64]) -> Estimate {
    let placement = model.placement(state);
    Estimate { pose: placement.pose, values: placement.values }
}
