//! Why a call gave no reply.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why a call gave no reply. Whatever is said here is written down: it names no key.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, Error)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CallError {
    /// Nobody answers there.
    #[error("the model cannot be reached: {reason}")]
    Unreachable {
        /// Why not.
        reason: String,
    },
    /// It has too much to do.
    #[error("the model is overloaded")]
    Overloaded,
    /// It was asked too often.
    #[error("the model was asked too often{}", .retry_after_ms.map_or_else(String::new, |ms| format!("; it can be asked again after {ms} ms")))]
    RateLimited {
        /// When it may be asked again, milliseconds.
        #[serde(default)]
        retry_after_ms: Option<u64>,
    },
    /// It took too long.
    #[error("the model gave no answer within {limit_ms} ms")]
    Timeout {
        /// How long it had, milliseconds.
        limit_ms: u64,
    },
    /// Its server stopped sending.
    #[error("the model's server has sent nothing for {idle_ms} ms")]
    Stalled {
        /// How long it may be silent, milliseconds.
        idle_ms: u64,
    },
    /// The reply has no end, or a piece of it is damaged.
    #[error("the model's reply broke off: {reason}")]
    BrokenOff {
        /// Where.
        reason: String,
    },
    /// What came is no reply of this wire format, or is too long.
    #[error("what came is no reply: {reason}")]
    Unreadable {
        /// Why not.
        reason: String,
    },
    /// Its server failed.
    #[error("the model's server failed with status {status}: {reason}")]
    Server {
        /// HTTP status.
        status: u16,
        /// The server's own words.
        reason: String,
    },
    /// The key is not accepted.
    #[error("the model's server refuses whoever asks: {reason}")]
    Auth {
        /// The server's own words.
        reason: String,
    },
    /// The key has nothing left to spend.
    #[error("the quota is used up: {reason}")]
    Quota {
        /// The server's own words.
        reason: String,
    },
    /// The server does not take the request.
    #[error("the model's server refuses the request with status {status}{}: {reason}", .parameter.as_ref().map_or_else(String::new, |name| format!(" for `{name}`")))]
    BadRequest {
        /// HTTP status.
        status: u16,
        /// The parameter that it names.
        #[serde(default)]
        parameter: Option<String>,
        /// The server's own words.
        reason: String,
    },
    /// The prompt is longer than the model can read.
    #[error("the prompt is too long for the model: {reason}")]
    ContextTooLong {
        /// The server's own words.
        reason: String,
    },
    /// The backend cannot take such a request, and nobody was asked.
    #[error("nobody was asked: {reason}")]
    Unable {
        /// What it cannot take.
        reason: String,
    },
    /// The backend failed too often, and is left alone for a while.
    #[error("nobody was asked: the last {failures} calls failed, and the next one is made in {again_in_ms} ms")]
    Resting {
        /// Calls in a row that failed.
        failures: u32,
        /// When it is asked again, milliseconds from now.
        again_in_ms: u64,
    },
    /// What may be spent is spent.
    #[error("nobody was asked: {reason}")]
    Budget {
        /// Which budget, and its limit.
        reason: String,
    },
    /// No rule of a script fits.
    #[error("no rule of {script} fits the request (stage `{stage}`, last words \"{last}\")")]
    NoRule {
        /// The script.
        script: String,
        /// The request's stage.
        stage: String,
        /// The end of the last turn.
        last: String,
    },
    /// A recorded model was asked something else.
    #[error("{cassette} holds no such request: {difference}")]
    ReplayMiss {
        /// The recording.
        cassette: String,
        /// In what the nearest recorded request differs.
        difference: String,
    },
}
