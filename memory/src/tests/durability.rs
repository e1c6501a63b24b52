//! The log: torn tails, damage, format, lock, wipes; the state is the fold of what was acknowledged.

use super::*;
use crate::{
    MemoryError, Policy,
    entry::Presence,
    ledger::FORMAT,
    memory::AcmMemory,
    observation::Note,
    staging::{Thing, begin, gripping_hand, look, open_hand, report, verify},
};
use acm_concept::{object::Visibility, skill::FailureCause, time::Time};
use proptest::prelude::*;
use std::{fs, path::Path};

/// The log's last segment.
fn log_of(dir: &Path) -> std::path::PathBuf {
    let names = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    names.filter(|path| path.file_name().unwrap().to_string_lossy().starts_with("log-")).max().unwrap()
}
/// Bytes of a segment's head, and of the blocks on which batches begin.
const BLOCK: u64 = 512;

fn open(dir: &Path) -> Result<AcmMemory, MemoryError> {
    AcmMemory::open(dir, Arc::clone(&LIBRARY))
}

/// One call on memory, chosen by a number.
#[derive(Debug, Clone)]
enum Step {
    Look { x: f64, y: f64, length: f64, confidence: f64, gone: bool },
    Pick { fails: bool },
    Place { x: f64 },
    Settle,
    Note(u32),
    Begin,
    Wipe,
}

fn steps(count: usize) -> impl Strategy<Value = Vec<Step>> {
    let look = (-0.3..0.3f64, -0.3..0.3f64, 0.03..0.1f64, 0.0..1.0f64, any::<bool>())
        .prop_map(|(x, y, length, confidence, gone)| Step::Look { x, y, length, confidence, gone });
    let step = prop_oneof![
        6 => look,
        2 => any::<bool>().prop_map(|fails| Step::Pick { fails }),
        2 => (-0.3..0.3f64).prop_map(|x| Step::Place { x }),
        2 => Just(Step::Settle),
        1 => (0..4u32).prop_map(Step::Note),
        1 => Just(Step::Begin),
        1 => Just(Step::Wipe),
    ];
    prop::collection::vec(step, 1..count)
}

fn perform(memory: &mut AcmMemory, number: usize, step: &Step) -> Result<(), MemoryError> {
    let seconds = number as f64;
    let first = memory.view().objects().first().map(|entry| entry.id);
    match step {
        Step::Look { x, y, length, confidence, gone } => {
            let things = [
                Thing::block([*length, 0.03, 0.04]).at(*x, *y, 0.0).sure(*confidence),
                Thing::mat(0.1, 0.1).at(0.1, 0.1, 0.0),
            ];
            let views: Vec<_> =
                first.filter(|_| *gone).map(|id| (id, Visibility::SeenThrough, 0.9)).into_iter().collect();
            let hand = if memory.view().held().is_some() { gripping_hand(seconds) } else { open_hand(seconds) };
            look(memory, number as u64, seconds, &things, &views, &hand).map(drop)
        }
        Step::Pick { fails } => {
            let Some(executed) = first.and_then(|id| report(&*memory.view(), "pick", id, seconds)) else {
                return Ok(());
            };
            let executed = if *fails { executed.failing(FailureCause::Grasp, "slipped") } else { executed.holding() };
            memory.record(&executed).map(drop)
        }
        Step::Place { x } => {
            let view = memory.view();
            let held = view.objects().iter().find(|entry| entry.presence == Presence::Held).map(|entry| entry.id);
            let Some(executed) = held.and_then(|id| report(&*view, "place", id, seconds)) else { return Ok(()) };
            let mut place = acm_concept::literal::Place {
                support: None,
                pose: Default::default(),
                tolerance_m: 0.03,
                heading_tolerance_rad: None,
            };
            place.pose.translation.x = *x;
            memory.record(&executed.leaving(place)).map(drop)
        }
        Step::Settle => match memory.view().transitions().last().map(|transition| transition.id) {
            Some(id) => verify(memory, id).map(drop),
            None => Ok(()),
        },
        Step::Note(index) => memory.note(&Note::SubtaskDone { time: Time::from_seconds(seconds), index: *index }),
        // One call: what `begin` does is two.
        Step::Begin => memory.note(&Note::EpisodeBegan),
        Step::Wipe => memory.wipe(),
    }
}

/// The log's bytes after each acknowledged call, with the state then.
fn states(dir: &Path, steps: &[Step]) -> Vec<(u64, crate::state::State)> {
    let mut memory = open(dir).unwrap();
    let mut states = vec![(BLOCK, memory.state().clone())];
    for (number, step) in steps.iter().enumerate() {
        perform(&mut memory, number, step).unwrap();
        if matches!(step, Step::Wipe) {
            states.clear();
        }
        states.push((fs::metadata(log_of(dir)).unwrap().len(), memory.state().clone()));
    }
    states
}

/// All objects as of some moments of the last runs, each as it was known at some of them.
fn since(memory: &AcmMemory, run: u32, keep_runs: u32) -> Vec<Option<acm_store::history::Past>> {
    let mut moments = vec![u64::MAX];
    for run in (run + 1).saturating_sub(keep_runs)..=run {
        let at = |seconds: u32| crate::entry::Moment { episode: run, time: Time::from_seconds(seconds.into()) };
        moments.extend((0..20).map(|half| crate::store_time(at(2 * half)).unwrap()));
    }
    let columns = memory.columns();
    let ids = 0..=memory.state().next.object as u32;
    let pairs = || moments.iter().flat_map(|valid| moments.iter().map(move |known| (*valid, *known)));
    ids.flat_map(|id| pairs().map(move |(v, k)| columns.as_of(id, v, k).filter(|past| past.there))).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn reopening_gives_the_same_state(steps in steps(24)) {
        let dir = tempfile::tempdir().unwrap();
        let states = states(dir.path(), &steps);
        let reopened = open(dir.path()).unwrap();
        prop_assert_eq!(reopened.state(), &states.last().unwrap().1);
    }

    #[test]
    fn a_compacted_log_comes_to_the_same(steps in steps(40), keep_runs in 0..3u32) {
        let dir = tempfile::tempdir().unwrap();
        let mut memory = open(dir.path()).unwrap();
        for (number, step) in steps.iter().enumerate() {
            perform(&mut memory, number, step).unwrap();
        }
        let (state, run) = (memory.state().clone(), memory.state().next.episode);
        let known = since(&memory, run, keep_runs);
        let done = memory.compact(keep_runs).unwrap();
        prop_assert!(done.bytes.1 <= done.bytes.0, "{:?}", done);
        prop_assert_eq!(memory.state(), &state);
        prop_assert_eq!(&since(&memory, run, keep_runs), &known);
        drop(memory);
        let mut memory = open(dir.path()).unwrap();
        prop_assert_eq!(memory.state(), &state);
        prop_assert_eq!(&since(&memory, run, keep_runs), &known);
        // It goes on, and can be forgotten from.
        for (number, step) in steps.iter().enumerate().take(8) {
            perform(&mut memory, 100 + number, step).unwrap();
        }
        let gone: Vec<_> = memory.view().objects().iter().take(1).map(|entry| entry.id).collect();
        memory.erase(&gone).unwrap();
        memory.compact(0).unwrap();
        let left = memory.state().clone();
        prop_assert!(gone.iter().all(|id| left.object(*id).is_none()));
        drop(memory);
        let again = open(dir.path()).unwrap();
        prop_assert_eq!(again.state(), &left);
    }

    #[test]
    fn a_cut_anywhere_loses_only_what_was_not_acknowledged(steps in steps(16), place in any::<prop::sample::Index>()) {
        let dir = tempfile::tempdir().unwrap();
        let states = states(dir.path(), &steps);
        check_cut(dir.path(), &states, BLOCK + place.index((states.last().unwrap().0 - BLOCK) as usize + 1) as u64);
    }
}

fn check_cut(dir: &Path, states: &[(u64, crate::state::State)], cut: u64) {
    let log = log_of(dir);
    let whole = fs::read(&log).unwrap();
    fs::write(&log, &whole[..cut as usize]).unwrap();
    let reopened = open(dir).unwrap();
    // A wiped log begins with the wipe; cut before its end it is empty, as nothing is acknowledged in it.
    let empty = (BLOCK, crate::state::State::default());
    let (end, expected) = states.iter().rev().find(|(end, _)| *end <= cut).unwrap_or(&empty);
    // A commit that lost but the zeros behind it is whole.
    let length = fs::metadata(&log).unwrap().len();
    let padded = states.iter().find(|(end, _)| *end > cut && end - cut < BLOCK);
    let padded = padded.filter(|(end, state)| reopened.state() == state && length == *end);
    let (end, expected) = padded.map_or((end, expected), |(end, state)| (end, state));
    assert_eq!(reopened.state(), expected, "cut at {cut}");
    assert_eq!(length, *end, "the torn tail is gone");
    drop(reopened);
    fs::write(&log, whole).unwrap();
}

#[test]
fn a_cut_at_every_byte_of_the_last_batches_is_repaired() {
    let dir = tempfile::tempdir().unwrap();
    let look = |x, gone| Step::Look { x, y: 0.1, length: 0.05, confidence: 0.9, gone };
    let steps = [
        Step::Begin,
        look(0.0, false),
        look(0.0, false),
        Step::Pick { fails: false },
        Step::Place { x: 0.2 },
        look(0.2, false),
        Step::Settle,
        Step::Note(0),
    ];
    let states = states(dir.path(), &steps);
    let begin = states[states.len() - 3].0;
    for cut in begin..=states.last().unwrap().0 {
        check_cut(dir.path(), &states, cut);
    }
}

#[test]
fn writing_goes_on_after_a_repair() {
    let dir = tempfile::tempdir().unwrap();
    let mut memory = open(dir.path()).unwrap();
    begin(&mut memory).unwrap();
    drop(memory);
    let log = log_of(dir.path());
    let mut bytes = fs::read(&log).unwrap();
    bytes.extend([7u8; 100]);
    fs::write(&log, bytes).unwrap();
    let mut memory = open(dir.path()).unwrap();
    look(&mut memory, 0, 0.0, &[Thing::can(0.03, 0.1)], &[], &open_hand(0.0)).unwrap();
    let state = memory.state().clone();
    drop(memory);
    assert_eq!(open(dir.path()).unwrap().state(), &state);
}

#[test]
fn damage_to_what_was_acknowledged_is_an_error_and_leaves_the_file_alone() {
    let dir = tempfile::tempdir().unwrap();
    let states = states(dir.path(), &[Step::Begin, Step::Note(0), Step::Note(1)]);
    let log = log_of(dir.path());
    let whole = fs::read(&log).unwrap();
    for at in [3, 20, states[1].0 as usize + 12, states[2].0 as usize + 40] {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x10;
        fs::write(&log, &damaged).unwrap();
        let error = open(dir.path()).unwrap_err();
        assert!(matches!(error, MemoryError::Record { .. }), "{error}");
        assert!(error.to_string().contains("damaged"), "{error}");
        assert_eq!(fs::read(&log).unwrap(), damaged);
    }
}

#[test]
fn blocks_that_a_power_failure_kept_from_the_disk_are_a_torn_tail() {
    let dir = tempfile::tempdir().unwrap();
    let look = Step::Look { x: 0.0, y: 0.0, length: 0.05, confidence: 0.9, gone: false };
    let states = states(dir.path(), &[Step::Begin, look]);
    let log = log_of(dir.path());
    let mut bytes = fs::read(&log).unwrap();
    let begin = states[1].0 as usize;
    bytes[begin..begin + 512].fill(0);
    fs::write(&log, bytes).unwrap();
    assert_eq!(open(dir.path()).unwrap().state(), &states[1].1);
}

#[test]
fn another_format_is_refused_with_both_numbers() {
    let dir = tempfile::tempdir().unwrap();
    drop(open(dir.path()).unwrap());
    fs::write(dir.path().join("FORMAT"), "acm-memory 7\n").unwrap();
    let error = open(dir.path()).unwrap_err();
    assert!(matches!(error, MemoryError::Format { found: 7, known: FORMAT, .. }), "{error}");
    fs::write(dir.path().join("FORMAT"), "something else").unwrap();
    assert!(matches!(open(dir.path()).unwrap_err(), MemoryError::Record { .. }));
}

#[test]
fn a_second_writer_is_refused_until_the_first_is_gone() {
    let dir = tempfile::tempdir().unwrap();
    let first = open(dir.path()).unwrap();
    assert!(matches!(open(dir.path()).unwrap_err(), MemoryError::Locked { .. }));
    drop(first);
    assert!(open(dir.path()).is_ok());
}

#[test]
fn a_transplanted_memory_believes_what_its_donor_believed() {
    let dir = tempfile::tempdir().unwrap();
    let (donor, own) = (dir.path().join("donor"), dir.path().join("own"));
    let mut memory = open(&donor).unwrap();
    begin(&mut memory).unwrap();
    look(&mut memory, 0, 0.0, &[Thing::can(0.03, 0.1)], &[], &open_hand(0.0)).unwrap();
    assert!(matches!(crate::read_events(&donor), Err(MemoryError::Locked { .. })));
    let believed = memory.state().clone();
    drop(memory);
    let events = crate::read_events(&donor).unwrap();

    let mut memory = open(&own).unwrap();
    begin(&mut memory).unwrap();
    look(&mut memory, 0, 0.0, &[Thing::block([0.05, 0.04, 0.03])], &[], &open_hand(0.0)).unwrap();
    assert!(contains(&own, b"\"block\""));
    memory.transplant(&events).unwrap();
    assert_eq!(memory.state(), &believed);
    drop(memory);
    assert_eq!(open(&own).unwrap().state(), &believed);
    assert!(contains(&own, b"cylinder") && !contains(&own, b"\"block\""));
    assert!(matches!(crate::read_events(&dir.path().join("nothing")), Err(MemoryError::Missing { .. })));
}

#[test]
fn what_was_wiped_is_in_no_file() {
    let dir = tempfile::tempdir().unwrap();
    let mut memory = open(dir.path()).unwrap();
    begin(&mut memory).unwrap();
    look(&mut memory, 0, 0.0, &[Thing::can(0.03, 0.1)], &[], &open_hand(0.0)).unwrap();
    assert!(contains(dir.path(), b"cylinder"));
    memory.wipe().unwrap();
    assert!(!contains(dir.path(), b"cylinder"));
    look(&mut memory, 1, 1.0, &[Thing::block([0.05, 0.04, 0.03])], &[], &open_hand(1.0)).unwrap();
    let state = memory.state().clone();
    drop(memory);
    let reopened = open(dir.path()).unwrap();
    assert_eq!(reopened.state(), &state);
    assert_eq!(reopened.view().objects().iter().map(|entry| entry.id.0).collect::<Vec<_>>(), [2]);
}

fn contains(dir: &Path, text: &[u8]) -> bool {
    let files = fs::read_dir(dir).unwrap().map(|entry| fs::read(entry.unwrap().path()).unwrap());
    files.into_iter().any(|bytes| bytes.windows(text.len()).any(|window| window == text))
}

#[test]
fn a_report_that_cannot_be_read_back_is_refused_and_changes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let mut memory = open(dir.path()).unwrap();
    begin(&mut memory).unwrap();
    look(&mut memory, 0, 0.0, &[Thing::can(0.03, 0.1)], &[], &open_hand(0.0)).unwrap();
    let before = memory.state().clone();
    let mut executed = report(&*memory.view(), "pick", ObjectId(1), 2.0).unwrap();
    executed.report.measured.insert("grip_width_m".into(), f64::NAN);
    assert!(matches!(memory.record(&executed), Err(MemoryError::Record { .. })));
    assert_eq!(memory.state(), &before);
    drop(memory);
    assert_eq!(open(dir.path()).unwrap().state(), &before);
}

#[test]
fn settling_what_was_never_recorded_is_an_error() {
    let mut memory = memory();
    assert!(matches!(verify(&mut memory, acm_concept::ids::TransitionId(3)), Err(MemoryError::UnknownTransition(_))));
}

#[test]
fn what_was_erased_is_in_no_file_and_what_is_left_is_as_if_it_had_never_been() {
    let dir = tempfile::tempdir().unwrap();
    let mut memory = open(dir.path()).unwrap();
    begin(&mut memory).unwrap();
    let things = [Thing::can(0.03, 0.1).at(0.0, 0.0, 0.0), Thing::block([0.05, 0.04, 0.03]).at(0.3, 0.2, 0.0)];
    look(&mut memory, 0, 0.0, &things, &[], &open_hand(0.0)).unwrap();
    look(&mut memory, 1, 1.0, &things, &[], &open_hand(1.0)).unwrap();
    let view = memory.view();
    let can = view.objects().iter().find(|entry| entry.parts[0].template == "cylinder").unwrap().id;
    let executed = report(&*view, "pick", can, 2.0).unwrap();
    memory.record(&executed.failing(FailureCause::Grasp, "slipped")).unwrap();
    memory.write_snapshot().unwrap();
    let token = format!("\"{can}\"");
    assert!(contains(dir.path(), token.as_bytes()));
    memory.erase(&[can]).unwrap();
    assert!(memory.view().object(can).is_none() && memory.view().objects().len() == 1);
    assert!(memory.view().transitions().is_empty());
    assert!(!contains(dir.path(), token.as_bytes()) && !contains(dir.path(), b"slipped"));
    assert_eq!(memory.columns().ids().count(), 1);
    let objects = memory.state().objects.clone();
    drop(memory);
    assert_eq!(open(dir.path()).unwrap().state().objects, objects);
}

#[test]
fn the_engines_columns_hold_what_is_believed() {
    let dir = tempfile::tempdir().unwrap();
    let look = |x, gone| Step::Look { x, y: 0.1, length: 0.05, confidence: 0.9, gone };
    let steps = [
        Step::Begin,
        look(0.0, false),
        look(0.0, false),
        Step::Pick { fails: false },
        Step::Place { x: 0.2 },
        look(0.2, false),
        Step::Begin,
        look(0.2, true),
    ];
    let mut memory = open(dir.path()).unwrap();
    for (number, step) in steps.iter().enumerate() {
        perform(&mut memory, number, step).unwrap();
        check_columns(&memory);
    }
    drop(memory);
    check_columns(&open(dir.path()).unwrap());
}

/// Presence, place, support, confidence, parts and states are the same in the columns and in the state.
fn check_columns(memory: &AcmMemory) {
    use acm_store::{Kind, event::Sure};
    let (columns, view) = (memory.columns(), memory.view());
    assert_eq!(
        columns.ids().map(u64::from).collect::<Vec<_>>(),
        view.objects().iter().map(|o| o.id.0).collect::<Vec<_>>()
    );
    for entry in view.objects() {
        let id = crate::narrow(entry.id).unwrap();
        let object = columns.object(id).unwrap();
        assert_eq!(columns.symbols.word(object.category), entry.category);
        assert_eq!(object.position, entry.pose().unwrap().translation.as_vec3().to_array());
        assert!((f64::from(object.confidence) - entry.confidence).abs() < 1e-3);
        assert_eq!(object.parts.len(), entry.parts.len());
        for (word, presence) in
            [("present", Presence::Present), ("held", Presence::Held), ("missing", Presence::Missing)]
        {
            let state = columns.symbols.find(Kind::State, word).unwrap();
            assert_eq!(columns.sure(id, state) == Sure::Yes, entry.presence == presence, "{id} {word}");
        }
        let on = columns.symbols.find(Kind::Relation, "on").unwrap();
        let supports: Vec<u64> = columns.relations.objects(id, on).map(u64::from).collect();
        assert_eq!(supports, entry.support.iter().map(|id| id.0).collect::<Vec<_>>());
        // What the past of the columns says of the present is the present.
        let past = columns.as_of(id, u64::MAX, u64::MAX).unwrap();
        assert_eq!((past.position, past.there), (object.position, true));
    }
}

#[test]
fn a_policy_forgets_by_age_count_and_confidence() {
    let mut memory = memory();
    let things = [
        Thing::mat(0.1, 0.1).at(0.0, 0.0, 0.0),
        Thing::can(0.03, 0.1).at(0.3, 0.0, 0.0),
        Thing::button(0.02, 0.02).at(0.0, 0.3, 0.0),
        Thing::block([0.04, 0.03, 0.04]).at(0.3, 0.3, 0.0),
    ];
    // One thing less a run: the camera looks past it.
    for run in 0..4usize {
        let past: Vec<_> = (1..=run as u64).map(|id| (ObjectId(id), Visibility::OutOfView, 0.0)).collect();
        for frame in 0..3 {
            look(&mut memory, 10 * run as u64 + frame, 1.0, &things[run..], &past, &open_hand(1.0)).unwrap();
        }
        if run < 3 {
            begin(&mut memory).unwrap();
        }
    }
    let ids = |numbers: &[u64]| numbers.iter().map(|number| ObjectId(*number)).collect::<Vec<_>>();
    let none = Policy::default();
    let seen: Vec<_> = memory.view().objects().iter().map(|o| (o.id.0, o.last_seen.episode)).collect();
    assert_eq!(seen, [(1, 1), (2, 2), (3, 3), (4, 4)]);
    assert_eq!(memory.due(&none), []);
    assert_eq!(memory.due(&Policy { older_than_runs: Some(2), ..none }), ids(&[1, 2]));
    assert_eq!(memory.due(&Policy { keep_most: Some(1), ..none }), ids(&[1, 2, 3]));
    assert_eq!(memory.due(&Policy { keep_most: Some(9), ..none }), []);
    let confidence = |id: u64| object(&memory, ObjectId(id)).confidence;
    let between = 0.5 * (confidence(1) + confidence(2));
    assert_eq!(memory.due(&Policy { below_confidence: Some(between), ..none }), ids(&[1]));
    // What is in the hand stays, and counts.
    let held = report(&*memory.view(), "pick", ObjectId(4), 2.0).unwrap().holding();
    memory.record(&held).unwrap();
    assert_eq!(memory.due(&Policy { keep_most: Some(2), below_confidence: Some(2.0), ..none }), ids(&[1, 2, 3]));
    assert_eq!(memory.due(&Policy { keep_most: Some(2), ..none }), ids(&[1, 2]));
    let due = memory.due(&Policy { older_than_runs: Some(1), ..none });
    memory.erase(&due).unwrap();
    assert_eq!(memory.view().objects().len(), 1);
}
