//! Grounding of a rendered table through a noisy depth camera.
#![allow(clippy::unwrap_used, clippy::expect_used)] // A failed unwrap is a failed test.

mod sensor;
mod world;

use acm_concept::{
    camera::RgbdFrame,
    expectation::{Expectation, ExpectedObject},
    ids::ObjectId,
    object::{Blindness, GroundedObject, Observability, Percepts, Visibility},
    pose::Pose,
    template::{TemplateLibrary, YawSymmetry},
    time::Time,
};
use acm_perception::{Grounder, GrounderConfig, LastPictures, level};
use glam::{DVec2, DVec3};
use sensor::Sensor;
use std::sync::Arc;
use world::{
    BUTTON, BUTTON_HEIGHT_M, BUTTON_RADIUS_M, CUBE_M, MAT_M, MAT_THICKNESS_M, MATS, TABLE_TOP_M, World, far_camera,
    head_camera,
};

fn library() -> Arc<TemplateLibrary> {
    let files = [
        ("box.toml", include_str!("../../../memory/library/box.toml")),
        ("button.toml", include_str!("../../../memory/library/button.toml")),
        ("cylinder.toml", include_str!("../../../memory/library/cylinder.toml")),
        ("mat.toml", include_str!("../../../memory/library/mat.toml")),
    ];
    Arc::new(TemplateLibrary::parse(files).unwrap())
}

fn grounder() -> Grounder {
    Grounder::new(library(), GrounderConfig::default())
}

fn instruction() -> Expectation {
    let nouns = ["cube", "mat", "button", "middle"].map(String::from).to_vec();
    Expectation { nouns, ..Expectation::default() }
}

fn of_category<'a>(percepts: &'a Percepts, category: &str) -> Vec<&'a GroundedObject> {
    percepts.objects.iter().filter(|o| o.category == category).collect()
}

fn place(object: &GroundedObject) -> DVec2 {
    object.pose().unwrap().pose.translation.truncate()
}

fn summary(percepts: &Percepts) -> String {
    let line = |o: &GroundedObject| {
        let p = &o.parts[0];
        let values: Vec<String> = p.parameters.iter().map(|v| format!("{:.0}", v.value * 1e3)).collect();
        let t = p.pose.pose.translation;
        format!(
            "  {} {} {:?} at {:.0},{:.0},{:.0} yaw {:.1} conf {:.2} px {}",
            o.category,
            p.template,
            values,
            t.x * 1e3,
            t.y * 1e3,
            t.z * 1e3,
            p.pose.pose.yaw().to_degrees(),
            o.confidence,
            o.support.count
        )
    };
    percepts.objects.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Grounds a world under the instruction; writes an overlay when OVERLAYS names a folder, and prints what was found.
fn ground(name: &str, world: &World, camera: Pose, seed: u64, expectation: &Expectation) -> Percepts {
    let frame = Sensor::new(camera).capture(world, seed);
    let percepts = grounder().ground(&frame, expectation);
    println!("{name}, seed {seed}\n{}", summary(&percepts));
    if let Ok(folder) = std::env::var("OVERLAYS") {
        let image = acm_perception::overlay::draw(&frame, &percepts, &[], &library());
        image.save(format!("{folder}/{name}-{seed}.png")).unwrap();
    }
    percepts
}

/// Checks that four mats, a cube and a button, and nothing else, are found; returns their places.
fn check_layout(percepts: &Percepts) -> (Vec<DVec2>, DVec2) {
    assert_eq!(percepts.blindness, None);
    let (mats, cubes, buttons) =
        (of_category(percepts, "mat"), of_category(percepts, "cube"), of_category(percepts, "button"));
    let counts = (mats.len(), cubes.len(), buttons.len(), percepts.objects.len());
    assert_eq!(counts, (4, 1, 1, 6), "mats, cubes, buttons, all:\n{}", summary(percepts));
    let size = |o: &GroundedObject, name: &str| o.parts[0].value(name).unwrap();
    assert!((size(cubes[0], "length") - CUBE_M).abs() < 0.006 && (size(cubes[0], "height") - CUBE_M).abs() < 0.006);
    assert!((size(buttons[0], "radius") - BUTTON_RADIUS_M).abs() < 0.005);
    assert!((size(buttons[0], "height") - BUTTON_HEIGHT_M).abs() < 0.005);
    for mat in &mats {
        assert!((size(mat, "length") - MAT_M).abs() < 0.005 && (size(mat, "width") - MAT_M).abs() < 0.005);
    }
    (mats.into_iter().map(place).collect(), place(cubes[0]))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn the_put_back_block_table_is_grounded_over_noise_and_bias() {
    let places =
        [(0.0, -0.1, MAT_THICKNESS_M), (0.1, -0.1, 0.0), (0.1, 0.0, MAT_THICKNESS_M), (0.2, -0.1, MAT_THICKNESS_M)];
    let mut errors = Vec::new();
    for (seed, cube) in [1, 101, 201, 301, 401, 501].into_iter().zip(places.into_iter().cycle()) {
        let camera = if seed % 200 == 1 { head_camera() } else { far_camera() };
        let percepts = ground("layout", &World::put_back_block(cube), camera, seed, &instruction());
        let (mats, found) = check_layout(&percepts);
        for (x, y) in MATS {
            let truth = DVec2::new(x, y) - DVec2::new(cube.0, cube.1);
            let nearest = mats.iter().map(|mat| (*mat - found - truth).length()).fold(f64::INFINITY, f64::min);
            errors.push(nearest);
        }
        let cube = of_category(&percepts, "cube")[0];
        assert!(cube.pose().unwrap().pose.yaw().abs() < 8f64.to_radians());
        let height = cube.pose().unwrap().pose.translation.z - percepts.support.unwrap().height_at(found.x, found.y);
        assert!(height.abs() < 0.004, "the cube's base is {height} m over the plane");
    }
    println!("errors {errors:.4?}");
    assert!(median(errors.clone()) < 0.004 && errors.iter().all(|e| *e < 0.008), "{errors:?}");
}

#[test]
fn turned_mats_and_blocks_keep_their_headings() {
    let mut world = World::table();
    let mats = [(0.0, -0.1, 0.2), (0.22, -0.1, -0.25), (0.1, -0.22, 0.1)];
    for (x, y, yaw) in mats {
        world.mat(x, y, yaw);
    }
    world.cube(0.1, 0.02, 0.0, 0.6);
    world.block(DVec3::new(0.16, 0.05, 0.1), -0.25, -0.1, 0.5, [0.2, 0.6, 0.3]);
    let percepts = ground("turned", &world, head_camera(), 7, &instruction());
    let found = of_category(&percepts, "mat");
    assert_eq!((found.len(), percepts.objects.len()), (3, 5), "{}", summary(&percepts));
    for (x, y, yaw) in mats {
        let near = found.iter().min_by(|a, b| {
            let distance = |o: &GroundedObject| place(o).distance(DVec2::new(x, y));
            distance(a).total_cmp(&distance(b))
        });
        let error = YawSymmetry::Fold(4).difference(near.unwrap().pose().unwrap().pose.yaw(), yaw);
        assert!(error < 2f64.to_radians(), "{} degrees", error.to_degrees());
    }
    let cube = of_category(&percepts, "cube")[0];
    assert!(YawSymmetry::Fold(4).difference(cube.pose().unwrap().pose.yaw(), 0.6) < 6f64.to_radians());
    let block = percepts.objects.iter().find(|o| o.parts[0].value("length").is_some_and(|l| l > 0.12)).unwrap();
    let value = |name: &str| block.parts[0].value(name).unwrap();
    let errors = [value("length") - 0.16, value("width") - 0.05, value("height") - 0.1];
    assert!(errors.iter().all(|e| e.abs() < 0.007), "{errors:?}");
    assert!(YawSymmetry::Fold(2).difference(block.pose().unwrap().pose.yaw(), 0.5) < 2f64.to_radians());
}

#[test]
fn what_shows_within_print_is_part_of_what_is_printed_on() {
    const WOOD: [f64; 3] = [0.7, 0.45, 0.22];
    let mut world = World::table();
    world.block(DVec3::new(0.14, 0.185, 0.001), 0.0, 0.09, 0.0, WOOD);
    // Two squares, one over the other: an eight whose eyes are large enough to be mats.
    for (size, x, y) in [
        ((0.068, 0.016), 0.0, 0.048),
        ((0.068, 0.016), 0.0, 0.0),
        ((0.068, 0.016), 0.0, -0.048),
        ((0.016, 0.112), -0.026, 0.0),
        ((0.016, 0.112), 0.026, 0.0),
    ] {
        world.block(DVec3::new(size.0, size.1, 0.0015), x, 0.09 + y, 0.0, [0.01; 3]);
    }
    let frame = Sensor::new(head_camera()).capture(&world, 5);
    let reader = Grounder::new(library(), GrounderConfig { read: true, ..GrounderConfig::default() });
    let percepts = reader.ground(&frame, &instruction());
    assert_eq!(percepts.objects.len(), 1, "{}", summary(&percepts));
    let read: Vec<String> = percepts.objects[0].readings.iter().map(ToString::to_string).collect();
    assert!(read.len() == 1 && read[0].starts_with("`8`"), "{read:?}");
}

#[test]
fn a_cube_is_never_a_button_and_a_disc_becomes_one_only_when_spoken_of() {
    let world = World::put_back_block((0.1, -0.1, 0.0));
    let only_button = Expectation { nouns: vec!["button".into()], ..Expectation::default() };
    let percepts = ground("button", &world, head_camera(), 11, &only_button);
    let probability =
        |o: &GroundedObject, noun: &str| o.categories.iter().find(|(n, _)| n == noun).map_or(0.0, |(_, p)| *p);
    let cube = percepts.objects.iter().find(|o| o.parts[0].template == "box").unwrap();
    assert!(probability(cube, "button") < 0.01, "{:?}", cube.categories);
    let round = of_category(&percepts, "button");
    assert!(round.len() == 1 && probability(round[0], "button") > 0.5);
    let silent = ground("silent", &world, head_camera(), 11, &Expectation::default());
    assert_eq!(of_category(&silent, "button").len(), 0, "{}", summary(&silent));
    assert_eq!(silent.objects.len(), percepts.objects.len());
}

#[test]
fn blindness_is_an_answer() {
    let sensor = Sensor::new(head_camera());
    let frame = sensor.capture(&World::put_back_block((0.1, -0.1, 0.0)), 3);
    let pixels = frame.header.intrinsics.pixels();
    let with =
        |color: Vec<u8>, depth: Vec<f32>| RgbdFrame::new(frame.header.clone(), color.into(), depth.into()).unwrap();
    let cases = [
        (with(vec![0; 3 * pixels], vec![0.0; pixels]), Blindness::NoDepth),
        (with(vec![0; 3 * pixels], frame.depth.to_vec()), Blindness::NoColor),
        (with(frame.color.to_vec(), vec![0.0; pixels]), Blindness::NoDepth),
        (with(frame.color.to_vec(), vec![f32::NAN; pixels]), Blindness::NoDepth),
        // Metres taken for millimetres, and millimetres for metres.
        (with(frame.color.to_vec(), frame.depth.iter().map(|z| 1e-3 * z).collect()), Blindness::DepthScale),
        (with(frame.color.to_vec(), frame.depth.iter().map(|z| 1e3 * z).collect()), Blindness::DepthScale),
        (with(vec![255; 3 * pixels], frame.depth.to_vec()), Blindness::Overexposed),
        // Depth at the end of the sensor's range of numbers, everywhere.
        (with(frame.color.to_vec(), vec![65.535; pixels]), Blindness::DepthScale),
        // A wall: depth, but nothing to stand on.
        (with(frame.color.to_vec(), vec![1.0; pixels]), Blindness::NoSupport),
    ];
    let expectation =
        remembered(&ground("seen", &World::put_back_block((0.1, -0.1, 0.0)), head_camera(), 3, &instruction()));
    for (blind, reason) in cases {
        let percepts = grounder().ground(&blind, &expectation);
        assert_eq!(percepts.blindness, Some(reason));
        assert!(percepts.objects.is_empty() && percepts.support.is_none());
        assert_eq!(percepts.expected.len(), expectation.objects.len());
        assert!(percepts.expected.iter().all(|view| view.visibility == Visibility::NotMeasured));
    }
}

#[test]
fn what_lies_where_half_of_the_depth_is_missing_was_not_measured() {
    let frame = Sensor::new(head_camera()).capture(&World::put_back_block((0.1, -0.1, 0.0)), 3);
    let seen = ground("seen", &World::put_back_block((0.1, -0.1, 0.0)), head_camera(), 3, &instruction());
    let expectation = remembered(&seen);
    let width = frame.header.intrinsics.width as usize;
    let left = |at: usize| at % width < width / 2;
    let depth: Vec<f32> = frame.depth.iter().enumerate().map(|(at, z)| if left(at) { *z } else { 0.0 }).collect();
    let half = RgbdFrame::new(frame.header.clone(), frame.color.clone(), depth.into()).unwrap();
    let percepts = grounder().ground(&half, &expectation);
    assert_eq!(percepts.blindness, None);
    assert!(percepts.depth_fraction < 0.6, "{}", percepts.depth_fraction);
    // The button stands on the left, everything else on the right: of that nothing is claimed, least of all its absence.
    assert_eq!((of_category(&percepts, "button").len(), percepts.objects.len()), (1, 1), "{}", summary(&percepts));
    for (view, object) in percepts.expected.iter().zip(&seen.objects) {
        let wanted = if object.category == "button" { Visibility::Seen } else { Visibility::NotMeasured };
        assert_eq!(view.visibility, wanted, "{}", object.category);
    }
}

#[test]
fn a_camera_that_has_stopped_shows_nothing() {
    let sensor = Sensor::new(head_camera());
    let frame = sensor.capture(&World::put_back_block((0.1, -0.1, 0.0)), 3);
    let later = |frame: &RgbdFrame, millis: f64| {
        let mut header = frame.header.clone();
        header.time = Time::from_seconds(header.time.seconds() + 1e-3 * millis);
        RgbdFrame::new(header, frame.color.clone(), frame.depth.clone()).unwrap()
    };
    let (grounder, mut last) = (grounder(), LastPictures::default());
    let mut blindness = |frame: &RgbdFrame| grounder.ground_next(&mut last, frame, &instruction()).blindness;
    assert_eq!(blindness(&frame), None);
    // Asked for again at once it is the same picture, and no sign of anything.
    assert_eq!(blindness(&frame), None);
    assert_eq!(blindness(&later(&frame, 100.0)), Some(Blindness::Frozen));
    assert_eq!(blindness(&later(&frame, 200.0)), Some(Blindness::Frozen));
    let moving = sensor.capture(&World::put_back_block((0.1, -0.1, 0.0)), 4);
    assert_eq!(blindness(&later(&moving, 300.0)), None);
}

/// What a memory would expect after these percepts: the same things in the same places.
fn remembered(percepts: &Percepts) -> Expectation {
    let object = |(i, o): (usize, &GroundedObject)| ExpectedObject {
        views: 1,
        id: ObjectId(i as u64),
        category: o.category.clone(),
        parts: o.parts.clone(),
        appearance: o.appearance,
        confidence: o.confidence,
        held: false,
        was_put: false,
    };
    Expectation { objects: percepts.objects.iter().enumerate().map(object).collect(), ..instruction() }
}

#[test]
fn the_robots_own_pixels_are_nobodys_object() {
    let mut world = World::put_back_block((0.0, -0.1, MAT_THICKNESS_M));
    let robot = world.gripper(DVec3::new(0.15, -0.02, TABLE_TOP_M + 0.12));
    let expectation = Expectation { robot, ..instruction() };
    let percepts = ground("gripper", &world, head_camera(), 21, &expectation);
    for object in &percepts.objects {
        let z = object.pose().unwrap().pose.translation.z;
        assert!((z - TABLE_TOP_M).abs() < 0.02, "{} floats at {z}", object.category);
    }
    assert_eq!(of_category(&percepts, "cube").len(), 1, "{}", summary(&percepts));
    assert_eq!(of_category(&percepts, "button").len(), 1);
    assert!((3..=4).contains(&of_category(&percepts, "mat").len()));
    let blind_to_itself = ground("gripper-unmasked", &world, head_camera(), 21, &instruction());
    assert!(blind_to_itself.objects.len() > percepts.objects.len(), "the mask made no difference");
}

#[test]
fn a_lifted_cube_is_seen_in_the_air() {
    let mut world = World::put_back_block((0.05, -0.12, 0.1));
    let robot = world.gripper(DVec3::new(0.05, -0.12, TABLE_TOP_M + 0.11));
    let percepts = ground("lifted", &world, head_camera(), 31, &Expectation { robot, ..instruction() });
    let lifted: Vec<&GroundedObject> =
        percepts.objects.iter().filter(|o| o.pose().unwrap().pose.translation.z > TABLE_TOP_M + 0.06).collect();
    assert!(lifted.len() <= 1, "{}", summary(&percepts));
    for object in lifted {
        // Little of it is seen between fingers and palm: it may be misjudged, but not believed.
        assert!(object.truncated && object.confidence < 0.6, "{}", summary(&percepts));
        let place = object.pose().unwrap().pose.translation;
        assert!(place.distance(DVec3::new(0.05, -0.12, TABLE_TOP_M + 0.1)) < 0.05, "{place}");
    }
}

#[test]
fn memory_helps_with_what_is_mostly_covered() {
    let before = ground("whole", &World::put_back_block((0.1, -0.1, 0.0)), head_camera(), 41, &instruction());
    let mut expectation = remembered(&before);
    // A box hides the nearer part of two mats.
    let mut hidden = World::put_back_block((0.1, -0.1, 0.0));
    hidden.block(DVec3::new(0.5, 0.02, 0.28), 0.1, -0.27, 0.0, [0.8, 0.7, 0.2]);
    let alone = ground("half", &hidden, head_camera(), 45, &instruction());
    let with_memory = ground("half-remembered", &hidden, head_camera(), 45, &expectation);
    for (x, y) in [(0.0, -0.1), (0.2, -0.1)] {
        let near = |percepts: &Percepts| {
            let distance = |o: &&GroundedObject| place(o).distance(DVec2::new(x, y));
            let mats = of_category(percepts, "mat");
            mats.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap().clone()
        };
        let (guessed, tracked) = (near(&alone), near(&with_memory));
        assert!(guessed.truncated && tracked.truncated);
        let width = &guessed.parts[0].parameters[1];
        assert!(
            matches!(width.observability, Observability::Interval { low, high } if low < MAT_M && high > MAT_M - 0.01),
            "{width:?}"
        );
        assert!(guessed.pose().unwrap().position_sigma_m.y > 0.01, "{:?}", guessed.parts[0]);
        assert!(place(&tracked).distance(DVec2::new(x, y)) < 0.012, "{}", place(&tracked));
        assert_eq!(tracked.parts[0].parameters[1].observability, Observability::PriorOnly);
    }

    // The cube in the hand, of which little is seen.
    let mut lifted = World::put_back_block((0.05, -0.12, 0.1));
    expectation.robot = lifted.gripper(DVec3::new(0.05, -0.12, TABLE_TOP_M + 0.11));
    let cube = before.objects.iter().position(|o| o.category == "cube").unwrap();
    expectation.objects[cube].held = true;
    expectation.objects[cube].parts[0].pose.pose.translation = DVec3::new(0.055, -0.115, TABLE_TOP_M + 0.095);
    let percepts = ground("held", &lifted, head_camera(), 32, &expectation);
    let held = percepts.objects.iter().find(|o| o.expected == Some(ObjectId(cube as u64))).unwrap();
    assert_eq!(held.category, "cube");
    let error = held.pose().unwrap().pose.translation.distance(DVec3::new(0.05, -0.12, TABLE_TOP_M + 0.1));
    assert!(error < 0.02, "{error}");
}

#[test]
fn expected_objects_are_seen_missed_hidden_or_out_of_view() {
    let before = ground("before", &World::put_back_block((0.1, -0.1, 0.0)), head_camera(), 41, &instruction());
    let mut expectation = remembered(&before);
    let cube = before.objects.iter().position(|o| o.category == "cube").unwrap();
    // One more cube beside the table's end, out of the image.
    let mut far = expectation.objects[cube].clone();
    far.id = ObjectId(99);
    far.parts[0].pose.pose.translation.x += 5.0;
    expectation.objects.push(far);
    let verdict = |percepts: &Percepts, id: u64| {
        percepts.expected.iter().find(|view| view.object == ObjectId(id)).unwrap().visibility
    };

    let same = ground("same", &World::put_back_block((0.1, -0.1, 0.0)), head_camera(), 42, &expectation);
    for (i, object) in before.objects.iter().enumerate() {
        assert_eq!(verdict(&same, i as u64), Visibility::Seen, "{} {i}", object.category);
    }
    assert_eq!(verdict(&same, 99), Visibility::OutOfView);
    let mut hints: Vec<ObjectId> = same.objects.iter().filter_map(|o| o.expected).collect();
    hints.sort();
    assert_eq!(hints, (0..6).map(ObjectId).collect::<Vec<_>>());
    for object in &same.objects {
        let id = object.expected.unwrap().0 as usize;
        assert_eq!(object.category, before.objects[id].category);
    }

    // The cube is gone and so is a mat: nothing is seen where they were, and memory conjures nothing up.
    let mut emptied = World::table();
    for (x, y) in &MATS[1..] {
        emptied.mat(*x, *y, 0.0);
    }
    emptied.button(BUTTON.0, BUTTON.1);
    let gone = ground("gone", &emptied, head_camera(), 43, &expectation);
    assert_eq!(verdict(&gone, cube as u64), Visibility::SeenThrough);
    let first_mat = before.objects.iter().position(|o| place(o).distance(MATS[0].into()) < 0.03).unwrap();
    assert_eq!(verdict(&gone, first_mat as u64), Visibility::SeenThrough);
    assert_eq!(gone.objects.len(), 4, "{}", summary(&gone));

    // A wall of a box stands before everything.
    let mut hidden = World::put_back_block((0.1, -0.1, 0.0));
    hidden.block(DVec3::new(0.5, 0.02, 0.35), 0.1, -0.24, 0.0, [0.8, 0.7, 0.2]);
    let covered = ground("covered", &hidden, head_camera(), 44, &expectation);
    assert_eq!(verdict(&covered, cube as u64), Visibility::Occluded);
}

#[test]
fn what_memory_explains_is_verified_and_what_took_its_place_is_noticed() {
    const SIZE: DVec3 = DVec3::new(0.06, 0.05, 0.05);
    const SAND: [f64; 3] = [0.8, 0.6, 0.2];
    let table = |fill: &dyn Fn(&mut World)| {
        let mut world = World::table();
        fill(&mut world);
        world.block(DVec3::new(0.04, 0.04, 0.06), 0.15, -0.1, 0.3, [0.2, 0.6, 0.3]);
        world
    };
    let block = |size: DVec3, x: f64, color| table(&move |world: &mut World| world.block(size, x, -0.1, 0.0, color));
    for seed in [71, 73] {
        let known = remembered(&ground("known", &block(SIZE, 0.0, SAND), head_camera(), seed, &instruction()));
        assert_eq!(known.objects.len(), 2);
        let look = |name: &str, world: World| ground(name, &world, head_camera(), seed + 1, &known);
        let length = |o: &GroundedObject| o.parts[0].parameters[0].value;
        let at = |percepts: &Percepts, x: f64| {
            let near = |o: &&GroundedObject| place(o).distance(DVec2::new(x, -0.1)) < 0.015;
            percepts.objects.iter().find(near).unwrap_or_else(|| panic!("{}", summary(percepts))).clone()
        };
        let same = look("same", block(SIZE, 0.0, SAND));
        assert_eq!(same.objects.len(), 2);
        assert!(same.objects.iter().all(|o| o.expected.is_some()), "{}", summary(&same));
        assert!((length(&at(&same, 0.0)) - 0.06).abs() < 0.002);
        let longer = look("longer", block(SIZE + DVec3::X * 0.008, 0.0, SAND));
        assert!((length(&at(&longer, 0.0)) - 0.068).abs() < 0.003, "{}", summary(&longer));
        let moved = look("moved", block(SIZE, 0.012, SAND));
        assert!((place(&at(&moved, 0.012)).x - place(&at(&same, 0.0)).x - 0.012).abs() < 0.003, "{}", summary(&moved));
        let round = look("round", table(&|world| world.disc(0.029, 0.05, 0.0, -0.1, SAND)));
        assert_eq!(at(&round, 0.0).parts[0].template, "cylinder", "{}", summary(&round));
        let topped = look(
            "topped",
            table(&|world| {
                world.block(SIZE, 0.0, -0.1, 0.0, SAND);
                world.cube(0.0, -0.1, SIZE.z, 0.0);
            }),
        );
        assert_eq!(topped.objects.len(), 3, "{}", summary(&topped));
        let other = look("other", block(SIZE, 0.0, [0.1, 0.3, 0.8]));
        let colors = [at(&other, 0.0), at(&same, 0.0)].map(|object| object.appearance.mean);
        assert!(colors[0].distance(&colors[1]) > 30.0, "{colors:?}");
    }
}

#[test]
fn memory_tells_two_touching_blocks_apart() {
    let size = DVec3::new(0.05, 0.05, 0.05);
    let mut apart = World::table();
    apart.block(size, -0.05, -0.1, 0.0, [0.8, 0.6, 0.2]);
    apart.block(size, 0.1, -0.1, 0.0, [0.2, 0.6, 0.3]);
    let mut expectation = remembered(&ground("apart", &apart, head_camera(), 51, &instruction()));
    assert_eq!(expectation.objects.len(), 2);
    for (object, x) in expectation.objects.iter_mut().zip([-0.05, 0.0005]) {
        object.parts[0].pose.pose.translation.x = x;
    }
    let mut touching = World::table();
    touching.block(size, -0.05, -0.1, 0.0, [0.8, 0.6, 0.2]);
    touching.block(size, 0.0005, -0.1, 0.0, [0.2, 0.6, 0.3]);
    let told = ground("touching", &touching, head_camera(), 52, &expectation);
    assert_eq!(told.objects.len(), 2, "{}", summary(&told));
}

#[test]
fn the_same_frame_gives_the_same_answer() {
    let frame = Sensor::new(head_camera()).capture(&World::put_back_block((0.1, -0.1, 0.0)), 61);
    assert_eq!(grounder().ground(&frame, &instruction()), grounder().ground(&frame, &instruction()));
}

#[test]
fn without_a_pose_the_plane_is_zero_and_x_points_right() {
    let mut frame = Sensor::new(head_camera()).capture(&World::put_back_block((0.1, -0.1, 0.0)), 71);
    frame.header.camera_pose = Pose::IDENTITY;
    frame.header.camera_pose = level(&frame, &GrounderConfig::default()).unwrap();
    let percepts = grounder().ground(&frame, &instruction());
    let (mats, cube) = check_layout(&percepts);
    let support = percepts.support.unwrap();
    assert!(support.normal.angle_between(DVec3::Z) < 0.01 && support.offset_m.abs() < 0.003);
    // The camera looks along the world's y here, so right stays right.
    assert!(mats.iter().any(|mat| (*mat - cube - DVec2::new(0.1, 0.0)).length() < 0.01));
}

#[test]
fn a_thing_whose_pixels_are_given_is_guessed_and_fitted() {
    let (bare, mut world) = (World::table(), World::table());
    let size = DVec3::new(0.14, 0.08, 0.06);
    world.block(size, 0.05, -0.05, 0.4, [0.1, 0.5, 0.2]);
    let frame = Sensor::new(head_camera()).capture(&world, 3);
    let depth = |world: &World| world.render(&frame.header.intrinsics, &head_camera()).1;
    let labels: Vec<u16> = depth(&world).iter().zip(depth(&bare)).map(|(a, b)| u16::from(*a < b - 1e-6)).collect();
    let things = acm_perception::given::things(&frame, &labels, &[0.0, 0.0], &GrounderConfig::default()).unwrap();
    // The second has no pixel.
    let [Some(thing), None] = &things[..] else { panic!("{} things", things.iter().flatten().count()) };
    let library = library();
    let template = library.get("box").unwrap();
    let off = |values: &[f64]| values.iter().zip(size.to_array()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (guess, fit) = (thing.guess(template).unwrap(), thing.fit(template).unwrap());
    assert!(off(&guess.values) < 0.02 && off(&fit.values) < 0.006, "{guess:?}, {fit:?}");
    assert!(YawSymmetry::Fold(2).difference(fit.pose.yaw(), 0.4).to_degrees() < 2.0);
    assert!(thing.cost(template, &fit) < thing.cost(template, &guess));
    let mut other = guess.clone();
    other.values = vec![0.12, 0.1, 0.05];
    let again = thing.fit_from(template, &other).unwrap();
    assert!(off(&again.values) < 0.006, "{again:?}");
}
