//! A stereo depth camera with the usual faults: correlated noise, quantisation, holes, edges, shadow, bias.

use crate::world::World;
use acm_concept::{
    camera::{FrameHeader, Intrinsics, RgbdFrame},
    ids::FrameId,
    pose::Pose,
    time::Time,
};
use glam::{DQuat, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const BASELINE_M: f64 = 0.05;
const FOCAL_PX: f64 = 385.0;
const DISPARITY_SIGMA_PX: f64 = 0.08;

pub struct Sensor {
    pub intrinsics: Intrinsics,
    pub nominal: Pose,
}

impl Sensor {
    pub fn new(nominal: Pose) -> Sensor {
        Sensor { intrinsics: Intrinsics::from_vertical_fov(640, 480, 50f64.to_radians()), nominal }
    }

    /// A frame of a world. Bias and noise follow from the seed; the header holds the nominal pose.
    pub fn capture(&self, world: &World, seed: u64) -> RgbdFrame {
        // The bias belongs to the episode, the noise to the frame.
        let mut bias = ChaCha8Rng::seed_from_u64(seed / 100);
        let mut noise = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed_0000);
        let tilt = DVec3::new(normal(&mut bias), normal(&mut bias), normal(&mut bias)) * 0.3f64.to_radians();
        let shift = DVec3::new(normal(&mut bias), normal(&mut bias), normal(&mut bias)) * 0.002;
        let scale = 1.0 + (0.008 * normal(&mut bias)).clamp(-0.015, 0.015);
        let truth = self.nominal * Pose::new(shift, DQuat::from_scaled_axis(tilt));
        let (color, exact) = world.render(&self.intrinsics, &truth);
        let depth: Vec<f32> = self.measure(&exact, &mut noise).into_iter().map(|z| (z * scale) as f32).collect();
        let color: Vec<u8> = color
            .into_iter()
            .map(|value| (f64::from(value) + 2.5 * normal(&mut noise)).clamp(0.0, 255.0) as u8)
            .collect();
        let header = FrameHeader {
            id: FrameId(seed),
            camera: "head".into(),
            time: Time::ZERO,
            intrinsics: self.intrinsics,
            camera_pose: self.nominal,
        };
        RgbdFrame { header, color: color.into(), depth: depth.into() }
    }

    fn measure(&self, exact: &[f64], random: &mut ChaCha8Rng) -> Vec<f64> {
        let (width, height) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let field = correlated(width, height, random);
        let mut out = vec![0.0; exact.len()];
        for row in 0..height {
            for column in 0..width {
                let index = row * width + column;
                let from = |at: usize, limit: usize, random: &mut ChaCha8Rng| {
                    (at as f64 + 0.5 * normal(random)).round().clamp(0.0, limit as f64 - 1.0) as usize
                };
                let (c, r) = (from(column, width, random), from(row, height, random));
                let z = exact[r * width + c];
                let edge = is_edge(exact, width, height, column, row);
                if z <= 0.0 || z > 6.0 || random.random_bool(0.01) || (edge && random.random_bool(0.5)) {
                    continue;
                }
                let disparity = FOCAL_PX * BASELINE_M / z + DISPARITY_SIGMA_PX * field[index];
                out[index] = FOCAL_PX * BASELINE_M / ((disparity * 32.0).round() / 32.0);
            }
        }
        self.shadow(exact, &mut out);
        out
    }

    /// Pixels that the right imager does not see because something nearer stands to their right in its view.
    fn shadow(&self, exact: &[f64], out: &mut [f64]) {
        let width = self.intrinsics.width as usize;
        for row in exact.chunks_exact(width).enumerate() {
            let (r, line) = row;
            let mut least = f64::INFINITY;
            // In the right image a point at column u lies at u - d: points from the right must not overtake.
            for column in (0..width).rev() {
                let z = line[column];
                if z <= 0.0 {
                    continue;
                }
                let seen_at = column as f64 - self.intrinsics.fx * BASELINE_M / z;
                if seen_at > least - 0.5 {
                    out[r * width + column] = 0.0;
                }
                least = least.min(seen_at);
            }
        }
    }
}

fn is_edge(exact: &[f64], width: usize, height: usize, column: usize, row: usize) -> bool {
    let z = exact[row * width + column];
    let around = |dc: isize, dr: isize| {
        let c = column.checked_add_signed(dc).filter(|c| *c < width);
        let r = row.checked_add_signed(dr).filter(|r| *r < height);
        c.zip(r).map_or(z, |(c, r)| exact[r * width + c])
    };
    (-2..=2).any(|dr| (-2..=2).any(|dc| (around(dc, dr) - z).abs() > 0.02))
}

/// Unit-variance noise, blurred over about five pixels.
fn correlated(width: usize, height: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
    let white: Vec<f64> = (0..width * height).map(|_| normal(random)).collect();
    let kernel = [0.06, 0.24, 0.4, 0.24, 0.06];
    let blur = |values: &[f64], step: usize, limit: usize, place: &dyn Fn(usize) -> usize| -> Vec<f64> {
        (0..values.len())
            .map(|i| {
                let taps = kernel.iter().enumerate().map(|(k, weight)| {
                    let at = (place(i) as isize + k as isize - 2).clamp(0, limit as isize - 1);
                    let offset = (at - place(i) as isize) * step as isize;
                    weight * values[(i as isize + offset) as usize]
                });
                taps.sum::<f64>()
            })
            .collect()
    };
    let across = blur(&white, 1, width, &|i| i % width);
    let both = blur(&across, width, height, &|i| i / width);
    let gain: f64 = kernel.iter().map(|k| k * k).sum();
    both.into_iter().map(|v| v / gain).collect()
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (random.random::<f64>().max(1e-12), random.random());
    (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}
