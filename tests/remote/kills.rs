//! One of the two processes is killed, or an actor fails, at seeded random moments spread over a run. The other side
//! ends soon and says why, nothing is left that stops the next run, and memory holds what was acknowledged.

use crate::{
    host::{HostProcess, Process, acm, config, now, runner, signal},
    hunted::{Hunt, Hunted},
};
use acm_actors::{
    message::Message,
    remote::{Address, FrameMode, RemoteRobot},
    report::Ending,
};
use acm_memory::{AcmMemory, Memory};
use acm_runtime::{
    envelope::Envelope,
    frame_bus::leftovers,
    journal::{Journal, JournalError, MemoryJournal},
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::{
    path::Path,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

const SCENARIO: &str = "put-back-block";
/// By then the side that is left must have ended.
const LIMIT: Duration = Duration::from_secs(5);
/// Messages, and questions to the host, of a run of this scenario.
const MESSAGES: u64 = 3000;
const QUESTIONS: u64 = 950;

#[test]
fn when_the_simulator_is_killed_the_agent_says_so_and_keeps_what_it_knows() {
    kill_simulators(1, 17);
}

#[test]
fn when_the_agent_is_killed_the_world_stays_and_memory_holds_what_was_acknowledged() {
    kill_agents(2, 17);
}

#[test]
fn when_an_actor_fails_the_run_ends_and_the_next_one_goes_on() {
    fail_actors(3, 16);
}

#[test]
#[ignore = "ten times as many moments: some ten minutes"]
fn five_hundred_moments() {
    kill_simulators(11, 170);
    kill_agents(12, 170);
    fail_actors(13, 160);
}

#[test]
fn a_simulator_that_hangs_is_not_waited_for() {
    let dir = tempfile::tempdir().unwrap();
    let host = HostProcess::simulator(SCENARIO, 1, &dir.path().join("robot.sock"));
    let killer = Killer::new(400, host.process.child.id(), "STOP");
    let robot = RemoteRobot::connect(&host.address, "test", FrameMode::Auto).unwrap();
    let result = runner().run_remote(&robot, 1, &config(None), Arc::new(killer.clone())).unwrap();
    let Ending::Broken { reason } = &result.report.ending else { panic!("{:?}", result.report.ending) };
    assert!(reason.contains("is lost: the other end did not answer within 4.0 s"), "{reason}");
    assert!(killer.since() < LIMIT, "{:?}", killer.since());
}

/// A journal that sends a signal to a process when the nth message is about to be handled.
#[derive(Clone)]
struct Killer {
    journal: MemoryJournal,
    left: Arc<AtomicU64>,
    victim: u32,
    signal: &'static str,
    sent: Arc<Mutex<Option<Instant>>>,
}

impl Killer {
    fn new(message: u64, victim: u32, signal: &'static str) -> Killer {
        let (journal, left) = (MemoryJournal::default(), Arc::new(AtomicU64::new(message)));
        Killer { journal, left, victim, signal, sent: Arc::default() }
    }
    /// Time since the signal.
    fn since(&self) -> Duration {
        self.sent.lock().unwrap().expect("the signal was never sent").elapsed()
    }
}

impl Journal<Message> for Killer {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        if self.left.fetch_sub(1, Ordering::SeqCst) == 1 {
            *self.sent.lock().unwrap() = Some(now());
            signal(self.victim, self.signal);
        }
        self.journal.record(message)
    }
}

fn kill_simulators(seed: u64, rounds: u32) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let dir = tempfile::tempdir().unwrap();
    // Always the same address and memory: each round is the next run of the round before.
    let (socket, memory) = (dir.path().join("robot.sock"), dir.path().join("memory"));
    let (mut before, mut hit) = (None, 0);
    for round in 0..rounds {
        let message = random.random_range(1..MESSAGES / 2);
        let mut host = HostProcess::simulator(SCENARIO, u64::from(round), &socket);
        let pid = host.process.child.id();
        let killer = Killer::new(message, pid, "KILL");
        let robot = RemoteRobot::connect(&host.address, "test", FrameMode::SharedMemory).unwrap();
        let result = runner().run_remote(&robot, 0, &config(Some(&memory)), Arc::new(killer.clone())).unwrap();
        let case = format!("round {round}, message {message}: {:?}", result.report.ending);
        if killer.left.load(Ordering::SeqCst) > MESSAGES {
            let Ending::Broken { reason } = &result.report.ending else { panic!("{case}") };
            assert!(reason.contains("is lost: the other end closed the connection"), "{case}");
            assert!(!reason.contains('\n') && killer.since() < LIMIT, "{case}");
            hit += 1;
        }
        host.process.child.wait().unwrap();
        drop(robot);
        // Another process may be about to give back what this simulator left; by the next run it must be done.
        if let Some(before) = before.replace(pid) {
            assert!(!leftovers().unwrap().contains(&before), "{case}");
        }
        holds_what_was_told(&memory, &killer.journal, &case);
    }
    let host = HostProcess::simulator(SCENARIO, 0, &socket);
    probe(&host.address, &memory);
    assert!(hit >= rounds / 2, "only {hit} of {rounds} simulators were still alive at their moment");
}

/// The memory folder opens, and holds every object and transition that memory had told of.
fn holds_what_was_told(memory: &Path, journal: &MemoryJournal, case: &str) {
    let told = journal.entries().into_iter().rfind(|entry| ["updated", "kept"].contains(&entry.kind));
    let opened = AcmMemory::open(memory, acm_memory::default_library().unwrap().into()).unwrap();
    let Some(told) = told else { return };
    let body: serde_json::Value = serde_json::from_slice(&told.body).unwrap();
    let view = &body["view"];
    let kept: Vec<String> = opened.view().objects().iter().map(|object| object.id.to_string()).collect();
    let objects = view["objects"].as_array().unwrap();
    for object in objects {
        assert!(kept.iter().any(|id| object["id"] == *id), "{case}: {object} is lost");
    }
    assert_eq!(view["transitions"], opened.view().transitions().len(), "{case}");
}

/// The next run: it connects, opens the memory, and ends when the instruction would be given.
fn probe(address: &Address, memory: &Path) {
    let arguments =
        ["run", "--robot", &address.to_string(), "--memory", memory.to_str().unwrap(), "--until", "instruction"];
    let output = acm(&arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}

fn kill_agents(seed: u64, rounds: u32) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let dir = tempfile::tempdir().unwrap();
    let socket = dir.path().join("robot.sock");
    let mut hit = 0;
    for round in 0..rounds {
        let memory = dir.path().join(format!("memory{}", round / 4));
        let host = Hunted::serve(SCENARIO, u64::from(round), &socket);
        let question = random.random_range(1..QUESTIONS);
        let grace = Duration::from_micros(if round % 3 == 0 { 0 } else { random.random_range(1..30_000) });
        let pid = {
            // Held until the victim is known: it may ask its first question before this thread goes on.
            let mut hunt = host.hunter.0.lock().unwrap();
            let address = host.address.to_string();
            let run = ["run", "--robot", &address, "--memory", memory.to_str().unwrap(), "--json"];
            let agent = Process::start(&mut acm(&run));
            let pid = agent.child.id();
            *hunt = Hunt { left: question, grace, victim: pid, memory: memory.clone(), ..Hunt::default() };
            drop(hunt);
            agent.end();
            pid
        };
        // The host is free when the next agent is served; by then the one before must be cleaned up.
        probe(&host.address, &memory);
        let case = format!("round {round}, question {question}, {grace:?} later");
        assert!(!leftovers().unwrap().contains(&pid), "{case}");
        let hunt = host.hunter.0.lock().unwrap();
        let (Some(killed), Some(acknowledged)) = (hunt.killed, &hunt.acknowledged) else { continue };
        hit += 1;
        assert!(host.left().unwrap().saturating_duration_since(killed) < LIMIT, "{case}");
        let log = std::fs::read(memory.join("log-00000000")).unwrap();
        assert!(!acknowledged.is_empty() && log.starts_with(acknowledged), "{case}");
    }
    assert!(hit >= rounds / 2, "only {hit} of {rounds} agents were still alive at their moment");
}

fn fail_actors(seed: u64, rounds: u32) {
    // Roles with the messages that each handles in a run of this scenario.
    let roles = [
        ("perception", 14),
        ("planner", 20),
        ("memory", 40),
        ("executor", 900),
        ("verifier", 6),
        ("host", 900),
        ("episode", 60),
    ];
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let dir = tempfile::tempdir().unwrap();
    let socket = dir.path().join("robot.sock");
    let mut failed = 0;
    for (round, (role, messages)) in (0..rounds).zip(roles.into_iter().cycle()) {
        let memory = dir.path().join(format!("memory{}", round / 4));
        let host = Hunted::serve(SCENARIO, u64::from(round), &socket);
        let fault = format!("panic@{role}:{}", random.random_range(1..=messages));
        let address = host.address.to_string();
        let run = ["run", "--robot", &address, "--memory", memory.to_str().unwrap(), "--inject", &fault];
        let output = acm(&run).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let case = format!("{fault}: {}\n{said}", String::from_utf8_lossy(&output.stdout));
        let panicked = said.contains("fault set for a test");
        failed += u32::from(panicked);
        match output.status.code() {
            // The loop itself is not restarted: the run ends with one line that says so.
            Some(1) if role == "episode" && panicked => {
                let last = said.lines().last().unwrap();
                assert!(last.starts_with("acm: ") && last.contains("the episode actor failed"), "{case}");
            }
            Some(0 | 1 | 3) => assert!(role != "episode" || !panicked, "{case}"),
            _ => panic!("{case}"),
        }
        probe(&host.address, &memory);
    }
    assert!(failed >= rounds / 2, "only {failed} of {rounds} actors came to their moment");
}
