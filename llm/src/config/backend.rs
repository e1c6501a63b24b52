//! One backend of a configuration file.

use crate::{
    server::{BreakerPolicy, Key, KeyError, Price, RetryPolicy, ServerConfig, TimeLimits},
    wire::{Learned, Profile, Sampling, Structured, Wire},
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::{collections::BTreeMap, time::Duration};
use thiserror::Error;

/// Most bytes of what is put over a body.
const MAX_EXTRA_BYTES: usize = 64 << 10;
/// Headers that hold keys.
const KEY_HEADERS: [&str; 8] = [
    "authorization",
    "proxy-authorization",
    "x-api-key",
    "api-key",
    "x-goog-api-key",
    "cookie",
    "openai-api-key",
    "x-auth-token",
];

/// A model behind a server, as a file names it.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BackendConfig {
    /// The server's wire format.
    pub wire: Wire,
    /// The model's name there.
    pub model: String,
    /// Where it is; the format's own vendor if not given.
    pub base_url: Option<String>,
    /// The variable that holds the key; none if no key is needed.
    pub key_env: Option<String>,
    /// Most tokens of an answer, reasoning included, whatever is asked for.
    pub max_output_tokens: Option<u32>,
    /// How much it is to reason, in the format's own words.
    pub reasoning: Option<String>,
    /// Temperature; sent only if it is set, like the next two.
    pub temperature: Option<f64>,
    /// Mass of the nucleus.
    pub top_p: Option<f64>,
    /// Seed.
    pub seed: Option<u64>,
    /// Whether the reply comes in pieces.
    #[serde(default)]
    pub stream: bool,
    /// Time to connect, milliseconds.
    #[serde(default = "five_seconds")]
    pub connect_timeout_ms: u64,
    /// Longest silence between two pieces of a reply, milliseconds.
    #[serde(default = "half_a_minute")]
    pub idle_timeout_ms: u64,
    /// Headers beside those of the format.
    #[serde(default)]
    pub headers: BTreeMap<String, String>,
    /// Further `options`; ollama alone.
    #[serde(default)]
    pub options: Map<String, Value>,
    /// What is put over the body at last.
    #[serde(default)]
    pub extra_body: Map<String, Value>,
    /// What it can do, where that is not what is assumed of the format.
    #[serde(default)]
    pub caps: Capabilities,
    /// When a failed call is made again.
    #[serde(default)]
    pub retry: RetryConfig,
    /// What it costs.
    pub price: Option<PriceConfig>,
}

fn five_seconds() -> u64 {
    5_000
}
fn half_a_minute() -> u64 {
    30_000
}

/// What a model can do, where that is not what is assumed of its wire format.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Capabilities {
    /// How it is told the schema of the answer.
    pub structured: Option<Structured>,
    /// Whether it takes images.
    pub images: Option<bool>,
    /// Whether it takes temperature, top_p and seed.
    pub sampling: Option<bool>,
}

/// When a failed call is made again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct RetryConfig {
    /// How often is asked at most, the first time included.
    pub attempts: u32,
    /// First wait, milliseconds; each further one is twice as long.
    pub base_ms: u64,
    /// Longest wait of our own choice, milliseconds.
    pub cap_ms: u64,
    /// Longest wait that a server may ask for, milliseconds.
    pub max_retry_after_ms: u64,
}

impl Default for RetryConfig {
    fn default() -> Self {
        RetryConfig { attempts: 3, base_ms: 500, cap_ms: 8_000, max_retry_after_ms: 120_000 }
    }
}

/// US dollars for a million tokens.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PriceConfig {
    /// Of the prompt.
    pub input_per_mtok: f64,
    /// Of the answer, reasoning included.
    pub output_per_mtok: f64,
    /// Of what comes from a cache; as `input_per_mtok` if not given.
    pub cached_input_per_mtok: Option<f64>,
}

/// Why a backend cannot be asked.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum OpenError {
    /// Its key is missing.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// Something else.
    #[error("{0}")]
    Server(String),
}

impl BackendConfig {
    /// Where it is.
    pub fn base_url(&self) -> &str {
        self.base_url.as_deref().unwrap_or(self.wire.home())
    }

    /// Whether it takes temperature, top_p and seed. The models behind `anthropic` refuse them.
    fn takes_sampling(&self) -> bool {
        self.caps.sampling.unwrap_or(self.wire != Wire::Anthropic)
    }

    pub(super) fn check(&self) -> Result<(), String> {
        if self.model.is_empty()
            || self.model.len() > 200
            || self.model.contains(|c: char| c.is_whitespace() || "?#".contains(c))
        {
            return Err("model: it is to be the name of a model, one word".into());
        }
        if self.key_env.as_ref().is_some_and(|name| !is_variable(name)) {
            // Not told: it may be the key itself.
            return Err("key_env: it is to be the name of a variable, such as OPENAI_API_KEY, and never the key".into());
        }
        if let Some(name) = self.headers.keys().find(|name| KEY_HEADERS.contains(&name.to_lowercase().as_str())) {
            return Err(format!("headers.{name}: keys are not in a file: name a variable by `key_env`"));
        }
        let sampling = [
            ("temperature", self.temperature.is_some()),
            ("top_p", self.top_p.is_some()),
            ("seed", self.seed.is_some()),
        ];
        for (name, _) in sampling.into_iter().filter(|(_, set)| *set) {
            if !self.takes_sampling() {
                return Err(format!("{name}: this backend takes no sampling (caps.sampling): leave it out"));
            }
            if name == "seed" && !self.wire.takes_seed() {
                return Err(format!("seed: {} has no such field: leave it out", self.wire));
            }
        }
        let within = |value: Option<f64>, most| value.is_none_or(|value| (0.0..=most).contains(&value));
        if !within(self.temperature, 2.0) {
            return Err("temperature: it is not within 0..2".into());
        }
        if !within(self.top_p, 1.0) {
            return Err("top_p: it is not within 0..1".into());
        }
        if self.max_output_tokens == Some(0) {
            return Err("max_output_tokens: it is 0".into());
        }
        if !self.options.is_empty() && self.wire != Wire::Ollama {
            return Err("options: only ollama has options; see extra_body".into());
        }
        if self.extra_body.contains_key("stream") {
            return Err("extra_body.stream: set `stream` itself".into());
        }
        let size = |map: &Map<String, Value>| serde_json::to_string(map).map_or(usize::MAX, |text| text.len());
        if size(&self.extra_body).max(size(&self.options)) > MAX_EXTRA_BYTES {
            return Err(format!("extra_body: it has more than {MAX_EXTRA_BYTES} bytes"));
        }
        if !(1..=10).contains(&self.retry.attempts) {
            return Err(format!("retry.attempts = {} is not within 1..10", self.retry.attempts));
        }
        let prices = self
            .price
            .into_iter()
            .flat_map(|p| [Some(p.input_per_mtok), Some(p.output_per_mtok), p.cached_input_per_mtok]);
        if prices.flatten().any(|price| !price.is_finite() || price < 0.0) {
            return Err("price: it is no amount of money".into());
        }
        for (name, value) in
            [("connect_timeout_ms", self.connect_timeout_ms), ("idle_timeout_ms", self.idle_timeout_ms)]
        {
            if !(1..=3_600_000).contains(&value) {
                return Err(format!("{name} = {value} is not within 1..3600000"));
            }
        }
        // The address and the headers, without a key.
        crate::Server::new(self.server(None, Duration::from_secs(1), 0)).map(drop).map_err(|reason| {
            if reason.starts_with("`base_url`") { format!("base_url: {reason}") } else { format!("headers: {reason}") }
        })
    }

    /// The server, with its key out of `variables`.
    ///
    /// # Errors
    /// The key is missing, or the machine offers no connections.
    pub fn open(
        &self,
        variables: &dyn Fn(&str) -> Option<String>,
        call: Duration,
        seed: u64,
    ) -> Result<crate::Server, OpenError> {
        let key = self.key_env.as_ref().map(|name| Key::new(name, variables(name))).transpose()?;
        crate::Server::new(self.server(key, call, seed)).map_err(OpenError::Server)
    }

    /// What the model can do and how it is asked.
    pub fn profile(&self) -> Profile {
        let base = self.base_url();
        // Known of these services: elsewhere the plainest that the format has is tried.
        let assumed = if base.contains("dashscope") { Structured::JsonObject } else { Structured::JsonSchema };
        Profile {
            wire: self.wire,
            model: self.model.clone(),
            structured: self.caps.structured.unwrap_or(assumed),
            images: self.caps.images.unwrap_or(true),
            stream: self.stream,
            completion_tokens: self.wire == Wire::OpenaiChat && base.starts_with(Wire::OpenaiChat.home()),
            reasoning: self.reasoning.clone(),
            sampling: Sampling { temperature: self.temperature, top_p: self.top_p, seed: self.seed },
            max_output_tokens: self.max_output_tokens,
            options: self.options.clone(),
            extra_body: self.extra_body.clone(),
            learned: Learned::default(),
        }
    }

    fn server(&self, key: Option<Key>, call: Duration, seed: u64) -> ServerConfig {
        let ms = Duration::from_millis;
        let RetryConfig { attempts, base_ms, cap_ms, max_retry_after_ms } = self.retry;
        ServerConfig {
            base_url: self.base_url().to_owned(),
            key,
            profile: self.profile(),
            headers: self.headers.iter().map(|(name, value)| (name.clone(), value.clone())).collect(),
            limits: TimeLimits { connect: ms(self.connect_timeout_ms), idle: ms(self.idle_timeout_ms), call },
            retry: RetryPolicy {
                attempts,
                base: ms(base_ms),
                cap: ms(cap_ms),
                max_retry_after: ms(max_retry_after_ms),
            },
            breaker: BreakerPolicy::default(),
            price: self.price.map(|price| Price {
                input: price.input_per_mtok,
                output: price.output_per_mtok,
                cached_input: price.cached_input_per_mtok.unwrap_or(price.input_per_mtok),
            }),
            seed,
        }
    }
}

/// Whether a text may be the name of a variable. Keys have small letters and dashes in them.
fn is_variable(name: &str) -> bool {
    let letters = name.bytes().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'_');
    letters && name.len() <= 100 && name.starts_with(|c: char| c.is_ascii_uppercase() || c == '_')
}
