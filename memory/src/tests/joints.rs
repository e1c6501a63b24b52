//! What is felt of a joint comes back with the part.

use super::*;
use crate::{
    observation::Executed,
    staging::{Thing, look, open_hand, report},
};
use acm_concept::{
    ids::{PartId, TransitionId},
    pose::Pose,
    skill::FailureCause,
};
use glam::DVec3;

const PART: PartId = PartId { object: ObjectId(1), index: 0 };

fn chest(x: f64) -> Thing {
    Thing::block([0.2, 0.07, 0.3]).at(x, 0.1, 0.0).colored(BLUE)
}

/// A hand swung the part about an upright axis through a point of the world, metres.
fn swung(memory: &AcmMemory, hinge: DVec3, ended_s: f64) -> Executed {
    let mut executed = report(&*memory.view(), "pick", ObjectId(1), ended_s).unwrap();
    let vectors = [("hinge_point_m", hinge), ("hinge_axis", DVec3::Z)];
    for (name, value) in vectors {
        for (axis, value) in ["x", "y", "z"].into_iter().zip(value.to_array()) {
            executed.report.measured.insert(format!("{name}_{axis}"), value);
        }
    }
    executed
}

fn seen() -> AcmMemory {
    let mut memory = memory();
    for frame in 0..3 {
        look(&mut memory, frame, frame as f64, &[chest(0.1)], &[], &open_hand(0.0)).unwrap();
    }
    memory
}

#[test]
fn a_felt_hinge_goes_with_its_part() {
    let mut memory = seen();
    assert_eq!(memory.view().felt_joint(PART), None);
    let executed = swung(&memory, DVec3::new(0.2, 0.15, 0.1), 4.0);
    let transition = memory.record(&executed).unwrap();
    let felt = memory.view().felt_joint(PART).unwrap();
    assert_eq!(felt.evidence, transition);
    // The part has been put elsewhere since, by 0.3 m: so has its hinge.
    let moved = executed.report.invocation.target.pose.pose;
    let moved = Pose::new(moved.translation + 0.3 * DVec3::X, moved.rotation);
    let point = felt.seen_from(&moved, &Pose::IDENTITY).point.unwrap();
    assert!(point.distance(DVec3::new(0.5, 0.15, 0.1)) < 1e-9, "{point}");
    memory.wipe().unwrap();
    assert_eq!(memory.view().felt_joint(PART), None);
}

#[test]
fn the_newest_way_that_went_well_tells_the_joint() {
    let mut memory = seen();
    let first = memory.record(&swung(&memory, DVec3::new(0.2, 0.15, 0.1), 4.0)).unwrap();
    let failed = swung(&memory, DVec3::new(0.9, 0.9, 0.9), 6.0).failing(FailureCause::Motion, "blocked");
    memory.record(&failed).unwrap();
    let evidence = |memory: &AcmMemory| -> TransitionId { memory.view().felt_joint(PART).unwrap().evidence };
    assert_eq!(evidence(&memory), first);
    let second = memory.record(&swung(&memory, DVec3::new(0.21, 0.15, 0.1), 8.0)).unwrap();
    assert_eq!(evidence(&memory), second);
}

#[test]
fn what_an_action_opened_stays_open_until_another_one_closes_it() {
    let mut memory = seen();
    let open = Literal::parse("open(O1)").unwrap();
    assert_eq!(truth(&memory, "open(O1)"), Truth::Unknown);
    let act = |memory: &mut AcmMemory, felt: Option<Literal>, ended_s: f64| {
        let mut executed = report(&*memory.view(), "pick", ObjectId(1), ended_s).unwrap();
        executed.predicted = vec![open.clone()];
        executed.report.felt = felt.into_iter().map(|literal| (literal, 0.9)).collect();
        memory.record(&executed).unwrap()
    };
    act(&mut memory, Some(open.clone()), 4.0);
    look(&mut memory, 9, 5.0, &[chest(0.1)], &[], &open_hand(5.0)).unwrap();
    assert_eq!(truth(&memory, "open(O1)"), Truth::Yes);
    act(&mut memory, Some(open.clone().negate()), 6.0);
    assert_eq!(truth(&memory, "open(O1)"), Truth::No);
    // A try that nobody could judge leaves the state open.
    act(&mut memory, None, 8.0);
    assert_eq!(truth(&memory, "open(O1)"), Truth::Unknown);
    memory.wipe().unwrap();
    assert_eq!(truth(&memory, "open(O1)"), Truth::Unknown);
}
