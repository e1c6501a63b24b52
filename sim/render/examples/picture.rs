//! Draws a small table scene, passes it through a depth sensor, and writes what came out as PNG files.
//!
//! `cargo run -p acm-render --example picture [FOLDER [WIDTH HEIGHT]]`

use acm_concept::{camera::*, pose::Pose};
use acm_render::{sensor::SensorProfile, *};
use glam::{DMat3, DQuat, DVec3};
use rand::SeedableRng;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = arguments.first().map_or_else(std::env::temp_dir, Into::into);
    let edge = |place: usize, default| arguments.get(place).map_or(Ok(default), |text| text.parse());
    let (cube, cylinder) = (Arc::new(Mesh::unit_box()), Arc::new(Mesh::unit_cylinder()));
    let mut scene = Scene { background: [40, 44, 52], ..Scene::default() };
    let mut add = |mesh: &Arc<Mesh>, at: [f64; 3], scale: [f64; 3], color, pattern: Option<(PatternKind, _)>| {
        let id = scene.instances.len() as u32 + 1;
        let pattern = pattern.map(|(kind, color)| Pattern { kind, color, cell_m: 0.02 });
        let (pose, scale) =
            (Pose::from_yaw(at.into(), if id > 2 { 0.3 * f64::from(id % 3) } else { 0.0 }), scale.into());
        scene.instances.push(Instance { mesh: mesh.clone(), pose, scale, material: Material { color, pattern }, id });
    };
    add(&cube, [0.0, 1.0, 1.5], [6.0, 1.2, 3.0], [255, 244, 244], None);
    add(&cube, [0.0, 0.0, 0.715], [1.2, 0.7, 0.05], [255; 3], None);
    for (x, y) in [(-0.15, 0.0), (0.15, 0.0), (0.0, 0.12), (0.0, -0.12)] {
        add(&cube, [x, y, 0.7415], [0.07, 0.07, 0.003], [30, 70, 220], None);
    }
    add(&cube, [-0.15, 0.0, 0.763], [0.04; 3], [220, 20, 20], None);
    add(&cylinder, [0.25, -0.1, 0.75], [0.04, 0.04, 0.02], [60; 3], None);
    add(&cylinder, [0.25, -0.1, 0.767], [0.025, 0.025, 0.014], [240, 40, 30], None);
    add(&cube, [-0.3, 0.12, 0.79], [0.1; 3], [240, 200, 40], Some((PatternKind::Checker, [30, 120, 30])));
    add(&cylinder, [0.3, 0.15, 0.8], [0.04, 0.04, 0.12], [200, 120, 40], Some((PatternKind::Stripes, [250; 3])));
    add(&cube, [-0.3, -0.15, 0.76], [0.12, 0.06, 0.04], [160, 160, 170], Some((PatternKind::Speckle, [40; 3])));

    let axes = DMat3::from_cols(DVec3::X, DVec3::new(0.0, -0.8, -0.6), DVec3::new(0.0, 0.6, -0.8));
    let nominal = CameraModel {
        name: "head".into(),
        intrinsics: Intrinsics::from_vertical_fov(edge(1, 640)?, edge(2, 480)?, 50f64.to_radians()),
        pose: Pose::new(DVec3::new(-0.032, -0.45, 1.35), DQuat::from_mat3(&axes)),
        depth_min_m: 0.1,
        depth_max_m: 4.0,
        mount: Default::default(),
    };
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let episode = SensorProfile::named("d435")?.episode(&mut rng);
    let mut renderer = Renderer::new().map_err(|error| error.to_string())?;
    println!("{:?}", renderer.adapter());
    let exact = renderer.render(&scene, &episode.true_camera(&nominal))?;
    let measured = episode.measure(&exact, &nominal, &mut rng);
    let grey = |depth: &[f32]| depth.iter().flat_map(|z| [(z * 160.0).min(255.0) as u8; 3]).collect::<Vec<_>>();
    let ids = exact.ids.iter().flat_map(|id| [id * 67, id * 113, id * 31].map(|c| c as u8)).collect();
    let (exact_depth, depth) = (grey(&exact.depth), grey(&measured.depth));
    let pictures = [
        ("exact", exact.color),
        ("color", measured.color),
        ("exact-depth", exact_depth),
        ("depth", depth),
        ("ids", ids),
    ];
    for (name, bytes) in pictures {
        let path = folder.join(format!("acm-{name}.png"));
        image::save_buffer(&path, &bytes, exact.width, exact.height, image::ColorType::Rgb8)?;
        println!("{}", path.display());
    }
    Ok(())
}
