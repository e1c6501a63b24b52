//! Runs what is missing, several episodes at a time.

use super::{
    follow::{Followed, Follower},
    ledger::Ledger,
    page,
    plan::{Contender, Job, Plan},
    record::{Lived, Record},
};
use crate::{
    bench::progress,
    cli::RmbenchArgs,
    episode::{EpisodeConfig, Runner},
    inject::{Faults, FrameTap},
};
use acm_actors::{message::Message, report::Ending, settings::Settings};
use acm_runtime::journal::Journal;
use anyhow::Context;
use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::sync_channel,
    },
};

/// Runs the episodes that are asked for and not there yet; tells whether it was interrupted.
///
/// # Errors
/// The renderer or a runtime cannot be started, or the results cannot be written.
pub fn run(plan: &Plan, ledger: &mut Ledger, args: &RmbenchArgs) -> anyhow::Result<bool> {
    let mut missing: Vec<Job> = plan.asked().into_iter().filter(|job| !ledger.records().contains_key(job)).collect();
    missing.truncate(args.common.episodes.unwrap_or(usize::MAX));
    if missing.is_empty() {
        return Ok(false);
    }
    let first = Runner::with_library(acm_memory::whole_library()?)?;
    let mut runners = vec![first];
    for _ in 1..plan.workers.min(missing.len()) {
        let beside = runners.first().context("there is a first runner")?.beside()?;
        runners.push(beside);
    }
    let bar = progress("episodes", missing.len() as u64);
    let (stopped, queue) = (AtomicBool::new(false), Mutex::new(missing.into_iter()));
    let (sender, receiver) = sync_channel::<Record>(plan.workers);
    std::thread::scope(|scope| {
        for runner in &runners {
            runner.end_on_ctrl_c();
            let (sender, stopped, queue) = (sender.clone(), &stopped, &queue);
            scope.spawn(move || {
                while !stopped.load(Ordering::SeqCst) {
                    let Some(job) = queue.lock().unwrap_or_else(PoisonError::into_inner).next() else { return };
                    let Some(record) = lived(runner, plan, &job, &args.out) else {
                        return stopped.store(true, Ordering::SeqCst);
                    };
                    // Nobody listens any more where the results could not be written.
                    if sender.send(record).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for record in receiver {
            bar.suspend(|| eprintln!("{}", line(&record)));
            if let Err(error) = ledger.add(record) {
                stopped.store(true, Ordering::SeqCst);
                return Err(error);
            }
            bar.inc(1);
        }
        Ok(())
    })?;
    bar.finish_and_clear();
    Ok(stopped.load(Ordering::SeqCst))
}

/// One episode; `None` if it was interrupted. One that crashes, or that cannot be run, is a failure and has its record.
fn lived(runner: &Runner, plan: &Plan, job: &Job, out: &Path) -> Option<Record> {
    let (_, digest) = plan.scenario(&job.scenario)?;
    let outcome = catch_unwind(AssertUnwindSafe(|| episode(runner, plan, job, out)));
    let outcome = match outcome {
        Ok(Ok(None)) => return None,
        Ok(Ok(Some(lived))) => Ok(lived),
        Ok(Err(error)) => Err(format!("{error:#}")),
        Err(panic) => Err(format!("crashed: {}", words(&*panic))),
    };
    Some(Record::new(job, digest, outcome))
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "without words".into())
}

fn episode(runner: &Runner, plan: &Plan, job: &Job, out: &Path) -> anyhow::Result<Option<Lived>> {
    let (scenario, _) = plan.scenario(&job.scenario).context("the plan has its scenarios")?;
    // One film a task: of the memory that the figures are about, and its first seed.
    let first = plan.blocks.iter().any(|(_, first)| *first == job.seed);
    let filmed = first && !job.black && job.contender == Contender::whole();
    let tap = filmed.then(FrameTap::last);
    let config = EpisodeConfig {
        method: job.contender.method.clone(),
        settings: Settings { on_unknown: job.contender.on_unknown(), ..Settings::default() },
        faults: Faults { black_frames: job.black, ..Faults::default() },
        sensor: Some(plan.sensor.clone()),
        frames: tap.clone(),
        ..EpisodeConfig::default()
    };
    let world = runner.world(scenario, job.seed, &config)?;
    let follower = Arc::new(Follower::new(world.simulation().witness(), tap));
    let result = runner.run_in(&world, &config, Arc::clone(&follower) as Arc<dyn Journal<Message>>)?;
    if result.report.ending == Ending::Interrupted {
        return Ok(None);
    }
    let followed: Followed = follower.take();
    if filmed {
        page::write_film(out, &job.scenario, &followed.pictures)?;
    }
    Ok(Some(Lived::new(&result, &followed)))
}

fn line(record: &Record) -> String {
    let job = record.job();
    let who = format!("{} {} seed {}", job.scenario, job.contender, job.seed);
    match &record.outcome {
        Err(reason) => format!("{who}: NOT RUN: {reason}"),
        Ok(lived) => {
            let strict = if lived.solved { "solved" } else { "NOT SOLVED" };
            let faithful = match lived.faithful {
                Some(true) => ", faithful",
                Some(false) => ", not faithful",
                None => "",
            };
            let judge = if lived.solved { String::new() } else { format!(" | judge: {}", lived.judge) };
            format!("{who}: {strict}{faithful}, {} skills, {:.0} s, {}{judge}", lived.steps, lived.wall_s, lived.ending)
        }
    }
}
