//! `acm demo`: the first minute. One task that needs memory, told as it happens; then the same without memory.
//!
//! | module | holds |
//! |---|---|
//! | [`watch`] | what is seen before the instruction |
//! | [`deed`] | what is decided, done and verified after it |
//! | [`judge`] | how far from its old place the thing is in truth |
//! | [`reel`] | pictures of it, step by step |
//! | [`page`] | the HTML page |
//! | [`montage`] | the README's picture |

pub mod deed;
pub mod judge;
pub mod montage;
pub mod page;
pub mod reel;
pub mod watch;

use crate::{
    cli::{DemoArgs, Exit},
    episode::{EpisodeConfig, EpisodeResult, Runner, World},
    perceive,
    trace::recording::TraceRequest,
};
use acm_actors::{episode::Until, message::Message, report::Ending, trace::FrameDetail};
use acm_concept::{embodiment::Clock, literal::Evidence, time::Time};
use acm_memory::{AcmMemory, Memory};
use acm_runtime::journal::{Both, Journal, NoJournal};
use acm_sim::Scenario;
use anyhow::Context;
use deed::Deed;
use judge::Truth;
use page::{Cards, Facts, Page};
use reel::{Chapter, Reel};
use std::{
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};
use watch::Watch;

const SCENARIO: &str = "return-stapler";
/// A further seed is only begun if it can be expected to end before this much of the minute is over, seconds.
const MINUTE_S: f64 = 52.0;
/// Width of the lines up to a remark at their end, columns.
const COLUMN: usize = 84;

/// Runs `acm demo`.
pub fn run(args: &DemoArgs) -> anyhow::Result<Exit> {
    Demo::begin(args)?.tell()
}

/// What all parts of the demo share.
struct Demo<'a> {
    args: &'a DemoArgs,
    began: Instant,
    runner: Runner,
    scenario: Scenario,
    memory: PathBuf,
}

/// What the episode came to, with its pictures.
struct Told {
    result: EpisodeResult,
    truth: Truth,
    pictures: Reel,
}

impl<'a> Demo<'a> {
    fn begin(args: &'a DemoArgs) -> anyhow::Result<Demo<'a>> {
        let began = now();
        let memory = fresh_memory(&args.out)?;
        let runner = Runner::new()?;
        runner.end_on_ctrl_c();
        let scenario = Scenario::open(SCENARIO)?;
        Ok(Demo { args, began, runner, scenario, memory })
    }

    fn tell(self) -> anyhow::Result<Exit> {
        let (seed, adapter) = (self.args.seed, self.runner.adapter());
        let drawn_by = adapter.split(" (").next().unwrap_or(&adapter);
        say(&format!("ACM demo   no GPU, no key, no network at run time   seed {seed}   renderer: {drawn_by}"))?;
        let cards = Arc::new(Cards::default());
        let told = self.with_memory(&cards)?;
        let wiped = self.without_memory()?;
        let honest = matches!(wiped.result.report.ending, Ending::GaveUp { .. }) && wiped.result.motion_commands == 0;
        let more = self.more_seeds(told.result.wall_s)?;
        let photograph = perceive::sample::photograph(&self.args.out.join("real.png"))?;
        if let Some(line) = &photograph {
            say(&headed("7 REAL CAMERA", &format!(" a real sensor: {line}")))?;
        }
        let facts = Facts {
            scenario: SCENARIO.into(),
            seed,
            renderer: adapter,
            solved: told.result.solved,
            judge: told.truth.words(&told.result),
            more,
            commands: self.commands(),
        };
        let page = Page::new(facts, told.pictures, wiped.pictures, &cards);
        let path = self.args.out.join("index.html");
        page.write(&path)?;
        if let Some(picture) = &self.args.picture {
            montage::write(&page, picture)?;
        }
        let trace = self.trace_file("run.mcap");
        say(&format!(
            "{:.0} s. Open {}   Next: {} trace show {} --step 2",
            self.began.elapsed().as_secs_f64(),
            path.display(),
            program(),
            trace.display()
        ))?;
        Ok(if told.result.solved && honest { Exit::Success } else { Exit::Failed })
    }

    /// Two agents over one memory folder in one world: one watches, the other is asked.
    fn with_memory(&self, cards: &Arc<Cards>) -> anyhow::Result<Told> {
        let about = "Someone pushes one of two staplers along behind a carton. The robot only watches.";
        say(&headed("1 WATCH", about))?;
        let config = EpisodeConfig { method: "acm".into(), memory: Some(self.memory.clone()), ..Default::default() };
        let world = self.runner.world(&self.scenario, self.args.seed, &config)?;
        let before = world.simulation().truth();
        let reel = Arc::new(Reel::new(Arc::clone(self.runner.library()), Chapter::Watch));
        let config = EpisodeConfig { frames: Some(reel.tap()), ..config };
        let watching =
            EpisodeConfig { until: Some(Until::Instruction), trace: Some(self.trace("watch.mcap")), ..config.clone() };
        let teller = Arc::new(Watch::new(Box::new(std::io::stdout()), Arc::clone(cards)));
        self.runner.run_in(&world, &watching, both(Arc::clone(&teller) as Arc<dyn Journal<Message>>, &reel))?;
        for line in teller.at_rest() {
            say(&line)?;
        }
        let moved = world.simulation().truth();
        self.restarted()?;
        reel.chapter(Chapter::Ask);
        let why = format!("{} trace show {} --step 1", program(), self.trace_file("run.mcap").display());
        let teller = Arc::new(Deed::new(Box::new(std::io::stdout()), Arc::clone(cards), why));
        let asked = EpisodeConfig { trace: Some(self.trace("run.mcap")), ..config };
        let result = self.runner.run_in(&world, &asked, both(teller, &reel))?;
        let truth = Truth::new(&before, &moved, &world.simulation().truth());
        let words = truth.words(&result);
        say(&headed("5 JUDGE", &format!("simulator's truth, never shown to the robot: {words}")))?;
        reel.end(&format!("{}; judge: {words}", result.report.ending));
        Ok(Told { result, truth, pictures: reel.take() })
    }

    /// The first agent has ended and closed its memory: opens it from disk, as the second one is about to.
    fn restarted(&self) -> anyhow::Result<()> {
        let started = now();
        let memory = AcmMemory::open(&self.memory, Arc::clone(self.runner.library()))?;
        let took_ms = 1e3 * started.elapsed().as_secs_f64();
        let view = memory.view();
        let objects = view.objects().len();
        let places: usize = view.objects().iter().map(|object| object.history.len()).sum();
        let bytes = folder_bytes(&self.memory)?;
        drop(memory);
        say(&headed(
            "2 RESTART",
            &format!(
                "agent ended, memory closed. A new agent reads it from disk: {objects} objects, {places} places, {} kB in {took_ms:.0} ms",
                bytes / 1000
            ),
        ))
    }

    /// Another agent in an equal world at the same moment, with nothing to remember.
    fn without_memory(&self) -> anyhow::Result<Told> {
        say("6 NOW WITHOUT MEMORY   same world, robot, eyes and planner; its memory is empty when it is asked")?;
        let config = EpisodeConfig { method: "acm".into(), ..Default::default() };
        let world = self.at_the_instruction(self.args.seed, &config)?;
        let before = world.simulation().truth();
        let reel = Arc::new(Reel::new(Arc::clone(self.runner.library()), Chapter::Ask));
        let config = EpisodeConfig { frames: Some(reel.tap()), ..config };
        let result = self.runner.run_in(&world, &config, both(Arc::new(NoJournal), &reel))?;
        let (said, moved) = match &result.report.ending {
            Ending::GaveUp { unknown, .. } => (unknown.clone(), result.motion_commands),
            other => (other.to_string(), result.motion_commands),
        };
        let gave_up = matches!(result.report.ending, Ending::GaveUp { .. });
        let verdict = match (gave_up, moved) {
            (true, 0) => "moves nothing   HONEST FAILURE",
            (true, _) => "GAVE UP, BUT MOVED",
            (false, _) => "NOT HONEST",
        };
        say(&below(&format!("\"{said}\"   {verdict}")))?;
        reel.end(&format!("\"{said}\" {verdict}"));
        let truth = Truth::new(&before, &before, &world.simulation().truth());
        Ok(Told { result, truth, pictures: reel.take() })
    }

    /// A world in which everything before the instruction has happened, and nobody has watched.
    fn at_the_instruction(&self, seed: u64, config: &EpisodeConfig) -> anyhow::Result<World<'_>> {
        let world = self.runner.world(&self.scenario, seed, config)?;
        let moment = Time::from_seconds(world.simulation().task().instruction_at_s);
        let mut clock: Box<dyn Clock> = world.simulation().clock();
        clock.wait_until(moment).context("the world does not go on")?;
        Ok(world)
    }

    /// As many further seeds as fit into the minute, each with memory and with the last frame alone.
    fn more_seeds(&self, one_s: f64) -> anyhow::Result<Option<[usize; 3]>> {
        let (mut asked, mut with, mut without) = (0, 0, 0);
        let seed = self.args.seed;
        let mut longest_s = one_s;
        for seed in seed + 1..=seed + self.args.more_seeds {
            if self.began.elapsed().as_secs_f64() + 1.2 * longest_s > MINUTE_S {
                break;
            }
            eprintln!("acm: seed {seed}, with memory and with the last frame only");
            let started = now();
            let config = EpisodeConfig { method: "acm".into(), ..Default::default() };
            with += usize::from(self.runner.run(&self.scenario, seed, &config, Arc::new(NoJournal))?.solved);
            // What came before the last frame makes no difference to an agent that keeps the last frame alone.
            let config = EpisodeConfig { method: "reactive".into(), ..Default::default() };
            let world = self.at_the_instruction(seed, &config)?;
            without += usize::from(self.runner.run_in(&world, &config, Arc::new(NoJournal))?.solved);
            longest_s = longest_s.max(started.elapsed().as_secs_f64());
            asked += 1;
        }
        if asked == 0 {
            return Ok(None);
        }
        let seeds = match asked {
            1 => format!("seed {}:", seed + 1),
            _ => format!("seeds {} to {}:", seed + 1, seed + asked as u64),
        };
        say(&below(&format!("{seeds}  with memory {with}/{asked}   last frame only {without}/{asked}")))?;
        Ok(Some([asked, with, without]))
    }

    /// Commands that show the same again, with what they show.
    fn commands(&self) -> Vec<(String, String)> {
        let seed = self.args.seed;
        let trace = self.trace_file("run.mcap").display().to_string();
        let watch = self.trace_file("watch.mcap").display().to_string();
        [
            (format!("acm demo --seed {}", seed + 1), "the same story in another world"),
            (format!("acm run {SCENARIO} --seed {seed}"), "watched and done by one agent"),
            (format!("acm run {SCENARIO} --seed {seed} --inject wipe-memory@instruction"), "its memory wiped"),
            (format!("acm run {SCENARIO} --seed {seed} --method reactive"), "an agent that keeps the last frame alone"),
            (format!("acm trace show {trace} --step 1"), "why it picked what it picked"),
            (format!("acm trace show {watch} --kind updated"), "what each frame changed"),
        ]
        .map(|(command, shows)| (command, shows.to_string()))
        .to_vec()
    }

    fn trace_file(&self, name: &str) -> PathBuf {
        self.args.out.join(name)
    }

    fn trace(&self, name: &str) -> TraceRequest {
        TraceRequest { path: self.trace_file(name), frames: FrameDetail::Thumbnail }
    }
}

/// The name under which this program can be called again: as it was called, where that is short.
fn program() -> String {
    std::env::args().next().filter(|name| name.len() <= 24).unwrap_or_else(|| "acm".into())
}

/// Prints a line at once.
fn say(line: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")?;
    Ok(out.flush()?)
}

fn both(teller: Arc<dyn Journal<Message>>, reel: &Arc<Reel>) -> Arc<dyn Journal<Message>> {
    Arc::new(Both(teller, Arc::clone(reel) as Arc<dyn Journal<Message>>))
}

/// An empty folder for the demo's memory. Only a folder that a demo made is ever emptied.
fn fresh_memory(out: &Path) -> anyhow::Result<PathBuf> {
    let memory = out.join("memory");
    let mark = out.join("made-by-acm-demo");
    if memory.exists() {
        anyhow::ensure!(mark.exists(), "{} was not made by a demo; choose another folder with --out", out.display());
        std::fs::remove_dir_all(&memory).with_context(|| format!("{} cannot be emptied", memory.display()))?;
    }
    std::fs::create_dir_all(out).with_context(|| format!("the folder {} cannot be made", out.display()))?;
    std::fs::write(&mark, "acm demo empties the memory folder beside this file\n")
        .with_context(|| format!("{} cannot be written", mark.display()))?;
    Ok(memory)
}

fn folder_bytes(folder: &Path) -> anyhow::Result<u64> {
    let mut bytes = 0;
    for entry in std::fs::read_dir(folder)? {
        bytes += entry?.metadata()?.len();
    }
    Ok(bytes)
}

/// A line with its heading.
fn headed(heading: &str, text: &str) -> String {
    format!("{heading:<12}{text}")
}

/// A line without a heading.
fn below(text: &str) -> String {
    headed("", text)
}

/// A line with a remark at its end.
fn noted(text: &str, note: &str) -> String {
    format!("{:<COLUMN$} {note}", below(text))
}

fn evidence_words(evidence: &Evidence) -> String {
    match evidence {
        Evidence::Frame(frame) => format!("frame {frame}"),
        Evidence::Transition(transition) => format!("own move {transition}"),
        Evidence::Inferred(how) => how.clone(),
    }
}

/// Wall time decides only how many further seeds are shown.
#[allow(clippy::disallowed_methods)]
fn now() -> Instant {
    Instant::now()
}
