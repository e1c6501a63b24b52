//! One memory over several runs.

use super::*;
use crate::{
    entry::Presence,
    observation::Note,
    query::{PlaceReference, Recall},
    staging::{Thing, begin, gripping_hand, look, open_hand, report},
};

use acm_concept::time::Time;

fn block(x: f64) -> Thing {
    Thing::block([0.04, 0.04, 0.04]).at(x, 0.0, 0.0).colored(RED)
}

#[test]
fn a_move_between_two_runs_is_remembered_and_a_later_run_without_one_asks_the_earlier() {
    let mut memory = memory();
    for frame in 0..2 {
        look(&mut memory, frame, 0.0, &[block(0.0)], &[], &open_hand(0.0)).unwrap();
    }
    begin(&mut memory).unwrap();
    let entry = object(&memory, ObjectId(1));
    assert!(!entry.verified && entry.confidence < 0.9, "it has to be seen again");
    let grounding = look(&mut memory, 0, 0.0, &[block(0.3)], &[], &open_hand(0.0)).unwrap();
    assert_eq!(grounding.resolved[0].object, ObjectId(1), "{grounding:?}");
    let origin = |memory: &AcmMemory| match memory.view().recall_place(ObjectId(1), PlaceReference::BeforeMoved) {
        Recall::Known { value, .. } => Some(value.pose.translation.x),
        Recall::Unknown { .. } => None,
    };
    assert!(origin(&memory).is_some_and(|x| x.abs() < 0.005));
    begin(&mut memory).unwrap();
    look(&mut memory, 0, 0.0, &[block(0.3)], &[], &open_hand(0.0)).unwrap();
    assert!(origin(&memory).is_some_and(|x| x.abs() < 0.005), "no move in this run: the last one counts");
    assert_eq!(truth(&memory, "moved(O1)"), Truth::No);
}

#[test]
fn what_an_earlier_subtask_moved_came_from_where_it_was_before_that_subtask() {
    let mut memory = memory();
    for frame in 0..2 {
        look(&mut memory, frame, 0.0, &[block(0.0)], &[], &open_hand(0.0)).unwrap();
    }
    begin(&mut memory).unwrap();
    // Between the runs somebody moved it to 0.3: seen, but not what the instruction speaks of.
    look(&mut memory, 0, 0.0, &[block(0.3)], &[], &open_hand(0.0)).unwrap();
    memory.note(&Note::Instructed { time: Time::ZERO, text: "bring it here, then return it".into() }).unwrap();
    let mut executed = report(&*memory.view(), "pick", ObjectId(1), 2.0).unwrap().holding();
    executed.subtask = Some(0);
    memory.record(&executed).unwrap();
    let origin = |memory: &AcmMemory| match memory.view().recall_place(ObjectId(1), PlaceReference::BeforeMoved) {
        Recall::Known { value, .. } => (value.pose.translation.x * 10.0).round() as i64,
        unknown => panic!("{unknown:?}"),
    };
    assert_eq!(origin(&memory), 0, "while the subtask runs, the move before it counts");
    memory.note(&Note::SubtaskDone { time: Time::from_seconds(3.0), index: 0 }).unwrap();
    assert_eq!(origin(&memory), 3);
}

#[test]
fn nothing_is_in_the_hand_when_a_run_begins() {
    let mut memory = memory();
    look(&mut memory, 0, 0.0, &[block(0.0)], &[], &open_hand(0.0)).unwrap();
    let executed = report(&*memory.view(), "pick", ObjectId(1), 2.0).unwrap().holding();
    memory.record(&executed).unwrap();
    look(&mut memory, 1, 2.0, &[], &[], &gripping_hand(2.0)).unwrap();
    assert_eq!(memory.view().held().map(|entry| entry.id), Some(ObjectId(1)));
    memory.note(&Note::EpisodeBegan).unwrap();
    assert_eq!(object(&memory, ObjectId(1)).presence, Presence::Missing);
    assert_eq!(truth(&memory, "holding(O1)"), Truth::Unknown);
    assert_eq!(memory.view().progress().current(), 0);
}

#[test]
fn the_expectation_follows_the_hand_and_grows_unsure_with_time() {
    let mut memory = memory();
    look(&mut memory, 0, 0.0, &[block(0.0), Thing::can(0.03, 0.1).at(0.3, 0.0, 0.0)], &[], &open_hand(0.0)).unwrap();
    let executed = report(&*memory.view(), "pick", ObjectId(1), 2.0).unwrap().holding();
    memory.record(&executed).unwrap();
    let mut hand = gripping_hand(2.0);
    hand.tcp.translation = glam::DVec3::new(0.5, 0.1, 0.4);
    look(&mut memory, 1, 2.0, &[], &[], &hand).unwrap();
    let expectation = memory.expect(acm_concept::time::Time::from_seconds(102.0));
    let [held, can] = expectation.objects.as_slice() else { panic!("two objects are expected") };
    assert!(held.held && !can.held);
    assert!(held.parts[0].pose.pose.translation.distance(glam::DVec3::new(0.5, 0.1, 0.38)) < 1e-9);
    assert!(can.parts[0].pose.position_sigma_m.x > crate::staging::SIGMA_M + 0.005);
    assert!(expectation.support.is_some());
}

#[test]
fn a_blind_frame_changes_nothing_but_the_hand() {
    let mut memory = memory();
    look(&mut memory, 0, 0.0, &[block(0.0)], &[], &open_hand(0.0)).unwrap();
    let before = object(&memory, ObjectId(1));
    crate::staging::look_blind(&mut memory, 1, 1.0, &gripping_hand(1.0)).unwrap();
    assert_eq!(object(&memory, ObjectId(1)), before);
    assert_eq!(memory.view().frames_seen(), 1);
    assert_eq!(truth(&memory, "hand-empty()"), Truth::No);
}
