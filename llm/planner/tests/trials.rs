//! What nobody says is found by trying: the right way round, the right order, the right one of several.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that panics fails, which is what it shall do")]

mod world;

use acm_concept::{ids::ObjectId, task::OnUnknown};
use acm_planner::{
    Decision, Destination, GiveUpCause, Goal, ObjectReference, Planner, Span, Subtask, Task,
    task::{Condition, Direction, Ordering, Quantity, Times, Variation},
};
use glam::DVec2;
use std::{collections::BTreeSet, f64::consts::PI};
use world::{BLUE, GREEN, RED, World, options, run, situation};

fn abstain() -> acm_planner::PlanOptions {
    options(OnUnknown::Abstain, 0)
}

/// A thing of this noun, or all of them.
fn noun(noun: &str, quantity: Quantity) -> ObjectReference {
    ObjectReference { phrase: format!("the {noun}"), noun: Some(noun.into()), quantity, ..ObjectReference::default() }
}

fn colored(name: &str, color: [u8; 3]) -> ObjectReference {
    let color = acm_planner::task::ColorTerm {
        name: name.into(),
        lab: acm_concept::color::Lab::from_srgb(color),
        delta_e: 30.0,
    };
    ObjectReference { phrase: format!("the {name} cube"), color: Some(color), ..noun("cube", Quantity::TheOne) }
}

fn task(references: Vec<ObjectReference>, goals: Vec<Goal>) -> Task {
    let subtask = |goal| Subtask { text: "do it".into(), span: Span { start: 0, end: 5 }, goal, when: None };
    Task {
        instruction: "do it".into(),
        subtasks: goals.into_iter().map(subtask).collect(),
        references,
        untouched: Vec::new(),
        nouns: Vec::new(),
        manners: Vec::new(),
        corrections: Vec::new(),
    }
}

fn given_up(decision: &Decision) -> (GiveUpCause, &str) {
    match decision {
        Decision::GiveUp { unknown, .. } => (unknown.cause, unknown.text.as_str()),
        other => panic!("expected to give up, got {other:?}"),
    }
}

fn turned(world: &World, id: ObjectId) -> bool {
    acm_concept::pose::wrap_angle(world.entry(id).pose().unwrap().yaw()).abs() > 0.5 * PI
}

/// Two cells, and a sign that shows as soon as they lie the right way round. Gives the ways that stood.
fn try_ways_round(right: Option<[bool; 2]>) -> (Decision, World, Vec<[bool; 2]>) {
    let mut world = World::new();
    let cells = [world.cell(DVec2::new(-0.1, 0.0)), world.cell(DVec2::new(0.1, 0.0))];
    let gauge = world.button(DVec2::new(0.0, 0.25));
    world.visible.insert("turned".into());
    let sign = Condition { predicate: "turned".into(), arguments: vec![1], negated: false, judged_at: None };
    let find = Goal::Find { members: 0, vary: Variation::Heading, within: None, probe: None, sign: Some(sign) };
    let task = task(vec![noun("cell", Quantity::Group), noun("button", Quantity::TheOne)], vec![find]);
    let mut stood = vec![[false, false]];
    if right == Some([false, false]) {
        world.facts.insert(format!("turned({gauge})"));
    }
    let end = run(&mut world, &task, &abstain(), |world, _| {
        if world.objects.iter().any(|entry| entry.place().is_none()) {
            return;
        }
        let way = cells.map(|cell| turned(world, cell));
        if stood.last() != Some(&way) {
            stood.push(way);
        }
        if Some(way) == right {
            world.facts.insert(format!("turned({gauge})"));
        }
    });
    (end, world, stood)
}

#[test]
fn the_way_round_that_makes_a_sign_show_is_found_and_none_is_tried_twice() {
    for right in [[false, false], [true, false], [true, true], [false, true]] {
        let (end, world, stood) = try_ways_round(Some(right));
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        let distinct: BTreeSet<_> = stood.iter().collect();
        assert_eq!(distinct.len(), stood.len(), "{stood:?}");
        assert_eq!(stood.last(), Some(&right));
        // One cell turned at a time visits all four ways.
        assert!(world.done_skills.len() <= 6, "{:?}", world.done_skills);
    }
}

#[test]
fn where_no_way_is_right_the_agent_says_so() {
    let (end, _, stood) = try_ways_round(None);
    let (cause, text) = given_up(&end);
    assert_eq!(cause, GiveUpCause::Plan);
    assert!(text.contains("all 4 ways"), "{text}");
    assert_eq!(stood.iter().collect::<BTreeSet<_>>().len(), 4);
}

/// Cubes in a row and a button that takes the right order; the robot cannot see whether it did. Gives the orders that
/// stood when the button was pressed.
fn try_orders(cubes: usize, fault: bool) -> (Decision, Vec<Vec<ObjectId>>) {
    let mut world = World::new();
    for (number, color) in (0..cubes).zip([RED, GREEN, BLUE, world::GREY]) {
        world.cube(DVec2::new(0.04 + 0.12 * number as f64, -0.1), color, None);
    }
    let button = world.button(DVec2::new(-0.2, -0.1));
    if fault {
        world.faults = vec![("place", 2, world::Fault::SlipsTo(DVec2::new(0.1, 0.1)))];
    }
    let press = Goal::Performed { function: "press".into(), object: 1, times: Times::Count(1) };
    let probe = Some(Box::new(press));
    let find = Goal::Find { members: 0, vary: Variation::Order, within: None, probe, sign: None };
    let task = task(vec![noun("cube", Quantity::Group), noun("button", Quantity::TheOne)], vec![find]);
    let mut orders: Vec<Vec<ObjectId>> = Vec::new();
    let mut presses = 0;
    let end = run(&mut world, &task, &abstain(), |world, _| {
        let pressed = world.done_skills.iter().filter(|skill| **skill == format!("press P{}.0", button.0)).count();
        if pressed > presses {
            presses = pressed;
            let mut row: Vec<ObjectId> = (1..=cubes as u64).map(ObjectId).collect();
            assert!(row.iter().all(|cube| world.entry(*cube).place().is_some()), "pressed while a cube was in the air");
            row.sort_by(|a, b| world.spot(*a).x.total_cmp(&world.spot(*b).x));
            orders.push(row);
        }
    });
    (end, orders)
}

#[test]
fn every_order_is_tried_once_and_the_nearest_first() {
    for (cubes, ways) in [(2, 2), (3, 6)] {
        let (end, orders) = try_orders(cubes, false);
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert_eq!(orders.len(), ways);
        assert_eq!(orders.iter().collect::<BTreeSet<_>>().len(), ways, "{orders:?}");
        for pair in orders.windows(2) {
            let changed = pair[0].iter().zip(&pair[1]).filter(|(a, b)| a != b).count();
            assert_eq!(changed, 2, "two cubes change places, not more: {orders:?}");
        }
    }
}

#[test]
fn a_cube_that_slips_between_two_tries_spoils_neither() {
    let (end, orders) = try_orders(3, true);
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert_eq!(orders.iter().collect::<BTreeSet<_>>().len(), 6, "{orders:?}");
}

#[test]
fn things_are_covered_in_a_row_and_uncovered_by_colour_though_nothing_shows_it() {
    for order in [[RED, GREEN, BLUE], [BLUE, RED, GREEN], [GREEN, BLUE, RED]] {
        let mut world = World::new();
        for (number, color) in (0..3).zip(order) {
            world.cube(DVec2::new(-0.2 + 0.2 * f64::from(number), -0.18), color, None);
        }
        for number in 0..3 {
            world.cover(DVec2::new(-0.2 + 0.2 * f64::from(number), 0.0));
        }
        let cubes = noun("cube", Quantity::Group);
        let references =
            vec![cubes.clone(), cubes, colored("red", RED), colored("green", GREEN), colored("blue", BLUE)];
        let covered = |object, holds| Goal::State { predicate: "covered".into(), object, holds, by: None };
        let hide = Goal::Each { members: 0, order: Ordering::From(Direction::Left), body: vec![covered(0, true)] };
        let reveal = Goal::Each { members: 1, order: Ordering::Named(vec![2, 3, 4]), body: vec![covered(1, false)] };
        let mut uncovered: Vec<ObjectId> = Vec::new();
        let mut hidden: Vec<ObjectId> = Vec::new();
        let end = run(&mut world, &task(references, vec![hide, reveal]), &abstain(), |world, _| {
            for cube in (1..=3).map(ObjectId) {
                let over = world.objects.iter().any(|entry| {
                    entry.category == "cover"
                        && entry.place().is_some()
                        && world.spot(entry.id).distance(world.spot(cube)) < 0.01
                });
                match (over, hidden.contains(&cube)) {
                    (true, false) => hidden.push(cube),
                    (false, true) if !uncovered.contains(&cube) => uncovered.push(cube),
                    _ => {}
                }
            }
        });
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert_eq!(hidden, [1, 2, 3].map(ObjectId));
        let color = |id: &ObjectId| order[id.0 as usize - 1];
        assert_eq!(uncovered.iter().map(color).collect::<Vec<_>>(), [RED, GREEN, BLUE]);
        assert_eq!(world.done_skills.len(), 12, "{:?}", world.done_skills);
    }
}

#[test]
fn each_goes_there_and_back_before_the_next_one() {
    let mut world = World::new();
    let mats: Vec<ObjectId> = (0..4).map(|n| world.mat(DVec2::new(-0.18 + 0.12 * f64::from(n), -0.1), BLUE)).collect();
    let goal = world.mat(DVec2::new(0.0, -0.3), GREEN);
    let cubes: Vec<ObjectId> =
        [2, 0, 3].iter().map(|n| world.cube(world.spot(mats[*n]), RED, Some(mats[*n]))).collect();
    let homes: Vec<DVec2> = cubes.iter().map(|cube| world.spot(*cube)).collect();
    let green = ObjectReference { noun: Some("mat".into()), phrase: "the green mat".into(), ..colored("green", GREEN) };
    let at = |destination| Goal::At { object: 0, destination };
    let back = acm_memory::query::PlaceReference::BeforeMoved;
    let body = vec![at(Destination::On { reference: 1 }), at(Destination::History { object: 0, reference: back })];
    let each = Goal::Each { members: 0, order: Ordering::From(Direction::Left), body };
    let mut visited: Vec<ObjectId> = Vec::new();
    let end = run(&mut world, &task(vec![noun("cube", Quantity::Group), green], vec![each]), &abstain(), |world, _| {
        for cube in &cubes {
            if world.entry(*cube).place().is_some_and(|place| place.support == Some(goal))
                && visited.last() != Some(cube)
            {
                visited.push(*cube);
            }
        }
    });
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert_eq!(visited, [cubes[1], cubes[0], cubes[2]], "from left to right");
    for (cube, home) in cubes.iter().zip(homes) {
        assert!(world.spot(*cube).distance(home) < 1e-9);
    }
    assert_eq!(world.done_skills.len(), 12);
}

#[test]
fn a_button_is_pressed_as_often_as_a_card_shows_and_what_it_shows_must_be_read() {
    let mut world = World::new();
    let card = world.mat(DVec2::new(0.1, 0.1), GREEN);
    let button = world.button(DVec2::new(-0.2, -0.1));
    let press = Goal::Performed { function: "press".into(), object: 1, times: Times::Shown(0) };
    let task = task(vec![noun("mat", Quantity::TheOne), noun("button", Quantity::TheOne)], vec![press]);
    let end = run(&mut world.clone(), &task, &abstain(), |_, _| {});
    let (cause, text) = given_up(&end);
    assert_eq!(cause, GiveUpCause::Perception);
    assert!(text.contains("cannot read the number"), "{text}");
    let entry = world.objects.iter_mut().find(|entry| entry.id == card).unwrap();
    entry.state.push(acm_concept::literal::Literal::parse(&format!("shows({card}, 4)")).unwrap());
    let end = run(&mut world, &task, &abstain(), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert_eq!(world.done_skills, vec![format!("press P{}.0", button.0); 4]);
}

#[test]
fn a_condition_decides_whether_anything_is_done_and_a_wait_ends_when_it_holds() {
    let press = Goal::Performed { function: "press".into(), object: 0, times: Times::Count(1) };
    let lit = Condition { predicate: "lit".into(), arguments: vec![0], negated: false, judged_at: None };
    for (holds, presses) in [(true, 1), (false, 0)] {
        let mut world = World::new();
        let button = world.button(DVec2::new(-0.2, -0.1));
        world.visible.insert("lit".into());
        if holds {
            world.facts.insert(format!("lit({button})"));
        }
        let mut asked = task(vec![noun("button", Quantity::TheOne)], vec![press.clone()]);
        asked.subtasks[0].when = Some(lit.clone());
        let end = run(&mut world, &asked, &abstain(), |_, _| {});
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert_eq!(world.done_skills.len(), presses);
    }
    let mut world = World::new();
    let button = world.button(DVec2::new(-0.2, -0.1));
    world.visible.insert("lit".into());
    let waiting = task(vec![noun("button", Quantity::TheOne)], vec![Goal::Await { condition: lit }, press]);
    let mut looks = 0;
    let end = run(&mut world, &waiting, &abstain(), |world, decision| {
        looks += u32::from(matches!(decision, Decision::Look { .. }));
        if looks == 10 {
            world.facts.insert(format!("lit({button})"));
        }
        assert!(looks >= 10 || world.done_skills.is_empty());
    });
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert_eq!((looks, world.done_skills.len()), (10, 1));
}

#[test]
fn the_one_of_several_that_gives_the_sign_is_found_and_the_others_are_not_tried_again() {
    for right in 0..3 {
        let mut world = World::new();
        let buttons: Vec<ObjectId> =
            (0..3).map(|n| world.button(DVec2::new(-0.2 + 0.15 * f64::from(n), -0.1))).collect();
        let lamp = world.cube(DVec2::new(0.0, 0.2), RED, None);
        world.visible.insert("lit".into());
        let press = Goal::Performed { function: "press".into(), object: 0, times: Times::Count(1) };
        let sign = Condition { predicate: "lit".into(), arguments: vec![1], negated: false, judged_at: None };
        let find = Goal::Find {
            members: 0,
            vary: Variation::Choice,
            within: None,
            probe: Some(Box::new(press)),
            sign: Some(sign),
        };
        let task = task(vec![noun("button", Quantity::Group), noun("cube", Quantity::TheOne)], vec![find]);
        let end = run(&mut world, &task, &abstain(), |world, _| {
            if world.done_skills.contains(&format!("press P{}.0", buttons[right].0)) {
                world.facts.insert(format!("lit({lamp})"));
            }
        });
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert_eq!(world.done_skills.len(), right + 1);
    }
}

#[test]
fn equal_memories_give_equal_decisions_in_the_middle_of_a_trial() {
    let mut world = World::new();
    for n in 0..3 {
        world.cube(DVec2::new(0.04 + 0.12 * f64::from(n), -0.1), RED, None);
    }
    let find = Goal::Find { members: 0, vary: Variation::Order, within: None, probe: None, sign: None };
    let task = task(vec![noun("cube", Quantity::Group)], vec![find]);
    let planner = Planner::new().unwrap();
    let mut again = 0;
    run(&mut world, &task, &abstain(), |world, _| {
        let decide = || planner.decide(&task, world, &situation(world, 0), &abstain());
        if !matches!(decide(), Decision::Done { .. }) {
            assert_eq!(decide(), decide());
            again += 1;
        }
    });
    assert!(again > 10);
}

#[test]
fn what_is_not_seen_is_searched_for_under_each_cover_once_and_not_under_one_that_hides_something_else() {
    for hides in [Some(0), Some(1), None] {
        let mut world = World::new();
        let green = world.cube(DVec2::new(-0.2, -0.1), GREEN, None);
        let covers: Vec<ObjectId> = (0..3).map(|n| world.cover(DVec2::new(0.2 * f64::from(n), -0.1))).collect();
        // The one on the left stands over the green cube, and memory knows it.
        let known = world.cover(world.spot(green));
        let red = world.cube(DVec2::new(0.5, 0.5), RED, None);
        let hidden = world.objects.pop().unwrap();
        let at = hides.map(|n: usize| world.spot(covers[n]));
        let references = vec![colored("red", RED)];
        let hold = Goal::Holding { object: 0, held: true };
        let mut lifted: Vec<ObjectId> = Vec::new();
        let end = run(&mut world, &task(references, vec![hold]), &abstain(), |world, _| {
            if let Some(held) = world.objects.iter().find(|e| e.presence == acm_memory::entry::Presence::Held)
                && !lifted.contains(&held.id)
            {
                lifted.push(held.id);
            }
            if let (Some(hides), Some(at)) = (hides, at)
                && lifted.contains(&covers[hides])
                && world.objects.iter().all(|entry| entry.id != red)
            {
                let mut shown = hidden.clone();
                shown.parts[0].pose.pose.translation = at.extend(world::TABLE_Z);
                world.objects.push(shown);
            }
        });
        assert!(!lifted.contains(&known), "memory knows what is under it");
        match hides {
            Some(hides) => {
                assert!(matches!(end, Decision::Done { .. }), "{end:?}");
                assert_eq!(lifted, covers[..=hides].iter().copied().chain([red]).collect::<Vec<_>>());
            }
            None => {
                let (cause, text) = given_up(&end);
                assert_eq!(cause, GiveUpCause::Perception);
                assert!(text.contains("I looked in or under O2, O3, O4"), "{text}");
                assert_eq!(lifted, covers);
            }
        }
    }
}
