//! Whole episodes, rendered and judged. Few seeds: the counts that matter are printed by `acm run A..B`.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a failed unwrap is the test's verdict

#[path = "episodes/causality.rs"]
mod causality;

use acm::{
    episode::{EpisodeConfig, EpisodeResult, Runner},
    inject::{Faults, Injection},
    trace::recording::TraceRequest,
};
use acm_actors::{message::Message, report::Ending, trace::FrameDetail};
use acm_runtime::{
    journal::{Journal, MemoryJournal, NoJournal},
    trace::{Item, TraceReader},
};
use acm_sim::Scenario;
use std::{
    path::Path,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

/// One renderer for all tests of this binary: it takes a second to start, and software drivers dislike several.
fn with_runner<T>(test: impl FnOnce(&Runner) -> T) -> T {
    static RUNNER: OnceLock<Mutex<Runner>> = OnceLock::new();
    let runner = RUNNER.get_or_init(|| Mutex::new(Runner::with_library(acm_memory::whole_library().unwrap()).unwrap()));
    test(&runner.lock().unwrap_or_else(PoisonError::into_inner))
}

fn run(scenario: &str, seed: u64, faults: &[&str], change: impl FnOnce(&mut EpisodeConfig)) -> EpisodeResult {
    run_into(scenario, seed, faults, Arc::new(NoJournal), change)
}

fn run_into(
    scenario: &str,
    seed: u64,
    faults: &[&str],
    journal: Arc<dyn Journal<Message>>,
    change: impl FnOnce(&mut EpisodeConfig),
) -> EpisodeResult {
    let injections: Vec<Injection> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    let mut config =
        EpisodeConfig { method: "acm".into(), faults: Faults::new(&injections), ..EpisodeConfig::default() };
    change(&mut config);
    with_runner(|runner| runner.run(&Scenario::open(scenario).unwrap(), seed, &config, journal).unwrap())
}

/// What the agent says it does not know.
fn unknown(result: &EpisodeResult) -> &str {
    match &result.report.ending {
        Ending::GaveUp { unknown, .. } => unknown,
        other => panic!("no honest give-up: {other:?}; judge: {}", result.verdict.explanation),
    }
}

#[test]
fn the_block_comes_back_to_where_it_was() {
    let result = run("put-back-block", 100_000, &[], |_| {});
    assert!(result.solved, "{:?}; judge: {}", result.report.ending, result.verdict.explanation);
    assert_eq!(result.verdict.faithful, Some(true));
}

#[test]
fn black_frames_end_in_a_give_up_without_a_motion() {
    let result = run("put-back-block", 3, &["black-frames"], |_| {});
    assert!(unknown(&result).to_lowercase().contains("see"), "{}", unknown(&result));
    assert_eq!(result.motion_commands, 0);
    assert!(!result.solved && !result.verdict.strict);
}

#[test]
fn a_wiped_memory_does_not_know_where_the_block_came_from() {
    let result = run("put-back-block", 4, &["wipe-memory@first-verified-place"], |_| {});
    assert!(unknown(&result).contains("came from"), "{}", unknown(&result));
}

/// The memory is what decides: with another episode's in its place, the block goes where that one's came from.
#[test]
fn a_transplanted_memory_gives_the_answer_of_its_donor() {
    let dir = tempfile::tempdir().unwrap();
    let donor = dir.path().join("donor");
    let own = run("put-back-block", 0, &[], |config| config.memory = Some(donor.clone()));
    assert!(own.solved, "{}", own.verdict.explanation);
    let fault = format!("transplant-memory={}@first-verified-place", donor.display());
    let other = run("put-back-block", 2, &[&fault], |_| {});
    assert_eq!(other.report.ending, Ending::Done);
    assert!(
        other.false_success,
        "the world of seed 2 begins with the block on another mat: {}",
        other.verdict.explanation
    );
}

#[test]
fn a_block_that_slips_away_is_never_reported_as_done_wrongly() {
    let result = run("put-back-block", 5, &["slip@1"], |_| {});
    assert!(!result.false_success, "{}", result.verdict.explanation);
    assert!(result.report.steps.iter().any(|step| step.failure.is_some()), "the loss was not noticed");
}

#[test]
fn without_a_past_the_agent_abstains() {
    let result = run("put-back-block", 6, &[], |config| config.method = "reactive".into());
    assert!(unknown(&result).contains("came from"), "{}", unknown(&result));
}

#[test]
fn a_robot_that_must_not_move_does_not() {
    let result = run("put-back-block", 7, &[], |config| config.no_motion = true);
    assert!(!result.solved && !result.false_success);
}

#[test]
fn two_runs_write_equal_journals() {
    let journals = [MemoryJournal::default(), MemoryJournal::default()];
    for journal in &journals {
        run_into("put-back-block", 8, &[], Arc::new(journal.clone()), |_| {});
    }
    let [first, second] = journals.map(|journal| journal.entries());
    assert!(first.iter().filter(|entry| entry.kind == "command").count() > 100);
    assert_eq!(first, second);
}

/// What two runs have in common: topic, virtual time and bytes of all but the wall clock's messages, in order.
fn told(trace: &Path) -> Vec<(String, u64, Vec<u8>)> {
    let mut reader = TraceReader::open(trace).unwrap();
    let mut told = Vec::new();
    while let Some(item) = reader.next_item() {
        match item {
            Item::Message(message) if message.topic() != "/wall" => {
                told.push((message.topic().to_owned(), message.time_ns, message.data))
            }
            _ => {}
        }
    }
    assert_eq!(reader.cut(), None);
    told
}

#[test]
fn a_trace_changes_nothing_and_two_traces_of_one_seed_are_equal() {
    let dir = tempfile::tempdir().unwrap();
    let paths = ["1.mcap", "2.mcap"].map(|name| dir.path().join(name));
    let requests = paths.clone().map(|path| Some(TraceRequest { path, frames: FrameDetail::Thumbnail }));
    let run = |trace: Option<TraceRequest>| {
        let journal = MemoryJournal::default();
        run_into("put-back-block", 11, &["slip@1"], Arc::new(journal.clone()), |config| config.trace = trace);
        journal.entries()
    };
    let untraced = run(None);
    let [first, second] = requests.map(run);
    assert!(untraced.len() > 500);
    assert_eq!(untraced, first);
    assert_eq!(untraced, second);
    let [first, second] = paths.map(|path| told(&path));
    // Every message of the journal is in the trace, in its order, with its body.
    let is_message = |topic: &str| untraced.iter().any(|entry| topic == format!("/{}/{}", entry.to, entry.kind));
    let messages: Vec<_> = first.iter().filter(|(topic, ..)| is_message(topic)).collect();
    assert_eq!(messages.len(), untraced.len());
    for ((topic, time_ns, bytes), entry) in messages.iter().zip(&untraced) {
        assert_eq!((topic.as_str(), *time_ns), (format!("/{}/{}", entry.to, entry.kind).as_str(), entry.time_ns));
        assert!(bytes.ends_with(&[&entry.body[..], b"}"].concat()), "{topic}");
    }
    assert!(
        first.iter().any(|(topic, ..)| topic == "/effect/frame")
            && first.iter().any(|(topic, ..)| topic == "/memory/delta")
    );
    assert_eq!(first, second);
}

#[test]
fn a_failing_actor_is_replaced_and_the_memory_is_whole() {
    for (role, message) in [("perception", 1), ("planner", 3), ("memory", 4), ("verifier", 1), ("executor", 30)] {
        let dir = tempfile::tempdir().unwrap();
        let result = run("put-back-block", 9, &[], |config| {
            config.memory = Some(dir.path().join("memory"));
            config.panic_at = Some((role.to_string(), message));
        });
        assert_eq!(result.report.restarts, 1, "{role}");
        assert!(!result.false_success, "{role}: {}", result.verdict.explanation);
        let library = Arc::new(acm_memory::default_library().unwrap());
        assert!(acm_memory::AcmMemory::open(&dir.path().join("memory"), library).is_ok(), "{role}");
    }
}
