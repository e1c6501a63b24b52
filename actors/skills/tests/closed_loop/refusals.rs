//! What cannot be started, what is bounded, and that equal worlds give equal commands.

use super::*;
use acm_concept::{embodiment::Feedback, skill::FailureCause};
use acm_skills::{StartError, kinds, required_arguments};
use proptest::prelude::*;

const CUBE: DVec3 = DVec3::splat(0.04);

fn refusal(invocation: &SkillInvocation, feedback: &Feedback) -> StartError {
    start(invocation, &world::robot(), feedback).map(|_| ()).unwrap_err()
}

#[test]
fn refusals_name_what_is_wrong() {
    let (idle, at) = (World::new().feedback(), table_pose(0.1, -0.1, 0.0));
    let unknown = refusal(&invocation("twist", at, 0.0, &[]), &idle).to_string();
    assert!(kinds().iter().all(|kind| unknown.contains(kind)) && unknown.contains("twist"), "{unknown}");
    let far = refusal(&pick(CUBE, table_pose(0.8, -0.1, 0.0)), &idle).to_string();
    assert!(far.contains("(0.800, -0.100, 0.760)") && far.contains("0.550"), "{far}");
    let wide = refusal(&pick(DVec3::new(0.12, 0.09, 0.05), at), &idle).to_string();
    assert!(wide.contains("90.0 mm") && wide.contains("80.0 mm"), "{wide}");
    let mut nameless = pick(CUBE, at);
    nameless.arguments.remove("height");
    assert!(refusal(&nameless, &idle).to_string().contains("`height`"));
    nameless.arguments.insert("height".into(), f64::NAN);
    assert!(refusal(&nameless, &idle).to_string().contains("NaN"));
    let mut homeless = place(idle.tcp.inverse(), at);
    homeless.destination = None;
    assert!(matches!(refusal(&homeless, &idle), StartError::NoDestination { .. }));
    homeless.held = None;
    assert!(matches!(refusal(&homeless, &idle), StartError::NothingHeld { .. }));
    let from_below = place(Pose::from_translation(DVec3::Z * 0.02), at);
    assert!(matches!(refusal(&from_below, &idle), StartError::Tilted { .. }));
}

#[test]
fn each_kind_asks_for_exactly_what_it_says_it_requires() {
    let idle = World::new().feedback();
    for kind in kinds() {
        let required = required_arguments(kind).unwrap();
        let mut whole = invocation(kind, table_pose(0.1, -0.1, 0.0), 0.03, &[]);
        whole.arguments.extend(required.iter().map(|name| (name.to_string(), 0.02)));
        let started = start(&whole, &world::robot(), &idle).map(|_| ());
        assert!(!matches!(started, Err(StartError::Argument { .. })), "{kind}: {started:?}");
        for name in required {
            let mut lacking = whole.clone();
            lacking.arguments.remove(*name);
            let refused = refusal(&lacking, &idle);
            assert!(matches!(refused, StartError::Argument { argument, .. } if argument == *name), "{kind}: {refused}");
        }
    }
}

#[test]
fn a_full_hand_neither_grasps_nor_presses() {
    let mut world = World::with_block(CUBE, DVec2::new(0.1, -0.1), 0.0);
    assert_eq!(run(&mut world, &pick(CUBE, table_pose(0.1, -0.1, 0.0))).failure, None);
    let again = refusal(&pick(CUBE, table_pose(-0.1, -0.1, 0.0)), &world.feedback());
    assert!(matches!(again, StartError::HandNotEmpty { opening_m, .. } if (opening_m - 0.032).abs() < 0.001));
    let press = invocation("press-down", table_pose(0.0, 0.0, 0.0), 0.03, &[("stroke", 0.008), ("force", 12.0)]);
    assert!(matches!(refusal(&press, &world.feedback()), StartError::HandNotEmpty { .. }));
}

#[test]
fn a_hand_that_does_not_move_ends_every_skill_in_time() {
    for invocation in [
        pick(CUBE, table_pose(0.1, -0.1, 0.0)),
        invocation("press-down", table_pose(0.1, -0.1, 0.0), 0.03, &[("stroke", 0.008), ("force", 12.0)]),
    ] {
        let stuck = World::new().feedback();
        let mut controller = start(&invocation, &world::robot(), &stuck).unwrap();
        let report = (0..MAX_TICKS).find_map(|_| match controller.tick(&stuck) {
            Tick::Act(_) => None,
            Tick::Finished(report) => Some(report),
        });
        let (cause, reason) = report.expect("it ends").failure.unwrap();
        assert!(cause == FailureCause::Motion && reason.contains("was not done after"), "{reason}");
    }
}

#[test]
fn equal_worlds_give_equal_commands() {
    let episode = || {
        let mut world = World::with_block(CUBE, DVec2::new(0.1, -0.1), 0.2);
        let report = run(&mut world, &pick(CUBE, table_pose(0.108, -0.106, 0.25)));
        go_home(&mut world);
        run(&mut world, &place(report.held.unwrap().1, table_pose(-0.1, -0.2, 0.0)));
        world.commands
    };
    let (first, second) = (episode(), episode());
    assert!(first.len() > 200);
    assert_eq!(first, second);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// The world refuses what breaks a limit, and then the test fails; here from many starts to many targets.
    #[test]
    fn no_command_breaks_a_limit(
        x in -0.6..0.6f64, y in -0.45..0.45f64, z in 0.7..1.3f64, yaw in -3.1..3.1f64,
        hand_x in -0.5..0.5f64, hand_y in -0.35..0.35f64, hand_z in 0.85..1.3f64, hand_yaw in -3.1..3.1f64,
        pressing in any::<bool>(),
    ) {
        let mut world = World::new();
        let heading = Pose::from_yaw(DVec3::ZERO, hand_yaw) * world::robot().home;
        world.place_hand(Pose::new(DVec3::new(hand_x, hand_y, hand_z), heading.rotation));
        let base = Pose::from_yaw(DVec3::new(x, y, z), yaw);
        let press = invocation("press-down", base, 0.03, &[("stroke", 0.008), ("force", 12.0)]);
        let invocation = if pressing { press } else { pick(CUBE, base) };
        match start(&invocation, world.description(), &world.feedback()) {
            Err(refused) => prop_assert!(matches!(refused, StartError::OutOfReach { .. }), "{}", refused),
            Ok(_) => prop_assert!(run(&mut world, &invocation).failure.is_some(), "there is nothing there"),
        }
        prop_assert_eq!(go_home(&mut world).failure, None);
    }
}
