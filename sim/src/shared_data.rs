//! Every articulated object of the shared data loads, is seen and moves. Skipped without that data.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use crate::{
    Scenario, SimOptions, Simulation, TrueJoint,
    model::{ObjectModel, shape::Shape},
    testbed::{joint, object_text, push, run, truth},
    world::{World, cpu_s},
};
use acm_concept::expression::Expression;
use acm_render::Renderer;
use rustix::time::ClockId;
use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

/// Force at a handle, newtons.
const FORCE_N: f64 = 60.0;
/// Speed at a handle up to which it is pushed, metres per second.
const FASTEST_M_S: f64 = 0.5;
/// A joint moves if it reaches this share of its range.
const MOST: f64 = 0.75;
const KITCHEN: [&str; 7] = ["microwave", "hingecabinet", "slidecabinet", "oven", "kettle", "counters1", "backwall"];

fn objects(data: &Path) -> Vec<String> {
    let mut names = Vec::new();
    let folders = |path: PathBuf| {
        let mut found: Vec<PathBuf> =
            std::fs::read_dir(path).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
        found.sort();
        found
    };
    for category in folders(data.join("infinigen_articulated")).into_iter().filter(|path| path.is_dir()) {
        for seed in folders(category.clone()) {
            let category = category.file_name().unwrap().to_str().unwrap();
            let seed = seed.file_name().unwrap().to_str().unwrap();
            names.push(format!("data:infinigen_articulated/{category}/{seed}/{category}.urdf"));
        }
    }
    let kitchen = "data:franka_kitchen/kitchen_assets/kitchen_env_model.xml";
    names.extend(KITCHEN.iter().map(|body| format!("{kitchen}#{body}")));
    names.extend(["microwave", "wooden_cabinet"].map(|name| format!("data:libero_articulated/{name}.xml")));
    names
}

/// How far a joint of the thing is opened by a limited force within some seconds, and whether all stays sound.
fn driven(scenario: &Scenario, name: &str) -> (f64, bool, String) {
    let mut world = World::new(scenario, &SimOptions::default()).unwrap();
    let start = joint(&world, name);
    let far = start.range.map_or(1.0, |[low, high]| if high - start.closed > start.closed - low { 1.0 } else { -1.0 });
    // A force at the handle: as much as it takes, and no more than a hand has.
    let reach = if start.is_hinge { reach(&truth(&world), name) } else { 1.0 };
    let force = (1.5 * start.friction + 10.0 * reach).min(FORCE_N * reach);
    let mut best = 0.0f64;
    // A hand goes on slowly; heavy drawers take their time.
    for _ in 0..250 {
        let now = joint(&world, name);
        best = best.max(opened(&now, start.position));
        if best > 0.98 {
            break;
        }
        let force = if far * now.speed * reach > FASTEST_M_S { 0.0 } else { force };
        push(&mut world, name, far * force, 0.04);
    }
    let how = format!("at {:.3}, pushed with {force:.1}, touches {}", joint(&world, name).position, touching(&world));
    run(&mut world, 0.5);
    let thing = truth(&world);
    let sound = thing.links.iter().all(|link| {
        let near = link.pose.translation.is_finite() && link.pose.translation.length() < 10.0;
        near && link.joint.as_ref().is_none_or(|joint| joint.speed.is_finite() && joint.speed.abs() < 30.0)
    });
    (best, sound, format!("{how}, at rest with {:.3}/s", joint(&world, name).speed))
}

/// Pairs of the thing's links that press on each other.
fn touching(world: &World) -> String {
    let body = &world.bodies[0];
    let link = |handle| {
        let at = (0..body.placed.links.len()).find(|at| body.carrier(*at) == handle);
        at.map_or("another thing", |at| body.placed.links[at].name.as_str())
    };
    let mut found: Vec<String> = Vec::new();
    for collider in &body.colliders {
        for pair in world.physics.contact_pairs_with(*collider).filter(|pair| pair.total_impulse_magnitude() > 0.0) {
            let parents = [pair.collider1, pair.collider2].map(|c| world.physics.colliders.get(c).unwrap().parent());
            found.push(parents.into_iter().flatten().map(link).collect::<Vec<_>>().join(" on "));
        }
    }
    found.sort_unstable();
    found.dedup();
    found.join(", ")
}

/// Share of the way from closed to the farther end; of one turn where there is no end.
fn opened(joint: &TrueJoint, start: f64) -> f64 {
    if joint.range.is_some() { joint.opened } else { ((joint.position - start).abs() / std::f64::consts::TAU).min(1.0) }
}

/// How far a link extends from its hinge.
fn reach(thing: &crate::TrueObject, name: &str) -> f64 {
    let link = thing.links.iter().find(|link| link.name == name).unwrap();
    let joint = link.joint.as_ref().unwrap();
    let away = |point: glam::DVec3| {
        (link.pose.transform_point(point) - joint.origin).reject_from_normalized(joint.axis).length()
    };
    link.pieces.iter().map(|piece| away(piece.low).max(away(piece.high))).fold(0.0, f64::max)
}

fn counts(model: &ObjectModel) -> (usize, usize) {
    let pieces = || model.links.iter().flat_map(|link| &link.pieces);
    let triangles = |shape: &Shape| if let Shape::Surface { mesh, .. } = shape { mesh.triangle_count() } else { 0 };
    (pieces().filter(|piece| piece.solid).count(), pieces().map(|piece| triangles(&piece.shape)).sum())
}

/// Share of the picture that the thing takes, from where all of it can be seen.
fn seen(scenario: &Scenario, renderer: &Arc<Mutex<Renderer>>) -> f64 {
    let simulation = Simulation::new(scenario, &SimOptions::default(), renderer.clone()).unwrap();
    let preview = simulation.preview(None).unwrap();
    let id = preview.legend.iter().find(|(_, name)| name == "thing").unwrap().0;
    preview.ids.iter().filter(|seen| **seen == id).count() as f64 / preview.ids.len() as f64
}

#[test]
fn every_shared_object_loads_is_seen_and_moves() {
    let Some(data) = std::env::var_os("ACM_DATA") else {
        return println!("skipped: the variable ACM_DATA does not name the shared data");
    };
    let renderer = Renderer::new().map(|renderer| Arc::new(Mutex::new(renderer)));
    if let Err(problem) = &renderer {
        println!("nothing is drawn: {problem}");
    }
    let (mut joints, mut moved, mut stuck) = (0, 0, Vec::new());
    println!("{:<44} links joints hulls triangles load s  moved", "object");
    for name in objects(Path::new(&data)) {
        let thing =
            format!("[[object]]\nname = 'thing'\nmodel_file = '{name}'\nfixed = true\nposition = [0, 0, 1.4]\n");
        let started = cpu_s(ClockId::ThreadCPUTime);
        let scenario = Scenario::parse("joints.toml", &object_text(&thing)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let load_s = cpu_s(ClockId::ThreadCPUTime) - started;
        let model = scenario.world.objects[0].model.clone();
        let names: Vec<String> = model.joints().map(|(link, _)| model.links[link].name.clone()).collect();
        let (hulls, triangles) = counts(&model);
        let mut row = Vec::new();
        for (link, spec) in model.joints() {
            if spec.follows.is_some() {
                continue;
            }
            let joint = &model.links[link].name;
            let (mut best, mut sound, mut how) = driven(&scenario, joint);
            if best < MOST {
                // What stands inside waits for the doors before it.
                let doors = model.joints().filter(|(other, spec)| *other != link && spec.follows.is_none());
                let ends = doors.filter_map(|(other, spec)| {
                    let far = spec.range?.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
                    Some((other, Expression::parse(&format!("{far}"), &[]).unwrap()))
                });
                let mut open = scenario.clone();
                open.world.objects[0].starts = ends.collect();
                let again = driven(&open, joint);
                (best, sound, how) = (best.max(again.0), sound && again.1, format!("{how}; others open: {}", again.2));
            }
            joints += 1;
            moved += usize::from(best >= MOST);
            row.push(format!("{joint} {best:.2}"));
            assert!(sound, "{name} {joint}: {how}");
            if best < MOST {
                stuck.push(format!("{name} {joint}: {best:.2}, {how}"));
            }
        }
        let short = name.rsplit('/').take(2).collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join("/");
        println!(
            "{short:<44} {:>5} {:>6} {hulls:>5} {triangles:>9} {load_s:>6.2}  {}",
            model.links.len(),
            names.len(),
            row.join(", ")
        );
        if let Ok(renderer) = &renderer {
            let share = seen(&scenario, renderer);
            assert!(share > 0.002, "{name} takes {share} of the picture");
        }
    }
    println!("{moved} of {joints} joints move");
    for line in &stuck {
        println!("stuck: {line}");
    }
    assert!(joints > 200 && moved * 100 >= joints * 98, "{} of {joints} joints are stuck", stuck.len());
}
