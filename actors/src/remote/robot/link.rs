//! The connection behind the three traits.

use super::{
    super::{
        address::Address,
        picture,
        protocol::{Answer, Ask, Carrier},
        wire::Wire,
    },
    CALL_LIMIT, RemoteError,
};
use acm_concept::{
    camera::{CameraModel, FrameHeader, RgbdFrame},
    embodiment::Feedback,
    time::Time,
};
use acm_runtime::frame_bus::{Bytes, FrameReader, SharedMemoryReader};
use std::{
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// The connection, and what the last answers said.
#[derive(Debug)]
pub struct Link {
    pub address: Address,
    pub wire: Wire,
    /// Why the connection was given up.
    pub broken: Option<String>,
    pub feedback: Feedback,
    pub time: Time,
    pub bus: Option<SharedMemoryReader>,
}

impl Link {
    /// Asks and waits for the answer and its raw bytes. A refusal is an answer; an error is the end of the connection.
    pub fn ask(&mut self, ask: &Ask, limit: Duration, most: usize) -> Result<(Answer, Vec<u8>), String> {
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
            Err(cause) => Err(self.give_up(RemoteError::Wire { address: self.address.clone(), cause })),
        }
    }

    fn give_up(&mut self, error: RemoteError) -> String {
        self.wire.stream().close();
        self.broken.insert(error.to_string()).clone()
    }

    /// Gives the connection up after an answer that does not fit.
    pub fn break_off(&mut self, answer: &Answer, asked: &str) -> String {
        let reason = format!("it answers {} to {asked}", name_of(answer));
        self.give_up(RemoteError::Protocol { address: self.address.clone(), reason })
    }

    /// A measurement that was received: time never goes back.
    pub fn measured(&mut self, feedback: Feedback) -> Feedback {
        self.time = self.time.max(feedback.time);
        self.feedback = feedback.clone();
        feedback
    }

    pub fn capture(&mut self, camera: &CameraModel) -> Result<RgbdFrame, String> {
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
pub fn lock(link: &Mutex<Link>) -> MutexGuard<'_, Link> {
    link.lock().unwrap_or_else(PoisonError::into_inner)
}

pub fn name_of(answer: &Answer) -> &'static str {
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
