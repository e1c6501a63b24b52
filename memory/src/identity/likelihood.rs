//! How much better "this percept is that object" explains what is seen than "this percept is something else".
//!
//! All terms are natural logarithms of likelihood ratios, so that they add up and their weights have a meaning.
//! Every Gaussian has a broad outlier class beside it: one wrong number must not split an identity.

use super::{Percept, predict::Prediction};
use crate::geometry::Body;
use acm_concept::{
    color::Appearance,
    object::{GroundedPart, Observability, ParameterEstimate},
    template::{ParameterSpec, TemplateLibrary, Unit},
};
use glam::DVec3;
use std::f64::consts::TAU;

/// Share of newcomers that look like something already known: twins are common.
const TWIN: f64 = 0.5;
/// Smallest volume in which an object that is "elsewhere" may be, cubic metres: a table top, 30 cm high.
const LEAST_ROOM_M3: f64 = 0.3;
/// How far about the outermost things the room goes on, metres.
const ROOM_MARGIN_M: f64 = 0.15;
/// A pair that is this much worse than "new" is not considered, natural logarithm.
const GATE: f64 = 7.0;
/// Logarithm of how often a percept is new where nothing is known of that, for the gate.
const RARELY_NEW: f64 = -3.0;
/// Squared Mahalanobis distance beyond which a place does not explain a percept.
const PLACE_GATE: f64 = 25.0;
/// A fragment fits within a thing if it is longer by no more than this factor.
const FITS_WITHIN: f64 = 1.15;
/// Likelihood ratio of a fragment that fits, whatever template was fitted to it.
const FRAGMENT: f64 = 0.5;
/// Systematic error of a length that all views from one side share, metres: many views do not average it out.
const VIEW_BIAS_M: f64 = 0.004;
/// What perception's own hint is worth, natural logarithm of 3.
const HINT: f64 = 1.1;

/// Scores of one frame: natural log-likelihoods relative to each other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scores {
    /// By percept: the objects (index into the predictions) within the gates, with their scores.
    pub(crate) pairs: Vec<Vec<(usize, f64)>>,
    /// By percept: the score of being none of them, but for how often newcomers are.
    pub(crate) new: Vec<f64>,
    /// By object: whether the camera should see it, so that not finding it tells something.
    pub(crate) due: Vec<bool>,
}

/// Scores all pairs and drops those beyond the gates.
pub(crate) fn scores(percepts: &[Percept<'_>], predictions: &[Prediction], library: &TemplateLibrary) -> Scores {
    let room_m3 = room_m3(percepts, predictions);
    let due = predictions.iter().map(|prediction| prediction.due).collect();
    let mut scores = Scores { pairs: Vec::new(), new: Vec::new(), due };
    for percept in percepts {
        let looks: Vec<f64> =
            predictions.iter().map(|known| look_ratio(Look::seen(percept), Look::known(known), library)).collect();
        let alike = looks.iter().map(|look| look.exp()).sum::<f64>() / (looks.len().max(1) as f64);
        let new = (1.0 - TWIN + TWIN * alike).ln();
        let pair = |(index, (prediction, look)): (usize, (&Prediction, &f64))| {
            let hint = if percept.object.expected == Some(prediction.id) { HINT } else { 0.0 };
            let score = place_ratio(percept, prediction, room_m3) + look + hint;
            (score > new + RARELY_NEW - GATE).then_some((index, score))
        };
        scores.pairs.push(predictions.iter().zip(&looks).enumerate().filter_map(pair).collect());
        scores.new.push(new);
    }
    scores
}

/// Volume of the room, cubic metres: the box round all that is known and seen, with some space about it.
fn room_m3(percepts: &[Percept<'_>], predictions: &[Prediction]) -> f64 {
    let known = predictions.iter().flat_map(|prediction| prediction.places.iter().map(|place| place.position));
    let spots = percepts.iter().map(|percept| percept.pose.pose.translation).chain(known);
    let (low, high) = spots.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), spot| (l.min(spot), h.max(spot)));
    let volume = (high - low + 2.0 * ROOM_MARGIN_M).element_product();
    if volume.is_finite() { volume.max(LEAST_ROOM_M3) } else { LEAST_ROOM_M3 }
}

/// Log ratio of the place: a mixture of where the object may be, against anywhere in the room.
fn place_ratio(percept: &Percept<'_>, prediction: &Prediction, room_m3: f64) -> f64 {
    let seen = &percept.pose;
    let slack = fragment_slack_m(percept, prediction);
    let variance = seen.position_sigma_m * seen.position_sigma_m + DVec3::new(slack * slack, slack * slack, 0.0);
    let mut likelihood = prediction.elsewhere;
    for place in &prediction.places {
        let (offset, variance) = (seen.pose.translation - place.position, variance + place.variance);
        let distance = (offset * offset / variance).element_sum();
        if distance < PLACE_GATE {
            let peak = room_m3 / (TAU.powi(3) * variance.element_product()).sqrt();
            likelihood += place.weight * peak * (-0.5 * distance).exp();
        }
    }
    likelihood.max(1e-12).ln()
}

/// How far the centre of a percept may lie from the object's centre because only a fragment of it was seen.
pub(crate) fn fragment_slack_m(percept: &Percept<'_>, prediction: &Prediction) -> f64 {
    let (seen, known) = (percept.body.extents(), prediction.body.extents());
    let partial = percept.object.truncated
        || percept.parts.iter().flat_map(|part| &part.parameters).any(|p| p.observability != Observability::Observed)
        || seen[0] < 0.85 * known[0]
        || seen[1] < 0.85 * known[1];
    if partial { 0.5 * (known[0] - seen[0]).max(known[1] - seen[1]).max(0.0) } else { 0.0 }
}

/// What something looks like wherever it is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look<'a> {
    pub(crate) parts: &'a [GroundedPart],
    pub(crate) appearance: &'a Appearance,
    pub(crate) body: &'a Body,
    /// Whether something cuts its outline off.
    pub(crate) truncated: bool,
}

impl<'a> Look<'a> {
    /// Of a percept.
    pub(crate) fn seen(percept: &'a Percept<'_>) -> Look<'a> {
        let Percept { object, parts, body, .. } = percept;
        Look { parts, appearance: &object.appearance, body, truncated: object.truncated }
    }
    /// Of a remembered object.
    pub(crate) fn known(prediction: &'a Prediction) -> Look<'a> {
        let Prediction { parts, appearance, body, .. } = prediction;
        Look { parts, appearance, body, truncated: false }
    }
}

/// Log ratio of everything but the place: template, parameters, colour.
pub(crate) fn look_ratio(seen: Look<'_>, known: Look<'_>, library: &TemplateLibrary) -> f64 {
    shape_ratio(seen, known, library) + color_ratio(seen.appearance, known.appearance)
}

/// Log ratio of template and parameters.
pub(crate) fn shape_ratio(percept: Look<'_>, prediction: Look<'_>, library: &TemplateLibrary) -> f64 {
    let (Some(seen), Some(known)) = (percept.parts.first(), prediction.parts.first()) else { return 0.0 };
    let templates = library.iter().count().max(1) as f64;
    if seen.template == known.template {
        let specs = library.get(&seen.template).map_or(&[][..], |template| &template.parameters);
        let ratio = |spec: &ParameterSpec| {
            let find = |part: &'_ GroundedPart| part.parameters.iter().find(|p| p.name == spec.name).cloned();
            match (find(seen), find(known)) {
                (Some(seen), Some(known)) => parameter_ratio(spec, &seen, &known, percept.truncated),
                _ => 0.0,
            }
        };
        return (0.9 * templates).ln() + specs.iter().map(ratio).sum::<f64>();
    }
    // What cuts a thing off decides what its rest looks like: only what is larger than the thing tells against it.
    if percept.truncated {
        let fits = percept.body.extents().iter().zip(prediction.body.extents()).all(|(a, b)| *a < FITS_WITHIN * b);
        return if fits { FRAGMENT } else { FRAGMENT * templates * 0.01 }.ln();
    }
    // Another template was chosen for the same thing: likelier among templates that share a noun and where the
    // outer sizes agree.
    let nouns = |name: &str| library.get(name).map_or(&[][..], |template| &template.synopsis.nouns);
    let shared = nouns(&seen.template).iter().any(|a| nouns(&known.template).iter().any(|b| a.noun == b.noun));
    let deviation: f64 = (percept.body.extents().iter())
        .zip(prediction.body.extents())
        .map(|(a, b)| ((a.max(1e-3) / b.max(1e-3)).ln() / 0.15).powi(2))
        .sum();
    let alike = (-0.5 * deviation).exp();
    let confusion = 0.002 + 0.06 * alike + if shared { 0.04 } else { 0.0 };
    (confusion * templates).ln() + (1.0 + 30.0 * alike).ln()
}

/// Log ratio of one parameter, as the logarithm of its quotient for lengths and as a difference for the rest.
fn parameter_ratio(spec: &ParameterSpec, seen: &ParameterEstimate, known: &ParameterEstimate, truncated: bool) -> f64 {
    if spec.fixed {
        return 0.0;
    }
    let by_quotient = spec.unit == Unit::M && spec.min > 0.0 && seen.value > 0.0 && known.value > 0.0;
    let (offset, sigma, width) = if by_quotient {
        let relative = |p: &ParameterEstimate| (p.sigma.hypot(VIEW_BIAS_M) / p.value).hypot(0.015);
        let sigma = relative(seen).hypot(relative(known));
        ((seen.value / known.value).ln(), sigma, (spec.max / spec.min).ln())
    } else {
        let width = (spec.max - spec.min).max(1e-9);
        (seen.value - known.value, (seen.sigma.powi(2) + known.sigma.powi(2) + (0.02 * width).powi(2)).sqrt(), width)
    };
    let bounds = |p: &ParameterEstimate| match p.observability {
        Observability::Observed => None,
        Observability::Interval { low, high } => Some((low, high)),
        Observability::PriorOnly => Some((f64::NEG_INFINITY, f64::INFINITY)),
    };
    // What cuts an outline off leaves a lower bound.
    let seen_bounds = if truncated { Some((seen.value, f64::INFINITY)) } else { bounds(seen) };
    let slack = 2.0 * (seen.sigma + known.sigma);
    let fits = |value: f64, (low, high): (f64, f64)| value >= low - slack && value <= high + slack;
    match (seen_bounds, bounds(known)) {
        (None, None) => robust(offset, sigma, width, 0.03),
        (Some(range), None) if fits(known.value, range) => 0.0,
        (None, Some(range)) if fits(seen.value, range) => 0.0,
        (Some((low, high)), Some((other_low, other_high)))
            if low <= other_high + slack && other_low <= high + slack =>
        {
            0.0
        }
        _ => 0.03f64.ln(),
    }
}

/// Log ratio of the colour: the a-b plane counts, lightness little, because shading changes it.
pub(crate) fn color_ratio(seen: &Appearance, known: &Appearance) -> f64 {
    let chroma = seen.mean.chroma_distance(&known.mean);
    let (sigma, plane) = (6.0f64, 160.0 * 160.0);
    let peak = plane / (TAU * sigma * sigma);
    let chroma = (0.95 * peak * (-0.5 * (chroma / sigma).powi(2)).exp() + 0.05).ln();
    chroma + robust(seen.mean.l - known.mean.l, 15.0, 100.0, 0.1)
}

/// Log ratio of a Gaussian with an outlier class against a uniform density of the given width.
fn robust(offset: f64, sigma: f64, width: f64, outliers: f64) -> f64 {
    let peak = width / (TAU.sqrt() * sigma);
    ((1.0 - outliers) * peak * (-0.5 * (offset / sigma).powi(2)).exp() + outliers).ln()
}
