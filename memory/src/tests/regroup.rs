//! Identities are merged, split, and put back.

use super::*;
use crate::{
    entry::{Moment, Presence},
    observation::Note,
    project::{moment, narrow},
    staging::{Thing, begin, look, open_hand, report},
    store_time,
};
use acm_concept::{object::Visibility, time::Time};

fn at(episode: u32, seconds: f64) -> Moment {
    Moment { episode, time: Time::from_seconds(seconds) }
}

fn cup(x: f64) -> Thing {
    Thing::can(0.03, 0.1).at(x, 0.0, 0.0).colored(BLUE)
}

/// Two cups are seen, then the second alone, elsewhere, and it is picked.
fn two_cups(dir: &std::path::Path) -> (AcmMemory, ObjectId, ObjectId) {
    let mut memory = AcmMemory::open(dir, Arc::clone(&LIBRARY)).unwrap();
    begin(&mut memory).unwrap();
    for frame in 0..2 {
        look(&mut memory, frame, 1.0, &[cup(0.0), cup(0.4)], &[], &open_hand(1.0)).unwrap();
    }
    let views = [(ObjectId(1), Visibility::OutOfView, 0.0), (ObjectId(2), Visibility::SeenThrough, 0.9)];
    for frame in 2..6 {
        look(&mut memory, frame, 3.0, &[cup(0.6)], &views, &open_hand(1.0)).unwrap();
    }
    let (first, second) = (ObjectId(1), ObjectId(2));
    let executed = report(&*memory.view(), "pick", second, 6.0).unwrap();
    memory.record(&executed).unwrap();
    (memory, first, second)
}

fn x_as_of(memory: &AcmMemory, id: ObjectId, valid: Moment, known: Moment) -> Option<f32> {
    let (valid, known) = (store_time(valid).unwrap(), store_time(known).unwrap());
    memory.columns().as_of(narrow(id)?, valid, known).filter(|past| past.there).map(|past| past.position[0])
}

#[test]
fn a_merge_gives_one_history_and_is_undone_exactly() {
    let dir = tempfile::tempdir().unwrap();
    let (mut memory, first, second) = two_cups(dir.path());
    let before = memory.state().clone();
    let last_known = memory.state().moment();
    memory.note(&Note::Instructed { time: Time::from_seconds(10.0), text: "go on".into() }).unwrap();
    let number = memory.merge(first, second).unwrap();
    let merged = object(&memory, first);
    assert!(memory.view().object(second).is_none());
    assert_eq!(merged.views, before.object(first).unwrap().views + before.object(second).unwrap().views);
    let places = merged.history.iter().map(|entry| entry.place.unwrap().pose.translation.x);
    let mut places: Vec<f64> = places.map(|x| (x * 1000.0).round()).collect();
    assert_eq!(places.pop(), Some(600.0), "where it was seen last");
    places.sort_by(f64::total_cmp);
    assert_eq!(places, [0.0, 400.0]);
    assert!(memory.view().transitions().iter().all(|transition| transition.object() == first));
    // What was so is another matter than what was known then.
    let now = at(1, 20.0);
    assert_eq!(x_as_of(&memory, second, at(1, 5.0), now), None);
    assert_eq!(x_as_of(&memory, second, at(1, 5.0), last_known), Some(0.6));
    assert_eq!(x_as_of(&memory, first, at(1, 5.0), last_known), Some(0.0));
    assert_eq!(x_as_of(&memory, first, at(1, 5.0), now), Some(0.6), "it has the other one's history");
    let after = memory.state().clone();
    drop(memory);
    let mut memory = AcmMemory::open(dir.path(), Arc::clone(&LIBRARY)).unwrap();
    assert_eq!(memory.state(), &after);
    memory.undo_regrouping(number).unwrap();
    for (name, same) in [
        ("objects", memory.state().objects == before.objects),
        ("tracks", memory.state().tracks == before.tracks),
        ("transitions", memory.state().transitions == before.transitions),
    ] {
        assert!(same, "{name} are not what they were");
    }
    assert_eq!(x_as_of(&memory, second, at(1, 5.0), now), Some(0.6));
    assert_eq!(x_as_of(&memory, first, at(1, 5.0), now), Some(0.0));
    assert!(memory.undo_regrouping(number).is_err(), "it is undone");
    assert!(memory.merge(first, first).is_err() && memory.merge(first, ObjectId(99)).is_err());
}

#[test]
fn what_is_seen_after_a_merge_stays_when_it_is_undone() {
    let dir = tempfile::tempdir().unwrap();
    let (mut memory, first, second) = two_cups(dir.path());
    let (one, other) = (object(&memory, first), object(&memory, second));
    let number = memory.merge(first, second).unwrap();
    for frame in 20..23 {
        look(&mut memory, frame, frame as f64, &[cup(0.6)], &[], &open_hand(1.0)).unwrap();
    }
    let seen = object(&memory, first);
    memory.undo_regrouping(number).unwrap();
    let (now, back) = (object(&memory, first), object(&memory, second));
    assert_eq!(back, other);
    assert_eq!((now.last_seen, now.parts), (seen.last_seen, seen.parts));
    assert_eq!(now.history[0], one.history[0]);
}

#[test]
fn a_split_gives_what_was_since_to_a_new_identity_and_is_undone_exactly() {
    let dir = tempfile::tempdir().unwrap();
    let mut memory = AcmMemory::open(dir.path(), Arc::clone(&LIBRARY)).unwrap();
    begin(&mut memory).unwrap();
    let block = |x: f64| Thing::block([0.08, 0.03, 0.04]).at(x, 0.0, 0.0).colored(RED);
    for (frame, x) in [0.0, 0.0, 0.0, 0.3, 0.3, 0.3].into_iter().enumerate() {
        let gone = [(ObjectId(1), Visibility::SeenThrough, 0.9)];
        let views = if frame < 3 { &[][..] } else { &gone };
        look(&mut memory, frame as u64, 1.0 + frame as f64, &[block(x)], views, &open_hand(1.0)).unwrap();
    }
    let executed = report(&*memory.view(), "pick", ObjectId(1), 9.0).unwrap();
    memory.record(&executed).unwrap();
    let before = memory.state().clone();
    let whole = object(&memory, ObjectId(1));
    let since = whole.history.last().unwrap().moment;
    assert!(whole.history.len() > 1 && moment(store_time(since).unwrap()) == since);
    assert!(memory.split(ObjectId(1), at(1, 0.0)).is_err(), "nothing was before");
    let (number, new) = memory.split(ObjectId(1), since).unwrap();
    let (old, other) = (object(&memory, ObjectId(1)), object(&memory, new));
    assert_eq!((old.presence, other.presence), (Presence::Missing, Presence::Present));
    assert_eq!([old.history.clone(), other.history.clone()].concat(), whole.history);
    assert_eq!(memory.view().transitions()[0].object(), new);
    let now = at(1, 20.0);
    assert_eq!(x_as_of(&memory, new, at(1, 2.0), now), None);
    assert_eq!(x_as_of(&memory, new, since, now), Some(0.3));
    // The columns hold what is believed, whatever was regrouped.
    assert!(memory.columns().row(narrow(new).unwrap()).is_some());
    memory.undo_regrouping(number).unwrap();
    assert_eq!(memory.state().objects, before.objects);
    assert_eq!(memory.state().transitions, before.transitions);
    assert!(memory.view().object(new).is_none());
    let state = memory.state().clone();
    drop(memory);
    let mut memory = AcmMemory::open(dir.path(), Arc::clone(&LIBRARY)).unwrap();
    assert_eq!(memory.state(), &state);
    // Forgetting and compaction take regroupings along.
    memory.split(ObjectId(1), since).unwrap();
    let state = memory.state().clone();
    memory.compact(0).unwrap();
    drop(memory);
    let mut memory = AcmMemory::open(dir.path(), Arc::clone(&LIBRARY)).unwrap();
    assert_eq!(memory.state(), &state);
    memory.erase(&[ObjectId(1)]).unwrap();
    assert!(memory.view().objects().iter().all(|entry| entry.id != ObjectId(1)));
}
