//! One agent's time with the world: what is agreed on, and the answer to each question.

use super::{
    super::{
        FrameMode, picture,
        protocol::{Answer, Ask, Carrier, Refusal, VERSION, Welcome},
    },
    Host, HostEvent,
};
use acm_concept::{
    camera::{CameraError, RgbdFrame},
    embodiment::EmbodimentError,
    task::TaskSpec,
};
use acm_runtime::frame_bus::{BusError, BusLimits, Bytes, SharedMemoryWriter, run_id};

/// What is agreed on: the carrier, its bus, and why it is not the agent's first choice.
pub type Agreed = (Carrier, Option<SharedMemoryWriter>, Option<String>);

/// Agrees on how frames travel. Each agent gets a bus of its own, so that what a killed one held is gone with it.
pub fn carrier(task: &TaskSpec, mode: FrameMode, agent: &[Carrier]) -> Result<Agreed, String> {
    let both = |carrier: Carrier| mode.carriers().contains(&carrier) && agent.contains(&carrier);
    let mut fallback = None;
    if both(Carrier::SharedMemory) {
        match open_bus(task) {
            Ok(bus) => return Ok((Carrier::SharedMemory, Some(bus), None)),
            Err(error) => fallback = Some(error.to_string()),
        }
    }
    match (both(Carrier::Inline), fallback) {
        (true, fallback) => Ok((Carrier::Inline, None, fallback)),
        (false, Some(reason)) => Err(reason),
        (false, None) => Err(format!("frames travel by {:?} here, the agent takes {agent:?}", mode.carriers())),
    }
}

fn open_bus(task: &TaskSpec) -> Result<SharedMemoryWriter, BusError> {
    let pixels = task.cameras.iter().map(|camera| camera.intrinsics.pixels()).max().unwrap_or(0);
    SharedMemoryWriter::create(&format!("acm/frames/{}", run_id()), BusLimits::default(), picture::raw_bytes(pixels))
}

/// One agent's time with the world.
pub struct Session<'a> {
    pub host: &'a mut Host,
    pub bus: Option<SharedMemoryWriter>,
}

impl Session<'_> {
    pub fn welcome(&self, frames: Carrier) -> Answer {
        Answer::Hello(Box::new(Welcome {
            protocol: VERSION,
            host: self.host.name.clone(),
            robot: self.host.embodiment.description().clone(),
            task: self.host.task.clone(),
            time: self.host.clock.now(),
            feedback: self.host.embodiment.feedback(),
            frames,
            bus: self.bus.as_ref().map(|bus| bus.name().to_string()),
        }))
    }

    /// The answer and the pixels that follow it.
    pub fn answer(&mut self, ask: Ask, tell: &impl Fn(HostEvent)) -> (Answer, Option<[Bytes; 2]>) {
        let refused = |error: &EmbodimentError| {
            let (why, reason) = Refusal::of(error);
            Answer::Refused { why, reason }
        };
        let answer = match ask {
            Ask::Hello { .. } => Answer::Error { reason: "a second hello".into() },
            Ask::Capture { camera, by } => return self.capture(&camera, by, tell),
            Ask::Feedback => Answer::Feedback { feedback: self.host.embodiment.feedback() },
            Ask::Command { command } => match self.host.embodiment.command(&command) {
                Ok(feedback) => Answer::Feedback { feedback },
                Err(error) => refused(&error),
            },
            Ask::WaitUntil { time } => match self.host.clock.wait_until(time) {
                Ok(time) => Answer::Time { time },
                Err(error) => refused(&error),
            },
            Ask::Stop => {
                self.host.embodiment.stop();
                Answer::Stopped
            }
            Ask::Done { report } => Answer::Verdict { verdict: (self.host.judge)(&report) },
        };
        (answer, None)
    }

    fn capture(&mut self, camera: &str, by: Carrier, tell: &impl Fn(HostEvent)) -> (Answer, Option<[Bytes; 2]>) {
        let frame = match self.host.cameras.capture(camera) {
            Ok(frame) => frame,
            Err(error) => {
                let reason = match error {
                    CameraError::Failed { reason, .. } => reason,
                    other => other.to_string(),
                };
                return (Answer::Refused { why: Refusal::Failed, reason }, None);
            }
        };
        if by == Carrier::SharedMemory && self.publish(&frame, tell) {
            return (Answer::Frame { header: frame.header, bytes: None }, None);
        }
        let planes = picture::planes(&frame);
        let bytes = Some(planes.iter().map(|plane| plane.len() as u64).sum());
        (Answer::Frame { header: frame.header, bytes }, Some(planes))
    }

    /// Puts a frame on the bus. Where that fails this and all later frames go inline: an agent takes them as they come.
    fn publish(&mut self, frame: &RgbdFrame, tell: &impl Fn(HostEvent)) -> bool {
        let Some(bus) = &self.bus else { return false };
        let published = bus.publish(frame.header.id.0, &picture::byte_frame(frame));
        if let Err(error) = &published {
            tell(HostEvent::Inline { reason: error.to_string() });
            self.bus = None;
        }
        published.is_ok()
    }
}
