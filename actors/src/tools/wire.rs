//! Requests and replies as JSON: docs/perception-tools.md and the schemas beside it.

use acm_concept::{
    camera::RgbdFrame,
    mesh::Mesh,
    object::Observability,
    pose::Pose,
    template::{TemplateLibrary, Unit, YawSymmetry},
};
use acm_perception::tools::{Detection, Mask, ParamBelief, PartHypothesis, PartView, PoseBelief, Request, ToolError};
use base64::{Engine, engine::general_purpose::STANDARD};
use glam::{DMat3, DQuat, DVec3};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

pub const REQUEST: &str = "acm.tool-request/1";
pub const REPLY: &str = "acm.tool-reply/1";
/// Metres per unit of the depth image: 16 bits reach to 6.5 m, where perception stops believing depths.
pub const DEPTH_UNIT_M: f64 = 1e-4;

/// What every request holds, and what only some do.
#[derive(Debug, Serialize)]
pub struct WireRequest<'a> {
    pub schema: &'static str,
    pub id: u64,
    pub limit_ms: u64,
    pub frame: &'a WireFrame,
    #[serde(flatten)]
    pub about: About<'a>,
}

/// What is asked for.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum About<'a> {
    Detect { nouns: &'a [String] },
    Segment { nouns: &'a [String], boxes: Vec<[u32; 4]> },
    Recognise { mask: &'a [u32], templates: Vec<WireTemplate<'a>> },
    Pose { mask: &'a [u32], part: WirePart<'a>, prior: Option<Box<WirePose>> },
    Params { mask: &'a [u32], part: WirePart<'a>, prior: Option<&'a ParamBelief> },
}

/// A frame with its images as PNG in base64.
#[derive(Debug, Serialize)]
pub struct WireFrame {
    id: u64,
    width: u32,
    height: u32,
    /// fx, fy, cx, cy in pixels.
    intrinsics: [f64; 4],
    camera_pose: Pose,
    color_png: String,
    depth_png: String,
    depth_unit_m: f64,
}

impl WireFrame {
    pub fn of(frame: &RgbdFrame) -> Result<WireFrame, ToolError> {
        let intrinsics = frame.header.intrinsics;
        let png = |bytes: &[u8], kind| {
            let mut png = Vec::new();
            let written = PngEncoder::new(&mut png).write_image(bytes, intrinsics.width, intrinsics.height, kind);
            match written {
                Ok(()) => Ok(STANDARD.encode(png)),
                Err(error) => Err(ToolError::bad_request("frame", error.to_string())),
            }
        };
        // Depths that are no numbers, negative or too far become 0: not measured.
        let unit = |z: &f32| {
            let units = (f64::from(*z) / DEPTH_UNIT_M).round();
            if (1.0..=65535.0).contains(&units) { units as u16 } else { 0 }
        };
        // The encoder takes samples in the machine's own order.
        let depth: Vec<u8> = frame.depth.iter().flat_map(|z| unit(z).to_ne_bytes()).collect();
        let complete = frame.depth.len() == intrinsics.pixels() && frame.color.len() == 3 * intrinsics.pixels();
        if !complete {
            return Err(ToolError::bad_request("frame", "has planes of another size than its calibration says"));
        }
        Ok(WireFrame {
            id: frame.header.id.0,
            width: intrinsics.width,
            height: intrinsics.height,
            intrinsics: [intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy],
            camera_pose: frame.header.camera_pose,
            color_png: png(&frame.color, ExtendedColorType::Rgb8)?,
            depth_png: png(&depth, ExtendedColorType::L16)?,
            depth_unit_m: DEPTH_UNIT_M,
        })
    }
}

/// A template that a thing may be.
#[derive(Debug, Serialize)]
pub struct WireTemplate<'a> {
    name: &'a str,
    description: &'a str,
    nouns: Vec<&'a str>,
}

pub fn templates(library: &TemplateLibrary) -> Vec<WireTemplate<'_>> {
    library
        .iter()
        .map(|template| WireTemplate {
            name: &template.name,
            description: &template.synopsis.description,
            nouns: template.synopsis.nouns.iter().map(|noun| noun.noun.as_str()).collect(),
        })
        .collect()
}

/// A template with values: parameters, and the solid that they make of it, in its base frame.
#[derive(Debug, Serialize)]
pub struct WirePart<'a> {
    template: &'a str,
    parameters: Vec<WireParameter<'a>>,
    mesh: Mesh,
}

#[derive(Debug, Serialize)]
struct WireParameter<'a> {
    name: &'a str,
    unit: Unit,
    value: f64,
    min: f64,
    max: f64,
}

impl<'a> WirePart<'a> {
    pub fn of(part: &PartView<'a>) -> Result<WirePart<'a>, ToolError> {
        let template = part.template;
        let solids = template.solids(&template.named(part.values));
        let solids = solids.map_err(|error| ToolError::bad_request("part", error.to_string()))?;
        let parameter = |(spec, value): (&'a acm_concept::template::ParameterSpec, &f64)| WireParameter {
            name: &spec.name,
            unit: spec.unit,
            value: *value,
            min: spec.min,
            max: spec.max,
        };
        Ok(WirePart {
            template: &template.name,
            parameters: template.parameters.iter().zip(part.values).map(parameter).collect(),
            mesh: Mesh::of(&solids),
        })
    }
}

/// A pose in the camera frame, as pose estimators give it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WirePose {
    translation: DVec3,
    rotation: DQuat,
    covariance: [[f64; 6]; 6],
    /// 0 if any heading looks the same.
    #[serde(default = "one")]
    symmetry_fold: u32,
}

fn one() -> u32 {
    1
}

impl WirePose {
    /// A belief about the world, seen from the camera.
    pub fn of(belief: &PoseBelief, camera: &Pose) -> WirePose {
        let to_camera = camera.inverse();
        let pose = to_camera * belief.pose;
        WirePose {
            translation: pose.translation,
            rotation: pose.rotation,
            covariance: turned(&belief.covariance, to_camera.rotation),
            symmetry_fold: match belief.symmetry {
                YawSymmetry::Continuous => 0,
                YawSymmetry::Fold(fold) => fold,
            },
        }
    }
    fn belief(self, camera: &Pose) -> Result<PoseBelief, ToolError> {
        // Written with few digits it may be a little off one.
        let length = self.rotation.length();
        if length.is_nan() || (length - 1.0).abs() > 1e-3 {
            return Err(ToolError::invalid(
                "pose.rotation",
                format!("has length {length}, but a rotation has length 1"),
            ));
        }
        let pose = Pose::new(self.translation, self.rotation.normalize());
        Ok(PoseBelief {
            pose: *camera * pose,
            covariance: turned(&self.covariance, camera.rotation),
            symmetry: if self.symmetry_fold == 0 {
                YawSymmetry::Continuous
            } else {
                YawSymmetry::Fold(self.symmetry_fold)
            },
        })
    }
}

/// A covariance of (position, small rotation) with both in turned axes.
fn turned(covariance: &[[f64; 6]; 6], rotation: DQuat) -> [[f64; 6]; 6] {
    let turn = DMat3::from_quat(rotation);
    let mut result = [[0.0; 6]; 6];
    for (rows, columns) in [(0, 0), (0, 3), (3, 0), (3, 3)] {
        let entry = |row: usize, column: usize| covariance[rows + row][columns + column];
        let column = |c: usize| DVec3::new(entry(0, c), entry(1, c), entry(2, c));
        let block = turn * DMat3::from_cols(column(0), column(1), column(2)) * turn.transpose();
        for row in 0..3 {
            for column in 0..3 {
                result[rows + row][columns + column] = block.col(column)[row];
            }
        }
    }
    result
}

/// What a server answers.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WireReply {
    pub schema: String,
    pub id: u64,
    pub tool: String,
    pub version: String,
    #[serde(default)]
    pub model_sha256: Option<String>,
    pub outcome: WireOutcome,
    #[serde(default)]
    pub missing: Vec<String>,
    #[serde(default)]
    pub reason: Option<String>,
    #[serde(default)]
    detections: Option<Vec<Detection>>,
    #[serde(default)]
    masks: Option<Vec<WireMask>>,
    #[serde(default)]
    hypotheses: Option<Vec<PartHypothesis>>,
    #[serde(default)]
    pose: Option<WirePose>,
    #[serde(default)]
    params: Option<WireParams>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WireOutcome {
    Ok,
    Partial,
    Abstain,
    Failed,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WireMask {
    runs: Vec<u32>,
    score: f64,
    #[serde(default)]
    evidence: BTreeMap<String, f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WireParams {
    mean: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    observability: Vec<Observability>,
    support_px: u32,
    #[serde(default)]
    residual_m: Option<f64>,
}

impl WireReply {
    pub fn detections(self) -> Result<Vec<Detection>, ToolError> {
        self.detections.ok_or_else(|| missing("detections"))
    }
    pub fn masks(self, request: &Request) -> Result<Vec<Mask>, ToolError> {
        let masks = self.masks.ok_or_else(|| missing("masks"))?;
        if masks.len() > acm_perception::tools::MAX_FOUND {
            return Err(ToolError::invalid("masks", format!("are {}, too many", masks.len())));
        }
        let read = |(index, mask): (usize, WireMask)| {
            let read = Mask::from_runs(mask.runs, &request.frame.header.intrinsics, mask.score);
            let read = read.map_err(|error| ToolError::invalid(format!("masks[{index}]"), error.to_string()))?;
            Ok(Mask { evidence: mask.evidence, ..read })
        };
        masks.into_iter().enumerate().map(read).collect()
    }
    pub fn hypotheses(self) -> Result<Vec<PartHypothesis>, ToolError> {
        self.hypotheses.ok_or_else(|| missing("hypotheses"))
    }
    pub fn pose(self, camera: &Pose) -> Result<PoseBelief, ToolError> {
        self.pose.ok_or_else(|| missing("pose"))?.belief(camera)
    }
    pub fn params(self) -> Result<ParamBelief, ToolError> {
        let WireParams { mean, covariance, observability, support_px, residual_m } =
            self.params.ok_or_else(|| missing("params"))?;
        Ok(ParamBelief { mean, covariance, observability, support_px, residual_m })
    }
}

fn missing(field: &str) -> ToolError {
    ToolError::invalid(field, "is missing")
}
