//! RMBench's tasks: their files are sound, published seeds start as the original's draws say, and nothing moves by itself.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use crate::{Scenario, SimOptions, Simulation, layout::Layout};
use std::collections::BTreeSet;

mod jittered;
mod solved;

/// The first of the published seeds.
const SEEDS: std::ops::Range<u64> = 100_000..100_008;

/// From the file, so that a scenario can be worked on without building anew.
fn open(name: &str) -> Scenario {
    Scenario::open(&format!("{}/scenarios/rmbench/{name}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap()
}
fn layout(name: &str, seed: u64) -> Layout {
    Layout::draw(&open(name).world, seed).unwrap()
}
fn draw(layout: &Layout, name: &str) -> f64 {
    layout.draws.scalars().find(|(known, _)| *known == name).unwrap().1
}
/// Named draws of every published seed.
fn drawn<const N: usize>(scenario: &str, names: [&str; N]) -> Vec<[f64; N]> {
    SEEDS.map(|seed| layout(scenario, seed)).map(|layout| names.map(|name| draw(&layout, name))).collect()
}
fn near(found: &[f64], expected: &[f64]) -> bool {
    found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 5.1e-5)
}

#[test]
fn every_task_of_the_suite_opens_by_its_name() {
    let names = Scenario::suite("rmbench");
    let plain: Vec<&String> = names.iter().filter(|name| !name.ends_with("-jittered")).collect();
    // With put-back-block, which stands among the first scenarios, nine scored tasks and one that is not.
    assert_eq!(plain.len(), 9, "{plain:?}");
    for name in plain {
        assert_eq!(Scenario::open(name).unwrap().name(), name);
        assert!(open(name).judge.faithful.is_some(), "{name}");
        let jittered = format!("{name}-jittered");
        assert!(names.contains(&jittered) && open(&jittered).judge.faithful.is_none(), "{jittered}");
    }
    assert!(Scenario::names().iter().all(|name| !names.contains(name)), "a name stands for two scenarios");
    assert!(Scenario::suite("objects").is_empty() && Scenario::suites() == ["rmbench"]);
}

#[test]
fn published_seeds_press_the_published_numbers() {
    let expected = [[1., 3.], [2., 5.], [3., 4.], [5., 4.], [4., 2.], [2., 1.], [8., 1.], [9., 1.]];
    assert_eq!(drawn("press-button", ["left_number", "right_number"]), expected);
}

#[test]
fn published_seeds_cover_the_published_colours() {
    let expected = [[1, 0, 2], [1, 0, 2], [1, 2, 0], [0, 1, 2], [0, 1, 2], [1, 2, 0], [0, 2, 1], [0, 2, 1]];
    assert_eq!(drawn("cover-blocks", ["color_0", "color_1", "color_2"]), expected.map(|ids| ids.map(f64::from)));
}

#[test]
fn published_seeds_swap_in_the_published_trays() {
    let expected = [[1, 0], [1, 2], [0, 1], [2, 1], [1, 0], [2, 1], [1, 0], [2, 1]];
    assert_eq!(drawn("swap-blocks", ["tray_of_one", "tray_of_two"]), expected.map(|trays| trays.map(f64::from)));
}

#[test]
fn published_seeds_rearrange_in_the_published_places() {
    let expected = [
        [-0.2011, -0.1088, -0.1218, 0.0],
        [-0.1855, -0.1008, -0.0940, 1.0],
        [-0.2281, -0.1346, -0.0933, 0.0],
        [-0.1672, -0.1993, -0.1015, 1.0],
        [-0.2257, -0.1250, -0.1004, 1.0],
        [-0.1830, -0.1104, -0.1308, 0.0],
        [-0.1824, -0.1233, -0.1275, 1.0],
        [-0.2330, -0.1983, -0.0912, 0.0],
    ];
    let found = drawn("rearrange-blocks", ["button_x", "button_y", "row_y", "side"]);
    assert!(found.iter().zip(&expected).all(|(found, expected)| near(found, expected)), "{found:?}");
}

#[test]
fn published_seeds_lay_the_t_pieces_as_published() {
    let expected = [
        [-0.1044, 0.3089, -0.1389, 0.7194],
        [-0.1004, 0.1956, -0.1492, 0.0287],
        [-0.1173, 0.4429, -0.1374, 0.5525],
        [-0.1497, 0.2964, -0.1384, 0.7436],
        [-0.1125, 0.5665, -0.1108, -0.5067],
        [-0.1052, -0.4713, -0.1457, 0.0636],
        [-0.1116, -0.0706, -0.1171, -0.0414],
        [-0.1492, 0.0292, -0.1092, 0.2069],
    ];
    let found = drawn("swap-t", ["red_across", "red_heading", "blue_across", "blue_heading"]);
    assert!(found.iter().zip(&expected).all(|(found, expected)| near(found, expected)), "{found:?}");
}

#[test]
fn published_seeds_hide_the_published_polarities_and_orders() {
    let ways = [[0, 1], [1, 1], [1, 1], [1, 0], [1, 1], [0, 1], [1, 1], [0, 1]];
    assert_eq!(drawn("battery-try", ["left_right_way", "right_right_way"]), ways.map(|ways| ways.map(f64::from)));
    let expected = [
        [0.6454, 1., 2., 0.],
        [0.7175, 2., 1., 0.],
        [0.2353, 2., 0., 1.],
        [0.6483, 1., 2., 0.],
        [0.9154, 2., 1., 0.],
        [0.2902, 1., 2., 0.],
        [0.8200, 2., 1., 0.],
        [0.3243, 0., 2., 1.],
    ];
    let found = drawn("blocks-ranking-try", ["first_hue", "slot_0", "slot_1", "slot_2"]);
    assert!(found.iter().zip(&expected).all(|(found, expected)| near(found, expected)), "{found:?}");
}

#[test]
fn published_seeds_put_cubes_on_the_published_mats() {
    let expected = [[3, 4, 5], [0, 1, 2], [0, 2, 3], [0, 2, 5], [0, 4, 5], [3, 4, 5], [0, 2, 4], [0, 3, 4]];
    let found = drawn("place-block-mat", ["first_slot", "second_slot", "third_slot"]);
    assert_eq!(found, expected.map(|slots| slots.map(f64::from)));
}

/// Five different items of which one is shown, as far apart as they should be; half of the episodes hold two of its kind.
#[test]
fn five_different_items_lie_before_the_bench() {
    let mut kin = 0;
    for seed in 0..200 {
        let layout = layout("observe-and-pickup", seed);
        let kinds: Vec<f64> = (0..5).map(|k| draw(&layout, &format!("kind_{k}"))).collect();
        let target = kinds[draw(&layout, "target") as usize];
        assert_eq!(kinds.iter().map(|kind| *kind as i64).collect::<BTreeSet<_>>().len(), 5, "seed {seed}: {kinds:?}");
        assert_eq!(draw(&layout, "shown_kind"), target);
        let model = |name: &str| layout.objects.iter().find(|object| object.name == name).unwrap().model.model.clone();
        assert_eq!(model("shown"), model(&format!("toy_{}", draw(&layout, "target"))));
        let category = |kind: f64| (kind / 4.0).floor();
        kin += usize::from(kinds.iter().filter(|kind| category(**kind) == category(target)).count() > 1);
        let at: Vec<[f64; 2]> =
            (0..5).map(|k| [draw(&layout, &format!("x_{k}")), draw(&layout, &format!("y_{k}"))]).collect();
        assert!(at.iter().all(|[x, y]| (0.07..=0.35).contains(&x.abs()) && (-0.25..=-0.1).contains(y)), "{at:?}");
    }
    assert!((70..=140).contains(&kin), "{kin} of 200 episodes have another item of the shown one's kind");
}

/// Everything lies as it is laid for ten seconds; cells do not roll, lids lie flat enough for the published checker.
#[test]
fn what_is_laid_down_stays_where_it_is() {
    for name in Scenario::suite("rmbench") {
        for seed in [100_000, 7] {
            let simulation =
                Simulation::without_renderer(&open(&name), &SimOptions { seed, ..SimOptions::default() }).unwrap();
            let before = simulation.truth();
            let now = simulation.clock().now();
            let later = acm_concept::time::Time::from_seconds(now.seconds() + 10.0);
            simulation.clock().wait_until(later).unwrap();
            for (object, old) in simulation.truth().iter().zip(&before).filter(|(object, _)| object.name != "screen") {
                let (shift, turn) =
                    (object.pose.translation.distance(old.pose.translation), object.pose.angle_to(&old.pose));
                assert!(shift < 5e-4 && turn < 5e-3, "{name} {seed}: {} moved {shift} m, {turn} rad", object.name);
                assert!(!object.name.starts_with("lid_") || object.pose.translation.z < 0.742, "{name}: {object:?}");
            }
            let verdict = simulation.verdict();
            assert!(!verdict.strict && verdict.faithful != Some(true), "{name} {seed}: {verdict:?}");
            assert!(verdict.violations.is_empty(), "{name} {seed}: {:?}", verdict.violations);
        }
    }
}

/// Pictures for people: `RMBENCH_PICTURES=FOLDER cargo test -p acm-sim pictures -- --ignored`.
#[test]
#[ignore = "writes files"]
fn pictures() {
    let Ok(folder) = std::env::var("RMBENCH_PICTURES") else { return };
    let renderer = std::sync::Arc::new(std::sync::Mutex::new(acm_render::Renderer::new().unwrap()));
    for name in Scenario::suite("rmbench") {
        let seed = if name.ends_with("jittered") { 7 } else { 100_000 };
        let options = SimOptions { seed, ..SimOptions::default() };
        let simulation = Simulation::new(&open(&name), &options, renderer.clone()).unwrap();
        simulation.preview(None).unwrap().color.save(format!("{folder}/{name}.png")).unwrap();
    }
}
