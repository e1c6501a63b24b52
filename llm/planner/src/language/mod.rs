//! From an instruction to a [`Task`].

mod error;

pub use error::ParseError;

use crate::{lexicon::Lexicon, task::Task};
use acm_concept::template::TemplateLibrary;

pub(crate) fn parse(_lexicon: &Lexicon, _library: &TemplateLibrary, text: &str) -> Result<Task, ParseError> {
    Err(ParseError::Unsupported {
        text: text.into(),
        span: crate::task::Span { start: 0, end: text.len() },
        reason: "the front end is not part of this version".into(),
    })
}
