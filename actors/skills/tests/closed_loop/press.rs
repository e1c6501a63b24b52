//! `press-down`.

use super::*;
use acm_concept::skill::FailureCause;
use proptest::prelude::*;
use world::Button;

fn button(center: DVec2) -> Button {
    Button { center, radius: 0.035, top_m: TABLE_M + 0.028, preload_n: 1.0, spring_n_m: 500.0, stroke_m: 0.007 }
}

fn press(button: &Button, dz: f64) -> SkillInvocation {
    let base = table_pose(button.center.x, button.center.y, 0.3);
    let base = Pose::from_yaw(base.translation + dz * DVec3::Z, 0.3);
    invocation("press-down", base, button.top_m - TABLE_M, &[("stroke", 0.008), ("force", 12.0)])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn a_button_is_pressed_once_and_springs_back(
        x in -0.4..0.4f64, y in -0.3..0.15f64, dx in -0.012..0.012f64, dz in -0.015..0.015f64,
        preload in 1.2..3.0f64, spring in 50.0..1000.0f64, stroke in 0.0055..0.01f64,
    ) {
        let truth = Button { preload_n: preload, spring_n_m: spring, stroke_m: stroke, ..button(DVec2::new(x, y)) };
        let mut world = World::with_button(truth);
        let mut invocation = press(&truth, dz);
        invocation.frame.translation.x += dx;
        let report = run(&mut world, &invocation);
        prop_assert_eq!(&report.failure, &None);
        prop_assert_eq!(world.presses, 1);
        prop_assert!(felt(&report, "pressed(O1)").unwrap() > 0.7);
        prop_assert!((report.measured["press_travel_m"] - world.deepest_m).abs() < 0.002);
        prop_assert!(report.measured["press_force_n"] < 25.0 && world.peak_n < 35.0);
        prop_assert!(world.feedback().tcp.translation.z > truth.top_m + 0.075);
        prop_assert!(world.feedback().opening_m < 0.004);
        prop_assert_eq!(go_home(&mut world).failure, None);
        prop_assert_eq!(world.presses, 1);
    }
}

#[test]
fn nothing_to_press_is_told() {
    let report =
        run(&mut World::new(), &press(&Button { top_m: TABLE_M + 0.05, ..button(DVec2::new(0.1, -0.1)) }, 0.0));
    let (cause, reason) = report.failure.clone().unwrap();
    assert!(cause == FailureCause::Press && reason.contains("touched nothing"), "{reason}");
    assert_eq!(felt(&report, "pressed(O1)"), None);
}

#[test]
fn what_does_not_give_way_is_not_pressed() {
    let stuck = Button { stroke_m: 0.0, preload_n: 0.0, ..button(DVec2::new(0.1, -0.1)) };
    let mut world = World::with_button(stuck);
    let report = run(&mut world, &press(&stuck, 0.004));
    let (cause, reason) = report.failure.clone().unwrap();
    assert!(cause == FailureCause::Press && reason.contains("gave way by only"), "{reason}");
    assert_eq!(felt(&report, "pressed(O1)"), None);
    assert!(world.feedback().tcp.translation.z > stuck.top_m + 0.08, "the hand withdraws after a failure too");
    assert!(report.measured["press_force_n"] >= 12.0 && world.peak_n < 30.0);
}

#[test]
fn a_retry_presses_harder_beside_the_middle() {
    let stiff = Button { preload_n: 13.0, spring_n_m: 100.0, stroke_m: 0.007, ..button(DVec2::new(0.1, -0.1)) };
    let first = run(&mut World::with_button(stiff), &press(&stiff, 0.0));
    assert_eq!(first.failure.unwrap().0, FailureCause::Press);
    let mut world = World::with_button(stiff);
    let retry = run(&mut world, &SkillInvocation { attempt: 1, ..press(&stiff, 0.0) });
    assert_eq!((retry.failure, world.presses), (None, 1));
    let beside = world.feedback().tcp.translation.truncate().distance(stiff.center);
    assert!(beside > 0.003 && beside < 0.011, "{beside}");
}
