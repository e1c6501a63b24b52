//! The scripted expert solves the jittered variants too, and they have as many worlds as seeds.

use super::{
    draw, layout, open,
    solved::{CUBE, ENDS, Grip, KNOB, STEM, carry, expert, heading, take},
};
use crate::{SimOptions, Simulation, expert::Expert};
use acm_concept::pose::Pose;
use glam::DVec3;
use std::{collections::BTreeSet, f64::consts::PI};

const SEEDS: std::ops::Range<u64> = 0..3;

#[track_caller]
fn strict(expert: &Expert, seed: u64) {
    let verdict = expert.simulation.verdict();
    assert!(verdict.strict, "seed {seed}: {verdict:?}");
}
fn place(scenario: &str, seed: u64, name: &str) -> DVec3 {
    layout(scenario, seed).places.iter().find(|(known, _)| known == name).unwrap().1
}
fn number(scenario: &str, seed: u64, name: &str) -> f64 {
    draw(&layout(scenario, seed), name)
}

#[test]
fn any_two_numbers_are_pressed() {
    let name = "press-button-jittered";
    for seed in SEEDS {
        let mut expert = expert(name, seed);
        for (button, count) in [("left", "left_number"), ("middle", "right_number")] {
            (0..number(name, seed, count) as u32).for_each(|_| expert.press(button));
        }
        expert.press("right");
        strict(&expert, seed);
    }
}

#[test]
fn cubes_anywhere_are_hidden_and_revealed() {
    let name = "cover-blocks-jittered";
    for seed in SEEDS {
        let mut expert = expert(name, seed);
        let slots = ["left", "middle", "right"];
        let homes = slots.map(|slot| expert.object(&format!("lid_{slot}")).pose);
        for slot in slots {
            let cube = expert.object(&format!("cube_{slot}")).pose;
            let lid = format!("lid_{slot}");
            let yaw = heading(&expert.object(&lid).pose);
            carry(&mut expert, &lid, cube.translation, yaw, KNOB);
        }
        let colors = [0, 1, 2].map(|slot| number(name, seed, &format!("color_{slot}")));
        for color in [0.0, 1.0, 2.0] {
            let slot = colors.iter().position(|known| *known == color).unwrap();
            let (lid, home) = (format!("lid_{}", slots[slot]), homes[slot]);
            carry(&mut expert, &lid, home.translation, heading(&home), KNOB);
        }
        strict(&expert, seed);
    }
}

#[test]
fn trays_anywhere_are_exchanged() {
    let name = "swap-blocks-jittered";
    for seed in SEEDS {
        let mut expert = expert(name, seed);
        let [one, two] = ["tray_of_one", "tray_of_two"].map(|tray| number(name, seed, tray));
        let tray = |expert: &Expert, tray: f64| {
            let pose = expert.object(&format!("tray_{tray}")).pose;
            (pose.translation + DVec3::Z * 0.004, heading(&pose))
        };
        for (cube, to) in [("one", 3.0 - one - two), ("two", one), ("one", two)] {
            let (at, yaw) = tray(&expert, to);
            carry(&mut expert, cube, at, yaw, Grip { height: 0.016, ..CUBE });
        }
        expert.press("button");
        strict(&expert, seed);
    }
}

#[test]
fn a_row_anywhere_is_rearranged() {
    let name = "rearrange-blocks-jittered";
    for seed in SEEDS {
        let mut expert = expert(name, seed);
        let [gap, free] = ["gap", "free_mat"].map(|spot| place(name, seed, spot));
        carry(&mut expert, "first", free + DVec3::Z * 0.001, 0.0, CUBE);
        expert.press("button");
        carry(&mut expert, "second", gap, 0.0, CUBE);
        strict(&expert, seed);
    }
}

#[test]
fn t_pieces_anywhere_change_places() {
    for seed in SEEDS {
        let mut expert = expert("swap-t-jittered", seed);
        let [red, blue] = ["red", "blue"].map(|piece| expert.object(piece).pose);
        let distance = |at: &DVec3| at.distance(red.translation).min(at.distance(blue.translation));
        let spare = [-0.3, -0.1, 0.1, 0.3].map(|x| DVec3::new(x, 0.2, 0.74));
        let spare = spare.into_iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
        carry(&mut expert, "red", spare, heading(&red), STEM);
        carry(&mut expert, "blue", red.translation, heading(&red), STEM);
        carry(&mut expert, "red", blue.translation, heading(&blue), STEM);
        strict(&expert, seed);
    }
}

#[test]
fn every_cube_visits_the_green_mat() {
    let name = "place-block-mat-jittered";
    for seed in SEEDS {
        let mut expert = expert(name, seed);
        let green = expert.object("green").pose.translation + DVec3::Z * 0.001;
        for cube in ["first", "second", "third"] {
            let home = expert.object(cube).pose;
            carry(&mut expert, cube, green, 0.0, CUBE);
            carry(&mut expert, cube, home.translation, heading(&home), CUBE);
        }
        strict(&expert, seed);
    }
}

#[test]
fn the_secret_order_has_nothing_to_do_with_hues() {
    for seed in SEEDS {
        let mut expert = expert("blocks-ranking-try-jittered", seed);
        let cubes = ["one", "two", "three"];
        let mut spots = cubes.map(|cube| expert.object(cube).pose.translation);
        let aside = spots.map(|spot| spot + DVec3::Y * if spot.y < -0.05 { 0.1 } else { -0.1 });
        for (cube, spot) in cubes.iter().zip(aside) {
            carry(&mut expert, cube, spot, 0.0, CUBE);
        }
        spots.sort_by(|a, b| a.x.total_cmp(&b.x));
        for (cube, spot) in cubes.iter().zip(spots) {
            carry(&mut expert, cube, spot, 0.0, CUBE);
        }
        expert.press("button");
        strict(&expert, seed);
    }
}

#[test]
fn all_four_polarities_move_the_needle() {
    let name = "battery-try-jittered";
    let mut ways = BTreeSet::new();
    for seed in 0..8 {
        let way = ["left_right_way", "right_right_way"].map(|way| number(name, seed, way));
        if !ways.insert(way.map(|way| way as u32)) {
            continue;
        }
        let mut expert = expert(name, seed);
        let holder = expert.object("holder").pose;
        for ((cell, x), way) in [("left", -0.02), ("right", 0.02)].into_iter().zip(way) {
            let at = (holder * Pose::from_translation(DVec3::new(x, 0.0, 0.004))).translation;
            carry(&mut expert, cell, at, heading(&holder) + PI * way, ENDS);
        }
        expert.wait(1.0);
        strict(&expert, seed);
    }
    assert_eq!(ways.len(), 4, "{ways:?}");
}

#[test]
fn the_twin_is_raised_from_among_six() {
    let name = "observe-and-pickup-jittered";
    for seed in SEEDS {
        let mut expert = expert(name, seed);
        let twin = format!("toy_{}", number(name, seed, "target"));
        let height = (0.5 * expert.object(&twin).size_m.z).max(0.013);
        take(&mut expert, &twin, Grip { height, turn: 0.0 });
        expert.wait(0.5);
        strict(&expert, seed);
    }
}

/// Different starts that can be seen, in 40 seeds.
#[test]
fn published_layouts_are_few_and_jittered_ones_many() {
    let worlds = |name: &str, first: u64| {
        let scenario = open(name);
        let digest = |seed| {
            let options = SimOptions { seed, ..SimOptions::default() };
            Simulation::without_renderer(&scenario, &options).unwrap().world_digest()
        };
        (first..first + 40).map(digest).collect::<BTreeSet<String>>().len()
    };
    assert_eq!(worlds("cover-blocks", 100_000), 6);
    assert!(worlds("place-block-mat", 100_000) <= 20);
    // Pairs of numbers, told apart by what is on the cards.
    assert!((15..=39).contains(&worlds("press-button", 100_000)));
    for name in ["cover-blocks-jittered", "place-block-mat-jittered", "press-button-jittered"] {
        assert_eq!(worlds(name, 0), 40, "{name}");
    }
}
