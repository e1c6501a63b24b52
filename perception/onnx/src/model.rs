//! A file and the runtime that computes it.

use crate::tensors::Tensor;
use acm_perception::tools::{Identity, ToolError};
use ort::{environment::Environment, session::Session, value::TensorRef};
use std::{
    path::{Path, PathBuf},
    sync::{Mutex, OnceLock, PoisonError},
};
use thiserror::Error;

/// Where ONNX Runtime is looked for.
const LIBRARY: &str = "ORT_DYLIB_PATH";
/// Largest model file that is opened, bytes.
const MAX_MODEL_BYTES: u64 = 4 << 30;

/// Why a model could not be opened.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum OpenError {
    /// Nobody said where the runtime is.
    #[error(
        "ORT_DYLIB_PATH is not set: give it the path of libonnxruntime.so, such as the one in the onnxruntime wheel"
    )]
    NoLibrary,
    /// What is there is no runtime, or too old a one.
    #[error("ORT_DYLIB_PATH: {reason}")]
    Library {
        /// What is wrong.
        reason: String,
    },
    /// The file cannot be read as a model.
    #[error("the model {} cannot be opened: {reason}", path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The model has other inputs or outputs than the tool needs.
    #[error("the model {} {reason}", path.display())]
    Interface {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// A model with its input and its outputs by name.
pub(crate) struct Model {
    session: Mutex<Session>,
    input: &'static str,
    outputs: &'static [&'static str],
    identity: Identity,
    template: Option<String>,
}

fn one_line(error: impl std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

impl Model {
    pub fn open(path: &Path, input: &'static str, outputs: &'static [&'static str]) -> Result<Model, OpenError> {
        let refused = |reason: String| OpenError::Model { path: path.into(), reason };
        let bytes = std::fs::metadata(path).map_err(|error| refused(error.to_string()))?.len();
        if bytes > MAX_MODEL_BYTES {
            return Err(refused(format!("it is longer than {MAX_MODEL_BYTES} bytes")));
        }
        let file = std::fs::read(path).map_err(|error| refused(error.to_string()))?;
        let session = Session::builder(runtime()?).and_then(|mut builder| builder.commit_from_memory(&file));
        let session = session.map_err(|error| refused(one_line(error)))?;
        let inputs: Vec<&str> = session.inputs().iter().map(|outlet| outlet.name()).collect();
        let given: Vec<&str> = session.outputs().iter().map(|outlet| outlet.name()).collect();
        let lacks = |reason: String| OpenError::Interface { path: path.into(), reason };
        if inputs != [input] {
            return Err(lacks(format!("takes {inputs:?}, not [\"{input}\"]")));
        }
        if let Some(output) = outputs.iter().find(|output| !given.contains(output)) {
            return Err(lacks(format!("gives {given:?}, without `{output}`")));
        }
        let template = session.metadata().ok().and_then(|metadata| metadata.custom("template"));
        let version = session.metadata().ok().and_then(|metadata| metadata.version());
        let identity = Identity {
            tool: path.file_name().map_or_else(|| "onnx".into(), |name| format!("onnx {}", name.to_string_lossy())),
            version: version.map_or_else(|| "unknown".into(), |version| version.to_string()),
            model_digest: Some(*blake3::hash(&file).as_bytes()),
        };
        Ok(Model { session: Mutex::new(session), input, outputs, identity, template })
    }

    pub fn identity(&self) -> Identity {
        self.identity.clone()
    }
    /// The template that the model says it is for.
    pub fn template(&self) -> Option<&str> {
        self.template.as_deref()
    }

    /// Computes the outputs, in the order in which they were named.
    pub fn run(&self, input: &Tensor) -> Result<Vec<Tensor>, ToolError> {
        let failed = |error: ort::Error| ToolError::Said { reason: one_line(error) };
        let given = TensorRef::from_array_view((input.shape.clone(), input.values.as_slice())).map_err(failed)?;
        // A call that panicked left no half-made state: a session is only read.
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        let outputs = session.run(ort::inputs![self.input => given]).map_err(failed)?;
        let read = |name: &&'static str| {
            let value = outputs.get(*name).ok_or_else(|| ToolError::invalid(*name, "is missing"))?;
            let (shape, values) = value.try_extract_tensor::<f32>().map_err(failed)?;
            let shape = shape.iter().map(|size| usize::try_from(*size).unwrap_or(0)).collect();
            Ok(Tensor { shape, values: values.to_vec() })
        };
        self.outputs.iter().map(read).collect()
    }
}

/// The runtime of this process. Its library is opened the first time; without doing so here the first call into it would
/// end the process where the library is missing.
fn runtime() -> Result<&'static Environment, OpenError> {
    static RUNTIME: OnceLock<Environment> = OnceLock::new();
    if let Some(runtime) = RUNTIME.get() {
        return Ok(runtime);
    }
    let path = std::env::var_os(LIBRARY).filter(|path| !path.is_empty()).ok_or(OpenError::NoLibrary)?;
    let broken = |reason: String| OpenError::Library { reason };
    let builder = ort::init_from(PathBuf::from(path)).map_err(|error| broken(one_line(error)))?;
    let runtime = builder.build().map_err(|error| broken(one_line(error)))?;
    Ok(RUNTIME.get_or_init(|| runtime))
}
