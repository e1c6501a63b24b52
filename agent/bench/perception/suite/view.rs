//! What a camera sees of a scene: noisy frames for perception, and which pixel shows what for the score.

use super::{
    plan::Plan,
    scene::{Scene, TABLE_M},
    thing::Thing,
};
use acm_concept::{
    camera::{CameraModel, FrameHeader, Intrinsics, RgbdFrame},
    color::Lab,
    ids::FrameId,
    pose::Pose,
    time::Time,
};
use acm_render::{
    Instance, Material, Mesh, Rendered, Renderer,
    sensor::{SensorEpisode, SensorProfile},
};
use anyhow::Context;
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// Ids of what is no thing; things come after them.
const TABLE: u32 = 1;
const FLOOR: u32 = 2;
const FIRST: u32 = 3;
/// Size of the table, metres.
const TABLE_SIZE: DVec3 = DVec3::new(2.0, 2.0, 0.04);
/// A surface's direction is taken over so many pixels, so many away from an edge.
const SPAN_PX: isize = 3;
/// Time between two frames, seconds.
const BETWEEN_S: f64 = 1.0;

/// The scene as it was seen.
#[derive(Debug, Clone)]
pub struct View {
    /// Frames of the same scene, which differ in their noise alone. They carry the nominal calibration.
    pub frames: Vec<RgbdFrame>,
    /// Place in the scene + 1 of what each pixel truly shows, 0 for table and floor.
    pub labels: Vec<u16>,
}

/// Draws views.
pub struct Eye {
    renderer: Renderer,
    cuboid: Arc<Mesh>,
}

impl Eye {
    /// One that draws with `renderer`.
    pub fn new(renderer: Renderer) -> Eye {
        Eye { renderer, cuboid: Arc::new(Mesh::unit_box()) }
    }

    /// The view of a scene whose noise is drawn from a seed; `None` where the scene is not one that could be judged: a
    /// thing is cut off, hidden or smaller than `least_pixels`, or there is no edge between things that touch. Without
    /// `least_pixels` any view will do.
    ///
    /// # Errors
    /// The renderer fails.
    pub fn view(
        &mut self,
        plan: &Plan,
        scene: &Scene,
        least_pixels: Option<usize>,
        seed: u64,
    ) -> anyhow::Result<Option<View>> {
        let (sensor, mut rng) = sensor(plan, seed)?;
        let camera = sensor.true_camera(&scene.camera);
        let rendered = self.renderer.render(&self.stage(scene, None), &camera)?;
        let labels: Vec<u16> = rendered.ids.iter().map(|id| id.saturating_sub(FIRST - 1) as u16).collect();
        if let Some(least_pixels) = least_pixels
            && !(whole(&labels, &rendered, scene.things.len(), least_pixels)
                && touching(scene).all(|pair| edge_between(plan, &rendered, &camera.intrinsics, &labels, pair))
                && self.seen(plan, scene, &camera, &labels)?)
        {
            return Ok(None);
        }
        let frame = |number| frame(scene, &sensor, &rendered, number, &mut rng);
        let frames = (0..plan.camera.frames as u64).map(frame).collect::<anyhow::Result<_>>()?;
        Ok(Some(View { frames, labels }))
    }

    /// Whether enough of each thing's silhouette is seen.
    fn seen(&mut self, plan: &Plan, scene: &Scene, camera: &CameraModel, labels: &[u16]) -> anyhow::Result<bool> {
        for at in 0..scene.things.len() {
            let alone = self.renderer.render(&self.stage(scene, Some(at)), camera)?;
            let all = alone.ids.iter().filter(|id| **id >= FIRST).count();
            let seen = labels.iter().filter(|label| usize::from(**label) == at + 1).count();
            if (seen as f64) < plan.layout.least_seen_share * all as f64 {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The scene for the renderer, or one of its things alone.
    fn stage(&self, scene: &Scene, alone: Option<usize>) -> acm_render::Scene {
        let cuboid = |size: DVec3, middle: DVec3, color, id| Instance {
            mesh: self.cuboid.clone(),
            pose: Pose::from_translation(middle),
            scale: size,
            material: Material::plain(color),
            id,
        };
        let mut lights = scene.lights.clone();
        let mut instances = Vec::new();
        if alone.is_none() {
            let middle = DVec3::Z * (TABLE_M - 0.5 * TABLE_SIZE.z);
            instances.push(cuboid(TABLE_SIZE, middle, scene.table, TABLE));
            instances.push(cuboid(DVec3::new(12.0, 12.0, 0.02), DVec3::Z * -0.01, [150, 146, 140], FLOOR));
        } else {
            lights.sun.shadow_map = 0;
        }
        let wanted = |(at, _): &(usize, &Thing)| alone.is_none_or(|alone| alone == *at);
        for (at, thing) in scene.things.iter().enumerate().filter(wanted) {
            instances.extend(thing.pieces.iter().map(|piece| Instance {
                mesh: piece.mesh.clone(),
                pose: thing.pose * piece.pose,
                scale: piece.scale,
                material: piece.material,
                id: FIRST + at as u32,
            }));
        }
        acm_render::Scene { instances, lights, background: [200, 200, 205] }
    }
}

/// Noise has a stream of its own, so that it never shifts what scenes are drawn.
const STREAM_SENSOR: u64 = 1;

/// The sensor of a seed, with its errors of calibration, and where its noise is drawn from.
pub(super) fn sensor(plan: &Plan, seed: u64) -> anyhow::Result<(SensorEpisode, ChaCha8Rng)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(STREAM_SENSOR);
    let sensor = SensorProfile::named(&plan.profile)?.episode(&mut rng);
    Ok((sensor, rng))
}

fn frame(
    scene: &Scene,
    sensor: &SensorEpisode,
    rendered: &Rendered,
    number: u64,
    rng: &mut ChaCha8Rng,
) -> anyhow::Result<RgbdFrame> {
    let measured = sensor.measure(rendered, &scene.camera, rng);
    let header = FrameHeader {
        id: FrameId(number),
        camera: scene.camera.name.clone(),
        time: Time::from_seconds(BETWEEN_S * number as f64),
        intrinsics: scene.camera.intrinsics,
        camera_pose: scene.camera.pose,
    };
    RgbdFrame::new(header, measured.color.into(), measured.depth.into()).context("the renderer's frame")
}

/// Whether each thing is seen, and none is cut off by the image's border.
fn whole(labels: &[u16], rendered: &Rendered, things: usize, least_pixels: usize) -> bool {
    let (width, height) = (rendered.width as usize, rendered.height as usize);
    let mut counts = vec![0; things + 1];
    for (index, label) in labels.iter().enumerate() {
        let (column, row) = (index % width, index / width);
        if *label > 0 && (column == 0 || row == 0 || column + 1 == width || row + 1 == height) {
            return false;
        }
        if let Some(count) = counts.get_mut(usize::from(*label)) {
            *count += 1;
        }
    }
    counts.iter().skip(1).all(|count| *count >= least_pixels)
}

/// The pairs of labels of things that touch.
fn touching(scene: &Scene) -> impl Iterator<Item = [u16; 2]> + '_ {
    let pairs = scene.things.iter().enumerate().filter_map(|(at, thing)| Some((at, thing.touches?)));
    pairs.filter(|(a, b)| a < b).map(|(a, b)| [a as u16 + 1, b as u16 + 1])
}

/// Whether colour, normal or depth tells two things apart along enough of their common border.
fn edge_between(plan: &Plan, rendered: &Rendered, intrinsics: &Intrinsics, labels: &[u16], pair: [u16; 2]) -> bool {
    let width = rendered.width as usize;
    let label = |index: usize| labels.get(index).copied().unwrap_or(0);
    let is_pair = |a: usize, b: usize| [[label(a), label(b)], [label(b), label(a)]].contains(&pair);
    let (mut border, mut edges) = (0usize, 0usize);
    for index in 0..labels.len() {
        for step in [1, width] {
            if label(index) == 0 || !is_pair(index, index + step) {
                continue;
            }
            border += 1;
            edges += usize::from(is_edge(plan, rendered, intrinsics, labels, index, step));
        }
    }
    // Without a common border in the image the table lies between them.
    border == 0 || edges as f64 >= plan.edge.least_share * border as f64
}

/// Whether there is an edge between a pixel and the one `step` after it.
fn is_edge(
    plan: &Plan,
    rendered: &Rendered,
    intrinsics: &Intrinsics,
    labels: &[u16],
    from: usize,
    step: usize,
) -> bool {
    let lab = |index: usize| {
        let color: Option<[u8; 3]> = rendered.color.get(3 * index..3 * index + 3).and_then(|c| c.try_into().ok());
        Lab::from_srgb(color.unwrap_or_default())
    };
    let depth = |index: usize| f64::from(rendered.depth.get(index).copied().unwrap_or(0.0));
    let edge = &plan.edge;
    let to = from + step;
    if (depth(from) - depth(to)).abs() > edge.depth_m || lab(from).distance(&lab(to)) > edge.color {
        return true;
    }
    let inward = SPAN_PX * step as isize;
    let normal = |at: usize, by: isize| normal(rendered, intrinsics, labels, at, by);
    match (normal(from, -inward), normal(to, inward)) {
        (Some(a), Some(b)) => a.angle_between(b).to_degrees() > edge.normal_deg,
        _ => false,
    }
}

/// Direction of the surface `by` pixels away from one, where that is the same thing.
fn normal(rendered: &Rendered, intrinsics: &Intrinsics, labels: &[u16], at: usize, by: isize) -> Option<DVec3> {
    let width = rendered.width as usize;
    let own = labels.get(at).copied()?;
    let middle = at.checked_add_signed(by)?;
    let point = |index: Option<usize>| {
        let index = index?;
        if labels.get(index).copied()? != own {
            return None;
        }
        let depth = f64::from(rendered.depth.get(index).copied()?);
        Some(intrinsics.ray((index % width) as f64, (index / width) as f64) * depth)
    };
    let across = |step: isize| Some(point(middle.checked_add_signed(step))? - point(middle.checked_add_signed(-step))?);
    across(1)?.cross(across(width as isize)?).try_normalize()
}
