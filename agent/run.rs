//! `acm run`: one episode told, or a range of seeds counted.

use crate::{
    cli::{Exit, RunArgs},
    config::{self, Config},
    episode::{EpisodeConfig, EpisodeResult, Runner},
    inject::Faults,
    live::Live,
    llm::{self, Llm, LlmId},
    narrate::Narrator,
    remote,
    statistics::{median_and, wilson95},
    trace::recording::TraceRequest,
    video::{Camera, VideoFile},
};
use acm_actors::{message::Message, report::Ending, settings::Stage};
use acm_concept::{task::OnUnknown, template::TemplateLibrary};
use acm_runtime::journal::{Both, Journal, NoJournal};
use acm_sim::Scenario;
use anyhow::bail;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    io::Write,
    sync::Arc,
};

/// Runs `acm run`.
pub fn run(args: &RunArgs) -> anyhow::Result<Exit> {
    let Some(scenario) = &args.scenario else { return remote::run(args) };
    let scenario = Scenario::open_with(scenario, &args.set)?;
    let video = args.video.as_deref().map(|path| VideoFile::create(path, args.seed.range)).transpose()?;
    let (config, library) = prepare(args)?;
    let runner = Runner::with_library(library)?;
    runner.end_on_ctrl_c();
    match args.seed.range {
        false => one(&runner, &scenario, args, &config, video),
        true => many(&runner, &scenario, args, &config),
    }
}

/// Reads what a run needs beside its world.
pub(crate) fn prepare(args: &RunArgs) -> anyhow::Result<(EpisodeConfig, TemplateLibrary)> {
    let (file, config) = config::open(args.config.as_deref())?;
    if let Some((field, _)) = config.settings.tools.named().next() {
        let file = file.unwrap_or_default();
        let file = file.display();
        bail!("{file}: tools.{field}: a run asks no tools, as it could not be replayed; they help `acm perceive`");
    }
    prepare_with(args, config)
}

/// As [`prepare`], whatever files say.
pub(crate) fn prepare_with(args: &RunArgs, config: Config) -> anyhow::Result<(EpisodeConfig, TemplateLibrary)> {
    let Config { mut settings, llm } = config;
    settings.on_unknown = args.on_unknown.map_or(settings.on_unknown, Into::into);
    let id = llm::chosen(args.llm.as_ref(), &llm);
    let llm = Llm::open(&id, &llm, args.llm_stages.as_deref())?;
    let asked = llm.as_ref().and_then(Llm::first).map_or(id, LlmId::Backend);
    let said = || args.llm_stages.clone().unwrap_or_else(|| vec![Stage::Parse]);
    let stages = llm.as_ref().and_then(Llm::stages).unwrap_or_else(said);
    let config = EpisodeConfig {
        method: args.method.clone(),
        settings,
        instruction: args.instruction.clone(),
        memory: args.memory.clone(),
        faults: Faults::new(&args.inject),
        no_motion: args.no_motion,
        sensor: args.sensor.clone(),
        until: args.until,
        llm,
        arguments: args.words(&asked, &stages),
        stages,
        ..EpisodeConfig::default()
    };
    let library = match &args.library {
        Some(dir) => acm_memory::library_from_dir(dir)?,
        None => acm_memory::whole_library()?,
    };
    // A misspelt method or a memory that cannot be opened must not cost the start of the renderer.
    drop(acm_baselines::by_name(&config.method, Arc::new(library.clone()), config.memory.as_deref(), None)?);
    if let Some((donor, _)) = &config.faults.transplant {
        drop(acm_memory::read_events(donor)?);
    }
    Ok((config, library))
}

fn one(
    runner: &Runner,
    scenario: &Scenario,
    args: &RunArgs,
    config: &EpisodeConfig,
    video: Option<VideoFile>,
) -> anyhow::Result<Exit> {
    let config = traced(scenario.name(), args, config, args.seed.first);
    let live = args.live.then(|| Live::new(args.json));
    let title = format!("{} seed {}: {}", scenario.name(), args.seed.first, scenario.summary());
    let journal = listener(args, live.as_ref(), &title)?;
    let source = Source::of(scenario, args, &config);
    let result = filmed(runner, video, config, journal, |config, journal| {
        runner.run(scenario, args.seed.first, config, journal)
    })?;
    drop(live);
    tell_result(&source, args, &result)?;
    Ok(exit_of(&result))
}

/// Who listens to the messages of one run: who shows its progress, else who tells its story, else nobody.
pub(crate) fn listener(args: &RunArgs, live: Option<&Live>, title: &str) -> anyhow::Result<Arc<dyn Journal<Message>>> {
    match live {
        Some(live) => Ok(live.begin(title)?),
        None if args.json => Ok(Arc::new(NoJournal)),
        None => {
            writeln!(std::io::stdout(), "{title}")?;
            Ok(Arc::new(Narrator::new(Box::new(std::io::stdout()))))
        }
    }
}

/// Runs an episode and draws it, where that is wanted.
pub(crate) fn filmed(
    runner: &Runner,
    video: Option<VideoFile>,
    config: EpisodeConfig,
    journal: Arc<dyn Journal<Message>>,
    run: impl FnOnce(&EpisodeConfig, Arc<dyn Journal<Message>>) -> anyhow::Result<EpisodeResult>,
) -> anyhow::Result<EpisodeResult> {
    let Some(video) = video else { return run(&config, journal) };
    let camera = Arc::new(Camera::new(Arc::clone(runner.library())));
    let config = EpisodeConfig { frames: Some(camera.tap()), ..config };
    let result = run(&config, Arc::new(Both(journal, Arc::clone(&camera) as Arc<dyn Journal<Message>>)))?;
    video.write(&camera.pictures(ending_of(&result)))?;
    Ok(result)
}

/// Prints what one episode came to.
pub(crate) fn tell_result(source: &Source<'_>, args: &RunArgs, result: &EpisodeResult) -> anyhow::Result<()> {
    if args.json {
        let runs = Runs::new(source, args, std::slice::from_ref(result));
        serde_json::to_writer_pretty(std::io::stdout().lock(), &runs)?;
        println!();
        return Ok(());
    }
    print_judgement(result)?;
    print_times(std::slice::from_ref(result))
}

fn many(runner: &Runner, scenario: &Scenario, args: &RunArgs, config: &EpisodeConfig) -> anyhow::Result<Exit> {
    let count = args.seed.last - args.seed.first + 1;
    let live = args.live.then(|| Live::new(args.json));
    let bar = progress(count, args.json || args.live);
    let mut results: Vec<EpisodeResult> = Vec::new();
    for seed in args.seed.first..=args.seed.last {
        let solved = results.iter().filter(|r| r.solved).count();
        bar.set_message(format!("{solved} solved"));
        let title = format!("{} seed {seed} ({} of {count}), {solved} solved", scenario.name(), results.len() + 1);
        let journal = live.as_ref().map_or_else(|| Ok(Arc::new(NoJournal) as Arc<_>), |live| live.begin(&title))?;
        let result = runner.run(scenario, seed, &traced(scenario.name(), args, config, seed), journal)?;
        match &live {
            Some(live) => live.tell(&line(&result))?,
            None => tell(&bar, args.json, &line(&result))?,
        }
        bar.inc(1);
        let interrupted = result.report.ending == Ending::Interrupted;
        results.push(result);
        if interrupted {
            break;
        }
    }
    bar.finish_and_clear();
    drop(live);
    let source = Source::of(scenario, args, config);
    let runs = Runs::new(&source, args, &results);
    if args.json {
        serde_json::to_writer_pretty(std::io::stdout().lock(), &runs)?;
        println!();
    } else {
        print_summary(&runs, count as usize)?;
        print_times(&results)?;
    }
    Ok(exit_of_range(&results, count as usize))
}

/// The configuration of one seed: its trace is a file of its own.
pub(crate) fn traced(world: &str, args: &RunArgs, config: &EpisodeConfig, seed: u64) -> EpisodeConfig {
    let request = |target| TraceRequest::for_seed(target, args.trace_frames, config, world, seed, args.seed.range);
    EpisodeConfig { trace: args.trace.as_deref().map(request), ..config.clone() }
}

/// One line an episode: above the bar on a terminal, on standard output elsewhere; none with JSON.
fn tell(bar: &ProgressBar, json: bool, line: &str) -> anyhow::Result<()> {
    if json {
        return Ok(());
    }
    bar.suspend(|| writeln!(std::io::stdout().lock(), "{line}"))?;
    Ok(())
}

fn progress(count: u64, hidden: bool) -> ProgressBar {
    if hidden {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} {elapsed} eta {eta}");
    let bar = ProgressBar::new(count);
    match style {
        Ok(style) => bar.with_style(style),
        Err(_template) => bar,
    }
}

/// The last line of a video: how it ended, and what the judge says.
fn ending_of(result: &EpisodeResult) -> String {
    let judge = if result.verdict.strict { "success" } else { "no success" };
    format!("{} (judge: {judge})", result.report.ending)
}

/// The exit of one episode.
pub fn exit_of(result: &EpisodeResult) -> Exit {
    match &result.report.ending {
        _ if result.solved => Exit::Success,
        Ending::Done if !result.judged => Exit::Success,
        Ending::Until { .. } => Exit::Success,
        Ending::GaveUp { .. } => Exit::GaveUp,
        Ending::NotUnderstood { .. } => Exit::Unusable,
        Ending::Interrupted => Exit::Interrupted,
        Ending::Done | Ending::Broken { .. } => Exit::Failed,
    }
}

fn exit_of_range(results: &[EpisodeResult], asked: usize) -> Exit {
    let exits: Vec<Exit> = results.iter().map(exit_of).collect();
    if exits.contains(&Exit::Interrupted) {
        return Exit::Interrupted;
    }
    if exits.len() == asked && exits.iter().all(|exit| *exit == Exit::Success) {
        return Exit::Success;
    }
    let failed = exits.iter().any(|exit| !matches!(exit, Exit::Success | Exit::GaveUp));
    if failed || exits.len() < asked { Exit::Failed } else { Exit::GaveUp }
}

/// How an episode ended, in words.
pub fn ending_words(ending: &Ending) -> String {
    ending.to_string()
}

fn line(result: &EpisodeResult) -> String {
    let word = match (result.solved, result.cause) {
        (true, _) => "solved".to_string(),
        _ if matches!(result.report.ending, Ending::Until { .. }) => "ended as asked".to_string(),
        (false, Some(cause)) => format!("NOT SOLVED ({})", cause.word()),
        (false, None) => "NOT SOLVED".to_string(),
    };
    let faithful = match result.verdict.faithful {
        Some(true) => "faithful yes",
        Some(false) => "faithful no",
        None => "",
    };
    format!(
        "seed {:>6}  {word:<24} {faithful:<13} {:>5.1} s simulated {:>5.1} s wall {:>3} frames {:>2} skills  {}{}{}",
        result.seed,
        result.report.ended.seconds(),
        result.wall_s,
        result.report.frames_perceived,
        result.report.steps.len(),
        ending_words(&result.report.ending),
        if result.solved { String::new() } else { format!(" | judge: {}", result.verdict.explanation) },
        fallbacks(result),
    )
}

/// Where the rules had to read an instruction for the model.
fn fallbacks(result: &EpisodeResult) -> String {
    let told = result.report.readings.iter().filter(|reading| reading.fallback.is_some());
    told.map(|reading| format!(" | {reading}")).collect()
}

pub(crate) fn print_judgement(result: &EpisodeResult) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    let verdict = &result.verdict;
    if !result.judged {
        writeln!(out, "judge     none has judged this run")?;
        return Ok(());
    }
    let word = |holds: bool| if holds { "success" } else { "no success" };
    writeln!(out, "judge     strict: {}; {}", word(verdict.strict), verdict.explanation)?;
    if let Some(faithful) = verdict.faithful {
        writeln!(out, "          faithful: {}", word(faithful))?;
    }
    for violation in &verdict.violations {
        writeln!(out, "          violation: {violation}")?;
    }
    writeln!(out, "audit     {} violations{}", result.audit.violations, listed(&result.audit.first))?;
    Ok(())
}

/// What the audit tells in words, a line each.
fn listed(told: &[String]) -> String {
    told.iter().map(|what| format!("\n          {what}")).collect()
}

fn print_summary(runs: &Runs<'_>, asked: usize) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    let (low, high) = wilson95(runs.solved, asked);
    writeln!(
        out,
        "{} ({}, on-unknown {}, sensor {}): {} of {asked} solved (strict), 95 % interval {:.1} to {:.1} %",
        runs.scenario,
        runs.method,
        runs.on_unknown,
        runs.sensor,
        runs.solved,
        100.0 * low,
        100.0 * high
    )?;
    writeln!(
        out,
        "  faithful {}; false successes {}; audit violations {}; gave up {}; not finished {}; {} distinct worlds",
        runs.faithful,
        runs.false_successes,
        runs.audit_violations,
        runs.gave_up,
        asked - runs.episodes.len(),
        runs.distinct_worlds
    )?;
    if !runs.causes.is_empty() {
        let causes: Vec<String> = runs.causes.iter().map(|(cause, count)| format!("{cause} {count}")).collect();
        writeln!(out, "  failures by cause: {}", causes.join(", "))?;
    }
    let wall: Vec<f64> = runs.episodes.iter().map(|e| e.wall_s).collect();
    let frames: Vec<f64> = runs.episodes.iter().map(|e| f64::from(e.report.frames_perceived)).collect();
    let ((wall50, wall_max), (frames50, frames_max)) = (median_and(1.0, &wall), median_and(1.0, &frames));
    writeln!(
        out,
        "  wall per episode: median {wall50:.1} s, longest {wall_max:.1} s; frames perceived: median {frames50:.0}, most {frames_max:.0}"
    )?;
    Ok(())
}

/// The table of where the time goes.
fn print_times(results: &[EpisodeResult]) -> anyhow::Result<()> {
    let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
    for (name, seconds) in results.iter().flat_map(|result| &result.spent_s) {
        *sums.entry(name).or_default() += seconds;
    }
    let (episodes, total) = (results.len().max(1) as f64, results.iter().map(|r| r.wall_s).sum::<f64>());
    sums.insert("messages and rest", (total - sums.values().sum::<f64>()).max(0.0));
    let mut rows: Vec<_> = sums.into_iter().collect();
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut out = std::io::stdout().lock();
    writeln!(out, "  wall time per episode ({:.2} s):", total / episodes)?;
    for (name, seconds) in rows.iter().filter(|(_, seconds)| *seconds > 0.0005 * episodes) {
        writeln!(out, "    {name:<18} {:>8.3} s {:>5.1} %", seconds / episodes, 100.0 * seconds / total.max(1e-9))?;
    }
    Ok(())
}

/// Where episodes took place.
pub(crate) struct Source<'a> {
    /// The scenario, or the address of a robot.
    pub name: &'a str,
    /// The sensor profile.
    pub sensor: &'a str,
    /// What the agent does when memory cannot decide.
    pub on_unknown: OnUnknown,
}

impl<'a> Source<'a> {
    fn of(scenario: &'a Scenario, args: &'a RunArgs, config: &EpisodeConfig) -> Source<'a> {
        let sensor = args.sensor.as_deref().unwrap_or(scenario.sensor());
        Source { name: scenario.name(), sensor, on_unknown: config.settings.on_unknown }
    }
}

/// The results of a range, as `--json` prints them.
#[derive(Serialize)]
struct Runs<'a> {
    schema: &'static str,
    scenario: &'a str,
    method: &'a str,
    on_unknown: &'static str,
    sensor: &'a str,
    seeds: [u64; 2],
    solved: usize,
    faithful: usize,
    false_successes: usize,
    audit_violations: u64,
    gave_up: usize,
    distinct_worlds: usize,
    causes: BTreeMap<&'static str, usize>,
    episodes: &'a [EpisodeResult],
}

impl<'a> Runs<'a> {
    fn new(source: &Source<'a>, args: &'a RunArgs, episodes: &'a [EpisodeResult]) -> Runs<'a> {
        let count = |test: fn(&EpisodeResult) -> bool| episodes.iter().filter(|e| test(e)).count();
        let mut causes = BTreeMap::new();
        for cause in episodes.iter().filter_map(|e| e.cause) {
            *causes.entry(cause.word()).or_default() += 1;
        }
        Runs {
            schema: "acm.run/1",
            scenario: source.name,
            method: &args.method,
            on_unknown: match source.on_unknown {
                OnUnknown::Abstain => "abstain",
                OnUnknown::Guess => "guess",
            },
            sensor: source.sensor,
            seeds: [args.seed.first, args.seed.last],
            solved: count(|e| e.solved),
            faithful: count(|e| e.verdict.faithful == Some(true)),
            false_successes: count(|e| e.false_success),
            audit_violations: episodes.iter().map(|e| e.audit.violations).sum(),
            gave_up: count(|e| matches!(e.report.ending, Ending::GaveUp { .. })),
            distinct_worlds: episodes.iter().map(|e| &e.world).collect::<BTreeSet<_>>().len(),
            causes,
            episodes,
        }
    }
}
