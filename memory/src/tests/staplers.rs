//! Things that are alike, moved by others: watched in small steps, or unseen.

use super::*;
use crate::{
    query::{PlaceReference, Recall},
    staging::{Thing, look, look_blind, open_hand},
};
use acm_concept::object::Visibility;

fn bar(length: f64, x: f64, y: f64) -> Thing {
    Thing::block([length, 0.03, 0.03]).at(x, y, 0.0).colored(RED)
}

fn came_from(memory: &AcmMemory, id: ObjectId) -> Recall<acm_concept::literal::Place> {
    memory.view().recall_place(id, PlaceReference::BeforeMoved)
}

fn is_at(recall: &Recall<acm_concept::literal::Place>, x: f64, y: f64) -> bool {
    let Recall::Known { value, .. } = recall else { return false };
    value.pose.translation.truncate().distance(glam::DVec2::new(x, y)) < 0.015
}

#[test]
fn what_creeps_away_in_small_steps_came_from_where_it_began() {
    let mut memory = memory();
    for frame in 0..10 {
        look(&mut memory, frame, 0.1 * frame as f64, &[bar(0.12, 0.0, 0.0)], &[], &open_hand(0.0)).unwrap();
    }
    for step in 1..=30u64 {
        let at = 0.01 * step as f64;
        let seen = [(ObjectId(1), Visibility::Seen, 0.7)];
        look(&mut memory, 9 + step, 1.0 + 0.1 * step as f64, &[bar(0.12, at, 0.0)], &seen, &open_hand(0.0)).unwrap();
    }
    let view = memory.view();
    assert_eq!(view.objects().len(), 1, "{:?}", view.objects());
    let now = view.object(ObjectId(1)).unwrap().pose().unwrap().translation;
    assert!((now.x - 0.3).abs() < 0.07, "it is followed: {now}");
    let from = came_from(&memory, ObjectId(1));
    assert!(is_at(&from, 0.0, 0.0), "{from:?}");
}

/// Two bars are seen; unseen, one of them is put elsewhere and the other taken away.
fn one_is_left(lengths: [f64; 2], left: f64, views: u64) -> (AcmMemory, ObjectId) {
    let mut memory = memory();
    let both = [bar(lengths[0], -0.2, 0.0), bar(lengths[1], 0.2, 0.0)];
    for frame in 0..6 {
        look(&mut memory, frame, 0.1 * frame as f64, &both, &[], &open_hand(0.0)).unwrap();
    }
    look_blind(&mut memory, 6, 1.0, &open_hand(0.0)).unwrap();
    let gone = [(ObjectId(1), Visibility::SeenThrough, 0.9), (ObjectId(2), Visibility::SeenThrough, 0.9)];
    look(&mut memory, 7, 2.0, &[bar(left, 0.0, 0.15)], &gone, &open_hand(0.0)).unwrap();
    for frame in 8..8 + views {
        look(&mut memory, frame, 0.1 * frame as f64, &[bar(left, 0.0, 0.15)], &[], &open_hand(0.0)).unwrap();
    }
    let view = memory.view();
    let there: Vec<ObjectId> =
        view.objects().iter().filter(|o| o.presence == crate::entry::Presence::Present).map(|o| o.id).collect();
    assert_eq!(view.objects().len(), 2, "no third bar is made up");
    assert_eq!(there.len(), 1);
    (memory, there[0])
}

#[test]
fn of_two_alike_nobody_knows_which_is_left() {
    let (memory, left) = one_is_left([0.12, 0.12], 0.12, 6);
    let Recall::Unknown { reason, candidates } = came_from(&memory, left) else { panic!("it cannot be known") };
    assert!(reason.contains("looks the same"), "{reason}");
    assert_eq!(candidates.len(), 2, "both places stay possible: {candidates:?}");
}

#[test]
fn a_length_that_differs_tells_which_is_left_and_more_views_tell_it_better() {
    for (left, x) in [(0.12, -0.2), (0.14, 0.2)] {
        let (memory, id) = one_is_left([0.12, 0.14], left, 10);
        let from = came_from(&memory, id);
        assert!(is_at(&from, x, 0.0), "{left}: {from:?}");
    }
    let doubt = |views| {
        let (memory, id) = one_is_left([0.12, 0.13], 0.12, views);
        memory.view().object(id).unwrap().ambiguous_with.iter().map(|(_, probability)| probability).sum::<f64>()
    };
    assert!(doubt(10) < doubt(0), "{} after ten views, {} at first", doubt(10), doubt(0));
}

#[test]
fn the_doubt_of_two_alike_outlives_a_restart() {
    let (mut memory, left) = one_is_left([0.12, 0.12], 0.12, 2);
    staging::begin(&mut memory).unwrap();
    look(&mut memory, 0, 0.1, &[bar(0.12, 0.0, 0.15)], &[], &open_hand(0.0)).unwrap();
    assert!(matches!(came_from(&memory, left), Recall::Unknown { .. }), "{:?}", came_from(&memory, left));
}

#[test]
fn the_second_piece_of_a_half_hidden_thing_is_no_new_thing() {
    let mut memory = memory();
    for frame in 0..4 {
        look(&mut memory, frame, 0.1 * frame as f64, &[bar(0.12, 0.0, 0.0)], &[], &open_hand(0.0)).unwrap();
    }
    let gone = [(ObjectId(1), Visibility::SeenThrough, 0.8)];
    let pieces = [bar(0.04, 0.1, 0.0).cut(), bar(0.035, 0.17, 0.0).cut()];
    look(&mut memory, 4, 0.5, &pieces, &gone, &open_hand(0.0)).unwrap();
    assert_eq!(memory.view().objects().len(), 1, "{:?}", memory.view().objects());
}
