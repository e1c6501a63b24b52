//! Decisions about which a model may be asked, in a symbolic world.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that panics fails, which is what it shall do")]

mod world;

use acm_concept::{skill::FailureCause, task::OnUnknown};
use acm_planner::{Choice, Decision, Planner, Question, Task};
use serde_json::json;
use world::{Fault, World, library, options, run, situation};

fn task() -> Task {
    Planner::new().unwrap().parse("Press the button.", &library()).unwrap()
}

/// What is open in a world, if a model may be asked about everything.
fn choice(world: &World) -> Option<Choice> {
    let options = options(OnUnknown::Abstain, 0);
    Planner::new().unwrap().choice(&task(), world, &situation(world, 0), &options, |_| true)
}

/// A world in which a press has just failed.
fn failed() -> World {
    let mut world = World::with_mats(3, 0);
    world.faults.push(("press", 1, Fault::Fails(FailureCause::Press)));
    let mut before = None;
    run(&mut world, &task(), &options(OnUnknown::Abstain, 0), |world, _| {
        if world.transitions.len() == 1 && before.is_none() {
            before = Some(world.clone());
        }
    });
    before.expect("a press that failed")
}

#[test]
fn with_one_way_and_no_failure_nobody_is_asked() {
    assert_eq!(choice(&World::with_mats(3, 0)), None);
}

#[test]
fn after_a_failure_the_model_may_try_again_look_or_give_up() {
    let choice = choice(&failed()).expect("a failure to reflect on");
    assert_eq!(choice.question, Question::Reflect);
    assert_eq!(choice.prompt.schema["properties"]["way"]["enum"], json!(["W1", "look", "give-up"]));
    assert!(choice.prompt.user.contains("press") && choice.prompt.user.contains("it failed"), "{}", choice.prompt.user);
    let say = |way: &str| choice.understand(&json!({ "diagnosis": "It slipped.", "reason": "Once more.", "way": way }));
    let again = say("W1").unwrap();
    assert_eq!(again.decision, choice.own());
    assert!(matches!(&again.decision, Decision::Act { step, .. } if step.attempt == 1), "with other parameters");
    assert_eq!(again.reason, "It slipped. Once more.");
    assert!(matches!(say("look").unwrap().decision, Decision::Look { .. }));
    assert!(
        matches!(say("give-up").unwrap().decision, Decision::GiveUp { unknown, .. } if unknown.text.contains("slipped"))
    );
    let refused = say("W2").unwrap_err();
    assert!(refused[0].contains("no way `W2`") && refused[0].contains("W1, look, give-up"), "{refused:?}");
}
