//! `grasp-from-above`.

use super::*;
use acm_concept::skill::FailureCause;
use acm_skills::StartError;
use proptest::prelude::*;

const CUBE: DVec3 = DVec3::splat(0.04);

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn a_block_is_picked_although_it_is_not_quite_where_it_was_perceived(
        x in -0.4..0.4f64, y in -0.3..0.15f64, yaw in -3.1..3.1f64, width in 0.025..0.045f64, height in 0.03..0.07f64,
        dx in -0.012..0.012f64, dy in -0.012..0.012f64, dz in -0.015..0.015f64, dyaw in -0.12..0.12f64, dw in -0.004..0.004f64,
    ) {
        let size = DVec3::new(width + 0.01, width, height);
        let mut world = World::with_block(size, DVec2::new(x, y), yaw);
        // The whole picture is off in height, as with a biased depth camera; sideways only the block is.
        let across = Pose::from_yaw(DVec3::ZERO, yaw).transform_vector(DVec3::new(dx, dy, 0.0));
        let mut perceived = table_pose(x + across.x, y + across.y, yaw + dyaw);
        perceived.translation.z += dz;
        let report = run(&mut world, &pick(size + DVec3::new(0.0, dw, 0.0), perceived));
        prop_assert_eq!(&report.failure, &None);
        let (_, held) = report.held.unwrap();
        let truth = world.held.unwrap();
        prop_assert!((held.translation.y - truth.translation.y).abs() < 1e-6, "closing puts it between the pads");
        prop_assert!(held.translation.truncate().distance(truth.translation.truncate()) < dx.abs() + dy.abs() + 0.002);
        // Its height in the hand is off by no more than the picture was.
        prop_assert!((held.translation.z - truth.translation.z).abs() < dz.abs() + 0.002);
        prop_assert!(held.angle_to(&truth) < 0.01, "closing turns its faces to the pads");
        prop_assert!(felt(&report, "holding(O1)").unwrap() > 0.7 && felt(&report, "not hand-empty()").is_some());
        prop_assert!((report.measured["grip_width_m"] - width).abs() < 0.003, "measured before the full force dents it");
        prop_assert!((report.measured["held_weight_n"] - 0.44).abs() < 0.8);
        prop_assert!(world.feedback().tcp.translation.z > TABLE_M + 0.06);
        prop_assert!(world.peak_n < 30.0, "felt {} N", world.peak_n);
        let home = go_home(&mut world);
        prop_assert_eq!(home.failure, None);
        prop_assert!(world.held.is_some());
    }
}

#[test]
fn closing_on_nothing_is_felt() {
    let mut world = World::new();
    let report = run(&mut world, &pick(CUBE, table_pose(0.1, -0.1, 0.0)));
    let (cause, reason) = report.failure.clone().unwrap();
    assert_eq!(cause, FailureCause::Grasp);
    assert!(reason.contains("closed on nothing"), "{reason}");
    assert!(felt(&report, "not holding(O1)").unwrap() > 0.9 && felt(&report, "hand-empty()").is_some());
    assert_eq!(report.held, None);
    assert!(world.feedback().tcp.translation.z > TABLE_M + 0.06, "a failed grasp ends at a safe height");
    assert_eq!(report.primitives.last().unwrap().failure.as_deref(), Some(reason.as_str()));
}

#[test]
fn a_block_that_is_too_narrow_is_let_go_again() {
    let mut world = World::with_block(DVec3::new(0.04, 0.02, 0.04), DVec2::new(0.1, -0.1), 0.0);
    let report = run(&mut world, &pick(CUBE, table_pose(0.1, -0.1, 0.0)));
    let (cause, reason) = report.failure.clone().unwrap();
    assert_eq!(cause, FailureCause::Grasp);
    assert!(reason.contains("17.6 mm") && reason.contains("40.0 mm"), "{reason}");
    assert!(world.held.is_none() && world.block.unwrap().pose.translation.z == TABLE_M);
}

#[test]
fn fingers_that_land_on_the_block_stop_and_rise() {
    let mut world = World::with_block(CUBE, DVec2::new(0.1, -0.1), 0.0);
    let report = run(&mut world, &pick(CUBE, table_pose(0.1, -0.135, 0.0)));
    let (cause, reason) = report.failure.clone().unwrap();
    assert!(cause == FailureCause::Grasp && reason.contains("landed on something"), "{reason}");
    assert!(world.peak_n < 25.0, "pressed with {} N", world.peak_n);
    assert!(world.feedback().tcp.translation.z > TABLE_M + 0.06);
}

#[test]
fn a_block_that_is_taken_away_in_the_lift_is_missed() {
    let mut world = World::with_block(CUBE, DVec2::new(0.1, -0.1), 0.0);
    let lifted = |world: &World| world.held.is_some() && world.block.unwrap().pose.translation.z > TABLE_M + 0.03;
    let report = run_with(&mut world, &pick(CUBE, table_pose(0.1, -0.1, 0.0)), |world, _| {
        if lifted(world) {
            world.steal();
        }
    });
    assert_eq!(report.failure.clone().unwrap().0, FailureCause::Grasp);
    assert!(felt(&report, "not holding(O1)").is_some() && report.held.is_none());
}

#[test]
fn a_neighbour_turns_the_grasp_and_two_forbid_it() {
    let mut world = World::with_block(CUBE, DVec2::new(0.1, -0.1), 0.0);
    let mut invocation = pick(CUBE, table_pose(0.1, -0.1, 0.0));
    invocation.obstacles = vec![neighbour(DVec2::new(0.1, -0.1 + 0.043), CUBE)];
    let report = run(&mut world.clone(), &invocation);
    assert_eq!(report.failure, None);
    assert!(report.measured["finger_clearance_m"] > 0.004);
    let closing_along_x = |world: &World| world.feedback().tcp.transform_vector(DVec3::Y).x.abs() > 0.99;
    run(&mut world, &invocation);
    assert!(closing_along_x(&world));
    invocation.obstacles.push(neighbour(DVec2::new(0.1 + 0.043, -0.1), CUBE));
    let refused = start(&invocation, world.description(), &World::new().feedback()).map(|_| ());
    assert!(matches!(refused, Err(StartError::Blocked { .. })), "{refused:?}");
    // A flat thing under the block is no obstacle, and neither is the block itself seen twice.
    invocation.obstacles = vec![neighbour(DVec2::new(0.1, -0.1), DVec3::new(0.1, 0.1, 0.001))];
    invocation.obstacles.push((ObjectId(1), neighbour(DVec2::new(0.1, -0.07), CUBE).1));
    assert_eq!(run(&mut World::with_block(CUBE, DVec2::new(0.1, -0.1), 0.0), &invocation).failure, None);
}

#[test]
fn a_retry_takes_the_other_side_and_reaches_deeper() {
    let first = pick(DVec3::new(0.05, 0.03, 0.04), table_pose(0.1, -0.1, 0.0));
    let retry = SkillInvocation { attempt: 1, ..first.clone() };
    let grasp = |invocation: &SkillInvocation| {
        let mut world = World::with_block(DVec3::new(0.05, 0.03, 0.04), DVec2::new(0.1, -0.1), 0.0);
        run(&mut world, invocation).measured
    };
    let (first, retry) = (grasp(&first), grasp(&retry));
    assert!((first["grip_width_m"] - 0.03).abs() < 0.003 && (retry["grip_width_m"] - 0.05).abs() < 0.003);
    assert!(first["grip_height_m"] - retry["grip_height_m"] > 0.004);
}

#[test]
fn a_collision_on_the_way_ends_the_skill_high_up() {
    let mut world = World::with_block(CUBE, DVec2::new(0.3, -0.1), 0.0);
    world.wall_x = Some(0.15);
    let report = run(&mut world, &pick(CUBE, table_pose(0.3, -0.1, 0.0)));
    let (cause, reason) = report.failure.clone().unwrap();
    assert!(cause == FailureCause::Motion && reason.contains("while reaching"), "{reason}");
    assert!(world.feedback().tcp.translation.z > TABLE_M + 0.1);
}
