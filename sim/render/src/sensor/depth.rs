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
/// Three halves of 2^23: next to it floats have steps of 1.
const DROPS_FRACTIONS: f32 = 12_582_912.0;

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
    let mut found = vec![0f32; width];
    let mut measured = vec![0f32; rendered.depth.len()];
    for (row, out) in measured.chunks_exact_mut(width).enumerate() {
        noise.next_row(errors, rng);
        matcher.look_at_surfaces(row, &noise, &mut found);
        matcher.look_at_edges(row, &noise, &mut found);
        report.depths(&found, &noise.disparity, out);
        occlusion.mark(matcher.line(row), matcher.image_scale, &mut hidden);
        for ((z, hidden), dice) in out.iter_mut().zip(&hidden).zip(noise.dice.chunks_exact(2)) {
            let lost = u32::from(u16::from_le_bytes([dice[0], dice[1]])) < noise.hole_limit;
            *z = if *hidden || lost { 0.0 } else { *z };
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
    columns: Vec<Column>,
    edges: Edges,
    reach: u8,
    /// Squared cosine of the largest angle at which a surface is measured.
    grazing: f32,
}

/// What the rays of a column have in common.
struct Column {
    /// Distance from the principal point, pixels.
    u: f32,
    /// Square of the ray's x where its z is 1.
    ray_squared: f32,
}

impl<'a> Matcher<'a> {
    fn new(rendered: &Rendered, intrinsics: &'a Intrinsics, errors: &SensorErrors) -> Matcher<'a> {
        let (width, height) = (rendered.width as usize, rendered.height as usize);
        let focal = FOCAL_WIDTHS * rendered.width as f32;
        let focal_baseline = focal * BASELINE_M;
        let disparity: Vec<f32> =
            rendered.depth.iter().map(|&z| if z > 0.0 { focal_baseline / z } else { 0.0 }).collect();
        let columns = (0..width).map(|column| {
            let u = column as f32 - intrinsics.cx as f32;
            Column { u, ray_squared: (u / intrinsics.fx as f32).powi(2) }
        });
        let columns = columns.collect();
        let edges = Edges::find(&disparity, width, errors.edge_reach_px);
        let image_scale = intrinsics.fx as f32 / focal;
        let grazing = errors.grazing_deg.to_radians().cos().powi(2);
        let reach = errors.edge_reach_px;
        Matcher { intrinsics, width, height, focal_baseline, image_scale, disparity, columns, edges, reach, grazing }
    }

    fn line(&self, row: usize) -> &[f32] {
        &self.disparity[row * self.width..(row + 1) * self.width]
    }

    /// Writes the disparity that the matcher finds for each pixel of a row, without noise, as if the neighbours
    /// belonged to the same surface; 0 where it finds none. Free of branches, so that the compiler takes several
    /// pixels at a time: most pixels are of this kind.
    fn look_at_surfaces(&self, row: usize, noise: &Noise, found: &mut [f32]) {
        let i = self.intrinsics;
        let (fx, fy, v) = (i.fx as f32, i.fy as f32, row as f32 - i.cy as f32);
        let ray_down_squared = (v / fy).powi(2) + 1.0;
        let (above, below) = (row.saturating_sub(1), (row + 1).min(self.height - 1));
        let per_row = 1.0 / (below - above).max(1) as f32;
        let vertical = self.line(above).iter().zip(self.line(below)).zip(&noise.down);
        let horizontal = self.line(row).iter().zip(&self.columns).zip(&noise.right);
        slopes(self.line(row), found);
        for ((out, ((d, column), right)), ((above, below), down)) in found.iter_mut().zip(horizontal).zip(vertical) {
            let (slope_right, slope_down) = (*out, (below - above) * per_row);
            // Inverse depth, and so disparity, is linear over the image of a plane: its gradient gives the normal.
            let forward = d - column.u * slope_right - v * slope_down;
            let normal_squared = (fx * slope_right).powi(2) + (fy * slope_down).powi(2) + forward * forward;
            let ray_squared = column.ray_squared + ray_down_squared;
            let steep = d * d < self.grazing * normal_squared * ray_squared;
            *out = if steep { 0.0 } else { d + slope_right * right + slope_down * down };
        }
    }

    /// Replaces what was found where an edge is near: there the pixel sees one of two surfaces, or nothing.
    fn look_at_edges(&self, row: usize, noise: &Noise, found: &mut [f32]) {
        let at =
            |place: usize, shift: f32, size: usize| place.saturating_add_signed(shift.round() as isize).min(size - 1);
        let start = row * self.width;
        let marks = self.edges.distance[start..start + self.width].iter().zip(&self.edges.foreground[start..]);
        for (column, ((distance, &foreground), out)) in marks.zip(found).enumerate() {
            if *distance == 0 {
                continue;
            }
            let (x, y) = (at(column, noise.right[column], self.width), at(row, noise.down[column], self.height));
            let seen = self.disparity[y * self.width + x];
            let edge = noise.edge[column];
            let steps = REACH_STEPS.iter().filter(|&&step| edge.abs() > step).count() as u8;
            let harmed = *distance <= self.reach.saturating_sub(2) + steps;
            *out = match harmed {
                true if edge < 0.0 => 0.0,
                true if foreground > seen + JUMP_PX => foreground,
                _ => seen,
            };
        }
    }
}

/// Change of the values from one to the next; one-sided at both ends.
fn slopes(line: &[f32], out: &mut [f32]) {
    let last = line.len() - 1;
    out[0] = line[last.min(1)] - line[0];
    out[last] = line[last] - line[last.saturating_sub(1)];
    if last >= 2 {
        for ((out, before), after) in out[1..last].iter_mut().zip(&line[..last - 1]).zip(&line[2..]) {
            *out = 0.5 * (after - before);
        }
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

    /// Depths of a row from the disparities found and their errors; 0 where nothing is found or out of range.
    fn depths(&self, found: &[f32], noise: &[f32], out: &mut [f32]) {
        for ((z, found), noise) in out.iter_mut().zip(found).zip(noise) {
            // Adding a number so large that fractions drop out rounds to the nearest, much faster than `round`.
            let steps = ((found + noise) * self.steps_per_px + DROPS_FRACTIONS) - DROPS_FRACTIONS;
            let depth = self.depth_of_step / steps;
            let valid = *found > 0.0 && steps > 0.0 && depth >= self.min && depth <= self.max;
            *z = if valid { depth } else { 0.0 };
        }
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
}
