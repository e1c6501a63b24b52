#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use crate::expert::{OPEN_M, down};
use glam::DVec3;

const EVENT: &str = r#"
[[event]]
name = "somebody moves the cube"
after_s = 0.5
carry = { object = "cube" }
to = [-0.1, 0.1, 0.74]
yaw = 0.5
over_s = 1.0

[[event]]
name = "and back, once it has been there for a while"
when = "cube_x < -0.09 && cube_speed < 0.01"
after_s = 0.3
carry = { object = "cube" }
to = ["start_x", "start_y", 0.741]
over_s = 0.5

[judge]
"#;

fn scenario_with(text: &str) -> Scenario {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/put-back-block.toml");
    let original = std::fs::read_to_string(folder).unwrap();
    Scenario::parse("s.toml", &original.replacen("[judge]\n", text, 1)).unwrap()
}
fn cube(world: &World) -> TrueObject {
    world.truth().into_iter().find(|object| object.name == "cube").unwrap()
}

#[test]
fn third_parties_carry_things_on_time() {
    let mut world = World::new(&scenario_with(EVENT), &SimOptions::default()).unwrap();
    let start = cube(&world).pose;
    world.wait_until(Time::from_seconds(0.48)).unwrap();
    assert!(cube(&world).pose.translation.distance(start.translation) < 1e-4);
    world.wait_until(Time::from_seconds(1.0)).unwrap();
    assert!(cube(&world).pose.translation.z > 0.82, "it is lifted on the way");
    world.wait_until(Time::from_seconds(1.7)).unwrap();
    let there = cube(&world).pose;
    assert!(there.translation.distance(DVec3::new(-0.1, 0.1, 0.74)) < 1e-3 && (there.yaw() - 0.5).abs() < 1e-2);
    world.wait_until(Time::from_seconds(3.0)).unwrap();
    assert!(cube(&world).pose.translation.distance(start.translation) < 1e-3, "{}", cube(&world).pose.translation);
}

const COVER: &str = r#"
[[event]]
name = "somebody stands before the camera"
after_s = 0.5
cover = ["head"]
over_s = 1.0

[judge]
"#;

#[test]
fn a_camera_is_covered_for_as_long_as_the_event_lasts() {
    let mut world = World::new(&scenario_with(COVER), &SimOptions::default()).unwrap();
    let mut covered_at = |seconds: f64| {
        world.wait_until(Time::from_seconds(seconds)).unwrap();
        (world.is_covered(0), world.is_covered(1))
    };
    assert_eq!(
        [0.4, 0.6, 1.4, 1.6].map(&mut covered_at),
        [(false, false), (true, false), (true, false), (false, false)]
    );
    let original = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/put-back-block.toml");
    let wrong = std::fs::read_to_string(original).unwrap().replacen("[judge]\n", &COVER.replace("head", "heat"), 1);
    let error = Scenario::parse("s.toml", &wrong).unwrap_err().to_string();
    assert!(error.contains("no camera `heat`") && error.contains("head"), "{error}");
}

#[test]
fn commands_beyond_the_limits_are_refused_and_move_nothing() {
    let mut world = World::new(&Scenario::open("put-back-block").unwrap(), &SimOptions::default()).unwrap();
    let home = world.robot.description.home;
    let good = Command::hand(home, OPEN_M, 10.0);
    let near = |shift| Pose { translation: home.translation + shift, ..home };
    let bad = [
        Command { tcp: near(DVec3::X * 0.02), ..good },
        Command { tcp: near(DVec3::Z * 9.0), ..good },
        Command { tcp: near(DVec3::X * f64::NAN), ..good },
        Command { tcp: down(home.translation, 0.5), ..good },
        Command { opening_m: 0.2, ..good },
        Command { opening_m: -0.01, ..good },
        Command { grip_force_n: f64::INFINITY, ..good },
        Command { grip_force_n: 1000.0, ..good },
    ];
    for command in bad {
        let error = world.command(&command).unwrap_err();
        assert!(matches!(error, EmbodimentError::Refused { .. }), "{command:?}: {error}");
    }
    assert_eq!(world.now(), Time::ZERO);
    // The fastest allowed motion is 10 mm in a tick.
    let feedback = world.command(&Command { tcp: near(DVec3::X * 0.01), ..good }).unwrap();
    assert_eq!(feedback.time, Time::from_seconds(0.02));
    world.stop();
    assert_eq!(world.command(&good).unwrap_err(), EmbodimentError::Stopped);
    assert!(world.wait_until(Time::from_seconds(0.5)).is_ok());
}

#[test]
fn with_motion_off_nothing_can_be_commanded() {
    let options = SimOptions { motion: false, ..SimOptions::default() };
    let mut world = World::new(&Scenario::open("put-back-block").unwrap(), &options).unwrap();
    let command = Command::hand(world.robot.description.home, OPEN_M, 10.0);
    assert_eq!(world.command(&command).unwrap_err(), EmbodimentError::MotionDisabled);
    assert_eq!(world.wait_until(Time::from_seconds(0.5)).unwrap(), Time::from_seconds(0.5));
}

#[test]
fn the_hand_goes_where_it_is_told() {
    let mut world = World::new(&Scenario::open("put-back-block").unwrap(), &SimOptions::default()).unwrap();
    let home = world.robot.description.home.translation;
    for tick in 1..=50 {
        let tcp = down(home + DVec3::new(0.0, 0.0, -0.008 * f64::from(tick).min(40.0)), 0.0);
        world.command(&Command::hand(tcp, 0.05, 10.0)).unwrap();
    }
    let feedback = world.feedback();
    assert!(feedback.tcp.translation.distance(home - DVec3::Z * 0.32) < 5e-4, "{feedback:?}");
    assert!((feedback.opening_m - 0.05).abs() < 5e-4, "{feedback:?}");
    assert!(world.wait_until(Time::from_seconds(1e6)).is_err());
}

/// The engine's settings must let things stand on each other.
#[test]
fn a_tower_stands() {
    let mut text = "[[object]]\nname = \"floor_0\"\nmodel = \"red-cube\"\nposition = [-0.1, 0.1, 0.74]\n".to_string();
    for floor in 1..5 {
        let below = floor - 1;
        let block = format!(
            "[[object]]\nname = \"floor_{floor}\"\nmodel = \"red-cube\"\non = {{ object = \"floor_{below}\" }}\n"
        );
        text.push_str(&block);
    }
    let mut world = World::new(&scenario_with(&format!("{text}\n[judge]\n")), &SimOptions::default()).unwrap();
    world.wait_until(Time::from_seconds(5.0)).unwrap();
    for object in world.truth().iter().filter(|object| object.name.starts_with("floor_")) {
        let floor: f64 = object.name.trim_start_matches("floor_").parse().unwrap();
        let error = object.pose.translation.distance(DVec3::new(-0.1, 0.1, 0.74 + 0.04 * floor));
        assert!(error < 0.001, "{}: {error} m", object.name);
    }
}
