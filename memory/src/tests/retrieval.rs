//! Retrieval and skills.

use super::*;
use crate::{
    query::ObjectQuery,
    staging::{Thing, look, open_hand},
};
use acm_concept::{color::Lab, literal::Place, pose::Pose};
use glam::DVec3;

fn seen() -> AcmMemory {
    let mut memory = memory();
    let things = [
        Thing::block([0.04, 0.04, 0.04]).at(0.0, 0.0, 0.0).colored(RED),
        Thing::block([0.04, 0.04, 0.04]).at(0.2, 0.0, 0.0).colored(BLUE),
        Thing::block([0.3, 0.2, 0.2]).at(0.5, 0.5, 0.0).colored(RED),
        Thing::can(0.03, 0.1).at(-0.2, 0.0, 0.0).colored(RED),
        Thing::mat(0.1, 0.1).at(0.0, 0.3, 0.0),
        Thing::button(0.03, 0.012).at(-0.3, 0.3, 0.0),
    ];
    for frame in 0..2 {
        look(&mut memory, frame, 0.0, &things, &[], &open_hand(0.0)).unwrap();
    }
    memory
}

fn ids(memory: &AcmMemory, query: ObjectQuery) -> Vec<u64> {
    memory.view().retrieve(&query).hits.iter().map(|hit| hit.object.0).collect()
}

fn nouns(nouns: &[&str]) -> ObjectQuery {
    ObjectQuery { nouns: nouns.iter().map(|noun| noun.to_string()).collect(), ..Default::default() }
}

#[test]
fn a_cube_is_a_block_and_a_large_box_is_not() {
    let memory = seen();
    assert_eq!(ids(&memory, nouns(&["block"])), [1, 2]);
    let boxes = memory.view().retrieve(&nouns(&["box"]));
    assert_eq!(boxes.hits.len(), 3);
    assert!(boxes.hits.iter().all(|hit| (hit.terms[0].1 - 1.0).abs() < 1e-9), "{boxes:?}");
    assert!(ids(&memory, nouns(&["walrus"])).is_empty());
    assert_eq!(ids(&memory, nouns(&["can", "mat"])).len(), 2);
}

#[test]
fn filters_drop_with_their_name_and_only_the_rest_is_scored() {
    let memory = seen();
    let query = ObjectQuery {
        color: Some((Lab::from_srgb(RED), 30.0)),
        exclude: vec![ObjectId(3)],
        affordance: Some("graspable".into()),
        ..Default::default()
    };
    let answer = memory.view().retrieve(&query);
    assert_eq!(answer.hits.iter().map(|hit| hit.object.0).collect::<Vec<_>>(), [1, 4]);
    assert_eq!(answer.scored, 2);
    let reason = |id| answer.dropped.iter().find(|(o, _)| *o == ObjectId(id)).map(|(_, why)| why.as_str());
    assert_eq!(
        [reason(2), reason(3), reason(5), reason(6)],
        [Some("color"), Some("exclude"), Some("affordance"), Some("affordance")]
    );
    for hit in &answer.hits {
        let product: f64 = hit.terms.iter().map(|(_, value)| value).product();
        assert!((hit.score - product).abs() < 1e-12 && hit.score > 0.0 && hit.score <= 1.0);
    }
    let pressable = ObjectQuery { function: Some("press".into()), ..Default::default() };
    assert_eq!(ids(&memory, pressable), [6]);
}

#[test]
fn the_nearest_of_equals_comes_first() {
    let memory = seen();
    let near = |x: f64| ObjectQuery { near: Some(DVec3::new(x, 0.0, 0.0)), ..nouns(&["cube"]) };
    assert_eq!(ids(&memory, near(0.0)), [1, 2]);
    assert_eq!(ids(&memory, near(0.2)), [2, 1]);
}

#[test]
fn skills_are_bound_to_parts_and_need_their_destination() {
    let view = seen().view();
    let names = |id, to| -> Vec<String> {
        view.skill_candidates(ObjectId(id), to).iter().map(|c| format!("{} {}", c.skill, c.part)).collect()
    };
    assert_eq!(names(1, None), ["pick P1.0"]);
    let to = Place { support: None, pose: Pose::IDENTITY, tolerance_m: 0.03, heading_tolerance_rad: None };
    assert_eq!(names(1, Some(to)), ["pick P1.0", "place P1.0"]);
    assert_eq!(names(6, None), ["press P6.0"]);
    assert!(names(5, Some(to)).is_empty());
    let press = view.skill_candidates(ObjectId(6), None).remove(0);
    assert_eq!(press.effects[0].to_string(), "pressed(O6)");
    assert_eq!((press.kind.as_str(), press.success), ("press-down", 0.5));
    assert!(view.applicable(&press.preconditions).holds());
    let place = view.skill_candidates(ObjectId(1), Some(to)).remove(1);
    let applicability = view.applicable(&place.preconditions);
    assert_eq!(applicability.failed().map(|(l, _)| l.to_string()).collect::<Vec<_>>(), ["holding(O1)"]);
}
