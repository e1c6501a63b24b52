//! `[llm]` of a configuration file: backends by name, one for each stage, what they may spend.
//!
//! What a file says is checked before anybody is asked. Keys are never in it: a backend names the variable that holds its
//! key.

mod backend;
#[cfg(test)]
mod tests;

pub use backend::{BackendConfig, Capabilities, PriceConfig, RetryConfig};

use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, time::Duration};

/// The name of what answers without a model.
pub const RULES: &str = "rules";
/// In `[llm.stages]`, the backend of `default`.
pub const DEFAULT: &str = "default";
/// Longest time of a call that may be set, milliseconds.
pub const MAX_CALL_MS: u64 = 110_000;
/// Most backends of a file, and of a chain.
const MAX_BACKENDS: usize = 100;

/// Language models, as a file names them.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct LlmConfig {
    /// Which backend is asked, by its name; `rules` is none. `--llm` goes before it.
    pub default: Option<String>,
    /// Backends that are asked in turn where the one before gave no reply. After the last one the rules decide.
    pub fallback: Vec<String>,
    /// The backend of each stage: its name, `default`, or `rules`.
    pub stages: BTreeMap<String, String>,
    /// What an episode may spend.
    pub limits: Limits,
    /// Backends by name.
    pub backend: BTreeMap<String, BackendConfig>,
}

/// What an episode may spend on models. When one of them is spent nobody is asked any more, and the rules decide.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Most calls of an episode, of all backends together.
    pub max_calls_per_episode: u32,
    /// Most tokens of an episode, those of prompts and answers together.
    pub max_tokens_per_episode: u64,
    /// Most US dollars of an episode; needs the price of every backend that is asked.
    pub max_usd_per_episode: Option<f64>,
    /// Longest call, fallbacks and all tries included, milliseconds of wall time.
    pub call_ms: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            max_calls_per_episode: 60,
            max_tokens_per_episode: 400_000,
            max_usd_per_episode: None,
            call_ms: 90_000,
        }
    }
}

impl Limits {
    /// The longest call.
    pub fn call(&self) -> Duration {
        Duration::from_millis(self.call_ms)
    }
}

impl LlmConfig {
    /// Finds what is wrong with it, given the names of the stages.
    ///
    /// # Errors
    /// The first mistake, with the field's path below `[llm]`.
    pub fn check(&self, stages: &[&str]) -> Result<(), String> {
        if self.backend.len() > MAX_BACKENDS || self.fallback.len() > MAX_BACKENDS {
            return Err(format!("backend: there are more than {MAX_BACKENDS}"));
        }
        let limits = self.limits;
        if !(1..=MAX_CALL_MS).contains(&limits.call_ms) {
            return Err(format!("limits.call_ms = {} is not within 1..{MAX_CALL_MS}", limits.call_ms));
        }
        if limits.max_usd_per_episode.is_some_and(|usd| !usd.is_finite() || usd < 0.0) {
            return Err("limits.max_usd_per_episode is no amount of money".into());
        }
        for (id, backend) in &self.backend {
            if id.is_empty() || id == RULES || id == DEFAULT || id.contains('=') {
                return Err(format!("backend.{id}: `{id}` names something else: choose another name"));
            }
            backend.check().map_err(|reason| format!("backend.{id}.{reason}"))?;
        }
        let known = |field: String, id: &str, also: &[&str]| {
            (also.contains(&id) || self.backend.contains_key(id)).then_some(()).ok_or_else(|| {
                let names: Vec<&str> = also.iter().copied().chain(self.backend.keys().map(String::as_str)).collect();
                format!("{field}: there is no backend `{id}`{}", suggestion(id, &names))
            })
        };
        if let Some(id) = &self.default {
            known("default".into(), id, &[RULES])?;
        }
        for id in &self.fallback {
            known("fallback".into(), id, &[RULES])?;
        }
        if self.fallback.iter().rev().skip(1).any(|id| id == RULES) {
            return Err(format!("fallback: `{RULES}` never fails, so nothing comes after it"));
        }
        for (stage, id) in &self.stages {
            if !stages.contains(&stage.as_str()) {
                return Err(format!("stages.{stage}: there is no such stage{}", suggestion(stage, stages)));
            }
            known(format!("stages.{stage}"), id, &[RULES, DEFAULT])?;
        }
        let asked = self.default.iter().chain(&self.fallback).chain(self.stages.values());
        let unpriced = asked.filter_map(|id| Some((id, self.backend.get(id)?))).find(|(_, b)| b.price.is_none());
        match (limits.max_usd_per_episode, unpriced) {
            (Some(_), Some((id, _))) => {
                Err(format!("limits.max_usd_per_episode: the price of `{id}` is not known: set backend.{id}.price"))
            }
            _ => Ok(()),
        }
    }
}

/// "; did you mean `x`?", or the names that there are.
pub fn suggestion(name: &str, names: &[&str]) -> String {
    let near = names.iter().map(|other| (strsim::damerau_levenshtein(name, other), *other)).min();
    match near {
        Some((distance, other)) if distance <= 1 + name.len() / 3 => format!("; did you mean `{other}`?"),
        _ if names.is_empty() => String::new(),
        _ => format!(": there are {}", names.join(", ")),
    }
}
