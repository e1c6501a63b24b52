//! Pictures beside MuJoCo's: the same mesh, light and camera on the same driver.

use super::{
    clock::cpu_s,
    peer::{self, Peer, number},
};
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
};
use acm_concept::{
    camera::{CameraModel, Intrinsics, Mount},
    pose::Pose,
};
use acm_render::{Instance, Lighting, Material, Mesh, Renderer, Scene, Sun};
use glam::{DQuat, DVec3, Vec3};
use serde_json::{Value, json};
use std::{f32::consts::TAU, f64::consts::PI, sync::Arc};

const TURNS: usize = 5;
const FRAMES: usize = 12;
const SIZE: (u32, u32) = (640, 480);
/// The torus has twice this many triangles for each of its segments: 20,000.
const SEGMENTS: (u32, u32) = (200, 50);
/// Edge of both shadow maps, texels: what our scenarios have. MuJoCo's default is 4096, which costs it another third.
const SHADOW_MAP: u32 = 512;
const FOV_Y: f64 = 0.9;

/// Adds frames per processor second and the ratio to the peer's, on each driver that both can use.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    // MuJoCo draws by OpenGL through EGL; only there is it the same driver.
    let mut renderer = match Renderer::by("gl") {
        Ok(renderer) => renderer,
        Err(error) => {
            result.rows.push(Row::skipped("rendering", error.to_string()));
            return Ok(());
        }
    };
    let (torus, camera) = (torus()?, camera());
    let scene = stage(&torus);
    let frames = if args.quick { FRAMES / 4 } else { FRAMES };
    let mut mujoco = Peer::start(&task(&torus, frames));
    drop(renderer.render(&scene, &camera)?);
    let (mut ours, mut theirs, mut last) = (Vec::new(), Vec::new(), None);
    for _ in 0..if args.quick { 2 } else { TURNS } {
        let ((), spent_s) = cpu_s(|| (0..frames).try_for_each(|_| renderer.render(&scene, &camera).map(drop)))?;
        ours.push(frames as f64 / spent_s);
        if let Ok(peer) = &mut mujoco {
            let answer = peer.turn()?;
            theirs.push(number(&answer, "frames")? / number(&answer, "cpu_s")?);
            last = Some(answer);
        }
    }
    let triangles: usize = scene.instances.iter().map(|instance| instance.mesh.triangle_count()).sum();
    let picture = renderer.render(&scene, &camera)?;
    let seen = picture.ids.iter().filter(|id| **id > 0).count() as f64 / picture.ids.len() as f64;
    let row = |name: String, rate, seen| Row::new(name, [("frames_per_cpu_s", rate), ("share_of_pixels_seen", seen)]);
    let mut own = row(format!("rendering: ours, {}", renderer.adapter()), peer::best(&ours), seen);
    own.values.insert("triangles".into(), triangles as f64);
    result.rows.push(own);
    match (mujoco, last) {
        (Ok(peer), Some(answer)) => {
            let name = format!("rendering: MuJoCo {}, EGL, three passes", peer.version);
            result.rows.push(row(name, peer::best(&theirs), number(&answer, "seen")?));
            result.figure("render_over_mujoco", peer::best(&ours) / peer::best(&theirs));
        }
        (Err(reason), _) => result.rows.push(Row::skipped("rendering: MuJoCo", reason.to_string())),
        (Ok(_), None) => {}
    }
    Ok(())
}

/// A torus of 20,000 triangles, its ring lying flat: 0.15 m and 0.06 m.
fn torus() -> anyhow::Result<Arc<Mesh>> {
    let (around, across) = SEGMENTS;
    let point = |i: u32, j: u32| {
        let (u, v) = (TAU * i as f32 / around as f32, TAU * j as f32 / across as f32);
        let ring = 0.15 + 0.06 * v.cos();
        Vec3::new(ring * u.cos(), ring * u.sin(), 0.06 * v.sin())
    };
    let at = |i: u32, j: u32| (i % around) * across + j % across;
    let vertices: Vec<Vec3> = (0..around).flat_map(|i| (0..across).map(move |j| point(i, j))).collect();
    let faces = (0..around).flat_map(|i| (0..across).map(move |j| (i, j)));
    let triangles: Vec<[u32; 3]> = faces
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Ok(Arc::new(Mesh::from_triangles("torus", &vertices, &triangles)?))
}

/// What stands where: table, torus, five cubes. Size of a box, or none for the torus.
fn placed() -> Vec<(Option<DVec3>, Pose, [u8; 3])> {
    let mut things = vec![
        (Some(DVec3::new(1.2, 0.7, 0.05)), Pose::from_translation(DVec3::Z * -0.025), [240; 3]),
        (None, Pose::from_translation(DVec3::new(0.0, 0.1, 0.06)), [60, 120, 200]),
    ];
    things.extend((0..5).map(|k| {
        let at = DVec3::new(-0.3 + 0.15 * f64::from(k), -0.2, 0.02);
        (Some(DVec3::splat(0.04)), Pose::from_yaw(at, 0.3 * f64::from(k)), [214, 32, 28])
    }));
    things
}

fn sun() -> DVec3 {
    DVec3::new(0.0, 0.3, -1.0)
}

fn stage(torus: &Arc<Mesh>) -> Scene {
    let cube = Arc::new(Mesh::unit_box());
    let instance = |(index, (size, pose, color)): (usize, (Option<DVec3>, Pose, [u8; 3]))| Instance {
        mesh: size.map_or_else(|| torus.clone(), |_| cube.clone()),
        pose,
        scale: size.unwrap_or(DVec3::ONE),
        material: Material::plain(color),
        id: index as u32 + 1,
    };
    let lights = Lighting {
        sun: Sun { direction: sun(), intensity: 1.0, shadow_map: SHADOW_MAP },
        points: Vec::new(),
        ..Lighting::default()
    };
    Scene { instances: placed().into_iter().enumerate().map(instance).collect(), lights, ..Scene::default() }
}

fn camera() -> CameraModel {
    CameraModel {
        name: "head".into(),
        intrinsics: Intrinsics::from_vertical_fov(SIZE.0, SIZE.1, FOV_Y),
        pose: Pose::new(DVec3::new(0.0, -0.45, 0.65), DQuat::from_rotation_x(PI + 0.6)),
        depth_min_m: 0.1,
        depth_max_m: 6.0,
        mount: Mount::World,
    }
}

fn task(torus: &Mesh, frames: usize) -> Value {
    let camera = camera();
    // Its cameras look along -z with y up.
    let rotation = camera.pose.rotation * DQuat::from_rotation_x(PI);
    let objects: Vec<Value> = placed()
        .into_iter()
        .map(|(size, pose, color)| {
            let (position, rotation) = (pose.translation.to_array(), pose.rotation.to_array());
            match size {
                Some(size) => {
                    json!({"size": size.to_array(), "position": position, "rotation": rotation, "color": color})
                }
                None => json!({"mesh": 0, "position": position, "rotation": rotation, "color": color}),
            }
        })
        .collect();
    let vertices: Vec<[f32; 3]> = torus.positions().iter().map(|point| point.to_array()).collect();
    let faces: Vec<&[u32]> = torus.indices().chunks_exact(3).collect();
    json!({
        "task": "render", "width": SIZE.0, "height": SIZE.1, "frames": frames, "shadow_map": SHADOW_MAP,
        "sun": sun().to_array(), "meshes": [{"vertices": vertices, "faces": faces}], "objects": objects,
        "camera": {
            "position": camera.pose.translation.to_array(), "rotation": rotation.to_array(),
            "fov_y_deg": FOV_Y.to_degrees(),
        },
    })
}
