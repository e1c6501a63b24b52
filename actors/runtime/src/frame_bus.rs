//! Frames handed over by number: messages stay small and no pixel is copied.
//!
//! Within a process a frame is an `Arc`. Between processes it is a [`ByteFrame`]: bytes whose meaning the runtime does
//! not know, in memory that both processes see.

mod in_process;
mod shared_memory;
#[cfg(test)]
mod tests;

pub use in_process::InProcessBus;
pub use shared_memory::{
    BusError, BusLimits, PreparedFrame, SharedMemoryBus, SharedMemoryReader, SharedMemoryWriter, leftovers, run_id,
};

pub use bytes::Bytes;

use std::sync::Arc;
use thiserror::Error;

/// Most planes of a [`ByteFrame`].
pub const MAX_PLANES: usize = 4;
/// Most bytes of a [`ByteFrame`], header and planes together: 4096 x 4096 pixels of colour and depth, and a header.
pub const MAX_FRAME_BYTES: usize = 4096 * 4096 * 7 + 65_536;

/// A frame as bytes. Cloning copies no byte.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ByteFrame {
    /// Width and height in pixels, for readers that want no more than to lay planes out.
    pub size: [u32; 2],
    /// What is said of the frame beside its pixels.
    pub header: Bytes,
    /// The planes, at most [`MAX_PLANES`]. On a shared-memory bus each begins at a multiple of 64 bytes.
    pub planes: Vec<Bytes>,
}

impl ByteFrame {
    /// Bytes of header and planes.
    pub fn bytes(&self) -> usize {
        self.header.len() + self.planes.iter().map(Bytes::len).sum::<usize>()
    }
}

/// A frame that is no longer, or not yet, on the bus.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("frame {wanted} is not on the bus, which holds {held}: it was overwritten by newer frames or never published")]
pub struct FrameLost {
    wanted: u64,
    held: String,
}

impl FrameLost {
    /// The loss of a frame from a bus that holds the frames of the given numbers.
    fn new(wanted: u64, first: Option<u64>, last: Option<u64>) -> FrameLost {
        let held = match (first, last) {
            (Some(first), Some(last)) => format!("{first} to {last}"),
            _ => "none".into(),
        };
        FrameLost { wanted, held }
    }
}

/// Why a frame could not be taken.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FrameError {
    /// It is not there.
    #[error(transparent)]
    Lost(#[from] FrameLost),
    /// It is there, but is no frame, or the bus itself failed.
    #[error("frame {number} cannot be read from the bus: {reason}")]
    Unreadable {
        /// The frame's number.
        number: u64,
        /// What is wrong.
        reason: String,
    },
}

/// Why a frame could not be put on the bus.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PublishError {
    /// Numbers must rise.
    #[error("frame {number} comes after frame {last}: a source's frame numbers must rise")]
    NotRising {
        /// The number given.
        number: u64,
        /// The last one.
        last: u64,
    },
    /// The frame is beyond [`MAX_PLANES`] or [`MAX_FRAME_BYTES`].
    #[error(
        "a frame of {bytes} bytes in {planes} planes is too large: at most {MAX_FRAME_BYTES} bytes in {MAX_PLANES} planes"
    )]
    TooLarge {
        /// Its bytes.
        bytes: usize,
        /// Its planes.
        planes: usize,
    },
    /// Shared memory is used up.
    #[error(transparent)]
    Full(BusError),
    /// The shared-memory port failed.
    #[error("the shared-memory port failed: {0}")]
    Port(String),
}

/// Where frames are taken.
pub trait FrameReader<F>: Send + Sync {
    /// Takes a share of a frame. The same frame may be taken any number of times while the bus holds it.
    fn get(&self, number: u64) -> Result<Arc<F>, FrameError>;
}

/// A bounded hand-over of frames between a producer and its consumers. When it is full the oldest frame goes.
pub trait FrameBus<F>: FrameReader<F> {
    /// Puts a frame on the bus under its number; numbers must rise.
    fn publish(&self, number: u64, frame: Arc<F>) -> Result<(), PublishError>;
}
