//! Proofs that the agent lives by what it sees and feels: worlds that look and feel alike but are named and filled
//! differently give the same journal, and another vocabulary gives the same deeds.
//!
//! | module | holds |
//! |---|---|
//! | `taint` | other names, hidden contents and judge, the same journal |
//! | `renaming` | other words for scenario, objects, templates and colours, the same deeds |
//! | `world` | scenario files rewritten |
//! | `words` | library, lexicon and instruction in other words |
#![allow(clippy::unwrap_used, clippy::expect_used)] // a failed unwrap is the test's verdict

mod renaming;
mod taint;
mod words;
mod world;

use acm::{
    episode::{EpisodeConfig, EpisodeResult, Runner},
    inject::FrameTap,
};
use acm_concept::camera::RgbdFrame;
use acm_runtime::journal::{Entry, MemoryJournal};
use acm_sim::Scenario;
use std::{
    path::Path,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};

/// More frames than any of these episodes takes.
const MAX_FRAMES: usize = 150;

/// One renderer for all tests of this binary: it takes a second to start, and software drivers dislike several.
fn runner() -> MutexGuard<'static, Runner> {
    static RUNNER: OnceLock<Mutex<Runner>> = OnceLock::new();
    RUNNER.get_or_init(|| Mutex::new(Runner::new().unwrap())).lock().unwrap_or_else(PoisonError::into_inner)
}

/// An episode with everything that reached the agent.
struct Lived {
    result: EpisodeResult,
    entries: Vec<Entry>,
    frames: Vec<RgbdFrame>,
}

/// Runs an episode of a scenario file.
fn live(runner: &Runner, scenario: &Path, seed: u64) -> Lived {
    let (journal, tap) = (MemoryJournal::default(), FrameTap::first(MAX_FRAMES));
    let config = EpisodeConfig { method: "acm".into(), frames: Some(tap.clone()), ..EpisodeConfig::default() };
    let scenario = Scenario::open(scenario.to_str().unwrap()).unwrap();
    let result = runner.run(&scenario, seed, &config, Arc::new(journal.clone())).unwrap();
    Lived { result, entries: journal.entries(), frames: tap.frames() }
}

/// A body as text.
fn body(entry: &Entry) -> String {
    String::from_utf8_lossy(&entry.body).into_owned()
}
