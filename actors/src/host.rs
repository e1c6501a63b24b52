//! The port to the outside world: camera, clock and robot.

use crate::message::{HOST, Message};
use acm_concept::{
    camera::{CameraSource, RgbdFrame},
    embodiment::{Clock, Embodiment, EmbodimentError},
};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
    frame_bus::FrameBus,
};
use std::sync::{Arc, Mutex, PoisonError};

/// Everything through which the agent touches the world.
pub struct Outside {
    /// The robot.
    pub embodiment: Box<dyn Embodiment>,
    /// Its cameras.
    pub cameras: Box<dyn CameraSource>,
    /// The episode's clock.
    pub clock: Box<dyn Clock>,
}

/// Performs what actors ask for in the world and answers the one who asked. The only actor with effects.
pub struct HostPort {
    outside: Arc<Mutex<Outside>>,
    camera: String,
    bus: Arc<dyn FrameBus<RgbdFrame>>,
}

impl HostPort {
    /// A port to `outside` whose frames come from the camera of the given name and go to `bus`.
    pub fn new(outside: Arc<Mutex<Outside>>, camera: String, bus: Arc<dyn FrameBus<RgbdFrame>>) -> HostPort {
        HostPort { outside, camera, bus }
    }

    fn capture(&self, outside: &mut Outside) -> Message {
        match outside.cameras.capture(&self.camera) {
            Ok(frame) => {
                let header = frame.header.clone();
                match self.bus.publish(header.id.0, Arc::new(frame)) {
                    Ok(()) => Message::Frame { header, feedback: outside.embodiment.feedback() },
                    Err(error) => Message::Broken { reason: error.to_string() },
                }
            }
            Err(error) => Message::Broken { reason: error.to_string() },
        }
    }
}

impl Core<Message> for HostPort {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        let mut outside = self.outside.lock().unwrap_or_else(PoisonError::into_inner);
        let answer = match &message.body {
            Message::Capture => self.capture(&mut outside),
            Message::Sense => Message::Moved(outside.embodiment.feedback()),
            Message::Command(command) => match outside.embodiment.command(command) {
                Ok(feedback) => Message::Moved(feedback),
                // Nobody is there to take another command: the episode ends.
                Err(EmbodimentError::Failed { reason }) => Message::Broken { reason },
                Err(error) => refusal(&error),
            },
            Message::Wait { seconds } => {
                let until = outside.clock.now() + *seconds;
                match outside.clock.wait_until(until) {
                    Ok(_) => Message::Waited,
                    Err(error) => Message::Broken { reason: error.to_string() },
                }
            }
            other => return Err(CoreError(format!("{HOST} cannot handle {other:?}"))),
        };
        outbox.advance(outside.clock.now().0);
        let to = if matches!(answer, Message::Broken { .. }) { crate::message::EPISODE } else { message.from };
        outbox.send(to, answer);
        Ok(())
    }
}

fn refusal(error: &EmbodimentError) -> Message {
    let fatal = !matches!(error, EmbodimentError::Refused { .. } | EmbodimentError::ProtectiveStop { .. });
    Message::Refused { reason: error.to_string(), fatal }
}
