//! The files of `prompts/`: what a language model is asked, with the schema of its answer. They ship inside the binary.

use serde::Deserialize;
use serde_json::Value;
use std::sync::OnceLock;

/// What a model is asked.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PromptFile {
    /// Name of the prompt.
    pub id: String,
    /// Its version.
    pub version: u32,
    /// Most tokens of the answer.
    pub max_output_tokens: u32,
    /// What the model is told first.
    pub system: String,
    /// The question, with places to be filled.
    pub user: String,
}

/// A prompt with the schema of its answer, read once.
pub(crate) type Cell = OnceLock<Option<(PromptFile, Value)>>;

/// Reads both texts; tests see to it that those that ship are well formed.
pub(crate) fn read(cell: &'static Cell, text: &str, schema: &str) -> Option<&'static (PromptFile, Value)> {
    cell.get_or_init(|| Some((toml::from_str(text).ok()?, serde_json::from_str(schema).ok()?))).as_ref()
}
