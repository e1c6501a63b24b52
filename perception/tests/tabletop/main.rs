//! Grounding of a rendered table through a noisy depth camera.
#![allow(clippy::unwrap_used, clippy::expect_used)] // A failed unwrap is a failed test.

mod sensor;
mod world;

use acm_concept::{
    expectation::Expectation,
    object::{GroundedObject, Percepts},
    template::TemplateLibrary,
};
use acm_perception::{Grounder, GrounderConfig};
use glam::DVec2;
use sensor::Sensor;
use std::sync::Arc;
use world::{MATS, World, head_camera};

fn library() -> Arc<TemplateLibrary> {
    let files = [
        ("box.toml", include_str!("../../../memory/library/box.toml")),
        ("button.toml", include_str!("../../../memory/library/button.toml")),
        ("cylinder.toml", include_str!("../../../memory/library/cylinder.toml")),
        ("mat.toml", include_str!("../../../memory/library/mat.toml")),
    ];
    Arc::new(TemplateLibrary::parse(files).unwrap())
}

fn grounder() -> Grounder {
    Grounder::new(library(), GrounderConfig::default())
}

fn instruction() -> Expectation {
    let nouns = ["cube", "mat", "button", "middle"].map(String::from).to_vec();
    Expectation { nouns, ..Expectation::default() }
}

fn of_category<'a>(percepts: &'a Percepts, category: &str) -> Vec<&'a GroundedObject> {
    percepts.objects.iter().filter(|o| o.category == category).collect()
}

fn place(object: &GroundedObject) -> DVec2 {
    object.pose().unwrap().pose.translation.truncate()
}

fn summary(percepts: &Percepts) -> String {
    let line = |o: &GroundedObject| {
        let p = &o.parts[0];
        let values: Vec<String> = p.parameters.iter().map(|v| format!("{:.0}", v.value * 1e3)).collect();
        let t = p.pose.pose.translation;
        format!(
            "  {} {} {:?} at {:.0},{:.0},{:.0} yaw {:.1} conf {:.2} px {}",
            o.category,
            p.template,
            values,
            t.x * 1e3,
            t.y * 1e3,
            t.z * 1e3,
            p.pose.pose.yaw().to_degrees(),
            o.confidence,
            o.support.count
        )
    };
    percepts.objects.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[test]
fn probe() {
    for seed in [1, 101, 201, 301] {
        for cube in [(0.0, -0.1, 0.001), (0.1, -0.1, 0.0), (0.1, 0.0, 0.001)] {
            let frame = Sensor::new(head_camera()).capture(&World::put_back_block(cube), seed);
            let started = std::time::Instant::now();
            let percepts = grounder().ground(&frame, &instruction());
            println!("seed {seed} cube {cube:?} {} ms\n{}", started.elapsed().as_millis(), summary(&percepts));
            if let Ok(folder) = std::env::var("OVERLAYS") {
                let image = acm_perception::overlay::draw(&frame, &percepts, &[], &library());
                image.save(format!("{folder}/s{seed}_{:.0}_{:.0}.png", cube.0 * 100.0, -cube.1 * 100.0)).unwrap();
            }
        }
    }
    let _unused = MATS;
}
