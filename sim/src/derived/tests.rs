#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
//! Over the scripted expert, in the world of the first scenario; and what else scenario files can say about numbers.

use crate::{Scenario, ScenarioError, SimOptions, Simulation, expert::Expert, layout::Layout};

const BLOCK: &str = include_str!("../../scenarios/put-back-block.toml");
const MORE: &str = r#"
[[point]]
name = "corner"
of = { object = "cube" }
at = [0.02, 0.02, "0.04"]

[[derived]]
name = "across"
is = "corner_x - cube_x"

[[derived]]
name = "above"
is = "(corner_z > 0.8) + 10 * (across > 0)"

[[object]]
name = "other"
models = ["stapler", "red-cube"]
which = "fixed_poses_3 + (start_mat > 1)"
position = [-0.1, 0.15, 0.74]
"#;
const DRAWS: &str = r#"
[[random.draw]]
kind = "uniform"
name = "first"
low = 0.0
high = 1.0

[[random.draw]]
kind = "value"
name = "twice"
is = "2 * first"

[[random.draw]]
kind = "uniform"
name = "last"
low = 0.0
high = 1.0

[[random.reject]]
when = "first < 0.5"
after = "first"
redraw_from = "first"

[[object]]
name = "button"
"#;

fn scenario(from: &str, to: &str) -> Result<Scenario, ScenarioError> {
    let more = format!("{MORE}\n[judge]\n");
    let text = BLOCK.replacen("[judge]\n", &more, 1).replacen("[[object]]\nname = \"button\"\n", DRAWS, 1);
    assert!(text.contains(from), "the test looks for `{from}`");
    Scenario::parse("more.toml", &text.replacen(from, to, 1))
}

fn value(expert: &Expert, name: &str) -> f64 {
    expert.simulation.variables().into_iter().find(|(known, _)| known == name).unwrap().1
}

#[test]
fn a_point_moves_with_its_object_and_numbers_follow() {
    let simulation = Simulation::without_renderer(&scenario("", "").unwrap(), &SimOptions::default()).unwrap();
    let mut expert = Expert::of(simulation);
    assert!((value(&expert, "across") - 0.02).abs() < 1e-4 && value(&expert, "above") == 10.0);
    expert.pick("cube");
    let cube = expert.object("cube").pose.translation;
    assert!((value(&expert, "corner_z") - cube.z - 0.04).abs() < 1e-3, "{}", value(&expert, "corner_z"));
    assert_eq!(value(&expert, "above"), 11.0);
    assert!(value(&expert, "hands_moved") > 0.1 && value(&expert, "cube_yaw").abs() < 0.01);
}

/// NumPy's legacy stream after the original's draws: numbers are drawn until one is 0.5 or more, and only then the next.
#[test]
fn a_rule_that_looks_at_once_draws_on_in_the_streams_order() {
    let (with, without) =
        (scenario("", "").unwrap(), scenario("when = \"first < 0.5\"", "when = \"first < 0\"").unwrap());
    let mut again = 0;
    for seed in 0..20 {
        let [with, without] = [&with, &without].map(|scenario| Layout::draw(&scenario.world, seed).unwrap());
        let draw = |layout: &Layout, name: &str| layout.draws.scalars().find(|(known, _)| *known == name).unwrap().1;
        let (first, plain) = (draw(&with, "first"), draw(&without, "first"));
        assert!(first >= 0.5 && draw(&with, "twice") == 2.0 * first);
        // Where the first number will do, all is as without the rule; where it will not, the next number is tried.
        if plain >= 0.5 {
            assert_eq!((first, draw(&with, "last")), (plain, draw(&without, "last")));
        } else if draw(&without, "last") >= 0.5 {
            assert_eq!(first, draw(&without, "last"));
            again += 1;
        }
    }
    assert!(again > 0, "no seed was drawn anew");
}

#[test]
fn an_episode_takes_one_of_several_models() {
    let scenario = scenario("", "").unwrap();
    for seed in 100_000..100_004 {
        let layout = Layout::draw(&scenario.world, seed).unwrap();
        let other = layout.objects.iter().find(|object| object.name == "other").unwrap();
        let start_mat = layout.draws.scalars().find(|(known, _)| *known == "start_mat").unwrap().1;
        assert_eq!(other.model.model, if start_mat > 1.0 { "red-cube" } else { "stapler" });
    }
}

#[test]
fn mistakes_name_the_place() {
    let cases = [
        ("is = \"corner_x - cube_x\"", "is = \"above\"", "names `above`"),
        ("is = \"2 * first\"", "is = \"2 * last\"", "names `last`"),
        ("of = { object = \"cube\" }\nat", "of = { object = \"cub\" }\nat", "did you mean `cube`"),
        ("\"stapler\", \"red-cube\"]", "\"stapler\", \"red-cub\"]", "did you mean `red-cube`"),
        ("\"stapler\", \"red-cube\"]", "\"stapler\", \"push-button\"]", "links or lamps"),
        ("which = \"fixed_poses_3 + (start_mat > 1)\"\n", "", "go together"),
        ("models = [", "model = \"stapler\"\nmodels = [", "needs either"),
        ("after = \"first\"", "after = \"frist\"", "did you mean `first`"),
        ("when = \"first < 0.5\"", "when = \"last < 0.5\"", "names `last`"),
        ("redraw_from = \"first\"", "redraw_from = \"last\"", "only after"),
        ("name = \"twice\"", "name = \"fixed_poses_2\"", "value in a list"),
    ];
    for (from, to, expected) in cases {
        let message = scenario(from, to).unwrap_err().to_string();
        assert!(message.contains("more.toml") && message.contains(expected), "{from} -> {to}: {message}");
    }
    let beyond = scenario("which = \"fixed_poses_3 + ", "which = \"7 + ").unwrap();
    let error = Layout::draw(&beyond.world, 0).unwrap_err().to_string();
    assert!(error.contains("other") && error.contains("0 to 1"), "{error}");
}
