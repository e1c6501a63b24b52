//! Whole tasks in a symbolic world: every decision from the first look to the end.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that panics fails, which is what it shall do")]

mod world;

use acm_concept::{ids::ObjectId, literal::Place, pose::Pose, skill::FailureCause, task::OnUnknown};
use acm_memory::MemoryView;
use acm_planner::{Decision, GiveUpCause, Planner, Task};
use glam::DVec2;
use world::{BLUE, Fault, GREEN, GREY, RED, World, library, options, robot, run, situation};

const PUT_BACK: &str = "Bring the cube to the middle, press the button, then return it to where it came from.";
const MIDDLE: DVec2 = DVec2::new(0.1, -0.1);

fn task(text: &str) -> Task {
    Planner::new().unwrap().parse(text, &library()).unwrap()
}

fn abstain() -> acm_planner::PlanOptions {
    options(OnUnknown::Abstain, 0)
}

fn given_up(decision: &Decision) -> (GiveUpCause, &str) {
    match decision {
        Decision::GiveUp { unknown, .. } => (unknown.cause, unknown.text.as_str()),
        other => panic!("expected to give up, got {other:?}"),
    }
}

#[test]
fn the_cube_returns_to_its_mat_whatever_their_number() {
    for mats in 3..=6 {
        for start in 0..mats {
            let mut world = World::with_mats(mats, start);
            let cube = ObjectId(u64::from(mats) + 1);
            let home = world.spot(cube);
            let mut was_in_the_middle = false;
            let end = run(&mut world, &task(PUT_BACK), &abstain(), |world, _| {
                was_in_the_middle |= world.spot(cube).distance(MIDDLE) < 0.005;
            });
            assert!(matches!(end, Decision::Done { .. }), "{end:?}");
            assert!(was_in_the_middle && world.spot(cube).distance(home) < 1e-9);
            let part = format!("P{}.0", cube.0);
            let expected = [format!("pick {part}"), format!("place {part}"), format!("press P{}.0", cube.0 + 1)];
            assert_eq!(world.done_skills[..3], expected);
            assert_eq!(world.done_skills.len(), 5);
        }
    }
}

#[test]
fn a_memory_wiped_after_the_first_place_gives_up_before_it_touches_anything() {
    let mut world = World::with_mats(4, 1);
    let mut wiped = false;
    let end = run(&mut world, &task(PUT_BACK), &abstain(), |world, decision| {
        if !wiped && matches!(decision, Decision::Act { step, .. } if step.candidate.skill == "place") {
            world.wipe();
            wiped = true;
        }
    });
    let (cause, text) = given_up(&end);
    assert_eq!(cause, GiveUpCause::Memory);
    assert!(text.contains("where the cube (O5) came from") || text.contains("came from"), "{text}");
    assert_eq!(world.done_skills, ["pick P5.0", "place P5.0"]);
}

#[test]
fn a_cube_already_in_the_middle_has_no_known_origin() {
    let mut world = World::with_mats(4, 0);
    let cube = ObjectId(5);
    let place = Place {
        support: None,
        pose: Pose::from_translation(MIDDLE.extend(world::TABLE_Z)),
        tolerance_m: 0.03,
        heading_tolerance_rad: None,
    };
    let entry = world.objects.iter_mut().find(|entry| entry.id == cube).unwrap();
    entry.parts[0].pose.pose = place.pose;
    entry.support = None;
    entry.history[0].place = Some(place);
    let end = run(&mut world, &task(PUT_BACK), &abstain(), |_, _| {});
    assert_eq!(given_up(&end).0, GiveUpCause::Memory);
    assert!(world.done_skills.is_empty(), "{:?}", world.done_skills);
}

#[test]
fn without_a_past_abstaining_gives_up_and_guessing_takes_some_mat() {
    let forgetful = || {
        let mut world = World::with_mats(4, 2);
        world.remembers = false;
        world
    };
    let mut world = forgetful();
    let end = run(&mut world, &task(PUT_BACK), &abstain(), |_, _| {});
    assert_eq!(given_up(&end).0, GiveUpCause::Memory);

    let mut homes = 0;
    let (mut guessed, seeds) = (0, 40);
    for seed in 0..seeds {
        let mut world = forgetful();
        let home = world.spot(ObjectId(5));
        let end = run(&mut world, &task(PUT_BACK), &options(OnUnknown::Guess, seed), |_, decision| {
            guessed += u32::from(matches!(decision, Decision::Act { step, .. } if step.guessed));
        });
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert_eq!(world.done_skills.len(), 5, "a guess must not change on the way: {:?}", world.done_skills);
        homes += u32::from(world.spot(ObjectId(5)).distance(home) < 0.01);
    }
    assert_eq!(guessed, 2 * seeds as u32, "the second pick and place rest on a guess");
    assert!((3..=20).contains(&homes), "{homes} of {seeds} guesses right, expected near one in four");
}

#[test]
fn a_cube_that_slips_is_found_and_still_returns_to_its_first_mat() {
    for fall in [1, 2] {
        let mut world = World::with_mats(5, 3);
        let home = world.spot(ObjectId(6));
        world.faults = vec![("place", fall, Fault::SlipsTo(DVec2::new(-0.05, 0.08)))];
        let end = run(&mut world, &task(PUT_BACK), &abstain(), |_, _| {});
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert!(world.spot(ObjectId(6)).distance(home) < 1e-9);
        assert_eq!(world.done_skills.len(), 7, "{:?}", world.done_skills);
    }
}

#[test]
fn what_slips_every_time_is_not_tried_for_ever() {
    let mut world = World::with_mats(4, 0);
    world.faults = (1..50).map(|n| ("place", n, Fault::SlipsTo(DVec2::new(0.0, 0.1 + 0.001 * f64::from(n))))).collect();
    let end = run(&mut world, &task(PUT_BACK), &abstain(), |_, _| {});
    assert_eq!(given_up(&end).0, GiveUpCause::Grasp);
    assert_eq!(world.done_skills.iter().filter(|skill| skill.starts_with("place")).count(), 3);
}

#[test]
fn a_lost_object_that_is_not_found_is_named() {
    let mut world = World::with_mats(4, 0);
    world.faults = vec![("place", 1, Fault::SlipsTo(DVec2::ZERO))];
    let end = run(&mut world, &task(PUT_BACK), &abstain(), |world, _| world.lost.clear());
    let (cause, text) = given_up(&end);
    assert_eq!(cause, GiveUpCause::Perception);
    assert!(text.contains("I do not know where the cube (O5) is"), "{text}");
}

#[test]
fn a_blind_agent_looks_three_times_and_never_moves() {
    let mut world = World::new();
    world.frames = 0;
    let mut looks = 0;
    let end = run(&mut world, &task(PUT_BACK), &options(OnUnknown::Guess, 3), |_, decision| {
        looks += u32::from(matches!(decision, Decision::Look { .. }));
    });
    let (cause, text) = given_up(&end);
    assert_eq!((cause, looks), (GiveUpCause::Perception, 3));
    assert!(text.starts_with("I see nothing"), "{text}");
    assert!(world.done_skills.is_empty());
}

#[test]
fn two_equal_cubes_are_ambiguous_unless_any_will_do() {
    let mut world = World::with_mats(4, 0);
    let second = world.spot(ObjectId(2));
    world.cube(second, RED, Some(ObjectId(2)));
    let end = run(&mut world.clone(), &task("Put the cube on the left mat."), &abstain(), |_, _| {});
    let (cause, text) = given_up(&end);
    assert_eq!(cause, GiveUpCause::Identity);
    assert!(text.contains("which is the cube? O5 and O7 fit equally"), "{text}");

    let mut any = world.clone();
    let end = run(&mut any, &task("Put one of the cubes on the left mat."), &abstain(), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");

    let mut chosen = [0, 0];
    for seed in 0..30 {
        let mut world = world.clone();
        let end = run(&mut world, &task("Pick up the cube."), &options(OnUnknown::Guess, seed), |_, _| {});
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        chosen[usize::from(world.held().unwrap().id == ObjectId(7))] += 1;
    }
    assert!(chosen.iter().all(|&count| count > 5), "{chosen:?}");
}

#[test]
fn colour_side_and_rank_choose_the_object_and_the_place() {
    let mut world = World::new();
    let left = world.mat(DVec2::new(-0.2, 0.0), BLUE);
    let middle = world.mat(DVec2::new(0.0, 0.01), BLUE);
    let right = world.mat(DVec2::new(0.2, 0.0), BLUE);
    let red = world.cube(DVec2::new(0.0, -0.2), RED, None);
    let green = world.cube(DVec2::new(0.1, -0.2), GREEN, None);
    for (text, object, mat) in [
        ("Put the red cube on the left mat.", red, left),
        ("Move the green block onto the rightmost pad.", green, right),
        ("Place the cube on the right on the middle mat.", green, middle),
        ("Put the red cube on the second mat from the right.", red, middle),
        ("Put the green cube on the mat on the left.", green, left),
    ] {
        let mut world = world.clone();
        let end = run(&mut world, &task(text), &abstain(), |_, _| {});
        assert!(matches!(end, Decision::Done { .. }), "{text}: {end:?}");
        assert!(world.spot(object).distance(world.spot(mat)) < 1e-9, "{text}");
        assert_eq!(world.entry(object).support, Some(mat), "{text}");
    }
}

#[test]
fn a_description_by_place_stays_true_while_the_thing_is_carried() {
    let mut world = World::with_mats(4, 0);
    let second = world.spot(ObjectId(2));
    let other = world.cube(second, RED, Some(ObjectId(2)));
    let (a, b) = (world.spot(ObjectId(5)), world.spot(other));
    let (left, right) = if a.x < b.x { (ObjectId(5), other) } else { (other, ObjectId(5)) };
    let untouched = world.spot(left);
    let text = "Move the right cube to the middle, press the button, then put it back.";
    let home = world.spot(right);
    let end = run(&mut world, &task(text), &abstain(), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert!(world.spot(right).distance(home) < 1e-9 && world.spot(left) == untouched);
}

#[test]
fn presses_are_counted_and_failures_do_not_count() {
    let mut world = World::with_mats(3, 0);
    world.faults = vec![("press", 2, Fault::Fails(FailureCause::Press))];
    let mut attempts = Vec::new();
    let end = run(&mut world, &task("Press the button three times."), &abstain(), |_, decision| {
        if let Decision::Act { step, .. } = decision {
            attempts.push(step.attempt);
        }
    });
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert_eq!(attempts, [0, 0, 1, 0], "three presses and one that failed");
}

#[test]
fn a_press_that_never_works_ends_with_its_cause() {
    let mut world = World::with_mats(3, 0);
    world.faults = (1..20).map(|n| ("press", n, Fault::Fails(FailureCause::Press))).collect();
    let end = run(&mut world, &task("Press the button."), &abstain(), |_, _| {});
    let (cause, text) = given_up(&end);
    assert_eq!(cause, GiveUpCause::Press);
    assert!(text.contains("3 tries"), "{text}");
    assert_eq!(world.done_skills.len(), 3);
}

#[test]
fn an_effect_that_cannot_be_told_is_not_taken_for_done() {
    let mut world = World::with_mats(3, 0);
    world.faults = (1..20).map(|n| ("press", n, Fault::CannotTell)).collect();
    let end = run(&mut world, &task("Press the button."), &abstain(), |_, _| {});
    assert_eq!(given_up(&end).0, GiveUpCause::Perception);
}

#[test]
fn what_stands_in_the_way_is_moved_and_the_hand_is_emptied_first() {
    let mut world = World::with_mats(4, 0);
    let (target, carried) = (ObjectId(2), ObjectId(5));
    let at = world.spot(target);
    let blocker = world.block(at, 0.05, GREY, Some(target));
    let green = world.mat(DVec2::new(-0.1, 0.2), GREEN);
    let top = world.spot(green);
    let hat = world.block(top, 0.03, GREY, Some(green));
    let text = "Pick up the red cube, then put the large grey cube on the green mat.";
    let end = run(&mut world, &task(text), &abstain(), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert!(world.spot(blocker).distance(world.spot(green)) < 1e-9);
    assert!(world.spot(hat).distance(world.spot(green)) > 0.05 && world.spot(carried).distance(at) > 0.05);
}

#[test]
fn a_stack_is_taken_apart_before_the_lower_cube_is_picked() {
    let mut world = World::with_mats(3, 0);
    let (lower, at) = (ObjectId(4), world.spot(ObjectId(4)));
    let upper = world.cube(at, GREEN, Some(lower));
    let mut first = None;
    let end =
        run(&mut world, &task(PUT_BACK.replace("the cube", "the red cube").as_str()), &abstain(), |_, decision| {
            if let (Decision::Act { step, explanation }, None) = (decision, &first) {
                first = Some((step.candidate.part.object, explanation.clone()));
            }
        });
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    let (object, explanation) = first.unwrap();
    assert_eq!(object, upper);
    assert_eq!(explanation.plan.len(), 4);
    assert!(explanation.rejected.iter().any(|r| r.candidate == "pick P4.0"
        && r.failed.as_ref().is_some_and(|(literal, _)| literal.to_string() == "clear(O4)")));
    assert!(world.spot(lower).distance(at) < 1e-9);
}

#[test]
fn a_tower_is_taken_down_from_its_top() {
    let mut world = World::with_mats(4, 1);
    let (red, mut top) = (ObjectId(5), ObjectId(5));
    for color in [GREEN, GREY, GREEN, GREY] {
        let at = world.spot(top);
        top = world.cube(at, color, Some(top));
    }
    let mut longest = 0;
    let end = run(&mut world, &task("Bring the red cube to the middle."), &abstain(), |_, decision| {
        if let Decision::Act { explanation, .. } = decision {
            longest = longest.max(explanation.plan.len());
        }
    });
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert_eq!((longest, world.done_skills.len()), (10, 10));
    assert!(world.spot(red).distance(MIDDLE) < 1e-9);
}

#[test]
fn what_must_not_be_touched_is_left_alone_even_if_nothing_else_helps() {
    let mut world = World::with_mats(3, 0);
    let at = world.spot(ObjectId(4));
    world.cube(at, GREEN, Some(ObjectId(4)));
    let text = "Put the red cube in the middle, but do not touch the green cube.";
    let end = run(&mut world, &task(text), &abstain(), |_, _| {});
    let (cause, text) = given_up(&end);
    assert_eq!(cause, GiveUpCause::Plan);
    assert!(text.contains("must not be touched"), "{text}");
    assert!(world.done_skills.is_empty());
}

#[test]
fn the_middle_is_that_of_the_largest_group_of_like_places() {
    let mut world = World::with_mats(4, 1);
    world.mat(DVec2::new(-0.3, 0.3), GREEN);
    world.mat(DVec2::new(-0.1, 0.3), GREEN);
    let end = run(&mut world, &task("Bring the cube to the middle."), &abstain(), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert!(world.spot(ObjectId(5)).distance(MIDDLE) < 1e-9);
    let end = run(&mut world, &task("Put the cube between the green mats."), &abstain(), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
}

#[test]
fn the_two_cubes_of_the_free_mat_task_are_told_apart() {
    let mut world = World::new();
    let row = -0.1;
    let left = world.mat(DVec2::new(0.02, row), BLUE);
    let right = world.mat(DVec2::new(0.26, row), BLUE);
    let in_gap = world.cube(DVec2::new(0.14, row), RED, None);
    let on_mat = world.cube(DVec2::new(0.26, row), RED, Some(right));
    world.button(DVec2::new(-0.2, -0.15));
    let text = "Fill the free mat with the cube standing in the gap, hit the button once, then bring the other cube into the gap.";
    let end = run(&mut world, &task(text), &abstain(), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert!(world.spot(in_gap).distance(world.spot(left)) < 1e-9);
    assert!(world.spot(on_mat).distance(DVec2::new(0.14, row)) < 1e-9);
}

#[test]
fn budgets_end_the_task_with_what_is_open() {
    let world = World::with_mats(3, 0);
    let planner = Planner::new().unwrap();
    let mut tired = situation(&world, 0);
    tired.skills_left = 0;
    let decision = planner.decide(&task(PUT_BACK), &world, &tired, &abstain());
    let (cause, text) = given_up(&decision);
    assert_eq!(cause, GiveUpCause::Budget);
    assert!(text.contains("3 of 3 subtasks are open"), "{text}");
    let mut late = situation(&world, 0);
    late.deadline = world.now;
    assert_eq!(given_up(&planner.decide(&task(PUT_BACK), &world, &late, &abstain())).0, GiveUpCause::Budget);
}

#[test]
fn binding_gives_the_controller_perceived_geometry() {
    let mut world = World::with_mats(3, 0);
    let planner = Planner::new().unwrap();
    let mut invocations = Vec::new();
    let mut world_before = world.clone();
    let end = run(&mut world, &task(PUT_BACK), &abstain(), |world, decision| {
        if let Decision::Act { step, .. } = decision {
            invocations.push(planner.bind(step, &world_before, &robot()).unwrap());
        }
        world_before = world.clone();
    });
    assert!(matches!(end, Decision::Done { .. }));
    let (pick, place, press, last) = (&invocations[0], &invocations[1], &invocations[2], &invocations[4]);
    assert!((pick.frame.translation.z - (world::TABLE_Z + 0.001 + 0.02)).abs() < 1e-9, "{}", pick.frame.translation);
    assert!((pick.arguments["grip_width"] - 0.04).abs() < 1e-12 && pick.held.is_none());
    assert!((pick.support_height_m - (world::TABLE_Z + 0.001)).abs() < 1e-9);
    let others = pick.obstacles.iter().filter(|(id, _)| *id != pick.part.object);
    assert_eq!(others.count(), 4, "three mats and a button");
    assert_eq!(pick.obstacles.len(), 5, "and the cube itself, which the arm must not hit");
    assert_eq!(place.held.as_ref().unwrap().0, ObjectId(4));
    assert!((place.support_height_m - world::TABLE_Z).abs() < 1e-9, "the middle is bare table");
    assert!((last.support_height_m - (world::TABLE_Z + 0.001)).abs() < 1e-9, "the mat's top");
    assert!((press.frame.translation.z - (world::TABLE_Z + 0.02)).abs() < 1e-9);
    assert!(press.obstacles.iter().any(|(id, _)| *id == ObjectId(4)), "the cube in the middle is an obstacle");
}

#[test]
fn an_unconfirmed_rival_is_looked_at_and_then_left_out() {
    let mut world = World::with_mats(3, 0);
    let ghost = world.cube(DVec2::new(-0.1, 0.2), RED, None);
    world.objects.last_mut().unwrap().verified = false;
    let mut looks = 0;
    let end = run(&mut world, &task("Pick up the cube."), &abstain(), |_, decision| {
        looks += u32::from(matches!(decision, Decision::Look { .. }));
    });
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert_eq!(world.held().unwrap().id, ObjectId(4));
    assert_ne!(ghost, ObjectId(4));
    assert!(looks >= 3, "{looks}");
}

#[test]
fn a_memory_of_the_last_frame_and_action_alone_guesses_once() {
    let tops = |world: &World| {
        let free = (1..=4).map(ObjectId).filter(|mat| world.entry(ObjectId(5)).support != Some(*mat));
        let place = |mat| Place {
            support: Some(mat),
            pose: Pose::from_translation(world.spot(mat).extend(world::TABLE_Z + 0.001)),
            tolerance_m: 0.03,
            heading_tolerance_rad: None,
        };
        free.map(|mat| (place(mat), 0.25)).collect::<Vec<_>>()
    };
    for seed in 0..10 {
        let mut world = World::with_mats(4, 2);
        world.remembers = false;
        world.candidates = tops(&world);
        let end = run(&mut world, &task(PUT_BACK), &options(OnUnknown::Guess, seed), |world, _| {
            world.candidates = tops(world);
            let last = world.transitions.len().saturating_sub(1);
            world.transitions.drain(..last);
        });
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert_eq!(world.done_skills.len(), 5, "{:?}", world.done_skills);
    }
}

#[test]
fn the_same_memory_gives_the_same_decision() {
    let world = World::with_mats(5, 2);
    let planner = Planner::new().unwrap();
    let task = task(PUT_BACK);
    let decide = || planner.decide(&task, &world, &situation(&world, 0), &options(OnUnknown::Guess, 9));
    assert_eq!(decide(), decide());
}

#[test]
fn a_move_that_was_only_seen_is_enough_to_return() {
    let mut world = World::with_mats(4, 0);
    let cube = ObjectId(5);
    let home = world.spot(cube);
    let elsewhere = Place {
        support: None,
        pose: Pose::from_translation(MIDDLE.extend(world::TABLE_Z)),
        tolerance_m: 0.03,
        heading_tolerance_rad: None,
    };
    let end = run(&mut world, &task("Return the cube to where it came from."), &abstain(), |_, _| {});
    assert_eq!(given_up(&end).0, GiveUpCause::Memory);
    assert!(world.done_skills.is_empty());

    world.seen_moving(cube, elsewhere);
    let end = run(&mut world, &task("Return the cube to where it came from."), &abstain(), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert!(world.spot(cube).distance(home) < 1e-9);
}

#[test]
fn the_own_grasp_for_a_guess_does_not_become_the_answer() {
    let mut world = World::with_mats(4, 0);
    let cube = ObjectId(5);
    let home = world.spot(cube);
    let text = task("Return the cube to where it came from.");
    let end = run(&mut world, &text, &options(OnUnknown::Guess, 1), |_, _| {});
    assert!(matches!(end, Decision::Done { .. }), "{end:?}");
    assert_eq!(world.done_skills.len(), 2);
    assert!(world.spot(cube).distance(home) > 0.05, "it did not come from where it stood");
}

#[test]
fn of_two_alike_the_one_that_was_moved_is_put_back() {
    for moved in [0, 1] {
        let mut world = World::new();
        let cubes = [world.cube(DVec2::new(-0.2, 0.0), RED, None), world.cube(DVec2::new(0.2, 0.0), RED, None)];
        let home = world.spot(cubes[moved]);
        let elsewhere = Pose::from_translation(DVec2::new(0.0, -0.15).extend(world::TABLE_Z));
        world.seen_moving(
            cubes[moved],
            Place { support: None, pose: elsewhere, tolerance_m: 0.03, heading_tolerance_rad: None },
        );
        let end = run(&mut world, &task("Put the cube back where it was."), &abstain(), |_, _| {});
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert!(world.spot(cubes[moved]).distance(home) < 1e-9, "{:?}", world.done_skills);
    }
    // Nothing was moved: then nothing tells which of the two is meant.
    let mut world = World::new();
    world.cube(DVec2::new(-0.2, 0.0), RED, None);
    world.cube(DVec2::new(0.2, 0.0), RED, None);
    let end = run(&mut world, &task("Put the cube back where it was."), &abstain(), |_, _| {});
    assert_eq!(given_up(&end).0, GiveUpCause::Identity);
}

#[test]
fn two_cubes_change_places_by_way_of_a_free_spot() {
    for mats in 2..=4 {
        let mut world = World::with_mats(mats, 0);
        let (red, on) = (ObjectId(u64::from(mats) + 1), ObjectId(2));
        let there = world.spot(on);
        let green = world.cube(there, GREEN, Some(on));
        let here = world.spot(red);
        let end = run(&mut world, &task("Swap the red cube and the green cube."), &abstain(), |_, _| {});
        assert!(matches!(end, Decision::Done { .. }), "{end:?}");
        assert!(world.spot(red).distance(there) < 0.005 && world.spot(green).distance(here) < 0.005);
        assert_eq!(world.done_skills.len(), 6, "{:?}", world.done_skills);
        assert_eq!(world.done_skills[0], format!("pick P{}.0", green.0), "it makes way first");
    }
}
