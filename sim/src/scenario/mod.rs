//! Scenario files: one TOML file is parsed into what the simulator builds, what the judge decides, and what the
//! agent is told. The three never mix.

mod meaning;
mod raw;
mod setting;
mod spec;

pub(crate) use raw::{Color, RawPerturb, TextureKind};
pub use setting::Setting;
pub(crate) use spec::{
    CameraSpec, DeedSpec, EventSpec, JudgeSpec, ObjectSpec, PlaceAt, PlaceSpec, PredicateSpec, Reference, RejectRule,
    RejectSpec, SurfaceSpec, TaskTemplate, TextureSpec, WorldSpec,
};
#[cfg(test)]
pub(crate) use spec::{StageSpec, ViolationSpec};

use acm_concept::expression::ExpressionError;
use include_dir::{Dir, include_dir};
use std::path::Path;
use thiserror::Error;

static EMBEDDED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/scenarios");

/// Largest scenario file that is read, bytes.
pub const MAX_SCENARIO_BYTES: usize = 256 * 1024;

/// A parsed and checked scenario. It can be simulated with any seed.
///
/// ```
/// # use acm_sim::Scenario;
/// let scenario = Scenario::open("put-back-block").unwrap();
/// assert!(Scenario::names().contains(&scenario.name().to_string()));
/// assert!(Scenario::open("put-back-blok").unwrap_err().to_string().contains("did you mean `put-back-block`?"));
/// ```
#[derive(Debug, Clone)]
pub struct Scenario {
    pub(crate) name: String,
    pub(crate) summary: String,
    pub(crate) paraphrases: Vec<String>,
    pub(crate) world: WorldSpec,
    pub(crate) judge: JudgeSpec,
    pub(crate) task: TaskTemplate,
}

/// Why a scenario could not be used.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// Neither a file nor an embedded scenario.
    #[error("there is no scenario `{name}`, neither as a file nor by name{suggestion}; known: {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// "; did you mean ...?", or nothing.
        suggestion: String,
        /// The embedded scenarios.
        known: String,
    },
    /// The file cannot be read.
    #[error("scenario file {file} cannot be read: {source}")]
    Read {
        /// The file.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// Not TOML, an unknown field, or a value of the wrong type.
    #[error("scenario file {file}: {reason}")]
    Format {
        /// The file.
        file: String,
        /// What is wrong, with a suggestion where a field's name is near a known one.
        reason: String,
    },
    /// A value that makes no sense.
    #[error("scenario file {file}, {field}: {reason}")]
    Field {
        /// The file.
        file: String,
        /// The field.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An expression that cannot be used.
    #[error("scenario file {file}, {field}: {source}")]
    Expression {
        /// The file.
        file: String,
        /// The field.
        field: String,
        /// What is wrong.
        source: ExpressionError,
    },
    /// An object model that cannot be used.
    #[error("object model {file}: {reason}")]
    Model {
        /// The model's file.
        file: String,
        /// What is wrong.
        reason: String,
    },
}

impl Scenario {
    /// Names of the scenarios that ship with the simulator, sorted; those of suites are not among them.
    pub fn names() -> Vec<String> {
        names_in(&EMBEDDED)
    }

    /// Names of the suites that ship with the simulator: scenarios that belong together, each in a folder of its own.
    pub fn suites() -> Vec<String> {
        let folders = EMBEDDED.dirs().filter_map(|folder| folder.path().to_str());
        folders.filter(|folder| *folder != MODELS).map(str::to_owned).collect()
    }

    /// Names of a suite's scenarios, sorted; none if there is no such suite. They are opened by these names alone.
    pub fn suite(name: &str) -> Vec<String> {
        EMBEDDED.get_dir(name).filter(|_| name != MODELS).map(names_in).unwrap_or_default()
    }

    /// Opens a scenario: a file if there is one of that path, else the embedded scenario of that name.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`] with a suggestion and the list of names, or whatever is wrong with the file.
    pub fn open(name_or_path: &str) -> Result<Scenario, ScenarioError> {
        Scenario::open_with(name_or_path, &[])
    }

    /// As [`Scenario::open`], with some of its fields set otherwise.
    ///
    /// # Errors
    /// As [`Scenario::open`], or a setting that leads nowhere.
    pub fn open_with(name_or_path: &str, settings: &[Setting]) -> Result<Scenario, ScenarioError> {
        let path = Path::new(name_or_path);
        if path.is_file() {
            let read = |source| ScenarioError::Read { file: name_or_path.into(), source };
            let length = std::fs::metadata(path).map_err(read)?.len();
            if length > MAX_SCENARIO_BYTES as u64 {
                return Err(too_large(name_or_path));
            }
            return Scenario::parse_with(name_or_path, &std::fs::read_to_string(path).map_err(read)?, settings);
        }
        let file = format!("{name_or_path}.toml");
        let in_suites = Scenario::suites().into_iter().map(|suite| format!("{suite}/{file}"));
        let mut found = std::iter::once(file.clone()).chain(in_suites).filter_map(|path| EMBEDDED.get_file(path));
        match found.next().and_then(|file| file.contents_utf8()) {
            Some(text) => Scenario::parse_with(&file, text, settings),
            None => Err(unknown(name_or_path)),
        }
    }

    /// Reads a scenario from text; `file` is its name in messages.
    ///
    /// # Errors
    /// What is wrong, with file and field.
    pub fn parse(file: &str, text: &str) -> Result<Scenario, ScenarioError> {
        if text.len() > MAX_SCENARIO_BYTES {
            return Err(too_large(file));
        }
        meaning::parse(file, text)
    }

    fn parse_with(file: &str, text: &str, settings: &[Setting]) -> Result<Scenario, ScenarioError> {
        if settings.is_empty() {
            return Scenario::parse(file, text);
        }
        Scenario::parse(file, &setting::apply(file, text, settings)?)
    }

    /// The JSON Schema of scenario files, every field documented.
    pub fn schema() -> String {
        let schema = schemars::schema_for!(raw::RawScenario);
        // A schema is plain JSON; printing it cannot fail.
        serde_json::to_string_pretty(&schema).unwrap_or_default()
    }

    /// The scenario's name.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// What it is about, one line.
    pub fn summary(&self) -> &str {
        &self.summary
    }
    /// The sensor profile of the first camera.
    pub fn sensor(&self) -> &str {
        self.world.cameras.first().map_or("none", |camera| camera.sensor.as_str())
    }
    /// The first instruction.
    pub fn instruction(&self) -> &str {
        &self.task.instruction
    }
    /// Other wordings of the instruction.
    pub fn paraphrases(&self) -> &[String] {
        &self.paraphrases
    }
}

/// The folder of object models, which is no suite.
const MODELS: &str = "objects";

fn names_in(folder: &Dir<'_>) -> Vec<String> {
    let stem = |path: &Path| Some(path.file_stem()?.to_str()?.to_string());
    let mut names: Vec<String> = folder.files().filter_map(|file| stem(file.path())).collect();
    names.sort();
    names
}

fn too_large(file: &str) -> ScenarioError {
    ScenarioError::Format { file: file.into(), reason: format!("larger than {MAX_SCENARIO_BYTES} bytes") }
}

fn unknown(name: &str) -> ScenarioError {
    let of_suites = Scenario::suites().into_iter().flat_map(|suite| Scenario::suite(&suite));
    let known: Vec<String> = Scenario::names().into_iter().chain(of_suites).collect();
    let suggestion = nearest(name, known.iter().map(String::as_str));
    ScenarioError::Unknown { name: name.into(), suggestion, known: known.join(", ") }
}

/// "; did you mean `x`?" for the nearest known name, or nothing if none is near.
pub(crate) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    match known.map(|candidate| (strsim::damerau_levenshtein(name, candidate), candidate)).min() {
        Some((distance, best)) if distance <= 1 + name.len() / 3 => format!("; did you mean `{best}`?"),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests;
