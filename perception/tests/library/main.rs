//! Each template of the library that stands alone, seen by a noisy depth camera, with the templates of its own group to
//! choose from.
#![allow(clippy::unwrap_used, clippy::expect_used)] // A failed unwrap is a failed test.

#[allow(dead_code)]
#[path = "../tabletop/sensor.rs"]
mod sensor;
#[allow(dead_code)]
#[path = "../tabletop/world.rs"]
mod world;

use acm_concept::{
    expectation::Expectation,
    pose::Pose,
    solid::{PlacedSolid, Solid},
    template::{Template, TemplateLibrary},
};
use acm_perception::{Grounder, GrounderConfig};
use glam::{DVec2, DVec3};
use sensor::Sensor;
use std::{collections::BTreeMap, fs, path::PathBuf, sync::Arc};
use world::{TABLE_TOP_M, Thing, World, head_camera};

/// Headings at which each is looked at, radians.
const HEADINGS: [f64; 2] = [0.4, 2.1];
const PLACE: (f64, f64) = (0.0, -0.05);

/// The templates of each folder of the library, and those of its own folder as the first.
fn groups() -> BTreeMap<String, TemplateLibrary> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../memory/library");
    let folders = fs::read_dir(&root).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir());
    let mut groups = BTreeMap::new();
    for folder in folders.chain([root.clone()]) {
        let files = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
        let texts: Vec<(String, String)> = files
            .filter(|path| path.is_file())
            .map(|path| (path.display().to_string(), fs::read_to_string(path).unwrap()))
            .collect();
        let library = TemplateLibrary::parse(texts.iter().map(|(name, text)| (name.as_str(), text.as_str()))).unwrap();
        let name = folder.strip_prefix(&root).unwrap().display().to_string();
        if library.iter().all(|template| template.stands_alone) {
            groups.insert(if name.is_empty() { "core".into() } else { name }, library);
        }
    }
    groups
}

/// A table with a typical specimen on it.
fn staged(template: &Template, heading: f64) -> World {
    let values = template.typical().unwrap();
    let pose = Pose::from_yaw(DVec3::new(PLACE.0, PLACE.1, TABLE_TOP_M), heading);
    let mut world = World::table();
    let solids = template.solids(&template.named(&values)).unwrap();
    let place =
        |s: PlacedSolid| Thing { solid: PlacedSolid { solid: s.solid, pose: pose * s.pose }, color: [0.2, 0.3, 0.8] };
    world.things.extend(solids.into_iter().map(place));
    world
}

#[test]
#[ignore = "a measurement of some minutes: cargo test -p acm-perception --test library -- --ignored --nocapture"]
fn how_often_each_template_is_told_from_its_group() {
    let (mut first, mut all) = (0, 0);
    for (group, library) in groups() {
        let library = Arc::new(library);
        let grounder = Grounder::new(library.clone(), GrounderConfig::default());
        let (mut right, mut views, mut pieces) = (0, 0, Vec::new());
        let mut taken = BTreeMap::<String, BTreeMap<String, usize>>::new();
        for (index, template) in library.iter().enumerate() {
            for (view, heading) in HEADINGS.into_iter().enumerate() {
                let sensor = Sensor::new(head_camera());
                let frame = sensor.capture(&staged(template, heading), 100 * index as u64 + view as u64);
                let percepts = grounder.ground(&frame, &Expectation::default());
                let near = |o: &&acm_concept::object::GroundedObject| {
                    o.pose()
                        .is_some_and(|p| p.pose.translation.truncate().distance(DVec2::new(PLACE.0, PLACE.1)) < 0.15)
                };
                let found: Vec<_> = percepts.objects.iter().filter(near).collect();
                let answer = found.first().map_or("nothing".into(), |best| best.parts[0].template.clone());
                if found.len() > 1 {
                    pieces.push(template.name.clone());
                }
                views += 1;
                if answer == template.name {
                    right += 1;
                } else {
                    *taken.entry(template.name.clone()).or_default().entry(answer).or_default() += 1;
                }
            }
        }
        println!("{group}: {right} of {views} views ranked first; seen in pieces: {}", pieces.join(" "));
        for (name, answers) in taken {
            println!("  {name} taken for {answers:?}");
        }
        (first, all) = (first + right, all + views);
    }
    println!("all groups: {first} of {all}");
    assert!(2 * first > all, "chance is far below half");
}

/// A tray of which the floor is too low to stand clear of the table: five boards of two colours, and a cube on the floor.
fn tray_with_a_cube(world: &mut World, x: f64, cube: bool) {
    let (length, width, height, wall) = (0.165, 0.115, 0.022, 0.005);
    let middle = DVec3::new(x, -0.12, TABLE_TOP_M);
    let mut board = |size: DVec3, at: DVec3, color: [f64; 3]| {
        let pose = Pose::from_yaw(middle + at.with_z(0.5 * size.z), 0.0);
        world.things.push(Thing { solid: PlacedSolid { solid: Solid::Box { size }, pose }, color });
    };
    board(DVec3::new(width, length, 0.004), DVec3::ZERO, [0.85, 0.76, 0.5]);
    let rim = [0.8, 0.6, 0.38];
    for side in [-1.0, 1.0] {
        let across = DVec3::X * side * 0.5 * (width - wall);
        board(DVec3::new(wall, length, height), across, rim);
        let along = DVec3::Y * side * 0.5 * (length - wall);
        board(DVec3::new(width, wall, height), along, rim);
    }
    if cube {
        let size = DVec3::splat(0.034);
        let pose = Pose::from_yaw(middle + DVec3::new(0.005, 0.01, 0.004 + 0.5 * size.z), 0.4);
        let solid = PlacedSolid { solid: Solid::Box { size }, pose };
        world.things.push(Thing { solid, color: [0.8, 0.12, 0.1] });
    }
}

#[test]
fn low_trays_that_are_spoken_of_are_whole_with_what_lies_in_them() {
    let mut groups = groups();
    let library = groups.remove("core").unwrap();
    let library = Arc::new(groups.into_values().fold(library, TemplateLibrary::with_on_call));
    let grounder = Grounder::new(library, GrounderConfig::default());
    let mut world = World::table();
    [(-0.14, true), (0.0, false), (0.14, true)].into_iter().for_each(|(x, cube)| tray_with_a_cube(&mut world, x, cube));
    let nouns = ["tray", "cube"].map(String::from).to_vec();
    for seed in 0..3 {
        let frame = Sensor::new(head_camera()).capture(&world, seed);
        let percepts = grounder.ground(&frame, &Expectation { nouns: nouns.clone(), ..Expectation::default() });
        let mut found: Vec<(&str, f64)> = Vec::new();
        for object in &percepts.objects {
            let part = &object.parts[0];
            found.push((object.category.as_str(), part.pose.pose.translation.x));
            if object.category == "tray" {
                let sizes = [part.value("length").unwrap(), part.value("width").unwrap()];
                assert!((sizes[0] - 0.165).abs() < 0.008 && (sizes[1] - 0.115).abs() < 0.010, "seed {seed}: {sizes:?}");
            }
        }
        found.sort_by(|a, b| a.0.cmp(b.0).then(a.1.total_cmp(&b.1)));
        let kinds: Vec<&str> = found.iter().map(|(category, _)| *category).collect();
        assert_eq!(kinds, ["cube", "cube", "tray", "tray", "tray"], "seed {seed}: {found:?}");
    }
}
