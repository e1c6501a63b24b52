//! A frame in which all that is verified seems to have moved in common, and frames in which some things truly moved.

use super::*;
use crate::{
    observation::{Displacement, Grounding},
    staging::{Thing, look, open_hand},
};
use acm_concept::{object::Visibility, pose::Pose};
use glam::DVec3;
use proptest::prelude::*;

/// Six things on a table, two of them twins.
fn table() -> Vec<Thing> {
    vec![
        Thing::block([0.04, 0.04, 0.04]).at(0.3, 0.1, 0.0).colored(RED),
        Thing::block([0.04, 0.04, 0.04]).at(0.4, 0.1, 0.0).colored(RED),
        Thing::block([0.08, 0.05, 0.06]).at(0.5, -0.1, 0.0).colored(BLUE),
        Thing::can(0.03, 0.1).at(0.6, 0.15, 0.0).colored([40, 160, 60]),
        Thing::block([0.12, 0.06, 0.09]).at(0.35, -0.2, 0.0).colored([200, 180, 40]),
        Thing::can(0.04, 0.07).at(0.65, -0.2, 0.0).colored([120, 60, 160]),
    ]
}

fn settled(things: &[Thing]) -> AcmMemory {
    let mut memory = memory();
    for frame in 0..3 {
        look(&mut memory, frame, frame as f64, things, &[], &open_hand(0.0)).unwrap();
    }
    assert!(memory.view().objects().iter().all(|entry| entry.verified));
    memory
}

/// One more frame, in which nothing is left where it was believed to be.
fn shown(memory: &mut AcmMemory, frame: u64, things: &[Thing], gone: &[u64]) -> Grounding {
    let views: Vec<(ObjectId, Visibility, f64)> =
        gone.iter().map(|id| (ObjectId(*id), Visibility::SeenThrough, 0.95)).collect();
    look(memory, frame, frame as f64, things, &views, &open_hand(0.0)).unwrap()
}

fn carried(thing: &Thing, motion: &Pose) -> Thing {
    let mut thing = thing.clone();
    thing.part.pose.pose = *motion * thing.part.pose.pose;
    thing
}

fn position(memory: &AcmMemory, id: u64) -> DVec3 {
    object(memory, ObjectId(id)).pose().unwrap().translation
}

const ALL: [u64; 6] = [1, 2, 3, 4, 5, 6];

#[test]
fn when_all_moved_in_common_the_camera_did_and_what_moved_beside_that_is_still_seen() {
    let things = table();
    let mut memory = settled(&things);
    let push = Pose::from_yaw(DVec3::new(0.05, 0.03, 0.01), 0.1);
    for frame in 3..6 {
        let mut seen: Vec<Thing> = things.iter().map(|thing| carried(thing, &push)).collect();
        // One thing truly moved, and one came.
        seen[4] = carried(&things[4].clone().at(0.75, 0.0, 0.0), &push);
        seen.push(carried(&Thing::block([0.1, 0.1, 0.03]).at(0.45, 0.25, 0.0).colored([20, 20, 20]), &push));
        let grounding = shown(&mut memory, frame, &seen, &ALL);
        let displaced = grounding.displaced.unwrap();
        let Displacement::Camera(motion) = displaced.by else { panic!("{displaced:?}") };
        assert!(motion.translation.distance(push.translation) < 1e-6 && displaced.undone, "{displaced:?}");
        assert!(displaced.things >= 5);
        assert!(grounding.missing.is_empty());
        for (id, thing) in (1..).zip(&things).filter(|(id, _)| *id != 5) {
            assert!(position(&memory, id).distance(thing.part.pose.pose.translation) < 0.001);
        }
    }
    // What truly moved may be taken for a copy that came, as nobody looked at its old place.
    let at = |x, y| {
        let near = |entry: &ObjectEntry| {
            entry.pose().is_some_and(|pose| pose.translation.distance(DVec3::new(x, y, 0.0)) < 0.001)
        };
        memory.view().objects().iter().any(near)
    };
    assert!(at(0.75, 0.0) && at(0.45, 0.25), "what is elsewhere, and what is new, is where the corrected frame has it");
}

#[test]
fn when_all_is_farther_and_larger_by_one_factor_the_depth_is_wrong_and_nothing_is_taken_over() {
    let things = table();
    let mut memory = settled(&things);
    let before = memory.view().objects().to_vec();
    let stretched = |thing: &Thing| {
        let mut thing = thing.clone();
        thing.part.pose.pose.translation *= 1.125;
        thing.part.parameters.iter_mut().for_each(|parameter| parameter.value *= 1.125);
        thing
    };
    for frame in 3..8 {
        let seen: Vec<Thing> = things.iter().map(stretched).collect();
        let displaced = shown(&mut memory, frame, &seen, &ALL).displaced.unwrap();
        let Displacement::Depth(stretch) = displaced.by else { panic!("{displaced:?}") };
        assert!((stretch - 1.125).abs() < 1e-6 && !displaced.undone);
        assert_eq!(memory.view().objects(), before);
    }
    assert!(shown(&mut memory, 8, &things, &[]).displaced.is_none(), "the next good frame is taken as ever");
    assert!(memory.view().objects().iter().all(|entry| entry.views == 4));
}

#[test]
fn what_is_carried_on_a_tray_moved_and_the_camera_did_not() {
    let tray = || {
        vec![
            Thing::block([0.3, 0.2, 0.02]).at(0.4, 0.0, 0.0).colored([90, 90, 90]),
            Thing::block([0.04, 0.04, 0.04]).at(0.33, 0.0, 0.02).colored(RED),
            Thing::block([0.06, 0.03, 0.05]).at(0.43, 0.05, 0.02).colored(BLUE),
            Thing::can(0.02, 0.06).at(0.48, -0.04, 0.02).colored([40, 160, 60]),
        ]
    };
    let mut memory = settled(&tray());
    assert_eq!(object(&memory, ObjectId(2)).support, Some(ObjectId(1)));
    let push = Pose::from_yaw(DVec3::new(0.1, 0.1, 0.0), 0.2);
    let seen: Vec<Thing> = tray().iter().map(|thing| carried(thing, &push)).collect();
    let grounding = shown(&mut memory, 3, &seen, &[1, 2, 3, 4]);
    assert_eq!(grounding.displaced, None);
    assert_eq!(grounding.moved.len(), 4, "{grounding:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn a_pushed_camera_overwrites_nothing(
        yaw in -0.4..0.4f64, x in -0.2..0.2f64, y in -0.2..0.2f64, z in -0.05..0.05f64,
        noise in prop::collection::vec(-0.003..0.003f64, 18),
    ) {
        let things = table();
        let push = Pose::from_yaw(DVec3::new(x, y, z), yaw);
        let moves = |thing: &&Thing| {
            let at = thing.part.pose.pose.translation;
            push.transform_point(at).distance(at) > 0.03
        };
        prop_assume!(things.iter().filter(moves).count() == things.len());
        let mut memory = settled(&things);
        let seen: Vec<Thing> = things.iter().zip(noise.chunks(3)).map(|(thing, noise)| {
            let mut seen = carried(thing, &push);
            seen.part.pose.pose.translation += DVec3::from_slice(noise);
            seen
        }).collect();
        let grounding = shown(&mut memory, 3, &seen, &ALL);
        prop_assert!(grounding.displaced.is_some() && grounding.missing.is_empty() && grounding.moved.is_empty());
        for (id, thing) in (1..).zip(&things) {
            prop_assert!(position(&memory, id).distance(thing.part.pose.pose.translation) < 0.01);
            prop_assert_eq!(object(&memory, ObjectId(id)).history.len(), 1);
        }
    }

    #[test]
    fn one_or_two_things_that_truly_moved_are_no_sign_of_a_pushed_camera(
        first in prop_oneof![Just(2usize), Just(4)], second in prop_oneof![Just(2usize), Just(4)], x in -0.2..0.2f64, y in 0.3..0.6f64, yaw in -1.0..1.0f64,
    ) {
        let things = table();
        let mut memory = settled(&things);
        let push = Pose::from_yaw(DVec3::new(x, y, 0.0), yaw);
        let mut seen = things.clone();
        for at in [first, second] {
            seen[at] = carried(&things[at], &push);
        }
        let grounding = shown(&mut memory, 3, &seen, &[first as u64 + 1, second as u64 + 1]);
        prop_assert_eq!(grounding.displaced, None);
        // That they moved is believed unless a copy that came explains it better; that others did is not.
        prop_assert!(grounding.moved.iter().all(|id| [first as u64 + 1, second as u64 + 1].contains(&id.0)));
        for (id, thing) in (1..).zip(&things).filter(|(id, _)| ![first as u64 + 1, second as u64 + 1].contains(id)) {
            prop_assert!(position(&memory, id).distance(thing.part.pose.pose.translation) < 0.001);
        }
    }
}
