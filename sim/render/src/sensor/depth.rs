//! From exact depth to what a stereo matcher reports.

use super::{
    SensorErrors,
    edges::{Edges, JUMP_PX},
    noise::SmoothNoise,
    occlusion::Occlusion,
};
use crate::renderer::Rendered;
use acm_concept::camera::{CameraModel, Intrinsics};
use rand::RngCore;
use rand_chacha::ChaCha8Rng;

/// Distance between the two imagers, metres.
const BASELINE_M: f32 = 0.05;
/// Focal length of the depth imagers as a fraction of the image width: 384 pixels of 640.
const FOCAL_WIDTHS: f32 = 384.0 / 640.0;
/// How far an edge does harm varies along it, in steps of a pixel: standard normal noise exceeds the first value in
/// two thirds of all places, the second in one third.
const REACH_STEPS: [f32; 2] = [0.431, 0.967];

/// Adds the sensor's errors to the depth of a frame; metres, 0 where nothing is measured.
pub(crate) fn measure(
    rendered: &Rendered,
    camera: &CameraModel,
    errors: &SensorErrors,
    depth_scale: f32,
    rng: &mut ChaCha8Rng,
) -> Vec<f32> {
    let width = rendered.width as usize;
    if width == 0 {
        return Vec::new();
    }
    let matcher = Matcher::new(rendered, &camera.intrinsics, errors);
    let report = Report::new(camera, errors, matcher.focal_baseline, depth_scale);
    let mut noise = Noise::new(width, rng);
    let mut occlusion = Occlusion::default();
    let mut hidden = vec![false; width];
    let mut in_image = vec![0f32; width];
    let mut measured = vec![0f32; rendered.depth.len()];
    for (row, out) in measured.chunks_exact_mut(width).enumerate() {
        noise.next_row(errors, rng);
        let line = &matcher.disparity[row * width..(row + 1) * width];
        for (here, d) in in_image.iter_mut().zip(line) {
            *here = d * matcher.image_scale;
        }
        occlusion.mark(&in_image, &mut hidden);
        for (column, z) in out.iter_mut().enumerate() {
            if hidden[column] || noise.is_hole(column) {
                continue;
            }
            let shift = (noise.right[column], noise.down[column]);
            let found = matcher.look(column, row, shift, noise.edge[column]);
            *z = report.depth(found, noise.disparity[column]);
        }
    }
    measured
}

/// The exact scene as the matcher sees it.
struct Matcher<'a> {
    intrinsics: &'a Intrinsics,
    width: usize,
    height: usize,
    /// Focal length of the imagers times baseline, pixel metres: disparity times depth.
    focal_baseline: f32,
    /// Pixels of the image to a pixel of the imagers.
    image_scale: f32,
    disparity: Vec<f32>,
    edges: Edges,
    reach: u8,
    /// Squared cosine of the largest angle at which a surface is measured.
    grazing: f32,
}

impl<'a> Matcher<'a> {
    fn new(rendered: &Rendered, intrinsics: &'a Intrinsics, errors: &SensorErrors) -> Matcher<'a> {
        let (width, height) = (rendered.width as usize, rendered.height as usize);
        let focal = FOCAL_WIDTHS * rendered.width as f32;
        let focal_baseline = focal * BASELINE_M;
        let disparity: Vec<f32> =
            rendered.depth.iter().map(|&z| if z > 0.0 { focal_baseline / z } else { 0.0 }).collect();
        let edges = Edges::find(&disparity, width, errors.edge_reach_px);
        let image_scale = intrinsics.fx as f32 / focal;
        let grazing = errors.grazing_deg.to_radians().cos().powi(2);
        let reach = errors.edge_reach_px;
        Matcher { intrinsics, width, height, focal_baseline, image_scale, disparity, edges, reach, grazing }
    }

    /// The disparity that the matcher finds for a pixel, without noise; 0 if it finds none. `shift` is where it
    /// looks instead of at the pixel's centre, `edge` (standard normal) what an edge nearby does to it.
    fn look(&self, column: usize, row: usize, shift: (f32, f32), edge: f32) -> f32 {
        let index = row * self.width + column;
        let distance = self.edges.distance[index];
        if distance == 0 {
            return self.look_at_surface(column, row, shift);
        }
        let at =
            |place: usize, shift: f32, size: usize| place.saturating_add_signed(shift.round() as isize).min(size - 1);
        let seen = self.disparity[at(row, shift.1, self.height) * self.width + at(column, shift.0, self.width)];
        let steps = REACH_STEPS.iter().filter(|&&step| edge.abs() > step).count() as u8;
        if distance > self.reach.saturating_sub(2) + steps {
            return seen;
        }
        let foreground = self.edges.foreground[index];
        if edge < 0.0 {
            0.0
        } else if foreground > seen + JUMP_PX {
            foreground
        } else {
            seen
        }
    }

    /// As `look`, where the neighbours belong to the same surface.
    fn look_at_surface(&self, column: usize, row: usize, shift: (f32, f32)) -> f32 {
        let index = row * self.width + column;
        let d = self.disparity[index];
        let slope = |place: usize, size: usize, step: usize| {
            let (before, after) = (usize::from(place > 0), usize::from(place + 1 < size));
            let rise = self.disparity[index + after * step] - self.disparity[index - before * step];
            rise / (before + after).max(1) as f32
        };
        let (right, down) = (slope(column, self.width, 1), slope(row, self.height, self.width));
        // Inverse depth, and so disparity, is linear over the image of a plane: its gradient gives the normal.
        let i = self.intrinsics;
        let (fx, fy) = (i.fx as f32, i.fy as f32);
        let (u, v) = (column as f32 - i.cx as f32, row as f32 - i.cy as f32);
        let forward = d - u * right - v * down;
        let normal_squared = (fx * right).powi(2) + (fy * down).powi(2) + forward.powi(2);
        let ray_squared = (u / fx).powi(2) + (v / fy).powi(2) + 1.0;
        if d * d < self.grazing * normal_squared * ray_squared {
            return 0.0;
        }
        d + right * shift.0 + down * shift.1
    }
}

/// How a disparity is reported.
struct Report {
    steps_per_px: f32,
    /// Reported depth at a disparity of one step, metres.
    depth_of_step: f32,
    min: f32,
    max: f32,
}

impl Report {
    fn new(camera: &CameraModel, errors: &SensorErrors, focal_baseline: f32, depth_scale: f32) -> Report {
        Report {
            steps_per_px: 1.0 / errors.disparity_step_px,
            depth_of_step: depth_scale * focal_baseline / errors.disparity_step_px,
            min: errors.depth_min_m.max(camera.depth_min_m as f32),
            max: errors.depth_max_m.min(camera.depth_max_m as f32),
        }
    }

    fn depth(&self, disparity: f32, noise: f32) -> f32 {
        if disparity <= 0.0 {
            return 0.0;
        }
        // Rounds by cutting off, which is much faster than `round`; what is negative becomes 0.
        let steps = ((disparity + noise) * self.steps_per_px + 0.5) as u32;
        if steps == 0 {
            return 0.0;
        }
        let z = self.depth_of_step / steps as f32;
        if z >= self.min && z <= self.max { z } else { 0.0 }
    }
}

/// All noise of one row of pixels.
struct Noise {
    fields: [SmoothNoise; 4],
    /// Error of the disparity, pixels.
    disparity: Vec<f32>,
    /// Where a pixel looks instead of at its centre, pixels.
    right: Vec<f32>,
    down: Vec<f32>,
    /// What an edge does, standard normal.
    edge: Vec<f32>,
    dice: Vec<u8>,
    hole_limit: u32,
}

impl Noise {
    fn new(width: usize, rng: &mut ChaCha8Rng) -> Noise {
        let row = || vec![0f32; width];
        let fields = std::array::from_fn(|_| SmoothNoise::new(width, rng));
        let (disparity, right, down, edge) = (row(), row(), row(), row());
        Noise { fields, disparity, right, down, edge, dice: vec![0; 2 * width], hole_limit: 0 }
    }

    fn next_row(&mut self, errors: &SensorErrors, rng: &mut ChaCha8Rng) {
        let [disparity, right, down, edge] = &mut self.fields;
        disparity.next_row(errors.disparity_sigma_px, rng, &mut self.disparity);
        right.next_row(errors.lateral_sigma_px, rng, &mut self.right);
        down.next_row(errors.lateral_sigma_px, rng, &mut self.down);
        edge.next_row(1.0, rng, &mut self.edge);
        rng.fill_bytes(&mut self.dice);
        self.hole_limit = (errors.hole_share * 65_536.0) as u32;
    }

    fn is_hole(&self, column: usize) -> bool {
        u32::from(u16::from_le_bytes([self.dice[2 * column], self.dice[2 * column + 1]])) < self.hole_limit
    }
}
