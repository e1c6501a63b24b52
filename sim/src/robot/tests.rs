#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use crate::{Scenario, SimOptions, world::World};
use acm_concept::embodiment::EmbodimentError;

fn world(robot: &str) -> World {
    world_with(robot, "")
}

fn world_with(robot: &str, more: &str) -> World {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/put-back-block.toml");
    let text = format!("{}\n[robot]\nmodel = \"{robot}\"\n{more}", std::fs::read_to_string(file).unwrap());
    World::new(&Scenario::parse("s.toml", &text).unwrap(), &SimOptions::default()).unwrap()
}

/// Where an arm is told to be, as it is described to the agent.
fn to(world: &World, arm: usize, joints: Joints) -> Command {
    let robot = world.robot.description.of_arm(arm).unwrap();
    let tcp = robot.arm.as_ref().unwrap().tcp(&joints);
    Command { joints: Some(joints), arm, ..Command::hand(tcp, robot.max_opening_m, 10.0) }
}

fn home(world: &World, arm: usize) -> Joints {
    world.robot.description.of_arm(arm).unwrap().arm.as_ref().unwrap().home
}

fn refused(world: &mut World, command: &Command) -> String {
    match world.command(command) {
        Err(EmbodimentError::Refused { reason }) => reason,
        other => panic!("not refused: {other:?}"),
    }
}

#[test]
fn an_arm_refuses_what_it_must_not_do_in_a_sentence() {
    let mut world = world("panda");
    let rest = home(&world, 0);
    let nudged = |joint: usize, by: f64| rest.map(|i| rest[i] + if i == joint { by } else { 0.0 });
    let still = to(&world, 0, rest);
    for (command, told) in [
        (to(&world, 0, nudged(5, 2.5)), "joint 6 at 4.0710 rad is not in -0.0175 to 3.7525 rad"),
        (to(&world, 0, nudged(6, 0.055)), "it asks joint 7 for 2.750 rad/s, its fastest is 2.61 rad/s"),
        (to(&world, 0, nudged(6, f64::NAN)), "it holds numbers that are not finite"),
        (Command { joints: None, ..still }, "it has no joint positions"),
        (Command { joints: Joints::new(&[0.0; 3]), ..still }, "3 joint positions for 7 joints"),
        (Command { tcp: Pose::from_translation(DVec3::Y) * still.tcp, ..still }, "its joints put the hand 1000.0 mm"),
        (Command { arm: 1, ..still }, "there is no arm 1, the robot has 1"),
        (Command { vacuum: true, ..still }, "this hand has no suction cup"),
        (Command { opening_m: 0.2, ..still }, "an opening of 0.2 m"),
    ] {
        let reason = refused(&mut world, &command);
        assert!(reason.contains(told), "{reason}");
    }
    assert_eq!(world.now(), Time::ZERO);
    // Turning the whole arm by the fastest that its first joint allows moves the hand faster than a hand may move.
    let fast = to(&world, 0, nudged(0, 0.04));
    let reason = refused(&mut world, &fast);
    assert!(reason.contains("m/s, the fastest is 0.5 m/s"), "{reason}");
    let slow = to(&world, 0, nudged(0, 0.02));
    let felt = world.command(&slow).unwrap();
    assert!((felt.joints[0] - nudged(0, 0.02)[0]).abs() < 1e-12 && felt.time == Time::from_seconds(0.02));
    world.stop();
    assert_eq!(world.command(&still).unwrap_err(), EmbodimentError::Stopped);
}

#[test]
fn a_floating_hand_takes_no_joints() {
    let mut world = world("floating-gripper");
    let command = Command { joints: Joints::new(&[0.0]), ..Command::hand(world.robot.description.home, 0.08, 10.0) };
    assert!(refused(&mut world, &command).contains("has no joints"));
}

/// Sends the arm towards joint positions at an even pace; the first refusal or failure ends it.
fn go(world: &mut World, arm: usize, goal: Joints) -> Result<Feedback, EmbodimentError> {
    let from = Joints::new(&world.feedback().of_arm(arm).unwrap().joints).unwrap();
    let ticks = (from.farthest(&goal) / 0.01).ceil();
    for tick in 1..=ticks as u32 {
        let command = to(world, arm, from.lerp(&goal, f64::from(tick) / ticks));
        world.command(&command)?;
    }
    for _ in 0..20 {
        let command = to(world, arm, goal);
        world.command(&command)?;
    }
    Ok(world.feedback())
}

#[test]
fn the_hand_is_where_the_joints_put_it() {
    let mut world = world("panda");
    let goal = Joints::new(&[0.2, 0.1, -0.1, -2.2, 0.1, 2.3, 0.9]).unwrap();
    let felt = go(&mut world, 0, goal).unwrap();
    let expected = world.robot.description.arm.as_ref().unwrap().tcp(&goal);
    assert!(felt.tcp.translation.distance(expected.translation) < 5e-4, "{felt:?} {expected:?}");
    assert_eq!(felt.joints, goal.to_vec());
    assert!(felt.wrist_force_n.length() < 0.05, "nothing touches it: {}", felt.wrist_force_n);
}

/// As high as the forearm, not in the way of the hand.
const POST: &str = r##"
[[surface]]
name = "post"
size = [0.08, 0.08, 0.45]
position = [-0.225, -0.272, 0.965]
color = "#808080"
"##;

#[test]
fn a_link_that_meets_something_stops_the_arm_and_can_leave_again() {
    let mut world = world_with("panda", POST);
    let before = Joints::new(&[0.0, 0.6, 0.0, -1.9, 0.0, 2.5, 0.785]).unwrap();
    // Over the hand's home to the right, away from the post.
    world_turn(&mut world, &before);
    let across = before.map(|i| if i == 0 { 0.75 } else { before[i] });
    let error = go(&mut world, 0, across).unwrap_err();
    assert!(matches!(&error, EmbodimentError::ProtectiveStop { .. }), "{error}");
    assert!(error.to_string().starts_with("the arm stopped by itself: link"), "{error}");
    let stopped = world.feedback();
    assert!(stopped.joints[0] < 0.7, "{:?}", stopped.joints);
    assert!(go(&mut world, 0, before).is_ok(), "after a stop it can be commanded away");
}

/// From home over the back, so that the post is passed on the far side.
fn world_turn(world: &mut World, to: &Joints) {
    let rest = home(world, 0);
    let up = rest.map(|i| [1.57, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785][i]);
    let turned = up.map(|i| if i == 0 { 0.0 } else { up[i] });
    go(world, 0, turned).unwrap();
    go(world, 0, *to).unwrap();
}

#[test]
fn one_arm_moves_and_the_other_holds_still() {
    let mut world = world("dual-panda");
    let before = world.feedback();
    assert_eq!((before.arm, before.others.len()), (0, 1));
    let goal = home(&world, 1).map(|i| home(&world, 1)[i] + if i == 0 { 0.6 } else { 0.0 });
    let felt = go(&mut world, 1, goal).unwrap();
    assert_eq!((felt.arm, felt.joints.clone()), (1, goal.to_vec()));
    assert_eq!(felt.of_arm(0).unwrap().joints, before.joints);
    assert!(felt.of_arm(0).unwrap().tcp.translation.distance(before.tcp.translation) < 1e-4);
}

#[test]
fn arms_that_would_touch_each_other_or_themselves_are_refused() {
    let mut both = world("dual-panda");
    let across =
        |world: &World, arm: usize, turn: f64| home(world, arm).map(|i| [turn, 0.5, 0.0, -1.9, 0.0, 2.4, 0.785][i]);
    // Each reaches over to the other's side.
    let (left, right) = (across(&both, 0, -0.5), across(&both, 1, 0.5));
    go(&mut both, 0, left).unwrap();
    let error = go(&mut both, 1, right).unwrap_err().to_string();
    assert!(error.contains("the other arm's link"), "{error}");
    let mut alone = world("panda");
    let folded = Joints::new(&[1.57, -1.7, 0.0, -3.05, 0.0, 0.0, 0.785]).unwrap();
    let error = go(&mut alone, 0, folded).unwrap_err().to_string();
    assert!(error.contains("would be") || error.contains("workspace"), "{error}");
}

#[test]
fn a_cup_holds_what_it_is_pressed_on_and_lets_it_go() {
    let mut world = world("floating-suction");
    let cube = |world: &World| world.truth().into_iter().find(|object| object.name == "cube").unwrap();
    let start = cube(&world).pose;
    let top = start.translation.z + 0.04;
    let mut at = world.robot.description.home;
    let mut go = |world: &mut World, to: DVec3, vacuum: bool| {
        let steps = (at.translation.distance(to) / 0.004).ceil().max(1.0);
        let from = at.translation;
        for step in 1..=steps as u32 {
            at.translation = from.lerp(to, f64::from(step) / steps);
            world.command(&Command { vacuum, ..Command::hand(at, 0.0, 0.0) }).unwrap();
        }
        for _ in 0..25 {
            world.command(&Command { vacuum, ..Command::hand(at, 0.0, 0.0) }).unwrap();
        }
        world.feedback()
    };
    let over = start.translation.with_z(0.9);
    go(&mut world, over, false);
    let open = go(&mut world, start.translation.with_z(top + 0.01), true);
    assert!((open.vacuum - 0.1).abs() < 1e-6, "in the air the pump sucks air: {}", open.vacuum);
    let sealed = go(&mut world, start.translation.with_z(top - 0.0005), true);
    assert!(sealed.vacuum > 0.99 && sealed.wrist_force_n.z > 1.0, "{sealed:?}");
    let lifted = go(&mut world, over, true);
    assert!(cube(&world).held && cube(&world).pose.translation.z > 0.84, "{:?}", cube(&world));
    assert!((lifted.wrist_force_n.z + 0.04f64.powi(3) * 700.0 * 9.81).abs() < 0.1, "{}", lifted.wrist_force_n);
    go(&mut world, start.translation.with_z(top + 0.001), true);
    let free = go(&mut world, start.translation.with_z(top + 0.001), false);
    assert_eq!(free.vacuum, 0.0);
    go(&mut world, over, false);
    assert!(
        !cube(&world).held && cube(&world).pose.translation.distance(start.translation) < 0.005,
        "{:?}",
        cube(&world)
    );
}

#[test]
fn a_cup_on_an_edge_gets_no_vacuum() {
    let mut world = world("floating-suction");
    let cube = world.truth().into_iter().find(|object| object.name == "cube").unwrap().pose.translation;
    let mut at = world.robot.description.home;
    // A third of the rim is beyond the cube's side.
    let goal = cube + DVec3::new(0.015, 0.0, 0.0395);
    for waypoint in [goal.with_z(0.9), goal] {
        let (from, steps) = (at.translation, (at.translation.distance(waypoint) / 0.004).ceil());
        for step in 1..=steps as u32 {
            at.translation = from.lerp(waypoint, f64::from(step) / steps);
            world.command(&Command { vacuum: true, ..Command::hand(at, 0.0, 0.0) }).unwrap();
        }
    }
    assert!(world.feedback().vacuum < 0.11, "{}", world.feedback().vacuum);
}
