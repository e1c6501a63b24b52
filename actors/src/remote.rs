//! A robot in another process: the protocol by which any simulator, camera or arm can host the agent.
//!
//! The agent asks and the host answers, one line of JSON each, over a local socket; pixels follow a line as raw bytes or
//! come through shared memory where both ends are on one host. docs/robot-protocol.md describes it for those who write a
//! host in another language; a host in Rust hands its three traits to [`RobotServer`].
//!
//! | module | holds |
//! |---|---|
//! | [`address`] | where a host listens, and the sockets behind it |
//! | [`protocol`] | every message |
//! | `wire` | lines and raw bytes, with limits and deadlines |
//! | `picture` | frames as bytes and back |
//! | [`robot`] | the agent's end: the three traits of the outside world over one connection |
//! | [`server`] | the host's end |

pub mod address;
mod picture;
pub mod protocol;
pub mod robot;
pub mod server;
#[cfg(test)]
mod tests;
mod wire;

pub use address::Address;
pub use protocol::{Carrier, HostVerdict};
pub use robot::{RemoteError, RemoteRobot};
pub use server::{Host, HostEvent, RobotServer, ServeError, Stopper};
pub use wire::WireError;

use std::str::FromStr;

/// How frames may travel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum FrameMode {
    /// Through shared memory where that is possible, else inline.
    #[default]
    Auto,
    /// Through shared memory or not at all.
    SharedMemory,
    /// Over the socket.
    Inline,
}

impl FrameMode {
    /// The carriers that this mode allows, best first.
    pub fn carriers(self) -> &'static [Carrier] {
        match self {
            FrameMode::Auto => &[Carrier::SharedMemory, Carrier::Inline],
            FrameMode::SharedMemory => &[Carrier::SharedMemory],
            FrameMode::Inline => &[Carrier::Inline],
        }
    }
}

impl FromStr for FrameMode {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(FrameMode::Auto),
            "shared-memory" => Ok(FrameMode::SharedMemory),
            "inline" => Ok(FrameMode::Inline),
            _ => Err(format!("`{text}` is no way for frames: auto, shared-memory or inline")),
        }
    }
}
