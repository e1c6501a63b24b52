//! What tools say of a segment, weighed against geometry: odds of templates, and one more start of the fit.

use super::{Hypothesis, canonical};
use crate::{
    fit::{Evidence, Model, approach, minimise},
    scene::Scene,
};
use acm_concept::{pose::Pose, template::Rest};
use glam::{DQuat, DVec3};

/// A ranking of templates raises or lowers odds by no more than this factor, as a logarithm: geometry that explains a
/// segment clearly better is not overruled.
const MOST_SAID: f64 = 5.0;

/// Adds a tool's log likelihoods to the odds. A template that the tool does not name counts as its least likely one, less
/// one.
pub(crate) fn weigh(ranked: &mut [Hypothesis], log_likelihoods: &[(String, f64)]) {
    let most = log_likelihoods.iter().map(|(_, value)| *value).fold(f64::NEG_INFINITY, f64::max);
    let least = log_likelihoods.iter().map(|(_, value)| *value).fold(f64::INFINITY, f64::min);
    if log_likelihoods.is_empty() {
        return;
    }
    for hypothesis in ranked.iter_mut() {
        let said = log_likelihoods.iter().find(|(template, _)| *template == hypothesis.model.template.name);
        let value = said.map_or(least - 1.0, |(_, value)| *value);
        hypothesis.probability *= (value - most).max(-MOST_SAID).exp();
    }
    normalise(ranked);
}

fn normalise(ranked: &mut [Hypothesis]) {
    let total: f64 = ranked.iter().map(|hypothesis| hypothesis.probability).sum();
    if total > 0.0 {
        ranked.iter_mut().for_each(|hypothesis| hypothesis.probability /= total);
    }
    ranked.sort_by(|a, b| b.probability.total_cmp(&a.probability));
}

/// Fits the best hypothesis once more, beginning from values and a pose in the world. The better minimum is kept.
/// Returns whether that is the new one, or why the start is none.
pub(crate) fn restart(
    scene: &Scene,
    evidence: &Evidence,
    ranked: &mut [Hypothesis],
    (values, pose): (&[f64], &Pose),
) -> Result<bool, String> {
    let Some(best) = ranked.first_mut() else { return Ok(false) };
    let template = best.model.template;
    if !template.admits(&template.named(values)) {
        return Err("values that the template does not admit".into());
    }
    let place = scene.world.inverse() * *pose;
    let upright = (place.rotation * DVec3::Z).z > UPRIGHT_COSINE;
    let rest =
        if upright { None } else { template.rests.iter().find(|rest| rest.holds(place.rotation.inverse() * DVec3::Z)) };
    if !upright && rest.is_none() {
        return Err("a stance in which the template neither stands nor rests".into());
    }
    let Some(model) = Model::new(template, values.to_vec(), best.model.base) else {
        return Err("values at which the template has no symmetry".into());
    };
    let model = model.lying(rest);
    let start = model.start(middle(&model, values, &place), heading(rest, &place));
    let minimum = minimise(&model, evidence, &approach(&model, evidence, &start));
    let Some(minimum) = canonical(&model, minimum, evidence) else { return Ok(false) };
    if minimum.cost >= best.minimum.cost {
        return Ok(false);
    }
    let misfit = best.minimum.cost / (0.5 * evidence.independent()).max(1.0);
    let gain = ((best.minimum.cost - minimum.cost) / misfit.max(1.0)).min(MOST_SAID);
    let score = best.score + best.minimum.cost - minimum.cost;
    *best = Hypothesis { model, minimum, score, probability: best.probability * gain.exp(), tracked: None };
    normalise(ranked);
    Ok(true)
}

/// A part whose axis is within about 20 degrees of the vertical is taken to stand.
const UPRIGHT_COSINE: f64 = 0.94;

fn heading(rest: Option<&Rest>, place: &Pose) -> f64 {
    let turn = rest.map_or(DQuat::IDENTITY, |rest| rest.turn());
    Pose::new(DVec3::ZERO, place.rotation * turn.inverse()).yaw()
}

/// Where a model begins: its base frame of an upright part, else the middle of what it covers.
fn middle(model: &Model, values: &[f64], place: &Pose) -> glam::DVec2 {
    let solids = model.template.solids(&model.template.named(values)).unwrap_or_default();
    if model.rest.is_none() || solids.is_empty() {
        return place.translation.truncate();
    }
    let sum: DVec3 = solids.iter().map(|solid| place.transform_point(solid.pose.translation)).sum();
    (sum / solids.len() as f64).truncate()
}
