//! One answer of perception against what is true of a scene.

use super::{
    scene::Scene,
    tally::Tally,
    thing::{Parameters, Thing},
};
use crate::statistics::median_and;
use acm_concept::{
    object::{GroundedObject, GroundedPart, Observability, ParameterEstimate, Percepts},
    pose::Pose,
    solid::PlacedSolid,
    template::{SeenBy, Template, TemplateLibrary, Unit, YawSymmetry},
};
use acm_perception::{
    labels,
    metrics::{self, Match},
};
use glam::DVec3;
use std::{collections::BTreeMap, f64::consts::PI};

/// From this F on an object is found.
const FOUND_F: f64 = 0.75;
/// A reported object that has no more F than this with any true one that is left over is a false one.
const FALSE_F: f64 = 0.25;
/// Positions are compared among things of this largest extent and more, metres.
const LARGE_M: f64 = 0.05;
/// Half of a 90 % interval in standard deviations.
const SIGMAS_90: f64 = 1.645;
/// A hinge is right within this.
const ANGLE_DEG: f64 = 5.0;
/// Sides that are nearer to each other than this are told apart by nobody: their heading repeats every quarter turn.
const NEARLY_SQUARE: f64 = 1.12;
/// Points along an edge of the box in which solids are compared.
const SAMPLES: usize = 24;
/// Share of a true object's pixels that makes a reported one part of the story of how it was lost.
const SHARE: f64 = 0.15;
/// An error of a dimension beyond this, metres, or of a heading, degrees, is told as a cause.
const WRONG_M: f64 = 0.008;
const WRONG_DEG: f64 = 5.0;

/// What became of one true thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fate {
    /// Found, and nothing wrong with it.
    Right,
    /// Found under another template than its own.
    WrongTemplate,
    /// Found, and an observed dimension is off.
    WrongSize,
    /// Found, and turned.
    WrongHeading,
    /// Nothing was reported where it is.
    Missed,
    /// Reported as one with another thing.
    Merged,
    /// Reported in pieces.
    Split,
    /// Reported with a wrong outline.
    Ragged,
}

impl Fate {
    /// All of them.
    pub const ALL: [Fate; 8] = [
        Fate::Right,
        Fate::WrongTemplate,
        Fate::WrongSize,
        Fate::WrongHeading,
        Fate::Missed,
        Fate::Merged,
        Fate::Split,
        Fate::Ragged,
    ];
    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Fate::Right => "right",
            Fate::WrongTemplate => "wrong_template",
            Fate::WrongSize => "wrong_size",
            Fate::WrongHeading => "wrong_heading",
            Fate::Missed => "missed",
            Fate::Merged => "merged",
            Fate::Split => "split",
            Fate::Ragged => "ragged",
        }
    }
}

/// What an answer came to: the numbers, and each thing's fate in the order of the scene.
#[derive(Debug, Clone, Default)]
pub struct Scored {
    /// For the figures.
    pub tally: Tally,
    /// For pictures.
    pub fates: Vec<Fate>,
}

/// Compares an answer with the truth.
pub fn score(scene: &Scene, truth: &[u16], percepts: &Percepts, library: &TemplateLibrary) -> Scored {
    let reported = labels::draw(percepts).into_raw();
    let matched = metrics::matches(&reported, truth);
    let mut scored = Scored::default();
    let tally = &mut scored.tally;
    tally.scenes = 1;
    tally.reported = percepts.objects.len();
    tally.false_objects = percepts.objects.len() - matched.iter().filter(|pair| pair.f > FALSE_F).count();
    let mut places = Vec::new();
    let errors = place_errors(scene, &matched, percepts);
    for (at, thing) in scene.things.iter().enumerate() {
        let label = at as u16 + 1;
        if let Some(template) = thing.template.as_ref().and_then(|truth| library.get(&truth.template)) {
            tally.templated += 1;
            tally.hinges += hinges(template).count();
        }
        let found = matched.iter().find(|pair| pair.truth == label && pair.f > FOUND_F);
        let share = if thing.touches.is_some() { &mut tally.touching } else { &mut tally.spaced };
        share.count(found.is_some());
        let object = found.and_then(|pair| percepts.objects.get(usize::from(pair.predicted).checked_sub(1)?));
        let fate = match object {
            Some(object) => {
                if let Some(pose) = object.pose() {
                    tally.absolute_mm.push(1e3 * pose.pose.translation.distance(thing.pose.translation));
                    if thing.extents().max_element() >= LARGE_M {
                        places.push((pose.pose.translation, thing.pose.translation));
                    }
                    tally.all_places.push((pose.pose.translation, thing.pose.translation));
                }
                compare(thing, object, library, common_error(&errors, label), tally)
            }
            None => lost(label, &reported, truth, &matched),
        };
        *tally.fates.entry(fate).or_default() += 1;
        scored.fates.push(fate);
    }
    let all = std::mem::take(&mut tally.all_places);
    tally.relative_mm = differences(&places);
    tally.small_relative_mm = differences(&all);
    scored
}

/// By how much each found thing, by its label, is not where it is said to be: world frame, metres.
fn place_errors(scene: &Scene, matched: &[Match], percepts: &Percepts) -> Vec<(u16, DVec3)> {
    let error = |pair: &Match| {
        let thing = scene.things.get(usize::from(pair.truth).checked_sub(1)?)?;
        let object = percepts.objects.get(usize::from(pair.predicted).checked_sub(1)?)?;
        Some((pair.truth, object.pose()?.pose.translation - thing.pose.translation))
    };
    matched.iter().filter(|pair| pair.f > FOUND_F).filter_map(error).collect()
}

/// The middle of the errors of all other things: that of the camera's calibration, as far as it can be told. Without
/// others nothing is taken off.
fn common_error(errors: &[(u16, DVec3)], label: u16) -> DVec3 {
    let others: Vec<DVec3> = errors.iter().filter(|(of, _)| *of != label).map(|(_, error)| *error).collect();
    if others.is_empty() {
        return DVec3::ZERO;
    }
    let middle = |axis: usize| median_and(0.5, &others.iter().map(|error| error[axis]).collect::<Vec<_>>()).0;
    DVec3::new(middle(0), middle(1), middle(2))
}

/// Errors of the differences between all pairs of places (found, true), millimetres.
fn differences(places: &[(DVec3, DVec3)]) -> Vec<f64> {
    let pairs = places.iter().enumerate().flat_map(|(at, a)| places.iter().skip(at + 1).map(move |b| (a, b)));
    pairs.map(|(a, b)| 1e3 * (a.0 - b.0).distance(a.1 - b.1)).collect()
}

/// How a thing was lost.
fn lost(label: u16, reported: &[u16], truth: &[u16], matched: &[Match]) -> Fate {
    let mut over: BTreeMap<u16, usize> = BTreeMap::new();
    let mut own = 0usize;
    for (found, _) in reported.iter().zip(truth).filter(|(_, t)| **t == label) {
        own += 1;
        if *found != 0 {
            *over.entry(*found).or_default() += 1;
        }
    }
    over.retain(|_, pixels| *pixels as f64 > SHARE * own as f64);
    let of_another = |found: &u16| matched.iter().any(|pair| pair.predicted == *found && pair.truth != label);
    // Another thing shares what covers most of it.
    let most = over.iter().max_by_key(|(_, pixels)| **pixels).map(|(found, _)| *found);
    let shared = most.is_some_and(|found| {
        let mut others: BTreeMap<u16, [usize; 2]> = BTreeMap::new();
        for (f, t) in reported.iter().zip(truth).filter(|(_, t)| **t != 0 && **t != label) {
            let [covered, all] = others.entry(*t).or_default();
            *covered += usize::from(*f == found);
            *all += 1;
        }
        others.values().any(|[covered, all]| *covered as f64 > SHARE * *all as f64)
    });
    match over.len() {
        0 => Fate::Missed,
        _ if shared || most.as_ref().is_some_and(of_another) => Fate::Merged,
        1 => Fate::Ragged,
        _ => Fate::Split,
    }
}

/// A found thing's template, dimensions, heading and parts.
fn compare(thing: &Thing, object: &GroundedObject, library: &TemplateLibrary, bias: DVec3, tally: &mut Tally) -> Fate {
    match &thing.template {
        Some(truth) => match library.get(&truth.template) {
            Some(template) => {
                let world = parts_iou(&thing.pose, template, &truth.values, object, library);
                tally.world_part_iou.extend(world);
                // What colour alone shows has no thickness to share.
                if template.seen_by == SeenBy::Depth {
                    let pose = Pose { translation: thing.pose.translation + bias, ..thing.pose };
                    tally.part_iou.extend(parts_iou(&pose, template, &truth.values, object, library));
                }
                compare_parameters(thing, truth, template, object, tally)
            }
            None => Fate::WrongTemplate,
        },
        None => compare_extents(thing, object, library, tally),
    }
}

fn compare_parameters(
    thing: &Thing,
    truth: &Parameters,
    template: &Template,
    object: &GroundedObject,
    tally: &mut Tally,
) -> Fate {
    let named = template.named(&truth.values);
    let right = object.parts.first().is_some_and(|part| part.template == truth.template);
    tally.template.count(right);
    let turns: Vec<usize> = hinges(template).collect();
    let Some(main) = object.parts.first().filter(|_| right) else {
        // A hinge that was not recognised has no angle.
        turns.iter().for_each(|_| tally.opening.count(false));
        return Fate::WrongTemplate;
    };
    let mut worst_m = 0.0f64;
    for (at, (spec, value)) in template.parameters.iter().zip(&truth.values).enumerate() {
        let Some(estimate) = main.parameters.iter().find(|p| p.name == spec.name) else { continue };
        let error = (estimate.value - value).abs();
        if turns.contains(&at) {
            tally.opening.count(error.to_degrees() <= ANGLE_DEG);
        }
        if spec.fixed || spec.unit != Unit::M {
            continue;
        }
        match estimate.observability {
            Observability::Observed => {
                worst_m = worst_m.max(error);
                observed(estimate, error, tally);
            }
            Observability::Interval { low, high } => tally.bounded.count((low..=high).contains(value)),
            Observability::PriorOnly => tally.unseen += 1,
        }
    }
    let symmetry = template.yaw_symmetry(&named).unwrap_or(YawSymmetry::Fold(1));
    let turned = heading(symmetry, main.pose.pose.yaw(), thing.pose.yaw(), tally);
    fate(worst_m, turned)
}

fn observed(estimate: &ParameterEstimate, error: f64, tally: &mut Tally) {
    let half = SIGMAS_90 * estimate.sigma;
    tally.dimension_mm.push(1e3 * error);
    tally.interval.count(error <= half);
    tally.interval_mm.push(2e3 * half);
}

fn heading(symmetry: YawSymmetry, found: f64, truth: f64, tally: &mut Tally) -> f64 {
    if symmetry == YawSymmetry::Continuous {
        return 0.0;
    }
    let error = symmetry.difference(found, truth).to_degrees();
    tally.yaw_deg.push(error);
    error
}

fn fate(worst_m: f64, turned_deg: f64) -> Fate {
    match (worst_m > WRONG_M, turned_deg > WRONG_DEG) {
        (true, _) => Fate::WrongSize,
        (false, true) => Fate::WrongHeading,
        (false, false) => Fate::Right,
    }
}

/// The parameters that are angles.
fn hinges(template: &Template) -> impl Iterator<Item = usize> + '_ {
    let angles = template.parameters.iter().enumerate().filter(|(_, spec)| spec.unit == Unit::Rad && !spec.fixed);
    angles.map(|(at, _)| at)
}

/// A foreign thing has no template: extents along its own axes and their heading are compared, where all that makes
/// them is said to be observed.
fn compare_extents(thing: &Thing, object: &GroundedObject, library: &TemplateLibrary, tally: &mut Tally) -> Fate {
    let (Some(main), Some(found)) = (object.parts.first(), library.extents_of(&object.parts)) else {
        return Fate::WrongTemplate;
    };
    let truth = thing.extents();
    let flat = |size: DVec3| [size.x.max(size.y), size.x.min(size.y), size.z];
    let of_length = |p: &&ParameterEstimate| !matches!(p.observability, Observability::Observed);
    let mut worst_m = 0.0;
    if main.parameters.iter().find(of_length).is_none() {
        for (found, truth) in flat(found).into_iter().zip(flat(truth)) {
            worst_m = f64::max(worst_m, (found - truth).abs());
            tally.dimension_mm.push(1e3 * (found - truth).abs());
        }
    }
    let round = library.get(&main.template).and_then(|template| template.yaw_symmetry(&main.values()).ok());
    if round == Some(YawSymmetry::Continuous) {
        return fate(worst_m, 0.0);
    }
    let longer = |size: DVec3, yaw: f64| if size.x >= size.y { yaw } else { yaw + 0.5 * PI };
    let nearly_square = truth.x.max(truth.y) < NEARLY_SQUARE * truth.x.min(truth.y);
    let symmetry = YawSymmetry::Fold(if nearly_square { 4 } else { 2 });
    let turned = heading(symmetry, longer(found, main.pose.pose.yaw()), longer(truth, thing.pose.yaw()), tally);
    fate(worst_m, turned)
}

/// Volume that a true part and its estimate share, of what either has, for each true part: by name where the template
/// is right, else with whatever found part shares most.
fn parts_iou(
    pose: &Pose,
    template: &Template,
    values: &[f64],
    object: &GroundedObject,
    library: &TemplateLibrary,
) -> Vec<f64> {
    let named = template.named(values);
    let Ok(frames) = template.part_frames(&named) else { return Vec::new() };
    let world = |part: &GroundedPart| -> Vec<PlacedSolid> {
        placed(&library.solids_of(part).unwrap_or_default(), &part.pose.pose)
    };
    let of_part = |(spec, frame): (&acm_concept::template::PartSpec, Pose)| {
        let solids = template.part_solids(&spec.name, &named).unwrap_or_default();
        let truth = placed(&solids, &(*pose * frame));
        let same = object.parts.iter().filter(|part| part.template != template.name || part.name == spec.name);
        same.map(|part| iou(&truth, &world(part))).fold(0.0, f64::max)
    };
    template.parts.iter().zip(frames).map(of_part).collect()
}

fn placed(solids: &[PlacedSolid], pose: &Pose) -> Vec<PlacedSolid> {
    solids.iter().map(|own| PlacedSolid { pose: *pose * own.pose, ..*own }).collect()
}

/// Intersection over union of the volumes of two sets of solids, by a grid of points.
pub(super) fn iou(a: &[PlacedSolid], b: &[PlacedSolid]) -> f64 {
    let ends = |placed: &PlacedSolid| {
        let half = placed.half_extents();
        (placed.pose.translation - half, placed.pose.translation + half)
    };
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = a.iter().chain(b).map(ends).fold(start, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let inverse = |solids: &[PlacedSolid]| -> Vec<_> { solids.iter().map(|s| (s.pose.inverse(), s.solid)).collect() };
    let (a, b) = (inverse(a), inverse(b));
    let (mut both, mut either) = (0usize, 0usize);
    for index in 0..SAMPLES.pow(3) {
        let cell =
            DVec3::new((index % SAMPLES) as f64, (index / SAMPLES % SAMPLES) as f64, (index / SAMPLES.pow(2)) as f64);
        let point = low + (high - low) * (cell + DVec3::splat(0.5)) / SAMPLES as f64;
        let inside = |solids: &[(Pose, acm_concept::solid::Solid)]| {
            solids.iter().any(|(inverse, solid)| solid.signed_distance(inverse.transform_point(point)) < 0.0)
        };
        let (in_a, in_b) = (inside(&a), inside(&b));
        both += usize::from(in_a && in_b);
        either += usize::from(in_a || in_b);
    }
    both as f64 / either.max(1) as f64
}
