//! MuJoCo in a Python process, which takes turns with us: on a busy machine both are disturbed alike, and the best of
//! several turns counts for both.

use anyhow::{Context, bail};
use serde_json::Value;
use std::{
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

/// The peer's program; `scripts/peers.sh` installs what it needs.
const PROGRAM: &str = include_str!("../../../scripts/peers/mujoco_world.py");
/// Names the Python that has MuJoCo, if it is not in the usual place.
const PYTHON: &str = "ACM_PEERS_PYTHON";

/// The other process, ready for its first turn.
pub struct Peer {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    /// MuJoCo's version.
    pub version: String,
}

impl Peer {
    /// Starts the peer with its task and waits until its scene stands.
    ///
    /// # Errors
    /// There is no Python, no MuJoCo, or its scene fails: in words.
    pub fn start(task: &Value) -> anyhow::Result<Peer> {
        let python = python();
        let mut child = Command::new(&python)
            .args(["-c", PROGRAM])
            .env("MUJOCO_GL", "egl")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("{} cannot be started", python.display()))?;
        let (Some(mut input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            bail!("the peer has no standard input or output");
        };
        // A peer that is already gone says why below.
        let told = writeln!(input, "{task}");
        let mut peer = Peer { child, input, output: BufReader::new(output), version: String::new() };
        match told.map_err(anyhow::Error::from).and_then(|()| peer.answer()) {
            Ok(ready) => {
                peer.version = ready["version"].as_str().unwrap_or("?").to_string();
                Ok(peer)
            }
            Err(_gone) => Err(peer.last_words(&python)),
        }
    }

    /// One turn: what it measured.
    pub fn turn(&mut self) -> anyhow::Result<Value> {
        writeln!(self.input, "go")?;
        self.answer()
    }

    fn answer(&mut self) -> anyhow::Result<Value> {
        let mut line = String::new();
        self.output.read_line(&mut line)?;
        if line.is_empty() {
            bail!("the peer has ended");
        }
        Ok(serde_json::from_str(&line)?)
    }

    fn last_words(mut self, python: &Path) -> anyhow::Error {
        let words = self.child.stderr.take().map(std::io::read_to_string).and_then(Result::ok).unwrap_or_default();
        let last = words.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it ended without a word");
        anyhow::anyhow!("no peer by {}: {last} (scripts/peers.sh installs it)", python.display())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself, which is as good.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// The Python that is asked: the one that is named, the one that `scripts/peers.sh` makes, or the system's.
pub fn python() -> PathBuf {
    if let Some(named) = std::env::var_os(PYTHON) {
        return named.into();
    }
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    let made = Path::new(env!("CARGO_MANIFEST_DIR")).join(target).join("peers/bin/python");
    if made.is_file() { made } else { "python3".into() }
}

/// The best of several turns: units of work per processor second.
pub fn best(rates: &[f64]) -> f64 {
    rates.iter().copied().fold(0.0, f64::max)
}

/// A number of an answer.
pub fn number(answer: &Value, name: &str) -> anyhow::Result<f64> {
    answer[name].as_f64().with_context(|| format!("the peer's answer has no number `{name}`: {answer}"))
}
