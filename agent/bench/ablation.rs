//! `acm bench ablation`: the same episodes with one language model after another, and with one that errs at a given rate.
//!
//! Every backend gets the same scenarios and seeds. A model is asked for what `--llm-stages` says; everything else is the
//! same planner, memory and robot.

mod degraded;

use crate::{
    bench::{BenchResult, Row, progress},
    cli::AblationArgs,
    config,
    episode::{EpisodeConfig, EpisodeResult, Runner},
    llm::Llm,
    statistics::{median_and, wilson95},
};
use acm_actors::{report::Reading, settings::Stage};
use acm_llm::{Backend, ChatRequest, Fault, Reply};
use acm_planner::Planner;
use acm_runtime::journal::NoJournal;
use acm_sim::Scenario;
use anyhow::{Context, bail};
use degraded::Degraded;
use std::{
    sync::{Arc, Mutex, PoisonError},
    time::Instant,
};

/// Episodes of each scenario and backend, if nothing is said.
const EPISODES: u64 = 10;
/// Shares of wrong answers, if nothing is said.
const RATES: [f64; 4] = [0.0, 0.1, 0.3, 0.6];

/// Measures each backend, then each rate of errors.
///
/// # Errors
/// A scenario or a backend is not there, or an episode could not be run.
pub fn measure(args: &AblationArgs) -> anyhow::Result<BenchResult> {
    let (_, config) = config::open(args.config.as_deref())?;
    let stages = args.llm_stages.clone().unwrap_or_else(|| vec![Stage::Parse]);
    // Opened first: a missing key must not cost the episodes of the others.
    let mut models = Vec::new();
    for id in &args.backends {
        models.push((id.to_string(), Llm::open(id, &config.llm, Some(&stages))?));
    }
    let scenarios = scenarios(args)?;
    let runner = Runner::new()?;
    runner.end_on_ctrl_c();
    let mut result = BenchResult::new("ablation", "each scenario's own");
    let count = args.common.episodes.map_or(EPISODES, |count| count as u64);
    result.seeds = vec![args.seed_from, args.seed_from + count.max(1) - 1];
    for (name, llm) in models {
        let config = EpisodeConfig { method: args.method.clone(), llm, stages: stages.clone(), ..Default::default() };
        let tally = Trial { runner: &runner, scenarios: &scenarios, args, count }.run(&name, &config)?;
        result.rows.push(tally.row(&name, "backend"));
        result.figure(&format!("success_{name}"), tally.share(|e| e.solved));
    }
    let rates: &[f64] = if args.no_degradation { &[] } else { args.rates.as_deref().unwrap_or(&RATES) };
    for rate in rates {
        if !(0.0..=1.0).contains(rate) {
            bail!("--rates {rate}: a share is within 0..1");
        }
        for (method, llm_alone) in [(args.method.as_str(), false), (args.method.as_str(), true), ("reactive", false)] {
            let made = degraded(*rate, args.seed_from)?;
            let config = EpisodeConfig {
                method: method.into(),
                llm: Some(made),
                stages: stages.clone(),
                llm_alone,
                ..EpisodeConfig::default()
            };
            let alone = if llm_alone { ", left alone" } else { "" };
            let name = format!("{:.0} % wrong, {method}{alone}", 100.0 * rate);
            let tally = Trial { runner: &runner, scenarios: &scenarios, args, count }.run(&name, &config)?;
            result.rows.push(tally.row(&name, "degraded"));
        }
    }
    let names: Vec<&str> = scenarios.iter().map(Scenario::name).collect();
    result.notes.push(format!("scenarios: {}", names.join(", ")));
    result.notes.push("a degraded model answers as the rules would, and errs in the given share of its answers".into());
    Ok(result)
}

fn scenarios(args: &AblationArgs) -> anyhow::Result<Vec<Scenario>> {
    let names = if args.scenarios.is_empty() { Scenario::names() } else { args.scenarios.clone() };
    names.iter().map(|name| Ok(Scenario::open(name)?)).collect()
}

/// A model that errs at this rate, each episode with draws of its own.
fn degraded(rate: f64, seed: u64) -> anyhow::Result<Llm> {
    let (planner, library) = (Planner::new()?, Arc::new(acm_memory::default_library()?));
    let episodes = Mutex::new(seed);
    Ok(Llm::made(move || {
        let mut seed = episodes.lock().unwrap_or_else(PoisonError::into_inner);
        *seed += 1;
        Arc::new(Degraded::new(planner.clone(), Arc::clone(&library), rate, *seed))
    }))
}

struct Trial<'a> {
    runner: &'a Runner,
    scenarios: &'a [Scenario],
    args: &'a AblationArgs,
    count: u64,
}

impl Trial<'_> {
    fn run(&self, name: &str, config: &EpisodeConfig) -> anyhow::Result<Tally> {
        let mut tally = Tally::default();
        let bar = progress(name, self.count * self.scenarios.len() as u64);
        let waits = Arc::clone(&tally.waits_ms);
        let llm = config
            .llm
            .clone()
            .map(|llm| Llm::made(move || Arc::new(Metered { model: llm.backend(), waits_ms: Arc::clone(&waits) })));
        let config = EpisodeConfig { llm, ..config.clone() };
        for scenario in self.scenarios {
            for seed in self.args.seed_from..self.args.seed_from + self.count {
                let episode = self.runner.run(scenario, seed, &config, Arc::new(NoJournal));
                let episode = episode.with_context(|| format!("{} seed {seed}", scenario.name()))?;
                tally.episodes.push(episode);
                bar.inc(1);
            }
        }
        bar.finish_and_clear();
        Ok(tally)
    }
}

/// A model whose calls are timed.
struct Metered {
    model: Arc<dyn Backend>,
    waits_ms: Arc<Mutex<Vec<f64>>>,
}

impl Backend for Metered {
    #[expect(clippy::disallowed_methods, reason = "a bench measures wall time")]
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a> {
        Box::pin(async move {
            let began = Instant::now();
            let answer = self.model.chat(request).await;
            let waited = 1000.0 * began.elapsed().as_secs_f64();
            self.waits_ms.lock().unwrap_or_else(PoisonError::into_inner).push(waited);
            answer
        })
    }
}

/// Episodes of one backend.
#[derive(Default)]
struct Tally {
    episodes: Vec<EpisodeResult>,
    waits_ms: Arc<Mutex<Vec<f64>>>,
}

impl Tally {
    fn share(&self, test: impl Fn(&EpisodeResult) -> bool) -> f64 {
        self.episodes.iter().filter(|episode| test(episode)).count() as f64 / self.episodes.len().max(1) as f64
    }

    /// Everything that a model was asked.
    fn asked(&self) -> impl Iterator<Item = &Reading> {
        self.episodes.iter().flat_map(|episode| {
            let report = &episode.report;
            report.readings.iter().chain(report.counsels.iter().map(|counsel| &counsel.asked))
        })
    }

    fn row(&self, name: &str, group: &str) -> Row {
        let solved = self.episodes.iter().filter(|episode| episode.solved).count();
        let (low, high) = wilson95(solved, self.episodes.len());
        let mut values = vec![
            ("episodes", self.episodes.len() as f64),
            ("success", self.share(|e| e.solved)),
            ("success_low", low),
            ("success_high", high),
            ("false_success", self.share(|e| e.false_success)),
            ("skills_per_episode", self.mean(|e| e.report.steps.len() as f64)),
        ];
        let (questions, calls) = (self.asked().count(), self.asked().map(|r| r.calls).sum::<u32>());
        if calls > 0 {
            let faults =
                |test: fn(&Fault) -> bool| self.asked().flat_map(|r| &r.faults).filter(|f| test(f)).count() as f64;
            let malformed = faults(|fault| matches!(fault, Fault::Malformed(_) | Fault::Schema(_) | Fault::Truncated));
            let ungrounded = faults(|fault| matches!(fault, Fault::Ungrounded(_)));
            let replies = (f64::from(calls) - self.asked().filter(|r| lost(r)).count() as f64).max(1.0);
            let refused = faults(|fault| matches!(fault, Fault::Refused));
            let formed = (replies - malformed - refused).max(0.0);
            let waits = self.waits_ms.lock().unwrap_or_else(PoisonError::into_inner);
            let (p50, p95) = median_and(0.95, &waits);
            values.extend([
                ("questions", questions as f64),
                ("schema_valid", formed / replies),
                ("groundable", (formed - ungrounded).max(0.0) / formed.max(1.0)),
                ("repairs_per_question", (f64::from(calls) - questions as f64) / questions.max(1) as f64),
                (
                    "decided_by_rules",
                    self.asked().filter(|r| r.fallback.is_some()).count() as f64 / questions.max(1) as f64,
                ),
                ("tokens_in", self.asked().map(|r| r.usage.input as f64).sum()),
                ("tokens_out", self.asked().map(|r| r.usage.output as f64).sum()),
                ("latency_p50_ms", p50),
                ("latency_p95_ms", p95),
            ]);
        }
        Row { group: Some(group.into()), ..Row::new(name, values) }
    }

    fn mean(&self, value: impl Fn(&EpisodeResult) -> f64) -> f64 {
        self.episodes.iter().map(value).sum::<f64>() / self.episodes.len().max(1) as f64
    }
}

/// Whether the last call of a question gave no reply: then there is a fallback that no fault explains.
fn lost(reading: &Reading) -> bool {
    reading.fallback.is_some() && reading.faults.len() < reading.calls as usize
}
