//! The methods on one story: what each of them can and cannot know.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a failed step is a failed test

use crate::{METHODS, by_name};
use acm_concept::{
    ids::{FrameId, ObjectId},
    literal::{Evidence, Literal, Place, Truth},
    object::Visibility,
    pose::Pose,
};
use acm_memory::{
    Memory, default_library,
    query::{ObjectQuery, PlaceReference, Recall},
    staging::{Thing, begin, gripping_hand, look, look_blind, open_hand, report, verify},
};
use std::sync::{Arc, LazyLock};

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

#[test]
fn only_memories_with_a_past_know_where_the_block_came_from() {
    for start in MATS {
        for name in METHODS {
            let mut memory = method(name);
            let block = bring_to_the_middle(&mut *memory, start);
            match (name, memory.view().recall_place(block, PlaceReference::BeforeMoved)) {
                ("reactive", Recall::Unknown { reason, candidates }) => {
                    assert!(reason.contains("do not show where"), "{reason}");
                    assert_eq!(candidates.iter().map(|(_, p)| *p).collect::<Vec<_>>(), [0.25; 4]);
                }
                ("reactive", known) => panic!("a memory without a past cannot know: {known:?}"),
                (_, Recall::Known { value, evidence, .. }) => {
                    let at = value.pose.translation;
                    assert!((at.x - start.0).abs() < 0.01 && (at.y - start.1).abs() < 0.01, "{name}: {at}");
                    assert!(evidence.contains(&Evidence::Frame(FrameId(0))), "{name}: {evidence:?}");
                }
                (_, unknown) => panic!("{name} saw it: {unknown:?}"),
            }
        }
    }
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
        let recall = memory.view().recall_place(block_of(&*memory), PlaceReference::BeforeMoved);
        assert!(matches!(&recall, Recall::Unknown { candidates, .. } if candidates.len() == 4), "{name}: {recall:?}");
    }
}

#[test]
fn a_memory_without_a_past_forgets_what_is_out_of_sight() {
    for name in ["reactive", "first-frame"] {
        let mut memory = method(name);
        let block = bring_to_the_middle(&mut *memory, MATS[0]);
        assert_eq!(memory.view().transitions().len(), 1, "{name}");
        assert!(memory.view().skills().is_empty());
        assert!(memory.view().objects().iter().all(|entry| entry.history.len() == 1));
        assert_eq!(memory.view().belief(&Literal::parse(&format!("moved({block})")).unwrap()).truth, Truth::Unknown);
        look(&mut *memory, 3, 7.0, &scene(None), &[], &open_hand(7.0)).unwrap();
        assert!(memory.view().object(block).is_none());
        assert_eq!(memory.view().objects().len(), 5);
        look_blind(&mut *memory, 4, 8.0, &open_hand(8.0)).unwrap();
        assert!(memory.view().objects().is_empty());
    }
}
