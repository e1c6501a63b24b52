//! The agent's end: the three traits of the outside world over one connection.
//!
//! Every question has a deadline. After the first failure the connection is given up and each later question fails at
//! once with the same reason, so that an episode whose host is gone ends soon and says why.

mod check;
mod handles;
mod link;

use super::{
    FrameMode,
    address::Address,
    protocol::{Answer, Ask, Carrier, HostVerdict, VERSION, Welcome},
    wire::{Wire, WireError},
};
use acm_concept::{
    camera::CameraSource,
    embodiment::{Clock, Embodiment, RobotDescription},
    task::TaskSpec,
};
use acm_runtime::frame_bus::{BusError, BusLimits, SharedMemoryReader};
use check::check;
use handles::{RemoteCameras, RemoteClock, RemoteEmbodiment};
use link::{Link, lock, name_of};
use serde::Serialize;
use std::{
    io,
    sync::{Arc, Mutex},
    time::Duration,
};
use thiserror::Error;

/// Longest time that a host may take for an answer, beside the time that it was asked to wait.
const CALL_LIMIT: Duration = Duration::from_secs(4);
/// Longest time that a judge may take.
const JUDGE_LIMIT: Duration = Duration::from_secs(30);

/// Why a host cannot be used. Causes are part of the text, since it also goes where no chain of errors can.
#[derive(Debug, Error)]
pub enum RemoteError {
    /// Nobody listens.
    #[error("no robot answers at {address} ({cause}): start its host first, such as `acm sim serve SCENARIO`")]
    Connect {
        /// Where.
        address: Address,
        /// What the system says.
        cause: io::Error,
    },
    /// The connection is lost.
    #[error("the robot at {address} is lost: {cause}")]
    Wire {
        /// Where.
        address: Address,
        /// How.
        cause: WireError,
    },
    /// The connection was lost before.
    #[error("{0}")]
    Lost(String),
    /// The host does not want this agent.
    #[error("the robot at {address} refuses: {reason}")]
    Refused {
        /// Where.
        address: Address,
        /// In the host's words.
        reason: String,
    },
    /// The host says what cannot be.
    #[error("the robot at {address} does not keep to the protocol (docs/robot-protocol.md): {reason}")]
    Protocol {
        /// Where.
        address: Address,
        /// What is wrong.
        reason: String,
    },
    /// Frames were to come through shared memory, and cannot.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// A robot behind a connection. Its handles share the connection, which ends with the last of them.
#[derive(Debug)]
pub struct RemoteRobot {
    link: Arc<Mutex<Link>>,
    host: String,
    robot: RobotDescription,
    task: TaskSpec,
    address: Address,
    carrier: Carrier,
    fallback: Option<String>,
}

impl RemoteRobot {
    /// Connects to a host and says hello as `agent`.
    ///
    /// # Errors
    /// Nobody listens there, the host is taken by another agent, it speaks another version, what it tells of itself
    /// cannot be, or frames were to come through shared memory alone and cannot.
    pub fn connect(address: &Address, agent: &str, frames: FrameMode) -> Result<RemoteRobot, RemoteError> {
        let stream = address.connect().map_err(|cause| RemoteError::Connect { address: address.clone(), cause })?;
        let hello = Ask::Hello { protocol: VERSION, agent: agent.into(), frames: frames.carriers().to_vec() };
        let mut wire = Wire::new(stream);
        let mut exchange = || {
            wire.send(&hello, [], CALL_LIMIT)?;
            wire.receive::<Answer>(CALL_LIMIT, CALL_LIMIT, 0)
        };
        let protocol = |reason: String| RemoteError::Protocol { address: address.clone(), reason };
        let welcome = match exchange().map_err(|cause| RemoteError::Wire { address: address.clone(), cause })?.0 {
            Answer::Hello(welcome) => *welcome,
            Answer::Error { reason } => return Err(RemoteError::Refused { address: address.clone(), reason }),
            other => return Err(protocol(format!("it answers {} to hello", name_of(&other)))),
        };
        check(&welcome).map_err(protocol)?;
        let (bus, fallback) = join_bus(&welcome, frames)?;
        let link =
            Link { address: address.clone(), wire, broken: None, feedback: welcome.feedback, time: welcome.time, bus };
        Ok(RemoteRobot {
            carrier: if link.bus.is_some() { Carrier::SharedMemory } else { Carrier::Inline },
            link: Arc::new(Mutex::new(link)),
            host: welcome.host,
            robot: welcome.robot,
            task: welcome.task,
            address: address.clone(),
            fallback,
        })
    }

    /// The task that the host sets.
    pub fn task(&self) -> &TaskSpec {
        &self.task
    }
    /// Where it was reached.
    pub fn address(&self) -> &Address {
        &self.address
    }
    /// The host's name for itself.
    pub fn host(&self) -> &str {
        &self.host
    }
    /// How frames come.
    pub fn carrier(&self) -> Carrier {
        self.carrier
    }
    /// Why frames come inline although shared memory was agreed.
    pub fn fallback(&self) -> Option<&str> {
        self.fallback.as_deref()
    }
    /// The robot.
    pub fn embodiment(&self) -> Box<dyn Embodiment> {
        Box::new(RemoteEmbodiment { link: Arc::clone(&self.link), robot: self.robot.clone() })
    }
    /// Its cameras.
    pub fn camera(&self) -> Box<dyn CameraSource> {
        Box::new(RemoteCameras { link: Arc::clone(&self.link), models: self.task.cameras.clone() })
    }
    /// The world's clock: it shows the moment of the host's last answer.
    pub fn clock(&self) -> Box<dyn Clock> {
        Box::new(RemoteClock { link: Arc::clone(&self.link) })
    }

    /// Says that the agent is done or gives up, and asks for the judge's verdict; `None` if the host has no judge.
    ///
    /// # Errors
    /// The connection is or was lost, or the host does not keep to the protocol.
    pub fn done(&self, report: &impl Serialize) -> Result<Option<HostVerdict>, RemoteError> {
        let mut link = lock(&self.link);
        let report = serde_json::to_value(report)
            .map_err(|e| RemoteError::Protocol { address: link.address.clone(), reason: e.to_string() })?;
        match link.ask(&Ask::Done { report }, JUDGE_LIMIT, 0).map_err(RemoteError::Lost)?.0 {
            Answer::Verdict { verdict } => Ok(verdict),
            other => Err(RemoteError::Lost(link.break_off(&other, "done"))),
        }
    }
}

/// Joins the bus that the host names. In the automatic mode a bus that cannot be joined is no reason to stop.
fn join_bus(welcome: &Welcome, frames: FrameMode) -> Result<(Option<SharedMemoryReader>, Option<String>), RemoteError> {
    let Some(name) = welcome.bus.as_ref().filter(|_| welcome.frames == Carrier::SharedMemory) else {
        return Ok((None, None));
    };
    match SharedMemoryReader::open(name, BusLimits::default()) {
        Ok(reader) => Ok((Some(reader), None)),
        Err(error) if frames == FrameMode::Auto => Ok((None, Some(error.to_string()))),
        Err(error) => Err(error.into()),
    }
}
