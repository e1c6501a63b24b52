//! The scripted expert solves every task under both predicates, and what a published checker lets pass, `strict` does not.

use super::{SEEDS, draw, layout, open};
use crate::{
    OracleVerdict, SimOptions, Simulation,
    expert::{Expert, OPEN_M, down},
};
use acm_concept::pose::Pose;
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

const TABLE_Z: f64 = 0.74;
const TRAVEL_Z: f64 = 0.92;

/// How a thing is gripped: height over its base, and the turn of the closing direction from its y axis.
#[derive(Clone, Copy)]
pub(super) struct Grip {
    pub(super) height: f64,
    pub(super) turn: f64,
}
pub(super) const CUBE: Grip = Grip { height: 0.02, turn: 0.0 };
pub(super) const KNOB: Grip = Grip { height: 0.085, turn: 0.0 };
pub(super) const STEM: Grip = Grip { height: 0.014, turn: PI / 2.0 };
pub(super) const ENDS: Grip = Grip { height: 0.02, turn: 0.0 };

pub(super) fn expert(scenario: &str, seed: u64) -> Expert {
    let options = SimOptions { seed, ..SimOptions::default() };
    Expert::of(Simulation::without_renderer(&open(scenario), &options).unwrap())
}

fn over(expert: &mut Expert, at: DVec3, yaw: f64) {
    let (here, _) = expert.plan();
    expert.go(Pose { translation: here.translation.with_z(TRAVEL_Z), ..here }, 0.4);
    expert.go(down(at.with_z(TRAVEL_Z), yaw), 0.25);
}

pub(super) fn take(expert: &mut Expert, name: &str, grip: Grip) {
    let object = expert.object(name);
    let (at, yaw) = (object.pose.translation, heading(&object.pose) + grip.turn);
    expert.fingers(OPEN_M);
    over(expert, at, yaw);
    expert.go(down(at + DVec3::Z * grip.height, yaw), 0.2);
    expert.fingers(0.0);
    expert.go(down(at.with_z(TRAVEL_Z), yaw), 0.2);
}

fn put(expert: &mut Expert, at: DVec3, yaw: f64, grip: Grip) {
    let yaw = yaw + grip.turn;
    over(expert, at, yaw);
    expert.go(down(at + DVec3::Z * (grip.height + 0.0015), yaw), 0.1);
    expert.fingers(OPEN_M);
    expert.go(down(at.with_z(TRAVEL_Z), yaw), 0.3);
}

pub(super) fn carry(expert: &mut Expert, name: &str, at: DVec3, yaw: f64, grip: Grip) {
    take(expert, name, grip);
    put(expert, at, yaw, grip);
}

pub(super) fn heading(pose: &Pose) -> f64 {
    2.0 * pose.rotation.z.atan2(pose.rotation.w)
}

fn table(x: f64, y: f64) -> DVec3 {
    DVec3::new(x, y, TABLE_Z)
}

#[track_caller]
fn solved(expert: &Expert) {
    let verdict = expert.simulation.verdict();
    assert!(verdict.strict && verdict.faithful == Some(true), "{verdict:?}");
}

/// What the published checker accepts and `strict` refuses, with the violation that says why.
#[track_caller]
fn exploited(expert: &Expert, why: &str) {
    let verdict = expert.simulation.verdict();
    assert!(!verdict.strict && verdict.faithful == Some(true), "{verdict:?}");
    says(&verdict, why);
}
#[track_caller]
fn failed(expert: &Expert, why: &str) {
    let verdict = expert.simulation.verdict();
    assert!(!verdict.strict && verdict.faithful == Some(false), "{verdict:?}");
    says(&verdict, why);
}
#[track_caller]
fn says(verdict: &OracleVerdict, why: &str) {
    assert!(verdict.violations.iter().any(|violation| violation.contains(why)), "{why}: {verdict:?}");
}

mod press_button {
    use super::*;

    #[test]
    fn as_often_as_the_cards_say_is_right() {
        let mut expert = expert("press-button", 100_005);
        ["left", "left", "middle", "right"].iter().for_each(|button| expert.press(button));
        solved(&expert);
    }

    #[test]
    fn a_press_to_confirm_that_comes_too_early_is_exploited_no_more() {
        let mut expert = expert("press-button", 100_005);
        ["right", "left", "left", "middle", "right"].iter().for_each(|button| expert.press(button));
        exploited(&expert, "before both counts were right");
    }

    #[test]
    fn too_often_is_wrong() {
        let mut expert = expert("press-button", 100_005);
        ["left", "left", "left", "middle", "right"].iter().for_each(|button| expert.press(button));
        failed(&expert, "too often");
    }
}

mod cover_blocks {
    use super::*;

    const NAMES: [&str; 3] = ["left", "middle", "right"];
    const X: [f64; 3] = [-0.2, 0.0, 0.2];

    fn hide(expert: &mut Expert, slot: usize) {
        carry(expert, &format!("lid_{}", NAMES[slot]), table(X[slot], -0.18), 0.0, KNOB);
    }
    fn reveal(expert: &mut Expert, slot: usize, y: f64) {
        carry(expert, &format!("lid_{}", NAMES[slot]), table(X[slot], y), 0.0, KNOB);
    }
    /// Places of red, green and blue.
    fn slots(seed: u64) -> [usize; 3] {
        let layout = layout("cover-blocks", seed);
        let colors = [0, 1, 2].map(|slot| draw(&layout, &format!("color_{slot}")));
        [0.0, 1.0, 2.0].map(|color| colors.iter().position(|known| *known == color).unwrap())
    }

    #[test]
    fn hidden_from_the_left_and_revealed_by_colour() {
        for seed in [100_000, 100_002] {
            let mut expert = expert("cover-blocks", seed);
            (0..3).for_each(|slot| hide(&mut expert, slot));
            slots(seed).into_iter().for_each(|slot| reveal(&mut expert, slot, -0.05));
            solved(&expert);
        }
    }

    #[test]
    fn another_order_of_colours_is_wrong() {
        let mut expert = expert("cover-blocks", 100_000);
        (0..3).for_each(|slot| hide(&mut expert, slot));
        let [red, green, blue] = slots(100_000);
        [green, red, blue].into_iter().for_each(|slot| reveal(&mut expert, slot, -0.05));
        failed(&expert, "another cube than the red one");
    }

    #[test]
    fn a_lid_may_be_parked_anywhere_behind() {
        let mut expert = expert("cover-blocks", 100_003);
        (0..3).for_each(|slot| hide(&mut expert, slot));
        slots(100_003).into_iter().for_each(|slot| reveal(&mut expert, slot, 0.05));
        let verdict = expert.simulation.verdict();
        assert!(verdict.strict && verdict.faithful == Some(false), "{verdict:?}");
    }
}

mod swap_blocks {
    use super::*;

    fn tray(number: f64) -> DVec3 {
        DVec3::new(0.14 * (number - 1.0), -0.15, 0.744)
    }
    fn trays(seed: u64) -> [f64; 3] {
        let layout = layout("swap-blocks", seed);
        let [one, two] = ["tray_of_one", "tray_of_two"].map(|name| draw(&layout, name));
        [one, two, 3.0 - one - two]
    }

    #[test]
    fn by_way_of_the_third_tray() {
        for seed in [100_000, 100_003] {
            let [one, two, spare] = trays(seed);
            let mut expert = expert("swap-blocks", seed);
            carry(&mut expert, "one", tray(spare), 0.0, CUBE);
            carry(&mut expert, "two", tray(one), 0.0, CUBE);
            carry(&mut expert, "one", tray(two), 0.0, CUBE);
            expert.press("button");
            solved(&expert);
        }
    }

    #[test]
    fn two_in_one_tray_are_wrong_even_side_by_side() {
        let [one, two, _] = trays(100_000);
        let mut expert = expert("swap-blocks", 100_000);
        // One above the other as the robot sees them: the published rule looks along x alone, and sees this one too.
        carry(&mut expert, "one", tray(two) + DVec3::Y * 0.05, 0.0, CUBE);
        carry(&mut expert, "two", tray(one), 0.0, CUBE);
        carry(&mut expert, "one", tray(two), 0.0, CUBE);
        expert.press("button");
        failed(&expert, "two cubes were in one tray");
    }

    #[test]
    fn a_press_before_the_end_is_wrong() {
        let [one, two, spare] = trays(100_001);
        let mut expert = expert("swap-blocks", 100_001);
        expert.press("button");
        carry(&mut expert, "one", tray(spare), 0.0, CUBE);
        carry(&mut expert, "two", tray(one), 0.0, CUBE);
        carry(&mut expert, "one", tray(two), 0.0, CUBE);
        expert.press("button");
        failed(&expert, "before the cubes were exchanged");
    }
}

mod rearrange_blocks {
    use super::*;

    /// Row, free mat and own mat.
    fn places(seed: u64) -> [DVec3; 3] {
        let layout = layout("rearrange-blocks", seed);
        let (y, side) = (draw(&layout, "row_y"), draw(&layout, "side"));
        let mat = |side: f64| DVec3::new(0.02 + 0.24 * side, y, TABLE_Z + 0.001);
        [table(0.14, y), mat(1.0 - side), mat(side)]
    }

    #[test]
    fn the_gap_is_filled_by_the_cube_that_stood_on_a_mat() {
        for seed in [100_000, 100_001] {
            let [gap, free, _] = places(seed);
            let mut expert = expert("rearrange-blocks", seed);
            carry(&mut expert, "first", free, 0.0, CUBE);
            expert.press("button");
            carry(&mut expert, "second", gap, 0.0, CUBE);
            solved(&expert);
        }
    }

    #[test]
    fn two_centimetres_off_is_right_for_the_published_gap_alone() {
        let [gap, free, _] = places(100_002);
        let mut expert = expert("rearrange-blocks", 100_002);
        carry(&mut expert, "first", free, 0.0, CUBE);
        expert.press("button");
        carry(&mut expert, "second", gap - DVec3::X * 0.035, 0.0, CUBE);
        let verdict = expert.simulation.verdict();
        assert!(!verdict.strict && verdict.faithful == Some(true), "{verdict:?}");
    }

    #[test]
    fn the_wrong_cube_and_a_second_press_are_wrong() {
        let [gap, free, own] = places(100_000);
        let mut expert = expert("rearrange-blocks", 100_000);
        carry(&mut expert, "first", free, 0.0, CUBE);
        expert.press("button");
        expert.press("button");
        carry(&mut expert, "second", gap, 0.0, CUBE);
        failed(&expert, "more than once");
        let mut other = super::expert("rearrange-blocks", 100_000);
        carry(&mut other, "first", free, 0.0, CUBE);
        other.press("button");
        carry(&mut other, "first", gap, 0.0, CUBE);
        let verdict = other.simulation.verdict();
        assert!(!verdict.strict && verdict.faithful == Some(false), "{own} {verdict:?}");
    }
}

mod swap_t {
    use super::*;

    fn swap(expert: &mut Expert, off: f64, askew: f64) {
        let [red, blue] = ["red", "blue"].map(|name| expert.object(name).pose);
        carry(expert, "red", table(0.0, 0.08), 0.0, STEM);
        carry(expert, "blue", red.translation + DVec3::X * off, heading(&red) + askew, STEM);
        carry(expert, "red", blue.translation, heading(&blue), STEM);
    }

    #[test]
    fn each_takes_the_others_place_and_heading() {
        for seed in [100_000, 100_005] {
            let mut expert = expert("swap-t", seed);
            swap(&mut expert, 0.0, 0.0);
            solved(&expert);
        }
    }

    #[test]
    fn a_looser_pose_is_right_as_published_alone() {
        for (off, askew) in [(0.023, 0.0), (0.0, 0.22)] {
            let mut expert = expert("swap-t", 100_001);
            swap(&mut expert, off, askew);
            let verdict = expert.simulation.verdict();
            assert!(!verdict.strict && verdict.faithful == Some(true), "{off} {askew} {verdict:?}");
        }
    }
}

mod place_block_mat {
    use super::*;

    const GREEN: [f64; 2] = [0.0, -0.25];

    fn visit(expert: &mut Expert, name: &str) {
        let home = expert.object(name).pose.translation;
        carry(expert, name, DVec3::new(GREEN[0], GREEN[1], TABLE_Z + 0.001), 0.0, CUBE);
        carry(expert, name, home, 0.0, CUBE);
    }

    #[test]
    fn there_and_back_from_left_to_right() {
        let mut expert = expert("place-block-mat", 100_002);
        ["first", "second", "third"].iter().for_each(|name| visit(&mut expert, name));
        solved(&expert);
    }

    #[test]
    fn another_order_is_right_as_published_alone() {
        let mut expert = expert("place-block-mat", 100_003);
        ["third", "first", "second"].iter().for_each(|name| visit(&mut expert, name));
        exploited(&expert, "before its turn");
    }
}

mod blocks_ranking_try {
    use super::*;

    const Y: f64 = -0.1;
    fn x(slot: f64) -> f64 {
        0.04 + 0.12 * slot
    }
    /// Puts cubes 1, 2, 3 into slots by way of a spot in front.
    fn arrange(expert: &mut Expert, slots: [f64; 3]) {
        let names = ["one", "two", "three"];
        for (at, name) in names.iter().enumerate() {
            carry(expert, name, table(x(at as f64), 0.02), 0.0, CUBE);
        }
        for (name, slot) in names.iter().zip(slots) {
            carry(expert, name, table(x(slot), Y), 0.0, CUBE);
        }
    }

    #[test]
    fn the_right_order_is_accepted_and_shown() {
        for seed in SEEDS.take(2) {
            let mut expert = expert("blocks-ranking-try", seed);
            expert.press("button");
            let refused = |expert: &Expert| {
                let value = |name: &str| expert.simulation.variables().into_iter().find(|(n, _)| n == name).unwrap().1;
                [value("accepted"), value("refused")]
            };
            assert_eq!(refused(&expert), [0.0, 1.0]);
            arrange(&mut expert, [0.0, 1.0, 2.0]);
            expert.press("button");
            assert_eq!(refused(&expert), [1.0, 0.0]);
            solved(&expert);
        }
    }

    #[test]
    fn an_order_that_is_tried_twice_is_wrong() {
        let mut expert = expert("blocks-ranking-try", 100_000);
        expert.press("button");
        expert.press("button");
        arrange(&mut expert, [0.0, 1.0, 2.0]);
        expert.press("button");
        let verdict = expert.simulation.verdict();
        assert!(!verdict.strict, "{verdict:?}");
        says(&verdict, "tried twice");
    }
}

mod battery_try {
    use super::*;

    /// The cell lies in a trough, turned by as many half turns.
    fn insert(expert: &mut Expert, name: &str, trough: f64, turned: f64) {
        carry(expert, name, DVec3::new(trough, -0.1, TABLE_Z + 0.004), PI * turned, ENDS);
    }
    fn needle(expert: &Expert) -> f64 {
        expert.simulation.variables().into_iter().find(|(name, _)| name == "holder_needle").unwrap().1
    }

    #[test]
    fn the_needle_moves_for_the_right_polarity_in_the_holder_alone() {
        for seed in [100_000, 100_001, 100_003] {
            let layout = layout("battery-try", seed);
            let ways = ["left_right_way", "right_right_way"].map(|name| draw(&layout, name));
            let mut expert = expert("battery-try", seed);
            insert(&mut expert, "left", -0.02, 0.0);
            insert(&mut expert, "right", 0.02, 0.0);
            expert.wait(1.0);
            assert!(needle(&expert) < 0.1, "{seed}: the needle moved for cells as they were");
            for ((name, trough), way) in [("left", -0.02), ("right", 0.02)].into_iter().zip(ways) {
                if way > 0.5 {
                    insert(&mut expert, name, trough, 1.0);
                }
            }
            expert.wait(1.0);
            assert!(needle(&expert) > 1.4, "{seed}: the needle stands at {}", needle(&expert));
            solved(&expert);
            take(&mut expert, "left", ENDS);
            expert.wait(1.0);
            assert!(needle(&expert) < 0.1, "{seed}: it goes back");
        }
    }

    #[test]
    fn cells_that_hang_over_the_holder_are_right_as_published_alone() {
        let mut expert = expert("battery-try", 100_003);
        insert(&mut expert, "right", 0.02, 0.0);
        take(&mut expert, "left", ENDS);
        // [1, 0]: the left one is turned in the air and held over its trough.
        over(&mut expert, DVec3::new(-0.02, -0.1, TRAVEL_Z), PI);
        let verdict = expert.simulation.verdict();
        assert!(!verdict.strict && verdict.faithful == Some(true), "{verdict:?}");
        assert!(needle(&expert) < 0.1);
    }

    /// A roll about its own axis and a cell that stands on end do not change the published class.
    #[test]
    fn a_heading_is_told_whatever_the_roll() {
        for (yaw, roll) in [(0.3, 1.0), (2.0, -1.2), (-1.5, 0.4)] {
            let rotation = DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(roll);
            assert!((heading(&Pose::new(DVec3::ZERO, rotation)) - yaw).abs() < 1e-9);
        }
    }
}

mod observe_and_pickup {
    use super::*;

    fn raise(expert: &mut Expert, number: usize) {
        let name = format!("toy_{number}");
        let height = (0.5 * expert.object(&name).size_m.z).max(0.013);
        take(expert, &name, Grip { height, turn: 0.0 });
        expert.wait(0.5);
    }

    #[test]
    fn the_twin_is_raised_and_held() {
        for seed in SEEDS {
            let target = draw(&layout("observe-and-pickup", seed), "target") as usize;
            let mut expert = expert("observe-and-pickup", seed);
            raise(&mut expert, target);
            solved(&expert);
            let screen = expert.object("screen").pose.translation;
            assert!(screen.distance(DVec3::new(0.0, 0.05, 0.75)) < 1e-6, "{screen}");
        }
    }

    #[test]
    fn raising_one_after_the_other_is_right_as_published_alone() {
        let target = draw(&layout("observe-and-pickup", 100_000), "target") as usize;
        let mut expert = expert("observe-and-pickup", 100_000);
        raise(&mut expert, (target + 1) % 5);
        expert.fingers(OPEN_M);
        expert.wait(0.5);
        raise(&mut expert, target);
        exploited(&expert, "another item was raised");
    }
}
