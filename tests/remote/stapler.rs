//! One memory over two processes: the first watches, the second is told what to do in the same world.

use crate::host::{HostProcess, acm};
use acm::trace::run_file::RunFile;

/// Lets one agent watch a scenario's world until the instruction, and another go on. Exit code and words of the second.
fn watch_then_act(scenario: &str, seed: u64) -> (Option<i32>, String) {
    let dir = tempfile::tempdir().unwrap();
    let host = HostProcess::simulator(scenario, seed, &dir.path().join("robot.sock"));
    let (address, memory) = (host.address.to_string(), dir.path().join("memory"));
    let run = ["run", "--robot", &address, "--memory", memory.to_str().unwrap()];
    let watched = acm(&run).args(["--until", "instruction"]).output().unwrap();
    let told = String::from_utf8_lossy(&watched.stdout).into_owned();
    assert_eq!(watched.status.code(), Some(0), "{told}");
    assert!(told.contains("the instruction would be given now") && !told.contains("told "), "{told}");
    let acted = acm(&run).output().unwrap();
    (acted.status.code(), String::from_utf8_lossy(&acted.stdout).into_owned())
}

#[test]
fn what_one_process_saw_the_next_one_puts_back() {
    // A move that was watched, and one that happened unseen: then the looks alone say which of two is left.
    for (scenario, seed) in [("return-stapler", 1), ("return-stapler-unseen", 1), ("return-stapler-unseen", 2)] {
        let (code, told) = watch_then_act(scenario, seed);
        assert_eq!(code, Some(0), "{scenario} {seed}: {told}");
        assert!(told.contains("judge     strict: success"), "{scenario} {seed}: {told}");
    }
}

#[test]
fn a_doubt_outlives_the_process() {
    for seed in [1, 2] {
        let (code, told) = watch_then_act("return-stapler-unknown", seed);
        assert_eq!(code, Some(3), "{seed}: {told}");
        assert!(told.contains("I cannot tell which of them it is"), "{seed}: {told}");
    }
}

#[test]
fn a_run_on_a_robot_is_traced_and_drawn_like_any_other() {
    let dir = tempfile::tempdir().unwrap();
    let host = HostProcess::simulator("return-stapler", 3, &dir.path().join("robot.sock"));
    let [address, folder] = [host.address.to_string(), format!("{}/traces/", dir.path().display())];
    let video = dir.path().join("episode.gif");
    let run = ["run", "--robot", &address, "--trace", &folder, "--video", video.to_str().unwrap()];
    let output = acm(&run).args(["--until", "instruction"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let trace = RunFile::read(&dir.path().join("traces/robot-acm-0.mcap")).unwrap();
    assert_eq!((trace.about("scenario"), trace.cut.as_deref()), (address.as_str(), None));
    assert!(trace.entries.iter().any(|entry| entry.header.kind == "percepts") && !trace.deltas.is_empty());
    assert!(trace.ending().contains("instruction"), "{}", trace.ending());
    assert!(std::fs::read(&video).unwrap().starts_with(b"GIF89a"));
}
