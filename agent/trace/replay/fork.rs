//! A recorded run that goes another way from a message on.

use super::{Comparison, Outcome, Recorded, tell};
use crate::{
    cli::{Exit, trace::TraceReplayArgs},
    episode::{EpisodeConfig, Runner},
    inject::{Faults, Signal},
    llm::Llm,
    run::{exit_of, prepare, print_judgement},
    trace::recording::TraceRequest,
};
use acm_actors::{message::Message, trace::FrameDetail};
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
    let (mut run, otherwise) = (recorded.arguments()?, &args.otherwise);
    run.inject.extend(otherwise.inject.iter().cloned());
    run.set.extend(otherwise.set.iter().cloned());
    run.on_unknown = otherwise.on_unknown.unwrap_or(run.on_unknown);
    let name = run.scenario.as_deref().context("the run was on a robot in another process: it has no simulator")?;
    let scenario = Scenario::open_with(name, &run.set)?;
    // Up to the fork the model replies as it did; what the last recorded message asks is asked of the other one.
    let (id, other) = (std::mem::take(&mut run.llm), Signal::default());
    let before = recorded.llm(id.clone())?;
    run.llm = otherwise.llm.clone().unwrap_or(id);
    let (config, library) = prepare(&run)?;
    let afterwards = config.llm.clone().map(Box::new);
    let llm = match before {
        Some(before) => Some(Llm::Fork { before, after: afterwards, from: other.clone() }),
        None => config.llm.clone(),
    };
    let memory = recorded.memory()?;
    let begins = Signal::default();
    let config = EpisodeConfig {
        memory: memory.as_ref().map(|folder| folder.path().to_path_buf()),
        llm,
        trace: otherwise.trace.clone().map(|path| TraceRequest { path, frames: FrameDetail::default() }),
        faults: Faults { cameras_from: begins_at_fork(&run.inject, otherwise.inject.len(), &begins), ..config.faults },
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

/// Camera faults that are new begin at the fork; those that the recorded run had begin where they did.
fn begins_at_fork(all: &[crate::inject::Injection], new: usize, begins: &Signal) -> Option<Signal> {
    let before = Faults::new(all.get(..all.len() - new).unwrap_or_default());
    (!before.black_frames && !before.freeze_frames && before.misplaced.is_none()).then(|| begins.clone())
}
