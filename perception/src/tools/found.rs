//! The values in a tool's answers.

use super::outcome::ToolError;
use acm_concept::{
    camera::{Intrinsics, MAX_PIXELS},
    object::{Observability, PixelSupport},
    pose::Pose,
    template::YawSymmetry,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A thing that was found, by its box in the image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Detection {
    /// First column, first row, last column, last row (both included).
    pub bounds: [u32; 4],
    /// Nouns with their probabilities, best first; what is missing to one is left open.
    pub labels: Vec<(String, f64)>,
}

/// The visible pixels of one thing. Masks of one answer share no pixel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mask {
    /// Its pixels, run-length encoded.
    pub support: PixelSupport,
    /// How sure the tool is that this is one whole thing, 0-1.
    pub score: f64,
    /// What the score rests on, as the tool names it: `stability`, `outline_own`.
    pub evidence: BTreeMap<String, f64>,
}

impl Mask {
    /// A mask from run lengths over the whole image, row by row, beginning with background.
    ///
    /// # Errors
    /// Runs that do not fill the image exactly, an empty run but the first, or no pixel at all.
    ///
    /// ```
    /// # use acm_concept::camera::Intrinsics;
    /// # use acm_perception::tools::Mask;
    /// let camera = Intrinsics::from_vertical_fov(4, 2, 1.0);
    /// let mask = Mask::from_runs(vec![1, 2, 5], &camera, 0.9).unwrap();
    /// assert_eq!((mask.support.count, mask.support.bounds), (2, [1, 0, 2, 0]));
    /// assert!(Mask::from_runs(vec![1, 2, 6], &camera, 0.9).is_err());
    /// ```
    pub fn from_runs(runs: Vec<u32>, intrinsics: &Intrinsics, score: f64) -> Result<Mask, ToolError> {
        let wrong = |reason: String| ToolError::invalid("runs", reason);
        let (width, pixels) = (intrinsics.width as usize, intrinsics.pixels());
        if pixels > MAX_PIXELS || runs.len() > pixels + 1 {
            return Err(wrong(format!("hold {} numbers for {pixels} pixels", runs.len())));
        }
        if runs.iter().skip(1).any(|run| *run == 0) {
            return Err(wrong("hold an empty run".into()));
        }
        let total: u64 = runs.iter().map(|run| u64::from(*run)).sum();
        if total != pixels as u64 {
            return Err(wrong(format!("cover {total} pixels, but the image has {pixels}")));
        }
        let mut set = vec![false; pixels];
        let mut at = 0;
        for (place, run) in runs.iter().enumerate() {
            set[at..at + *run as usize].fill(place % 2 == 1);
            at += *run as usize;
        }
        let support = PixelSupport::from_mask(&set, width).ok_or_else(|| wrong("leave no pixel set".into()))?;
        Ok(Mask { support, score, evidence: BTreeMap::new() })
    }
    /// The mask with a number that its score rests on.
    pub fn with(mut self, name: &str, value: f64) -> Mask {
        self.evidence.insert(name.into(), value);
        self
    }
}

/// A template that a thing may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartHypothesis {
    /// Template type tau.
    pub template: String,
    /// Logarithm of the likelihood of what is seen under it, up to a constant that all share.
    pub log_likelihood: f64,
}

/// Where a part is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseBelief {
    /// Pose of the template's base frame in the world.
    pub pose: Pose,
    /// Covariance of (x, y, z in metres; a small rotation about the world's x, y, z in radians), row by row.
    pub covariance: [[f64; 6]; 6],
    /// Which headings are equivalent.
    pub symmetry: YawSymmetry,
}

/// How large a part is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParamBelief {
    /// Values in the template's order and units.
    pub mean: Vec<f64>,
    /// Their covariance, row by row.
    pub covariance: Vec<Vec<f64>>,
    /// How each is known.
    pub observability: Vec<Observability>,
    /// Pixels that the values rest on.
    pub support_px: u32,
    /// Root mean square distance of these pixels' points from the solids with these values, metres; `None` from a tool
    /// that does not place them.
    pub residual_m: Option<f64>,
}
