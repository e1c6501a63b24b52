//! What goes into a model and what comes out of it.

use acm_concept::{
    camera::RgbdFrame,
    object::{Observability, PixelSupport},
    template::Template,
};
use acm_perception::tools::{MAX_FOUND, Mask, ParamBelief, ToolError};
use glam::DVec3;

/// Channels of a segmenter's image: red, green and blue from 0 to 1, depth in metres (0 where none was measured).
pub const IMAGE_CHANNELS: usize = 4;
/// Points of a parameter estimator's cloud.
pub const CLOUD_POINTS: usize = 512;
/// A pixel belongs to the thing with the highest score there, if that is higher than this.
const BELONGS: f32 = 0.5;

/// Numbers with a shape, the last dimension the fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// Sizes of its dimensions.
    pub shape: Vec<usize>,
    /// As many numbers as the sizes multiply to.
    pub values: Vec<f32>,
}

/// A frame as `image`, [1, 4, height, width].
pub(crate) fn image(frame: &RgbdFrame) -> Result<Tensor, ToolError> {
    let (width, height) = (frame.header.intrinsics.width as usize, frame.header.intrinsics.height as usize);
    let pixels = width * height;
    if frame.color.len() != 3 * pixels || frame.depth.len() != pixels {
        return Err(ToolError::bad_request("frame", "has planes of another size than its calibration says"));
    }
    let mut values = Vec::with_capacity(IMAGE_CHANNELS * pixels);
    for channel in 0..3 {
        values.extend(frame.color.iter().skip(channel).step_by(3).map(|value| f32::from(*value) / 255.0));
    }
    values.extend(frame.depth.iter().map(|z| if z.is_finite() && *z > 0.0 { *z } else { 0.0 }));
    Ok(Tensor { shape: vec![1, IMAGE_CHANNELS, height, width], values })
}

/// A model's `scores`, [1, things, height, width], as masks: every pixel is its best thing's, if that is likelier than
/// not; a mask's score is the mean of its pixels'.
pub(crate) fn masks(scores: &Tensor, frame: &RgbdFrame) -> Result<Vec<Mask>, ToolError> {
    let intrinsics = frame.header.intrinsics;
    let (width, pixels) = (intrinsics.width as usize, intrinsics.pixels());
    let things = match *scores.shape {
        [1, things, h, w] if (h, w) == (intrinsics.height as usize, width) && things <= MAX_FOUND => things,
        _ => {
            let wanted = format!("[1, at most {MAX_FOUND}, {}, {width}]", intrinsics.height);
            return Err(ToolError::invalid("scores", format!("have the shape {:?}, not {wanted}", scores.shape)));
        }
    };
    if scores.values.len() != things * pixels || scores.values.iter().any(|value| !(0.0..=1.0).contains(value)) {
        return Err(ToolError::invalid("scores", "are not all from 0 to 1"));
    }
    let mut best = vec![(BELONGS, usize::MAX); pixels];
    for (thing, plane) in scores.values.chunks_exact(pixels.max(1)).enumerate() {
        for (best, score) in best.iter_mut().zip(plane) {
            if *score > best.0 {
                *best = (*score, thing);
            }
        }
    }
    let mask = |thing: usize| {
        let set: Vec<bool> = best.iter().map(|(_, of)| *of == thing).collect();
        let support = PixelSupport::from_mask(&set, width)?;
        let sum: f64 = best.iter().filter(|(_, of)| *of == thing).map(|(score, _)| f64::from(*score)).sum();
        Some(Mask { score: sum / f64::from(support.count), support, evidence: Default::default() })
    };
    Ok((0..things).filter_map(mask).collect())
}

/// The points of a mask as `cloud`, [1, 512, 3]: along the world's axes, from the middle of their extents, metres. Points
/// are taken evenly over the mask, and again from the first where there are too few.
pub(crate) fn cloud(frame: &RgbdFrame, mask: &PixelSupport) -> Result<Tensor, ToolError> {
    let (camera, intrinsics) = (frame.header.camera_pose, frame.header.intrinsics);
    let point = |pixel: usize| {
        let depth = frame.depth.get(pixel).copied().filter(|z| z.is_finite() && *z > 0.0)?;
        let (column, row) = (pixel % intrinsics.width as usize, pixel / intrinsics.width as usize);
        Some(camera.transform_point(intrinsics.ray(column as f64, row as f64) * f64::from(depth)))
    };
    let points: Vec<DVec3> = mask.indices().into_iter().filter_map(point).collect();
    if points.is_empty() {
        return Err(ToolError::bad_request("mask", "has no pixel with a depth"));
    }
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let middle = (low + high) * 0.5;
    let taken = |i: usize| {
        let index = if points.len() < CLOUD_POINTS { i % points.len() } else { i * points.len() / CLOUD_POINTS };
        points.get(index).copied().unwrap_or(middle) - middle
    };
    let values = (0..CLOUD_POINTS).flat_map(|i| taken(i).to_array()).map(|value| value as f32).collect();
    Ok(Tensor { shape: vec![1, CLOUD_POINTS, 3], values })
}

/// A model's `values` and `sigmas`, each [1, parameters], as a belief. The model says nothing of what is hidden: a
/// parameter whose standard deviation is a quarter of its range or more is the template's prior.
pub(crate) fn belief(
    values: &Tensor,
    sigmas: &Tensor,
    template: &Template,
    support_px: u32,
) -> Result<ParamBelief, ToolError> {
    let size = template.parameters.len();
    for (name, tensor) in [("values", values), ("sigmas", sigmas)] {
        if tensor.shape != [1, size] || tensor.values.len() != size {
            let reason = format!("have the shape {:?}, but template `{}` has {size}", tensor.shape, template.name);
            return Err(ToolError::invalid(name, reason));
        }
    }
    if let Some(sigma) = sigmas.values.iter().find(|sigma| !(sigma.is_finite() && **sigma > 0.0)) {
        return Err(ToolError::invalid("sigmas", format!("hold {sigma}")));
    }
    let sigma = |i: usize| sigmas.values.get(i).map_or(0.0, |sigma| f64::from(*sigma));
    let known = |(i, spec): (usize, &acm_concept::template::ParameterSpec)| {
        if sigma(i) < 0.25 * (spec.max - spec.min) { Observability::Observed } else { Observability::PriorOnly }
    };
    Ok(ParamBelief {
        mean: values.values.iter().map(|value| f64::from(*value)).collect(),
        covariance: (0..size)
            .map(|i| (0..size).map(|j| if i == j { sigma(i).powi(2) } else { 0.0 }).collect())
            .collect(),
        observability: template.parameters.iter().enumerate().map(known).collect(),
        support_px,
        residual_m: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_perception::tools::conformance::Trial;

    #[test]
    fn an_image_has_its_channels_one_after_the_other() {
        let trial = Trial::new().unwrap();
        let image = image(&trial.frame).unwrap();
        assert_eq!(image.shape, [1, IMAGE_CHANNELS, 240, 320]);
        let (pixels, at) = (320 * 240, trial.things[0].mask.indices()[0]);
        let channels: Vec<f32> = (0..IMAGE_CHANNELS).map(|channel| image.values[channel * pixels + at]).collect();
        let [red, green, blue] = trial.frame.rgb(at).map(|value| f32::from(value) / 255.0);
        assert_eq!(channels, [red, green, blue, trial.frame.depth[at]]);
    }

    #[test]
    fn scores_become_masks_that_share_no_pixel() {
        let trial = Trial::new().unwrap();
        let size = trial.frame.depth.len();
        let mut values = vec![0.0; 2 * size];
        (values[3], values[4], values[size + 4], values[size + 5]) = (0.6, 0.7, 0.9, 0.8);
        let found = masks(&Tensor { shape: vec![1, 2, 240, 320], values: values.clone() }, &trial.frame).unwrap();
        let pixels: Vec<Vec<usize>> = found.iter().map(|mask| mask.support.indices()).collect();
        assert_eq!(pixels, [vec![3], vec![4, 5]]);
        assert!((found[1].score - 0.85).abs() < 1e-6);
        values[0] = f32::NAN;
        assert!(masks(&Tensor { shape: vec![1, 2, 240, 320], values: values.clone() }, &trial.frame).is_err());
        assert!(masks(&Tensor { shape: vec![1, 2, 320, 240], values }, &trial.frame).is_err());
    }

    #[test]
    fn a_cloud_is_as_large_as_the_thing_and_lies_round_the_origin() {
        let trial = Trial::new().unwrap();
        let can = &trial.things[1];
        let cloud = cloud(&trial.frame, &can.mask).unwrap();
        assert_eq!((cloud.shape, cloud.values.len()), (vec![1, CLOUD_POINTS, 3], 3 * CLOUD_POINTS));
        let extent = |axis: usize| {
            let along = || cloud.values.iter().skip(axis).step_by(3).copied();
            along().fold(f32::MIN, f32::max) - along().fold(f32::MAX, f32::min)
        };
        assert!((extent(0) - 0.07).abs() < 0.006 && (extent(2) - 0.1).abs() < 0.01, "{} {}", extent(0), extent(2));
    }

    #[test]
    fn a_belief_needs_a_value_and_a_sigma_for_each_parameter() {
        let trial = Trial::new().unwrap();
        let can = trial.template(&trial.things[1]);
        let tensor = |values: &[f32]| Tensor { shape: vec![1, values.len()], values: values.to_vec() };
        let known = belief(&tensor(&[0.03, 0.1]), &tensor(&[0.002, 0.4]), can, 9).unwrap();
        assert_eq!(known.observability, [Observability::Observed, Observability::PriorOnly]);
        assert!(belief(&tensor(&[0.03]), &tensor(&[0.002, 0.4]), can, 9).is_err());
        assert!(belief(&tensor(&[0.03, 0.1]), &tensor(&[0.0, 0.4]), can, 9).is_err());
    }
}
