//! The methods on one story: what each of them can and cannot know.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a failed step is a failed test

use crate::{FullHistory, METHODS, Perceive, by_name};
use acm_concept::{
    ids::{FrameId, ObjectId},
    literal::{Evidence, Literal, Place, Truth},
    object::Visibility,
    pose::Pose,
};
use acm_memory::{
    Memory, default_library,
    observation::Note,
    query::{ObjectQuery, PlaceReference, Recall},
    staging::{Thing, begin, gripping_hand, look, look_blind, open_hand, report, verify},
};
use std::sync::{Arc, LazyLock, Mutex};

static LIBRARY: LazyLock<Arc<acm_concept::template::TemplateLibrary>> =
    LazyLock::new(|| Arc::new(default_library().unwrap()));

const MATS: [(f64, f64); 4] = [(0.0, -0.1), (0.2, -0.1), (0.1, -0.2), (0.1, 0.0)];

fn scene(block: Option<(f64, f64)>) -> Vec<Thing> {
    let mats = MATS.map(|(x, y)| Thing::mat(0.08, 0.08).at(x, y, 0.0).colored([120, 160, 120]));
    let block = block.map(|(x, y)| Thing::block([0.04, 0.04, 0.04]).at(x, y, 0.001).colored([200, 30, 30]));
    mats.into_iter().chain([Thing::button(0.03, 0.012).at(-0.25, -0.1, 0.0)]).chain(block).collect()
}

fn method(name: &str) -> Box<dyn Memory> {
    let mut memory = by_name(name, Arc::clone(&LIBRARY), None, None).unwrap();
    begin(&mut *memory).unwrap();
    memory
}

fn block_of(memory: &dyn Memory) -> ObjectId {
    let query = ObjectQuery { nouns: vec!["block".into()], ..Default::default() };
    memory.view().retrieve(&query).hits.first().expect("the block is in sight").object
}

/// The block is seen on its mat and brought to the middle by the robot, unless it starts there.
fn bring_to_the_middle(memory: &mut dyn Memory, start: (f64, f64)) -> ObjectId {
    look(memory, 0, 0.0, &scene(Some(start)), &[], &open_hand(0.0)).unwrap();
    let block = block_of(memory);
    let executed = report(&*memory.view(), "pick", block, 3.0).unwrap().holding();
    memory.record(&executed).unwrap();
    look(memory, 1, 3.1, &scene(None), &[(block, Visibility::SeenThrough, 1.0)], &gripping_hand(3.1)).unwrap();
    assert_eq!(memory.view().held().map(|entry| entry.id), Some(block), "{}", memory.name());
    let middle = Place {
        support: None,
        pose: Pose::from_translation((0.1, -0.1, 0.001).into()),
        tolerance_m: 0.03,
        heading_tolerance_rad: None,
    };
    let candidates = memory.view().skill_candidates(block, Some(middle));
    let place = candidates.iter().find(|candidate| candidate.skill == "place").unwrap();
    let executed = report(&*memory.view(), "place", block, 6.0).unwrap().predicting(place).leaving(middle);
    let id = memory.record(&executed).unwrap();
    look(memory, 2, 6.1, &scene(Some((0.1, -0.1))), &[], &open_hand(6.1)).unwrap();
    assert_eq!(verify(memory, id).unwrap(), acm_memory::observation::Outcome::Verified, "{}", memory.name());
    assert_eq!(block_of(memory), block, "{}: the id went on", memory.name());
    block
}

#[test]
fn names_lead_to_methods_of_that_name() {
    for name in METHODS {
        assert_eq!(method(name).name(), name);
    }
    let error = by_name("frist-frame", Arc::clone(&LIBRARY), None, None).err().unwrap().to_string();
    assert!(error.contains("did you mean `first-frame`") && error.contains("paper-identity"), "{error}");
    assert!(!by_name("xyz", Arc::clone(&LIBRARY), None, None).err().unwrap().to_string().contains("did you mean"));
}

/// Whether a method knows where the block came from that it brought to the middle two frames ago; the others must say so.
fn knows_whence(name: &str) -> bool {
    !["reactive", "semantic", "window-2"].contains(&name)
}

fn whence(memory: &dyn Memory, block: ObjectId) -> Recall<Place> {
    memory.view().recall_place(block, PlaceReference::BeforeMoved)
}

#[test]
fn only_memories_with_a_past_know_where_the_block_came_from() {
    for start in MATS {
        for name in METHODS {
            let mut memory = method(name);
            let block = bring_to_the_middle(&mut *memory, start);
            match (knows_whence(name), whence(&*memory, block)) {
                (false, Recall::Unknown { reason, candidates }) => {
                    assert!(reason.contains("I do not know where it came from"), "{name}: {reason}");
                    assert_eq!(candidates.iter().map(|(_, p)| *p).collect::<Vec<_>>(), [0.25; 4], "{name}");
                }
                (false, known) => panic!("{name}: a memory without a past cannot know: {known:?}"),
                (true, Recall::Known { value, evidence, .. }) => {
                    let at = value.pose.translation;
                    let right = (at.x - start.0).abs() < 0.01 && (at.y - start.1).abs() < 0.01;
                    assert_eq!(right, name != "shuffled", "{name}: {at}");
                    let seen = evidence.contains(&Evidence::Frame(FrameId(0)));
                    // Who keeps deeds alone has it from the grasp.
                    assert_eq!(seen, name != "action-log", "{name}: {evidence:?}");
                }
                (true, unknown) => panic!("{name} saw it: {unknown:?}"),
            }
        }
    }
}

#[test]
fn a_summary_in_words_knows_the_mat_and_not_the_spot_on_it() {
    for (name, off) in [("acm", 0.02), ("text-summary", 0.0)] {
        let mut memory = method(name);
        let block = bring_to_the_middle(&mut *memory, (MATS[0].0, MATS[0].1 + 0.02));
        let Recall::Known { value, .. } = whence(&*memory, block) else { panic!("{name} saw it") };
        assert!((value.pose.translation.y - MATS[0].1 - off).abs() < 0.005, "{name}: {}", value.pose.translation);
    }
}

#[test]
fn what_is_out_of_the_window_is_forgotten_and_what_was_an_event_is_not() {
    for name in METHODS {
        let mut memory = method(name);
        let block = bring_to_the_middle(&mut *memory, MATS[2]);
        for frame in 3..13 {
            let seconds = 4.0 + frame as f64;
            look(&mut *memory, frame, seconds, &scene(Some((0.1, -0.1))), &[], &open_hand(seconds)).unwrap();
        }
        let known = matches!(whence(&*memory, block), Recall::Known { .. });
        assert_eq!(known, knows_whence(name) && name != "window", "{name}");
    }
}

#[test]
fn what_someone_else_moved_is_no_deed() {
    for name in METHODS {
        let mut memory = method(name);
        let mut block = None;
        for (frame, at) in [(0, MATS[0]), (1, MATS[0]), (2, MATS[3]), (3, MATS[3])] {
            let gone: Vec<_> =
                block.filter(|_| frame == 2).map(|id| (id, Visibility::SeenThrough, 1.0)).into_iter().collect();
            look(&mut *memory, frame, frame as f64, &scene(Some(at)), &gone, &open_hand(frame as f64)).unwrap();
            block = Some(block_of(&*memory));
        }
        let known = matches!(whence(&*memory, block_of(&*memory)), Recall::Known { .. });
        // By the paper's rule what is found so far away is another thing.
        assert_eq!(known, knows_whence(name) && !["action-log", "paper-identity"].contains(&name), "{name}");
    }
}

#[test]
fn what_is_hidden_is_remembered_by_those_that_keep_what_they_saw() {
    for name in METHODS {
        let mut memory = method(name);
        look(&mut *memory, 0, 0.0, &scene(Some(MATS[1])), &[], &open_hand(0.0)).unwrap();
        let block = block_of(&*memory);
        for frame in 1..5 {
            let hidden = [(block, Visibility::Occluded, 1.0)];
            look(&mut *memory, frame, frame as f64, &scene(None), &hidden, &open_hand(frame as f64)).unwrap();
        }
        let view = memory.view();
        let place = view.object(block).and_then(|entry| entry.place());
        assert_eq!(place.is_some(), !["reactive", "action-log", "window-2"].contains(&name), "{name}: {place:?}");
        if let Some(place) = place {
            assert!((place.pose.translation.x - MATS[1].0).abs() < 0.01, "{name}: {}", place.pose.translation);
        }
        assert_eq!(view.objects().len(), if place.is_some() { 6 } else { 5 }, "{name}");
    }
}

#[test]
fn presses_are_counted_as_far_as_deeds_are_kept() {
    const PRESSES: usize = 11;
    for name in METHODS {
        let mut memory = method(name);
        look(&mut *memory, 0, 0.0, &scene(None), &[], &open_hand(0.0)).unwrap();
        let query = ObjectQuery { nouns: vec!["button".into()], ..Default::default() };
        let button = memory.view().retrieve(&query).hits[0].object;
        for press in 1..=PRESSES {
            let ended = 4.0 * press as f64;
            let executed = report(&*memory.view(), "press", button, ended).unwrap();
            let id = memory.record(&executed).unwrap();
            look(&mut *memory, press as u64, ended + 0.1, &scene(None), &[], &open_hand(ended + 0.1)).unwrap();
            verify(&mut *memory, id).unwrap();
        }
        let wanted = match name {
            "acm" | "paper-identity" | "shuffled" | "action-log" | "text-summary" | "full-history" => PRESSES,
            // The last eight frames, and the deeds between them.
            "window" | "keyframe" => 7,
            // That the button was dealt with, not how often.
            _ => 1,
        };
        assert_eq!(memory.view().transitions().len(), wanted, "{name}");
    }
}

#[test]
fn stored_frames_are_perceived_again_with_the_words_of_the_instruction() {
    let asked = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&asked);
    // A perception that sees nothing at first sight and the block once it is spoken of.
    let perceive: Perceive = Arc::new(move |frame, _, expectation| {
        heard.lock().unwrap().push((frame.header.id, expectation.nouns.clone()));
        let objects = scene(Some(MATS[0])).iter().map(Thing::grounded).collect();
        acm_concept::object::Percepts {
            frame: frame.header.clone(),
            support: Some(acm_memory::staging::table()),
            objects,
            expected: Vec::new(),
            blindness: None,
            depth_fraction: 0.9,
        }
    });
    let mut memory = FullHistory::new(Arc::clone(&LIBRARY), Some(perceive));
    memory.note(&Note::EpisodeBegan).unwrap();
    look(&mut memory, 0, 0.0, &scene(None), &[], &open_hand(0.0)).unwrap();
    look(&mut memory, 1, 0.1, &scene(None), &[], &open_hand(0.1)).unwrap();
    assert_eq!(memory.view().objects().len(), 5);
    let text = "Put the block back.".to_owned();
    memory.note(&Note::Instructed { time: Default::default(), text }).unwrap();
    assert_eq!(memory.view().objects().len(), 6);
    let words: Vec<String> = ["put", "the", "block", "back"].map(str::to_owned).into();
    assert_eq!(*asked.lock().unwrap(), [(FrameId(0), words.clone()), (FrameId(1), words)]);
}

#[test]
fn after_a_wipe_no_method_knows() {
    for name in METHODS {
        let mut memory = method(name);
        bring_to_the_middle(&mut *memory, MATS[1]);
        memory.wipe().unwrap();
        for frame in 3..5 {
            look(&mut *memory, frame, frame as f64 + 4.0, &scene(Some((0.1, -0.1))), &[], &open_hand(7.0)).unwrap();
        }
        let recall = whence(&*memory, block_of(&*memory));
        assert!(matches!(&recall, Recall::Unknown { candidates, .. } if candidates.len() == 4), "{name}: {recall:?}");
        let at_start = memory.view().recall_place(block_of(&*memory), PlaceReference::AtStart);
        assert!(matches!(at_start, Recall::Unknown { .. }), "{name}: {at_start:?}");
    }
}

#[test]
fn a_memory_without_a_past_forgets_what_is_out_of_sight() {
    let mut memory = method("reactive");
    let block = bring_to_the_middle(&mut *memory, MATS[0]);
    assert_eq!(memory.view().transitions().len(), 1);
    assert!(memory.view().skills().is_empty());
    assert!(memory.view().objects().iter().all(|entry| entry.history.len() == 1));
    assert_eq!(memory.view().belief(&Literal::parse(&format!("moved({block})")).unwrap()).truth, Truth::Unknown);
    look(&mut *memory, 3, 7.0, &scene(None), &[], &open_hand(7.0)).unwrap();
    assert!(memory.view().object(block).is_none());
    assert_eq!(memory.view().objects().len(), 5);
    look_blind(&mut *memory, 4, 8.0, &open_hand(8.0)).unwrap();
    assert!(memory.view().objects().is_empty());
}

#[test]
fn a_first_frame_is_the_first_of_its_run() {
    let mut memory = method("first-frame");
    let block = bring_to_the_middle(&mut *memory, MATS[0]);
    assert!(matches!(whence(&*memory, block), Recall::Known { .. }));
    begin(&mut *memory).unwrap();
    look(&mut *memory, 9, 0.0, &scene(Some((0.1, -0.1))), &[], &open_hand(0.0)).unwrap();
    let Recall::Known { value, evidence, .. } = whence(&*memory, block_of(&*memory)) else {
        panic!("the frame shows it")
    };
    assert!((value.pose.translation.x - 0.1).abs() < 0.01, "{}", value.pose.translation);
    assert_eq!(evidence, [Evidence::Frame(FrameId(9))], "the other one was of another run");
}
