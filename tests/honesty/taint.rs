//! Two worlds with equal pixels and feedback but other names, ids and hidden contents give equal journals.

use crate::{
    Lived, body, live, runner,
    world::{World, text},
};
use std::path::Path;
use toml::Value;

/// A hollow chest without a lid that opens; part of both worlds.
const CHEST: &str = r##"
[[model]]
model = "chest"
summary = "a closed chest, 160 by 100 mm, 84 mm high"
fixed = true
solid = [
    { shape = "box", size = [0.16, 0.10, 0.004], position = [0.0, 0.0, 0.002], color = "#406040" },
    { shape = "box", size = [0.16, 0.004, 0.08], position = [0.0, 0.048, 0.04], color = "#406040" },
    { shape = "box", size = [0.16, 0.004, 0.08], position = [0.0, -0.048, 0.04], color = "#406040" },
    { shape = "box", size = [0.004, 0.10, 0.08], position = [0.078, 0.0, 0.04], color = "#406040" },
    { shape = "box", size = [0.004, 0.10, 0.08], position = [-0.078, 0.0, 0.04], color = "#406040" },
    { shape = "box", size = [0.16, 0.10, 0.004], position = [0.0, 0.0, 0.082], color = "#406040" },
]
[[object]]
name = "chest"
model = "chest"
position = [-0.42, 0.24, 0.74]
"##;

/// What no camera sees and nothing touches that could be seen: in the chest, under the table, behind the wall. One of
/// them moves.
const HIDDEN: &str = r##"
[[model]]
model = "red-thing"
summary = "what the instruction might be about, were it seen"
solid = [{ shape = "box", size = [0.04, 0.04, 0.04], position = [0.0, 0.0, 0.02], color = "#d6201c" }]
[[model]]
model = "block-in-the-air"
summary = "held by nothing"
fixed = true
solid = [{ shape = "cylinder", radius = 0.03, height = 0.05, position = [0.0, 0.0, 0.025], color = "#10f010" }]
[[object]]
name = "treasure"
model = "red-thing"
position = [-0.42, 0.24, 0.744]
[[object]]
name = "below"
model = "block-in-the-air"
count = 3
position = ["0.1 * i", 0.0, 0.4]
[[object]]
name = "beyond"
model = "block-in-the-air"
position = [0.3, 2.5, 0.5]
[[event]]
name = "something happens where nobody looks"
after_s = 0.5
carry = { object = "beyond" }
to = [-0.3, 2.7, 0.6]
over_s = 3.0
"##;

/// The world as it is, and the same to eye and hand under other names, with hidden contents and another judge.
fn worlds(scenario: &str, folder: &Path) -> [std::path::PathBuf; 2] {
    let [plain, other] = ["plain.toml", "other.toml"].map(|name| folder.join(name));
    let mut world = World::read(scenario);
    world.add(CHEST);
    world.write(&plain);
    let mut world = World::read(scenario);
    world.add(CHEST);
    world.add(HIDDEN);
    world.rename();
    world.reorder();
    world.0.insert("summary".into(), Value::from("Nothing of what you think"));
    let task = world.0["task"].as_table_mut().unwrap();
    task.insert("paraphrases".into(), Value::Array(vec![Value::from("Throw everything off the table.")]));
    let judge = "strict = { stage = [{ name = \"never\", when = \"0 > 1\" }] }".parse().unwrap();
    world.0.insert("judge".into(), Value::Table(judge));
    world.write(&other);
    [plain, other]
}

/// Asserts that all that the agent was shown, felt, thought and did is equal: first the premise, then what follows.
///
/// The premise is not free: with more bodies in the world the physics engine may solve the contacts of a thing of
/// several solids in another order, and then a pose differs in its last digits. A seed at which that shows in a pixel
/// says nothing of the agent; it fails here as what it is.
fn assert_equal(plain: &Lived, other: &Lived) {
    assert_eq!(plain.frames.len(), other.frames.len());
    for (index, (plain, other)) in plain.frames.iter().zip(&other.frames).enumerate() {
        assert_eq!(plain.header, other.header);
        let differ = plain.depth.iter().zip(other.depth.iter()).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        let equal = plain.color == other.color && differ == 0;
        assert!(equal, "the premise fails, take another seed: frame {index}, {differ} depths differ, or colours");
    }
    for (plain, other) in plain.entries.iter().zip(&other.entries) {
        assert_eq!(body(plain), body(other), "message {} ({})", plain.seq, plain.kind);
        assert_eq!(plain, other);
    }
    assert_eq!(plain.entries.len(), other.entries.len());
}

fn hidden_things_change_nothing(scenario: &str, seed: u64) {
    let (runner, folder) = (runner(), tempfile::tempdir().unwrap());
    let [plain, other] = worlds(scenario, folder.path()).map(|path| live(&runner, &path, seed));
    // The agent does its task, and the judges, of whom it is told nothing, do not agree.
    assert!(plain.result.solved, "{:?}; {}", plain.result.report.ending, plain.result.verdict.explanation);
    assert!(!other.result.verdict.strict);
    assert_ne!(plain.result.world, other.result.world, "the worlds are the same");
    assert_equal(&plain, &other);
    let words = ["w900", "m90", "treasure", "red-thing", "Throw everything"];
    for entry in &other.entries {
        let told = body(entry);
        assert!(!words.iter().any(|word| told.contains(word)), "message {}: {told}", entry.seq);
    }
}

#[test]
fn hidden_names_and_contents_leave_no_trace_in_the_journal() {
    hidden_things_change_nothing("put-back-block", 2);
}

#[test]
fn what_happens_unseen_leaves_no_trace_in_the_journal() {
    hidden_things_change_nothing("return-stapler-unseen", 7);
}

#[test]
fn a_change_that_can_be_seen_is_in_the_journal() {
    let (runner, folder) = (runner(), tempfile::tempdir().unwrap());
    let [plain, _] = worlds("put-back-block", folder.path());
    let mut world = World(std::fs::read_to_string(&plain).unwrap().parse().unwrap());
    let repainted = folder.path().join("repainted.toml");
    let cube = world.items("model").iter_mut().find(|model| text(model, "model") == "red-cube").unwrap();
    cube["solid"][0].as_table_mut().unwrap().insert("color".into(), Value::from("#d63a1c"));
    world.write(&repainted);
    let [plain, repainted] = [plain, repainted].map(|path| live(&runner, &path, 2));
    assert!(plain.result.solved && repainted.result.solved, "a shade of red is no other task");
    assert_ne!(plain.entries, repainted.entries);
}
