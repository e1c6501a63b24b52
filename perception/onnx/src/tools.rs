//! The two tools that a model may be.

use crate::{
    model::{Model, OpenError},
    tensors,
};
use acm_perception::tools::{
    Identity, Mask, Outcome, ParamBelief, ParamEstimator, PartView, Prompts, Reason, Request, Segmenter, Tool,
    ToolError,
};
use std::path::Path;

/// A segmenter: `image` [1, 4, H, W] in, `scores` [1, things, H, W] out. It heeds no prompts.
///
/// A computation cannot be broken off: an answer that comes after the deadline is thrown away by the one who asked.
pub struct OnnxSegmenter(Model);

impl OnnxSegmenter {
    /// Opens a model file.
    ///
    /// # Errors
    /// No runtime, no model, or one with another interface.
    pub fn open(path: &Path) -> Result<OnnxSegmenter, OpenError> {
        Model::open(path, "image", &["scores"]).map(OnnxSegmenter)
    }
}

impl Tool for OnnxSegmenter {
    fn identity(&self) -> Identity {
        self.0.identity()
    }
}

impl Segmenter for OnnxSegmenter {
    fn segment(&self, request: &Request, _prompts: &Prompts) -> Outcome<Vec<Mask>> {
        let masks = || {
            let outputs = self.0.run(&tensors::image(request.frame)?)?;
            let scores = outputs.first().ok_or_else(|| ToolError::invalid("scores", "are missing"))?;
            tensors::masks(scores, request.frame)
        };
        masks().map_or_else(Outcome::Failed, Outcome::Ok)
    }
}

/// A parameter estimator of the template that the model's metadata name under `template`: `cloud` [1, 512, 3] in,
/// `values` and `sigmas` [1, parameters] out. It begins from no earlier belief.
pub struct OnnxParamEstimator(Model);

impl OnnxParamEstimator {
    /// Opens a model file.
    ///
    /// # Errors
    /// No runtime, no model, one with another interface, or one that names no template.
    pub fn open(path: &Path) -> Result<OnnxParamEstimator, OpenError> {
        let model = Model::open(path, "cloud", &["values", "sigmas"])?;
        if model.template().is_none() {
            let reason = "names no template: set `template` in its metadata".into();
            return Err(OpenError::Interface { path: path.into(), reason });
        }
        Ok(OnnxParamEstimator(model))
    }
}

impl Tool for OnnxParamEstimator {
    fn identity(&self) -> Identity {
        self.0.identity()
    }
}

impl ParamEstimator for OnnxParamEstimator {
    fn params(&self, request: &Request, part: &PartView, _prior: Option<&ParamBelief>) -> Outcome<ParamBelief> {
        if self.0.template() != Some(part.template.name.as_str()) {
            let known = self.0.template().unwrap_or_default();
            return Outcome::Abstain(Reason::Said(format!("knows template `{known}` alone")));
        }
        let belief = || {
            let outputs = self.0.run(&tensors::cloud(request.frame, part.mask)?)?;
            let [values, sigmas] = outputs.as_slice() else {
                return Err(ToolError::invalid("values", "are missing"));
            };
            tensors::belief(values, sigmas, part.template, part.mask.count)
        };
        belief().map_or_else(Outcome::Failed, Outcome::Ok)
    }
}
