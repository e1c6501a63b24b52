//! Typical parameter values: the middle of the ranges, as far as the constraints allow.

use super::{Template, Unit};

/// Places in the ranges that are tried where the middle itself breaks a constraint.
const TRIES: u32 = 20_000;
/// Halvings of the way back to the middle.
const HALVINGS: usize = 30;

impl Template {
    /// The middle of every range, geometric for lengths; where that breaks a constraint, what comes nearest to it among
    /// many places spread evenly over the ranges. Fixed parameters have their value. `None` if no place was found that
    /// meets all constraints.
    pub fn typical(&self) -> Option<Vec<f64>> {
        let fixed = self.initial_values([0.0; 4]).ok()?;
        let at = |shares: &[f64]| -> Vec<f64> {
            let value = |((spec, fixed), share): ((&super::ParameterSpec, &f64), &f64)| match spec.unit {
                _ if spec.fixed => *fixed,
                Unit::M => (spec.min * (spec.max / spec.min).powf(*share)).clamp(spec.min, spec.max),
                Unit::Rad | Unit::One => spec.min + share * (spec.max - spec.min),
            };
            self.parameters.iter().zip(&fixed).zip(shares).map(value).collect()
        };
        let admitted = |shares: &[f64]| self.admits(&self.named(&at(shares)));
        let middle = vec![0.5; self.parameters.len()];
        if admitted(&middle) {
            return Some(at(&middle));
        }
        // Multiples of a root's powers, modulo 1, fill a cube evenly: M. Roberts' sequence.
        let root = (0..40).fold(2.0f64, |root, _| (1.0 + root).powf(1.0 / (self.parameters.len() as f64 + 1.0)));
        let spread = |n: u32| -> Vec<f64> {
            (1..=middle.len() as i32).map(|power| (0.5 + f64::from(n) * root.powi(-power)).fract()).collect()
        };
        let far = |shares: &[f64]| shares.iter().map(|share| (share - 0.5).powi(2)).sum::<f64>();
        let tried = (1..=TRIES).map(spread).filter(|shares| admitted(shares));
        let mut near = tried.min_by(|a, b| far(a).total_cmp(&far(b)))?;
        let mut step = 0.5;
        for _ in 0..HALVINGS {
            let closer: Vec<f64> = near.iter().map(|share| share + step * (0.5 - share)).collect();
            if admitted(&closer) {
                near = closer;
            } else {
                step *= 0.5;
            }
        }
        Some(at(&near))
    }
}
