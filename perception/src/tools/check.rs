//! What an answer must keep to before anything is made of it.

use super::{
    asked::PartView,
    found::{Detection, Mask, ParamBelief, PartHypothesis, PoseBelief},
    outcome::ToolError,
};
use acm_concept::{
    camera::{FrameHeader, Intrinsics},
    object::Observability,
    template::TemplateLibrary,
};
use nalgebra::DMatrix;
use std::collections::BTreeSet;

/// Most detections, masks or hypotheses of one answer.
pub const MAX_FOUND: usize = 1024;
/// No camera of ours sees farther, metres.
const FARTHEST_M: f64 = 20.0;
/// A covariance may be so far from symmetric, and its eigenvalues so far below zero, as a share of its largest entry:
/// numbers are written with few digits.
const ROUNDED: f64 = 1e-6;

type Checked = Result<(), ToolError>;

fn invalid(field: impl Into<String>, reason: impl Into<String>) -> Checked {
    Err(ToolError::invalid(field, reason))
}

fn count(field: &str, found: usize) -> Checked {
    if found > MAX_FOUND {
        return invalid(field, format!("are {found}, more than {MAX_FOUND}"));
    }
    Ok(())
}

fn share(field: String, value: f64) -> Checked {
    if !(0.0..=1.0).contains(&value) {
        return invalid(field, format!("is {value}, not from 0 to 1"));
    }
    Ok(())
}

pub(super) fn detections(found: &[Detection], intrinsics: &Intrinsics) -> Checked {
    count("detections", found.len())?;
    for (i, detection) in found.iter().enumerate() {
        let [left, top, right, bottom] = detection.bounds;
        if left > right || top > bottom || right >= intrinsics.width || bottom >= intrinsics.height {
            return invalid(format!("detections[{i}].bounds"), format!("{:?} are not in the image", detection.bounds));
        }
        count(&format!("detections[{i}].labels"), detection.labels.len())?;
        for (label, probability) in &detection.labels {
            share(format!("detections[{i}].labels.{label}"), *probability)?;
        }
        let together: f64 = detection.labels.iter().map(|(_, probability)| probability).sum();
        if together > 1.0 + ROUNDED {
            return invalid(format!("detections[{i}].labels"), format!("add up to {together}, more than 1"));
        }
    }
    Ok(())
}

pub(super) fn masks(found: &[Mask], intrinsics: &Intrinsics) -> Checked {
    count("masks", found.len())?;
    let mut owner = vec![usize::MAX; intrinsics.pixels()];
    for (i, mask) in found.iter().enumerate() {
        share(format!("masks[{i}].score"), mask.score)?;
        if let Some((name, value)) = mask.evidence.iter().find(|(_, value)| !value.is_finite()) {
            return invalid(format!("masks[{i}].evidence.{name}"), format!("is {value}"));
        }
        let read = Mask::from_runs(mask.support.runs.clone(), intrinsics, mask.score);
        let read = read.map_err(|error| ToolError::invalid(format!("masks[{i}]"), error.to_string()))?;
        if read.support != mask.support {
            return invalid(format!("masks[{i}].support"), "has another count or other bounds than its runs");
        }
        for pixel in mask.support.indices() {
            let Some(of) = owner.get_mut(pixel) else { return invalid(format!("masks[{i}]"), "leaves the image") };
            if *of != usize::MAX {
                return invalid(format!("masks[{i}]"), format!("shares pixels with masks[{of}]", of = *of));
            }
            *of = i;
        }
    }
    Ok(())
}

pub(super) fn hypotheses(found: &[PartHypothesis], library: &TemplateLibrary) -> Checked {
    count("hypotheses", found.len())?;
    let mut seen = BTreeSet::new();
    for (i, hypothesis) in found.iter().enumerate() {
        if library.get(&hypothesis.template).is_none() {
            return invalid(format!("hypotheses[{i}].template"), format!("`{}` is not known", hypothesis.template));
        }
        if !seen.insert(hypothesis.template.as_str()) {
            return invalid(format!("hypotheses[{i}].template"), format!("`{}` comes twice", hypothesis.template));
        }
        if !hypothesis.log_likelihood.is_finite() {
            return invalid(format!("hypotheses[{i}].log_likelihood"), format!("is {}", hypothesis.log_likelihood));
        }
    }
    Ok(())
}

pub(super) fn pose(belief: &PoseBelief, header: &FrameHeader) -> Checked {
    if !belief.pose.is_valid() {
        return invalid("pose", "holds no finite translation and unit quaternion");
    }
    let away = belief.pose.translation.distance(header.camera_pose.translation);
    if away > FARTHEST_M {
        return invalid("pose.translation", format!("is {away:.0} m from the camera"));
    }
    covariance(&DMatrix::from_fn(6, 6, |row, column| belief.covariance[row][column]))
}

pub(super) fn params(belief: &ParamBelief, part: &PartView) -> Checked {
    let specs = &part.template.parameters;
    let size = specs.len();
    for (field, length) in [("mean", belief.mean.len()), ("observability", belief.observability.len())] {
        if length != size {
            return invalid(field, format!("has {length} entries, but template `{}` has {size}", part.template.name));
        }
    }
    for (spec, value) in specs.iter().zip(&belief.mean) {
        if !(spec.min..=spec.max).contains(value) {
            let range = format!("from {} to {}", spec.min, spec.max);
            return invalid(format!("mean.{}", spec.name), format!("is {value}, not {range}"));
        }
    }
    for (spec, how) in specs.iter().zip(&belief.observability) {
        if let Observability::Interval { low, high } = how
            && !(low.is_finite() && high.is_finite() && low <= high)
        {
            return invalid(format!("observability.{}", spec.name), format!("is the interval from {low} to {high}"));
        }
    }
    if let Some(residual_m) = belief.residual_m.filter(|residual| !(residual.is_finite() && *residual >= 0.0)) {
        return invalid("residual_m", format!("is {residual_m}"));
    }
    if belief.covariance.len() != size || belief.covariance.iter().any(|row| row.len() != size) {
        return invalid("covariance", format!("is not {size} x {size}"));
    }
    covariance(&DMatrix::from_fn(size, size, |row, column| belief.covariance[row][column]))
}

/// Finite, symmetric, and no variance below zero in any direction.
fn covariance(matrix: &DMatrix<f64>) -> Checked {
    if matrix.iter().any(|value| !value.is_finite()) {
        return invalid("covariance", "holds a number that is not finite");
    }
    if matrix.is_empty() {
        return Ok(());
    }
    let leave = ROUNDED * matrix.amax();
    if (matrix - matrix.transpose()).amax() > leave {
        return invalid("covariance", "is not symmetric");
    }
    if matrix.clone().symmetric_eigenvalues().iter().any(|value| *value < -leave) {
        return invalid("covariance", "has a negative eigenvalue");
    }
    Ok(())
}
