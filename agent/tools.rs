//! The tools of perception that a user names, opened: the only place that knows where each kind is.

use acm_actors::tools::{HttpTool, ToolSettings, WallStopwatch};
use acm_perception::tools::{Segmenter, Tools};
use std::sync::Arc;

/// What stands before the path of a model file.
const ONNX: &str = "onnx:";
/// What stands before the path of a folder of weights.
const LEARNED: &str = "learned:";

/// Opens what the `[tools]` table of `file` names: `http://HOST:PORT`, `onnx:MODEL.onnx` for a segmenter or a parameter
/// estimator, or `learned:DIR` for a parameter estimator. Servers are not asked yet.
///
/// # Errors
/// An address that is none, a model that cannot be opened, or one that this build leaves out.
pub fn open(file: &str, settings: &ToolSettings) -> anyhow::Result<Tools> {
    let at = |field: &'static str| move |reason: String| anyhow::anyhow!("{file}: tools.{field}: {reason}");
    let http = |field: &'static str, named: &Option<String>| {
        let tool = named.as_deref().map(HttpTool::new).transpose().map_err(at(field))?;
        anyhow::Ok(tool.map(Arc::new))
    };
    let segmenter: Option<Arc<dyn Segmenter>> = match path(&settings.segmenter, ONNX) {
        Some(path) => Some(onnx::segmenter(path).map_err(at("segmenter"))?),
        None => http("segmenter", &settings.segmenter)?.map(|tool| tool as _),
    };
    let named = &settings.param_estimator;
    let param_estimator = match (path(named, ONNX), path(named, LEARNED)) {
        (Some(path), _) => Some(onnx::param_estimator(path).map_err(at("param_estimator"))?),
        (None, Some(path)) => Some(learned::param_estimator(path).map_err(at("param_estimator"))?),
        (None, None) => http("param_estimator", named)?.map(|tool| tool as _),
    };
    Ok(Tools {
        detector: http("detector", &settings.detector)?.map(|tool| tool as _),
        segmenter,
        part_recogniser: http("part_recogniser", &settings.part_recogniser)?.map(|tool| tool as _),
        pose_estimator: http("pose_estimator", &settings.pose_estimator)?.map(|tool| tool as _),
        param_estimator,
        limit: settings.limit(),
        stopwatch: Arc::new(WallStopwatch::default()),
    })
}

fn path<'a>(named: &'a Option<String>, kind: &str) -> Option<&'a str> {
    named.as_deref()?.strip_prefix(kind)
}

#[cfg(feature = "learned")]
mod learned {
    use acm_learned::tool::LearnedTool;
    use acm_perception::{GrounderConfig, tools::ParamEstimator};
    use std::{path::Path, sync::Arc};

    pub fn param_estimator(path: &str) -> Result<Arc<dyn ParamEstimator>, String> {
        let tool = LearnedTool::read(Path::new(path), GrounderConfig::default());
        tool.map(|tool| Arc::new(tool) as _).map_err(|error| error.to_string())
    }
}

#[cfg(not(feature = "learned"))]
mod learned {
    use acm_perception::tools::ParamEstimator;
    use std::sync::Arc;

    pub fn param_estimator(path: &str) -> Result<Arc<dyn ParamEstimator>, String> {
        Err(format!("{path} needs the learned estimator, which this build leaves out: build with --features learned"))
    }
}

#[cfg(feature = "onnx")]
mod onnx {
    use acm_onnx::{OnnxParamEstimator, OnnxSegmenter};
    use acm_perception::tools::{ParamEstimator, Segmenter};
    use std::{path::Path, sync::Arc};

    pub fn segmenter(path: &str) -> Result<Arc<dyn Segmenter>, String> {
        OnnxSegmenter::open(Path::new(path)).map(|tool| Arc::new(tool) as _).map_err(|error| error.to_string())
    }
    pub fn param_estimator(path: &str) -> Result<Arc<dyn ParamEstimator>, String> {
        OnnxParamEstimator::open(Path::new(path)).map(|tool| Arc::new(tool) as _).map_err(|error| error.to_string())
    }
}

#[cfg(not(feature = "onnx"))]
mod onnx {
    use acm_perception::tools::{ParamEstimator, Segmenter};
    use std::sync::Arc;

    fn left_out<T>(path: &str) -> Result<T, String> {
        Err(format!("{path} needs ONNX, which this build leaves out: build with --features onnx"))
    }
    pub fn segmenter(path: &str) -> Result<Arc<dyn Segmenter>, String> {
        left_out(path)
    }
    pub fn param_estimator(path: &str) -> Result<Arc<dyn ParamEstimator>, String> {
        left_out(path)
    }
}
