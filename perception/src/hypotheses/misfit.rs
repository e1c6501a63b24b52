//! How much of what was seen a fit explains, and how what it does not explain is spread.

use super::Hypothesis;
use crate::fit::{Evidence, OutlineKind};

/// An outline point that is farther off is an error of its own.
const GROSS_PX: f64 = 6.0;
/// A residual up to this many standard deviations counts as explained.
const EXPLAINED: f64 = 3.0;
/// So is an outline point up to this many pixels, however sharp the edge.
const EXPLAINED_PX: f64 = 4.5;
/// A surface point that is more standard deviations off is an error of its own.
const GROSS: f64 = 6.0;
/// What is so far below the top is wall, metres; fewer points tell no lean, and none is larger, metres.
const BELOW_TOP_M: f64 = 0.008;
const LEAST_WALL: usize = 20;
const MOST_LEAN_M: f64 = 0.004;

/// How a thing is not quite of its template's shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Misfit {
    /// How far the thing's own outline is from the fitted one, pixels: four fifths of its points are nearer, gross errors
    /// left out.
    pub outline_px: f64,
    /// Root mean square distance of its surface from the fitted one, in standard deviations.
    pub surface: f64,
    /// How much farther out its walls are at one end of their height than at the other, metres.
    pub lean_m: f64,
}

impl Hypothesis<'_> {
    /// Share of the evidence that the fit explains: of the surface points, and of the outline points that are the
    /// thing's own.
    pub fn explained(&self, evidence: &Evidence) -> (f64, f64) {
        let (points, outline) = self.residuals(evidence);
        let share = |good: usize, all: usize| if all == 0 { 1.0 } else { good as f64 / all as f64 };
        let own: Vec<bool> = outline
            .iter()
            .zip(&evidence.outline)
            .filter(|(_, p)| p.kind == OutlineKind::Own)
            .map(|(r, p)| r.abs() < EXPLAINED.max(EXPLAINED_PX / p.sigma_px))
            .collect();
        (
            share(points.iter().filter(|r| r.abs() < EXPLAINED).count(), points.len()),
            share(own.iter().filter(|fits| **fits).count(), own.len()),
        )
    }

    /// What the fit leaves.
    pub fn misfit(&self, evidence: &Evidence) -> Misfit {
        let (points, outline) = self.residuals(evidence);
        let own = outline.iter().zip(&evidence.outline).filter(|(_, point)| point.kind == OutlineKind::Own);
        let off = own.map(|(residual, point)| residual.abs() * point.sigma_px);
        let mut off: Vec<f64> = off.filter(|px| *px < GROSS_PX).collect();
        off.sort_by(f64::total_cmp);
        let fine: Vec<f64> = points.iter().filter(|r| r.abs() < GROSS).map(|r| r * r).collect();
        Misfit {
            outline_px: off.get(off.len() * 4 / 5).copied().unwrap_or(0.0),
            surface: (fine.iter().sum::<f64>() / fine.len().max(1) as f64).sqrt(),
            lean_m: self.lean_m(evidence, &points),
        }
    }

    /// The slope of the walls' residuals over their height, times the thing's height.
    fn lean_m(&self, evidence: &Evidence, residuals: &[f64]) -> f64 {
        let top_m = evidence.top_m();
        let all = evidence.points.iter().zip(residuals).filter(|(point, _)| point.position.z < top_m - BELOW_TOP_M);
        let walls: Vec<(f64, f64)> = all.map(|(point, r)| (point.position.z, r * point.sigma_m)).collect();
        if walls.len() < LEAST_WALL {
            return 0.0;
        }
        let mean = |of: fn(&(f64, f64)) -> f64| walls.iter().map(of).sum::<f64>() / walls.len() as f64;
        let (height, off) = (mean(|wall| wall.0), mean(|wall| wall.1));
        let spread: f64 = walls.iter().map(|wall| (wall.0 - height).powi(2)).sum();
        let together: f64 = walls.iter().map(|wall| (wall.0 - height) * (wall.1 - off)).sum();
        let base_m = self.model.placement(&self.minimum.state).pose.translation.z;
        (together / spread.max(1e-9) * (top_m - base_m)).abs().min(MOST_LEAN_M)
    }

    /// Of the surface points and of the outline points.
    fn residuals(&self, evidence: &Evidence) -> (Vec<f64>, Vec<f64>) {
        let mut points = Vec::new();
        self.model.residuals(&self.minimum.state, evidence, &mut points);
        let outline = points.split_off(evidence.points.len().min(points.len()));
        (points, outline)
    }
}
