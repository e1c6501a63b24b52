#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use std::collections::BTreeSet;

#[test]
fn the_first_scenario_has_four_worlds_and_the_second_has_many() {
    let digests = |name: &str, seeds: std::ops::Range<u64>| {
        let scenario = Scenario::open(name).unwrap();
        let digest = |seed| {
            let options = SimOptions { seed, ..SimOptions::default() };
            Simulation::without_renderer(&scenario, &options).unwrap().world_digest()
        };
        seeds.map(digest).collect::<BTreeSet<String>>().len()
    };
    assert_eq!(digests("put-back-block", 100_000..100_016), 4);
    assert_eq!(digests("put-back-block-jittered", 0..8), 8);
}

#[test]
fn the_task_holds_what_the_agent_may_know() {
    let scenario = Scenario::open("put-back-block").unwrap();
    let options = SimOptions { camera_size: Some((320, 240)), ..SimOptions::default() };
    let simulation = Simulation::without_renderer(&scenario, &options).unwrap();
    let task = simulation.task();
    assert!(task.instruction.contains("came from") && task.budgets.seconds == 120.0);
    assert_eq!(task.cameras[0].pose, scenario.world.cameras[0].model.pose);
    assert!((task.cameras[0].intrinsics.fy - 257.34).abs() < 0.01);
    let error = simulation.camera().capture("head").unwrap_err();
    assert!(matches!(error, CameraError::Failed { .. }));
    let error = simulation.camera().capture("tail").unwrap_err();
    assert!(error.to_string().contains("head"));
    let unknown = SimOptions { sensor: Some("d453".into()), ..SimOptions::default() };
    assert!(matches!(Simulation::without_renderer(&scenario, &unknown), Err(SimError::Sensor(_))));
}

/// One test for all that needs the renderer: it is expensive to make.
#[test]
fn frames_show_the_table_and_not_the_waiting_hand() {
    let renderer = match Renderer::new() {
        Ok(renderer) => Arc::new(Mutex::new(renderer)),
        Err(e) => return println!("skipped: {e}"),
    };
    for name in Scenario::names() {
        let scenario = Scenario::open(&name).unwrap();
        let options = SimOptions { seed: 3, ..SimOptions::default() };
        let simulation = Simulation::new(&scenario, &options, renderer.clone()).unwrap();
        let preview = simulation.preview(None).unwrap();
        let seen: BTreeSet<&str> =
            preview.legend.iter().filter(|(id, _)| preview.ids.contains(id)).map(|(_, name)| name.as_str()).collect();
        for object in simulation.truth() {
            assert!(seen.contains(object.name.as_str()), "{name}: {} is not seen", object.name);
        }
        assert!(seen.contains("table") && !seen.contains("hand"), "{name}: {seen:?}");

        let frame = |simulation: &Simulation| simulation.camera().capture("head").unwrap();
        let again = Simulation::new(&scenario, &options, renderer.clone()).unwrap();
        let first = frame(&simulation);
        assert_eq!(first, frame(&again), "{name}: one seed, two pictures");
        assert_eq!(first.header.camera_pose, simulation.task().cameras[0].pose);
        assert_eq!((first.header.id, first.header.time), (FrameId(0), Time::ZERO));
        let measured = first.depth.iter().filter(|depth| **depth > 0.0).count();
        assert!(measured > first.depth.len() * 9 / 10, "{name}: only {measured} depths");
        let timings = simulation.timings();
        assert!(timings.render_s > 0.0 && timings.noise_s > 0.0);
        println!("{name}: {timings:?}");
    }
}
