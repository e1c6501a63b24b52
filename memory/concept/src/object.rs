//! Grounded parts and objects: what perception reports of a frame, before memory gives identities.

use crate::{camera::FrameHeader, color::Appearance, ids::ObjectId, pose::Pose, reading::Reading};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How a parameter is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Observability {
    /// Both bounding surfaces were seen, or one and the surface it stands on.
    Observed,
    /// Only bounded: at least what was seen, at most what the occlusion or the prior leaves room for.
    Interval {
        /// Smallest value that fits.
        low: f64,
        /// Largest value that fits.
        high: f64,
    },
    /// Nothing was seen of it; the value is the template's prior.
    PriorOnly,
}

/// One estimated parameter of a part. Values are in the unit that the template declares.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// The parameter's name in its template.
    pub name: String,
    /// Best estimate.
    pub value: f64,
    /// Standard deviation, calibrated: includes the systematic floor of the sensor.
    pub sigma: f64,
    /// How it is known.
    pub observability: Observability,
}

/// A pose with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseEstimate {
    /// Pose of the part's frame in the world. The main part's is the template's base frame: origin at the middle of
    /// the bottom, z up for upright objects.
    pub pose: Pose,
    /// Standard deviation along the world's axes, metres.
    pub position_sigma_m: DVec3,
    /// Standard deviation of the heading, radians, modulo the template's symmetry.
    pub yaw_sigma_rad: f64,
}

/// A part bound to a template: P = (tau, Theta, T, A, F_tau).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroundedPart {
    /// Template type tau.
    pub template: String,
    /// Which of the template's parts it is ([`WHOLE`](crate::template::WHOLE) where the template has but one).
    #[serde(default = "whole")]
    pub name: String,
    /// Parameters Theta, in the template's order. The parts of one template share them.
    pub parameters: Vec<ParameterEstimate>,
    /// Pose T.
    pub pose: PoseEstimate,
    /// Affordances A, from the template.
    pub affordances: Vec<String>,
    /// Names of the manipulation functions F_tau that the template binds.
    pub functions: Vec<String>,
    /// Colour of the part's visible surface.
    pub appearance: Appearance,
}

fn whole() -> String {
    crate::template::WHOLE.into()
}

impl GroundedPart {
    /// Parameter values by name, as expressions take them.
    pub fn values(&self) -> Vec<(&str, f64)> {
        self.parameters.iter().map(|p| (p.name.as_str(), p.value)).collect()
    }
    /// The direction of the part's own frame that points up: z for an upright part.
    pub fn up(&self) -> DVec3 {
        self.pose.pose.rotation.inverse() * DVec3::Z
    }
    /// One parameter's value.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.parameters.iter().find(|p| p.name == name).map(|p| p.value)
    }
}

/// The pixels that an object explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PixelSupport {
    /// Number of pixels.
    pub count: u32,
    /// First column, first row, last column, last row (both included).
    pub bounds: [u32; 4],
    /// Run lengths over the whole image, row by row, beginning with background.
    pub runs: Vec<u32>,
}

impl PixelSupport {
    /// Packs a mask (row by row, `width` columns); `None` if it is empty.
    ///
    /// ```
    /// # use acm_concept::object::PixelSupport;
    /// let support = PixelSupport::from_mask(&[false, true, true, false, true, false], 3).unwrap();
    /// assert_eq!((support.count, support.bounds), (3, [1, 0, 2, 1]));
    /// assert_eq!(support.indices(), [1, 2, 4]);
    /// ```
    pub fn from_mask(mask: &[bool], width: usize) -> Option<PixelSupport> {
        let (mut runs, mut value, mut length, mut count) = (Vec::new(), false, 0u32, 0u32);
        let mut bounds = [u32::MAX, u32::MAX, 0, 0];
        for (index, &set) in mask.iter().enumerate() {
            if set != value {
                runs.push(length);
                (value, length) = (set, 0);
            }
            length += 1;
            if set {
                count += 1;
                let (column, row) = ((index % width) as u32, (index / width) as u32);
                bounds = [bounds[0].min(column), bounds[1].min(row), bounds[2].max(column), bounds[3].max(row)];
            }
        }
        runs.push(length);
        (count > 0).then_some(PixelSupport { count, bounds, runs })
    }
    /// Packs ascending indices of pixels of an image with `pixels` of them; `None` without any.
    ///
    /// ```
    /// # use acm_concept::object::PixelSupport;
    /// let mask = [true, true, false, false, true, false];
    /// assert_eq!(PixelSupport::from_indices(&[0, 1, 4], 3, 6), PixelSupport::from_mask(&mask, 3));
    /// ```
    pub fn from_indices(indices: &[usize], width: usize, pixels: usize) -> Option<PixelSupport> {
        let (mut runs, mut at) = (Vec::new(), 0usize);
        let mut bounds = [u32::MAX, u32::MAX, 0, 0];
        for stretch in indices.chunk_by(|a, b| a + 1 == *b) {
            let (first, end) = (stretch.first()?, stretch.last()? + 1);
            runs.extend([(first - at) as u32, stretch.len() as u32]);
            at = end;
        }
        for index in indices {
            let (column, row) = ((index % width) as u32, (index / width) as u32);
            bounds = [bounds[0].min(column), bounds[1].min(row), bounds[2].max(column), bounds[3].max(row)];
        }
        if at < pixels {
            runs.push((pixels - at) as u32);
        }
        (!indices.is_empty()).then_some(PixelSupport { count: indices.len() as u32, bounds, runs })
    }
    /// The pixel indices, ascending.
    pub fn indices(&self) -> Vec<usize> {
        let (mut at, mut set, mut indices) = (0usize, false, Vec::with_capacity(self.count as usize));
        for &length in &self.runs {
            if set {
                indices.extend(at..at + length as usize);
            }
            at += length as usize;
            set = !set;
        }
        indices
    }
}

/// An object as grounded from one frame: O = (c, {P_i}), without an identity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroundedObject {
    /// Most likely category, a noun of a template.
    pub category: String,
    /// Probabilities of the nouns that fit, best first, `category` included.
    pub categories: Vec<(String, f64)>,
    /// The parts; the first is the main one.
    pub parts: Vec<GroundedPart>,
    /// Colour of the whole.
    pub appearance: Appearance,
    /// Pixels it explains.
    pub support: PixelSupport,
    /// Probability that this is an object and its grounding is right, 0-1.
    pub confidence: f64,
    /// Whether the image border or another object cuts it off, so that its outline is not its own.
    pub truncated: bool,
    /// The expected object whose predicted appearance explained these pixels, as a hint for identity.
    pub expected: Option<ObjectId>,
    /// What is written or shown on it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub readings: Vec<Reading>,
}

impl GroundedObject {
    /// Pose of the main part.
    pub fn pose(&self) -> Option<&PoseEstimate> {
        self.parts.first().map(|part| &part.pose)
    }
}

/// The horizontal surface on which things stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SupportPlane {
    /// Unit normal in the world, pointing up.
    pub normal: DVec3,
    /// Signed offset: points `p` of the plane have `normal . p = offset_m`. Metres.
    pub offset_m: f64,
    /// Root mean square distance of its inliers, metres.
    pub residual_m: f64,
    /// Colour of the bare surface.
    pub appearance: Appearance,
}

impl SupportPlane {
    /// Height of the plane below or above a point with the given x and y, world frame, metres.
    pub fn height_at(&self, x: f64, y: f64) -> f64 {
        (self.offset_m - self.normal.x * x - self.normal.y * y) / self.normal.z
    }
    /// Signed distance of a point above the plane, metres.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset_m
    }
}

/// What a frame says of an object that memory expected to see.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Visibility {
    /// Enough of its predicted pixels agree.
    Seen,
    /// Something nearer covers where it should be.
    Occluded,
    /// The camera does not cover where it should be.
    OutOfView,
    /// The depth lies behind where it should be: it is not there.
    SeenThrough,
    /// No depth was measured there.
    NotMeasured,
}

/// The verdict on one expected object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExpectedView {
    /// The expected object.
    pub object: ObjectId,
    /// What the frame says.
    pub visibility: Visibility,
    /// Share of its predicted pixels that support the verdict, 0-1.
    pub fraction: f64,
}

/// Why a frame could not be grounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Blindness {
    /// No, or almost no, depth was measured.
    NoDepth,
    /// Depth was measured, but nearly all of it lies nearer or farther than any sensor of this kind sees: it is likely in
    /// another unit than metres.
    DepthScale,
    /// The colour image is black.
    NoColor,
    /// The colour image is white: overexposed.
    Overexposed,
    /// There is depth, but no surface on which things could stand.
    NoSupport,
    /// The camera has stopped: the picture is its last one again, bit for bit, although time has passed.
    Frozen,
}

/// Everything perception says about one frame. Abstaining is an ordinary answer: then `blindness` says why
/// and there are no objects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Percepts {
    /// The frame that was read.
    pub frame: FrameHeader,
    /// The surface on which things stand, where one was found.
    pub support: Option<SupportPlane>,
    /// Objects, largest pixel support first.
    pub objects: Vec<GroundedObject>,
    /// One entry for each expected object.
    pub expected: Vec<ExpectedView>,
    /// Why nothing could be grounded, if so.
    pub blindness: Option<Blindness>,
    /// Share of the pixels with a depth, 0-1.
    pub depth_fraction: f64,
}
