//! A language model that answers as badly as it can at every stage never gets a skill run whose preconditions do not hold.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that panics fails, which is what it shall do")]

mod world;

use acm_concept::{
    literal::{Literal, Truth},
    skill::FailureCause,
    task::OnUnknown,
};
use acm_memory::{MemoryView, query::SkillCandidate};
use acm_planner::{Choice, Decision, Planner, Task};
use glam::DVec2;
use rand::{Rng, seq::IndexedRandom};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use serde_json::{Value, json};
use world::{BLUE, Fault, GREEN, RED, World, moment, options, robot, situation};

/// Episodes that are played.
const EPISODES: u64 = 300;
/// Wrong answers that are tried for one reading.
const MAX_WRONG: u32 = 40;
/// Decisions of one episode.
const MAX_DECISIONS: u32 = 60;

/// What the instructions are that the model is to read.
const INSTRUCTIONS: [&str; 6] = [
    "Bring the red cube to the middle, press the button, then return it to where it came from.",
    "Swap the red cube and the blue cube.",
    "Hide both cubes, then reveal the red cube.",
    "Pick up the blue cube, press the button twice and put the cube on the left mat.",
    "If the button was pressed, put each cube on a mat, otherwise pick up the red cube.",
    "Do not touch the blue cube. Put the red cube beside the button.",
];

/// Words that a hostile answer may have anywhere.
const WORDS: [&str; 14] = [
    "cube",
    "mat",
    "button",
    "O1",
    "P1.0",
    "pick",
    "place",
    "press",
    "covered",
    "holding",
    "at",
    "in-place-of",
    "\u{0}",
    "",
];

/// Changes an answer somewhere.
fn corrupt(answer: &mut Value, rng: &mut ChaCha8Rng) {
    match answer {
        Value::Object(fields) if !fields.is_empty() && rng.random_bool(0.95) => {
            let at = rng.random_range(0..fields.len());
            if rng.random_bool(0.03) {
                let name = fields.keys().nth(at).cloned().unwrap();
                fields.remove(&name);
            } else {
                corrupt(fields.values_mut().nth(at).unwrap(), rng);
            }
        }
        Value::Array(items) if !items.is_empty() && rng.random_bool(0.9) => {
            let at = rng.random_range(0..items.len());
            match rng.random_range(0..8) {
                0 => _ = items.remove(at),
                1 => items.push(items[at].clone()),
                2 => {
                    let other = rng.random_range(0..items.len());
                    items.swap(at, other);
                }
                _ => corrupt(&mut items[at], rng),
            }
        }
        Value::Bool(value) => *value = !*value,
        Value::Number(_) => *answer = json!(rng.random_range(0..6)),
        other => {
            *other = match rng.random_range(0..4) {
                0 => json!(rng.random_range(-1..6)),
                1 => Value::Null,
                _ => json!(WORDS.choose(rng).unwrap()),
            }
        }
    }
}

/// A task out of an answer that was made wrong, or as the rules read the instruction where it is refused.
fn read(planner: &Planner, world: &World, rng: &mut ChaCha8Rng) -> (Task, bool) {
    let text = INSTRUCTIONS.choose(rng).unwrap();
    let by_rules = planner.parse(text, &world.library);
    let readable = INSTRUCTIONS.iter().find_map(|text| planner.parse(text, &world.library).ok()).unwrap();
    let task = by_rules.unwrap_or(readable);
    let answer = serde_json::to_value(planner.answer(&task)).unwrap();
    // It goes on until one of its wrong answers is taken.
    for _ in 0..MAX_WRONG {
        let mut wrong = answer.clone();
        for _ in 0..rng.random_range(1..4) {
            corrupt(&mut wrong, rng);
        }
        match planner.understand(&task.instruction, &world.library, &wrong) {
            Ok(other) if other != task => return (other, true),
            _ => {}
        }
    }
    (task, false)
}

/// What the model has the robot do: mostly anything but what is sensible.
fn choose(choice: &Choice, rng: &mut ChaCha8Rng) -> (Decision, bool) {
    let way = ["W1", "W2", "W3", "W4", "W5", "w1", "look", "give-up", "pick O1", ""].choose(rng).unwrap();
    let mut answer = json!({ "reason": "because", "way": way });
    if rng.random_bool(0.7) {
        answer["diagnosis"] = json!("nobody knows");
    }
    if rng.random_bool(0.1) {
        corrupt(&mut answer, rng);
    }
    match choice.understand(&answer) {
        Ok(chosen) => (chosen.decision, true),
        Err(_) => (choice.own(), false),
    }
}

fn world(rng: &mut ChaCha8Rng) -> World {
    let mut world = World::with_mats(3, rng.random_range(0..3));
    let blue = world.cube(DVec2::new(0.2, 0.15), BLUE, None);
    if rng.random_bool(0.5) {
        // On the other cube: that one cannot be taken as it stands.
        world.cube(world.spot(blue), GREEN, Some(blue));
    }
    for at in [-0.25, -0.35] {
        world.cover(DVec2::new(at, 0.2));
    }
    world.visible.insert("pressed".into());
    for skill in ["pick", "place", "press"] {
        let fault = [Fault::Fails(FailureCause::Grasp), Fault::CannotTell].choose(rng).copied().unwrap();
        if rng.random_bool(0.8) {
            world.faults.push((skill, rng.random_range(1..4), fault));
        }
    }
    world.cube(DVec2::new(-0.1, 0.25), RED, None);
    world
}

/// The preconditions of a skill that do not hold in the world as it is.
fn violated<'a>(world: &World, candidate: &'a SkillCandidate) -> Vec<&'a Literal> {
    candidate.preconditions.iter().filter(|literal| world.belief(literal).truth == Truth::No).collect()
}

/// What came of the episodes.
#[derive(Default)]
struct Count {
    understood: u32,
    chosen: u32,
    executed: u32,
    violations: Vec<String>,
}

fn play(seed: u64, count: &mut Count) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (planner, mut world) = (Planner::new().unwrap(), world(&mut rng));
    let (task, understood) = read(&planner, &world, &mut rng);
    count.understood += u32::from(understood);
    let options = options(if rng.random_bool(0.5) { OnUnknown::Abstain } else { OnUnknown::Guess }, seed);
    let mut looks = 0;
    for _ in 0..MAX_DECISIONS {
        let situation = situation(&world, looks);
        let decision = match planner.choice(&task, &world, &situation, &options, |_| true) {
            Some(choice) => {
                let (decision, accepted) = choose(&choice, &mut rng);
                count.chosen += u32::from(accepted);
                decision
            }
            None => planner.decide(&task, &world, &situation, &options),
        };
        looks = if matches!(decision, Decision::Look { .. }) { looks + 1 } else { 0 };
        match decision {
            Decision::Act { step, .. } => {
                let violated = violated(&world, &step.candidate);
                let said = |literal: &&Literal| format!("seed {seed}: {} without {literal}", step.candidate.skill);
                count.violations.extend(violated.iter().map(said));
                // What cannot be bound to what is perceived is not run.
                let (Ok(invocation), true) = (planner.bind(&step, &world, &robot()), violated.is_empty()) else {
                    return;
                };
                count.executed += 1;
                world.execute(&step, invocation);
            }
            Decision::Look { .. } => world.look(),
            Decision::SubtaskDone { index, .. } => {
                world.now = world.now + 0.01;
                let now = moment(world.now);
                world.progress.done.push((index, now));
            }
            Decision::Done { .. } | Decision::GiveUp { .. } => return,
        }
    }
}

#[test]
fn a_hostile_model_gets_no_violated_precondition_executed() {
    let mut count = Count::default();
    for seed in 0..EPISODES {
        play(seed, &mut count);
    }
    let Count { understood, chosen, executed, violations } = count;
    println!("{EPISODES} episodes: {understood} wrong readings and {chosen} choices were taken, {executed} skills run");
    assert_eq!(violations, Vec::<String>::new());
    // It was hostile indeed: enough of what it said was taken, and enough was done on it.
    assert!(understood * 2 >= EPISODES as u32 && chosen > 30 && executed > 300, "{understood} {chosen} {executed}");
}

/// The count sees violations: skills taken blindly from what memory offers have them.
#[test]
fn skills_that_are_run_without_planning_violate_their_preconditions() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let world = world(&mut rng);
    let offered = world.objects.iter().flat_map(|entry| world.skill_candidates(entry.id, entry.place()));
    assert!(offered.into_iter().any(|candidate| !violated(&world, &candidate).is_empty()));
}
