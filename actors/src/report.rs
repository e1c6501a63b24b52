//! What an episode came to.

use crate::episode::Until;
use acm_concept::{ids::ObjectId, skill::FailureCause, time::Time};
use acm_llm::{Fault, Usage};
use acm_memory::observation::Outcome;
use acm_planner::GiveUpCause;
use serde::Serialize;
use std::fmt;

/// How an episode ended, from the agent's side. Whether it was right is for the judge to say.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// The agent holds the task to be done.
    Done,
    /// The agent gave up and says what it does not know or cannot do.
    GaveUp {
        /// The kind of reason that it names.
        cause: GiveUpCause,
        /// In words.
        unknown: String,
    },
    /// The instruction cannot be read.
    NotUnderstood {
        /// Which words, and why.
        reason: String,
    },
    /// The event has come at which the run was to end, and nothing more was asked for.
    Until {
        /// The event.
        event: Until,
    },
    /// The user or the host ended it.
    Interrupted,
    /// An actor or the outside world failed for good.
    Broken {
        /// What.
        reason: String,
    },
}

impl fmt::Display for Ending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Ending::Done => f.write_str("done"),
            Ending::GaveUp { unknown, .. } => write!(f, "gave up: {unknown}"),
            Ending::NotUnderstood { reason } => write!(f, "not understood: {reason}"),
            Ending::Until { event: Until::Instruction } => {
                f.write_str("the instruction would be given now, and the run ends here as asked")
            }
            Ending::Interrupted => f.write_str("interrupted"),
            Ending::Broken { reason } => write!(f, "broken: {reason}"),
        }
    }
}

/// One skill that was run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepRecord {
    /// The subtask it served, from 0.
    pub subtask: u32,
    /// Skill name.
    pub skill: String,
    /// The object acted on.
    pub object: ObjectId,
    /// 0 for the first try.
    pub attempt: u32,
    /// Whether a candidate was drawn where memory could not decide.
    pub guessed: bool,
    /// When the skill ended.
    pub ended: Time,
    /// The controller's own failure.
    pub failure: Option<(FailureCause, String)>,
    /// The verifier's answer, once there is one.
    pub outcome: Option<Outcome>,
    /// Entries scored by the retrievals behind the step (retrieval effort a).
    pub entries_scored: u32,
    /// Candidates handed on until one was accepted (retrieval effort b).
    pub candidates_inspected: u32,
}

/// What a language model had to do with how an instruction was read.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Reading {
    /// How often it was asked.
    pub calls: u32,
    /// The kind of backend that answered last, and its model; `None` where none answered.
    pub answered_by: Option<(String, String)>,
    /// What all replies cost.
    pub usage: Usage,
    /// What was wrong with the replies that were asked for again, and with the last one if it stayed so.
    pub faults: Vec<Fault>,
    /// Why the rules have read the instruction instead; `None` where the model has.
    pub fallback: Option<String>,
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (backend, model) = self.answered_by.as_ref().map_or(("", ""), |(backend, model)| (backend, model));
        match &self.fallback {
            None => write!(f, "read by the model {model} ({backend})")?,
            Some(reason) => write!(f, "READ BY RULES INSTEAD OF THE MODEL: {reason}")?,
        }
        let calls = if self.calls == 1 { "call" } else { "calls" };
        write!(f, "; {} {calls}, {}", self.calls, self.usage)
    }
}

/// What a language model had to do with a decision.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Counsel {
    /// What it was asked for: `select` or `reflect`.
    pub stage: &'static str,
    /// How it was asked; under `fallback` why the planner has decided by itself.
    #[serde(flatten)]
    pub asked: Reading,
    /// Why it chose so, in its own words.
    pub reason: Option<String>,
}

impl fmt::Display for Counsel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counsel { stage, asked, reason } = self;
        match (&asked.fallback, &asked.answered_by) {
            (Some(why), _) => write!(f, "{stage}: DECIDED BY THE PLANNER INSTEAD OF THE MODEL: {why}"),
            (None, Some((backend, model))) => {
                write!(f, "{stage}: chosen by the model {model} ({backend}): {}", reason.as_deref().unwrap_or_default())
            }
            (None, None) => write!(f, "{stage}: chosen by nobody"),
        }
    }
}

/// An episode from the agent's side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EpisodeReport {
    /// How it ended.
    pub ending: Ending,
    /// The skills that were run, in order.
    pub steps: Vec<StepRecord>,
    /// Instructions found done.
    pub instructions_done: u32,
    /// Subtasks of the last instruction that are done.
    pub subtasks_done: u32,
    /// Subtasks of the instruction; 0 if it was not understood.
    pub subtasks: u32,
    /// Frames that were perceived.
    pub frames_perceived: u32,
    /// Virtual time at the end.
    pub ended: Time,
    /// Actors that failed and were restarted.
    pub restarts: u32,
    /// How a language model read each instruction; empty where none was used.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub readings: Vec<Reading>,
    /// How a language model took part in decisions; empty where none did.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub counsels: Vec<Counsel>,
}

impl EpisodeReport {
    /// The kind of failure to blame, from the agent's side: what it named when giving up, else the last step that
    /// failed.
    pub fn cause(&self) -> Option<GiveUpCause> {
        match &self.ending {
            Ending::GaveUp { cause, .. } => Some(*cause),
            _ => self.steps.iter().rev().find_map(|step| step.failure.as_ref().map(|(cause, _)| (*cause).into())),
        }
    }
}
