//! What the agent does on tasks of memory rests on its memory, and on nothing else: without sight or past it says so, and with
//! another past it acts on that one.

use super::{run, unknown, with_runner};
use acm::{
    episode::{EpisodeConfig, EpisodeResult},
    inject::{Faults, Injection},
};
use acm_actors::report::Ending;
use acm_concept::task::OnUnknown;
use acm_runtime::journal::NoJournal;
use acm_sim::Scenario;
use glam::DVec3;
use std::{path::Path, sync::Arc};

const TASKS: [&str; 3] = ["rearrange-blocks", "cover-blocks", "put-back-block"];

#[test]
fn without_sight_every_task_ends_in_a_give_up() {
    for task in TASKS {
        let result = run(task, 1, &["black-frames"], |_| {});
        assert!(unknown(&result).to_lowercase().contains("see"), "{task}: {}", unknown(&result));
        assert_eq!(result.motion_commands, 0, "{task}");
    }
}

/// The run begins anew with what is to be seen then: the gap is empty, or the colours are under their lids.
#[test]
fn without_its_past_a_task_in_the_middle_ends_in_a_give_up() {
    for (task, event, unknown_thing) in [
        ("rearrange-blocks", "first-verified-place", "no cube standing in the gap"),
        ("rearrange-blocks", "first-verified-press", "no cube standing in the gap"),
        ("cover-blocks", "first-verified-place", "no red"),
    ] {
        let whole = run(task, 1, &[], |_| {});
        assert!(whole.solved, "{task} is solved with its past: {}", whole.verdict.explanation);
        let wiped = run(task, 1, &[&format!("wipe-memory@{event}")], |_| {});
        assert!(unknown(&wiped).contains(unknown_thing), "{task} after {event}: {}", unknown(&wiped));
    }
}

/// One of four mats is the right one: five draws do not all hit it.
#[test]
fn without_its_past_a_guess_is_no_better_than_chance() {
    let guess = |seed| {
        run("put-back-block", seed, &["wipe-memory@first-verified-place"], |config| {
            config.settings.on_unknown = OnUnknown::Guess;
        })
    };
    let results: Vec<EpisodeResult> = (0..5).map(guess).collect();
    assert!(results.iter().all(|result| result.report.steps.iter().any(|step| step.guessed)), "nothing was guessed");
    let solved = results.iter().filter(|result| result.solved).count();
    assert!(solved < results.len(), "{solved} of {} guesses were right", results.len());
}

/// Runs an episode and tells where a thing was at the beginning and where it ended, in truth.
fn carried(seed: u64, faults: &[&str], memory: Option<&Path>, thing: &str) -> (EpisodeResult, DVec3, DVec3) {
    let injections: Vec<Injection> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    let config = EpisodeConfig {
        method: "acm".into(),
        faults: Faults::new(&injections),
        memory: memory.map(Path::to_path_buf),
        ..EpisodeConfig::default()
    };
    with_runner(|runner| {
        let scenario = Scenario::open("put-back-block").unwrap();
        let world = runner.world(&scenario, seed, &config).unwrap();
        let at = || world.simulation().truth().iter().find(|object| object.name == thing).unwrap().pose.translation;
        let began = at();
        let result = runner.run_in(&world, &config, Arc::new(NoJournal)).unwrap();
        (result, began, at())
    })
}

/// Not only is the outcome wrong: it is the donor's.
#[test]
fn with_another_runs_memory_the_block_goes_where_that_one_took_it_from() {
    let dir = tempfile::tempdir().unwrap();
    let donor = dir.path().join("donor");
    let (own, donors, back) = carried(0, &[], Some(&donor), "cube");
    assert!(own.solved && back.distance(donors) < 0.03, "{}", own.verdict.explanation);
    let fault = format!("transplant-memory={}@first-verified-place", donor.display());
    let (other, its_own, end) = carried(2, &[&fault], None, "cube");
    assert!(its_own.distance(donors) > 0.05, "the two worlds begin alike");
    assert_eq!(other.report.ending, Ending::Done);
    assert!(end.distance(donors) < 0.03, "the block is {:.3} m from the donor's mat", end.distance(donors));
}
