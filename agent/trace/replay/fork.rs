//! A recorded run that goes another way from a message on.

use super::{Comparison, Outcome, Recorded, tell};
use crate::{
    cli::{Exit, trace::TraceReplayArgs},
    config::{self, Config},
    episode::{EpisodeConfig, Fork, Runner},
    inject::{Faults, Injection},
    llm::Llm,
    run::{exit_of, prepare_with, print_judgement},
    trace::recording::TraceRequest,
};
use acm_actors::{
    message::Message,
    settings::{Settings, Signal},
    trace::FrameDetail,
};
use acm_runtime::journal::Journal;
use acm_sim::Scenario;
use anyhow::{Context, bail};
use std::{io, sync::Arc};

/// Runs the recorded run again up to a message, and then live with what is set otherwise.
///
/// # Errors
/// The trace has no such message or no simulator, or what is set otherwise makes a difference before the fork.
pub(super) fn run(recorded: &Recorded, args: &TraceReplayArgs, after: u64) -> anyhow::Result<Exit> {
    let last = recorded.entries.last().map_or(0, |entry| entry.header.seq);
    if after == 0 || after >= last {
        bail!("there is nothing to fork after message {after}: the run has messages 1 to {last}");
    }
    let donor = recorded.donor()?;
    let (mut run, otherwise) = (recorded.arguments(donor.as_ref().map(tempfile::TempDir::path))?, &args.otherwise);
    // What happens in the world happens at a moment of its own; a moment before the fork is no fork, and is told.
    let (cameras, others): (Vec<_>, Vec<_>) = otherwise.inject.iter().cloned().partition(Injection::is_of_cameras);
    run.inject.extend(others);
    run.set.extend(otherwise.set.iter().cloned());
    let name = run.scenario.as_deref().context("the run was on a robot in another process: it has no simulator")?;
    let scenario = Scenario::open_with(name, &run.set)?;
    // Up to the fork the model replies as it did; what the last recorded message asks is asked of the other one.
    let (id, other) = (run.llm.take().unwrap_or_default(), Signal::default());
    let before = recorded.llm(id.clone())?;
    run.llm = Some(otherwise.llm.clone().unwrap_or(id));
    let file = config::open(otherwise.config.as_deref())?.1;
    let (config, library) = prepare_with(&run, Config { settings: Settings::default(), llm: file.llm })?;
    let afterwards = config.llm.clone().map(Box::new);
    let llm = match before {
        Some(before) => Some(Llm::Fork { before, after: afterwards, from: other.clone() }),
        None => config.llm.clone(),
    };
    let memory = recorded.memory()?;
    let settings = recorded.settings()?.unwrap_or(config.settings);
    let mut then = otherwise.config.as_ref().map_or_else(|| settings.clone(), |_| file.settings);
    then.on_unknown = otherwise.on_unknown.map_or(then.on_unknown, Into::into);
    let begins = Signal::default();
    let config = EpisodeConfig {
        memory: memory.as_ref().map(|folder| folder.path().to_path_buf()),
        llm,
        trace: otherwise.trace.clone().map(|path| TraceRequest { path, frames: FrameDetail::default() }),
        settings,
        fork: Some(Fork { begins: begins.clone(), cameras: Faults::new(&cameras), settings: then }),
        ..config
    };
    let comparison = Arc::new(Comparison {
        fork: Some((after, begins)),
        other_llm: Some((after, other)),
        ..Comparison::new(recorded, args)
    });
    let runner = Runner::with_library(library)?;
    runner.end_on_ctrl_c();
    let journal = Arc::clone(&comparison) as Arc<dyn Journal<Message>>;
    let ended = runner.run(&scenario, recorded.seed()?, &config, journal);
    if let Outcome::Diverged(divergence) = comparison.outcome(Ok(()), runner.adapter())?
        && divergence.seq <= after
    {
        println!("what is set otherwise makes a difference before message {after}:");
        tell(&divergence, &mut io::stdout().lock())?;
        return Ok(Exit::Failed);
    }
    let result = ended?;
    println!("as recorded up to message {after}, then live");
    print_judgement(&result)?;
    Ok(exit_of(&result))
}
