//! Rates with intervals, and means over tasks. The denominator is what was asked for: what crashed, or was not run, failed.

use super::{
    plan::{Block, Contender, Job, Plan, jittered, task_of},
    record::{Lived, Record},
};
use crate::statistics::wilson95;
use std::collections::{BTreeMap, BTreeSet};

/// The two of the nine tasks that the paper's table leaves out.
const NOT_IN_THE_PAPER: [&str; 2] = ["observe-and-pickup", "press-button"];

/// Episodes of one scenario with one memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Tally {
    /// The scenario.
    pub scenario: String,
    /// The memory.
    pub contender: Contender,
    /// The block.
    pub block: Block,
    /// Whether all frames were black.
    pub black: bool,
    /// Episodes that were asked for.
    pub asked: usize,
    /// Of them those that came to an end.
    pub lived: Vec<Lived>,
}

/// A proportion with its Wilson interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// The share.
    pub share: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Tallies in the order of the plan.
pub fn tallies(plan: &Plan, records: &BTreeMap<Job, Record>) -> Vec<Tally> {
    let mut tallies: BTreeMap<(usize, bool, Block, bool, usize), Tally> = BTreeMap::new();
    for job in plan.asked() {
        let (task, jitter) = task_of(&job.scenario);
        let at = plan.tasks.iter().position(|known| known == task).unwrap_or(usize::MAX);
        let by = plan.contenders.iter().position(|known| *known == job.contender).unwrap_or(usize::MAX);
        let tally = tallies.entry((at, jitter, job.block, job.black, by)).or_insert_with(|| Tally {
            scenario: job.scenario.clone(),
            contender: job.contender.clone(),
            block: job.block,
            black: job.black,
            asked: 0,
            lived: Vec::new(),
        });
        tally.asked += 1;
        let outcome = records.get(&job).map(|record| &record.outcome);
        tally.lived.extend(outcome.and_then(|outcome| outcome.as_ref().ok()).cloned());
    }
    tallies.into_values().collect()
}

/// The share of episodes with black frames that were solved; `None` without such.
pub fn black_frames(tallies: &[Tally]) -> Option<f64> {
    let black = tallies.iter().filter(|tally| tally.black);
    let (solved, asked) =
        black.fold((0, 0), |(solved, asked), tally| (solved + tally.count(|e| e.solved), asked + tally.asked));
    (asked > 0).then(|| solved as f64 / asked as f64)
}

impl Tally {
    /// The memory, and whether it was blinded.
    pub fn name(&self) -> String {
        format!("{}{}", self.contender, if self.black { ", black frames" } else { "" })
    }
    /// How many fulfil a test.
    pub fn count(&self, test: impl Fn(&Lived) -> bool) -> usize {
        self.lived.iter().filter(|episode| test(episode)).count()
    }
    /// The share of what was asked for that fulfils a test.
    pub fn rate(&self, test: impl Fn(&Lived) -> bool) -> Rate {
        let hits = self.count(test);
        let (low, high) = wilson95(hits, self.asked);
        Rate { share: hits as f64 / self.asked.max(1) as f64, low, high }
    }
    /// The mean over those that came to an end.
    pub fn mean(&self, value: impl Fn(&Lived) -> f64) -> f64 {
        self.lived.iter().map(value).sum::<f64>() / self.lived.len().max(1) as f64
    }
    /// Whether the scenario has the published checker's predicate.
    pub fn is_faithful_judged(&self) -> bool {
        self.lived.iter().any(|episode| episode.faithful.is_some())
    }
    /// The share of things seen again that had their old identity; `None` where nothing was.
    pub fn known_again(&self) -> Option<f64> {
        let sum = |value: fn(&Lived) -> u32| self.lived.iter().map(value).sum::<u32>();
        let seen = sum(|e| e.seen_again);
        (seen > 0).then(|| f64::from(sum(|e| e.known_again)) / f64::from(seen))
    }
    /// Different start worlds.
    pub fn worlds(&self) -> usize {
        self.lived.iter().map(|episode| &episode.world).collect::<BTreeSet<_>>().len()
    }
    /// All of it, by name.
    pub fn values(&self) -> Vec<(&'static str, f64)> {
        let strict = self.rate(|e| e.solved);
        let mut values = vec![
            ("asked", self.asked as f64),
            ("not_run", (self.asked - self.lived.len()) as f64),
            ("strict", strict.share),
            ("strict_low", strict.low),
            ("strict_high", strict.high),
            ("decided", self.rate(|e| e.decided).share),
            ("false_success", self.rate(|e| e.false_success).share),
            ("gave_up", self.rate(|e| e.gave_up).share),
            ("steps", self.mean(|e| f64::from(e.steps))),
            ("in_vain", self.mean(|e| f64::from(e.in_vain))),
            ("simulated_s", self.mean(|e| e.simulated_s)),
            ("wall_s", self.mean(|e| e.wall_s)),
            ("frames", self.mean(|e| f64::from(e.frames))),
            ("inspected", self.mean(|e| f64::from(e.inspected))),
            ("memory_bytes", self.mean(|e| e.memory_bytes as f64).round()),
            ("worlds", self.worlds() as f64),
        ];
        if self.is_faithful_judged() {
            let faithful = self.rate(|e| e.faithful == Some(true));
            values.extend([
                ("faithful", faithful.share),
                ("faithful_low", faithful.low),
                ("faithful_high", faithful.high),
            ]);
            values.push(("exploit", self.rate(|e| e.faithful == Some(true) && !e.strict).share));
        }
        values.extend(self.known_again().map(|share| ("known_again", share)));
        values
    }
}

/// Means over tasks, each task counting the same.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Averages {
    /// How many tasks.
    pub tasks: usize,
    /// Episodes asked for.
    pub asked: usize,
    /// Strict success.
    pub strict: f64,
    /// Success by the published checker; NaN where a task has none.
    pub faithful: f64,
    /// The same two over the paper's seven tasks.
    pub strict7: f64,
    /// See `strict7`.
    pub faithful7: f64,
    /// Right decisions.
    pub decided: f64,
    /// False claims of success, pooled over all episodes.
    pub false_success: f64,
    /// Give-ups, pooled.
    pub gave_up: f64,
    /// The lower end of the worst task's interval, strict.
    pub worst_low: f64,
    /// Frames perceived, over all episodes.
    pub frames: f64,
    /// Wall seconds, over all episodes.
    pub wall_s: f64,
}

impl Averages {
    /// Of one memory over one block and layout.
    pub fn of(tallies: &[Tally], contender: &Contender, block: Block, jitter: bool) -> Averages {
        let meant = |tally: &&Tally| {
            let layout = task_of(&tally.scenario).1 == jitter;
            layout && !tally.black && tally.block == block && tally.contender == *contender
        };
        let of_them: Vec<&Tally> = tallies.iter().filter(meant).collect();
        let all: Vec<&Tally> = of_them.iter().copied().filter(|tally| counts(tally)).collect();
        let in_paper = |tally: &&&Tally| !NOT_IN_THE_PAPER.contains(&task_of(&tally.scenario).0);
        let seven: Vec<&Tally> = all.iter().filter(in_paper).copied().collect();
        let mean =
            |of: &[&Tally], value: fn(&Tally) -> f64| of.iter().map(|t| value(t)).sum::<f64>() / of.len().max(1) as f64;
        let strict = |tally: &Tally| tally.rate(|e| e.solved).share;
        let faithful = |tally: &Tally| match tally.is_faithful_judged() {
            true => tally.rate(|e| e.faithful == Some(true)).share,
            false => f64::NAN,
        };
        let pooled = |value: fn(&Lived) -> f64| {
            let episodes = all.iter().flat_map(|tally| &tally.lived);
            episodes.map(value).sum::<f64>()
        };
        let asked: usize = all.iter().map(|tally| tally.asked).sum();
        let lived: usize = all.iter().map(|tally| tally.lived.len()).sum();
        Averages {
            tasks: all.len(),
            asked,
            strict: mean(&all, strict),
            faithful: mean(&all, faithful),
            strict7: if seven.len() == 7 { mean(&seven, strict) } else { f64::NAN },
            faithful7: if seven.len() == 7 { mean(&seven, faithful) } else { f64::NAN },
            decided: mean(&all, |tally| tally.rate(|e| e.decided).share),
            false_success: pooled(|e| f64::from(u8::from(e.false_success))) / asked.max(1) as f64,
            gave_up: pooled(|e| f64::from(u8::from(e.gave_up))) / asked.max(1) as f64,
            worst_low: all.iter().map(|tally| tally.rate(|e| e.solved).low).fold(1.0, f64::min),
            frames: pooled(|e| f64::from(e.frames)) / lived.max(1) as f64,
            wall_s: pooled(|e| e.wall_s) / lived.max(1) as f64,
        }
    }
    /// Those that are numbers, by name.
    pub fn values(&self) -> Vec<(&'static str, f64)> {
        let values = [
            ("tasks", self.tasks as f64),
            ("asked", self.asked as f64),
            ("strict_mean", self.strict),
            ("faithful_mean", self.faithful),
            ("strict_mean7", self.strict7),
            ("faithful_mean7", self.faithful7),
            ("decided_mean", self.decided),
            ("false_success", self.false_success),
            ("gave_up", self.gave_up),
            ("worst_task_wilson_lower", self.worst_low),
            ("frames", self.frames),
            ("wall_s", self.wall_s),
        ];
        values.into_iter().filter(|(_, value)| value.is_finite()).collect()
    }
}

/// Whether a tally is of one of the nine tasks, which alone are averaged; of all where none of them was run.
fn counts(tally: &Tally) -> bool {
    let scored = super::plan::scored();
    scored.contains(&tally.scenario) || scored.iter().any(|task| jittered(task) == tally.scenario)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "shares of small counts are exact enough to be equal")]
    use super::*;

    fn lived(solved: bool, faithful: Option<bool>) -> Lived {
        Lived {
            solved,
            strict: solved,
            faithful,
            decided: solved,
            false_success: !solved,
            gave_up: false,
            ending: String::new(),
            judge: String::new(),
            steps: 4,
            in_vain: 1,
            simulated_s: 20.0,
            wall_s: 6.0,
            frames: 9,
            inspected: 0,
            seen_again: 4,
            known_again: 3,
            memory_bytes: 100,
            world: "w".into(),
        }
    }
    fn tally(scenario: &str, solved: usize, asked: usize) -> Tally {
        Tally {
            scenario: scenario.into(),
            contender: Contender::whole(),
            block: Block::Published,
            black: false,
            asked,
            lived: (0..solved).map(|_| lived(true, Some(true))).chain([lived(false, Some(true))]).collect(),
        }
    }
    fn value(tally: &Tally, name: &str) -> f64 {
        tally.values().into_iter().find(|(known, _)| *known == name).map_or(f64::NAN, |(_, value)| value)
    }

    #[test]
    fn what_was_not_run_counts_as_a_failure() {
        let tally = tally("swap-t", 6, 10);
        assert_eq!([value(&tally, "strict"), value(&tally, "not_run"), value(&tally, "exploit")], [0.6, 3.0, 0.1]);
        assert_eq!(
            [value(&tally, "faithful"), value(&tally, "known_again"), value(&tally, "worlds")],
            [0.7, 0.75, 1.0]
        );
        let (low, high) = wilson95(6, 10);
        assert_eq!([value(&tally, "strict_low"), value(&tally, "strict_high")], [low, high]);
    }

    #[test]
    fn every_task_counts_the_same_and_false_claims_are_pooled() {
        let tallies = [tally("swap-t", 9, 10), tally("press-button", 4, 40), tally("place-block-mat", 0, 5)];
        let averages = Averages::of(&tallies, &Contender::whole(), Block::Published, false);
        assert_eq!((averages.tasks, averages.asked), (2, 50), "the unscored task is not averaged");
        assert!((averages.strict - 0.5).abs() < 1e-12 && (averages.false_success - 0.04).abs() < 1e-12);
        assert!((averages.worst_low - wilson95(4, 40).0).abs() < 1e-12);
        assert!(averages.strict7.is_nan(), "there are not seven of the paper's tasks");
    }
}
