#![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict

use super::*;
use crate::{
    core::{CoreError, Outbox},
    journal::MemoryJournal,
};

const COUNTER: Role = Role("counter");
const ECHO: Role = Role("echo");

#[derive(Debug, serde::Serialize)]
enum Body {
    Start(u32),
    Ping(u32),
    Pong(u32),
    Failed(String),
    Result(u32),
}

impl Payload for Body {
    fn kind(&self) -> &'static str {
        match self {
            Body::Start(_) => "start",
            Body::Ping(_) => "ping",
            Body::Pong(_) => "pong",
            Body::Failed(_) => "failed",
            Body::Result(_) => "result",
        }
    }
    fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        serde_json::to_vec(self)
    }
}

/// Asks for `left` echoes one after the other; a failure of the echo makes it ask again.
struct Counter {
    left: u32,
    done: u32,
}
struct Echo;

impl Core<Body> for Counter {
    fn handle(&mut self, message: Envelope<Body>, outbox: &mut Outbox<Body>) -> Result<(), CoreError> {
        match message.body {
            Body::Start(rounds) => self.left = rounds,
            Body::Pong(_) => (self.left, self.done) = (self.left - 1, self.done + 1),
            Body::Failed(_) => {}
            other => return Err(CoreError(format!("unexpected {other:?}"))),
        }
        if self.left == 0 {
            outbox.send(OUTSIDE, Body::Result(self.done));
        } else {
            outbox.send(ECHO, Body::Ping(self.left));
        }
        Ok(())
    }
}
impl Core<Body> for Echo {
    fn handle(&mut self, message: Envelope<Body>, outbox: &mut Outbox<Body>) -> Result<(), CoreError> {
        if let Body::Ping(number) = message.body {
            outbox.advance(outbox.time_ns() + 5);
            outbox.send(message.from, Body::Pong(number));
        }
        Ok(())
    }
}

fn builder(journal: &MemoryJournal, panic_at: Option<PanicAt>) -> SystemBuilder<Body> {
    SystemBuilder::new(1, Arc::new(journal.clone()))
        .actor(COUNTER, Box::new(|| Box::new(Counter { left: 0, done: 0 })))
        .actor(ECHO, Box::new(|| Box::new(Echo)))
        .notify(COUNTER, Box::new(|failure| Body::Failed(failure.reason)))
        .panic_at(panic_at)
}

async fn run(panic_at: Option<PanicAt>) -> (u32, Vec<crate::journal::Entry>) {
    let journal = MemoryJournal::default();
    let mut system = builder(&journal, panic_at).start().await.unwrap();
    system.send(COUNTER, Body::Start(20));
    let result = system.result(Duration::from_secs(10)).await.unwrap();
    system.stop().await;
    let Body::Result(done) = result else { panic!("{result:?}") };
    (done, journal.entries())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_runs_write_equal_journals_with_causes() {
    let (done, first) = run(None).await;
    assert_eq!(done, 20);
    assert_eq!(first, run(None).await.1);
    assert_eq!(first.len(), 42);
    assert!(
        first
            .iter()
            .enumerate()
            .all(|(i, e)| e.seq == i as u64 + 1 && e.cause == e.seq.checked_sub(1).filter(|c| *c > 0))
    );
    assert_eq!(first.last().map(|e| (e.kind, e.time_ns)), Some(("result", 100)));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_panic_is_supervised_and_the_work_goes_on() {
    let (done, entries) = run(Some(PanicAt { role: ECHO, message: 7 })).await;
    assert_eq!(done, 20);
    let failed = entries.iter().find(|e| e.kind == "failed").unwrap();
    assert!(String::from_utf8_lossy(&failed.body).contains("fails at its message 7"));
    // The message that killed it stands in the journal just before the notice.
    assert_eq!(entries[(failed.seq - 2) as usize].kind, "ping");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_failure_of_the_one_who_is_told_goes_outside() {
    let journal = MemoryJournal::default();
    let mut system = builder(&journal, Some(PanicAt { role: COUNTER, message: 3 })).start().await.unwrap();
    system.send(COUNTER, Body::Start(20));
    let result = system.result(Duration::from_secs(10)).await.unwrap();
    assert!(matches!(result, Body::Failed(reason) if reason.contains("message 3")));
    system.stop().await;
}
