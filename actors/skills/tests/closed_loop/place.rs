//! `place-upright`, after a grasp.

use super::*;
use acm_concept::{embodiment::Feedback, primitive::Primitive, skill::FailureCause};
use proptest::prelude::*;

const CUBE: DVec3 = DVec3::splat(0.04);

/// A world in which a cube, perceived with errors, has been picked; and how it was felt to sit in the hand.
fn picked(dx: f64, dz: f64) -> (World, Pose) {
    let mut world = World::with_block(CUBE, DVec2::new(0.2, -0.1), 0.4);
    let mut perceived = table_pose(0.2 + dx, -0.1, 0.4);
    perceived.translation.z += dz;
    let report = run(&mut world, &pick(CUBE, perceived));
    (world, report.held.unwrap().1)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn what_is_held_is_put_where_it_should_be(
        dx in -0.01..0.01f64, dz in -0.015..0.015f64, there_dz in -0.015..0.015f64,
        x in -0.35..0.35f64, y in -0.3..0.15f64, yaw in -1.5..1.5f64,
    ) {
        let (mut world, held) = picked(dx, 0.5 * dz);
        let mut destination = table_pose(x, y, yaw);
        destination.translation.z += 0.5 * there_dz;
        let report = run(&mut world, &place(held, destination));
        prop_assert_eq!(&report.failure, &None);
        let block = world.block.unwrap().pose;
        prop_assert!(world.held.is_none());
        prop_assert!(block.translation.truncate().distance(DVec2::new(x, y)) < dx.abs() + 0.003);
        prop_assert!(world.fell_m < 0.002, "it was let go {} m above the table", world.fell_m);
        let left_at = report.left_at.unwrap();
        prop_assert!(left_at.translation.truncate().distance(DVec2::new(x, y)) < 0.002);
        prop_assert!(left_at.angle_to(&block) < 0.05);
        prop_assert!(felt(&report, "hand-empty()").is_some() && felt(&report, "not holding(O1)").is_some());
        prop_assert!(!report.felt.iter().any(|(literal, _)| literal.predicate == "at"), "only looking shows where it is");
        prop_assert_eq!(report.held, None);
        prop_assert_eq!(world.feedback().commanded_opening_m, 0.08);
        prop_assert!(world.feedback().tcp.translation.z > TABLE_M + 0.06);
        prop_assert!(world.peak_n < 30.0, "felt {} N", world.peak_n);
        prop_assert_eq!(go_home(&mut world).failure, None);
    }
}

#[test]
fn a_block_that_is_lost_on_the_way_is_missed_at_once() {
    let destination = table_pose(-0.2, -0.1, 0.0);
    let (world, held) = picked(0.0, 0.0);
    let whole = run(&mut world.clone(), &place(held, destination));
    // A theft at the moment of letting go cannot be felt; one a fifth of a second before must be.
    let release = whole.primitives.iter().find(|report| report.primitive == Primitive::Release).unwrap();
    let ticks = (release.started.seconds_since(whole.started) / 0.02) as usize - 10;
    let mut missed = 0;
    for stolen_at in (1..ticks).step_by(3) {
        let mut world = world.clone();
        let mut before: Option<Feedback> = None;
        let report = run_with(&mut world, &place(held, destination), |world, tick| {
            if tick == stolen_at && world.held.is_some() {
                before = Some(world.feedback());
                world.steal();
            }
        });
        let Some(before) = before else { continue };
        let (cause, reason) = report.failure.clone().unwrap();
        assert!(cause == FailureCause::Grasp && reason.contains("lost on the way"), "at tick {stolen_at}: {reason}");
        assert!(felt(&report, "not holding(O1)").unwrap() > 0.9 && report.held.is_none() && report.left_at.is_none());
        let after = world.feedback().tcp.translation.truncate();
        assert!(after.distance(before.tcp.translation.truncate()) < 0.06, "the hand went on after the loss");
        assert!(world.feedback().tcp.translation.z > TABLE_M + 0.06);
        missed += 1;
    }
    assert!(missed > 25, "only {missed} thefts were tried");
}

#[test]
fn an_empty_hand_places_nothing() {
    let report = run(&mut World::new(), &place(Pose::IDENTITY, table_pose(0.0, -0.1, 0.0)).flipped());
    let (cause, reason) = report.failure.unwrap();
    assert!(cause == FailureCause::Grasp && reason.contains("the hand is empty"), "{reason}");
}

#[test]
fn neighbours_keep_the_fingers_narrow_until_the_hand_is_above_them() {
    let (mut world, held) = picked(0.0, 0.0);
    // The grasp closes along the block's y; neighbours stand 14 mm beyond the fingers on both sides.
    let destination = table_pose(0.0, -0.1, 0.0);
    let mut invocation = place(held, destination);
    let beside = 0.02 + 0.012 + 0.011 + 0.02;
    let tall = DVec3::new(0.04, 0.04, 0.05);
    invocation.obstacles = [1.0, -1.0].map(|side| neighbour(DVec2::new(0.0, -0.1 + side * beside), tall)).to_vec();
    let from = world.commands.len();
    let report = run(&mut world, &invocation);
    assert_eq!(report.failure, None);
    for command in &world.commands[from..] {
        let low = command.tcp.translation.z < TABLE_M + 0.05;
        assert!(!low || command.opening_m < 0.052, "the fingers opened into a neighbour");
    }
    assert_eq!(world.feedback().commanded_opening_m, 0.08);
}

#[test]
fn what_leans_on_a_pad_is_left_by_rising_and_what_sticks_is_told() {
    let (mut world, held) = picked(0.0, 0.0);
    let invocation = place(held, table_pose(0.0, -0.1, 0.0));
    world.leaning_below_m = TABLE_M + 0.03;
    let report = run(&mut world.clone(), &invocation);
    assert_eq!((report.failure.clone(), report.measured["pads_free"]), (None, 0.0));
    world.leaning_below_m = TABLE_M + 0.1;
    let report = run(&mut world, &invocation);
    let (cause, reason) = report.failure.clone().unwrap();
    assert!(cause == FailureCause::Place && reason.contains("a pad still feels something"), "{reason}");
    assert_eq!(felt(&report, "hand-empty()"), None, "what sticks to a pad may still hang there");
    assert!(report.left_at.is_some());
}

trait Flipped {
    fn flipped(self) -> SkillInvocation;
}

impl Flipped for SkillInvocation {
    /// The same with what is held below a downward hand.
    fn flipped(mut self) -> SkillInvocation {
        if let Some((_, held, _)) = &mut self.held {
            *held = Pose::new(DVec3::new(0.0, 0.0, 0.02), glam::DQuat::from_rotation_x(std::f64::consts::PI));
        }
        self
    }
}
