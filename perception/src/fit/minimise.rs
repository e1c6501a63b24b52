//! Levenberg-Marquardt with a uniform outlier class, widened at first so that a rough start still reaches its points.

use super::{evidence::Evidence, model::Model};
use nalgebra::{DMatrix, DVector};

/// Weight of the uniform outlier class against the peak of the inliers' density.
const OUTLIERS: f64 = 0.02;
/// Widening of the standard deviations on the way to a minimum, stage by stage, and the steps of each.
const APPROACH: [(f64, usize); 2] = [(4.0, 5), (2.0, 4)];
/// A step that gains less (negative log likelihood) is the last one.
const WORTHWHILE: f64 = 0.02;
/// A weak pull towards the start keeps unseen directions from drifting, metres or radians.
const PULL_SIGMA: f64 = 0.3;

/// Where a minimisation ended.
#[derive(Debug, Clone)]
pub(crate) struct Minimum {
    pub state: Vec<f64>,
    /// Negative log likelihood over all evidence, up to a constant.
    pub cost: f64,
    /// Covariance of the state from the curvature, scaled up where the residuals are larger than their sigmas.
    pub covariance: DMatrix<f64>,
}

/// Which evidence is looked at.
#[derive(Clone, Copy, PartialEq)]
enum Share {
    All,
    /// Two thirds.
    Fitted,
    /// The remaining third.
    HeldOut,
}

impl Share {
    fn takes(self, index: usize) -> bool {
        match self {
            Share::All => true,
            Share::Fitted => !index.is_multiple_of(3),
            Share::HeldOut => index.is_multiple_of(3),
        }
    }
}

/// Moves a rough start near to a minimum, with wide standard deviations.
pub(crate) fn approach(model: &Model, evidence: &Evidence, start: &[f64]) -> Vec<f64> {
    let problem = Problem { model, evidence, start, frozen: None };
    APPROACH
        .iter()
        .fold(start.to_vec(), |state, (widening, steps)| problem.descend(state, *widening, *steps, Share::Fitted))
}

/// Fits a model from `start`, which [`approach`] has brought near. The start is kept where the fitted state does not
/// explain held-out evidence better.
pub(crate) fn minimise(model: &Model, evidence: &Evidence, start: &[f64]) -> Minimum {
    let problem = Problem { model, evidence, start, frozen: None };
    let mut state = problem.descend(start.to_vec(), 1.0, 8, Share::Fitted);
    let held_out = |state: &[f64]| problem.cost(state, 1.0, Share::HeldOut);
    if held_out(&state) > held_out(start) {
        state = start.to_vec();
    }
    let state = problem.descend(state, 1.0, 3, Share::All);
    let covariance = problem.covariance(&state);
    let cost = cost(model, evidence, &state);
    Minimum { state, cost, covariance }
}

/// Negative log likelihood of the evidence at a state.
pub(crate) fn cost(model: &Model, evidence: &Evidence, state: &[f64]) -> f64 {
    Problem { model, evidence, start: state, frozen: None }.cost(state, 1.0, Share::All)
}

/// The cost of a rough state, with wide standard deviations: which of several starts is worth a fit.
pub(crate) fn rough_cost(model: &Model, evidence: &Evidence, state: &[f64]) -> f64 {
    Problem { model, evidence, start: state, frozen: None }.cost(state, 3.0, Share::All)
}

/// The state with one quantity held at its value and the others re-fitted by a few steps, and its cost.
pub(crate) fn refit_others(
    model: &Model,
    evidence: &Evidence,
    state: &[f64],
    frozen: usize,
    steps: usize,
) -> (Vec<f64>, f64) {
    let problem = Problem { model, evidence, start: state, frozen: Some(frozen) };
    let state = problem.descend(state.to_vec(), 1.0, steps, Share::All);
    let cost = cost(model, evidence, &state);
    (state, cost)
}

struct Problem<'a> {
    model: &'a Model<'a>,
    evidence: &'a Evidence,
    start: &'a [f64],
    /// Quantity that does not move.
    frozen: Option<usize>,
}

impl Problem<'_> {
    fn weight(&self, index: usize) -> f64 {
        if index < self.evidence.points.len() { self.evidence.point_weight } else { self.evidence.outline_weight }
    }
    fn pull(&self, state: &[f64]) -> f64 {
        state.iter().zip(self.start).map(|(a, b)| 0.5 * ((a - b) / PULL_SIGMA).powi(2)).sum()
    }
    fn cost(&self, state: &[f64], widening: f64, share: Share) -> f64 {
        let mut residuals = Vec::new();
        self.model.residuals(state, self.evidence, &mut residuals);
        self.cost_of(&residuals, widening, share) + self.pull(state)
    }
    fn cost_of(&self, residuals: &[f64], widening: f64, share: Share) -> f64 {
        let taken = residuals.iter().enumerate().filter(|(i, _)| share.takes(*i));
        taken.map(|(i, r)| self.weight(i) * robust_cost(r / widening)).sum()
    }

    fn descend(&self, mut state: Vec<f64>, widening: f64, steps: usize, share: Share) -> Vec<f64> {
        let mut damping = 1e-3;
        let mut residuals = Vec::new();
        self.model.residuals(&state, self.evidence, &mut residuals);
        let mut cost = self.cost_of(&residuals, widening, share) + self.pull(&state);
        for _ in 0..steps {
            let (normal, gradient) = self.linearise(&state, &residuals, widening, share);
            let mut improved = false;
            for _ in 0..5 {
                let mut damped = normal.clone();
                for i in 0..damped.nrows() {
                    damped[(i, i)] += damping * (normal[(i, i)] + 1e-6);
                }
                let Some(step) = damped.cholesky().map(|c| c.solve(&gradient)) else { break };
                let mut next: Vec<f64> = state.iter().zip(step.iter()).map(|(a, b)| a - b).collect();
                self.model.clamp(&mut next);
                let mut next_residuals = Vec::new();
                self.model.residuals(&next, self.evidence, &mut next_residuals);
                let next_cost = self.cost_of(&next_residuals, widening, share) + self.pull(&next);
                if next_cost < cost {
                    improved = cost - next_cost > WORTHWHILE;
                    (state, residuals, cost) = (next, next_residuals, next_cost);
                    damping = (damping * 0.2).max(1e-7);
                    break;
                }
                damping *= 6.0;
            }
            if !improved {
                break;
            }
        }
        state
    }

    /// The weighted normal matrix and gradient, with forward differences.
    fn linearise(&self, state: &[f64], residuals: &[f64], widening: f64, share: Share) -> (DMatrix<f64>, DVector<f64>) {
        let size = state.len();
        let (mut columns, mut moved) = (Vec::with_capacity(size), Vec::new());
        for i in 0..size {
            if self.frozen == Some(i) {
                columns.push(vec![0.0; residuals.len()]);
                continue;
            }
            let mut next = state.to_vec();
            // Towards the inside where the value sits at its upper bound.
            let mut step = 2e-4;
            next[i] += step;
            self.model.clamp(&mut next);
            if next[i] == state[i] {
                step = -step;
                next[i] = state[i] + step;
            }
            self.model.residuals(&next, self.evidence, &mut moved);
            columns.push(moved.iter().zip(residuals).map(|(a, b)| (a - b) / (step * widening)).collect::<Vec<f64>>());
        }
        let (mut normal, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for (at, residual) in residuals.iter().enumerate().filter(|(at, _)| share.takes(*at)) {
            let reduced = residual / widening;
            let weight = self.weight(at) * robust_weight(reduced);
            if weight < 1e-6 {
                continue;
            }
            for i in 0..size {
                let ji = columns[i][at];
                gradient[i] += weight * ji * reduced;
                for j in 0..=i {
                    normal[(i, j)] += weight * ji * columns[j][at];
                }
            }
        }
        for i in 0..size {
            for j in 0..i {
                normal[(j, i)] = normal[(i, j)];
            }
            normal[(i, i)] += 1.0 / (PULL_SIGMA * PULL_SIGMA);
            gradient[i] += (state[i] - self.start[i]) / (PULL_SIGMA * PULL_SIGMA);
        }
        (normal, gradient)
    }

    fn covariance(&self, state: &[f64]) -> DMatrix<f64> {
        let mut residuals = Vec::new();
        self.model.residuals(state, self.evidence, &mut residuals);
        let (normal, _) = self.linearise(state, &residuals, 1.0, Share::All);
        let (mut squares, mut total) = (0.0, 0.0);
        for (i, r) in residuals.iter().enumerate() {
            let weight = self.weight(i) * robust_weight(*r);
            squares += weight * r * r;
            total += weight;
        }
        let misfit = if total > 0.0 { (squares / total).max(1.0) } else { 1.0 };
        let size = state.len();
        normal.cholesky().map_or_else(|| DMatrix::identity(size, size), |c| c.inverse() * misfit)
    }
}

/// Negative log of a normal density mixed with a uniform one, 0 at r = 0.
fn robust_cost(r: f64) -> f64 {
    -(((-0.5 * r * r).exp() + OUTLIERS) / (1.0 + OUTLIERS)).ln()
}
/// The probability that a residual is no outlier: the weight of its least-squares term.
fn robust_weight(r: f64) -> f64 {
    let inlier = (-0.5 * r * r).exp();
    inlier / (inlier + OUTLIERS)
}
