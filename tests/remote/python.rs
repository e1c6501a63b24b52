//! A host that knows nothing of ours: examples/robot.py.

use crate::host::{HostProcess, Process, acm};
use std::{collections::BTreeSet, path::Path, process::Command};

fn robot() -> HostProcess {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/robot.py");
    HostProcess::start(Command::new("python3").arg(script).arg("0"))
}

#[test]
fn a_robot_of_sixty_lines_hosts_the_agent_with_every_message_of_the_protocol() {
    let (robot, dir) = (robot(), tempfile::tempdir().unwrap());
    let (address, memory) = (robot.address.to_string(), dir.path().join("memory"));
    let run = ["run", "--robot", &address, "--memory", memory.to_str().unwrap()];

    // The first agent watches until the instruction; the second goes on in the same world with what the first knows.
    let first = acm(&run).args(["--until", "instruction"]).output().unwrap();
    let told = String::from_utf8_lossy(&first.stdout).into_owned();
    assert_eq!(first.status.code(), Some(0), "{told}");
    assert!(told.contains("the instruction would be given now") && !told.contains("told "), "{told}");
    let seen = ids(&told);
    assert_eq!(seen.len(), 2, "a block and a mat: {told}");
    let second = acm(&run).output().unwrap();
    let told = String::from_utf8_lossy(&second.stdout).into_owned();
    assert_eq!(second.status.code(), Some(0), "{told}");
    assert!(told.contains("judge     strict: success"), "{told}");
    let acted: Vec<&str> = told.lines().filter(|line| line.starts_with("act ")).collect();
    assert!(acted.iter().all(|line| line.contains("VERIFIED") && !ids(line).is_disjoint(&seen)), "{told}");

    let mut asked: BTreeSet<String> = robot.process.lines().into_iter().collect();
    asked.extend(interrupted());
    for kind in ["hello", "capture", "feedback", "command", "wait-until", "stop", "done"] {
        assert!(asked.contains(kind), "{kind} was never asked: {asked:?}");
    }
}

/// What is asked of a robot whose agent is interrupted while it moves.
fn interrupted() -> Vec<String> {
    let robot = robot();
    let agent = Process::start(&mut acm(&["run", "--robot", &robot.address.to_string(), "--json"]));
    robot.process.wait_for("command", |lines| lines.iter().any(|line| line == "command").then_some(()));
    agent.signal("INT");
    let (code, told) = agent.end();
    assert_eq!(code, Some(130), "{told:?}");
    robot.process.wait_for("done", |lines| lines.iter().any(|line| line == "done").then_some(()));
    robot.process.lines()
}

/// Ids of objects in a text.
fn ids(text: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric());
    let is_id = |word: &&str| word.strip_prefix('O').is_some_and(|digits| digits.parse::<u32>().is_ok());
    words.filter(is_id).map(str::to_string).collect()
}
