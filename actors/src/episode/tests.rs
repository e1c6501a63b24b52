use super::*;
use crate::message::EPISODE;
use acm_concept::task::Budgets;
use acm_memory::{AcmMemory, Memory};
use acm_runtime::envelope::Role;
use std::sync::Arc;

fn episode(instruction_at_s: f64, until: Option<Until>) -> Episode {
    let budgets = Budgets { seconds: 10.0, skills: 3, frames: 30 };
    let task = TaskSpec { instruction: "Wave.".into(), instruction_at_s, budgets, then: vec![], cameras: vec![] };
    Episode::new(task, Upheavals::default()).until(until)
}

fn handle(episode: &mut Episode, seconds: f64, body: Message) -> Vec<(Role, Message)> {
    let time_ns = Time::from_seconds(seconds).0;
    let mut out = Outbox::new(time_ns);
    let envelope = Envelope { seq: 1, cause: None, episode: 1, from: OUTSIDE, to: EPISODE, time_ns, body };
    episode.handle(envelope, &mut out).unwrap();
    out.into_messages().1
}

/// Begins at a moment of the world's clock; what the loop does first.
fn begin(episode: &mut Episode, seconds: f64) -> Message {
    handle(episode, seconds, Message::Begin);
    let memory = AcmMemory::in_memory(Arc::new(acm_memory::default_library().unwrap()));
    let kept = Message::Kept { transition: None, view: View(memory.view()) };
    handle(episode, seconds, kept).remove(0).1
}

#[test]
fn who_joins_after_the_instruction_gets_it_at_once_with_the_whole_budget() {
    let mut late = episode(2.0, None);
    assert!(matches!(begin(&mut late, 50.0), Message::Parse { .. }));
    assert_eq!(late.asked.deadline(), Time::from_seconds(60.0));
    let mut early = episode(2.0, None);
    assert!(matches!(begin(&mut early, 0.5), Message::Look { .. }));
    assert_eq!(early.asked.deadline(), Time::from_seconds(12.0));
}

#[test]
fn a_run_until_the_instruction_ends_instead_of_reading_it() {
    let until = Some(Until::Instruction);
    let mut watching = episode(2.0, until);
    assert!(matches!(begin(&mut watching, 0.0), Message::Look { .. }));
    match begin(&mut episode(2.0, until), 2.0) {
        Message::Ended(report) => assert_eq!(report.ending, Ending::Until { event: Until::Instruction }),
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_actor_that_fails_before_the_instruction_does_not_bring_it_forward() {
    let mut watching = episode(2.0, None);
    begin(&mut watching, 0.5);
    let failed = Message::ActorFailed { role: "memory", reason: "a test".into(), restarted: true };
    assert!(matches!(handle(&mut watching, 0.5, failed).remove(0).1, Message::Look { .. }));
}
