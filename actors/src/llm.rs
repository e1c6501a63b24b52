//! The port to a language model: the only place where a request leaves the agent.

use crate::message::{LLM, Message};
use acm_llm::{Answer, Backend, CallError};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
};
use std::{sync::Arc, time::Duration};
use tokio::{runtime::Handle, sync::watch};

/// How long a model has for an answer, wall time.
pub const CALL_LIMIT: Duration = Duration::from_secs(120);

/// Asks the model and answers the one who asked. Like the other port it blocks its worker while it waits; a call ends at
/// once when the run does, and then nobody is answered. The world's clock stands still meanwhile.
pub struct LlmPort {
    backend: Arc<dyn Backend>,
    /// Whether the run is being ended.
    ending: watch::Receiver<bool>,
    limit: Duration,
}

impl LlmPort {
    /// A port to `backend`. The backend outlives the port: after a restart the new one goes on with what it holds.
    pub fn new(backend: Arc<dyn Backend>, ending: watch::Receiver<bool>) -> LlmPort {
        LlmPort { backend, ending, limit: CALL_LIMIT }
    }

    /// With another limit for each call.
    pub fn with_limit(self, limit: Duration) -> LlmPort {
        LlmPort { limit, ..self }
    }
}

impl Core<Message> for LlmPort {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        let Message::AskLlm { request } = &message.body else {
            return Err(CoreError(format!("{LLM} cannot handle {:?}", message.body)));
        };
        let (backend, limit, mut ending) = (Arc::clone(&self.backend), self.limit, self.ending.clone());
        // Dropping the call ends it.
        let call = async {
            tokio::select! {
                biased;
                // Whoever would say so is gone too when the run is.
                _ = ending.wait_for(|ending| *ending) => None,
                answer = tokio::time::timeout(limit, backend.chat(request)) => Some(answer),
            }
        };
        let answer: Answer = match tokio::task::block_in_place(|| Handle::current().block_on(call)) {
            None => return Ok(()),
            Some(Ok(answer)) => answer.into(),
            Some(Err(_elapsed)) => Answer::Error(CallError::Timeout { limit_ms: limit.as_millis() as u64 }),
        };
        outbox.send(message.from, Message::LlmReplied(Box::new(answer)));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::PLANNER;
    use acm_llm::{ChatRequest, Parameters, PromptId, Script, Turn};

    fn replied(delay_ms: u64, limit: Duration, end: bool) -> Vec<Message> {
        let script = Script::parse("s.toml", &format!("[[rule]]\ntext = 'x'\ndelay_ms = {delay_ms}\n")).unwrap();
        let (ending, ended) = watch::channel(end);
        let mut port = LlmPort::new(Arc::new(Arc::new(script).backend()), ended).with_limit(limit);
        let request = Box::new(ChatRequest {
            stage: "s".into(),
            prompt: PromptId { id: "p".into(), version: 1 },
            system: String::new(),
            turns: vec![Turn::user("?")],
            schema: serde_json::json!({}),
            parameters: Parameters { max_output_tokens: 1 },
        });
        let body = Message::AskLlm { request };
        let envelope = Envelope { seq: 1, cause: None, episode: 1, from: PLANNER, to: LLM, time_ns: 0, body };
        let mut out = Outbox::new(0);
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        runtime.block_on(async { port.handle(envelope, &mut out) }).unwrap();
        drop(ending);
        out.into_messages().1.into_iter().map(|(_, message)| message).collect()
    }

    #[test]
    fn a_reply_a_late_one_and_none_at_the_end_of_the_run() {
        let hour = Duration::from_secs(3600);
        assert!(
            matches!(&replied(0, hour, false)[..], [Message::LlmReplied(answer)] if matches!(**answer, Answer::Reply(_)))
        );
        let late = replied(3_000_000, Duration::from_millis(1), false);
        let timeout = Answer::Error(CallError::Timeout { limit_ms: 1 });
        assert!(matches!(&late[..], [Message::LlmReplied(answer)] if **answer == timeout), "{late:?}");
        assert!(replied(3_000_000, hour, true).is_empty());
    }
}
