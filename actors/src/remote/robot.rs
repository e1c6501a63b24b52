//! The agent's end: the three traits of the outside world over one connection.
//!
//! Every question has a deadline. After the first failure the connection is given up and each later question fails at
//! once with the same reason, so that an episode whose host is gone ends soon and says why.

use super::{
    FrameMode,
    address::Address,
    picture,
    protocol::{Answer, Ask, Carrier, HostVerdict, VERSION, Welcome},
    wire::{Wire, WireError},
};
use acm_concept::{
    camera::{CameraError, CameraModel, CameraSource, FrameHeader, MAX_PIXELS, RgbdFrame},
    embodiment::{Clock, Command, Embodiment, EmbodimentError, Feedback, RobotDescription},
    task::TaskSpec,
    time::Time,
};
use acm_runtime::frame_bus::{BusError, BusLimits, Bytes, FrameReader, SharedMemoryReader};
use serde::Serialize;
use std::{
    io,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};
use thiserror::Error;

/// Longest time that a host may take for an answer, beside the time that it was asked to wait.
const CALL_LIMIT: Duration = Duration::from_secs(4);
/// Longest time that a judge may take.
const JUDGE_LIMIT: Duration = Duration::from_secs(30);
/// Most cameras, solids of the hand, and bytes of an instruction that a host may name.
const MAX_CAMERAS: usize = 16;
const MAX_SOLIDS: usize = 256;
const MAX_INSTRUCTION_BYTES: usize = 16 * 1024;

/// Why a host cannot be used.
#[derive(Debug, Error)]
pub enum RemoteError {
    /// Nobody listens.
    #[error("no robot answers at {address} ({source}): start its host first, such as `acm sim serve SCENARIO`")]
    Connect {
        /// Where.
        address: Address,
        /// What the system says.
        source: io::Error,
    },
    /// The connection is lost.
    #[error("the robot at {address} is lost: {source}")]
    Wire {
        /// Where.
        address: Address,
        /// How.
        source: WireError,
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
        let stream = address.connect().map_err(|source| RemoteError::Connect { address: address.clone(), source })?;
        let hello = Ask::Hello { protocol: VERSION, agent: agent.into(), frames: frames.carriers().to_vec() };
        let mut wire = Wire::new(stream);
        let mut exchange = || {
            wire.send(&hello, [], CALL_LIMIT)?;
            wire.receive::<Answer>(CALL_LIMIT, CALL_LIMIT, 0)
        };
        let protocol = |reason: String| RemoteError::Protocol { address: address.clone(), reason };
        let welcome = match exchange().map_err(|source| RemoteError::Wire { address: address.clone(), source })?.0 {
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
            fallback,
        })
    }

    /// The task that the host sets.
    pub fn task(&self) -> &TaskSpec {
        &self.task
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

/// What a host tells of itself is bounded and possible.
fn check(welcome: &Welcome) -> Result<(), String> {
    if welcome.protocol != VERSION {
        return Err(format!("it speaks version {}, this agent version {VERSION}", welcome.protocol));
    }
    let (task, robot) = (&welcome.task, &welcome.robot);
    if task.cameras.is_empty() || task.cameras.len() > MAX_CAMERAS {
        return Err(format!("it has {} cameras, 1 to {MAX_CAMERAS} are possible", task.cameras.len()));
    }
    for camera in &task.cameras {
        let seen = &camera.intrinsics;
        let possible = (1..=MAX_PIXELS).contains(&seen.pixels()) && seen.fx > 0.0 && seen.fy > 0.0;
        if !possible || ![seen.fx, seen.fy, seen.cx, seen.cy].iter().all(|value| value.is_finite()) {
            return Err(format!("the intrinsics of its camera `{}` are not possible: {seen:?}", camera.name));
        }
        if !camera.pose.is_valid() {
            return Err(format!("the pose of its camera `{}` is none: rotations are unit quaternions", camera.name));
        }
    }
    let numbers =
        [robot.max_opening_m, robot.max_grip_force_n, robot.max_speed_m_s, robot.max_turn_rad_s, robot.tick_s];
    if !numbers.iter().all(|number| number.is_finite() && *number > 0.0) || !robot.home.is_valid() {
        return Err("the robot's opening, force, speeds, tick and home must be positive and finite".into());
    }
    let solids = robot.hand.len() + robot.finger.len();
    if solids > MAX_SOLIDS || task.instruction.len() > MAX_INSTRUCTION_BYTES {
        return Err(format!("more than {MAX_SOLIDS} solids or {MAX_INSTRUCTION_BYTES} bytes of instruction"));
    }
    let seconds = [task.instruction_at_s, task.budgets.seconds];
    if !seconds.iter().all(|value| value.is_finite() && *value >= 0.0) {
        return Err("the moment of the instruction and the budget must be finite and not negative".into());
    }
    Ok(())
}

#[derive(Debug)]
struct Link {
    address: Address,
    wire: Wire,
    /// Why the connection was given up.
    broken: Option<String>,
    feedback: Feedback,
    time: Time,
    bus: Option<SharedMemoryReader>,
}

impl Link {
    /// Asks and waits for the answer and its raw bytes. A refusal is an answer; an error is the end of the connection.
    fn ask(&mut self, ask: &Ask, limit: Duration, most: usize) -> Result<(Answer, Vec<u8>), String> {
        if let Some(broken) = &self.broken {
            return Err(broken.clone());
        }
        let mut exchange = || {
            self.wire.send(ask, [], limit)?;
            self.wire.receive(limit, limit, most)
        };
        match exchange() {
            Ok((Answer::Error { reason }, _)) => {
                Err(self.give_up(RemoteError::Refused { address: self.address.clone(), reason }))
            }
            Ok(answer) => Ok(answer),
            Err(source) => Err(self.give_up(RemoteError::Wire { address: self.address.clone(), source })),
        }
    }

    fn give_up(&mut self, error: RemoteError) -> String {
        self.wire.stream().close();
        self.broken.insert(error.to_string()).clone()
    }

    /// Gives the connection up after an answer that does not fit.
    fn break_off(&mut self, answer: &Answer, asked: &str) -> String {
        let reason = format!("it answers {} to {asked}", name_of(answer));
        self.give_up(RemoteError::Protocol { address: self.address.clone(), reason })
    }

    /// A measurement that was received: time never goes back.
    fn measured(&mut self, feedback: Feedback) -> Feedback {
        self.time = self.time.max(feedback.time);
        self.feedback = feedback.clone();
        feedback
    }

    fn capture(&mut self, camera: &CameraModel) -> Result<RgbdFrame, String> {
        let by = if self.bus.is_some() { Carrier::SharedMemory } else { Carrier::Inline };
        let ask = Ask::Capture { camera: camera.name.clone(), by };
        let most = picture::raw_bytes(camera.intrinsics.pixels());
        match self.ask(&ask, CALL_LIMIT, most)? {
            (Answer::Frame { header, .. }, _) if header.camera != camera.name => {
                Err(self.give_up(RemoteError::Protocol {
                    address: self.address.clone(),
                    reason: format!("it sends a frame of `{}`, `{}` was asked for", header.camera, camera.name),
                }))
            }
            (Answer::Frame { header, bytes }, raw) => {
                self.time = self.time.max(header.time);
                let frame = self.picture(header, bytes.is_some(), raw);
                let address = self.address.clone();
                frame.map_err(|reason| self.give_up(RemoteError::Protocol { address, reason }))
            }
            (Answer::Refused { reason, .. }, _) => Err(reason),
            (other, _) => Err(self.break_off(&other, "capture")),
        }
    }

    fn picture(&self, header: FrameHeader, inline: bool, raw: Vec<u8>) -> Result<RgbdFrame, String> {
        if inline {
            let raw = Bytes::from(raw);
            let color = raw.len().min(3 * header.intrinsics.pixels());
            return picture::frame(header, raw.slice(..color), raw.slice(color..));
        }
        let bus = self.bus.as_ref().ok_or("it sends a frame through shared memory that was not agreed")?;
        let found = bus.get(header.id.0).map_err(|e| e.to_string())?;
        match found.planes.as_slice() {
            [color, depth] => picture::frame(header, color.clone(), depth.clone()),
            planes => Err(format!("its frame has {} planes, not colour and depth", planes.len())),
        }
    }
}

/// A panic elsewhere leaves the link between two messages, or broken.
fn lock(link: &Mutex<Link>) -> MutexGuard<'_, Link> {
    link.lock().unwrap_or_else(PoisonError::into_inner)
}

fn name_of(answer: &Answer) -> &'static str {
    match answer {
        Answer::Hello(_) => "hello",
        Answer::Frame { .. } => "frame",
        Answer::Feedback { .. } => "feedback",
        Answer::Time { .. } => "time",
        Answer::Stopped => "stopped",
        Answer::Verdict { .. } => "verdict",
        Answer::Refused { .. } => "refused",
        Answer::Error { .. } => "error",
    }
}

struct RemoteEmbodiment {
    link: Arc<Mutex<Link>>,
    robot: RobotDescription,
}

impl Embodiment for RemoteEmbodiment {
    fn description(&self) -> &RobotDescription {
        &self.robot
    }
    /// If the connection is lost this is the last measurement, and the next command or frame fails.
    fn feedback(&self) -> Feedback {
        let mut link = lock(&self.link);
        match link.ask(&Ask::Feedback, CALL_LIMIT, 0) {
            Ok((Answer::Feedback { feedback }, _)) => link.measured(feedback),
            Ok((other, _)) => {
                tracing::warn!("{}", link.break_off(&other, "feedback"));
                link.feedback.clone()
            }
            Err(_kept_in_the_link) => link.feedback.clone(),
        }
    }
    fn command(&mut self, command: &Command) -> Result<Feedback, EmbodimentError> {
        let mut link = lock(&self.link);
        let failed = |reason| EmbodimentError::Failed { reason };
        match link.ask(&Ask::Command { command: *command }, CALL_LIMIT, 0).map_err(failed)?.0 {
            Answer::Feedback { feedback } => Ok(link.measured(feedback)),
            Answer::Refused { why, reason } => Err(why.into_error(reason)),
            other => Err(failed(link.break_off(&other, "command"))),
        }
    }
    fn stop(&mut self) {
        let mut link = lock(&self.link);
        match link.ask(&Ask::Stop, CALL_LIMIT, 0) {
            Ok((Answer::Stopped, _)) => {}
            Ok((other, _)) => tracing::warn!("{}", link.break_off(&other, "stop")),
            Err(reason) => tracing::warn!(%reason, "the robot could not be told to stop"),
        }
    }
}

struct RemoteCameras {
    link: Arc<Mutex<Link>>,
    models: Vec<CameraModel>,
}

impl CameraSource for RemoteCameras {
    fn cameras(&self) -> &[CameraModel] {
        &self.models
    }
    fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError> {
        let Some(model) = self.models.iter().find(|model| model.name == camera) else {
            let known = self.models.iter().map(|model| model.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(CameraError::UnknownCamera { name: camera.into(), known });
        };
        lock(&self.link).capture(model).map_err(|reason| CameraError::Failed { name: camera.into(), reason })
    }
}

struct RemoteClock {
    link: Arc<Mutex<Link>>,
}

impl Clock for RemoteClock {
    fn now(&self) -> Time {
        lock(&self.link).time
    }
    fn wait_until(&mut self, moment: Time) -> Result<Time, EmbodimentError> {
        let mut link = lock(&self.link);
        let failed = |reason| EmbodimentError::Failed { reason };
        let limit = CALL_LIMIT + Duration::from_nanos(moment.0.saturating_sub(link.time.0));
        match link.ask(&Ask::WaitUntil { time: moment }, limit, 0).map_err(failed)?.0 {
            Answer::Time { time } => {
                link.time = link.time.max(time);
                Ok(link.time)
            }
            Answer::Refused { why, reason } => Err(why.into_error(reason)),
            other => Err(failed(link.break_off(&other, "wait-until"))),
        }
    }
}
