//! How a new view changes what is believed: parameters by an information filter with gating, poses by a running
//! mean while a thing stands still.

use acm_concept::{
    color::{Appearance, Lab},
    object::{GroundedPart, Observability, ParameterEstimate, PoseEstimate},
    template::{TemplateLibrary, YawSymmetry},
};
use glam::{DQuat, DVec3};

/// Two observed values that differ by more combined standard deviations contradict each other.
const GATE_SIGMAS: f64 = 4.0;
/// Systematic difference between two views of one parameter: absolute (metres, radians, one) and relative.
const VIEW_FLOOR: f64 = 0.003;
const VIEW_FLOOR_RELATIVE: f64 = 0.03;
/// No number of views makes a fused value surer than this: errors of one camera are not independent.
const FUSED_FLOOR: f64 = 0.001;
/// A pose that moved by more combined standard deviations is taken as it is, not averaged.
const STILL_SIGMAS: f64 = 3.0;

/// A part whose own vertical has turned by more than this was tipped over: there is nothing to average.
const TIPPED_RAD: f64 = 0.35;

/// What a view of a parameter does to its estimate.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Update {
    /// It adds nothing.
    Keep,
    /// The estimate becomes this one.
    Take(ParameterEstimate),
    /// It contradicts the estimate.
    Contradiction,
}

/// Compares a view of a parameter with its estimate. Only observed values are averaged; an interval narrows an
/// interval; what is only a prior changes nothing.
pub(crate) fn update(known: &ParameterEstimate, seen: &ParameterEstimate, truncated: bool) -> Update {
    use Observability::{Interval, Observed, PriorOnly};
    let sigma = (known.sigma.powi(2) + seen.sigma.powi(2) + floor(known.value).powi(2)).sqrt();
    match (known.observability, seen.observability) {
        (_, PriorOnly) => Update::Keep,
        // A cut outline gives a lower bound at best.
        (Observed, Observed) if truncated => match seen.value > known.value + GATE_SIGMAS * sigma {
            true => Update::Contradiction,
            false => Update::Keep,
        },
        (_, Observed) if truncated => Update::Keep,
        (PriorOnly | Interval { .. }, Observed) | (PriorOnly, Interval { .. }) => Update::Take(seen.clone()),
        (Observed, Observed) if (known.value - seen.value).abs() > GATE_SIGMAS * sigma => Update::Contradiction,
        (Observed, Observed) => {
            let (value, sigma) = fuse((known.value, known.sigma), (seen.value, seen.sigma));
            Update::Take(ParameterEstimate { name: known.name.clone(), value, sigma, observability: Observed })
        }
        (Observed, Interval { low, high }) => {
            let slack = GATE_SIGMAS * sigma;
            let fits = known.value >= low - slack && known.value <= high + slack;
            if fits { Update::Keep } else { Update::Contradiction }
        }
        (Interval { low, high }, Interval { low: seen_low, high: seen_high }) => {
            let (low, high) = (low.max(seen_low), high.min(seen_high));
            if low > high {
                return Update::Keep;
            }
            let observability = Interval { low, high };
            Update::Take(ParameterEstimate { value: known.value.clamp(low, high), observability, ..known.clone() })
        }
    }
}

/// The parts with a view fused in, or `None` if the view contradicts them: another template, another number of
/// parts, or an observed parameter beyond the gate.
pub(crate) fn fuse_parts(
    known: &[GroundedPart],
    seen: &[GroundedPart],
    truncated: bool,
    library: &TemplateLibrary,
) -> Option<Vec<GroundedPart>> {
    if known.len() != seen.len() {
        return None;
    }
    known.iter().zip(seen).map(|(known, seen)| fuse_part(known, seen, truncated, library)).collect()
}

fn fuse_part(
    known: &GroundedPart,
    seen: &GroundedPart,
    truncated: bool,
    library: &TemplateLibrary,
) -> Option<GroundedPart> {
    if known.template != seen.template {
        return None;
    }
    let mut fused = known.clone();
    for parameter in &mut fused.parameters {
        let Some(view) = seen.parameters.iter().find(|view| view.name == parameter.name) else { continue };
        match update(parameter, view, truncated) {
            Update::Keep => {}
            Update::Take(estimate) => *parameter = estimate,
            Update::Contradiction => return None,
        }
    }
    // The middle of a cut outline is not the thing's middle.
    if !truncated {
        fused.pose = fuse_pose(&known.pose, &seen.pose, crate::geometry::symmetry(known, library));
    }
    Some(fused)
}

/// The mean of two poses weighted by their information, or the seen one if the thing was shifted.
pub(crate) fn fuse_pose(known: &PoseEstimate, seen: &PoseEstimate, symmetry: YawSymmetry) -> PoseEstimate {
    let up = |estimate: &PoseEstimate| estimate.pose.transform_vector(DVec3::Z);
    if up(known).angle_between(up(seen)) > TIPPED_RAD {
        return *seen;
    }
    let (from, to) = (known.pose.translation, seen.pose.translation);
    let spread = known.position_sigma_m * known.position_sigma_m + seen.position_sigma_m * seen.position_sigma_m;
    let offset = to - from;
    let shifted = (offset * offset / spread.max(DVec3::splat(1e-9))).max_element() > STILL_SIGMAS * STILL_SIGMAS;
    let heading = symmetry.nearest(seen.pose.yaw(), known.pose.yaw());
    if shifted {
        return turned(seen, heading);
    }
    let axis = |a: f64, b: f64, sigma_a: f64, sigma_b: f64| fuse((a, sigma_a), (b, sigma_b));
    let (x, sx) = axis(from.x, to.x, known.position_sigma_m.x, seen.position_sigma_m.x);
    let (y, sy) = axis(from.y, to.y, known.position_sigma_m.y, seen.position_sigma_m.y);
    let (z, sz) = axis(from.z, to.z, known.position_sigma_m.z, seen.position_sigma_m.z);
    let (yaw, yaw_sigma_rad) = fuse((known.pose.yaw(), known.yaw_sigma_rad), (heading, seen.yaw_sigma_rad));
    let mut fused = turned(seen, yaw);
    fused.pose.translation = DVec3::new(x, y, z);
    fused.position_sigma_m = DVec3::new(sx, sy, sz);
    fused.yaw_sigma_rad = yaw_sigma_rad;
    fused
}

fn turned(seen: &PoseEstimate, yaw: f64) -> PoseEstimate {
    let mut turned = *seen;
    turned.pose.rotation = (DQuat::from_rotation_z(yaw - seen.pose.yaw()) * seen.pose.rotation).normalize();
    turned
}

/// Two values with standard deviations joined by their information.
fn fuse((a, sigma_a): (f64, f64), (b, sigma_b): (f64, f64)) -> (f64, f64) {
    let (a_weight, b_weight) = (1.0 / sigma_a.max(1e-6).powi(2), 1.0 / sigma_b.max(1e-6).powi(2));
    let value = (a * a_weight + b * b_weight) / (a_weight + b_weight);
    (value, (1.0 / (a_weight + b_weight)).sqrt().max(FUSED_FLOOR))
}

fn floor(value: f64) -> f64 {
    VIEW_FLOOR.max(VIEW_FLOOR_RELATIVE * value.abs())
}

/// The running mean of a colour over views; it keeps following slow changes of light.
pub(crate) fn fuse_appearance(known: &Appearance, seen: &Appearance, views: u32) -> Appearance {
    let share = 1.0 / f64::from(views.clamp(1, 9) + 1);
    let mix = |a: f64, b: f64| a + share * (b - a);
    let mean =
        Lab { l: mix(known.mean.l, seen.mean.l), a: mix(known.mean.a, seen.mean.a), b: mix(known.mean.b, seen.mean.b) };
    let palette = known.palette.towards(&seen.palette, share);
    Appearance { mean, spread: mix(known.spread, seen.spread), palette }
}

/// The running mean of noun probabilities over views, best first.
pub(crate) fn fuse_categories(known: &[(String, f64)], seen: &[(String, f64)], views: u32) -> Vec<(String, f64)> {
    let share = 1.0 / f64::from(views.clamp(1, 9) + 1);
    let of = |list: &[(String, f64)], noun: &str| list.iter().find(|(n, _)| n == noun).map_or(0.0, |(_, p)| *p);
    let mut fused: Vec<(String, f64)> = Vec::new();
    for (noun, _) in known.iter().chain(seen) {
        if !fused.iter().any(|(n, _)| n == noun) {
            let (a, b) = (of(known, noun), of(seen, noun));
            fused.push((noun.clone(), a + share * (b - a)));
        }
    }
    fused.retain(|(_, probability)| *probability > 1e-4);
    fused.sort_by(|a, b| b.1.total_cmp(&a.1));
    fused
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use crate::{default_library, staging::Thing};
    use proptest::prelude::*;

    fn observed(value: f64, sigma: f64) -> ParameterEstimate {
        ParameterEstimate { name: "length".into(), value, sigma, observability: Observability::Observed }
    }

    #[test]
    fn a_halved_length_contradicts_and_a_prior_changes_nothing() {
        let known = observed(0.2, 0.004);
        assert_eq!(update(&known, &observed(0.1, 0.004), false), Update::Contradiction);
        assert_eq!(update(&known, &observed(0.1, 0.004), true), Update::Keep);
        let prior = ParameterEstimate { observability: Observability::PriorOnly, ..observed(0.05, 0.1) };
        assert_eq!(update(&known, &prior, false), Update::Keep);
        assert_eq!(update(&prior, &known, false), Update::Take(known.clone()));
        let bound = ParameterEstimate {
            observability: Observability::Interval { low: 0.08, high: 0.4 },
            ..observed(0.12, 0.05)
        };
        assert_eq!(update(&known, &bound, false), Update::Keep);
        assert_eq!(update(&bound, &known, false), Update::Take(known));
    }

    #[test]
    fn a_view_from_the_equivalent_heading_does_not_turn_the_block() {
        let library = default_library().unwrap();
        let block = Thing::block([0.06, 0.03, 0.02]).at(0.1, 0.2, 0.0);
        let seen = block.clone().turned(std::f64::consts::PI - 0.02);
        let fused = fuse_parts(&block.parts(), &seen.parts(), false, &library).unwrap();
        assert!(fused[0].pose.pose.yaw().abs() < 0.02, "{}", fused[0].pose.pose.yaw());
    }

    #[test]
    fn a_tipped_can_is_where_it_is_seen_and_keeps_its_sizes() {
        let library = default_library().unwrap();
        let can = Thing::can(0.05, 0.06).at(0.1, 0.2, 0.0);
        let mut seen = Thing::can(0.052, 0.06).at(0.1, 0.2, 0.05);
        seen.part.pose.pose.rotation = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let fused = fuse_parts(&can.parts(), &seen.parts(), false, &library).unwrap();
        assert_eq!(fused[0].pose, seen.part.pose);
        assert!((fused[0].value("radius").unwrap() - 0.051).abs() < 1e-9);
        // Half a turn shows the other end of a lying can, and nothing else looks alike.
        assert_eq!(crate::geometry::symmetry(&fused[0], &library), YawSymmetry::Fold(2));
        assert_eq!(crate::geometry::symmetry(&can.part, &library), YawSymmetry::Continuous);
    }

    proptest! {
        #[test]
        fn fusion_lies_between_and_is_surer(a in 0.05..0.051f64, b in 0.05..0.051f64, s in 0.002..0.01f64, t in 0.002..0.01f64) {
            let Update::Take(fused) = update(&observed(a, s), &observed(b, t), false) else {
                return Err(TestCaseError::fail("values that agree were not fused"));
            };
            prop_assert!(fused.value >= a.min(b) - 1e-12 && fused.value <= a.max(b) + 1e-12);
            prop_assert!(fused.sigma <= s.min(t));
        }
    }
}
