//! The perception actor: asks for a frame and grounds it against what memory expects.

use crate::{
    message::{EPISODE, HOST, MEMORY, Message},
    settings::Turning,
};
use acm_concept::{camera::RgbdFrame, embodiment::RobotDescription, expectation::Expectation};
use acm_perception::{Grounder, LastPictures};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
    frame_bus::FrameBus,
};
use std::sync::Arc;

/// The perception actor.
pub struct PerceptionActor {
    grounder: Turning<Arc<Grounder>>,
    robot: RobotDescription,
    bus: Arc<dyn FrameBus<RgbdFrame>>,
    /// The expectation for the frame that was asked for.
    expectation: Option<Expectation>,
    /// By which a camera that has stopped is known.
    last: LastPictures,
}

impl PerceptionActor {
    /// An actor that grounds with `grounder` and takes frames from `bus`.
    pub fn new(
        grounder: Turning<Arc<Grounder>>,
        robot: RobotDescription,
        bus: Arc<dyn FrameBus<RgbdFrame>>,
    ) -> PerceptionActor {
        PerceptionActor { grounder, robot, bus, expectation: None, last: LastPictures::default() }
    }
}

impl Core<Message> for PerceptionActor {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        match message.body {
            Message::Expected(expectation) => {
                self.expectation = Some(expectation);
                outbox.send(HOST, Message::Capture);
            }
            Message::Frame { header, feedback } => {
                let frame = match self.bus.get(header.id.0) {
                    Ok(frame) => frame,
                    Err(lost) => {
                        outbox.send(EPISODE, Message::Broken { reason: lost.to_string() });
                        return Ok(());
                    }
                };
                let mut expectation = self.expectation.take().unwrap_or_default();
                expectation.time = header.time;
                expectation.robot = self.robot.body(&feedback);
                let percepts = Box::new(self.grounder.now().ground_next(&mut self.last, &frame, &expectation));
                outbox.send(MEMORY, Message::Percepts { percepts, feedback });
            }
            other => return Err(CoreError(format!("perception cannot handle {other:?}"))),
        }
        Ok(())
    }

    fn state(&self) -> Option<String> {
        let expected = self.expectation.as_ref().map(|expected| expected.objects.len());
        Some(serde_json::json!({ "expected_objects": expected }).to_string())
    }
}
