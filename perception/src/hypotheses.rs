//! Which template a segment is: every template is fitted and the fits are ranked by penalised likelihood, the
//! template's prior and the words of the instruction.

pub(crate) mod advised;
pub(crate) mod given;
mod misfit;
mod tipped;

pub(crate) use misfit::Misfit;

use crate::{
    config::GrounderConfig,
    expected::{Known, solids},
    fit::{Base, Evidence, Minimum, Model, approach, cost, minimise, rough_cost},
    measure::{self, Rectangle},
};
use acm_concept::{
    object::GroundedPart,
    pose::Pose,
    template::{Rest, SeenBy, Template, TemplateLibrary, Unit},
};
use glam::{DQuat, DVec2, DVec3, Vec2Swizzles};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::{collections::BTreeMap, f64::consts::FRAC_PI_2};

/// What is measured of a segment, and where it stands.
#[derive(Debug, Clone)]
pub(crate) struct Measured {
    /// Points seen from above, support frame.
    pub plan: Vec<DVec2>,
    /// Height of the top over the base, metres.
    pub height_m: f64,
    pub base: Base,
    pub seen_by: SeenBy,
}

/// What raises or lowers the odds of templates besides geometry.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Context<'a> {
    pub library: &'a TemplateLibrary,
    pub config: &'a GrounderConfig,
    /// Nouns of the instruction.
    pub nouns: &'a [String],
    /// Whether parts may lie in another rest than upright; it costs time.
    pub lying: bool,
    /// The main parts of what memory expects in this frame and does not find in its place.
    pub displaced: &'a [GroundedPart],
    /// What memory expects here.
    pub remembered: Option<Known<'a>>,
}

impl Context<'_> {
    /// Whether a template is tried: one on call only where the instruction names such a thing or memory knows one.
    pub fn tries(&self, template: &Template) -> bool {
        let named = || template.synopsis.nouns.iter().any(|noun| self.nouns.contains(&noun.noun));
        let known = || {
            let expected = self.remembered.iter().map(|known| known.part);
            expected.chain(self.displaced).any(|part| part.template == template.name)
        };
        !template.on_call || template.stands_alone && (named() || known())
    }
}

/// One template with its fit.
#[derive(Debug, Clone)]
pub(crate) struct Hypothesis<'a> {
    pub model: Model<'a>,
    pub minimum: Minimum,
    /// Penalised log likelihood with the template's odds.
    pub score: f64,
    /// Posterior probability among the hypotheses that were tried.
    pub probability: f64,
    /// The remembered part whose parameters were taken over, so that only the place was fitted.
    pub tracked: Option<&'a GroundedPart>,
}

/// What is known is recognised if its cost is at most so many times what noise explains, and it explains these shares
/// of the surface and of the outline.
const RECOGNISED_MISFIT: f64 = 1.2;
const RECOGNISED: f64 = 0.93;
const RECOGNISED_OUTLINE: f64 = 0.85;
/// Headings that are tried as starts: a quarter turn in steps of 7.5 degrees.
const YAW_STEP: f64 = std::f64::consts::PI / 24.0;
/// A thing of which more than this share of the outline is cut off may take over its remembered size.
const TRACKED_CUT: f64 = 0.15;
/// After a rough fit, templates with a higher cost (negative log likelihood) than this many times the best one's, and
/// this much more, are dropped.
const HOPELESS_FACTOR: f64 = 1.5;
const HOPELESS_COST: f64 = 25.0;
/// Before any fit, templates whose best start costs more than this many times the best one's, and this much more, are
/// dropped.
const FORLORN_FACTOR: f64 = 4.0;
const FORLORN_COST: f64 = 100.0;
/// Shares of its range at which a hinge is tried.
const OPENED: [f64; 2] = [0.25, 0.65];
/// Rough fits look at every so many-th point.
const ROUGHLY: usize = 2;
/// A segment that is not longer than this many times its width may be a thing that is wider than long.
const NEARLY_SQUARE: f64 = 1.3;
/// Starts that are fitted of each template.
const STARTS: usize = 2;

/// All templates that can explain a segment, the most probable first.
pub(crate) fn rank<'a>(context: Context<'a>, measured: &Measured, evidence: &Evidence) -> Vec<Hypothesis<'a>> {
    if let Some(known) = recognise(context, measured, evidence) {
        return vec![known];
    }
    let rectangles = measure::rectangles(&measured.plan, YAW_STEP, 0.01);
    let circle = measure::circle(&measured.plan);
    let templates =
        context.library.iter().filter(|template| template.seen_by == measured.seen_by && context.tries(template));
    // A rest that looks like an upright part of other sizes brings nothing that the upright stance does not.
    let lying = |rest: &&Rest| context.lying && !rest.like_upright;
    let stances = templates.flat_map(|template| {
        let rests = template.rests.iter().filter(lying).map(Some);
        std::iter::once(None).chain(rests).map(move |rest| (template, rest))
    });
    let stances: Vec<_> = stances.collect();
    let rough = evidence.thinned(ROUGHLY);
    let of = |stance| Starts::of(stance, measured, &rectangles, circle, &rough);
    let starts: Vec<Starts> = stances.into_par_iter().filter_map(of).collect();
    let least = starts.iter().map(|s| s.rough).fold(f64::INFINITY, f64::min);
    // What is far behind before any fit is not worth a rough one.
    let near: Vec<Approach> = starts
        .into_par_iter()
        .filter(|s| s.rough < FORLORN_FACTOR * least + FORLORN_COST)
        .flat_map_iter(|s| s.near(&rough))
        .collect();
    let best = near.iter().map(|a| a.cost).fold(f64::INFINITY, f64::min);
    // What is far behind after the rough fit is not worth a fine one, unless what was ahead does not admit what it comes to.
    let (promising, rest): (Vec<Approach>, Vec<Approach>) =
        near.into_iter().partition(|a| a.cost < HOPELESS_FACTOR * best + HOPELESS_COST);
    let fitted = |Approach { model, state, .. }: Approach<'a>| {
        let minimum = canonical(&model, minimise(&model, evidence, &state), evidence)?;
        let score = score(context, &model, &minimum, evidence);
        Some(Hypothesis { model, minimum, score, probability: 0.0, tracked: None })
    };
    let mut scored: Vec<Hypothesis<'a>> = promising.into_par_iter().filter_map(fitted).collect();
    if scored.is_empty() {
        scored = rest.into_par_iter().filter_map(fitted).collect();
    }
    scored.sort_by(|a, b| b.score.total_cmp(&a.score));
    // Of what was fitted along and across the better counts.
    let mut seen: Vec<(&str, Option<DQuat>)> = Vec::new();
    scored.retain(|found| {
        let stance = (found.model.template.name.as_str(), found.model.rest.map(Rest::turn));
        let new = !seen.contains(&stance);
        seen.push(stance);
        new
    });
    scored.extend(track(context, measured, &rectangles, evidence));
    scored.sort_by(|a, b| b.score.total_cmp(&a.score));
    if let Some(other) = scored.first().and_then(|best| tipped::read_anew(context, best, evidence)) {
        scored.insert(0, other);
    }
    let Some(best) = scored.first().map(|best| best.score) else { return Vec::new() };
    // Where even the best fits badly the likelihoods of all are less sure than they look.
    let misfit = scored.first().map_or(1.0, |h| h.minimum.cost / (0.5 * evidence.independent()).max(1.0));
    let temperature = misfit.max(1.0);
    let odds: Vec<f64> = scored.iter().map(|h| ((h.score - best) / temperature).exp()).collect();
    let total: f64 = odds.iter().sum();
    scored.into_iter().zip(odds).map(|(h, odd)| Hypothesis { probability: odd / total, ..h }).collect()
}

/// What memory knows and what explains the evidence as well as noise lets anything do, fitted from where it is expected:
/// no other template is tried. Of what is settled only the place is fitted.
pub(crate) fn recognise<'a>(context: Context<'a>, measured: &Measured, evidence: &Evidence) -> Option<Hypothesis<'a>> {
    // What is not settled must be seen whole: of what is cut off the ranking decides whether memory's sizes are taken over.
    let whole = evidence.cut_share() <= TRACKED_CUT;
    let Known { part, settled } = context.remembered.filter(|known| known.settled || whole)?;
    let (model, (at, yaw)) = as_remembered(context, part, measured)?;
    let (model, tracked) = if settled { (model.rigid(), Some(part)) } else { (model, None) };
    let start = model.start(at, yaw);
    let fitted = |start: &[f64]| {
        let minimum = canonical(&model, minimise(&model, evidence, start), evidence)?;
        let score = score(context, &model, &minimum, evidence);
        let found = Hypothesis { model: model.clone(), minimum, score, probability: 1.0, tracked };
        let (on_surface, on_outline) = found.explained(evidence);
        let misfit = found.minimum.cost / (0.5 * evidence.independent()).max(1.0);
        (misfit < RECOGNISED_MISFIT && on_surface > RECOGNISED && on_outline > RECOGNISED_OUTLINE).then_some(found)
    };
    // What has not moved is near enough as it is.
    fitted(&start).or_else(|| fitted(&approach(&model, &evidence.thinned(ROUGHLY), &start)))
}

/// A template brought near to a minimum.
struct Approach<'a> {
    model: Model<'a>,
    state: Vec<f64>,
    cost: f64,
}

/// The best starts of a template in a stance.
struct Starts<'a> {
    starts: Vec<(Model<'a>, Vec<f64>)>,
    /// Rough cost of the first.
    rough: f64,
    /// Whether the second lies across the first.
    both: bool,
}

impl<'a> Starts<'a> {
    fn of(
        (template, rest): (&'a Template, Option<&'a Rest>),
        measured: &Measured,
        rectangles: &[Rectangle],
        circle: Option<(DVec2, f64)>,
        evidence: &Evidence,
    ) -> Option<Starts<'a>> {
        let smallest = measure::smallest(rectangles)?;
        let fallback = (smallest.centre, 0.25 * (smallest.length + smallest.width));
        let (centre, radius) =
            circle.filter(|(_, r)| *r < smallest.length && *r > 0.2 * smallest.length).unwrap_or(fallback);
        let height_m = measured.height_m.max(0.0);
        let start_at = |(rectangle, along): (&Rectangle, DVec2)| {
            let measures = match rest {
                None => [rectangle.length, rectangle.width, height_m, radius],
                Some(rest) => upright_measures(rest, along.extend(height_m)),
            };
            let values = template.initial_values(measures).map_or(Vec::new(), |initial| opened(template, initial));
            // The measures are along the longer side, or across it.
            let quarter = if along.x < along.y { FRAC_PI_2 } else { 0.0 };
            let started = move |values: Vec<f64>| {
                let model = Model::new(template, values, measured.base)?.lying(rest);
                let at = if model.turns { rectangle.centre } else { centre };
                let start = model.start(at, rectangle.yaw + quarter);
                Some((model, start))
            };
            values.into_iter().filter_map(started).collect::<Vec<_>>()
        };
        // In another rest either side of the rectangle may be the part's own height.
        let ways = |rectangle| {
            let sides = |r: &Rectangle| DVec2::new(r.length, r.width);
            let across = rest.map(|_| (rectangle, sides(rectangle).yx()));
            std::iter::once((rectangle, sides(rectangle))).chain(across)
        };
        let square = rectangles.iter().filter(|r| r.length < NEARLY_SQUARE * r.width);
        let quarter_turned: Vec<Rectangle> = square.map(|r| Rectangle { yaw: r.yaw + FRAC_PI_2, ..*r }).collect();
        let mut starts: Vec<_> = rectangles.iter().flat_map(ways).flat_map(start_at).collect();
        // What is about as wide as long may have its longer side across.
        if rest.is_none() && starts.first().is_some_and(|(model, _)| model.has_two_sides()) {
            starts.extend(quarter_turned.iter().flat_map(ways).flat_map(start_at));
        }
        // A thing whose two ends differ may lie either way round.
        if starts.first().is_some_and(|(model, _)| model.has_two_ends()) {
            let turned = |r: &Rectangle| Rectangle { yaw: r.yaw + std::f64::consts::PI, ..*r };
            let turned: Vec<Rectangle> = rectangles.iter().map(turned).collect();
            starts.extend(turned.iter().flat_map(ways).flat_map(start_at));
        }
        // What is round starts alike in every rectangle.
        starts.dedup_by(|a, b| a.1 == b.1);
        let mut rated: Vec<_> =
            starts.into_iter().map(|(model, start)| (rough_cost(&model, evidence, &start), model, start)).collect();
        rated.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (rough, turns) = rated.first().map(|(rough, model, _)| (*rough, model.turns))?;
        // Of what is on call and may lie across, the best that does so goes second.
        let across = |(_, model, start): &(f64, Model, Vec<f64>)| {
            let heading = |start: &[f64], model: &Model| model.yaw_index().and_then(|yaw| start.get(yaw).copied());
            let (own, first) =
                (heading(start, model), rated.first().and_then(|(_, model, start)| heading(start, model)));
            own.zip(first).is_some_and(|(a, b)| (2.0 * (a - b)).cos() < 0.0)
        };
        let two_sides = template.on_call && rated.first().is_some_and(|(_, model, _)| model.has_two_sides());
        let other = rated.iter().position(across).filter(|_| two_sides);
        if let Some(other) = other {
            let other = rated.remove(other);
            rated.insert(1, other);
        }
        rated.truncate(if turns { STARTS } else { 1 });
        let both = turns && other.is_some();
        Some(Starts { starts: rated.into_iter().map(|(_, model, start)| (model, start)).collect(), rough, both })
    }

    /// The best of the starts, brought near to a minimum; both of what lies along and across, which only a fine fit tells
    /// apart.
    fn near(self, evidence: &Evidence) -> Vec<Approach<'a>> {
        let mut near: Vec<Approach<'a>> = self
            .starts
            .into_iter()
            .map(|(model, start)| {
                let state = approach(&model, evidence, &start);
                Approach { cost: cost(&model, evidence, &state), model, state }
            })
            .collect();
        near.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        near.truncate(if self.both { STARTS } else { 1 });
        near
    }
}

/// The first guess, and for each angle of the template two more, with the hinge little and far open: no measure of a
/// segment tells how far.
fn opened(template: &Template, initial: Vec<f64>) -> Vec<Vec<f64>> {
    let angles = template.parameters.iter().enumerate().filter(|(_, spec)| spec.unit == Unit::Rad && !spec.fixed);
    let at = |share: f64| angles.clone().map(move |(index, spec)| (index, spec.min + share * (spec.max - spec.min)));
    let moved = |(index, value): (usize, f64)| {
        let mut values = initial.clone();
        values[index] = value;
        values
    };
    OPENED.into_iter().flat_map(at).map(moved).chain(std::iter::once(initial.clone())).collect()
}

/// The measures of a segment as they would be if the part were stood upright, from its extents along the axes of its
/// rest.
fn upright_measures(rest: &Rest, extents: DVec3) -> [f64; 4] {
    let turn = rest.turn();
    let along = |axis: DVec3| (turn * axis).abs().dot(extents);
    let (x, y, z) = (along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
    [x.max(y), x.min(y), z, 0.25 * (x + y)]
}

/// A model with the parameters and the rest of a remembered part, and the place and heading where it is remembered.
pub(crate) fn as_remembered<'a>(
    context: Context<'a>,
    part: &GroundedPart,
    measured: &Measured,
) -> Option<(Model<'a>, (DVec2, f64))> {
    let template = context.library.get(&part.template).filter(|t| t.seen_by == measured.seen_by)?;
    let values: Vec<f64> = template.parameters.iter().map(|p| part.value(&p.name)).collect::<Option<_>>()?;
    let rest = template.rests.iter().find(|rest| rest.holds(part.up()));
    let model = Model::new(template, values, measured.base)?.lying(rest);
    let turn = rest.map_or(DQuat::IDENTITY, |rest| rest.turn());
    let middle = solids(std::slice::from_ref(part), context.library).iter().map(|s| s.pose.translation).sum::<DVec3>();
    let place = match rest {
        None => part.pose.pose.translation,
        Some(_) => middle / context.library.solids_of(part).map_or(1, |solids| solids.len()).max(1) as f64,
    };
    let own = (place.truncate(), Pose::new(DVec3::ZERO, part.pose.pose.rotation * turn.inverse()).yaw());
    Some((model, own))
}

/// The remembered part with its remembered parameters, moved to where the evidence is: what is seen of it may be
/// too little to measure it anew. It competes with the other hypotheses by its likelihood like any of them.
fn track<'a>(
    context: Context<'a>,
    measured: &Measured,
    rectangles: &[Rectangle],
    evidence: &Evidence,
) -> Option<Hypothesis<'a>> {
    let Known { part, .. } = context.remembered.filter(|_| evidence.cut_share() > TRACKED_CUT)?;
    let (model, own) = as_remembered(context, part, measured)?;
    let model = model.rigid();
    let starts = std::iter::once(own).chain(rectangles.iter().map(|r| (r.centre, r.yaw)));
    let rough = |(at, yaw): (DVec2, f64)| {
        let start = model.start(at, yaw);
        (rough_cost(&model, evidence, &start), start)
    };
    let (_, start) = starts.map(rough).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let minimum = minimise(&model, evidence, &approach(&model, evidence, &start));
    let score = score(context, &model, &minimum, evidence);
    Some(Hypothesis { model, minimum, score, probability: 0.0, tracked: Some(part) })
}

/// The same solids under parameter values that the template admits: as they are, or with two parameters exchanged
/// and a quarter turn (a box's length and width). `None` if there are no such values.
fn canonical(model: &Model, minimum: Minimum, evidence: &Evidence) -> Option<Minimum> {
    let template = model.template;
    let admitted = |state: &[f64]| template.admits(&template.named(&model.placement(state).values));
    if admitted(&minimum.state) {
        return Some(minimum);
    }
    let yaw = model.yaw_index()?;
    let count = template.parameters.len();
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    for (i, j) in pairs.filter(|&(i, j)| template.parameters[i].unit == template.parameters[j].unit) {
        let (Some(a), Some(b)) = (model.parameter_index(i), model.parameter_index(j)) else { continue };
        let mut state = minimum.state.clone();
        state.swap(a, b);
        state[yaw] += std::f64::consts::FRAC_PI_2;
        let same = (cost(model, evidence, &state) - minimum.cost).abs() < 1e-3 * (1.0 + minimum.cost.abs());
        if same && admitted(&state) {
            let mut covariance: DMatrix<f64> = minimum.covariance;
            covariance.swap_rows(a, b);
            covariance.swap_columns(a, b);
            return Some(Minimum { state, covariance, cost: minimum.cost });
        }
    }
    None
}

pub(crate) fn score(context: Context, model: &Model, minimum: &Minimum, evidence: &Evidence) -> f64 {
    let template = model.template;
    let values = model.placement(&minimum.state).values;
    let named = template.named(&values);
    let penalty = 0.5 * minimum.state.len() as f64 * evidence.independent().max(2.0).ln();
    let spoken_of = template.nouns(&named).iter().any(|noun| context.nouns.iter().any(|said| said == noun));
    let mut score = -minimum.cost - penalty + template.prior.max(1e-9).ln();
    if let Some(rest) = model.rest.filter(|rest| !rest.like_upright) {
        score += rest.prior.max(1e-9).ln();
    }
    if spoken_of {
        score += context.config.noun_boost.ln();
    }
    if context.remembered.is_some_and(|known| known.part.template == template.name) {
        score += context.config.memory_boost.ln();
    }
    score
}

/// Probabilities of the nouns under which the hypotheses are spoken of, best first.
///
/// The first nouns of a template are its most specific ones and count twice the next; a noun of the instruction is
/// preferred over its neighbours.
pub(crate) fn categories(hypotheses: &[Hypothesis], context: Context) -> Vec<(String, f64)> {
    let mut nouns: BTreeMap<&str, f64> = BTreeMap::new();
    for hypothesis in hypotheses {
        let template = hypothesis.model.template;
        let values = hypothesis.model.placement(&hypothesis.minimum.state).values;
        let fitting = template.nouns(&template.named(&values));
        let weight = |(place, noun): (usize, &&str)| {
            let said = context.nouns.iter().any(|said| said == noun);
            0.5f64.powi(place as i32) * if said { context.config.noun_boost } else { 1.0 }
        };
        let total: f64 = fitting.iter().enumerate().map(weight).sum();
        for (place, noun) in fitting.iter().enumerate() {
            *nouns.entry(noun).or_insert(0.0) += hypothesis.probability * weight((place, noun)) / total;
        }
    }
    // A sum of shares may round to a little over one.
    let mut categories: Vec<(String, f64)> =
        nouns.into_iter().map(|(noun, p)| (noun.to_string(), p.min(1.0))).collect();
    categories.sort_by(|a, b| b.1.total_cmp(&a.1));
    categories
}
