//! A simulator in a process of its own gives the journal that the simulator within gives.

use crate::host::{HostProcess, config, runner};
use acm_actors::remote::{Carrier, FrameMode, RemoteRobot};
use acm_runtime::journal::{Entry, MemoryJournal};
use acm_sim::Scenario;
use std::sync::Arc;

const SCENARIO: &str = "put-back-block-jittered";
const SEED: u64 = 11;

#[test]
fn a_simulator_in_another_process_gives_an_equal_journal() {
    let runner = runner();
    let journal = MemoryJournal::default();
    let scenario = Scenario::open(SCENARIO).unwrap();
    let within = runner.run(&scenario, SEED, &config(None), Arc::new(journal.clone())).unwrap();
    let expected = journal.entries();
    assert!(expected.iter().filter(|entry| entry.kind == "command").count() > 100);
    let dir = tempfile::tempdir().unwrap();
    for (mode, carrier) in [(FrameMode::SharedMemory, Carrier::SharedMemory), (FrameMode::Inline, Carrier::Inline)] {
        let host = HostProcess::simulator(SCENARIO, SEED, &dir.path().join("robot.sock"));
        let robot = RemoteRobot::connect(&host.address, "test", mode).unwrap();
        assert_eq!(robot.carrier(), carrier);
        let journal = MemoryJournal::default();
        let apart = runner.run_remote(&robot, SEED, &config(None), Arc::new(journal.clone())).unwrap();
        assert_equal(&expected, &journal.entries());
        assert_eq!((apart.report, apart.verdict), (within.report.clone(), within.verdict.clone()));
        assert_eq!(apart.motion_commands, within.motion_commands);
    }
}

/// Compares message by message, so that a difference is told where it begins.
fn assert_equal(expected: &[Entry], actual: &[Entry]) {
    for (expected, actual) in expected.iter().zip(actual) {
        let body = |entry: &Entry| String::from_utf8_lossy(&entry.body).into_owned();
        assert_eq!(body(expected), body(actual), "message {}", expected.seq);
        assert_eq!(expected, actual);
    }
    assert_eq!(expected.len(), actual.len());
}
