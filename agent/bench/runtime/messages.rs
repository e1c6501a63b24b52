//! Questions and answers between two actors.

use super::{Scratch, now_ns, row};
use crate::{
    bench::{BenchResult, Row},
    statistics::median_and,
};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::{Envelope, OUTSIDE, Payload, Role},
    journal::{Journal, NoJournal},
    system::{PanicAt, SystemBuilder},
    trace::{TraceJournal, TraceOptions, TraceWriter},
};
use anyhow::bail;
use serde::Serialize;
use std::{sync::Arc, time::Duration};

const ASKER: Role = Role("asker");
const ANSWERER: Role = Role("answerer");
const ROUNDS: u32 = 20_000;
const RESTARTS: u32 = 50;
const PATIENCE: Duration = Duration::from_secs(120);

/// A message about as long as an arm's report.
#[derive(Debug, Clone, Serialize)]
pub struct Ball {
    what: What,
    numbers: [f64; 12],
    #[serde(skip)]
    routine: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
enum What {
    Begin(u32),
    Ask(u32),
    Answer(u32),
    Failed,
    Times(#[serde(skip)] Vec<f64>),
}

impl Ball {
    /// A question.
    pub fn question(number: u32, routine: bool) -> Ball {
        Ball::new(What::Ask(number), routine)
    }
    fn new(what: What, routine: bool) -> Ball {
        let numbers = std::array::from_fn(|i| 0.123_456_789 * (i as f64 + 1.0));
        Ball { what, numbers, routine }
    }
}

impl Payload for Ball {
    fn kind(&self) -> &'static str {
        match self.what {
            What::Begin(_) => "begin",
            What::Ask(_) => "ask",
            What::Answer(_) => "answer",
            What::Failed => "failed",
            What::Times(_) => "times",
        }
    }
    fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        serde_json::to_vec(self)
    }
    fn routine(&self) -> bool {
        self.routine
    }
}

/// Asks one question after the other and times each until its answer; asks again when the answerer failed.
struct Asker {
    left: u32,
    routine: bool,
    asked_ns: u64,
    times_us: Vec<f64>,
}

impl Core<Ball> for Asker {
    fn handle(&mut self, message: Envelope<Ball>, outbox: &mut Outbox<Ball>) -> Result<(), CoreError> {
        match message.body.what {
            What::Begin(rounds) => self.left = rounds,
            What::Answer(_) => {
                self.times_us.push(now_ns().saturating_sub(self.asked_ns) as f64 * 1e-3);
                self.left -= 1;
            }
            // The clock goes on: what counts is the time until an answer is there.
            What::Failed => {
                outbox.send(ANSWERER, Ball::new(What::Ask(self.left), self.routine));
                return Ok(());
            }
            other => return Err(CoreError(format!("unexpected {other:?}"))),
        }
        if self.left == 0 {
            outbox.send(OUTSIDE, Ball::new(What::Times(std::mem::take(&mut self.times_us)), false));
        } else {
            self.asked_ns = now_ns();
            outbox.send(ANSWERER, Ball::new(What::Ask(self.left), self.routine));
        }
        Ok(())
    }
}

struct Answerer;

impl Core<Ball> for Answerer {
    fn handle(&mut self, message: Envelope<Ball>, outbox: &mut Outbox<Ball>) -> Result<(), CoreError> {
        if let What::Ask(number) = message.body.what {
            outbox.send(message.from, Ball::new(What::Answer(number), message.body.routine));
        }
        Ok(())
    }
}

/// Measures round trips untraced and traced, and the replacement of a failed actor.
pub fn measure(quick: bool, folder: &Scratch, result: &mut BenchResult) -> anyhow::Result<()> {
    let rounds = if quick { ROUNDS / 10 } else { ROUNDS };
    let mut figure = |name: &str, label: &str, times_us: &[f64]| {
        result.rows.push(row(label, "question and answer", times_us));
        result.figure(name, median_and(0.99, times_us).0);
    };
    figure("message_round_trip_p50_us", "untraced", &round_trips(Arc::new(NoJournal), rounds, true, None)?);
    let journal = |name: &str| -> anyhow::Result<(Arc<TraceWriter>, Arc<dyn Journal<Ball>>)> {
        let writer = Arc::new(TraceWriter::create(&folder.path().join(name), TraceOptions::default())?);
        Ok((Arc::clone(&writer), Arc::new(TraceJournal::new(writer))))
    };
    let (writer, routine) = journal("routine.mcap")?;
    figure("traced_round_trip_p50_us", "traced, 64 at a time", &round_trips(routine, rounds, true, None)?);
    writer.finish()?;
    let (writer, flushed) = journal("flushed.mcap")?;
    let times_us = round_trips(flushed, rounds / 4, false, None)?;
    figure("traced_and_flushed_round_trip_p50_us", "traced, each flushed", &times_us);
    writer.finish()?;
    let notes = [
        "A traced message is in the file's chunk before it is handled. Control ticks leave the process 64 at a time, all",
        "other messages each on its own: that is the flushed row.",
    ];
    result.notes.extend(notes.map(str::to_owned));
    result.rows.push(restarts(if quick { RESTARTS / 5 } else { RESTARTS }, result_of(&mut result.figures))?);
    Ok(())
}

fn result_of(figures: &mut std::collections::BTreeMap<String, f64>) -> impl FnMut(&str, f64) + '_ {
    |name, value| {
        figures.insert(name.to_owned(), value);
    }
}

fn restarts(count: u32, mut figure: impl FnMut(&str, f64)) -> anyhow::Result<Row> {
    // The panics are wanted; nobody needs to read of each.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let spans: anyhow::Result<Vec<f64>> = (0..count)
        .map(|_| {
            let fault = Some(PanicAt { role: ANSWERER, message: 3 });
            let times_us = round_trips(Arc::new(NoJournal), 5, true, fault)?;
            Ok(times_us.into_iter().fold(0.0, f64::max))
        })
        .collect();
    std::panic::set_hook(hook);
    let spans = spans?;
    let (p50, p99) = median_and(0.99, &spans);
    figure("actor_restart_ms", p50 * 1e-3);
    Ok(Row::new(
        "actor replaced after a panic, until it answers",
        [("p50_us", p50), ("p99_us", p99), ("repetitions", f64::from(count))],
    ))
}

fn round_trips(
    journal: Arc<dyn Journal<Ball>>,
    rounds: u32,
    routine: bool,
    fault: Option<PanicAt>,
) -> anyhow::Result<Vec<f64>> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let asker = move || Asker { left: 0, routine, asked_ns: 0, times_us: Vec::new() };
    let builder = SystemBuilder::new(1, journal)
        .actor(ASKER, Box::new(move || Box::new(asker())))
        .actor(ANSWERER, Box::new(|| Box::new(Answerer)))
        .notify(ASKER, Box::new(|_| Ball::new(What::Failed, false)))
        .panic_at(fault);
    runtime.block_on(async {
        let mut system = builder.start().await?;
        system.send(ASKER, Ball::new(What::Begin(rounds), false));
        let ended = system.result(PATIENCE).await;
        system.stop().await;
        match ended?.what {
            What::Times(times_us) => Ok(times_us),
            other => bail!("the actors ended with {other:?}"),
        }
    })
}
