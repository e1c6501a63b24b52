//! Parameters and pose of a part as the numbers that are learned, and back.
//!
//! Numbers are of the cloud's own frame and unit ([`Normal`]), so that they depend on neither place nor size: lengths as
//! logarithms, angles and plain numbers as they are, the place as two lengths. A heading that repeats n times a turn is the
//! cosine and sine of n times it: equivalent headings have equal targets.

use crate::{cloud::Normal, config::HeadSpec};
use acm_concept::{
    pose::Pose,
    template::{Template, Unit, YawSymmetry},
};
use glam::DVec2;

/// An estimate of a part, or what is true of it, in the frame of its cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct PartState {
    /// All parameter values in the template's order.
    pub values: Vec<f64>,
    /// Where the base frame stands on the support, metres.
    pub place: DVec2,
    /// Its heading, radians; 0 where any looks the same.
    pub yaw: f64,
}

/// Standard deviations of a [`PartState`], as the network claims them.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviations {
    /// Of all parameter values; 0 of those that are not fitted.
    pub values: Vec<f64>,
    /// Of the place, along each axis of the cloud's own frame, metres.
    pub place: [f64; 2],
    /// Of the heading, radians; a whole turn where any looks the same.
    pub yaw: f64,
}

impl HeadSpec {
    /// The head of a template.
    pub fn of(template: &Template) -> HeadSpec {
        let fitted = template.parameters.iter().filter(|spec| !spec.fixed);
        let fold = match template.common_symmetry() {
            YawSymmetry::Continuous => 0,
            YawSymmetry::Fold(fold) => fold,
        };
        HeadSpec { template: template.name.clone(), parameters: fitted.map(|spec| spec.name.clone()).collect(), fold }
    }
}

/// The numbers that a head is to give, in its order: fitted parameters, place, heading.
pub fn encode(template: &Template, normal: &Normal, state: &PartState) -> Vec<f32> {
    let head = HeadSpec::of(template);
    let fitted = template.parameters.iter().zip(&state.values).filter(|(spec, _)| !spec.fixed);
    let mut numbers: Vec<f64> = fitted.map(|(spec, value)| Scale::of(spec).encode(*value, normal.unit_m)).collect();
    let place = DVec2::from_angle(-normal.yaw).rotate(state.place - normal.origin) / normal.unit_m;
    numbers.extend(place.to_array());
    if head.fold > 0 {
        numbers.extend(DVec2::from_angle(f64::from(head.fold) * (state.yaw - normal.yaw)).to_array());
    }
    numbers.into_iter().map(|number| number as f32).collect()
}

/// What a head's numbers mean: the estimate and its standard deviations. `means` and `deviations` have
/// [`HeadSpec::outputs`] numbers each; parameters are kept in their ranges.
pub fn decode(template: &Template, normal: &Normal, means: &[f32], deviations: &[f32]) -> (PartState, Deviations) {
    let fold = HeadSpec::of(template).fold;
    let mut numbers = means.iter().copied().map(f64::from).zip(deviations.iter().copied().map(f64::from));
    let mut next = || numbers.next().unwrap_or((0.0, 0.0));
    // What is fixed does not depend on what is measured.
    let fixed = template.initial_values([0.0; 4]).unwrap_or_default();
    let (mut values, mut value_deviations) = (Vec::new(), Vec::new());
    for (at, spec) in template.parameters.iter().enumerate() {
        let (value, deviation) = if spec.fixed {
            (fixed.get(at).copied().unwrap_or(spec.min), 0.0)
        } else {
            Scale::of(spec).decode(next(), normal.unit_m)
        };
        values.push(value.clamp(spec.min, spec.max));
        value_deviations.push(deviation);
    }
    let ((x, x_deviation), (y, y_deviation)) = (next(), next());
    let place = DVec2::from_angle(normal.yaw).rotate(DVec2::new(x, y) * normal.unit_m) + normal.origin;
    let (yaw, yaw_deviation) = if fold == 0 {
        (0.0, std::f64::consts::TAU)
    } else {
        let ((cosine, c_deviation), (sine, s_deviation)) = (next(), next());
        let direction = DVec2::new(cosine, sine);
        let across = (c_deviation * sine).hypot(s_deviation * cosine) / direction.length_squared().max(1e-6);
        (normal.yaw + direction.to_angle() / f64::from(fold), across / f64::from(fold))
    };
    let place_deviation = [x_deviation * normal.unit_m, y_deviation * normal.unit_m];
    (
        PartState { values, place, yaw },
        Deviations { values: value_deviations, place: place_deviation, yaw: yaw_deviation },
    )
}

/// The pose of a part's base frame that stands `base_m` over the origin of its cloud's frame.
pub fn pose(state: &PartState, base_m: f64) -> Pose {
    Pose::from_yaw(state.place.extend(base_m), state.yaw)
}

/// How a parameter is learned.
#[derive(Clone, Copy)]
enum Scale {
    /// A length that is never 0.
    Logarithm,
    /// Another length.
    Length,
    /// Angles and plain numbers.
    Plain,
}

impl Scale {
    fn of(spec: &acm_concept::template::ParameterSpec) -> Scale {
        match spec.unit {
            Unit::M if spec.min > 0.0 => Scale::Logarithm,
            Unit::M => Scale::Length,
            Unit::Rad | Unit::One => Scale::Plain,
        }
    }
    fn encode(self, value: f64, unit_m: f64) -> f64 {
        match self {
            Scale::Logarithm => (value / unit_m).ln(),
            Scale::Length => value / unit_m,
            Scale::Plain => value,
        }
    }
    fn decode(self, (number, deviation): (f64, f64), unit_m: f64) -> (f64, f64) {
        match self {
            Scale::Logarithm => {
                let value = unit_m * number.exp();
                (value, value * deviation)
            }
            Scale::Length => (number * unit_m, deviation * unit_m),
            Scale::Plain => (number, deviation),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn brick(rules: &str) -> Template {
        let length = |name: &str| {
            format!("[[parameter]]\nname = \"{name}\"\nunit = \"m\"\nmin = 0.01\nmax = 0.6\ninitial = \"extent_x\"\n")
        };
        let text = format!(
            "template = \"brick\"\nseen_by = \"depth\"\naffordances = []\n[synopsis]\ndescription = \"d\"\naffordance = \"a\"\n\
             intended_use = \"u\"\nnouns = [{{ noun = \"brick\" }}]\n{}{}\
             [[parameter]]\nname = \"tilt\"\nunit = \"rad\"\nmin = -0.5\nmax = 0.5\ninitial = \"0.1\"\n\
             [[solid]]\nshape = \"box\"\nsize = [\"length\", \"width\", \"0.02\"]\nposition = [\"0\", \"0\", \"0.01\"]\n{rules}",
            length("length"),
            length("width"),
        );
        Template::parse("brick.toml", &text).unwrap()
    }

    fn normal(yaw: f64, unit_m: f64) -> Normal {
        Normal { origin: DVec2::new(0.3, -0.2), yaw, unit_m, context: [0.0; 3] }
    }

    proptest! {
        #[test]
        fn what_is_encoded_is_decoded(length in 0.02..0.5f64, tilt in -0.4..0.4f64, yaw in -1.5..1.5f64, at in -0.2..0.2f64, view in -3.0..3.0f64) {
            let template = brick("[[symmetry]]\nfold = 2\n");
            let state = PartState { values: vec![length, 0.02, tilt], place: DVec2::new(0.3 + at, at), yaw };
            let normal = normal(view, 0.17);
            let numbers = encode(&template, &normal, &state);
            prop_assert_eq!(numbers.len(), HeadSpec::of(&template).outputs());
            let (found, deviations) = decode(&template, &normal, &numbers, &vec![0.1; numbers.len()]);
            for (a, b) in state.values.iter().zip(&found.values) {
                prop_assert!((a - b).abs() < 1e-5);
            }
            prop_assert!(state.place.distance(found.place) < 1e-5);
            prop_assert!(YawSymmetry::Fold(2).difference(found.yaw, yaw) < 1e-4);
            prop_assert!((deviations.values[0] - 0.1 * found.values[0]).abs() < 1e-9 && (deviations.values[2] - 0.1).abs() < 1e-6);
            prop_assert!((deviations.yaw - 0.05).abs() < 1e-4);
        }
    }

    #[test]
    fn equivalent_headings_have_equal_targets() {
        let state = |yaw: f64| PartState { values: vec![0.2, 0.1, 0.0], place: DVec2::ZERO, yaw };
        let targets = |rules: &str, yaw: f64| encode(&brick(rules), &normal(0.4, 0.2), &state(yaw));
        let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        let two = "[[symmetry]]\nfold = 2\n";
        assert!(near(&targets(two, 0.7), &targets(two, 0.7 + PI)));
        assert!(!near(&targets(two, 0.7), &targets(two, 0.7 + 0.5 * PI)));
        assert!(!near(&targets("", 0.7), &targets("", 0.7 + PI)));
        let round = "[[symmetry]]\nfold = 0\n";
        assert_eq!(targets(round, 0.7), targets(round, 1.9));
        assert_eq!(targets(round, 0.7).len(), 5);
    }
}
