//! Every message of the robot protocol. Fields that are not known are left out of account, so that a version can grow.

use acm_concept::{
    camera::FrameHeader,
    embodiment::{Command, EmbodimentError, Feedback, RobotDescription},
    task::TaskSpec,
    time::Time,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The version that this program speaks.
pub const VERSION: u32 = 1;

/// How the pixels of a frame travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Carrier {
    /// Through shared memory, by number.
    SharedMemory,
    /// As raw bytes behind the answer.
    Inline,
}

/// What the agent asks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
pub enum Ask {
    /// The first message: who is there, and what for?
    Hello {
        /// The version that the agent speaks.
        protocol: u32,
        /// The agent's name.
        agent: String,
        /// How frames may travel, best first.
        frames: Vec<Carrier>,
    },
    /// Take a frame now; time does not pass.
    Capture {
        /// The camera's name.
        camera: String,
        /// How its pixels shall travel.
        by: Carrier,
    },
    /// What does the arm measure now? Time does not pass.
    Feedback,
    /// Perform one control tick.
    Command {
        /// What to do.
        command: Command,
    },
    /// Let the world go on with the robot holding still.
    WaitUntil {
        /// Until when.
        time: Time,
    },
    /// Stop all motion at once.
    Stop,
    /// The agent is done or gives up: how does it stand?
    Done {
        /// The agent's report.
        report: Value,
    },
}

/// What the host answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "kebab-case")]
pub enum Answer {
    /// To a hello.
    Hello(Box<Welcome>),
    /// To a capture. The pixels follow this line, or lie in shared memory under the frame's number.
    Frame {
        /// All of the frame but its pixels.
        header: FrameHeader,
        /// Raw bytes that follow: colour, then depth as 32-bit floats, little endian. `None`: shared memory.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        bytes: Option<u64>,
    },
    /// To a feedback or a command.
    Feedback {
        /// What the arm measures.
        feedback: Feedback,
    },
    /// To a wait.
    Time {
        /// The moment reached.
        time: Time,
    },
    /// To a stop.
    Stopped,
    /// To a done.
    Verdict {
        /// The judge's, if there is a judge.
        verdict: Option<HostVerdict>,
    },
    /// What was asked is not done; the connection goes on.
    Refused {
        /// Why.
        why: Refusal,
        /// In words.
        reason: String,
    },
    /// What was said is not understood, or the host is taken; the connection ends.
    Error {
        /// In words.
        reason: String,
    },
}

/// The host's side of the hello.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Welcome {
    /// The version that the host speaks.
    pub protocol: u32,
    /// The host's name.
    pub host: String,
    /// The robot's geometry and limits.
    pub robot: RobotDescription,
    /// What is to be done, and the cameras with nominal calibration.
    pub task: TaskSpec,
    /// The world's clock.
    pub time: Time,
    /// What the arm measures.
    pub feedback: Feedback,
    /// How frames will travel.
    pub frames: Carrier,
    /// Name of the bus in shared memory, if they travel through it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bus: Option<String>,
}

/// Why something that was asked is not done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Refusal {
    /// The command leaves the robot's limits.
    Limits,
    /// Motion is switched off.
    MotionDisabled,
    /// A stop was commanded before.
    Stopped,
    /// The arm met something and stopped by itself.
    ProtectiveStop,
    /// The robot failed, or the camera.
    Failed,
}

impl Refusal {
    /// A robot's error as it is sent.
    pub fn of(error: &EmbodimentError) -> (Refusal, String) {
        match error {
            EmbodimentError::Refused { reason } => (Refusal::Limits, reason.clone()),
            EmbodimentError::MotionDisabled => (Refusal::MotionDisabled, error.to_string()),
            EmbodimentError::Stopped => (Refusal::Stopped, error.to_string()),
            EmbodimentError::ProtectiveStop { reason } => (Refusal::ProtectiveStop, reason.clone()),
            EmbodimentError::Failed { reason } => (Refusal::Failed, reason.clone()),
        }
    }
    /// The error that was sent.
    pub fn into_error(self, reason: String) -> EmbodimentError {
        match self {
            Refusal::Limits => EmbodimentError::Refused { reason },
            Refusal::MotionDisabled => EmbodimentError::MotionDisabled,
            Refusal::Stopped => EmbodimentError::Stopped,
            Refusal::ProtectiveStop => EmbodimentError::ProtectiveStop { reason },
            Refusal::Failed => EmbodimentError::Failed { reason },
        }
    }
}

/// How the host judges the episode.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HostVerdict {
    /// Whether the task is done.
    pub strict: bool,
    /// The same by a second, published standard, if there is one.
    pub faithful: Option<bool>,
    /// What had to be reached, in order, and whether each was.
    pub stages: Vec<(String, bool)>,
    /// What must not happen and did.
    pub violations: Vec<String>,
    /// One or two sentences.
    pub explanation: String,
}
