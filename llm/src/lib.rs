//! Chat with language models: neutral requests and replies, answers that are checked here, and backends.
//!
//! It knows no robotics. A request has no place for keys: whoever needs one takes it elsewhere, so
//! that what is written down of a request never holds one.
//!
//! | module | holds |
//! |---|---|
//! | [`chat`] | a request, a reply, and what can go wrong with a call |
//! | [`dialogue`] | a question with its answer's JSON Schema: validation, and a bounded number of repairs |
//! | [`backend`] | the trait behind which every model stands |
//! | [`script`] | a backend that answers by the rules of a file |
//! | [`cassette`] | a backend that answers as was recorded |
//! | [`server`] | a backend behind an HTTP server: retries, limits, keys |
//! | [`route`] | several backends as one: a chain for each stage, within a budget |
//! | [`config`] | backends as a configuration file names them |
//! | [`wire`] | the formats of such servers, as pure functions |
//!
//! ```
//! # use acm_llm::{Backend, ChatRequest, Dialogue, Next, Script};
//! let script = std::sync::Arc::new(Script::parse("s.toml", "[[rule]]\nlast = ['ping']\njson = { word = 'pong' }\n")?);
//! let request = ChatRequest {
//!     stage: "greet".into(),
//!     prompt: acm_llm::PromptId { id: "greet".into(), version: 1 },
//!     system: "Answer in one word.".into(),
//!     turns: vec![acm_llm::Turn::user("ping")],
//!     schema: serde_json::json!({ "type": "object", "required": ["word"] }),
//!     parameters: acm_llm::Parameters { max_output_tokens: 20 },
//! };
//! let mut dialogue = Dialogue::new(request, 2)?;
//! # let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
//! let answer = runtime.block_on(script.backend().chat(dialogue.request())).into();
//! let word = dialogue.take(&answer, |json| json["word"].as_str().map(str::to_owned).ok_or_else(Vec::new));
//! assert_eq!(word, Next::Accepted("pong".to_owned()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod backend;
pub mod cassette;
pub mod chat;
pub mod config;
pub mod dialogue;
mod error;
mod file;
pub mod route;
pub mod script;
pub mod server;
pub mod wire;

pub use backend::{Backend, Reply};
pub use cassette::Cassette;
pub use chat::{
    Answer, CallError, ChatReply, ChatRequest, EndReason, Image, Parameters, Part, PromptId, Speaker, Turn, Usage,
};
pub use config::LlmConfig;
pub use dialogue::{Dialogue, Fault, Next, SchemaError};
pub use file::FileError;
pub use route::Route;
pub use script::Script;
pub use server::{Server, ServerConfig};
