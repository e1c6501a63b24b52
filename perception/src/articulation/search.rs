//! The best motion of each kind, and how sure it is.

use super::{
    JointModel,
    agreement::Evidence,
    change::Changed,
    screw::{Kind, Screw},
    starts::starts,
    view::View,
};
use crate::GrounderConfig;
use glam::DVec3;

/// Points that are looked at while starts are compared, while they are refined, and in the end.
const ROUGH_POINTS: usize = 160;
const REFINED_POINTS: usize = 500;
const FINAL_POINTS: usize = 1500;
/// Starts of each kind that are refined.
const KEPT: usize = 30;
/// Widening of the standard deviations while starts are compared.
const WIDENING: f64 = 4.0;
/// Points that count as one independent measurement: noise of neighbours is alike.
const ALIKE: f64 = 10.0;
/// A motion that costs more a point explains nothing.
const EXPLAINS: f64 = 3.6;

/// Share of the log odds between the kinds that is believed.
const DOUBT: f64 = 0.1;
/// Steps of the curvature, as shares of the search's scales; smallest curvature that is believed.
const SPREAD_STEP: f64 = 0.25;
const LEAST_CURVATURE: f64 = 100.0;

/// Error of a hinge's place where one frame shows a part's outer side and the other one its inner side, metres.
const SIDES_M: f64 = 0.06;

/// What was found.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub screw: Screw,
    pub confidence: f64,
    /// Standard deviations: direction (radians), place (metres), amount.
    pub sigma: [f64; 3],
}

impl Found {
    pub fn model(&self) -> JointModel {
        // Amounts are positive: the axis looks where it moved.
        let sign = self.screw.amount.signum();
        let (axis, amount) = (self.screw.axis * sign, self.screw.amount * sign);
        match self.screw.kind {
            Kind::Revolute => {
                JointModel::Revolute { axis, point: self.screw.point, angle_rad: amount, sigma: self.sigma }
            }
            Kind::Prismatic => {
                JointModel::Prismatic { axis, distance_m: amount, sigma: [self.sigma[0], self.sigma[2]] }
            }
        }
    }
}

/// The motion that explains best what changed, if any does.
pub(super) fn best_motion(views: &[View; 2], changed: &Changed, config: &GrounderConfig) -> Option<Found> {
    let rough = Evidence::of(views, changed, ROUGH_POINTS);
    let refined = Evidence::of(views, changed, REFINED_POINTS);
    let last = Evidence::of(views, changed, FINAL_POINTS);
    let middle = middle(&last)?;
    let mut starts: Vec<(f64, Screw)> =
        starts(views, changed).into_iter().map(|screw| (rough.cost(&screw, WIDENING), screw)).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = |kind: Kind| -> Option<(f64, Screw)> {
        let own = distinct(starts.iter().filter(|(_, screw)| screw.kind == kind).map(|(_, screw)| *screw), middle);
        let coarse = narrowed(&rough, own, middle, 2.0, 60, 8);
        let fine = narrowed(&refined, coarse, middle, 1.0, 90, 3);
        let screw = *narrowed(&last, fine, middle, 1.0, 200, 1).first()?;
        Some((last.cost(&screw, 1.0), screw))
    };
    let (turn, slide) = (best(Kind::Revolute), best(Kind::Prismatic));
    let independent = last.count() as f64 / ALIKE;
    // Two numbers more, each worth half the logarithm of the measurements.
    let penalty = independent.max(2.0).ln();
    let total = |found: &Option<(f64, Screw)>| found.as_ref().map_or(f64::MAX, |(cost, _)| cost * independent);
    let gain = total(&slide) - total(&turn) - penalty;
    let (chosen, other) = if gain > 0.0 { (turn, slide) } else { (slide, turn) };
    let (cost, screw) = chosen?;
    if cost > EXPLAINS {
        return None;
    }
    let screw = screw.anchored(middle);
    let distance = views.iter().map(|view| (view.camera.translation - middle).length()).fold(0.0, f64::max);
    let sigma = spread(&last, &screw, independent, distance, config);
    // Without another kind there is nothing to doubt the kind with; with one, models are wrong before noise is.
    let confidence = if other.is_none() { 1.0 } else { 1.0 / (1.0 + (-DOUBT * gain.abs()).exp()) };
    Some(Found { screw, confidence, sigma })
}

/// Standard deviations of a motion's direction, place and amount, from the curvature of the cost round it.
fn spread(evidence: &Evidence, screw: &Screw, independent: f64, distance: f64, config: &GrounderConfig) -> [f64; 3] {
    let count = screw.freedom();
    let step = screw.scales().map(|scale| SPREAD_STEP * scale);
    let at = |i: usize, a: f64, j: usize, b: f64| {
        let mut by = [0.0; 5];
        by[i] += a * step[i];
        by[j] += b * step[j];
        independent * evidence.cost(&screw.changed(&by[..count]), 1.0)
    };
    let centre = at(0, 0.0, 0, 0.0);
    let curvature = nalgebra::DMatrix::from_fn(count, count, |i, j| {
        if i == j {
            (at(i, 1.0, i, 0.0) + at(i, -1.0, i, 0.0) - 2.0 * centre) / (step[i] * step[i])
        } else {
            (at(i, 1.0, j, 1.0) + at(i, -1.0, j, -1.0) - at(i, 1.0, j, -1.0) - at(i, -1.0, j, 1.0))
                / (4.0 * step[i] * step[j])
        }
    });
    // A direction without curvature is as unsure as the search was wide.
    let eigen = curvature.symmetric_eigen();
    let variance = |number: usize| -> f64 {
        let share =
            |(axis, value): (usize, &f64)| eigen.eigenvectors[(number, axis)].powi(2) / value.max(LEAST_CURVATURE);
        eigen.eigenvalues.iter().enumerate().map(share).sum()
    };
    let place = if count > 3 { (variance(3) + variance(4)).sqrt() } else { 0.0 };
    let direction = (variance(1) + variance(2)).sqrt();
    // A point near the axis moves by twice the sine of half the turn of its distance: small turns tell places badly.
    let lever = (1.0 / (2.0 * (0.5 * screw.amount).sin().abs()).max(0.1)).max(1.0);
    let systematic = lever * config.sigma_floor_m.hypot(config.sigma_range * distance);
    let systematic = systematic.hypot(SIDES_M * evidence.turned_away(screw));
    [
        config.sigma_factor * direction,
        (config.sigma_factor * place).hypot(systematic),
        config.sigma_factor * variance(0).sqrt(),
    ]
}

/// The best `most` of some motions, each moved to a minimum near to it.
fn narrowed(
    evidence: &Evidence,
    screws: Vec<Screw>,
    middle: DVec3,
    widening: f64,
    steps: usize,
    most: usize,
) -> Vec<Screw> {
    let minimum = |screw: Screw| {
        let screw = descend(evidence, screw.anchored(middle), widening, steps);
        (evidence.cost(&screw, widening), screw)
    };
    let mut found: Vec<(f64, Screw)> = screws.into_iter().map(minimum).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, screw)| screw).take(most).collect()
}

/// The middle of what changed.
fn middle(evidence: &Evidence) -> Option<DVec3> {
    let all = || evidence.points.iter().flatten();
    let count = all().count();
    (count > 0).then(|| all().map(|point| point.at).sum::<DVec3>() / count as f64)
}

/// The first of some motions that take the middle to different places.
fn distinct(screws: impl Iterator<Item = Screw>, middle: DVec3) -> Vec<Screw> {
    let mut kept: Vec<Screw> = Vec::new();
    let probes = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|d| middle + 0.2 * d);
    let apart = |a: &Screw, b: &Screw| {
        let (a, b) = (a.pose(), b.pose());
        probes.iter().map(|p| a.transform_point(*p).distance(b.transform_point(*p))).fold(0.0, f64::max)
    };
    for screw in screws {
        if kept.iter().all(|other| apart(other, &screw) > 0.04) {
            kept.push(screw);
            if kept.len() >= KEPT {
                break;
            }
        }
    }
    kept
}

/// Nelder and Mead's simplex over a motion's numbers: the cost has steps, where points come off an edge, so that its
/// slope tells less than its values.
fn descend(evidence: &Evidence, start: Screw, widening: f64, most: usize) -> Screw {
    let count = start.freedom();
    let scales = start.scales();
    let value = |at: &[f64]| evidence.cost(&start.changed(at), widening);
    let mut simplex: Vec<(f64, Vec<f64>)> = Vec::with_capacity(count + 1);
    for corner in 0..=count {
        let mut at = vec![0.0; count];
        if corner > 0 {
            at[corner - 1] = scales[corner - 1];
        }
        simplex.push((value(&at), at));
    }
    let mut spent = simplex.len();
    while spent < most {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (best, worst, next) = (simplex[0].0, simplex[count].clone(), simplex[count - 1].0);
        if worst.0 - best < 1e-5 {
            break;
        }
        let centre: Vec<f64> =
            (0..count).map(|i| simplex[..count].iter().map(|(_, at)| at[i]).sum::<f64>() / count as f64).collect();
        let along = |by: f64| -> Vec<f64> { centre.iter().zip(&worst.1).map(|(c, w)| c + by * (w - c)).collect() };
        let mut try_at = |by: f64| {
            let at = along(by);
            spent += 1;
            (value(&at), at)
        };
        let reflected = try_at(-1.0);
        let better = if reflected.0 < best {
            let expanded = try_at(-2.0);
            Some(if expanded.0 < reflected.0 { expanded } else { reflected })
        } else if reflected.0 < next {
            Some(reflected)
        } else {
            let contracted = try_at(if reflected.0 < worst.0 { -0.5 } else { 0.5 });
            (contracted.0 < worst.0.min(reflected.0)).then_some(contracted)
        };
        match better {
            Some(corner) => simplex[count] = corner,
            None => {
                let first = simplex[0].1.clone();
                for (cost, at) in simplex.iter_mut().skip(1) {
                    at.iter_mut().zip(&first).for_each(|(a, f)| *a = 0.5 * (*a + f));
                    *cost = value(at);
                    spent += 1;
                }
            }
        }
    }
    simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
    start.changed(&simplex[0].1)
}
