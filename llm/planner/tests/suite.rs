//! The tasks of a published suite on perfect state: the goals are those of the instructions in the scenario files, the starts
//! are drawn, and skills bring about what they declare.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that panics fails, which is what it shall do")]

mod world;

use acm_concept::{ids::ObjectId, pose::wrap_angle, task::OnUnknown, template::TemplateLibrary};
use acm_planner::{Decision, Planner, Task};
use glam::DVec2;
use rand::{Rng, seq::SliceRandom};
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use std::{collections::BTreeSet, f64::consts::PI, sync::OnceLock};
use world::{BLUE, GREEN, RED, World, options};

/// Starts that are drawn for each task.
const STARTS: u64 = 8;

fn library() -> &'static TemplateLibrary {
    static LIBRARY: OnceLock<TemplateLibrary> = OnceLock::new();
    LIBRARY.get_or_init(|| acm_memory::library_of(&acm_memory::library_groups()).unwrap())
}

/// The instruction of a task and its paraphrases.
fn wordings(task: &str) -> Vec<String> {
    let all: toml::Table = toml::from_str(include_str!("wordings.toml")).unwrap();
    all[task].as_array().unwrap().iter().map(|wording| wording.as_str().unwrap().to_owned()).collect()
}

fn read(text: &str) -> Task {
    Planner::new().unwrap().parse(text, library()).unwrap_or_else(|error| panic!("{text}\n  {error}"))
}

/// The task of a scenario in one of its wordings.
fn task(scenario: &str, wording: u64) -> Task {
    let wordings = wordings(scenario);
    read(&wordings[wording as usize % wordings.len()])
}

fn world() -> World {
    let mut world = World::new();
    world.library = library().clone();
    world
}

fn run(world: &mut World, task: &Task, between: impl FnMut(&mut World, &Decision)) {
    let end = world::run(world, task, &options(OnUnknown::Abstain, 0), between);
    assert!(matches!(end, Decision::Done { .. }), "{}\n{end:?}\n{:?}", task.instruction, world.done_skills);
}

fn at_rest(world: &World) -> bool {
    world.objects.iter().all(|entry| entry.place().is_some())
}

fn yaw(world: &World, id: ObjectId) -> f64 {
    world.entry(id).pose().unwrap().yaw()
}

fn presses(world: &World, button: ObjectId) -> usize {
    world.done_skills.iter().filter(|skill| **skill == format!("press P{}.0", button.0)).count()
}

#[test]
fn all_wordings_of_a_task_ask_for_the_same() {
    let tasks: toml::Table = toml::from_str(include_str!("wordings.toml")).unwrap();
    for task in tasks.keys() {
        let wordings = wordings(task);
        assert!(wordings.len() >= 8, "{task}");
        for wording in &wordings {
            assert_eq!(read(wording).outline(), read(&wordings[0]).outline(), "{task}: {wording}");
        }
    }
}

#[test]
fn each_cube_goes_to_the_green_mat_and_home_again() {
    for start in 0..STARTS {
        let mut rng = ChaCha8Rng::seed_from_u64(start);
        let mut world = world();
        let count = rng.random_range(4..=7);
        let mats: Vec<ObjectId> = (0..count)
            .map(|n| {
                let at = DVec2::new(0.1 * (f64::from(n) - 2.5), rng.random_range(-0.12..-0.06));
                world.mat(at, BLUE)
            })
            .collect();
        let green = world.mat(DVec2::new(0.0, -0.28), GREEN);
        let mut homes: Vec<usize> = (0..count as usize).collect();
        homes.shuffle(&mut rng);
        let cubes: Vec<ObjectId> =
            homes[..3].iter().map(|home| world.cube(world.spot(mats[*home]), RED, Some(mats[*home]))).collect();
        let mut from_left = cubes.clone();
        from_left.sort_by(|a, b| world.spot(*a).x.total_cmp(&world.spot(*b).x));
        let mut visits: Vec<ObjectId> = Vec::new();
        run(&mut world, &task("place-block-mat", start), |world, _| {
            let on_green: Vec<&ObjectId> =
                cubes.iter().filter(|c| world.entry(**c).place().is_some_and(|p| p.support == Some(green))).collect();
            assert!(on_green.len() <= 1);
            if let Some(cube) = on_green.first().filter(|cube| visits.last() != Some(**cube)) {
                visits.push(**cube);
            }
        });
        assert_eq!(visits, from_left);
        for (cube, home) in cubes.iter().zip(&homes) {
            assert_eq!(world.entry(*cube).support, Some(mats[*home]));
        }
    }
}

#[test]
fn orders_are_tried_once_each_until_the_lamp_is_green() {
    for start in 0..STARTS {
        let mut rng = ChaCha8Rng::seed_from_u64(start);
        let mut world = world();
        let cubes: Vec<ObjectId> = [RED, GREEN, BLUE]
            .into_iter()
            .enumerate()
            .map(|(n, color)| world.cube(DVec2::new(0.04 + 0.12 * n as f64, -0.1), color, None))
            .collect();
        let button = world.button(DVec2::new(-0.2, -0.1));
        let lamp = world.add("cylinder", &[("radius", 0.03), ("height", 0.07)], DVec2::new(-0.2, 0.06), BLUE, None);
        world.shows(lamp, "dark");
        let mut right = cubes.clone();
        while right == cubes {
            right.shuffle(&mut rng);
        }
        let mut orders: Vec<Vec<ObjectId>> = Vec::new();
        run(&mut world, &task("blocks-ranking-try", start), |world, _| {
            if presses(world, button) > orders.len() {
                let mut row = cubes.clone();
                row.sort_by(|a, b| world.spot(*a).x.total_cmp(&world.spot(*b).x));
                world.shows(lamp, if row == right { "green" } else { "red" });
                orders.push(row);
            }
        });
        assert_eq!(orders.last(), Some(&right));
        assert_eq!(orders.iter().collect::<BTreeSet<_>>().len(), orders.len(), "{orders:?}");
    }
}

#[test]
fn two_pieces_take_over_each_others_place_and_heading() {
    for start in 0..STARTS {
        let mut rng = ChaCha8Rng::seed_from_u64(start);
        let mut world = world();
        let size = [("length", 0.1), ("width", 0.08), ("unit", 0.03)];
        let mut piece = |x: f64, color| {
            let id = world.add("t-block", &size, DVec2::new(x, rng.random_range(-0.2..0.05)), color, None);
            world.turn(id, rng.random_range(-PI..PI));
            id
        };
        let (red, blue) = (piece(-0.09, RED), piece(0.09, BLUE));
        let before = [red, blue].map(|id| (world.spot(id), yaw(&world, id)));
        run(&mut world, &task("swap-t", start), |_, _| {});
        for (id, (spot, heading)) in [blue, red].into_iter().zip(before) {
            assert!(world.spot(id).distance(spot) < 0.001, "{id}");
            assert!(wrap_angle(yaw(&world, id) - heading).abs() < 0.001, "{id}");
        }
        assert_eq!(world.done_skills.len(), 6, "one is put aside: {:?}", world.done_skills);
    }
}

#[test]
fn keys_are_pressed_as_often_as_the_cards_say_and_then_the_last_one_once() {
    for start in 0..STARTS {
        let mut rng = ChaCha8Rng::seed_from_u64(start);
        let mut world = world();
        let keys = [-0.2, 0.0, 0.2].map(|x| world.button(DVec2::new(x, rng.random_range(-0.2..-0.1))));
        let numbers = [rng.random_range(1..=6), rng.random_range(1..=6)];
        for (x, number) in [-0.12, 0.12].into_iter().zip(numbers) {
            let size = [("length", 0.185), ("width", 0.14), ("height", 0.002)];
            let card = world.add("card", &size, DVec2::new(x, rng.random_range(0.05..0.15)), GREEN, None);
            world.shows(card, &number.to_string());
        }
        run(&mut world, &task("press-button", start), |_, _| {});
        let wanted = [(keys[0], numbers[0]), (keys[1], numbers[1]), (keys[2], 1)];
        let wanted: Vec<String> =
            wanted.iter().flat_map(|(key, times)| vec![format!("press P{}.0", key.0); *times]).collect();
        assert_eq!(world.done_skills, wanted);
    }
}

#[test]
fn cubes_are_hidden_in_a_row_and_revealed_by_colour_with_each_lid_behind_its_cube() {
    for start in 0..STARTS {
        let mut rng = ChaCha8Rng::seed_from_u64(start);
        let mut world = world();
        let mut colors = [RED, GREEN, BLUE];
        colors.shuffle(&mut rng);
        let cubes: Vec<ObjectId> = colors
            .iter()
            .enumerate()
            .map(|(n, color)| {
                let at = DVec2::new(-0.2 + 0.2 * n as f64, rng.random_range(-0.2..-0.16));
                world.cube(at, *color, None)
            })
            .collect();
        let lids = [-0.2, 0.0, 0.2].map(|x| world.cover(DVec2::new(x, rng.random_range(-0.05..0.0))));
        let (mut hidden, mut shown): (Vec<ObjectId>, Vec<ObjectId>) = (Vec::new(), Vec::new());
        let over = |world: &World, cube: ObjectId| {
            lids.into_iter()
                .find(|lid| world.entry(*lid).place().is_some() && world.spot(*lid).distance(world.spot(cube)) < 0.01)
        };
        let mut lid_of: Vec<(ObjectId, ObjectId)> = Vec::new();
        run(&mut world, &task("cover-blocks", start), |world, _| {
            for cube in &cubes {
                match (over(world, *cube), hidden.contains(cube)) {
                    (Some(lid), false) => {
                        hidden.push(*cube);
                        lid_of.push((*cube, lid));
                    }
                    (None, true) if !shown.contains(cube) => shown.push(*cube),
                    _ => {}
                }
            }
        });
        assert_eq!(hidden, cubes);
        let color = |id: &ObjectId| colors[cubes.iter().position(|cube| cube == id).unwrap()];
        assert_eq!(shown.iter().map(color).collect::<Vec<_>>(), [RED, GREEN, BLUE]);
        for (cube, lid) in &lid_of {
            let away = world.spot(*lid) - world.spot(*cube);
            assert!(away.x.abs() < 0.02 && away.y > 0.07 && away.y < 0.2, "{lid} stands {away} from {cube}");
        }
        assert_eq!(world.done_skills.len(), 12, "{:?}", world.done_skills);
    }
}

#[test]
fn two_cubes_change_trays_by_way_of_the_free_one() {
    for start in 0..STARTS {
        let mut rng = ChaCha8Rng::seed_from_u64(start);
        let mut world = world();
        let size = [("length", 0.16), ("width", 0.11), ("height", 0.02)];
        let mut trays: Vec<ObjectId> = [-0.14, 0.0, 0.14]
            .into_iter()
            .map(|x| {
                let tray = world.add("desk-tray", &size, DVec2::new(x, rng.random_range(-0.17..-0.13)), BLUE, None);
                world.turn(tray, PI / 2.0);
                tray
            })
            .collect();
        trays.shuffle(&mut rng);
        let [one, two] = [trays[0], trays[1]].map(|tray| {
            let near = world.spot(tray) + DVec2::new(rng.random_range(-0.005..0.005), rng.random_range(-0.005..0.005));
            world.block(near, 0.03, RED, Some(tray))
        });
        let button = world.button(DVec2::new(0.0, -0.3));
        let inside = |world: &World, cube: ObjectId| world.entry(cube).place().and_then(|place| place.support);
        let mut stops: Vec<(Option<ObjectId>, Option<ObjectId>)> = Vec::new();
        run(&mut world, &task("swap-blocks", start), |world, _| {
            let now = (inside(world, one), inside(world, two));
            if at_rest(world) && stops.last() != Some(&now) {
                assert_ne!(now.0, now.1, "two in one tray");
                stops.push(now);
            }
            assert!(presses(world, button) == 0 || now == (Some(trays[1]), Some(trays[0])));
        });
        assert_eq!(stops.last(), Some(&(Some(trays[1]), Some(trays[0]))));
        let aside = stops.iter().filter(|stop| stop.0 == Some(trays[2]) || stop.1 == Some(trays[2])).count();
        assert!(aside >= 1, "the free tray was used: {stops:?}, start {start}");
        assert_eq!(world.done_skills.len(), 7, "{:?}", world.done_skills);
        assert_eq!(presses(&world, button), 1);
    }
}

#[test]
fn cells_are_tried_way_round_by_way_round_until_the_gauge_moves() {
    for start in 0..STARTS {
        let mut rng = ChaCha8Rng::seed_from_u64(start);
        let mut world = world();
        let holder_size = [("length", 0.1), ("width", 0.088), ("height", 0.012)];
        let holder = world.add("battery-holder", &holder_size, DVec2::new(0.0, -0.1), BLUE, None);
        let cells = [-0.22, 0.22].map(|x| {
            let size = [("radius", 0.016), ("length", 0.06)];
            let cell = world.add("battery", &size, DVec2::new(x, rng.random_range(-0.2..0.0)), RED, None);
            world.turn(cell, PI / 2.0 + rng.random_range(-0.8..0.8));
            cell
        });
        let right = [rng.random::<bool>(), rng.random::<bool>()];
        world.visible.insert("changed".into());
        let mut ways: Vec<[bool; 2]> = Vec::new();
        run(&mut world, &task("battery-try", start), |world, _| {
            world.facts.clear();
            let seated = cells.iter().all(|cell| world.entry(*cell).place().is_some_and(|p| p.support == Some(holder)));
            if !seated {
                return;
            }
            assert!(world.spot(cells[0]).distance(world.spot(cells[1])) > 0.03, "one slot each");
            let away = cells.map(|cell| wrap_angle(yaw(world, cell)) < 0.0);
            if ways.last() != Some(&away) {
                ways.push(away);
            }
            if away == right {
                world.facts.insert(format!("changed({holder})"));
            }
        });
        assert_eq!(ways.last(), Some(&right));
        assert_eq!(ways.iter().collect::<BTreeSet<_>>().len(), ways.len(), "each way once: {ways:?}");
    }
}

#[test]
fn the_twin_of_what_was_shown_is_raised_once_that_is_hidden() {
    let kinds: [(&str, &[(&str, f64)]); 5] = [
        ("box", &[("length", 0.05), ("width", 0.05), ("height", 0.05)]),
        ("box", &[("length", 0.03), ("width", 0.03), ("height", 0.03)]),
        ("cylinder", &[("radius", 0.02), ("height", 0.06)]),
        ("t-block", &[("length", 0.07), ("width", 0.06), ("unit", 0.02)]),
        ("cylinder", &[("radius", 0.035), ("height", 0.02)]),
    ];
    for start in 0..STARTS {
        let mut rng = ChaCha8Rng::seed_from_u64(start);
        let mut world = world();
        let bench_size = [("length", 0.2), ("width", 0.1), ("height", 0.09)];
        let bench = world.add("bench", &bench_size, DVec2::new(0.0, 0.25), BLUE, None);
        let shown = rng.random_range(0..kinds.len());
        let (template, size) = kinds[shown];
        let item = world.add(template, size, DVec2::new(0.0, 0.25), RED, Some(bench));
        let mut spots: Vec<f64> = (0..kinds.len()).map(|n| -0.24 + 0.12 * n as f64).collect();
        spots.shuffle(&mut rng);
        let items: Vec<ObjectId> = kinds
            .iter()
            .zip(spots)
            .map(|((template, size), x)| world.add(template, size, DVec2::new(x, -0.15), RED, None))
            .collect();
        // One of the same make in another colour.
        world.add(template, size, DVec2::new(0.36, -0.15), GREEN, None);
        world.visible.insert("visible".into());
        world.facts = world.objects.iter().map(|entry| format!("visible({})", entry.id)).collect();
        let mut looks = 0;
        run(&mut world, &task("observe-and-pickup", start), |world, decision| {
            looks += u32::from(matches!(decision, Decision::Look { .. }));
            assert!(looks > 2 || world.done_skills.is_empty(), "nothing is raised before it is hidden");
            if looks > 2 {
                world.facts.remove(&format!("visible({item})"));
            }
        });
        assert_eq!(world.done_skills, [format!("pick P{}.0", items[shown].0)]);
    }
}
