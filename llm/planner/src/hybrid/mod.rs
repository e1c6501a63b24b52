//! An instruction read by a language model: what it is asked, and a task out of its answer.
//!
//! The text is data in `prompts/`, with a version. The answer's schema keeps to what all providers take: an object in
//! which everything is required, unions with null alone, no references. Nouns, functions and colours that the library
//! and the lexicon have are put in as enumerations, so that a decoder which heeds the schema cannot name another thing.
//! Whoever gets an answer checks it against the schema; `ground` checks the rest.

mod form;
mod ground;

pub use form::TaskForm;

use crate::{
    language::{MAX_BYTES, ParseError},
    lexicon::Lexicon,
    prompt_file::{self, PromptFile},
    task::Task,
};
use acm_concept::template::TemplateLibrary;
use serde_json::Value;
use std::collections::BTreeSet;

const TEXT: &str = include_str!("../../prompts/parse.toml");
const SCHEMA: &str = include_str!("../../prompts/parse.schema.json");

/// What a model is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct TaskPrompt {
    /// Name of the text.
    pub id: String,
    /// Its version.
    pub version: u32,
    /// What the model is told first.
    pub system: String,
    /// The question.
    pub user: String,
    /// JSON Schema of the answer.
    pub schema: Value,
    /// Most tokens of the answer.
    pub max_output_tokens: u32,
}

fn file() -> Option<&'static (PromptFile, Value)> {
    static PARSE: prompt_file::Cell = prompt_file::Cell::new();
    prompt_file::read(&PARSE, TEXT, SCHEMA)
}

/// The question for an instruction.
pub(crate) fn prompt(lexicon: &Lexicon, library: &TemplateLibrary, text: &str) -> Result<TaskPrompt, ParseError> {
    if text.len() > MAX_BYTES {
        return Err(ParseError::TooLong { unit: "bytes", length: text.len(), limit: MAX_BYTES });
    }
    let (false, Some((file, schema))) = (text.trim().is_empty(), file()) else { return Err(ParseError::Empty) };
    let names = Names::new(lexicon, library);
    let nouns: Vec<String> = names.nouns.iter().map(|noun| noun_line(library, noun)).collect();
    Ok(TaskPrompt {
        id: file.id.clone(),
        version: file.version,
        system: file.system.replace("{nouns}", &nouns.join("\n")),
        user: file.user.replace("{instruction}", text).trim_end().to_owned(),
        schema: names.filled(schema.clone()),
        max_output_tokens: file.max_output_tokens,
    })
}

/// The task of an answer.
pub(crate) fn understand(
    lexicon: &Lexicon,
    library: &TemplateLibrary,
    text: &str,
    answer: &Value,
) -> Result<Task, Vec<String>> {
    let form: TaskForm = serde_json::from_value(answer.clone()).map_err(|error| vec![error.to_string()])?;
    ground::Grounding::new(lexicon, library, text).task(form)
}

/// "cube: pick, place".
fn noun_line(library: &TemplateLibrary, noun: &str) -> String {
    let functions: BTreeSet<&str> =
        library.with_noun(noun).flat_map(|template| template.functions.iter().map(|f| f.name.as_str())).collect();
    let functions: Vec<&str> = functions.into_iter().collect();
    format!("- {noun}: {}", if functions.is_empty() { "none".into() } else { functions.join(", ") })
}

/// The names that an answer may use, each list in order.
struct Names<'a> {
    nouns: Vec<&'a str>,
    functions: Vec<&'a str>,
    affordances: Vec<&'a str>,
    colors: Vec<&'a str>,
    shades: Vec<&'a str>,
}

impl<'a> Names<'a> {
    fn new(lexicon: &'a Lexicon, library: &'a TemplateLibrary) -> Names<'a> {
        let ordered = |names: BTreeSet<&'a str>| names.into_iter().collect();
        Names {
            nouns: ordered(library.iter().flat_map(|t| t.synopsis.nouns.iter().map(|n| n.noun.as_str())).collect()),
            functions: ordered(library.iter().flat_map(|t| t.functions.iter().map(|f| f.name.as_str())).collect()),
            affordances: ordered(library.iter().flat_map(|template| template.affordances()).collect()),
            colors: ordered(lexicon.colors().map(|term| term.name.as_str()).collect()),
            shades: ordered(lexicon.shade_words().map(|(word, _)| word).collect()),
        }
    }

    /// A schema with the names in place of `{nouns}` and its like.
    fn filled(&self, schema: Value) -> Value {
        match schema {
            Value::Array(items) => Value::Array(items.into_iter().flat_map(|item| self.filled_item(item)).collect()),
            Value::Object(fields) => {
                Value::Object(fields.into_iter().map(|(name, value)| (name, self.filled(value))).collect())
            }
            plain => plain,
        }
    }

    fn filled_item(&self, item: Value) -> Vec<Value> {
        let names = match item.as_str() {
            Some("{nouns}") => &self.nouns,
            Some("{functions}") => &self.functions,
            Some("{affordances}") => &self.affordances,
            Some("{colors}") => &self.colors,
            Some("{shades}") => &self.shades,
            _ => return vec![self.filled(item)],
        };
        names.iter().map(|name| Value::from(*name)).collect()
    }
}

#[cfg(test)]
mod tests;
