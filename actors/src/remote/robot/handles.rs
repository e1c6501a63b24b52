//! The three traits of the outside world, over one connection.

use super::{
    super::protocol::{Answer, Ask},
    CALL_LIMIT,
    link::{Link, lock},
};
use acm_concept::{
    camera::{CameraError, CameraModel, CameraSource, RgbdFrame},
    embodiment::{Clock, Command, Embodiment, EmbodimentError, Feedback, RobotDescription},
    time::Time,
};
use std::{
    sync::{Arc, Mutex},
    time::Duration,
};

/// The robot behind a connection.
pub struct RemoteEmbodiment {
    pub link: Arc<Mutex<Link>>,
    pub robot: RobotDescription,
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

/// Its cameras.
pub struct RemoteCameras {
    pub link: Arc<Mutex<Link>>,
    pub models: Vec<CameraModel>,
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

/// Its clock.
pub struct RemoteClock {
    pub link: Arc<Mutex<Link>>,
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
