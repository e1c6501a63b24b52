//! The world of a recorded run: what its host answered, given again in the same order.

use crate::host::Outside;
use acm_concept::{
    camera::{CameraError, CameraModel, CameraSource, FrameHeader, RgbdFrame},
    embodiment::{Clock, Command, Embodiment, EmbodimentError, Feedback, RobotDescription},
    time::Time,
};
use acm_runtime::trace::Record;
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::Value;
use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use thiserror::Error;

/// What the host answered once.
#[derive(Debug, Clone)]
pub struct Answer {
    /// When, virtual time.
    pub time: Time,
    /// What.
    pub what: Answered,
}

/// The kinds of answers.
#[derive(Debug, Clone)]
pub enum Answered {
    /// A frame, and what the arm reported with it.
    Frame(Box<RgbdFrame>, Feedback),
    /// What the arm reported.
    Moved(Feedback),
    /// The arm refused, in words.
    Refused(String),
    /// Time has passed.
    Waited,
    /// Something failed for good, in words.
    Broken(String),
}

/// A record that cannot be given again.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("message {seq} (`{kind}`) cannot be given again: {reason}")]
pub struct AnswerError {
    /// Number of the message.
    pub seq: u64,
    /// Its kind.
    pub kind: String,
    /// Why not.
    pub reason: String,
}

#[derive(Deserialize)]
struct FrameBody {
    header: FrameHeader,
    feedback: Feedback,
}

impl Answer {
    /// Reads what the host sent. `pixels` finds the colour and depth of a frame by its header.
    ///
    /// # Errors
    /// The body has another form, or the pixels of a frame are not there.
    pub fn read(
        record: Record,
        pixels: impl FnOnce(&FrameHeader) -> Option<(Vec<u8>, Vec<f32>)>,
    ) -> Result<Answer, AnswerError> {
        let Record { seq, kind, t, body, .. } = record;
        let failed = |reason: String| AnswerError { seq, kind: kind.clone(), reason };
        let words = |body: &Value| body.get("reason").and_then(Value::as_str).map(str::to_owned);
        let what = match kind.as_str() {
            "frame" => {
                let FrameBody { header, feedback } = form(body).map_err(failed)?;
                let missing = || failed("the trace does not keep the frame's pixels".into());
                let (color, depth) = pixels(&header).ok_or_else(missing)?;
                let (width, height) = (header.intrinsics.width, header.intrinsics.height);
                let count = width as usize * height as usize;
                if (color.len(), depth.len()) != (3 * count, count) {
                    return Err(failed(format!("the pixels that the trace keeps are not {width}x{height}")));
                }
                Answered::Frame(Box::new(RgbdFrame { header, color: color.into(), depth: depth.into() }), feedback)
            }
            "moved" => Answered::Moved(form(body).map_err(failed)?),
            "waited" => Answered::Waited,
            "refused" => Answered::Refused(words(&body).ok_or_else(|| failed("it has no reason".into()))?),
            "broken" => Answered::Broken(words(&body).ok_or_else(|| failed("it has no reason".into()))?),
            _ => return Err(failed("a host gives no such answer".into())),
        };
        Ok(Answer { time: Time(t), what })
    }
}

fn form<T: DeserializeOwned>(body: Value) -> Result<T, String> {
    serde_json::from_value(body).map_err(|error| error.to_string())
}

/// The world that gives the answers again. Asked for anything else than the recorded run asked for, it fails.
pub fn outside(robot: RobotDescription, cameras: Vec<CameraModel>, began: Time, answers: Vec<Answer>) -> Outside {
    let tape = Tape(Arc::new(Mutex::new(State { answers: answers.into(), now: began, felt: None })));
    Outside {
        embodiment: Box::new(RecordedRobot { robot, tape: tape.clone() }),
        cameras: Box::new(RecordedCameras { cameras, tape: tape.clone() }),
        clock: Box::new(tape),
    }
}

#[derive(Clone)]
struct Tape(Arc<Mutex<State>>);

struct State {
    answers: VecDeque<Answer>,
    now: Time,
    /// The report that came with a frame: the host asks for it next.
    felt: Option<Feedback>,
}

impl Tape {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
    fn next(&self) -> Option<Answered> {
        let mut state = self.state();
        let answer = state.answers.pop_front()?;
        state.now = answer.time;
        Some(answer.what)
    }
}

struct RecordedRobot {
    robot: RobotDescription,
    tape: Tape,
}

impl Embodiment for RecordedRobot {
    fn description(&self) -> &RobotDescription {
        &self.robot
    }
    fn feedback(&self) -> Feedback {
        let felt = self.tape.state().felt.take();
        felt.or_else(|| match self.tape.next() {
            Some(Answered::Moved(feedback)) => Some(feedback),
            // Not what was recorded: whoever compares the messages finds it.
            _ => None,
        })
        .unwrap_or_default()
    }
    fn command(&mut self, _: &Command) -> Result<Feedback, EmbodimentError> {
        match self.tape.next() {
            Some(Answered::Moved(feedback)) => Ok(feedback),
            Some(Answered::Refused(words)) => Err(refusal(&words)),
            Some(Answered::Broken(reason)) => Err(EmbodimentError::Failed { reason }),
            other => Err(EmbodimentError::Failed { reason: not_recorded("a command", other.as_ref()) }),
        }
    }
    fn stop(&mut self) {}
}

struct RecordedCameras {
    cameras: Vec<CameraModel>,
    tape: Tape,
}

impl CameraSource for RecordedCameras {
    fn cameras(&self) -> &[CameraModel] {
        &self.cameras
    }
    fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError> {
        let failed = |reason: String| CameraError::Failed { name: camera.into(), reason };
        match self.tape.next() {
            Some(Answered::Frame(frame, feedback)) => {
                self.tape.state().felt = Some(feedback);
                Ok(*frame)
            }
            Some(Answered::Broken(words)) => {
                // The words say already which camera it was.
                let told = failed(String::new()).to_string();
                Err(failed(words.strip_prefix(&told).unwrap_or(&words).into()))
            }
            other => Err(failed(not_recorded("a frame", other.as_ref()))),
        }
    }
}

impl Clock for Tape {
    fn now(&self) -> Time {
        self.state().now
    }
    fn wait_until(&mut self, _: Time) -> Result<Time, EmbodimentError> {
        match self.next() {
            Some(Answered::Waited) => Ok(self.state().now),
            Some(Answered::Broken(words)) | Some(Answered::Refused(words)) => Err(refusal(&words)),
            other => Err(EmbodimentError::Failed { reason: not_recorded("time to pass", other.as_ref()) }),
        }
    }
}

fn not_recorded(asked: &str, answer: Option<&Answered>) -> String {
    let came = match answer {
        None => "nothing",
        Some(Answered::Frame(..)) => "a frame",
        Some(Answered::Moved(_)) => "a report of the arm",
        Some(Answered::Refused(_)) => "a refusal",
        Some(Answered::Waited) => "time",
        Some(Answered::Broken(_)) => "a failure",
    };
    format!("the agent asked for {asked}, in the recorded run {came} came next")
}

/// The error that has these words.
fn refusal(words: &str) -> EmbodimentError {
    let reasoned: [fn(String) -> EmbodimentError; 3] = [
        |reason| EmbodimentError::Refused { reason },
        |reason| EmbodimentError::ProtectiveStop { reason },
        |reason| EmbodimentError::Failed { reason },
    ];
    let plain = [EmbodimentError::MotionDisabled, EmbodimentError::Stopped];
    let plain = plain.into_iter().find(|error| error.to_string() == words);
    let reasoned = || {
        reasoned.iter().find_map(|error| {
            let reason = words.strip_prefix(&error(String::new()).to_string())?;
            Some(error(reason.into()))
        })
    };
    plain.or_else(reasoned).unwrap_or_else(|| EmbodimentError::Failed { reason: words.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_read_back_from_its_words() {
        let reason = || "x = 2 m".to_owned();
        for error in [
            EmbodimentError::Refused { reason: reason() },
            EmbodimentError::MotionDisabled,
            EmbodimentError::Stopped,
            EmbodimentError::ProtectiveStop { reason: reason() },
            EmbodimentError::Failed { reason: reason() },
        ] {
            assert_eq!(refusal(&error.to_string()), error);
        }
    }

    #[test]
    fn a_record_of_another_form_is_named() {
        let record = |kind: &str, body: Value| Record {
            seq: 7,
            cause: Some(6),
            episode: 1,
            from: "host".into(),
            to: "executor".into(),
            kind: kind.into(),
            t: 5,
            body,
        };
        let read = |kind, body| Answer::read(record(kind, body), |_| None);
        assert!(read("waited", Value::Null).is_ok_and(|answer| answer.time == Time(5)));
        for (kind, body) in [("moved", serde_json::json!({"tcp": 1})), ("refused", Value::Null), ("begin", Value::Null)]
        {
            let error = read(kind, body).map(|_| ()).map_err(|error| error.to_string());
            assert!(error.is_err_and(|error| error.contains("message 7") && error.contains(kind)));
        }
    }
}
