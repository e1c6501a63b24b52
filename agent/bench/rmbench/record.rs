//! What is kept of one episode.

use super::{
    follow::Followed,
    plan::{Block, Contender, Job},
};
use crate::episode::EpisodeResult;
use acm_actors::report::Ending;
use acm_memory::observation::Outcome;
use acm_planner::GiveUpCause;
use serde::{Deserialize, Serialize};

/// Words of violations that say what the hand did and not what was decided.
const OF_THE_HAND: [&str; 2] = ["displaced", "fell off"];

/// One line of the file of results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// The scenario.
    pub scenario: String,
    /// Its digest: of all that is in its file, with the robot.
    pub digest: String,
    /// The seed.
    pub seed: u64,
    /// The block that the seed is of.
    pub block: Block,
    /// The memory.
    pub method: String,
    /// Whether a candidate is drawn where it cannot decide.
    pub guesses: bool,
    /// Whether all frames were black.
    pub black: bool,
    /// What came of it.
    pub outcome: Result<Lived, String>,
}

/// What came of an episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lived {
    /// The agent says done and the strict predicate holds.
    pub solved: bool,
    /// The strict predicate holds.
    pub strict: bool,
    /// The published checker's semantics; `None` where there are none.
    pub faithful: Option<bool>,
    /// What was decided was right: see [`decided`].
    pub decided: bool,
    /// The agent says done and the strict predicate does not hold.
    pub false_success: bool,
    /// The agent gave up and said why.
    pub gave_up: bool,
    /// How it ended, in the agent's words, and what the judge says.
    pub ending: String,
    /// See `ending`.
    pub judge: String,
    /// Skills that were run.
    pub steps: u32,
    /// Those of them that did not do what they should, or of which that could not be told.
    pub in_vain: u32,
    /// Simulated seconds.
    pub simulated_s: f64,
    /// Wall seconds, on a machine that does other things too.
    pub wall_s: f64,
    /// Frames perceived.
    pub frames: u32,
    /// Candidates handed on until one was accepted.
    pub inspected: u32,
    /// Things seen again after they were out of sight or had moved, and how many of them had their old identity.
    pub seen_again: u32,
    /// See `seen_again`.
    pub known_again: u32,
    /// What memory held at the end, as JSON, bytes.
    pub memory_bytes: u64,
    /// Equal for equal start worlds.
    pub world: String,
}

impl Record {
    /// A record of a job.
    pub fn new(job: &Job, digest: &str, outcome: Result<Lived, String>) -> Record {
        Record {
            scenario: job.scenario.clone(),
            digest: digest.into(),
            seed: job.seed,
            block: job.block,
            method: job.contender.method.clone(),
            guesses: job.contender.guesses,
            black: job.black,
            outcome,
        }
    }
    /// What it is the record of.
    pub fn job(&self) -> Job {
        Job {
            scenario: self.scenario.clone(),
            contender: Contender { method: self.method.clone(), guesses: self.guesses },
            black: self.black,
            seed: self.seed,
            block: self.block,
        }
    }
}

impl Lived {
    /// Reads an episode.
    pub fn new(result: &EpisodeResult, followed: &Followed) -> Lived {
        let report = &result.report;
        let in_vain = report.steps.iter().filter(|step| step.outcome != Some(Outcome::Verified));
        Lived {
            solved: result.solved,
            strict: result.verdict.strict,
            faithful: result.verdict.faithful,
            decided: decided(result),
            false_success: result.false_success,
            gave_up: matches!(report.ending, Ending::GaveUp { .. }),
            ending: report.ending.to_string(),
            judge: result.verdict.explanation.clone(),
            steps: report.steps.len() as u32,
            in_vain: in_vain.count() as u32,
            simulated_s: report.ended.seconds(),
            wall_s: result.wall_s,
            frames: report.frames_perceived,
            inspected: report.steps.iter().map(|step| step.candidates_inspected).sum(),
            seen_again: followed.seen_again,
            known_again: followed.known_again,
            memory_bytes: followed.memory_bytes,
            world: result.world.clone(),
        }
    }
}

/// Whether what was decided was right, whatever the hand made of it. Read off the judge's records and the agent's ending:
/// the strict predicate holds; or no object was taken, put or pressed against the rules and the agent ended without claiming
/// success, for a reason of its hand: grasping, placing, pressing, moving. A claim that is false counts as a wrong decision,
/// also where the hand missed by a little, and so does every other end, giving up for what is not known among them.
pub fn decided(result: &EpisodeResult) -> bool {
    let of_the_hand = |violation: &String| OF_THE_HAND.iter().any(|words| violation.contains(words));
    let against_rules = result.verdict.violations.iter().any(|violation| !of_the_hand(violation));
    let hand = |cause: GiveUpCause| {
        matches!(cause, GiveUpCause::Grasp | GiveUpCause::Place | GiveUpCause::Press | GiveUpCause::Motion)
    };
    let stopped_by_hand = matches!(&result.report.ending, Ending::GaveUp { cause, .. } if hand(*cause));
    result.verdict.strict || (stopped_by_hand && !against_rules)
}
