//! The paper's closed loop on the put-back task, told to memory step by step.

use super::*;
use crate::MemoryView;
use crate::{
    Snapshot,
    entry::{Presence, TransitionResult},
    observation::{Executed, Note, Outcome},
    query::{ObjectQuery, PlaceReference, Recall},
    staging::{Thing, gripping_hand, look, open_hand, report, verify},
};
use acm_concept::{
    ids::TransitionId,
    literal::{Evidence, Place},
    object::Visibility,
    pose::Pose,
    skill::FailureCause,
    time::Time,
};
use glam::DVec3;

const MATS: [(f64, f64); 4] = [(0.0, -0.1), (0.2, -0.1), (0.1, -0.2), (0.1, 0.0)];

fn scene(block: Option<(f64, f64)>) -> Vec<Thing> {
    let mats = MATS.map(|(x, y)| Thing::mat(0.08, 0.08).at(x, y, 0.0).colored([120, 160, 120]));
    let button = Thing::button(0.03, 0.012).at(-0.25, -0.1, 0.0).colored([220, 200, 40]);
    let block = block.map(|(x, y)| Thing::block([0.04, 0.04, 0.04]).at(x, y, 0.002).colored(RED));
    mats.into_iter().chain([button]).chain(block).collect()
}

fn find(view: &dyn MemoryView, noun: &str) -> ObjectId {
    let query = ObjectQuery { nouns: vec![noun.into()], ..Default::default() };
    view.retrieve(&query).hits.first().expect("a hit").object
}

fn place_at(x: f64, y: f64) -> Place {
    Place {
        support: None,
        pose: Pose::from_translation(DVec3::new(x, y, 0.001)),
        tolerance_m: 0.03,
        heading_tolerance_rad: None,
    }
}

/// The look after a skill: when it ended, the frame's number, where the block is seen.
struct After(f64, u64, Option<(f64, f64)>);

/// Runs one skill: predicted by the template, reported, looked at, judged.
fn act(
    memory: &mut AcmMemory,
    skill: &str,
    on: ObjectId,
    to: Option<Place>,
    After(at_s, frame, block_seen): After,
    finish: impl FnOnce(Executed) -> Executed,
) -> (TransitionId, Outcome) {
    let view = memory.snapshot();
    let candidates = view.skill_candidates(on, to);
    let candidate = candidates.iter().find(|c| c.skill == skill).expect("the template binds the skill");
    assert!(view.applicable(&candidate.preconditions).holds(), "{:?}", view.applicable(&candidate.preconditions));
    let executed = finish(report(&view, skill, on, at_s).unwrap().predicting(candidate));
    let id = memory.record(&executed).unwrap();
    let held = memory.view().held().is_some();
    let hand = if held { gripping_hand(at_s) } else { open_hand(at_s) };
    look(memory, frame, at_s + 0.1, &scene(block_seen), &[], &hand).unwrap();
    let outcome = verify(memory, id).unwrap();
    (id, outcome)
}

/// Watches the scene and brings the block from its mat to the middle.
fn bring_to_the_middle(memory: &mut AcmMemory, start: (f64, f64)) -> (ObjectId, ObjectId) {
    look(memory, 0, 0.1, &scene(Some(start)), &[], &open_hand(0.1)).unwrap();
    look(memory, 1, 0.2, &scene(Some(start)), &[], &open_hand(0.2)).unwrap();
    let view = memory.view();
    let (block, button) = (find(&*view, "block"), find(&*view, "button"));
    assert_eq!(truth(memory, &format!("moved({block})")), Truth::No);
    let (_, outcome) = act(memory, "pick", block, None, After(3.0, 2, None), |executed| executed.holding());
    assert_eq!(outcome, Outcome::Verified);
    assert_eq!(object(memory, block).presence, Presence::Held);
    assert_eq!(truth(memory, &format!("holding({block})")), Truth::Yes);
    let middle = place_at(0.1, -0.1);
    let (_, outcome) = act(memory, "place", block, Some(middle), After(6.0, 3, Some((0.103, -0.098))), |executed| {
        executed.leaving(middle)
    });
    assert_eq!(outcome, Outcome::Verified);
    memory.note(&Note::SubtaskDone { time: Time::from_seconds(6.1), index: 0 }).unwrap();
    (block, button)
}

#[test]
fn the_block_is_put_back_where_it_came_from() {
    for start in MATS {
        let mut memory = memory();
        let (block, button) = bring_to_the_middle(&mut memory, start);
        assert_eq!(truth(&memory, &format!("pressed({button})")), Truth::No);
        let pressed = Literal::parse(&format!("pressed({button})")).unwrap();
        let (_, outcome) = act(&mut memory, "press", button, None, After(9.0, 4, Some((0.102, -0.099))), |executed| {
            executed.feeling(pressed.clone())
        });
        assert_eq!(outcome, Outcome::Verified);
        memory.note(&Note::SubtaskDone { time: Time::from_seconds(9.1), index: 1 }).unwrap();
        assert_eq!(truth(&memory, &pressed.to_string()), Truth::No, "the press served the subtask before");

        let view = memory.snapshot();
        let Recall::Known { value, confidence, evidence } = view.recall_place(block, PlaceReference::BeforeMoved)
        else {
            panic!("the origin was seen: {:?}", view.recall_place(block, PlaceReference::BeforeMoved));
        };
        let from = value.pose.translation;
        assert!((from.x - start.0).abs() < 0.005 && (from.y - start.1).abs() < 0.005, "{from} for {start:?}");
        assert!(confidence > 0.8);
        assert!(evidence.contains(&Evidence::Transition(TransitionId(1))), "{evidence:?}");
        let mat = value.support.expect("it stood on a mat");
        assert_eq!(object(&memory, mat).parts[0].template, "mat");

        act(&mut memory, "pick", block, None, After(12.0, 5, None), |executed| executed.holding());
        let (last, outcome) = act(&mut memory, "place", block, Some(value), After(15.0, 6, Some(start)), |executed| {
            executed.leaving(value)
        });
        assert_eq!(outcome, Outcome::Verified);
        assert_eq!(truth(&memory, &format!("on({block}, {mat})")), Truth::Yes);
        check_what_was_learned(&memory, block, last);
    }
}

fn check_what_was_learned(memory: &AcmMemory, block: ObjectId, last: TransitionId) {
    let view = memory.snapshot();
    let place = view.skills().iter().find(|skill| skill.skill == "place").unwrap();
    assert_eq!((place.tries, place.successes, place.template.as_str()), (2, 2, "box"));
    assert_eq!(place.parameters, [("grip_width".to_string(), 0.04)]);
    assert_eq!(place.transitions.last(), Some(&last));
    let candidate = view.skill_candidates(block, Some(place_at(0.0, 0.0))).remove(0);
    let prediction = view.predict(&candidate);
    assert_eq!((prediction.tries, prediction.successes), (2, 2));
    assert!((prediction.success - 0.75).abs() < 1e-12);
    let transition = view.transitions().iter().find(|t| t.id == last).unwrap();
    assert_eq!(transition.result, TransitionResult::Verified);
    assert!(transition.before.iter().any(|l| l.to_string() == format!("holding({block})")), "{:?}", transition.before);
    assert!(transition.after.iter().any(|l| l.to_string() == "hand-empty()"), "{:?}", transition.after);
}

#[test]
fn a_wiped_memory_says_what_it_does_not_know() {
    let mut memory = memory();
    bring_to_the_middle(&mut memory, MATS[2]);
    memory.wipe().unwrap();
    let view = memory.view();
    assert!(view.objects().is_empty() && view.transitions().is_empty() && view.skills().is_empty());
    assert_eq!(view.progress().current(), 0);
    for frame in 10..20 {
        let jitter = 0.003 * f64::from(frame % 3);
        let seconds = f64::from(frame);
        look(&mut memory, frame as u64, seconds, &scene(Some((0.1 + jitter, -0.1))), &[], &open_hand(seconds)).unwrap();
    }
    let view = memory.view();
    let block = find(&*view, "block");
    assert!(block.0 > 6, "an id was given twice: {block}");
    for reference in [PlaceReference::BeforeMoved, PlaceReference::AtStart] {
        let Recall::Unknown { reason, candidates } = view.recall_place(block, reference) else {
            panic!("nothing of its past is known");
        };
        assert!(reason.contains("do not know"), "{reason}");
        assert_eq!(candidates.len(), 4, "the four mats, and neither the button nor the block itself");
        assert!(candidates.iter().all(|(place, p)| *p == 0.25 && place.support.is_some()));
    }
    let button = find(&*view, "button");
    assert_eq!(truth(&memory, &format!("pressed({button})")), Truth::Unknown);
}

#[test]
fn a_block_that_slipped_away_unseen_is_never_believed_to_be_held_or_placed() {
    let mut memory = memory();
    look(&mut memory, 0, 0.1, &scene(Some(MATS[0])), &[], &open_hand(0.1)).unwrap();
    look(&mut memory, 1, 0.2, &scene(Some(MATS[0])), &[], &open_hand(0.2)).unwrap();
    let block = find(&*memory.view(), "block");
    act(&mut memory, "pick", block, None, After(3.0, 2, None), |executed| executed.holding());
    let middle = place_at(0.1, -0.1);
    let view = memory.snapshot();
    let candidate = view.skill_candidates(block, Some(middle)).into_iter().find(|c| c.skill == "place").unwrap();
    let lost = Literal::parse(&format!("not holding({block})")).unwrap();
    let executed = report(&view, "place", block, 6.0).unwrap().predicting(&candidate);
    let executed = executed.feeling(lost).failing(FailureCause::Grasp, "the fingers closed on nothing");
    let id = memory.record(&executed).unwrap();
    assert_eq!(object(&memory, block).presence, Presence::Missing);
    assert_eq!(truth(&memory, &format!("holding({block})")), Truth::No);
    assert_eq!(truth(&memory, "hand-empty()"), Truth::Yes);
    let place_literal = Literal { predicate: "at".into(), ..candidate.effects[0].clone() };
    assert_eq!(memory.view().belief(&place_literal).truth, Truth::Unknown);
    assert_eq!(verify(&mut memory, id).unwrap(), Outcome::Contradicted);
    assert!(matches!(
        memory.view().transitions().last().unwrap().result,
        TransitionResult::Failed { cause: FailureCause::Grasp, .. }
    ));
    // It is found elsewhere: the same block, and still known to have come from its mat.
    let grounding = look(&mut memory, 4, 6.5, &scene(Some((-0.05, -0.2))), &[], &open_hand(6.5)).unwrap();
    assert!(grounding.resolved.iter().any(|found| found.object == block && !found.new));
    assert_eq!(object(&memory, block).presence, Presence::Present);
    let Recall::Known { value, .. } = memory.view().recall_place(block, PlaceReference::BeforeMoved) else {
        panic!("its first place was seen");
    };
    assert!(value.pose.translation.truncate().distance(glam::DVec2::new(0.0, -0.1)) < 0.005);
    assert_eq!(
        memory.view().skills().iter().find(|s| s.skill == "place").map(|s| (s.tries, s.successes)),
        Some((1, 0))
    );
}

#[test]
fn fingers_that_feel_nothing_end_the_hold_even_if_no_report_says_so() {
    let mut memory = memory();
    look(&mut memory, 0, 0.1, &scene(Some(MATS[0])), &[], &open_hand(0.1)).unwrap();
    let block = find(&*memory.view(), "block");
    act(&mut memory, "pick", block, None, After(3.0, 1, None), |executed| executed.holding());
    // Not seen at its old place, and looked through there: it is in the hand.
    let views = [(block, Visibility::SeenThrough, 1.0)];
    let grounding = look(&mut memory, 2, 4.0, &scene(None), &views, &gripping_hand(4.0)).unwrap();
    assert!(grounding.missing.is_empty());
    assert_eq!(object(&memory, block).presence, Presence::Held);
    look(&mut memory, 3, 5.0, &scene(None), &[], &open_hand(5.0)).unwrap();
    assert_eq!(object(&memory, block).presence, Presence::Missing);
}

#[test]
fn a_placed_block_is_not_believed_there_before_it_is_seen() {
    let mut memory = memory();
    look(&mut memory, 0, 0.1, &scene(Some(MATS[0])), &[], &open_hand(0.1)).unwrap();
    let block = find(&*memory.view(), "block");
    act(&mut memory, "pick", block, None, After(3.0, 1, None), |executed| executed.holding());
    let there = place_at(0.1, -0.1);
    let executed = report(&*memory.view(), "place", block, 6.0).unwrap().leaving(there);
    memory.record(&executed).unwrap();
    let at =
        Literal::new("at", vec![acm_concept::literal::Term::Object(block), acm_concept::literal::Term::Place(there)]);
    let view: Snapshot = memory.snapshot();
    assert_eq!(view.belief(&at).truth, Truth::Unknown);
    assert_eq!(view.belief(&at.clone().negate()).truth, Truth::Unknown);
    look(&mut memory, 2, 6.1, &scene(Some((0.1, -0.1))), &[], &open_hand(6.1)).unwrap();
    let belief = memory.view().belief(&at);
    assert!(belief.truth == Truth::Yes && belief.confidence > 0.8, "{belief:?}");
    assert_eq!(view.belief(&at).truth, Truth::Unknown, "a view changed under its reader");
    // Put down 5 cm beside it is not there.
    look(&mut memory, 3, 6.2, &scene(Some((0.15, -0.1))), &[(block, Visibility::SeenThrough, 0.9)], &open_hand(6.2))
        .unwrap();
    assert_eq!(memory.view().belief(&at).truth, Truth::No);
}

#[test]
fn a_memory_that_saw_nothing_knows_nothing() {
    let memory = memory();
    for literal in [
        "on(O1, O2)",
        "holding(O1)",
        "hand-empty()",
        "clear(O1)",
        "visible(O1)",
        "graspable(O1)",
        "moved(O1)",
        "flies(O1)",
    ] {
        assert_eq!(truth(&memory, literal), Truth::Unknown, "{literal}");
        assert_eq!(truth(&memory, &format!("not {literal}")), Truth::Unknown, "{literal}");
    }
    let recall = memory.view().recall_place(ObjectId(1), PlaceReference::Now);
    assert!(matches!(recall, Recall::Unknown { candidates, .. } if candidates.is_empty()));
}
