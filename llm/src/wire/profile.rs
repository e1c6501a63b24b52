//! What a backend can do and how it is asked.

use super::Wire;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeSet;

/// How a server is told the schema of the answer. Whatever it promises, the answer is checked here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Structured {
    /// By the format's own field for a JSON Schema.
    JsonSchema,
    /// As the arguments of a tool that must be called.
    ForcedTool,
    /// In the prompt, with a field that asks for any JSON object.
    JsonObject,
    /// In the prompt alone.
    PromptOnly,
}

/// Parameters of sampling; only those that are set are sent.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sampling {
    /// Temperature.
    pub temperature: Option<f64>,
    /// Mass of the nucleus.
    pub top_p: Option<f64>,
    /// Seed; as good as the server keeps it.
    pub seed: Option<u64>,
}

/// A model behind a wire format.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// The format.
    pub wire: Wire,
    /// The model's name there.
    pub model: String,
    /// How the schema is told.
    pub structured: Structured,
    /// Whether images may be sent.
    pub images: bool,
    /// Whether the reply comes in pieces, so that a server that hangs is noticed before the call's time is up.
    pub stream: bool,
    /// Whether most tokens are `max_completion_tokens`; openai-chat alone.
    pub completion_tokens: bool,
    /// How much the model is to reason, in the format's own words.
    pub reasoning: Option<String>,
    /// Sampling.
    pub sampling: Sampling,
    /// Most tokens that are asked for, whatever the request says.
    pub max_output_tokens: Option<u32>,
    /// Further `options`; ollama alone.
    pub options: Map<String, Value>,
    /// What is put over the body at last.
    pub extra_body: Map<String, Value>,
    /// What the server's refusals have taught.
    pub learned: Learned,
}

impl Profile {
    /// A model that is asked in the plainest way that the format has.
    pub fn new(wire: Wire, model: impl Into<String>) -> Profile {
        Profile {
            wire,
            model: model.into(),
            structured: Structured::JsonSchema,
            images: true,
            stream: false,
            completion_tokens: false,
            reasoning: None,
            sampling: Sampling::default(),
            max_output_tokens: None,
            options: Map::new(),
            extra_body: Map::new(),
            learned: Learned::default(),
        }
    }

    pub(super) fn structured(&self) -> Structured {
        self.learned.structured.unwrap_or(self.structured)
    }
    pub(super) fn most_tokens(&self, asked: u32) -> u32 {
        self.max_output_tokens.map_or(asked, |most| most.min(asked))
    }
    pub(super) fn tokens_field(&self) -> &'static str {
        let other = self.completion_tokens || self.learned.completion_tokens;
        if other { "max_completion_tokens" } else { "max_tokens" }
    }
    /// Parameters beside the prompt that are sent, in words.
    pub(crate) fn effective(&self) -> String {
        let shown = |name: &str, value: Option<String>| value.map(|value| format!("{name} {value}"));
        let Sampling { temperature, top_p, seed } = self.sampling;
        let words = [
            shown("temperature", temperature.map(|value| value.to_string())),
            shown("top_p", top_p.map(|value| value.to_string())),
            shown("seed", seed.filter(|_| self.wire.takes_seed()).map(|value| value.to_string())),
            shown("reasoning", self.reasoning.clone()),
        ];
        let words: Vec<String> = words.into_iter().flatten().filter(|words| !self.learned.knows(words)).collect();
        words.join(", ")
    }
}

/// What a server refused, and is spared from then on.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Learned {
    /// Fields of the body, with dots between their levels.
    stripped: BTreeSet<String>,
    completion_tokens: bool,
    structured: Option<Structured>,
}

/// Fields without which nothing is asked.
const ESSENTIAL: [&str; 7] = ["model", "messages", "input", "contents", "instructions", "system", "systemInstruction"];
/// Fields by which a schema is told.
const SCHEMA_FIELDS: [&str; 10] = [
    "response_format",
    "text",
    "output_config",
    "format",
    "tools",
    "tool_choice",
    "toolConfig",
    "strict",
    "responseJsonSchema",
    "responseMimeType",
];

impl Learned {
    /// What to do about a parameter that was refused: changes this so that the next body is another one, and says how;
    /// `None` where nothing is left to do.
    pub(crate) fn learn(&mut self, profile: &Profile, body: &Value, parameter: &str, words: &str) -> Option<String> {
        let first = parameter.split(['.', '[']).find(|level| *level != "generationConfig").unwrap_or(parameter);
        if ESSENTIAL.contains(&first) {
            return None;
        }
        if profile.wire == Wire::OpenaiChat && matches!(first, "max_tokens" | "max_completion_tokens") {
            let renamed = profile.tokens_field() == "max_tokens" && words.contains("max_completion_tokens");
            self.completion_tokens |= renamed;
            return renamed.then(|| "`max_tokens` is refused: `max_completion_tokens` is sent from now on".into());
        }
        if SCHEMA_FIELDS.contains(&first) {
            if profile.structured() == Structured::PromptOnly {
                return None;
            }
            self.structured = Some(Structured::PromptOnly);
            return Some(format!("`{parameter}` is refused: the schema is told in the prompt alone from now on"));
        }
        let path = present(body, parameter)?;
        let told = format!("`{path}` is refused and left out from now on");
        self.stripped.insert(path).then_some(told)
    }

    pub(super) fn strip(&self, body: &mut Value) {
        for path in &self.stripped {
            let (parent, last) = path.rsplit_once('.').unwrap_or(("", path));
            let pointer = if parent.is_empty() { String::new() } else { format!("/{}", parent.replace('.', "/")) };
            if let Some(Value::Object(fields)) = body.pointer_mut(&pointer) {
                fields.remove(last);
            }
        }
    }

    /// Whether such a parameter is left out; `words` begin with its name.
    fn knows(&self, words: &str) -> bool {
        let name = words.split(' ').next().unwrap_or_default();
        self.stripped.iter().any(|path| path.split('.').any(|level| level.starts_with(name)))
    }
}

/// Where a body has a parameter, which a server may name by its last level alone.
fn present(body: &Value, parameter: &str) -> Option<String> {
    let at = |path: &str| body.pointer(&format!("/{}", path.replace('.', "/"))).is_some();
    let places = [parameter.to_owned(), format!("generationConfig.{parameter}"), format!("options.{parameter}")];
    places.into_iter().find(|path| at(path))
}
