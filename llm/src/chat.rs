//! A request and its reply, in a form that is no provider's own.

pub use crate::error::CallError;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::{fmt, sync::Arc};

/// One question to a model. All of it is written down wherever a request is: it has no place for keys, and addresses
/// are no part of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChatRequest {
    /// What it is asked for, such as `parse`.
    pub stage: String,
    /// The text from which it was made.
    pub prompt: PromptId,
    /// What the model is told before everything else.
    pub system: String,
    /// What was said, in order; the last turn is the user's.
    pub turns: Vec<Turn>,
    /// JSON Schema of the answer.
    pub schema: Value,
    /// Parameters that take effect.
    pub parameters: Parameters,
}

impl ChatRequest {
    /// The request as bytes that are equal for equal requests, whatever the order of a schema's fields.
    ///
    /// # Errors
    /// The schema has a part that is no JSON.
    pub fn canonical(&self) -> Result<Vec<u8>, serde_json::Error> {
        serde_json::to_vec(&sorted(serde_json::to_value(self)?))
    }

    /// The BLAKE3 hash of [`ChatRequest::canonical`], in hexadecimal digits.
    ///
    /// # Errors
    /// As there.
    pub fn key(&self) -> Result<String, serde_json::Error> {
        Ok(blake3::hash(&self.canonical()?).to_hex().to_string())
    }
}

/// The fields of all objects in the order of their names.
fn sorted(value: Value) -> Value {
    match value {
        Value::Object(fields) => {
            let mut fields: Vec<(String, Value)> =
                fields.into_iter().map(|(name, value)| (name, sorted(value))).collect();
            fields.sort_by(|a, b| a.0.cmp(&b.0));
            Value::Object(fields.into_iter().collect())
        }
        Value::Array(items) => Value::Array(items.into_iter().map(sorted).collect()),
        plain => plain,
    }
}

/// Which text a request was made from. Whoever changes the text gives it another version.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PromptId {
    /// Name.
    pub id: String,
    /// Version, from 1.
    pub version: u32,
}

impl fmt::Display for PromptId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} v{}", self.id, self.version)
    }
}

/// Who speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Speaker {
    /// Who asks.
    User,
    /// The model.
    Assistant,
}

/// What one of the two said.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// Who.
    pub who: Speaker,
    /// Texts and images in order.
    pub parts: Vec<Part>,
}

impl Turn {
    /// A text from who asks.
    pub fn user(text: impl Into<String>) -> Turn {
        Turn { who: Speaker::User, parts: vec![Part::Text(text.into())] }
    }
    /// A text from the model.
    pub fn assistant(text: impl Into<String>) -> Turn {
        Turn { who: Speaker::Assistant, parts: vec![Part::Text(text.into())] }
    }
    /// Its texts, one after the other.
    pub fn text(&self) -> String {
        let texts = self.parts.iter().filter_map(|part| match part {
            Part::Text(text) => Some(text.as_str()),
            Part::Image(_) => None,
        });
        texts.collect::<Vec<_>>().join("\n")
    }
}

/// A piece of a turn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// Words.
    Text(String),
    /// A picture.
    Image(Image),
}

/// A picture in a request. It is written down by its hash: whoever reads a request back has no pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// Such as `image/png`.
    pub media_type: String,
    /// BLAKE3 hash of the encoded picture, hexadecimal.
    pub blake3: String,
    /// The encoded picture; empty in a request that was read back.
    #[serde(skip)]
    pub bytes: Arc<[u8]>,
}

impl Image {
    /// A picture of this type.
    pub fn new(media_type: impl Into<String>, bytes: impl Into<Arc<[u8]>>) -> Image {
        let bytes = bytes.into();
        Image { media_type: media_type.into(), blake3: blake3::hash(&bytes).to_hex().to_string(), bytes }
    }
}

/// Parameters of a call as they take effect. What a model does not take is not here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Most tokens that the model may answer with, reasoning included.
    pub max_output_tokens: u32,
}

/// What a model answered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChatReply {
    /// The answer, which shall be JSON of the request's schema. Nobody has checked that yet.
    pub text: String,
    /// What the model says that it thought, where it says so.
    pub reasoning: Option<String>,
    /// What it cost.
    pub usage: Usage,
    /// Why it ended.
    pub end: EndReason,
    /// The kind of backend that answered.
    pub backend: String,
    /// The model that answered.
    pub model: String,
    /// What it cost in US dollars, where the prices are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost_usd: Option<f64>,
    /// What must be known of how it came about: parameters that were sent, refused or left out, and how often was asked.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

impl ChatReply {
    /// A complete answer of a backend that costs nothing.
    pub fn new(text: impl Into<String>, backend: impl Into<String>, model: impl Into<String>) -> ChatReply {
        ChatReply {
            text: text.into(),
            reasoning: None,
            usage: Usage::default(),
            end: EndReason::Complete,
            backend: backend.into(),
            model: model.into(),
            cost_usd: None,
            notes: Vec::new(),
        }
    }
}

/// Tokens of a call.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Usage {
    /// Of the whole prompt, those from a cache included.
    pub input: u64,
    /// Of all that the model wrote, its reasoning included.
    pub output: u64,
    /// Of its reasoning.
    pub reasoning: u64,
    /// Of the prompt, those that came from a cache.
    pub cached: u64,
}

impl std::ops::AddAssign for Usage {
    fn add_assign(&mut self, other: Usage) {
        self.input = self.input.saturating_add(other.input);
        self.output = self.output.saturating_add(other.output);
        self.reasoning = self.reasoning.saturating_add(other.reasoning);
        self.cached = self.cached.saturating_add(other.cached);
    }
}

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} tokens in", self.input)?;
        if self.cached > 0 {
            write!(f, " ({} cached)", self.cached)?;
        }
        write!(f, ", {} out", self.output)?;
        if self.reasoning > 0 {
            write!(f, " ({} reasoning)", self.reasoning)?;
        }
        Ok(())
    }
}

/// Why a model stopped writing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndReason {
    /// It had said all.
    #[default]
    Complete,
    /// It had used up its tokens.
    MaxTokens,
    /// It declined to answer.
    Refused,
}

/// What a call came to, as it is written down.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    /// A reply.
    Reply(ChatReply),
    /// None, and why.
    Error(CallError),
}

impl From<Result<ChatReply, CallError>> for Answer {
    fn from(result: Result<ChatReply, CallError>) -> Answer {
        result.map_or_else(Answer::Error, Answer::Reply)
    }
}

impl From<Answer> for Result<ChatReply, CallError> {
    fn from(answer: Answer) -> Self {
        match answer {
            Answer::Reply(reply) => Ok(reply),
            Answer::Error(error) => Err(error),
        }
    }
}

/// A text on one line, its middle left out where it is long.
pub(crate) fn shortened(text: &str, most: usize) -> String {
    let words: Vec<char> = text.split_whitespace().collect::<Vec<_>>().join(" ").chars().collect();
    if words.len() <= most {
        return words.into_iter().collect();
    }
    let half = most / 2;
    let part = |range: std::ops::Range<usize>| words.get(range).unwrap_or_default().iter().collect::<String>();
    format!("{} ... {}", part(0..half), part(words.len() - half..words.len()))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn request(words: &str) -> ChatRequest {
        ChatRequest {
            stage: "parse".into(),
            prompt: PromptId { id: "parse".into(), version: 1 },
            system: "You read instructions.".into(),
            turns: vec![Turn::user(words)],
            schema: serde_json::json!({
                "type": "object", "additionalProperties": false, "required": ["count"],
                "properties": { "count": { "type": "integer", "minimum": 1 } }
            }),
            parameters: Parameters { max_output_tokens: 100 },
        }
    }

    pub(crate) fn reply(text: &str) -> ChatReply {
        let usage = Usage { input: 7, output: 3, ..Usage::default() };
        ChatReply { usage, ..ChatReply::new(text, "test", "none") }
    }

    #[test]
    fn the_key_knows_every_word_and_no_order_of_fields() {
        let one = request("one");
        assert_eq!(one.key().unwrap(), one.clone().key().unwrap());
        assert_ne!(one.key().unwrap(), request("two").key().unwrap());
        let (mut a, mut b) = (one.clone(), one);
        a.schema = serde_json::from_str(r#"{"type": "object", "title": "x"}"#).unwrap();
        b.schema = serde_json::from_str(r#"{"title": "x", "type": "object"}"#).unwrap();
        assert_eq!(a.key().unwrap(), b.key().unwrap());
        a.parameters.max_output_tokens += 1;
        assert_ne!(a.key().unwrap(), b.key().unwrap());
    }

    #[test]
    fn a_picture_is_written_down_by_its_hash() {
        let image = Image::new("image/png", vec![1, 2, 3]);
        let mut asked = request("what is this?");
        asked.turns.push(Turn { who: Speaker::User, parts: vec![Part::Image(image.clone())] });
        let read: ChatRequest = serde_json::from_slice(&asked.canonical().unwrap()).unwrap();
        assert_eq!(read.key().unwrap(), asked.key().unwrap());
        assert!(String::from_utf8(asked.canonical().unwrap()).unwrap().contains(&image.blake3));
        assert!(matches!(&read.turns[1].parts[0], Part::Image(read) if read.bytes.is_empty()));
    }

    #[test]
    fn long_texts_keep_both_ends() {
        assert_eq!(shortened("a\n b", 10), "a b");
        assert_eq!(shortened(&format!("begin {} end", "x".repeat(90)), 8), "begi ...  end");
    }
}
