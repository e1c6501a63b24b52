#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
//! Over the scripted expert, in a world of the first scenario with state of its own.

use crate::{Scenario, ScenarioError, SimOptions, Simulation, expert::Expert};

const BLOCK: &str = include_str!("../../scenarios/put-back-block.toml");
const STATE: &str = r#"
[[region]]
name = "middle_mats"
low = ["middle_x - 0.05", "middle_y - 0.05", 0.74]
high = ["middle_x + 0.05", "middle_y + 0.05", 0.84]

[[region]]
name = "above_button"
of = { object = "button" }
low = [-0.05, -0.05, 0.0]
high = [0.05, 0.05, 0.3]

[[fluent]]
name = "timer"
rate = "-(timer > 0)"
low = 0

[[fluent]]
name = "heat"
start = "20"
rate = "10 * (timer > 0) * middle_mats_has_cube"
high = 25

[[fluent]]
name = "strokes"

[[rule]]
name = "the button starts the timer"
when = "button_pressed > 0"
set = { timer = 2, strokes = "strokes + 1" }
"#;

fn world(extra: &str) -> Result<Scenario, ScenarioError> {
    // The judge's tables stand last in the file; these go before them.
    Scenario::parse("state.toml", &BLOCK.replace("[judge]\n", &format!("{extra}\n[judge]\n")))
}

fn value(expert: &Expert, name: &str) -> f64 {
    expert.simulation.variables().into_iter().find(|(known, _)| known == name).unwrap().1
}

#[test]
fn a_timer_that_a_button_starts_heats_what_is_in_a_region() {
    let scenario = world(STATE).unwrap();
    let mut expert = Expert::of(Simulation::without_renderer(&scenario, &SimOptions::default()).unwrap());
    assert_eq!(
        [value(&expert, "timer"), value(&expert, "heat"), value(&expert, "middle_mats_has_cube")],
        [0.0, 20.0, 0.0]
    );
    expert.press("button");
    let (left, heat) = (value(&expert, "timer"), value(&expert, "heat"));
    assert!(left < 2.0 && heat == 20.0, "the cube is not in the region: {left} {heat}");
    expert.wait(2.5);
    assert_eq!([value(&expert, "timer"), value(&expert, "strokes")], [0.0, 1.0]);
    expert.pick("cube");
    expert.place("cube", 0.1, -0.1, 0.74);
    assert_eq!([value(&expert, "middle_mats_has_cube"), value(&expert, "middle_mats_count")], [1.0, 1.0]);
    expert.press("button");
    expert.wait(2.5);
    assert_eq!([value(&expert, "heat"), value(&expert, "strokes")], [25.0, 2.0]);
    // Looking at the outcome goes ahead in a copy of the world alone.
    expert.press("button");
    let before = value(&expert, "timer");
    expert.simulation.verdict();
    assert_eq!(value(&expert, "timer"), before);
}

#[test]
fn a_region_moves_with_its_object_and_does_not_hold_it() {
    let scenario = world(STATE).unwrap();
    let mut expert = Expert::of(Simulation::without_renderer(&scenario, &SimOptions::default()).unwrap());
    assert_eq!(value(&expert, "above_button_count"), 0.0);
    let button = expert.object("button").pose.translation;
    expert.pick("cube");
    expert.go(crate::expert::down(button + glam::DVec3::Z * 0.2, 0.0), 0.2);
    expert.wait(0.2);
    assert_eq!(value(&expert, "above_button_has_cube"), 1.0);
}

#[test]
fn mistakes_name_the_place() {
    let message = |from: &str, to: &str| world(&STATE.replace(from, to)).unwrap_err().to_string();
    assert!(message("set = { timer", "set = { tmer").contains("did you mean `timer`?"));
    assert!(message("button_pressed > 0", "buton_pressed > 0").contains("buton_pressed"));
    assert!(message("name = \"heat\"", "name = \"cube\"").contains("is taken"));
    assert!(message("high = 25", "high = 25\nlow = 30").contains("low = 30"));
    assert!(message("low = [-0.05, -0.05, 0.0]", "low = [0.05, -0.05]").contains("low"));
    let upside_down = world(&STATE.replace("high = [0.05, 0.05, 0.3]", "high = [0.05, 0.05, -0.3]")).unwrap();
    let error = Simulation::without_renderer(&upside_down, &SimOptions::default()).map(|_| ()).unwrap_err();
    assert!(error.to_string().contains("above_button"), "{error}");
}

#[test]
fn a_drop_lets_the_cube_fall_and_the_hand_can_take_it_again() {
    let scenario = world("[[fault]]\nkind = \"drop\"\n").unwrap();
    let mut expert = Expert::of(Simulation::without_renderer(&scenario, &SimOptions::default()).unwrap());
    expert.pick("cube");
    let felt = expert.wait(0.6);
    let cube = expert.object("cube");
    assert!(!cube.held && cube.pose.translation.z < 0.75 && felt.opening_m < 0.005, "{cube:?} {felt:?}");
    let message = world("[[fault]]\nkind = \"drop\"\nat_carry = 0\n").unwrap_err().to_string();
    assert!(message.contains("counted from 1"), "{message}");
}
