//! Places: what a thing rests on, what is clear, and places that move with what they are on.

use super::*;
use crate::{
    inspect,
    query::{PlaceReference, Recall},
    staging::{Thing, look, open_hand},
};
use acm_concept::{
    literal::{Place, Term},
    object::Visibility,
    pose::Pose,
};
use glam::DVec3;

fn mat(x: f64, y: f64) -> Thing {
    Thing::mat(0.1, 0.08).at(x, y, 0.0).colored([90, 140, 90])
}
fn block(x: f64, y: f64) -> Thing {
    Thing::block([0.04, 0.04, 0.04]).at(x, y, 0.001).colored(RED)
}

#[test]
fn relations_are_kept_for_what_is_not_seen_now() {
    let mut memory = memory();
    let stacked = Thing::block([0.05, 0.05, 0.05]).at(0.0, 0.0, 0.041).colored(BLUE);
    look(&mut memory, 0, 0.0, &[mat(0.0, 0.0), block(0.0, 0.0), stacked], &[], &open_hand(0.0)).unwrap();
    look(&mut memory, 1, 1.0, &[], &[], &open_hand(1.0)).unwrap();
    assert_eq!(truth(&memory, "on(O2, O1)"), Truth::Yes);
    assert_eq!(truth(&memory, "on(O3, O2)"), Truth::Yes);
    assert_eq!(truth(&memory, "on(O3, O1)"), Truth::No);
    assert_eq!(truth(&memory, "clear(O2)"), Truth::No);
    assert_eq!(truth(&memory, "clear(O3)"), Truth::Yes);
    assert_eq!(truth(&memory, "visible(O3)"), Truth::Unknown);
    assert_eq!(truth(&memory, "graspable(O1)"), Truth::No);
    assert_eq!(truth(&memory, "supportive(O1)"), Truth::Yes);
    let relations: Vec<String> = inspect::relations(&*memory.view()).iter().map(Literal::to_string).collect();
    assert_eq!(relations, ["on(O2, O1)", "on(O3, O2)", "clear(O3)"]);
    let stats = inspect::stats(&*memory.view());
    assert_eq!((stats.objects, stats.frames_seen), (3, 2));
    assert_eq!(inspect::objects(&*memory.view())[1].support, Some(ObjectId(1)));
}

#[test]
fn the_camera_may_err_by_a_centimetre_in_height() {
    for z in [-0.009, -0.004, 0.0, 0.005, 0.01] {
        let mut memory = memory();
        look(&mut memory, 0, 0.0, &[mat(0.0, 0.0), block(0.01, 0.01).at(0.01, 0.01, z)], &[], &open_hand(0.0)).unwrap();
        assert_eq!(truth(&memory, "on(O2, O1)"), Truth::Yes, "{z}");
    }
}

#[test]
fn a_place_moves_with_the_mat_it_is_on() {
    let mut memory = memory();
    for frame in 0..2 {
        look(&mut memory, frame, 0.0, &[mat(0.0, 0.0), block(0.02, 0.01)], &[], &open_hand(0.0)).unwrap();
    }
    // The block goes first, then the mat is moved and turned by a right angle.
    let gone = [(ObjectId(2), Visibility::SeenThrough, 1.0)];
    look(&mut memory, 2, 1.0, &[mat(0.0, 0.0), block(0.3, 0.3)], &gone, &open_hand(1.0)).unwrap();
    let gone = [(ObjectId(1), Visibility::SeenThrough, 1.0)];
    let turned = mat(-0.2, 0.1).turned(1.2);
    let grounding = look(&mut memory, 3, 2.0, &[turned, block(0.3, 0.3)], &gone, &open_hand(2.0)).unwrap();
    assert_eq!(grounding.moved, [ObjectId(1)]);
    let Recall::Known { value, evidence, .. } = memory.view().recall_place(ObjectId(2), PlaceReference::BeforeMoved)
    else {
        panic!("it was seen on the mat");
    };
    let expected = Pose::from_yaw(DVec3::new(-0.2, 0.1, 0.0), 1.2).transform_point(DVec3::new(0.02, 0.01, 0.001));
    assert!(value.pose.translation.distance(expected) < 1e-3, "{} instead of {expected}", value.pose.translation);
    assert_eq!(value.support, Some(ObjectId(1)));
    assert!(evidence.iter().any(|e| matches!(e, acm_concept::literal::Evidence::Inferred(_))));
}

#[test]
fn the_start_is_the_place_before_the_first_move_and_now_is_now() {
    let mut memory = memory();
    look(&mut memory, 0, 0.0, &[block(0.0, 0.0)], &[], &open_hand(0.0)).unwrap();
    let gone = [(ObjectId(1), Visibility::SeenThrough, 1.0)];
    look(&mut memory, 1, 1.0, &[block(0.2, 0.0)], &gone, &open_hand(1.0)).unwrap();
    look(&mut memory, 2, 2.0, &[block(0.4, 0.1)], &gone, &open_hand(2.0)).unwrap();
    let x = |reference| match memory.view().recall_place(ObjectId(1), reference) {
        Recall::Known { value, .. } => (value.pose.translation.x * 10.0).round() as i64,
        unknown => panic!("{reference:?}: {unknown:?}"),
    };
    assert_eq!(x(PlaceReference::AtStart), 0);
    assert_eq!(x(PlaceReference::BeforeMoved), 0);
    assert_eq!(x(PlaceReference::Now), 4);
}

#[test]
fn being_at_a_place_is_three_valued() {
    let mut memory = memory();
    look(&mut memory, 0, 0.0, &[block(0.0, 0.0).spread(0.02)], &[], &open_hand(0.0)).unwrap();
    let at = |memory: &AcmMemory, x: f64| {
        let place = Place {
            support: None,
            pose: Pose::from_translation(DVec3::new(x, 0.0, 0.0)),
            tolerance_m: 0.03,
            heading_tolerance_rad: None,
        };
        memory.view().belief(&Literal::new("at", vec![Term::Object(ObjectId(1)), Term::Place(place)])).truth
    };
    assert_eq!(at(&memory, 0.0), Truth::Unknown, "2 cm of uncertainty leave a third outside 3 cm");
    assert_eq!(at(&memory, 0.1), Truth::No);
    for frame in 1..8 {
        look(&mut memory, frame, 1.0, &[block(0.0, 0.0)], &[], &open_hand(1.0)).unwrap();
    }
    assert_eq!(at(&memory, 0.005), Truth::Yes);
    let high = Place {
        support: None,
        pose: Pose::from_translation(DVec3::new(0.0, 0.0, 0.1)),
        tolerance_m: 0.03,
        heading_tolerance_rad: None,
    };
    let belief = memory.view().belief(&Literal::new("at", vec![Term::Object(ObjectId(1)), Term::Place(high)]));
    assert_eq!(belief.truth, Truth::No, "{}", belief.reason);
}

#[test]
fn a_place_with_a_heading_is_reached_modulo_the_symmetry_of_what_stands_there() {
    let mut memory = memory();
    let oblong = Thing::block([0.08, 0.03, 0.04]).at(0.0, 0.0, 0.0).colored(BLUE);
    for frame in 0..8 {
        look(&mut memory, frame, 1.0, std::slice::from_ref(&oblong), &[], &open_hand(1.0)).unwrap();
    }
    let pose = object(&memory, ObjectId(1)).pose().unwrap();
    let turned_by = |turn: f64| {
        let pose = Pose::from_yaw(pose.translation, pose.yaw() + turn);
        let place = Place { support: None, pose, tolerance_m: 0.03, heading_tolerance_rad: Some(0.26) };
        memory.view().belief(&Literal::new("at", vec![Term::Object(ObjectId(1)), Term::Place(place)]))
    };
    assert_eq!(turned_by(0.0).truth, Truth::Yes);
    assert_eq!(turned_by(std::f64::consts::PI).truth, Truth::Yes, "half a turn of a box changes nothing");
    let across = turned_by(std::f64::consts::FRAC_PI_2);
    assert_eq!(across.truth, Truth::No);
    assert!(across.reason.contains("turned by"), "{}", across.reason);
}
