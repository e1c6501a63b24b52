//! The paper's identity rule, kept as an ablation: Filter over category and parts, then
//! S = lambda_g S_geom + lambda_T S_pose + lambda_r S_rel, and each percept on its own takes the best object over a
//! threshold (section "Object and Scene Concept Grounding"). The paper states neither weights nor threshold.

use super::{Match, Percept, predict::Prediction};
use acm_concept::template::TemplateLibrary;

const WEIGHT_GEOMETRY: f64 = 0.4;
const WEIGHT_POSE: f64 = 0.4;
const WEIGHT_RELATION: f64 = 0.2;
const THRESHOLD: f64 = 0.5;
/// Relative deviation of a size that halves nothing yet: standard deviation of the geometry score.
const SIZE_SIGMA: f64 = 0.1;
/// Standard deviation of the relation score's overlap, metres.
const NEAR_M: f64 = 0.05;

/// Every percept's best object over the threshold; an object may be taken twice.
pub(crate) fn assign(percepts: &[Percept<'_>], predictions: &[Prediction], library: &TemplateLibrary) -> Vec<Match> {
    let one = |(index, percept): (usize, &Percept<'_>)| {
        let best = predictions
            .iter()
            .filter(|prediction| passes_filter(percept, prediction, library))
            .map(|prediction| (prediction.id, score(percept, prediction, predictions)))
            .fold(None, |best: Option<(_, f64)>, next| match best {
                Some(best) if best.1 >= next.1 => Some(best),
                _ => Some(next),
            });
        let taken = best.filter(|(_, score)| *score > THRESHOLD);
        Match {
            percept: index,
            object: taken.map(|(id, _)| id),
            probability: taken.map_or(1.0 - best.map_or(0.0, |(_, score)| score), |(_, score)| score),
            alternatives: Vec::new(),
            possible: Vec::new(),
        }
    };
    percepts.iter().enumerate().map(one).collect()
}

fn passes_filter(percept: &Percept<'_>, prediction: &Prediction, library: &TemplateLibrary) -> bool {
    let templates = |parts: &[acm_concept::object::GroundedPart]| -> Vec<String> {
        parts.iter().map(|part| part.template.clone()).collect()
    };
    let known = prediction.parts.first().and_then(|part| library.get(&part.template).map(|t| (t, part)));
    let category = &percept.object.category;
    let same_category =
        known.is_some_and(|(template, part)| template.nouns(&part.values()).contains(&category.as_str()));
    templates(&percept.parts) == templates(&prediction.parts) && same_category
}

fn score(percept: &Percept<'_>, prediction: &Prediction, all: &[Prediction]) -> f64 {
    let deviation: f64 = (percept.body.extents().iter())
        .zip(prediction.body.extents())
        .map(|(a, b)| ((a.max(1e-3) / b.max(1e-3)).ln() / SIZE_SIGMA).powi(2))
        .sum::<f64>();
    let geometry = (-0.5 * deviation / 3.0).exp();
    let pose = prediction.places.first().map_or(0.0, |place| {
        let seen = &percept.pose;
        let variance = seen.position_sigma_m * seen.position_sigma_m + place.variance;
        let offset = seen.pose.translation - place.position;
        (-0.5 * (offset * offset / variance).element_sum() / 3.0).exp()
    });
    // The relation kept here is what the object stands on.
    let relation = match prediction.support.and_then(|id| all.iter().find(|other| other.id == id)) {
        Some(support) if support.body.covers(percept.body.centre, 0.0) => 1.0,
        Some(_) => 0.0,
        None => (-0.5 * (percept.body.centre.distance(prediction.body.centre) / NEAR_M).powi(2)).exp(),
    };
    WEIGHT_GEOMETRY * geometry + WEIGHT_POSE * pose + WEIGHT_RELATION * relation
}
