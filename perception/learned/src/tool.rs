//! The estimator behind perception's trait.

use crate::{
    cloud::Cloud,
    config::{FolderError, WEIGHTS_FILE},
    estimator::{EstimateError, Estimated, Estimator},
    targets,
};
use acm_concept::{object::Observability, template::Template};
use acm_perception::{
    GrounderConfig,
    given::{self, GivenThing},
    tools::{Identity, Mask, Outcome, ParamBelief, ParamEstimator, PartView, Reason, Request, Tool, ToolError},
};
use std::path::Path;

/// Half of a 90 % interval in standard deviations.
const SIGMAS_90: f64 = 1.645;

/// Measures things by learned weights. Of a part it sees that one mask alone, and takes it to stand on the plane.
///
/// What it says of a parameter is an interval, never an observation: no face that bounds it was looked for.
#[derive(Debug, Clone)]
pub struct LearnedTool {
    estimator: Estimator,
    digest: [u8; 32],
    config: GrounderConfig,
}

impl LearnedTool {
    /// Reads a folder of weights.
    ///
    /// # Errors
    /// One line with the file and what is wrong with it.
    pub fn read(folder: &Path, config: GrounderConfig) -> Result<LearnedTool, FolderError> {
        let estimator = Estimator::read(folder)?;
        let path = folder.join(WEIGHTS_FILE);
        let bytes = std::fs::read(&path).map_err(|source| FolderError::file(&path, source))?;
        Ok(LearnedTool { estimator, digest: *blake3::hash(&bytes).as_bytes(), config })
    }

    fn thing(&self, request: &Request, part: &PartView) -> Result<GivenThing, Outcome<ParamBelief>> {
        let intrinsics = &request.frame.header.intrinsics;
        Mask::from_runs(part.mask.runs.clone(), intrinsics, 1.0)
            .map_err(|error| Outcome::Failed(ToolError::bad_request("mask", error.to_string())))?;
        let mut labels = vec![0; intrinsics.pixels()];
        for pixel in part.mask.indices() {
            if let Some(label) = labels.get_mut(pixel) {
                *label = 1;
            }
        }
        let things = given::things(request.frame, &labels, &[0.0], &self.config)
            .map_err(|blindness| Outcome::Abstain(Reason::Blind(blindness)))?;
        things.into_iter().next().flatten().ok_or(Outcome::Abstain(Reason::NothingFound))
    }
}

impl Tool for LearnedTool {
    fn identity(&self) -> Identity {
        let version = env!("CARGO_PKG_VERSION").into();
        Identity { tool: "learned".into(), version, model_digest: Some(self.digest) }
    }
}

impl ParamEstimator for LearnedTool {
    fn params(&self, request: &Request, part: &PartView, _prior: Option<&ParamBelief>) -> Outcome<ParamBelief> {
        let thing = match self.thing(request, part) {
            Ok(thing) => thing,
            Err(outcome) => return outcome,
        };
        let cloud = Cloud { camera: thing.camera.translation, points: thing.points };
        match self.estimator.estimate(&cloud, part.template) {
            Ok(estimated) => Outcome::Ok(belief(&estimated, part.template, &cloud, part.mask.count)),
            Err(error @ EstimateError::Tensor(_)) => Outcome::Failed(ToolError::Said { reason: error.to_string() }),
            Err(error) => Outcome::Abstain(Reason::Said(error.to_string())),
        }
    }
}

fn belief(estimated: &Estimated, template: &Template, cloud: &Cloud, support_px: u32) -> ParamBelief {
    let mean = estimated.state.values.clone();
    let deviations = &estimated.deviations.values;
    let row =
        |at: usize| (0..mean.len()).map(|to| if to == at { deviations.get(at).map_or(0.0, |d| d * d) } else { 0.0 });
    let covariance = (0..mean.len()).map(|at| row(at).collect()).collect();
    let specs = mean.iter().zip(deviations).zip(&template.parameters);
    let interval = |((value, deviation), spec): ((&f64, &f64), &acm_concept::template::ParameterSpec)| {
        if spec.fixed {
            return Observability::PriorOnly;
        }
        let half = SIGMAS_90 * deviation;
        Observability::Interval { low: (value - half).max(spec.min), high: (value + half).min(spec.max) }
    };
    let observability = specs.map(interval).collect();
    let to_part = targets::pose(&estimated.state, 0.0).inverse();
    let solids = template.solids(&template.named(&mean)).unwrap_or_default();
    let distance = |point: &glam::DVec3| {
        let own = to_part.transform_point(*point);
        solids.iter().map(|solid| solid.signed_distance(own)).fold(f64::INFINITY, f64::min)
    };
    let squares: f64 = cloud.points.iter().map(|point| distance(point).powi(2)).sum();
    let residual_m = (squares / cloud.points.len().max(1) as f64).sqrt();
    ParamBelief { mean, covariance, observability, support_px, residual_m: Some(residual_m) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use crate::{
        config::{Description, HeadSpec, Origin, SCHEMA, Shape},
        net::Net,
        samples::{Sample, Samples},
        targets::{PartState, encode},
        train::{Plan, begin, train},
    };
    use acm_concept::template::TemplateLibrary;
    use acm_perception::tools::{
        Tools,
        conformance::{Trial, answers, unfit_requests},
    };
    use std::{ops::ControlFlow, sync::Arc};

    /// The tool with weights that know the trial's two things by heart.
    fn tool(trial: &Trial) -> LearnedTool {
        let heads: Vec<HeadSpec> = trial.library.iter().map(HeadSpec::of).collect();
        let config = GrounderConfig::default();
        let sample = |thing: &acm_perception::tools::conformance::Thing| {
            let template = trial.template(thing);
            let mut labels = vec![0; trial.frame.header.intrinsics.pixels()];
            thing.mask.indices().into_iter().for_each(|pixel| labels[pixel] = 1);
            let seen = given::things(&trial.frame, &labels, &[0.0], &config).unwrap().remove(0).unwrap();
            let in_support = seen.camera * trial.frame.header.camera_pose.inverse() * thing.pose;
            let cloud = Cloud { camera: seen.camera.translation, points: seen.points };
            let normal = cloud.normal().unwrap();
            let place = in_support.translation.truncate();
            let state = PartState { values: thing.values.clone(), place, yaw: in_support.yaw() };
            let head = heads.iter().position(|head| head.template == thing.template).unwrap();
            Sample::new(&cloud, &normal, head, encode(template, &normal, &state))
        };
        let samples = trial.things.iter().map(sample).collect();
        let samples = Samples { heads: heads.clone(), scenes: [0, 0], samples };
        let shape = Shape { points: 256, groups: 16, group_size: 16, token_width: 16, layers: 1, heads: 2, width: 32 };
        let net = Net::drawn(shape, &heads, 1).unwrap();
        begin(&net, &samples).unwrap();
        let plan = Plan { steps: 40, batch: 2, learning_rate: 1e-3, seed: 1 };
        train(&net, &samples, &plan, |_| ControlFlow::Continue(())).unwrap();
        let description = Description { schema: SCHEMA.into(), shape, origin: Origin::default(), heads };
        let folder = tempfile::tempdir().unwrap();
        Estimator::new(description, net).write(folder.path()).unwrap();
        LearnedTool::read(folder.path(), config).unwrap()
    }

    #[test]
    fn it_passes_the_conformance_suite() {
        let trial = Trial::new().unwrap();
        let tools = Tools { param_estimator: Some(Arc::new(tool(&trial))), ..Tools::default() };
        let told = answers(&tools, &trial).unwrap();
        assert!(
            told.len() == trial.things.len() && told.iter().all(|told| told.outcome == Outcome::Ok(())),
            "{told:?}"
        );
        unfit_requests(&tools, &trial).unwrap();
    }

    #[test]
    fn a_template_that_was_not_learned_is_abstained_from() {
        let trial = Trial::new().unwrap();
        let tool = tool(&trial);
        let renamed = include_str!("../../src/tools/conformance/can.toml").replace("\"can\"", "\"tin\"");
        let library = TemplateLibrary::parse([("tin.toml", renamed.as_str())]).unwrap();
        let thing = trial.things.first().unwrap();
        let part = PartView { mask: &thing.mask, template: library.get("tin").unwrap(), values: &[0.03, 0.1] };
        let request = Request { id: 1, frame: &trial.frame, limit: std::time::Duration::from_secs(1) };
        let outcome = tool.params(&request, &part, None);
        assert!(matches!(&outcome, Outcome::Abstain(Reason::Said(why)) if why.contains("`tin`")), "{outcome:?}");
    }
}
