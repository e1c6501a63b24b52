//! A model behind an HTTP server: one call with its retries, its time limit, and what refusals have taught.

mod breaker;
mod key;
mod retry;
#[cfg(test)]
mod tests;
mod transport;

pub use breaker::BreakerPolicy;
pub use key::{Key, KeyError};
pub use retry::RetryPolicy;

use crate::{
    backend::{Backend, Reply},
    chat::{CallError, ChatReply, ChatRequest, Usage},
    wire::{self, Learned, Profile, Said},
};
use breaker::Breaker;
use std::{
    fmt,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use transport::{Stopwatch, Transport};

/// Most refusals of one call that are learned from.
const MAX_LEARNED: usize = 4;

/// Where a model is and how it is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct ServerConfig {
    /// What stands before the path of the wire format.
    pub base_url: String,
    /// The key, if one is needed.
    pub key: Option<Key>,
    /// The model and what it can do.
    pub profile: Profile,
    /// Headers beside those of the wire format.
    pub headers: Vec<(String, String)>,
    /// Time limits.
    pub limits: TimeLimits,
    /// When to ask again.
    pub retry: RetryPolicy,
    /// When to leave it alone.
    pub breaker: BreakerPolicy,
    /// What it costs, where that is known.
    pub price: Option<Price>,
    /// Seed of the waits' jitter.
    pub seed: u64,
}

impl ServerConfig {
    /// A server asked in the plainest way.
    pub fn new(base_url: impl Into<String>, profile: Profile) -> ServerConfig {
        ServerConfig {
            base_url: base_url.into(),
            key: None,
            profile,
            headers: Vec::new(),
            limits: TimeLimits::default(),
            retry: RetryPolicy::default(),
            breaker: BreakerPolicy::default(),
            price: None,
            seed: 0,
        }
    }
}

/// Time limits of a call, wall time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeLimits {
    /// To connect.
    pub connect: Duration,
    /// Between two pieces of a reply; with a streamed one also until its first piece.
    pub idle: Duration,
    /// The whole call, with all that is asked again and all waits.
    pub call: Duration,
}

impl Default for TimeLimits {
    fn default() -> Self {
        let [connect, idle, call] = [5, 30, 90].map(Duration::from_secs);
        TimeLimits { connect, idle, call }
    }
}

/// What tokens cost, US dollars for a million.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Price {
    /// Of the prompt, but for those from a cache.
    pub input: f64,
    /// Of the prompt, those from a cache.
    pub cached_input: f64,
    /// Of the answer, reasoning included.
    pub output: f64,
}

impl Price {
    /// What such a call costs, US dollars.
    ///
    /// ```
    /// # use acm_llm::{Usage, server::Price};
    /// let price = Price { input: 2.0, cached_input: 0.5, output: 10.0 };
    /// let usage = Usage { input: 1_000_000, cached: 400_000, output: 100_000, reasoning: 50_000 };
    /// assert!((price.of(usage) - (1.2 + 0.2 + 1.0)).abs() < 1e-12);
    /// ```
    pub fn of(&self, usage: Usage) -> f64 {
        let millions = |tokens: u64| tokens as f64 / 1e6;
        millions(usage.input.saturating_sub(usage.cached)) * self.input
            + millions(usage.cached) * self.cached_input
            + millions(usage.output) * self.output
    }
}

/// A model behind an HTTP server. What its refusals teach and how often it failed is kept for as long as it lives.
pub struct Server {
    config: ServerConfig,
    transport: Transport,
    learned: Mutex<Learned>,
    breaker: Mutex<Breaker>,
    /// Since when times are counted.
    clock: Stopwatch,
    calls: AtomicU64,
}

impl Server {
    /// Nobody is asked yet.
    ///
    /// # Errors
    /// The address is none, a header is none, or the machine offers no TLS.
    pub fn new(config: ServerConfig) -> Result<Server, String> {
        let transport = Transport::new(&config)?;
        let breaker = Mutex::new(Breaker::new(config.breaker));
        Ok(Server {
            config,
            transport,
            learned: Mutex::default(),
            breaker,
            clock: Stopwatch::start(),
            calls: AtomicU64::new(0),
        })
    }

    /// What it can do, as far as its refusals have taught.
    pub fn profile(&self) -> Profile {
        let learned = self.learned.lock().unwrap_or_else(PoisonError::into_inner).clone();
        Profile { learned, ..self.config.profile.clone() }
    }

    async fn call(&self, request: &ChatRequest) -> Result<ChatReply, CallError> {
        self.breaker().admit(self.clock.elapsed())?;
        let limit = self.config.limits.call;
        let asking = self.ask(request, Stopwatch::start());
        let result = match tokio::time::timeout(limit, asking).await {
            Ok(result) => result,
            Err(_elapsed) => Err(CallError::Timeout { limit_ms: limit.as_millis() as u64 }),
        };
        self.breaker().note(self.clock.elapsed(), result.as_ref().err());
        result
    }

    /// Asks until there is an answer or nothing is gained by asking again.
    async fn ask(&self, request: &ChatRequest, began: Stopwatch) -> Result<ChatReply, CallError> {
        let call = self.calls.fetch_add(1, Ordering::Relaxed);
        let (mut notes, mut learned, mut attempt) = (Vec::new(), 0, 0);
        loop {
            let profile = self.profile();
            let made = wire::request(request, &profile)?;
            let failed = match self.transport.exchange(&profile, &made).await {
                Ok(said) => return Ok(self.replied(said, &profile, notes)),
                Err(failed) => failed,
            };
            if learned < MAX_LEARNED
                && let Some(told) = self.learn(&profile, &made.body, &failed.error)
            {
                notes.push(told);
                learned += 1;
                continue;
            }
            attempt += 1;
            let left = self.config.limits.call.saturating_sub(began.elapsed());
            let jitter = retry::jitter(self.config.seed, call, attempt);
            let Some(wait) = self.config.retry.wait(&failed, attempt, left, jitter) else { return Err(failed.error) };
            notes.push(format!("asked again: {}", failed.error));
            tokio::time::sleep(wait).await;
        }
    }

    fn learn(&self, profile: &Profile, body: &serde_json::Value, error: &CallError) -> Option<String> {
        let CallError::BadRequest { parameter: Some(parameter), reason, .. } = error else { return None };
        let mut learned = self.learned.lock().unwrap_or_else(PoisonError::into_inner);
        learned.learn(profile, body, parameter, reason)
    }

    fn replied(&self, said: Said, profile: &Profile, mut notes: Vec<String>) -> ChatReply {
        let effective = profile.effective();
        if !effective.is_empty() {
            notes.push(format!("sent with {effective}"));
        }
        ChatReply {
            text: said.text,
            reasoning: said.reasoning,
            usage: said.usage,
            end: said.end,
            backend: profile.wire.name().into(),
            model: said.model.unwrap_or_else(|| profile.model.clone()),
            cost_usd: self.config.price.map(|price| price.of(said.usage)),
            notes,
        }
    }

    fn breaker(&self) -> std::sync::MutexGuard<'_, Breaker> {
        self.breaker.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Server {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Profile { wire, model, .. } = &self.config.profile;
        write!(f, "Server({wire} {model} at {})", self.config.base_url)
    }
}

impl Backend for Server {
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a> {
        Box::pin(self.call(request))
    }
}
