//! Shells that run cores on ractor: one order of messages, write-ahead journal, supervision and restart.

mod shell;
mod supervisor;

use crate::{
    core::Core,
    envelope::{Envelope, OUTSIDE, Payload, Role},
    journal::Journal,
};
use ractor::ActorRef;
use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use thiserror::Error;
use tokio::sync::mpsc;

/// Makes an actor's core, first at the start and again after a failure. What must survive a restart lives
/// outside the core, in what the closure holds.
pub type Factory<M> = Box<dyn Fn() -> Box<dyn Core<M>> + Send + Sync>;

/// Makes the message by which one actor is told that another has failed and was restarted (or not).
pub type FailureNotice<M> = Box<dyn Fn(Failure) -> M + Send + Sync>;

/// A failed actor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Which actor.
    pub role: Role,
    /// What it died of.
    pub reason: String,
    /// Whether a new one has taken its place.
    pub restarted: bool,
}

/// A fault for tests: the actor panics when it is about to handle its nth message (from 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PanicAt {
    /// Which actor.
    pub role: Role,
    /// Which of its messages, counted over restarts.
    pub message: u64,
}

/// Why a system could not be started or ended without a result.
#[derive(Debug, Error)]
pub enum SystemError {
    /// An actor did not start.
    #[error("actor {role} did not start: {reason}")]
    Start {
        /// Which actor.
        role: Role,
        /// Why not.
        reason: String,
    },
    /// Nothing more will come: the actors ended without sending a result outside.
    #[error("the actors ended without a result; the last failure: {0}")]
    Ended(String),
    /// No result within the time limit.
    #[error("no result within {0:?}: an actor hangs or the world stands still")]
    Timeout(Duration),
}

/// How a system is put together.
pub struct SystemBuilder<M> {
    episode: u32,
    factories: BTreeMap<Role, Factory<M>>,
    journal: Arc<dyn Journal<M>>,
    notice: Option<(Role, FailureNotice<M>)>,
    max_restarts: u32,
    panic_at: Option<PanicAt>,
    time_ns: u64,
}

impl<M: Payload> SystemBuilder<M> {
    /// A system without actors whose messages go to `journal`.
    pub fn new(episode: u32, journal: Arc<dyn Journal<M>>) -> SystemBuilder<M> {
        SystemBuilder {
            episode,
            factories: BTreeMap::new(),
            journal,
            notice: None,
            max_restarts: 3,
            panic_at: None,
            time_ns: 0,
        }
    }
    /// Adds an actor.
    pub fn actor(mut self, role: Role, factory: Factory<M>) -> Self {
        self.factories.insert(role, factory);
        self
    }
    /// Tells `to` about failures.
    pub fn notify(mut self, to: Role, notice: FailureNotice<M>) -> Self {
        self.notice = Some((to, notice));
        self
    }
    /// How often each actor is restarted before it stays down.
    pub fn max_restarts(mut self, max_restarts: u32) -> Self {
        self.max_restarts = max_restarts;
        self
    }
    /// The virtual time at the start, nanoseconds: a world may be older than the system that joins it.
    pub fn starts_at(mut self, time_ns: u64) -> Self {
        self.time_ns = time_ns;
        self
    }
    /// Sets a fault for tests.
    pub fn panic_at(mut self, panic_at: Option<PanicAt>) -> Self {
        self.panic_at = panic_at;
        self
    }

    /// Starts all actors. Must be called within a tokio runtime of at least two worker threads, since ports block.
    pub async fn start(self) -> Result<System<M>, SystemError> {
        let (outside, results) = mpsc::channel(16);
        let shared = Arc::new(Shared {
            episode: self.episode,
            sequence: AtomicU64::new(0),
            latest_ns: AtomicU64::new(self.time_ns),
            addresses: Mutex::new(BTreeMap::new()),
            journal: self.journal,
            outside,
            handled: Mutex::new(BTreeMap::new()),
            spent: Mutex::new(BTreeMap::new()),
            panic_at: self.panic_at,
            last_failure: OnceLock::new(),
        });
        let supervisor =
            supervisor::Supervisor::start(Arc::clone(&shared), self.factories, self.notice, self.max_restarts).await?;
        Ok(System { shared, supervisor, results })
    }
}

/// A running system.
pub struct System<M: Payload> {
    shared: Arc<Shared<M>>,
    supervisor: ActorRef<supervisor::Never>,
    results: mpsc::Receiver<M>,
}

impl<M: Payload> System<M> {
    /// Sends a message from outside, at the latest virtual time that a message had.
    pub fn send(&self, to: Role, body: M) {
        self.shared.deliver(OUTSIDE, to, None, self.shared.latest_ns(), body);
    }
    /// Waits for the next message that an actor sends outside.
    pub async fn result(&mut self, limit: Duration) -> Result<M, SystemError> {
        let ended = || self.shared.last_failure.get().cloned().unwrap_or_else(|| "none was reported".into());
        match tokio::time::timeout(limit, self.results.recv()).await {
            Ok(Some(message)) => Ok(message),
            Ok(None) => Err(SystemError::Ended(ended())),
            Err(_elapsed) => Err(SystemError::Timeout(limit)),
        }
    }
    /// Stops all actors and waits until they are gone; tells how long each role's handlers ran.
    pub async fn stop(self) -> BTreeMap<Role, Duration> {
        let stopped = self.supervisor.stop_and_wait(None, Some(Duration::from_secs(5))).await;
        if let Err(error) = stopped {
            tracing::warn!(%error, "the supervisor did not stop in time");
        }
        self.shared.spent.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// What all shells of a system share.
struct Shared<M> {
    episode: u32,
    sequence: AtomicU64,
    /// The latest virtual time of a message: who has no clock of his own sends at this time.
    latest_ns: AtomicU64,
    addresses: Mutex<BTreeMap<Role, ActorRef<Envelope<M>>>>,
    journal: Arc<dyn Journal<M>>,
    outside: mpsc::Sender<M>,
    /// Messages handled by each role over all its restarts, for [`PanicAt`].
    handled: Mutex<BTreeMap<Role, u64>>,
    spent: Mutex<BTreeMap<Role, Duration>>,
    panic_at: Option<PanicAt>,
    last_failure: OnceLock<String>,
}

impl<M: Payload> Shared<M> {
    fn latest_ns(&self) -> u64 {
        self.latest_ns.load(Ordering::SeqCst)
    }
    /// Numbers a message and puts it into the receiver's mailbox. With one request in flight the order of
    /// numbers is the order of handling.
    fn deliver(&self, from: Role, to: Role, cause: Option<u64>, time_ns: u64, body: M) {
        let seq = self.sequence.fetch_add(1, Ordering::SeqCst) + 1;
        self.latest_ns.fetch_max(time_ns, Ordering::SeqCst);
        let envelope = Envelope { seq, cause, episode: self.episode, from, to, time_ns, body };
        if to == OUTSIDE {
            if let Err(error) = self.journal.record(&envelope) {
                tracing::error!(%error, "a result was not written down");
            }
            if self.outside.try_send(envelope.body).is_err() {
                tracing::warn!("nobody takes results any more");
            }
            return;
        }
        let address = self.addresses.lock().unwrap_or_else(PoisonError::into_inner).get(&to).cloned();
        match address {
            Some(address) => {
                if address.cast(envelope).is_err() {
                    tracing::warn!(%to, "message to an actor that has ended");
                }
            }
            None => tracing::error!(%to, "message to an actor that does not exist"),
        }
    }
}

#[cfg(test)]
mod tests;
