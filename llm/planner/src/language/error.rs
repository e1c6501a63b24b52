//! Why an instruction could not be read.

use crate::task::Span;
use thiserror::Error;

/// Why an instruction could not be read. Nothing is guessed: the span names the first words without a reading.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ParseError {
    /// There is nothing to do in it.
    #[error("the instruction is empty: say what shall be done")]
    Empty,
    /// Longer than what is read.
    #[error("the instruction has {length} {unit}, at most {limit} are read")]
    TooLong {
        /// What is counted.
        unit: &'static str,
        /// How many it has.
        length: usize,
        /// How many are allowed.
        limit: usize,
    },
    /// A thing that no template of the library is called.
    #[error("I do not know what `{text}` (characters {}-{}) is; I know: {known}", .span.start, .span.end)]
    UnknownNoun {
        /// The words.
        text: String,
        /// Where they stand.
        span: Span,
        /// Nouns of the library, with a suggestion where one is spelt nearly so.
        known: String,
    },
    /// Words that fit no rule.
    #[error("I cannot read `{text}` (characters {}-{}): {reason}", .span.start, .span.end)]
    Unreadable {
        /// The words.
        text: String,
        /// Where they stand.
        span: Span,
        /// What was expected there.
        reason: String,
    },
    /// Words that are read but ask for what cannot be done.
    #[error("I cannot do `{text}` (characters {}-{}): {reason}", .span.start, .span.end)]
    Unsupported {
        /// The words.
        text: String,
        /// Where they stand.
        span: Span,
        /// Why not.
        reason: String,
    },
    /// A pronoun or "the other one" without anything before it that it could mean.
    #[error("I do not know what `{text}` (characters {}-{}) refers to: nothing named before it fits", .span.start, .span.end)]
    NoAntecedent {
        /// The words.
        text: String,
        /// Where they stand.
        span: Span,
    },
}

impl ParseError {
    /// Where in the instruction the trouble is; `None` where it is the whole.
    pub fn span(&self) -> Option<Span> {
        match self {
            ParseError::Empty | ParseError::TooLong { .. } => None,
            ParseError::UnknownNoun { span, .. }
            | ParseError::Unreadable { span, .. }
            | ParseError::Unsupported { span, .. }
            | ParseError::NoAntecedent { span, .. } => Some(*span),
        }
    }
}
