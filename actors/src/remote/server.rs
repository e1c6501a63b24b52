//! The host's end: answers one agent at a time for whatever stands behind the three traits.
//!
//! Blocking threads and plain sockets: a host answers one question at a time and has nothing to do in between.

mod session;

use super::{
    FrameMode,
    address::{Address, Listener, Stream},
    protocol::{Answer, Ask, Carrier, HostVerdict, VERSION},
    wire::{Wire, WireError},
};
use acm_concept::{
    camera::CameraSource,
    embodiment::{Clock, Embodiment},
    task::TaskSpec,
};
use serde_json::Value;
use session::{Session, carrier};
use std::{
    collections::BTreeMap,
    io,
    sync::{
        Arc, Condvar, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};
use thiserror::Error;

/// Longest silence of an agent that thinks, or whose host is gone without a word.
const IDLE_LIMIT: Duration = Duration::from_secs(900);
/// Longest time for one message, once it has begun.
const MESSAGE_LIMIT: Duration = Duration::from_secs(10);
/// How long a new agent waits for the one before it to be gone: a killed one is noticed within moments.
const TURN_LIMIT: Duration = Duration::from_secs(2);
/// Connections at one time: the agent's, and those that are being told to come back later.
const MAX_CONNECTIONS: usize = 8;

/// Judges an episode from the agent's report and the world.
pub type Judge = Box<dyn FnMut(&Value) -> Option<HostVerdict> + Send>;

/// What is hosted.
pub struct Host {
    /// The host's name for itself.
    pub name: String,
    /// The task it sets, with the cameras.
    pub task: TaskSpec,
    /// The robot.
    pub embodiment: Box<dyn Embodiment>,
    /// Its cameras.
    pub cameras: Box<dyn CameraSource>,
    /// The world's clock.
    pub clock: Box<dyn Clock>,
    /// How an episode stands, if somebody can tell.
    pub judge: Judge,
    /// Called when an agent has said hello, before it is answered: a stop of the agent before it may be lifted here.
    pub on_agent: Box<dyn FnMut() + Send>,
}

/// Why a host cannot listen.
#[derive(Debug, Error)]
#[error("{address} cannot be listened on ({cause}): another host may run there: choose another address")]
pub struct ServeError {
    address: Address,
    cause: io::Error,
}

/// What happens at a host, for its log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum HostEvent {
    /// An agent is connected.
    Connected {
        /// Its name.
        agent: String,
        /// How frames will travel.
        frames: Carrier,
        /// Why they do not travel through shared memory although the agent can.
        fallback: Option<String>,
    },
    /// A frame could not go through shared memory: from now on frames go inline.
    Inline {
        /// Why.
        reason: String,
    },
    /// Somebody was turned away.
    TurnedAway {
        /// Why.
        reason: String,
    },
    /// The agent is gone; the world stays.
    Left {
        /// How.
        reason: String,
    },
}

/// A host that listens.
pub struct RobotServer {
    listener: Listener,
    frames: FrameMode,
    shared: Arc<Shared>,
}

/// Ends a server from another thread.
#[derive(Clone)]
pub struct Stopper {
    own_address: Address,
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    stopped: AtomicBool,
    next: AtomicU64,
    /// Open connections, to be closed when the server ends.
    open: Mutex<BTreeMap<u64, Stream>>,
    taken: Mutex<bool>,
    freed: Condvar,
}

impl Stopper {
    /// Ends the server: no further agent is taken and the present one is cut off.
    pub fn stop(&self) {
        self.shared.stopped.store(true, Ordering::SeqCst);
        for stream in self.shared.open.lock().unwrap_or_else(PoisonError::into_inner).values() {
            stream.close();
        }
        // The server waits for a connection: this is one.
        if let Err(error) = self.own_address.connect() {
            tracing::debug!(%error, "the server is gone already");
        }
    }
}

impl RobotServer {
    /// Begins to listen.
    ///
    /// # Errors
    /// The address is in use or is none of this machine's.
    pub fn bind(address: &Address, frames: FrameMode) -> Result<RobotServer, ServeError> {
        let listener = address.listen().map_err(|cause| ServeError { address: address.clone(), cause })?;
        Ok(RobotServer { listener, frames, shared: Arc::default() })
    }

    /// Where agents reach it, with the port that was found.
    pub fn address(&self) -> &Address {
        &self.listener.address
    }

    /// Ends this server from elsewhere.
    pub fn stopper(&self) -> Stopper {
        Stopper { own_address: self.listener.own_address(), shared: Arc::clone(&self.shared) }
    }

    /// Serves agents, one at a time, until it is stopped; hands the world back. What happens is told to `tell`.
    pub fn serve(self, host: Host, tell: impl Fn(HostEvent) + Sync) -> Host {
        let world = Mutex::new(host);
        let (tell, world_of_all, frames) = (&tell, &world, self.frames);
        std::thread::scope(|threads| {
            while !self.shared.stopped.load(Ordering::SeqCst) {
                let Ok(stream) = self.listener.accept() else { continue };
                let Some(connection) = Connection::new(stream, &self.shared) else { continue };
                threads.spawn(move || connection.serve(world_of_all, frames, tell));
            }
        });
        world.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One connection, which is closed and forgotten with it.
struct Connection {
    wire: Wire,
    number: u64,
    shared: Arc<Shared>,
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.wire.stream().close();
        self.shared.open.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.number);
    }
}

impl Connection {
    /// Takes a connection in, unless the server ends or has too many.
    fn new(stream: Stream, shared: &Arc<Shared>) -> Option<Connection> {
        let mut open = shared.open.lock().unwrap_or_else(PoisonError::into_inner);
        let clone = stream.try_clone().ok()?;
        if open.len() >= MAX_CONNECTIONS || shared.stopped.load(Ordering::SeqCst) {
            stream.close();
            return None;
        }
        let number = shared.next.fetch_add(1, Ordering::Relaxed);
        open.insert(number, clone);
        drop(open);
        Some(Connection { wire: Wire::new(stream), number, shared: Arc::clone(shared) })
    }

    fn serve(mut self, world: &Mutex<Host>, mode: FrameMode, tell: &(impl Fn(HostEvent) + Sync)) {
        let (agent, frames) = match self.hello() {
            Ok(hello) => hello,
            Err(reason) => return self.turn_away(reason, tell),
        };
        let Some(_turn) = Turn::take(&self.shared) else {
            let reason = "another agent is connected, and a robot takes one at a time: try again when it is gone";
            return self.turn_away(reason.into(), tell);
        };
        let mut host = world.lock().unwrap_or_else(PoisonError::into_inner);
        (host.on_agent)();
        let (carrier, bus, fallback) = match carrier(&host.task, mode, &frames) {
            Ok(agreed) => agreed,
            Err(reason) => return self.turn_away(reason, tell),
        };
        let mut session = Session { host: &mut host, bus };
        let welcome = session.welcome(carrier);
        tell(HostEvent::Connected { agent, frames: carrier, fallback });
        let end = match self.wire.send(&welcome, [], MESSAGE_LIMIT) {
            Ok(()) => self.answer_all(&mut session, tell),
            Err(error) => error,
        };
        tell(HostEvent::Left { reason: end.to_string() });
    }

    /// The agent's name and the carriers it can use.
    fn hello(&mut self) -> Result<(String, Vec<Carrier>), String> {
        match self.wire.receive(MESSAGE_LIMIT, MESSAGE_LIMIT, 0) {
            Ok((Ask::Hello { protocol: VERSION, agent, frames }, _)) => Ok((agent, frames)),
            Ok((Ask::Hello { protocol, .. }, _)) => {
                Err(format!("this host speaks version {VERSION} of the robot protocol, the agent version {protocol}"))
            }
            Ok(_) => Err("an agent says hello first".into()),
            Err(error) => Err(error.to_string()),
        }
    }

    fn turn_away(mut self, reason: String, tell: &(impl Fn(HostEvent) + Sync)) {
        if let Err(error) = self.wire.send(&Answer::Error { reason: reason.clone() }, [], MESSAGE_LIMIT) {
            tracing::debug!(%error, "who was turned away is gone already");
        }
        // The wake-up call of a stop is nobody.
        if !self.shared.stopped.load(Ordering::SeqCst) {
            tell(HostEvent::TurnedAway { reason });
        }
    }

    fn answer_all(&mut self, session: &mut Session<'_>, tell: &impl Fn(HostEvent)) -> WireError {
        loop {
            let (answer, raw) = match self.wire.receive(IDLE_LIMIT, MESSAGE_LIMIT, 0) {
                Ok((ask, _)) => session.answer(ask, tell),
                Err(WireError::Message(reason)) => (Answer::Error { reason }, None),
                Err(error) => return error,
            };
            let raw = raw.iter().flatten().map(|plane| &plane[..]);
            if let Err(error) = self.wire.send(&answer, raw, MESSAGE_LIMIT) {
                return error;
            }
            if let Answer::Error { reason } = answer {
                return WireError::Message(reason);
            }
        }
    }
}

/// The right to drive the robot, given back when it is dropped.
struct Turn(Arc<Shared>);

impl Turn {
    fn take(shared: &Arc<Shared>) -> Option<Turn> {
        let taken = shared.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = shared.freed.wait_timeout_while(taken, TURN_LIMIT, |taken| *taken);
        let (mut taken, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if *taken {
            return None;
        }
        *taken = true;
        Some(Turn(Arc::clone(shared)))
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        *self.0.taken.lock().unwrap_or_else(PoisonError::into_inner) = false;
        self.0.freed.notify_one();
    }
}
