//! What comes of asking a tool.

use acm_concept::{ids::FrameId, object::Blindness};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use thiserror::Error;

/// What a tool answers. It never panics; an answer after the deadline is [`ToolError::TimedOut`].
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome<T> {
    /// All that was asked for.
    Ok(T),
    /// Some of it, and what is missing.
    Partial {
        /// What there is.
        value: T,
        /// What there is not.
        missing: Vec<Gap>,
    },
    /// The tool understood and cannot say: an ordinary answer.
    Abstain(Reason),
    /// The tool did not do its work.
    Failed(ToolError),
}

impl<T> Outcome<T> {
    /// What there is to use.
    pub fn value(&self) -> Option<&T> {
        match self {
            Outcome::Ok(value) | Outcome::Partial { value, .. } => Some(value),
            Outcome::Abstain(_) | Outcome::Failed(_) => None,
        }
    }
    /// The same with another value.
    pub fn map<U>(self, change: impl FnOnce(T) -> U) -> Outcome<U> {
        match self {
            Outcome::Ok(value) => Outcome::Ok(change(value)),
            Outcome::Partial { value, missing } => Outcome::Partial { value: change(value), missing },
            Outcome::Abstain(reason) => Outcome::Abstain(reason),
            Outcome::Failed(error) => Outcome::Failed(error),
        }
    }
    /// `ok`, `partial`, `abstain` or `failed`.
    pub fn word(&self) -> &'static str {
        match self {
            Outcome::Ok(_) => "ok",
            Outcome::Partial { .. } => "partial",
            Outcome::Abstain(_) => "abstain",
            Outcome::Failed(_) => "failed",
        }
    }
    /// What is missing, why the tool abstains, or how it failed; `None` of a whole answer.
    pub fn remark(&self) -> Option<String> {
        match self {
            Outcome::Ok(_) => None,
            Outcome::Partial { missing, .. } => {
                let gaps: Vec<&str> = missing.iter().map(|gap| gap.0.as_str()).collect();
                Some(format!("without {}", gaps.join(", ")))
            }
            Outcome::Abstain(reason) => Some(reason.to_string()),
            Outcome::Failed(error) => Some(error.to_string()),
        }
    }
}

/// Something that a partial answer lacks, in a few words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gap(pub String);

/// Why a tool abstains.
#[derive(Debug, Clone, PartialEq, Eq, Error, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// The frame shows nothing.
    #[error("the frame shows nothing: {0:?}")]
    Blind(Blindness),
    /// The frame is sound, and what was asked for is not in it.
    #[error("nothing of the kind was found")]
    NothingFound,
    /// The tool's own words.
    #[error("{0}")]
    Said(String),
}

/// How a tool failed.
#[derive(Debug, Clone, PartialEq, Eq, Error, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ToolError {
    /// No answer within the time it had.
    #[error("no answer within {limit_ms} ms")]
    TimedOut {
        /// The time it had, milliseconds.
        limit_ms: u64,
    },
    /// The tool could not be asked.
    #[error("cannot be reached: {reason}")]
    Unreachable {
        /// What went wrong.
        reason: String,
    },
    /// The tool said that it failed.
    #[error("said it failed: {reason}")]
    Said {
        /// Its words.
        reason: String,
    },
    /// The answer cannot be read or makes no sense.
    #[error("gave no sound answer: {field} {reason}")]
    Invalid {
        /// The field of the answer.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The request itself cannot be answered: a mask without pixels, a template that does not exist.
    #[error("cannot be asked this: {field} {reason}")]
    BadRequest {
        /// The field of the request.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
}

impl ToolError {
    /// An answer that makes no sense.
    pub fn invalid(field: impl Into<String>, reason: impl Into<String>) -> ToolError {
        ToolError::Invalid { field: field.into(), reason: reason.into() }
    }
    /// A request that cannot be answered.
    pub fn bad_request(field: impl Into<String>, reason: impl Into<String>) -> ToolError {
        ToolError::BadRequest { field: field.into(), reason: reason.into() }
    }
}

/// Which tool it is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Its name: `geometric`, or an address.
    pub tool: String,
    /// Its version, in its own words.
    pub version: String,
    /// Digest (BLAKE3 or SHA-256, as the tool chooses) of the weights that it answers from, where there are any.
    pub model_digest: Option<[u8; 32]>,
}

/// Where an answer comes from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ToolMeta {
    /// The tool.
    #[serde(flatten)]
    pub identity: Identity,
    /// Number of the request.
    pub request: u64,
    /// The frame that it was asked about.
    pub frame: FrameId,
    /// How long it took, by the stopwatch of the one who asked.
    pub latency: Duration,
}

/// An outcome and where it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer<T> {
    /// Where it comes from.
    pub meta: ToolMeta,
    /// What it is.
    pub outcome: Outcome<T>,
}
