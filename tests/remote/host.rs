//! Processes that the tests start, and what they share.

use acm::episode::{EpisodeConfig, Runner};
use acm_actors::remote::Address;
use std::{
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError},
    thread::JoinHandle,
    time::{Duration, Instant},
};

/// Only against a test that hangs.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// One renderer for all tests of this binary: it takes a second to start, and software drivers dislike several.
pub fn runner() -> MutexGuard<'static, Runner> {
    static RUNNER: OnceLock<Mutex<Runner>> = OnceLock::new();
    RUNNER.get_or_init(|| Mutex::new(Runner::new().unwrap())).lock().unwrap_or_else(PoisonError::into_inner)
}

pub fn config(memory: Option<&Path>) -> EpisodeConfig {
    EpisodeConfig { method: "acm".into(), memory: memory.map(Into::into), ..EpisodeConfig::default() }
}

/// The program under test.
pub fn acm(arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("acm"));
    command.args(arguments);
    command
}

/// A child process whose output is read while it runs. It is killed with the test.
pub struct Process {
    pub child: Child,
    lines: Arc<(Mutex<Vec<String>>, Condvar)>,
    reader: Option<JoinHandle<()>>,
}

impl Process {
    /// Starts a program and reads its standard output; standard error goes where the test's does.
    #[allow(clippy::disallowed_methods)] // one thread a child, joined when it ends
    pub fn start(command: &mut Command) -> Process {
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        let lines: Arc<(Mutex<Vec<String>>, Condvar)> = Arc::default();
        let told = Arc::clone(&lines);
        let reader = std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                told.0.lock().unwrap().push(line);
                told.1.notify_all();
            }
        });
        Process { child, lines, reader: Some(reader) }
    }

    /// Waits until `find` is satisfied with what was printed so far.
    pub fn wait_for<T>(&self, what: &str, find: impl Fn(&[String]) -> Option<T>) -> T {
        let (lines, more) = &*self.lines;
        let mut lines = lines.lock().unwrap();
        loop {
            if let Some(found) = find(&lines) {
                return found;
            }
            let (woken, late) = more.wait_timeout(lines, PATIENCE).unwrap();
            lines = woken;
            assert!(!late.timed_out(), "no {what} in {lines:?}");
        }
    }

    pub fn lines(&self) -> Vec<String> {
        self.lines.0.lock().unwrap().clone()
    }

    /// Waits for the end and all of the output.
    pub fn end(mut self) -> (Option<i32>, Vec<String>) {
        self.reader.take().unwrap().join().unwrap();
        (self.child.wait().unwrap().code(), self.lines())
    }

    /// Sends a signal by name.
    pub fn signal(&self, name: &str) {
        signal(self.child.id(), name);
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        if self.child.kill().is_ok() {
            self.child.wait().unwrap();
        }
    }
}

/// Sends a signal to a process that a test has started.
pub fn signal(pid: u32, name: &str) {
    let sent = Command::new("sh").args(["-c", &format!("kill -{name} {pid}")]).status().unwrap();
    assert!(sent.success());
}

/// A host in a process of its own that prints where it listens.
pub struct HostProcess {
    pub process: Process,
    pub address: Address,
}

impl HostProcess {
    /// Starts a host and waits until it listens.
    pub fn start(command: &mut Command) -> HostProcess {
        let process = Process::start(command);
        let address = process.wait_for("address", |lines| {
            lines.iter().find_map(|line| line.strip_prefix("listening on ")?.parse().ok())
        });
        HostProcess { process, address }
    }

    /// `acm sim serve` on a socket file.
    pub fn simulator(scenario: &str, seed: u64, socket: &Path) -> HostProcess {
        let (seed, listen) = (seed.to_string(), Address::Unix(socket.into()).to_string());
        HostProcess::start(&mut acm(&["sim", "serve", scenario, "--seed", &seed, "--listen", &listen]))
    }
}

/// Wall time of a test's own limit.
#[allow(clippy::disallowed_methods)]
pub fn now() -> Instant {
    Instant::now()
}
