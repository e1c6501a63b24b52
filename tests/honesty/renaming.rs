//! Scenario, objects, templates, parameters and colours under other names, one to one: the same deeds.

use crate::{Lived, live, runner, words::Vocabulary, world::World};
use acm_runtime::journal::Entry;
use serde_json::Value as Json;
use toml::Value;

/// Runs a scenario with this instruction as it is, and again with everything in other words.
fn both(scenario: &str, seed: u64, instruction: &str) -> ([Lived; 2], Vocabulary) {
    let (runner, folder, words) = (runner(), tempfile::tempdir().unwrap(), Vocabulary::mirrored());
    let said = words.say(instruction);
    assert_ne!(said, instruction);
    let other = runner.with_words(words.library.clone(), words.lexicon.clone()).unwrap();
    let lived =
        [(&*runner, instruction, false), (&other, said.as_str(), true)].map(|(runner, instruction, renamed)| {
            let mut world = World::read(scenario);
            if renamed {
                world.rename();
            }
            let task = world.0["task"].as_table_mut().unwrap();
            task.insert("instruction".into(), Value::from(instruction));
            let path = folder.path().join(format!("{renamed}.toml"));
            world.write(&path);
            live(runner, &path, seed)
        });
    (lived, words)
}

/// A message without the words: who told whom what, when.
fn told(entry: &Entry) -> (Option<u64>, String, String, &'static str, u64) {
    (entry.cause, entry.from.to_string(), entry.to.to_string(), entry.kind, entry.time_ns)
}

fn renaming_changes_nothing(scenario: &str, seed: u64, instruction: &str) {
    let ([plain, renamed], words) = both(scenario, seed, instruction);
    assert!(plain.result.solved, "{:?}; {}", plain.result.report.ending, plain.result.verdict.explanation);
    for (plain, renamed) in plain.entries.iter().zip(&renamed.entries) {
        let json = |entry: &Entry| serde_json::from_slice::<Json>(&entry.body).unwrap();
        let (expected, understood) = (json(plain), words.understand(json(renamed)));
        assert_eq!(expected.to_string(), understood.to_string(), "message {} ({})", plain.seq, plain.kind);
        assert_eq!(told(plain), told(renamed));
    }
    assert_eq!(plain.entries.len(), renamed.entries.len());
    let commands = |lived: &Lived| -> Vec<Vec<u8>> {
        lived.entries.iter().filter(|entry| entry.kind == "command").map(|entry| entry.body.clone()).collect()
    };
    // Commands hold no words: they are equal to the byte.
    assert!(commands(&plain).len() > 100);
    assert_eq!(commands(&plain), commands(&renamed));
    assert!(renamed.result.solved, "{}", renamed.result.verdict.explanation);
}

#[test]
fn a_block_under_another_name_is_put_back_alike() {
    let instruction = "Put the red cube in the middle of the mats, press the button once, then bring the cube back to \
                       its old place.";
    renaming_changes_nothing("put-back-block", 1, instruction);
}

#[test]
fn a_stapler_under_another_name_is_returned_alike() {
    renaming_changes_nothing("return-stapler-unseen", 1, "Put the stapler back where it was.");
}

#[test]
fn the_old_words_mean_nothing_any_more() {
    let words = Vocabulary::mirrored();
    let planner = acm_planner::Planner::with_lexicon(words.lexicon.clone());
    for instruction in ["Press the button.", "Put the red cube back.", "Return the stapler to where it was."] {
        assert!(planner.parse(instruction, &words.library).is_err(), "{instruction}");
        let said = words.say(instruction);
        assert!(planner.parse(&said, &words.library).is_ok(), "{said}");
    }
}
