//! Which episodes are asked for.

use crate::cli::RmbenchArgs;
use acm_concept::task::OnUnknown;
use acm_sim::{Scenario, Setting};
use anyhow::{Context, bail};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, fmt, io::Read};

/// The folder of scenarios.
const SUITE: &str = "rmbench";
/// Its task that stands among the other scenarios.
const BESIDE: &str = "put-back-block";
/// Its task that has no published score.
const UNSCORED: &str = "place-block-mat";
/// How the variants with other layouts are named.
const JITTERED: &str = "-jittered";
/// Seeds of a block, if nothing is said.
const SEEDS: u64 = 100;
/// Seeds below this are worked on, those of the published block begin with the next one.
const PUBLISHED_FROM: u64 = 100_000;
const DEVELOPMENT: u64 = 10_000;

/// A block of seeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Block {
    /// From 0: those that the agent was worked on with.
    Development,
    /// From 100000: those with which the published scores were made.
    Published,
    /// Any others.
    Fresh,
}

impl Block {
    /// For tables.
    pub fn word(self) -> &'static str {
        match self {
            Block::Development => "development",
            Block::Published => "published",
            Block::Fresh => "fresh",
        }
    }
}

/// A memory, and what the agent does when it cannot decide.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Contender {
    /// The memory.
    pub method: String,
    /// Whether a candidate is drawn.
    pub guesses: bool,
}

impl Contender {
    /// The memory that the figures are about.
    pub fn whole() -> Contender {
        Contender { method: "acm".into(), guesses: false }
    }
    /// The setting of the agent.
    pub fn on_unknown(&self) -> OnUnknown {
        if self.guesses { OnUnknown::Guess } else { OnUnknown::Abstain }
    }
}

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.method, if self.guesses { " (guesses)" } else { "" })
    }
}

/// One episode that is asked for.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Job {
    /// The scenario.
    pub scenario: String,
    /// The memory.
    pub contender: Contender,
    /// Whether all frames are black.
    pub black: bool,
    /// The seed.
    pub seed: u64,
    /// The block that the seed is of.
    pub block: Block,
}

/// All of them.
#[derive(Debug)]
pub struct Plan {
    /// Tasks in their order, as scenarios with the published layout.
    pub tasks: Vec<String>,
    /// Memories in their order.
    pub contenders: Vec<Contender>,
    /// Blocks with their first seeds.
    pub blocks: Vec<(Block, u64)>,
    /// Seeds of each block.
    pub seeds: u64,
    /// Seeds of each task with black frames.
    pub black_frames: u64,
    /// Whether the variants with other layouts are run too.
    pub jittered: bool,
    /// Episodes at a time.
    pub workers: usize,
    /// The sensor profile.
    pub sensor: String,
    /// Another robot than the tasks' own.
    pub robot: Option<String>,
    /// What runs them: version and digest of this program.
    pub program: String,
    scenarios: BTreeMap<String, (Scenario, String)>,
}

/// The nine tasks that are scored, in the order of the published tables.
pub fn scored() -> Vec<String> {
    let mut tasks: Vec<String> = std::iter::once(BESIDE.into()).chain(Scenario::suite(SUITE)).collect();
    tasks.retain(|task| !task.ends_with(JITTERED) && task != UNSCORED);
    tasks.sort();
    tasks
}

impl Plan {
    /// Reads what is asked for.
    ///
    /// # Errors
    /// Something that is named does not exist.
    pub fn new(args: &RmbenchArgs) -> anyhow::Result<Plan> {
        let tasks = if args.tasks.is_empty() { scored() } else { args.tasks.clone() };
        let settings: Vec<Setting> = match &args.robot {
            Some(robot) => vec![format!("robot.model={robot}").parse().map_err(anyhow::Error::msg)?],
            None => Vec::new(),
        };
        let mut scenarios = BTreeMap::new();
        let names = tasks.iter().cloned().chain(tasks.iter().filter(|_| args.jittered).map(|task| jittered(task)));
        for name in names {
            let scenario = Scenario::open_with(&name, &settings)?;
            let digest = blake3::hash(format!("{scenario:?}").as_bytes()).to_hex();
            scenarios.insert(name, (scenario, digest.chars().take(16).collect()));
        }
        let methods: Vec<String> = match args.memories.is_empty() {
            true => acm_baselines::METHODS.map(str::to_owned).into(),
            false => args.memories.clone(),
        };
        let library = std::sync::Arc::new(acm_memory::whole_library()?);
        let mut contenders = Vec::new();
        for method in &methods {
            drop(acm_baselines::by_name(method, library.clone(), None, None)?);
            for arg in &args.on_unknown {
                let guesses = OnUnknown::from(*arg) == OnUnknown::Guess;
                contenders.push(Contender { method: method.clone(), guesses });
            }
        }
        let seeds = args.seeds.unwrap_or(if args.common.quick { SEEDS.div_ceil(10) } else { SEEDS });
        if seeds == 0 || tasks.is_empty() || contenders.is_empty() || args.blocks.is_empty() {
            bail!("nothing is asked for: name at least one task, memory, block and seed");
        }
        let first = |block: Block| match block {
            Block::Development => 0,
            Block::Published => PUBLISHED_FROM,
            Block::Fresh => args.fresh_from,
        };
        let blocks: Vec<(Block, u64)> = args.blocks.iter().map(|block| (*block, first(*block))).collect();
        if args.blocks.contains(&Block::Development) && seeds > DEVELOPMENT {
            bail!("--seeds {seeds}: the development block has {DEVELOPMENT} seeds");
        }
        if args.blocks.contains(&Block::Fresh) && args.fresh_from < PUBLISHED_FROM + SEEDS {
            bail!(
                "--fresh-from {}: fresh seeds are none of the other blocks': take {} or more",
                args.fresh_from,
                PUBLISHED_FROM + SEEDS
            );
        }
        let processors = std::thread::available_parallelism().map_or(2, usize::from);
        let own = scenarios.values().next().map_or("none", |(scenario, _)| scenario.sensor());
        Ok(Plan {
            sensor: args.sensor.clone().unwrap_or_else(|| own.to_owned()),
            contenders,
            blocks,
            seeds,
            black_frames: args.black_frames,
            jittered: args.jittered,
            workers: args.workers.unwrap_or(processors).clamp(1, 64),
            robot: args.robot.clone(),
            program: program()?,
            tasks,
            scenarios,
        })
    }

    /// A scenario with its digest.
    pub fn scenario(&self, name: &str) -> Option<(&Scenario, &str)> {
        self.scenarios.get(name).map(|(scenario, digest)| (scenario, digest.as_str()))
    }
    /// The robot, in words.
    pub fn robot_name(&self) -> &str {
        self.robot.as_deref().unwrap_or("of the tasks")
    }
    /// Layouts: as published, and jittered where that is asked for.
    pub fn layouts(&self) -> &'static [bool] {
        if self.jittered { &[false, true] } else { &[false] }
    }
    /// All episodes: seed by seed, so that what is interrupted has a little of everything.
    pub fn asked(&self) -> Vec<Job> {
        let mut jobs = Vec::new();
        for offset in 0..self.seeds.max(self.black_frames) {
            for (block, first) in &self.blocks {
                let job = |scenario: String, contender: &Contender, black| Job {
                    scenario,
                    contender: contender.clone(),
                    black,
                    seed: first + offset,
                    block: *block,
                };
                for task in &self.tasks {
                    for contender in self.contenders.iter().filter(|_| offset < self.seeds) {
                        jobs.push(job(task.clone(), contender, false));
                        jobs.extend(self.jittered.then(|| job(jittered(task), contender, false)));
                    }
                    if offset < self.black_frames && Some(block) == self.blocks.first().map(|(block, _)| block) {
                        jobs.push(job(task.clone(), &Contender::whole(), true));
                    }
                }
            }
        }
        jobs
    }
}

/// The name of a task's variant with other layouts.
pub fn jittered(task: &str) -> String {
    format!("{task}{JITTERED}")
}

/// The task of a scenario, and whether it is the variant.
pub fn task_of(scenario: &str) -> (&str, bool) {
    scenario.strip_suffix(JITTERED).map_or((scenario, false), |task| (task, true))
}

/// Version and digest of the running program: results of two programs are not mixed.
fn program() -> anyhow::Result<String> {
    let path = std::env::current_exe().context("this program does not know its own file")?;
    let mut file = std::fs::File::open(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    let (mut hasher, mut buffer) = (blake3::Hasher::new(), vec![0; 1 << 20]);
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            break;
        }
        hasher.update(&buffer[..count]);
    }
    Ok(format!("{} {}", env!("CARGO_PKG_VERSION"), hasher.finalize().to_hex().chars().take(16).collect::<String>()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nine_tasks_are_scored_and_have_a_variant() {
        assert_eq!(scored().len(), 9);
        for task in scored() {
            assert!(Scenario::open(&jittered(&task)).is_ok(), "{task}");
            assert_eq!(task_of(&jittered(&task)), (task.as_str(), true));
        }
        assert!(Scenario::open(UNSCORED).is_ok());
    }
}
