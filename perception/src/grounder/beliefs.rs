//! A fit in the words of the tools: beliefs with full covariances.

use crate::{
    config::GrounderConfig,
    fit::Evidence,
    hypotheses::Hypothesis,
    tools::{ParamBelief, PoseBelief},
};
use acm_concept::{object::GroundedPart, template::YawSymmetry};

/// Where a fitted part is. The fit takes it to stand or lie exactly; how far the surface may be tilted unnoticed stands
/// for the two angles that are not fitted.
pub(super) fn pose(hypothesis: &Hypothesis, part: &GroundedPart, config: &GrounderConfig) -> PoseBelief {
    let (position, yaw) = (part.pose.position_sigma_m, part.pose.yaw_sigma_rad);
    let tilt = config.upright_tolerance_rad;
    let mut covariance = [[0.0; 6]; 6];
    for (i, sigma) in [position.x, position.y, position.z, tilt, tilt, yaw].into_iter().enumerate() {
        covariance[i][i] = sigma * sigma;
    }
    let symmetry = hypothesis.model.template.symmetry_at(&part.values(), part.pose.pose.rotation);
    PoseBelief { pose: part.pose.pose, covariance, symmetry: symmetry.unwrap_or(YawSymmetry::Fold(1)) }
}

/// How large a fitted part is: the calibrated standard deviations with the correlations of the fit.
pub(super) fn params(
    hypothesis: &Hypothesis,
    part: &GroundedPart,
    evidence: &Evidence,
    support_px: u32,
) -> ParamBelief {
    let (model, minimum) = (&hypothesis.model, &hypothesis.minimum);
    let correlation = |a: usize, b: usize| {
        if a == b {
            return 1.0;
        }
        let (Some(i), Some(j)) = (model.parameter_index(a), model.parameter_index(b)) else { return 0.0 };
        let scale = (minimum.covariance[(i, i)] * minimum.covariance[(j, j)]).sqrt();
        if scale > 0.0 { (minimum.covariance[(i, j)] / scale).clamp(-1.0, 1.0) } else { 0.0 }
    };
    let entry = |a: usize, b: usize| part.parameters[a].sigma * part.parameters[b].sigma * correlation(a, b);
    let indices = 0..part.parameters.len();
    let solids = model.solids(&minimum.state);
    let squares = evidence.points.iter().map(|point| {
        let distance = solids.iter().map(|solid| solid.signed_distance(point.position)).fold(f64::INFINITY, f64::min);
        distance * distance
    });
    ParamBelief {
        mean: part.parameters.iter().map(|parameter| parameter.value).collect(),
        covariance: indices.clone().map(|a| indices.clone().map(|b| entry(a, b)).collect()).collect(),
        observability: part.parameters.iter().map(|parameter| parameter.observability).collect(),
        support_px,
        residual_m: Some((squares.sum::<f64>() / evidence.points.len().max(1) as f64).sqrt()),
    }
}
