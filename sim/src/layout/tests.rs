#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use crate::{Scenario, placed::Placed};
use std::collections::BTreeSet;

fn layout(scenario: &str, seed: u64) -> (Scenario, Layout) {
    let scenario = Scenario::open(scenario).unwrap();
    let layout = Layout::draw(&scenario.world, seed).unwrap();
    (scenario, layout)
}

/// Start mats of the published seeds, as the original's sequence of NumPy calls gives them.
#[test]
fn published_seeds_start_on_the_published_mats() {
    let (left, right, front, back) = ([0.0, -0.1], [0.2, -0.1], [0.1, -0.2], [0.1, 0.0]);
    let expected = [right, right, back, left, back, right, back, front];
    for (seed, [x, y]) in (100_000..).zip(expected) {
        let (_, layout) = layout("put-back-block", seed);
        let cube = layout.objects.iter().find(|object| object.name == "cube").unwrap();
        assert!(
            cube.pose.translation.distance(DVec3::new(x, y, 0.741)) < 1e-9,
            "seed {seed}: {}",
            cube.pose.translation
        );
    }
}

#[test]
fn jittered_layouts_keep_their_rules() {
    let scenario = Scenario::open("put-back-block-jittered").unwrap();
    let camera = &scenario.world.cameras[0].model;
    let mut counts = BTreeSet::new();
    let mut perturbed = 0;
    for seed in 0..200 {
        let layout = Layout::draw(&scenario.world, seed).unwrap();
        let mats: Vec<&Placed> = layout.objects.iter().filter(|o| o.name.starts_with("mat_")).collect();
        counts.insert(mats.len());
        let cube = layout.objects.iter().find(|object| object.name == "cube").unwrap();
        perturbed += usize::from(cube.links[0].pieces[0].bevel_m > 0.0);
        let middle = layout.places[0].1;
        for (i, mat) in mats.iter().enumerate() {
            for other in &mats[i + 1..] {
                let gap = gap(&solids_at(mat, &mat.pose), &solids_at(other, &other.pose)).unwrap();
                assert!(gap >= 0.01, "seed {seed}: mats {gap} m apart");
            }
            assert!(mat.pose.yaw().abs() <= 15f64.to_radians() + 1e-9);
            assert!((0.05..0.20).contains(&mat.pose.translation.distance(middle)));
            let size = DVec3::new(0.5, 0.5, 0.0);
            for corner in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
                let corner = mat.pose.transform_point(DVec3::new(corner[0], corner[1], 0.0) * size * 0.08);
                let pixel = camera.intrinsics.project(camera.pose.inverse().transform_point(corner)).unwrap();
                // Room for a camera that is mounted a little wrong.
                let (inner, outer) = (glam::DVec2::splat(8.0), glam::DVec2::new(632.0, 472.0));
                assert!(pixel.cmpgt(inner).all() && pixel.cmplt(outer).all(), "seed {seed}: mat {i} at {pixel}");
                assert!(corner.cmpge(scenario.world.robot.description.workspace_min.with_z(0.0)).all());
                assert!(corner.cmple(scenario.world.robot.description.workspace_max).all());
            }
        }
    }
    assert_eq!(counts, BTreeSet::from([3, 4, 5, 6]));
    assert!((40..80).contains(&perturbed), "{perturbed} of 200 cubes are perturbed");
}

#[test]
fn a_seed_gives_one_layout() {
    let poses = |seed| layout("put-back-block-jittered", seed).1.objects.iter().map(|o| o.pose).collect::<Vec<_>>();
    assert_eq!(poses(3), poses(3));
    assert_ne!(poses(3), poses(4));
}

#[test]
fn impossible_rules_end_after_the_attempts() {
    let scenario = Scenario::open("put-back-block-jittered").unwrap();
    let mut world = scenario.world.clone();
    let between = ["mat".into(), "mat".into()];
    world.rejects[0].rule = RejectRule::Near { between, nearer_than_m: 1.0 };
    world.attempts = 10;
    assert_eq!(Layout::draw(&world, 0).unwrap_err(), LayoutError::Rejected { attempts: 10 });
}

/// One stapler of its model and one that is made differently.
const MADE: &str = r##"
[[object]]
name = "made"
model = "stapler"
position = [-0.1, 0.1, 0.74]
scale = [1.5, 1.0, 1.0]
hue_deg = 240.0

[judge]
"##;

#[test]
fn copies_can_be_made_larger_and_of_another_hue() {
    let original = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/put-back-block.toml");
    let text = std::fs::read_to_string(original).unwrap().replacen("[judge]\n", MADE, 1);
    let scenario = Scenario::parse("s.toml", &text).unwrap();
    let layout = Layout::draw(&scenario.world, 0).unwrap();
    let made = layout.objects.iter().find(|object| object.name == "made").unwrap();
    let plain = layout.objects.iter().find(|object| object.name == "cube").unwrap();
    assert!((made.size().x - 0.195).abs() < 0.002 && (made.size().y - 0.036).abs() < 1e-9, "{}", made.size());
    let [r, g, b] = made.color().unwrap();
    assert!(b > r && r == g, "red became blue: {r} {g} {b}");
    assert!(plain.color().unwrap()[0] > plain.color().unwrap()[2]);
    let wrong = text.replace("scale = [1.5,", "scale = [50.0,");
    let error = Layout::draw(&Scenario::parse("s.toml", &wrong).unwrap().world, 0).unwrap_err();
    assert!(error.to_string().contains("made") && error.to_string().contains("0.1 to 10"), "{error}");
}

#[test]
fn a_condition_can_reject_a_layout() {
    for seed in 0..20 {
        let (scenario, layout) = layout("return-stapler-unseen", seed);
        let at = |name: &str| layout.places.iter().find(|(place, _)| place == name).unwrap().1;
        let target = at("target");
        assert!(target.x.abs() <= 0.32 && (-0.18..=0.16).contains(&target.y), "seed {seed}: {target}");
        let stapler = layout.objects.iter().find(|object| object.name == "stapler").unwrap();
        let distance = stapler.pose.translation.distance(target);
        assert!((0.2..=0.6).contains(&distance), "seed {seed}: {distance}");
        drop(scenario);
    }
}
