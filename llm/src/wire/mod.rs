//! Wire formats: a neutral request as the body that a server takes, and what it sends back as a neutral reply.
//!
//! Everything here is pure, so that it can be compared with the formats' own types and with recorded replies. Each format
//! is a module with two functions, `request` and `reply`; streamed replies are put together to whole ones first.

mod anthropic;
mod failure;
mod gemini;
mod ollama;
mod openai_chat;
mod openai_responses;
mod profile;
mod stream;
#[cfg(test)]
mod tests;

pub use profile::{Learned, Profile, Sampling, Structured};

pub(crate) use failure::{failure, retry_after_ms};
pub(crate) use stream::Watch;

use crate::chat::{CallError, ChatRequest, EndReason, Image, Part, Turn, Usage};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::{collections::BTreeMap, fmt};

/// A wire format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wire {
    /// `POST {base}/chat/completions`, which most servers speak.
    OpenaiChat,
    /// `POST {base}/responses`.
    OpenaiResponses,
    /// `POST {base}/v1/messages`.
    Anthropic,
    /// `POST {base}/v1beta/models/{model}:generateContent`.
    Gemini,
    /// `POST {base}/api/chat`.
    Ollama,
}

impl Wire {
    /// All of them.
    pub const ALL: [Wire; 5] = [Wire::OpenaiChat, Wire::OpenaiResponses, Wire::Anthropic, Wire::Gemini, Wire::Ollama];

    /// As it is written in a file.
    pub fn name(self) -> &'static str {
        match self {
            Wire::OpenaiChat => "openai-chat",
            Wire::OpenaiResponses => "openai-responses",
            Wire::Anthropic => "anthropic",
            Wire::Gemini => "gemini",
            Wire::Ollama => "ollama",
        }
    }
    /// Where its own vendor serves it; a model of one's own for the last one.
    pub fn home(self) -> &'static str {
        match self {
            Wire::OpenaiChat | Wire::OpenaiResponses => "https://api.openai.com/v1",
            Wire::Anthropic => "https://api.anthropic.com",
            Wire::Gemini => "https://generativelanguage.googleapis.com",
            Wire::Ollama => "http://127.0.0.1:11434",
        }
    }
    /// The header that takes the key, and what stands before it there.
    pub(crate) fn key_header(self) -> (&'static str, &'static str) {
        match self {
            Wire::OpenaiChat | Wire::OpenaiResponses | Wire::Ollama => ("authorization", "Bearer "),
            Wire::Anthropic => ("x-api-key", ""),
            Wire::Gemini => ("x-goog-api-key", ""),
        }
    }
    /// Whether it has a field for a seed.
    pub(crate) fn takes_seed(self) -> bool {
        matches!(self, Wire::OpenaiChat | Wire::Gemini | Wire::Ollama)
    }
}

impl fmt::Display for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A request as it goes out, but for the key.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WireRequest {
    /// What follows the base address.
    pub path: String,
    /// Headers beside those of HTTP itself.
    pub headers: Vec<(&'static str, String)>,
    /// The body.
    pub body: Value,
}

/// Headers of a reply by their names in lower case.
pub type Headers = BTreeMap<String, String>;

/// What a server said, in neutral terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// The answer.
    pub text: String,
    /// What the model says that it thought.
    pub reasoning: Option<String>,
    /// Tokens.
    pub usage: Usage,
    /// Why it ended.
    pub end: EndReason,
    /// The model, as the server names it.
    pub model: Option<String>,
}

/// The body for a request.
///
/// # Errors
/// [`CallError::Unable`]: the profile takes no images, or an image has no pixels.
pub fn request(asked: &ChatRequest, profile: &Profile) -> Result<WireRequest, CallError> {
    check_images(asked, profile)?;
    let mut made = match profile.wire {
        Wire::OpenaiChat => openai_chat::request(asked, profile),
        Wire::OpenaiResponses => openai_responses::request(asked, profile),
        Wire::Anthropic => anthropic::request(asked, profile),
        Wire::Gemini => gemini::request(asked, profile),
        Wire::Ollama => ollama::request(asked, profile),
    };
    merge(&mut made.body, &Value::Object(profile.extra_body.clone()));
    profile.learned.strip(&mut made.body);
    Ok(made)
}

/// What a server sent, status 200 or not.
///
/// # Errors
/// The server's failure, or that this is no reply.
pub fn reply(profile: &Profile, status: u16, headers: &Headers, body: &[u8]) -> Result<Said, CallError> {
    if !(200..300).contains(&status) {
        return Err(failure(status, headers, body));
    }
    let value = if profile.stream { stream::assemble(profile.wire, body)? } else { whole(body)? };
    let mut said = match profile.wire {
        Wire::OpenaiChat => openai_chat::reply(&value),
        Wire::OpenaiResponses => openai_responses::reply(&value),
        Wire::Anthropic => anthropic::reply(&value),
        Wire::Gemini => gemini::reply(&value),
        Wire::Ollama => ollama::reply(&value),
    }?;
    if matches!(profile.structured(), Structured::JsonObject | Structured::PromptOnly) {
        said.text = unfenced(&said.text).to_owned();
    }
    Ok(said)
}

/// What stands within a fence, where that is all that was said: who is asked in words alone likes to answer so.
fn unfenced(text: &str) -> &str {
    let within = || {
        let (_language, rest) = text.trim().strip_prefix("```")?.split_once('\n')?;
        let inside = rest.strip_suffix("```")?;
        (!inside.contains("```")).then_some(inside.trim())
    };
    within().unwrap_or(text)
}

fn whole(body: &[u8]) -> Result<Value, CallError> {
    serde_json::from_slice(body).map_err(|error| unreadable(format!("its body is no JSON: {error}")))
}

fn check_images(asked: &ChatRequest, profile: &Profile) -> Result<(), CallError> {
    let unable = |reason: &str| Err(CallError::Unable { reason: reason.into() });
    let parts = asked.turns.iter().flat_map(|turn| &turn.parts);
    for image in parts.filter_map(|part| if let Part::Image(image) = part { Some(image) } else { None }) {
        if !profile.images {
            return unable("the backend takes no images (`caps.images`)");
        }
        if image.bytes.is_empty() {
            return unable("an image has no pixels: the request was read back from a recording");
        }
    }
    Ok(())
}

/// Puts `more` over `body`, field by field within objects.
fn merge(body: &mut Value, more: &Value) {
    match (body, more) {
        (Value::Object(body), Value::Object(more)) => {
            for (name, value) in more {
                merge(body.entry(name.clone()).or_insert(Value::Null), value);
            }
        }
        (body, more) => *body = more.clone(),
    }
}

fn unreadable(reason: impl Into<String>) -> CallError {
    CallError::Unreadable { reason: reason.into() }
}

/// The parts of a turn, each as `text` or `image` makes it.
fn parts(turn: &Turn, text: impl Fn(&str) -> Value, image: impl Fn(&Image) -> Value) -> Value {
    let made = turn.parts.iter().map(|part| match part {
        Part::Text(words) => text(words),
        Part::Image(picture) => image(picture),
    });
    Value::Array(made.collect())
}

fn data_url(image: &Image) -> String {
    format!("data:{};base64,{}", image.media_type, base64(image))
}

fn base64(image: &Image) -> String {
    use base64::Engine as _;
    base64::engine::general_purpose::STANDARD.encode(&image.bytes)
}

/// The name of the answer's form: the stage, in the letters that all servers take.
fn form_name(asked: &ChatRequest) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = asked.stage.chars().map(letter).take(64).collect();
    if name.is_empty() { "answer".into() } else { name }
}

/// What the model is told first; with the schema in words where no field of the body has it.
fn system(asked: &ChatRequest, profile: &Profile) -> String {
    match profile.structured() {
        Structured::JsonSchema | Structured::ForcedTool => asked.system.clone(),
        Structured::JsonObject | Structured::PromptOnly => {
            format!("{}\n\nAnswer with one JSON object of this JSON Schema:\n{}", asked.system.trim_end(), asked.schema)
        }
    }
}

/// Adds the fields that are not null.
fn put(body: &mut Value, fields: impl IntoIterator<Item = (&'static str, Value)>) {
    if let Value::Object(body) = body {
        body.extend(fields.into_iter().filter(|(_, value)| !value.is_null()).map(|(name, value)| (name.into(), value)));
    }
}

fn text_at<'a>(value: &'a Value, pointer: &str) -> Option<&'a str> {
    value.pointer(pointer)?.as_str()
}

fn number_at(value: &Value, pointer: &str) -> u64 {
    value.pointer(pointer).and_then(Value::as_u64).unwrap_or(0)
}

fn list_at<'a>(value: &'a Value, pointer: &str) -> impl Iterator<Item = &'a Value> {
    value.pointer(pointer).and_then(Value::as_array).into_iter().flatten()
}

/// Texts one after the other; `None` where there is nothing in them.
fn joined<'a>(texts: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let joined: String = texts.into_iter().collect();
    (!joined.is_empty()).then_some(joined)
}

fn object(fields: impl IntoIterator<Item = (&'static str, Value)>) -> Value {
    let mut value = Value::Object(Map::new());
    put(&mut value, fields);
    value
}

/// A tool whose arguments are the answer, in the form that two of the formats share.
fn tool_words(asked: &ChatRequest) -> Value {
    json!({ "name": form_name(asked), "description": "Gives the answer." })
}
