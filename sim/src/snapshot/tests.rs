#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use crate::{Scenario, SimOptions, Simulation, expert::Expert};

fn simulation(scenario: &str, seed: u64) -> Simulation {
    let options = SimOptions { seed, slip_at: Some(2), ..SimOptions::default() };
    Simulation::without_renderer(&Scenario::open(scenario).unwrap(), &options).unwrap()
}

/// What there is to compare of a world: every body's pose, and everything else that is saved.
fn everything(expert: &Expert) -> Vec<u8> {
    expert.simulation.snapshot().unwrap().as_bytes().to_vec()
}

/// The first cube is carried, which the second carry's mishap must not forget; then the button is pressed.
fn go_on(expert: &mut Expert) -> Vec<u8> {
    expert.press("button");
    expert.pick("cube");
    everything(expert)
}

#[test]
fn a_restored_world_goes_on_bit_by_bit() {
    let mut first = Expert::of(simulation("put-back-block-jittered", 3));
    first.pick("cube");
    first.place("cube", 0.1, -0.1, 0.74);
    let (snapshot, plan) = (first.simulation.snapshot().unwrap(), first.plan());
    let kept = Snapshot::from_bytes(snapshot.as_bytes().to_vec()).unwrap();
    let after = go_on(&mut first);

    // Into another simulation that has not begun, and into the one that has gone on.
    let mut second = Expert::of(simulation("put-back-block-jittered", 3));
    second.simulation.restore(&kept).unwrap();
    second.set_plan(plan);
    assert!(go_on(&mut second) == after);
    first.simulation.restore(&kept).unwrap();
    first.set_plan(plan);
    assert!(go_on(&mut first) == after);
}

#[test]
fn what_is_no_snapshot_of_this_world_is_refused_and_changes_nothing() {
    let simulation_3 = simulation("put-back-block-jittered", 3);
    let good = simulation_3.snapshot().unwrap();
    let other = simulation("put-back-block-jittered", 4);
    let before = other.state_hash();
    assert!(matches!(other.restore(&good), Err(SnapshotError::OtherWorld)));
    assert_eq!(other.state_hash(), before);
    assert!(matches!(Snapshot::from_bytes(b"hello".to_vec()), Err(SnapshotError::Foreign { length: 5 })));
    let mut newer = good.as_bytes().to_vec();
    newer[8] = 99;
    assert!(matches!(Snapshot::from_bytes(newer), Err(SnapshotError::Version { found: 99 })));
    let before = simulation_3.state_hash();
    for length in [12, 13, 200, good.as_bytes().len() - 1] {
        let cut = Snapshot::from_bytes(good.as_bytes()[..length].to_vec()).unwrap();
        assert!(matches!(simulation_3.restore(&cut), Err(SnapshotError::Damaged(_))), "{length}");
    }
    assert_eq!(simulation_3.state_hash(), before);
}
