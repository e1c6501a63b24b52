//! `--llm`: which language model reads instructions, if any.

use acm_actors::settings::Signal;
use acm_llm::{Backend, CallError, Cassette, ChatRequest, FileError, Reply, Script};
use std::{fmt, path::PathBuf, str::FromStr, sync::Arc};

/// A model as `--llm` names it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum LlmId {
    /// None: the rules read instructions.
    #[default]
    Rules,
    /// One that answers by the rules of a file.
    Scripted(PathBuf),
    /// One that answers as was recorded in a cassette.
    Replay(PathBuf),
}

impl fmt::Display for LlmId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LlmId::Rules => f.write_str("rules"),
            LlmId::Scripted(file) => write!(f, "scripted={}", file.display()),
            LlmId::Replay(file) => write!(f, "replay={}", file.display()),
        }
    }
}

impl FromStr for LlmId {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            None if text == "rules" => Ok(LlmId::Rules),
            Some(("scripted", file)) if !file.is_empty() => Ok(LlmId::Scripted(file.into())),
            Some(("replay", file)) if !file.is_empty() => Ok(LlmId::Replay(file.into())),
            _ => Err(format!("`{text}` is no model: rules, scripted=FILE or replay=FILE")),
        }
    }
}

/// A model whose files are read. Each episode has one of its own, with nothing used up.
#[derive(Debug, Clone)]
pub enum Llm {
    /// See [`LlmId::Scripted`].
    Script(Arc<Script>),
    /// See [`LlmId::Replay`].
    Cassette(Arc<Cassette>),
    /// A recorded one up to a signal, then another one; the rules alone if there is none.
    Fork {
        /// What was recorded.
        before: Arc<Cassette>,
        /// The other one.
        after: Option<Box<Llm>>,
        /// From when on.
        from: Signal,
    },
}

impl Llm {
    /// Reads a model's files; `None` where the rules read instructions.
    ///
    /// # Errors
    /// A file cannot be read or is not what it should be.
    pub fn open(id: &LlmId) -> Result<Option<Llm>, FileError> {
        Ok(match id {
            LlmId::Rules => None,
            LlmId::Scripted(file) => Some(Llm::Script(Arc::new(Script::read(file)?))),
            LlmId::Replay(file) => Some(Llm::Cassette(Arc::new(Cassette::read(file)?))),
        })
    }

    /// The model, for one episode.
    pub fn backend(&self) -> Arc<dyn Backend> {
        match self {
            Llm::Script(script) => Arc::new(script.backend()),
            Llm::Cassette(cassette) => Arc::new(cassette.backend()),
            Llm::Fork { before, after, from } => Arc::new(Forked {
                before: Arc::new(before.backend()),
                after: after.as_ref().map(|after| after.backend()),
                from: from.clone(),
            }),
        }
    }
}

struct Forked {
    before: Arc<dyn Backend>,
    after: Option<Arc<dyn Backend>>,
    from: Signal,
}

impl Backend for Forked {
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a> {
        match &self.after {
            _ if !self.from.is_given() => self.before.chat(request),
            Some(after) => after.chat(request),
            None => Box::pin(async {
                Err(CallError::Unreachable { reason: "the fork goes on with the rules alone".into() })
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_named_and_others_are_refused_with_a_list() {
        for text in ["rules", "scripted=a/b.toml", "replay=c=d.jsonl"] {
            assert_eq!(text.parse::<LlmId>().map(|id| id.to_string()), Ok(text.into()));
        }
        for text in ["", "gpt", "scripted", "scripted=", "rules=x"] {
            let error = text.parse::<LlmId>().unwrap_err();
            assert!(error.contains("rules, scripted=FILE or replay=FILE"), "{error}");
        }
    }
}
