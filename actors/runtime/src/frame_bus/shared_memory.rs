//! The bus between processes: frames in shared memory, carried by iceoryx2.
//!
//! A bus has a name, one writer and a fixed number of readers, and a fixed number of places for frames in `/dev/shm`.
//! The payload is plain bytes without a demanded alignment, so that tools which know no type of ours can carry it on;
//! planes are aligned inside of it. With each frame an event goes out on the service `NAME/event`, for those who wait.

mod chunk;
mod reader;
mod writer;

pub use reader::SharedMemoryReader;
pub use writer::{PreparedFrame, SharedMemoryWriter};

use super::{ByteFrame, FrameBus, FrameError, FrameReader, PublishError};
use chunk::FrameTag;
use iceoryx2::{
    node::NodeView,
    prelude::{
        CallbackProgression, Config, LogLevel, Node, NodeBuilder, NodeName, NodeState, ServiceName, SignalHandlingMode,
        ipc_threadsafe, set_log_level,
    },
    service::port_factory::{event, publish_subscribe},
};
use std::{collections::hash_map::RandomState, hash::BuildHasher, sync::Arc, time::Duration};
use thiserror::Error;

/// Where the system keeps shared memory.
const SHM_DIR: &str = "/dev/shm";
/// Readers and the writer, and two more that may be dying while others start.
const SPARE_NODES: usize = 3;
/// How long another process is waited for that is cleaning up after a dead one.
const CLEANUP_LIMIT: Duration = Duration::from_millis(500);

type Service = ipc_threadsafe::Service;
type Frames = publish_subscribe::PortFactory<Service, [u8], FrameTag>;
type Events = event::PortFactory<Service>;

/// How much a bus may hold. Both ends must name the same numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusLimits {
    /// Readers at one time.
    pub readers: usize,
    /// Frames that the bus holds for each reader: the newest ones.
    pub frames: usize,
    /// Older frames that a reader's user may still hold without a copy being made.
    pub views: usize,
}

impl BusLimits {
    /// Places in shared memory: what readers may hold and have waiting, and the frame being written.
    pub fn places(&self) -> usize {
        self.readers * (self.frames + self.borrowed()) + 1
    }
    /// Samples that one reader may hold: its window, its user's views, and the one being received.
    fn borrowed(&self) -> usize {
        self.frames + self.views + 1
    }
}

/// For one agent that keeps its last eight frames.
impl Default for BusLimits {
    fn default() -> Self {
        BusLimits { readers: 1, frames: 2, views: 10 }
    }
}

/// Why there is no bus in shared memory.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum BusError {
    /// The system has no place for shared memory.
    #[error("there is no shared memory for frames: {SHM_DIR} cannot be used ({reason}); send frames inline instead")]
    NoSharedMemory {
        /// What the system says.
        reason: String,
    },
    /// It is there, but too small.
    #[error(
        "{SHM_DIR} has {free_mb} MB free, the frames need {needed_mb} MB: enlarge it (docker run --shm-size) or send frames inline"
    )]
    Full {
        /// Megabytes needed.
        needed_mb: u64,
        /// Megabytes there are.
        free_mb: u64,
    },
    /// A name that cannot name a service.
    #[error("`{name}` cannot name a frame bus: {reason}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// The bus could not be made, or there is none to join.
    #[error("the frame bus `{name}` cannot be {action}: {reason}")]
    Setup {
        /// Its name.
        name: String,
        /// `created` or `joined`.
        action: &'static str,
        /// What iceoryx2 says.
        reason: String,
    },
}

/// A text that no other run has: for the names of buses, sockets and folders.
pub fn run_id() -> String {
    // The standard library's hasher is seeded by the system.
    format!("{:x}-{:016x}", std::process::id(), RandomState::new().hash_one(std::process::id()))
}

/// Processes that died while they were on a bus and whose share of `/dev/shm` has not been given back. Whoever next
/// creates, joins or leaves a bus does that.
///
/// # Errors
/// The list cannot be read.
pub fn leftovers() -> Result<Vec<u32>, BusError> {
    set_log_level(LogLevel::Error);
    let mut dead = Vec::new();
    let listed = Node::<Service>::list(Config::global_config(), |state| {
        if let NodeState::Dead(node) = state {
            dead.extend(node.id().pid::<Service>().map(|pid| pid.value().unsigned_abs()));
        }
        CallbackProgression::Continue
    });
    listed.map_err(|e| BusError::Setup { name: "all".into(), action: "listed", reason: e.to_string() })?;
    Ok(dead)
}

/// Both ends of a bus in one process.
#[derive(Debug)]
pub struct SharedMemoryBus {
    writer: SharedMemoryWriter,
    reader: SharedMemoryReader,
}

impl SharedMemoryBus {
    /// A new bus; see [`SharedMemoryWriter::create`].
    ///
    /// # Errors
    /// As there.
    pub fn create(name: &str, limits: BusLimits, frame_bytes: usize) -> Result<SharedMemoryBus, BusError> {
        let writer = SharedMemoryWriter::create(name, limits, frame_bytes)?;
        Ok(SharedMemoryBus { reader: SharedMemoryReader::open(name, limits)?, writer })
    }

    /// The name by which other readers find the bus.
    pub fn name(&self) -> &str {
        self.writer.name()
    }
}

impl FrameReader<ByteFrame> for SharedMemoryBus {
    fn get(&self, number: u64) -> Result<Arc<ByteFrame>, FrameError> {
        self.reader.get(number)
    }
}

impl FrameBus<ByteFrame> for SharedMemoryBus {
    fn publish(&self, number: u64, frame: Arc<ByteFrame>) -> Result<(), PublishError> {
        self.writer.publish(number, &frame)
    }
}

/// One end's services.
struct Joined {
    frames: Frames,
    events: Events,
    node: Node<Service>,
}

/// Creates (as the writer) or joins (as a reader) the services of a bus. What dead processes left is cleaned on the way.
fn join(name: &str, limits: &BusLimits, create: bool) -> Result<Joined, BusError> {
    set_log_level(LogLevel::Error);
    let (action, nodes) = (if create { "created" } else { "joined" }, limits.readers + SPARE_NODES);
    let bad = |reason: String| BusError::Name { name: name.into(), reason };
    let setup = |reason: String| BusError::Setup { name: name.into(), action, reason };
    let node_name = NodeName::new("acm").map_err(|e| bad(e.to_string()))?;
    let services = [name.to_string(), format!("{name}/event")].map(|text| ServiceName::new(&text));
    let [frames_name, events_name] = services;
    let (frames_name, events_name) =
        (frames_name.map_err(|e| bad(e.to_string()))?, events_name.map_err(|e| bad(e.to_string()))?);
    let node = NodeBuilder::new()
        .name(&node_name)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Service>()
        .map_err(|e| setup(e.to_string()))?;
    let frames = node
        .service_builder(&frames_name)
        .publish_subscribe::<[u8]>()
        .user_header::<FrameTag>()
        .enable_safe_overflow(true)
        .history_size(0)
        .max_publishers(1)
        .max_subscribers(limits.readers)
        .subscriber_max_buffer_size(limits.frames)
        .subscriber_max_borrowed_samples(limits.borrowed())
        .max_nodes(nodes);
    let frames = match create {
        true => frames.create().map_err(|e| setup(e.to_string())),
        false => frames.open().map_err(|e| setup(e.to_string())),
    }?;
    let events =
        node.service_builder(&events_name).event().max_notifiers(1).max_listeners(limits.readers).max_nodes(nodes);
    let events = match create {
        true => events.create().map_err(|e| setup(e.to_string())),
        false => events.open().map_err(|e| setup(e.to_string())),
    }?;
    Ok(Joined { frames, events, node })
}

/// Gives back what dead processes left.
fn clean_up(node: &Node<Service>) {
    let state = node.blocking_cleanup_dead_nodes(CLEANUP_LIMIT);
    tracing::debug!(?state, "cleaned up after dead processes");
}

/// Checks that `needed` bytes can be had. Memory of this kind is given page by page as it is first written, and a
/// process that writes where none is left is killed by the system: so it is asked beforehand.
fn check_room(needed: u64) -> Result<(), BusError> {
    let room = rustix::fs::statvfs(SHM_DIR).map_err(|e| BusError::NoSharedMemory { reason: e.to_string() })?;
    let free = room.f_bavail.saturating_mul(room.f_frsize);
    let megabytes = |bytes: u64| bytes.div_ceil(1_000_000);
    match needed <= free {
        true => Ok(()),
        false => Err(BusError::Full { needed_mb: megabytes(needed), free_mb: free / 1_000_000 }),
    }
}
