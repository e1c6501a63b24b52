//! Ingest: which depths are believed, a smoothed copy of them, and the colour image in CIELAB.

use crate::{config::GrounderConfig, grid::Grid};
use acm_concept::{
    camera::{Intrinsics, MAX_PIXELS, RgbdFrame},
    color::{Appearance, Lab, Palette},
    object::Blindness,
};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::OnceLock;

/// So many pixels of a segment make its palette.
const PALETTE_SAMPLES: usize = 1500;
/// An image with fewer bright pixels is black. A white one must be whiter still: a bright table may nearly fill it.
const FEW_BRIGHT: f64 = 0.05;
const FEW_COLORED: f64 = 0.01;
/// A channel from this value on is saturated.
const WHITE: u8 = 250;
/// Depth in another unit: this share of the pixels was measured, and so many times more than are believed.
const MEASURED: f64 = 0.5;
const TIMES_BELIEVED: f64 = 10.0;

/// A frame as the pipeline reads it. All planes have the shape of `grid`.
pub(crate) struct Scan {
    pub grid: Grid,
    pub intrinsics: Intrinsics,
    /// Depth in metres, 0 where none is believed.
    pub depth: Vec<f32>,
    /// Depth averaged over neighbours on the same surface, lone holes filled; 0 elsewhere.
    pub smooth: Vec<f32>,
    /// CIELAB of every pixel.
    pub lab: Vec<[f32; 3]>,
    /// Share of the pixels with a depth.
    pub depth_fraction: f64,
}

/// Colour with the strength of the light taken out: a and b over L + 16, which all scale with the cube root of the
/// illumination, times 80 so that the numbers compare with CIELAB's at medium lightness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tint {
    pub a: f32,
    pub b: f32,
}

impl Tint {
    pub fn new(l: f32, a: f32, b: f32) -> Tint {
        Tint { a: 80.0 * a / (l + 16.0), b: 80.0 * b / (l + 16.0) }
    }
    pub fn of(lab: &Lab) -> Tint {
        Tint::new(lab.l as f32, lab.a as f32, lab.b as f32)
    }
    pub fn distance(&self, other: &Tint) -> f32 {
        // The numbers are small: `hypot` would guard against an overflow that cannot be.
        ((self.a - other.a).powi(2) + (self.b - other.b).powi(2)).sqrt()
    }
}

impl Scan {
    /// Reads a frame, or says why it shows nothing.
    pub fn read(frame: &RgbdFrame, config: &GrounderConfig) -> Result<Scan, (Blindness, f64)> {
        let intrinsics = frame.header.intrinsics;
        let grid = Grid { width: intrinsics.width as usize, height: intrinsics.height as usize };
        let complete = frame.depth.len() == grid.len() && frame.color.len() == 3 * grid.len();
        if !complete
            || grid.width < 16
            || grid.height < 16
            || grid.len() > MAX_PIXELS
            || !frame.header.camera_pose.is_valid()
        {
            return Err((Blindness::NoDepth, 0.0));
        }
        let believed = |&z: &f32| if z >= config.depth_min_m && z <= config.depth_max_m { z } else { 0.0 };
        let depth: Vec<f32> = frame.depth.iter().map(believed).collect();
        let depth_fraction = depth.iter().filter(|z| **z > 0.0).count() as f64 / grid.len() as f64;
        if depth_fraction < config.min_depth_fraction {
            let measured = frame.depth.iter().filter(|z| z.is_finite() && **z > 0.0).count() as f64 / grid.len() as f64;
            let scaled = measured > MEASURED && measured > TIMES_BELIEVED * depth_fraction;
            let reason = if scaled { Blindness::DepthScale } else { Blindness::NoDepth };
            return Err((reason, depth_fraction));
        }
        let brightest = |pixel: &[u8]| pixel.iter().copied().max().unwrap_or(0) >= config.min_brightness;
        if share(&frame.color, brightest) < FEW_BRIGHT {
            return Err((Blindness::NoColor, depth_fraction));
        }
        if share(&frame.color, |pixel| pixel.iter().any(|value| *value < WHITE)) < FEW_COLORED {
            return Err((Blindness::Overexposed, depth_fraction));
        }
        let smooth = smooth(grid, &depth, config);
        let color = &frame.color;
        let lab = grid.map(|index| to_lab([color[3 * index], color[3 * index + 1], color[3 * index + 2]]));
        Ok(Scan { grid, intrinsics, depth, smooth, lab, depth_fraction })
    }

    /// The viewing ray of a pixel in the camera frame, z = 1.
    pub fn ray(&self, index: usize) -> DVec3 {
        self.intrinsics.ray(self.grid.column(index) as f64, self.grid.row(index) as f64)
    }
    /// The tint of a pixel.
    pub fn tint(&self, index: usize) -> Tint {
        let [l, a, b] = self.lab[index];
        Tint::new(l, a, b)
    }
    /// Mean colour and spread of some pixels.
    pub fn appearance(&self, pixels: &[usize]) -> Appearance {
        let count = pixels.len().max(1) as f64;
        let mut sum = [0f64; 3];
        for &pixel in pixels {
            for (total, value) in sum.iter_mut().zip(self.lab[pixel]) {
                *total += f64::from(value);
            }
        }
        let mean = sum.map(|total| total / count);
        let distance2 = |&pixel: &usize| -> f64 {
            self.lab[pixel].iter().zip(mean).map(|(value, m)| (f64::from(*value) - m).powi(2)).sum()
        };
        let variance = pixels.iter().map(distance2).sum::<f64>() / count;
        let mut palette = Palette::default();
        let color = |&pixel: &usize| {
            let [l, a, b] = self.lab[pixel].map(f64::from);
            Lab { l, a, b }
        };
        let step = (pixels.len() / PALETTE_SAMPLES).max(1);
        pixels.iter().step_by(step).for_each(|pixel| palette.add(&color(pixel), 1.0));
        let mean = Lab { l: mean[0], a: mean[1], b: mean[2] };
        Appearance { mean, spread: variance.sqrt(), palette: palette.normalised() }
    }
}

/// The share of the pixels of which something holds, from a sample.
fn share(color: &[u8], holds: impl Fn(&[u8]) -> bool) -> f64 {
    let pixels = || color.chunks_exact(3).step_by(7);
    pixels().filter(|pixel| holds(pixel)).count() as f64 / pixels().count().max(1) as f64
}

/// Averages each depth with those of its 5x5 neighbours that lie on the same surface; fills lone holes.
fn smooth(grid: Grid, depth: &[f32], config: &GrounderConfig) -> Vec<f32> {
    let mut out = vec![0f32; depth.len()];
    out.par_chunks_mut(grid.width).enumerate().with_min_len(16).for_each(|(row, out)| {
        // The depth each pixel is compared with, and how near to it is the same surface; nothing is near to no depth.
        let reference = |column: usize| match depth[grid.index(column, row)] {
            0.0 => hole(grid, depth, column, row).unwrap_or((0.0, 0.0)),
            z => (z, 0.006 + 3.0 * config.depth_sigma_m(f64::from(z)) as f32),
        };
        let (centre, gate_m): (Vec<f32>, Vec<f32>) = (0..grid.width).map(reference).unzip();
        let (mut sum, mut count) = (vec![0f32; grid.width], vec![0f32; grid.width]);
        for other in row.saturating_sub(2)..=(row + 2).min(grid.height - 1) {
            let line = &depth[other * grid.width..(other + 1) * grid.width];
            for shift in 0..5 {
                // The neighbour `shift - 2` columns on; a whole row at once, without a branch.
                let (skip, from) = (2usize.saturating_sub(shift), shift.saturating_sub(2));
                let references = centre[skip..].iter().zip(&gate_m[skip..]);
                let sums = sum[skip..].iter_mut().zip(&mut count[skip..]);
                for (((sum, count), (centre, gate_m)), &z) in sums.zip(references).zip(&line[from..]) {
                    let near = if (z - centre).abs() < *gate_m && z > 0.0 { 1.0 } else { 0.0 };
                    *sum += near * z;
                    *count += near;
                }
            }
        }
        for (((out, sum), count), centre) in out.iter_mut().zip(&sum).zip(&count).zip(&centre) {
            *out = if *count > 0.0 { sum / count } else { *centre };
        }
    });
    out
}

/// A depth for a hole whose direct surroundings are mostly measured and of one surface.
fn hole(grid: Grid, depth: &[f32], column: usize, row: usize) -> Option<(f32, f32)> {
    if column == 0 || row == 0 || column + 1 >= grid.width || row + 1 >= grid.height {
        return None;
    }
    let (mut low, mut high, mut sum, mut count) = (f32::MAX, 0f32, 0f32, 0f32);
    for r in row - 1..=row + 1 {
        for &z in depth[r * grid.width + column - 1..=r * grid.width + column + 1].iter().filter(|z| **z > 0.0) {
            (low, high, sum, count) = (low.min(z), high.max(z), sum + z, count + 1.0);
        }
    }
    (count >= 5.0 && high - low < 0.012 * high).then(|| (sum / count, 0.02 * high))
}

/// [`Lab::from_srgb`] by tables: a frame has too many pixels for powers and roots.
fn to_lab(rgb: [u8; 3]) -> [f32; 3] {
    const STEPS: usize = 4096;
    static TABLES: OnceLock<(Vec<f32>, Vec<f32>)> = OnceLock::new();
    let (linear, root) = TABLES.get_or_init(|| {
        let linear = (0..256)
            .map(|i| i as f64 / 255.0)
            .map(|c| (if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32);
        let root = (0..=STEPS + 1)
            .map(|i| i as f64 / STEPS as f64)
            .map(|t| (if t > 216.0 / 24389.0 { t.cbrt() } else { (24389.0 / 27.0 * t + 16.0) / 116.0 }) as f32);
        (linear.collect(), root.collect())
    });
    let [r, g, b] = rgb.map(|channel| linear[usize::from(channel)]);
    let f = |t: f32| {
        let at = t.clamp(0.0, 1.0) * STEPS as f32;
        let low = at as usize;
        root[low] + (root[low + 1] - root[low]) * (at - low as f32)
    };
    let fx = f((0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b) / 0.95047);
    let fy = f(0.212_672_9 * r + 0.715_152_2 * g + 0.072_175 * b);
    let fz = f((0.019_333_9 * r + 0.119_192 * g + 0.950_304_1 * b) / 1.08883);
    [116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_agree_with_the_exact_colour() {
        for rgb in [[0, 0, 0], [255, 255, 255], [10, 200, 30], [1, 2, 3], [250, 10, 128], [90, 90, 91]] {
            let (exact, [l, a, b]) = (Lab::from_srgb(rgb), to_lab(rgb));
            let near = Lab { l: f64::from(l), a: f64::from(a), b: f64::from(b) };
            assert!(exact.distance(&near) < 0.15, "{rgb:?}: {exact:?} {near:?}");
        }
    }

    #[test]
    fn tint_does_not_change_with_the_light() {
        // Linear light halved: sRGB 180 -> 132, 90 -> 64, 60 -> 41.
        let tint = |rgb| {
            let [l, a, b] = to_lab(rgb);
            Tint::new(l, a, b)
        };
        let (full, half) = (tint([180, 90, 60]), tint([132, 64, 41]));
        assert!(full.distance(&half) < 1.5, "{full:?} {half:?}");
    }

    #[test]
    fn a_lone_hole_is_filled_and_an_edge_is_kept() {
        let grid = Grid { width: 16, height: 16 };
        let mut depth: Vec<f32> = (0..256).map(|i| if i % 16 < 8 { 0.8 } else { 1.2 }).collect();
        depth[5 * 16 + 4] = 0.0;
        let smooth = smooth(grid, &depth, &GrounderConfig::default());
        assert!((smooth[5 * 16 + 4] - 0.8).abs() < 1e-6);
        assert!((smooth[5 * 16 + 7] - 0.8).abs() < 1e-6 && (smooth[5 * 16 + 8] - 1.2).abs() < 1e-6);
    }
}
