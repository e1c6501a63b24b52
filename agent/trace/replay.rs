//! `acm trace replay`: a recorded run once more, compared message by message.
//!
//! Without `--resim` all handlers run again against what the host answered in the recorded run. With it, physics and
//! renderer run again too. Each message is compared before it is handled, so a replay stops at the first that differs.

mod fork;

use super::{
    diff::{FieldDifference, field_differences, tell_fields},
    recorded::Recorded,
    run_file::Entry,
};
use crate::{
    cli::{Exit, RunArgs, trace::TraceReplayArgs},
    config::Config,
    episode::{EpisodeConfig, Runner},
    inject::Faults,
    llm::{Llm, LlmId},
    run::prepare_with,
};
use acm_actors::{message::Message, settings::Signal, trace::words};
use acm_runtime::{
    envelope::{Envelope, OUTSIDE},
    journal::{Journal, JournalError},
    trace::record,
};
use acm_sim::Scenario;
use anyhow::Context;
use std::{
    collections::{BTreeMap, BTreeSet},
    io::{self, BufRead, IsTerminal, Write},
    sync::{Arc, Mutex, PoisonError},
};

/// Kind of the message by which somebody ends a run from outside.
const INTERRUPT: &str = "interrupt";

/// Runs `acm trace replay`.
pub fn run(args: &TraceReplayArgs) -> anyhow::Result<Exit> {
    let recorded = Recorded::read(&args.file)?;
    if let Some(after) = args.fork {
        return fork::run(&recorded, args, after);
    }
    let outcome = replay(&recorded, args)?;
    let out = &mut io::stdout().lock();
    match &outcome {
        Outcome::Identical { messages } => {
            write!(out, "identical: {messages} messages")?;
            match &recorded.cut {
                Some(cut) => writeln!(out, "; the trace is cut there: {cut}")?,
                None => writeln!(out)?,
            }
        }
        Outcome::Stopped { messages } => writeln!(out, "identical up to message {messages}, where it was to stop")?,
        Outcome::Interrupted { messages } => {
            writeln!(out, "identical up to message {messages}, where the run was interrupted by hand")?;
        }
        Outcome::Diverged(divergence) => {
            tell(divergence, out)?;
            if args.resim && recorded.about("renderer") != divergence.renderer {
                writeln!(out, "  the frames were drawn by {}", recorded.about("renderer"))?;
                writeln!(out, "  here they are drawn by {}", divergence.renderer)?;
            }
        }
    }
    Ok(if matches!(outcome, Outcome::Diverged(_)) { Exit::Failed } else { Exit::Success })
}

/// What came of a replay.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Every message came again.
    Identical {
        /// How many.
        messages: u64,
    },
    /// Every message came again up to the one where it was to stop.
    Stopped {
        /// The last one.
        messages: u64,
    },
    /// Every message came again up to where somebody had ended the run from outside, which no replay does at the same
    /// instant.
    Interrupted {
        /// The last one.
        messages: u64,
    },
    /// A message came otherwise.
    Diverged(Box<Divergence>),
}

/// The first message that came otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Divergence {
    /// Its number.
    pub seq: u64,
    /// The line of the recorded one; `None` where the recorded run had ended.
    pub recorded: Option<String>,
    /// The line of the new one; `None` where the new run ended.
    pub replayed: Option<String>,
    /// The fields that differ.
    pub fields: Vec<FieldDifference>,
    /// What drew the frames of the new run, if it drew any.
    pub renderer: String,
}

fn tell(divergence: &Divergence, out: &mut impl Write) -> io::Result<()> {
    let Divergence { seq, recorded, replayed, fields, .. } = divergence;
    writeln!(out, "DIVERGED at message {seq}")?;
    writeln!(out, "  recorded  {}", recorded.as_deref().unwrap_or("the run has ended"))?;
    writeln!(out, "  replayed  {}", replayed.as_deref().unwrap_or("the run has ended"))?;
    tell_fields(fields, out)
}

/// Replays a recorded run.
///
/// # Errors
/// The trace does not hold what the replay needs.
pub fn replay(recorded: &Recorded, args: &TraceReplayArgs) -> anyhow::Result<Outcome> {
    let donor = recorded.donor()?;
    let mut run = recorded.arguments(donor.as_ref().map(tempfile::TempDir::path))?;
    // What a model replied is in the trace: its files need not be there.
    let id = run.llm.replace(LlmId::Rules).unwrap_or_default();
    let llm = recorded.llm(id)?.map(Llm::Cassette);
    let (config, library) = prepare_with(&run, Config::default())?;
    let config = EpisodeConfig { llm, ..config };
    let comparison = Arc::new(Comparison::new(recorded, args));
    let journal = Arc::clone(&comparison) as Arc<dyn Journal<Message>>;
    let seed = recorded.seed()?;
    let memory = recorded.memory()?;
    let config = EpisodeConfig {
        memory: memory.as_ref().map(|folder| folder.path().to_path_buf()),
        settings: recorded.settings()?.unwrap_or(config.settings),
        ..config
    };
    let (ended, renderer) = if args.resim {
        let name = run.scenario.as_deref().context("the run was on a robot in another process: it has no simulator")?;
        let scenario = Scenario::open_with(name, &run.set)?;
        let runner = Runner::with_library(library)?;
        runner.end_on_ctrl_c();
        let ended = runner.run(&scenario, seed, &config, journal).map(|_| ());
        (ended, runner.adapter())
    } else {
        let outside = recorded.outside()?;
        let runner = Runner::without_renderer(library)?;
        runner.end_on_ctrl_c();
        // What befell the cameras and the robot is in what they gave; what befell the agent befalls it again.
        let Faults { wipe_at, transplant, panic_at, .. } = config.faults;
        let faults = Faults { wipe_at, transplant, panic_at, ..Faults::default() };
        let config = EpisodeConfig { faults, no_motion: false, ..config };
        (runner.live(recorded.task()?, outside, seed, &config, journal, None).map(|_| ()), String::new())
    };
    comparison.outcome(ended, renderer)
}

/// Compares each message with the recorded one of its number.
struct Comparison {
    expected: BTreeMap<u64, Vec<u8>>,
    lines: BTreeMap<u64, String>,
    /// Whether the recorded run came to its end.
    whole: bool,
    /// The message by which somebody ended the run from outside.
    interrupt: Option<u64>,
    until: Option<u64>,
    step: bool,
    /// After which message the run may be another one, and who is told.
    fork: Option<(u64, Signal)>,
    /// From which message on another model answers, and who is told.
    other_llm: Option<(u64, Signal)>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    compared: BTreeSet<u64>,
    stopped: bool,
    divergence: Option<Divergence>,
}

impl Comparison {
    fn new(recorded: &Recorded, args: &TraceReplayArgs) -> Comparison {
        let messages = || recorded.entries.iter();
        let seq = |entry: &Entry| entry.header.seq;
        Comparison {
            expected: messages().map(|entry| (seq(entry), entry.raw().to_vec())).collect(),
            lines: messages().map(|entry| (seq(entry), entry.line.clone())).collect(),
            whole: recorded.cut.is_none(),
            interrupt: messages()
                .find(|entry| entry.header.from == OUTSIDE.0 && entry.header.kind == INTERRUPT)
                .map(seq),
            until: args.until,
            step: args.step,
            fork: None,
            other_llm: None,
            state: Mutex::default(),
        }
    }

    /// Compares a message; an error ends the run.
    fn compare(&self, message: &Envelope<Message>, state: &mut State) -> Result<(), String> {
        if state.stopped || state.divergence.is_some() {
            return Err("the replay has ended".into());
        }
        let seq = message.seq;
        let expected = self.expected.get(&seq);
        if let Some((from, signal)) = &self.other_llm
            && seq >= *from
        {
            signal.give();
        }
        if let Some((after, signal)) = &self.fork
            && seq > *after
        {
            signal.give();
            return Ok(());
        }
        let interrupted = self.interrupt.is_some_and(|interrupt| seq >= interrupt);
        if interrupted || self.until.is_some_and(|until| seq > until) || (expected.is_none() && !self.whole) {
            state.stopped = true;
            return Err("the replay was to stop here".into());
        }
        let bytes = record::encode(message).map_err(|error| error.to_string())?;
        let (_, line) = words::line(&message.body);
        if expected.is_some_and(|expected| *expected == bytes) {
            state.compared.insert(seq);
            if self.step && !wait_for_enter(seq, message, &line) {
                state.stopped = true;
                return Err("the replay was stopped".into());
            }
            return Ok(());
        }
        let mut fields = expected.map(|expected| field_differences(expected, &bytes)).unwrap_or_default();
        // What stands in the body tells more than the headers that follow from it.
        fields.sort_by_key(|field| !field.field.starts_with("/body"));
        state.divergence = Some(Divergence {
            seq,
            recorded: self.lines.get(&seq).cloned(),
            replayed: Some(line),
            fields,
            renderer: String::new(),
        });
        Err(format!("message {seq} differs from the recorded one"))
    }

    fn outcome(&self, ended: anyhow::Result<()>, renderer: String) -> anyhow::Result<Outcome> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let messages = state.compared.len() as u64;
        if let Some(divergence) = state.divergence.clone() {
            return Ok(Outcome::Diverged(Box::new(Divergence { renderer, ..divergence })));
        }
        let seen = state.compared.last().copied().unwrap_or_default();
        if state.stopped {
            return Ok(match self.interrupt {
                Some(interrupt) if seen + 1 >= interrupt => Outcome::Interrupted { messages },
                _ if self.whole => Outcome::Stopped { messages },
                _ => Outcome::Identical { messages },
            });
        }
        // All that came was as recorded; an error is then the recorded run's own, unless messages are missing.
        match self.lines.iter().find(|(seq, _)| !state.compared.contains(seq)) {
            Some((&seq, line)) => {
                let replayed = ended.err().map(|error| format!("{error:#}"));
                let recorded = Some(line.clone());
                Ok(Outcome::Diverged(Box::new(Divergence { seq, recorded, replayed, fields: Vec::new(), renderer })))
            }
            None => Ok(Outcome::Identical { messages }),
        }
    }
}

impl Journal<Message> for Comparison {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        self.compare(message, &mut state).map_err(JournalError)
    }
}

fn kind_of(message: &Envelope<Message>) -> &'static str {
    acm_runtime::envelope::Payload::kind(&message.body)
}

/// Shows a message and waits; false if enough was seen.
fn wait_for_enter(seq: u64, message: &Envelope<Message>, line: &str) -> bool {
    let seconds = message.time_ns as f64 * 1e-9;
    println!("{seq:>6} {seconds:8.2} s  {} -> {}  {}  {line}", message.from, message.to, kind_of(message));
    if !io::stdin().is_terminal() {
        return true;
    }
    let mut answer = String::new();
    let read = io::stdin().lock().read_line(&mut answer);
    !matches!(read, Ok(0) | Err(_)) && answer.trim() != "q"
}

/// The arguments of `acm run` that a trace's run had.
pub fn run_arguments(words: &[String]) -> anyhow::Result<RunArgs> {
    use clap::Parser;
    let words = ["acm", "run"].into_iter().map(str::to_owned).chain(words.iter().cloned());
    let cli = crate::cli::Cli::try_parse_from(words).context("the trace's arguments are not those of this version")?;
    match cli.command {
        crate::cli::Command::Run(args) => Ok(args),
        _ => anyhow::bail!("the trace's arguments are no run's"),
    }
}
