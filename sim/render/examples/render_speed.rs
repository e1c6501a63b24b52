//! Milliseconds a frame (median by the clock, and mean of processor time, which other load disturbs less): rendering with and without shadows, and the sensor model.
//!
//! `cargo run --release -p acm-render --example render_speed`

use acm_concept::{camera::*, pose::Pose};
use acm_render::{sensor::SensorProfile, *};
use glam::{DQuat, DVec3};
use rand::SeedableRng;
use std::{sync::Arc, time::Instant};

const FRAMES: usize = 60;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut renderer = Renderer::new().map_err(|error| error.to_string())?;
    println!("{:?}", renderer.adapter());
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    for (width, height, cylinders) in [(640, 480, 25), (640, 480, 100), (320, 240, 25)] {
        let camera = CameraModel {
            name: "head".into(),
            intrinsics: Intrinsics::from_vertical_fov(width, height, 0.87),
            pose: Pose::new(DVec3::new(0.0, -0.3, 0.7), DQuat::from_rotation_x(std::f64::consts::PI + 0.4)),
            depth_min_m: 0.1,
            depth_max_m: 4.0,
            mount: Default::default(),
        };
        let mut scene = cluttered(cylinders);
        let triangles: usize = scene.instances.iter().map(|instance| instance.mesh.triangle_count()).sum();
        let shadowed = timed(|| renderer.render(&scene, &camera).map(drop))?;
        scene.lights.sun.shadow_map = 0;
        let plain = timed(|| renderer.render(&scene, &camera).map(drop))?;
        let frame = renderer.render(&scene, &camera)?;
        let episode = SensorProfile::named("d435")?.episode(&mut rng);
        let sensor = timed(|| {
            std::hint::black_box(episode.measure(&frame, &camera, &mut rng));
            Ok(())
        })?;
        println!(
            "{width}x{height}, {triangles} triangles: render {shadowed} with shadows, {plain} without; sensor {sensor}"
        );
    }
    Ok(())
}

/// A table with a grid of small cylinders of 188 triangles each.
fn cluttered(cylinders: u32) -> Scene {
    let (cube, cylinder) = (Arc::new(Mesh::unit_box()), Arc::new(Mesh::unit_cylinder()));
    let mut scene = Scene::default();
    let mut add = |mesh: &Arc<Mesh>, at, scale, color| {
        let id = scene.instances.len() as u32 + 1;
        let pose = Pose::from_translation(at);
        scene.instances.push(Instance { mesh: mesh.clone(), pose, scale, material: Material::plain(color), id });
    };
    add(&cube, DVec3::new(0.0, 0.0, -0.05), DVec3::new(1.2, 0.7, 0.1), [250; 3]);
    add(&cube, DVec3::new(0.0, 1.0, 0.0), DVec3::new(6.0, 0.1, 3.0), [255, 230, 230]);
    for k in 0..cylinders {
        let at = DVec3::new(f64::from(k % 10) * 0.05 - 0.22, f64::from(k / 10) * 0.05 - 0.25, 0.03);
        add(&cylinder, at, DVec3::new(0.018, 0.018, 0.06), [(k * 40) as u8, 120, 60]);
    }
    scene
}

/// The median time of a frame by the clock and its mean processor time, after a few frames to warm up.
#[allow(clippy::disallowed_methods, reason = "measuring wall time is what this program is for")]
fn timed(mut frame: impl FnMut() -> Result<(), RenderError>) -> Result<String, RenderError> {
    for _ in 0..5 {
        frame()?;
    }
    let mut times = Vec::with_capacity(FRAMES);
    let before = processor_ms();
    for _ in 0..FRAMES {
        let start = Instant::now();
        frame()?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    let spent = processor_ms().zip(before).map(|(after, before)| (after - before) / FRAMES as f64);
    times.sort_by(f64::total_cmp);
    let processor = spent.map_or_else(|| "?".into(), |ms| format!("{ms:.1}"));
    Ok(format!("{:.1} ms (CPU {processor})", times[FRAMES / 2]))
}

/// Processor time of all our threads so far, user and system, in the kernel's steps of 10 ms. Linux only.
fn processor_ms() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let after_name = stat.rsplit_once(')')?.1;
    let ticks = after_name.split_whitespace().skip(11).take(2).map(|field| field.parse::<f64>().ok());
    Some(ticks.sum::<Option<f64>>()? * 10.0)
}
