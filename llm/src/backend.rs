//! The trait behind which every model stands.

use crate::chat::{CallError, ChatReply, ChatRequest};
use std::{future::Future, pin::Pin};

/// A reply on its way. Dropping it ends the call.
pub type Reply<'a> = Pin<Box<dyn Future<Output = Result<ChatReply, CallError>> + Send + 'a>>;

/// A model that can be asked. It may keep state, such as which of its answers are used up.
pub trait Backend: Send + Sync {
    /// Asks once. Nothing is asked again here: what to do about an error is for the caller to say.
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a>;
}
