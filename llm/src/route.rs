//! Several backends as one: a chain for each stage, within what an episode may spend.

use crate::{
    backend::{Backend, Reply},
    chat::{CallError, ChatReply, ChatRequest},
    config::Limits,
};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

/// Backends in the order in which they are asked, each with its name.
pub type Chain = Vec<(String, Arc<dyn Backend>)>;

/// The backends of an episode. Where one gives no reply the next one of the stage's chain is asked, and the reply says so.
pub struct Route {
    chains: BTreeMap<String, Chain>,
    limits: Limits,
    spent: Mutex<Spent>,
}

/// What was spent so far.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Spent {
    /// Calls.
    pub calls: u32,
    /// Tokens of prompts and answers.
    pub tokens: u64,
    /// US dollars, as far as prices are known.
    pub usd: f64,
}

impl Route {
    /// A chain for each stage, with nothing spent.
    pub fn new(chains: BTreeMap<String, Chain>, limits: Limits) -> Route {
        Route { chains, limits, spent: Mutex::default() }
    }

    /// What was spent so far.
    pub fn spent(&self) -> Spent {
        *self.spent.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn ask(&self, request: &ChatRequest) -> Result<ChatReply, CallError> {
        let mut notes = Vec::new();
        let mut failed = CallError::Unable { reason: format!("no backend is set for the stage `{}`", request.stage) };
        for (name, backend) in self.chains.get(&request.stage).into_iter().flatten() {
            self.draw()?;
            match backend.chat(request).await {
                Ok(mut reply) => {
                    self.pay(&reply);
                    reply.notes.splice(0..0, notes);
                    return Ok(reply);
                }
                Err(error) => {
                    notes.push(format!("`{name}` gave no reply: {error}"));
                    failed = error;
                }
            }
        }
        Err(failed)
    }

    /// Takes one call out of the budget.
    fn draw(&self) -> Result<(), CallError> {
        let mut spent = self.spent.lock().unwrap_or_else(PoisonError::into_inner);
        let Limits { max_calls_per_episode, max_tokens_per_episode, max_usd_per_episode, .. } = self.limits;
        let over = |what: String| Err(CallError::Budget { reason: format!("the episode's budget is spent: {what}") });
        if spent.calls >= max_calls_per_episode {
            return over(format!("{} of {max_calls_per_episode} calls", spent.calls));
        }
        if spent.tokens >= max_tokens_per_episode {
            return over(format!("{} of {max_tokens_per_episode} tokens", spent.tokens));
        }
        if let Some(most) = max_usd_per_episode.filter(|most| spent.usd >= *most) {
            return over(format!("{:.4} of {most} US dollars", spent.usd));
        }
        spent.calls += 1;
        Ok(())
    }

    fn pay(&self, reply: &ChatReply) {
        let mut spent = self.spent.lock().unwrap_or_else(PoisonError::into_inner);
        spent.tokens = spent.tokens.saturating_add(reply.usage.input).saturating_add(reply.usage.output);
        spent.usd += reply.cost_usd.unwrap_or(0.0);
    }
}

impl Backend for Route {
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a> {
        Box::pin(async move {
            let limit = self.limits.call();
            let late = |_elapsed| Err(CallError::Timeout { limit_ms: limit.as_millis() as u64 });
            tokio::time::timeout(limit, self.ask(request)).await.unwrap_or_else(late)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Script, chat::tests::request};

    fn scripted(name: &str, rules: &str) -> (String, Arc<dyn Backend>) {
        (name.into(), Arc::new(Arc::new(Script::parse("s.toml", rules).unwrap()).backend()))
    }

    fn asked(route: &Route, stage: &str) -> Result<ChatReply, CallError> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        runtime.block_on(route.chat(&ChatRequest { stage: stage.into(), ..request("x") }))
    }

    #[test]
    fn the_next_one_answers_where_one_fails_and_says_so() {
        let busy = scripted("far", "[[rule]]\nonce = true\nerror = { kind = 'overloaded' }\n[[rule]]\ntext = 'far'\n");
        let near = scripted("near", "[[rule]]\ntext = 'near'\n");
        let chains = [("parse".to_owned(), vec![busy, near])].into();
        let route = Route::new(chains, Limits { max_calls_per_episode: 3, ..Limits::default() });
        let reply = asked(&route, "parse").unwrap();
        assert_eq!((reply.text.as_str(), reply.notes.len()), ("near", 1));
        assert!(reply.notes[0].contains("`far` gave no reply: the model is overloaded"), "{:?}", reply.notes);
        assert_eq!(asked(&route, "parse").unwrap().text, "far");
        assert!(matches!(asked(&route, "parse"), Err(CallError::Budget { reason }) if reason.contains("3 of 3 calls")));
        assert!(matches!(asked(&route, "select"), Err(CallError::Unable { .. })));
    }

    #[test]
    fn tokens_and_time_are_limited() {
        let rule = "[[rule]]\ntext = 'x'\nusage = { input = 70, output = 30 }\n";
        let route = |rules: &str, limits| Route::new([("parse".to_owned(), vec![scripted("a", rules)])].into(), limits);
        let tokens = route(rule, Limits { max_tokens_per_episode: 100, ..Limits::default() });
        assert!(asked(&tokens, "parse").is_ok());
        assert_eq!(tokens.spent().tokens, 100);
        assert!(matches!(asked(&tokens, "parse"), Err(CallError::Budget { .. })));
        let slow = route("[[rule]]\ntext = 'x'\ndelay_ms = 60000\n", Limits { call_ms: 5, ..Limits::default() });
        assert_eq!(asked(&slow, "parse"), Err(CallError::Timeout { limit_ms: 5 }));
    }
}
