//! What a stereo depth camera would have delivered instead of the exact image.
//!
//! The model works in disparity space, where a stereo matcher errs: `d = f B / z` with a baseline B of 50 mm and a
//! focal length f of 384 pixels at an image width of 640 (Intel RealSense D435), less in proportion for smaller images. A [`SensorProfile`] holds the
//! strengths; a [`SensorEpisode`] holds what stays the same from frame to frame: how wrong each camera's calibration
//! is. All randomness comes from the generators that are passed in, so a seed gives the same images on any machine.
//!
//! ```
//! use acm_render::sensor::SensorProfile;
//! use rand::SeedableRng;
//! let profile = SensorProfile::named("d435")?;
//! let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
//! let episode = profile.episode(&mut rng);
//! assert_eq!(episode.profile().name(), "d435");
//! assert!(SensorProfile::named("d453").is_err());
//! # Ok::<(), acm_render::sensor::UnknownProfile>(())
//! ```

mod color;
mod depth;
mod edges;
mod noise;
mod occlusion;

use crate::renderer::Rendered;
use acm_concept::{camera::CameraModel, pose::Pose};
use glam::{DQuat, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, UnitSphere};
use serde::Serialize;
use thiserror::Error;

/// Errors of calibration are cut at this many standard deviations: nobody ships a camera beyond them.
const MAX_DEVIATIONS: f64 = 3.0;

/// How well a sensor measures. Profiles are known by name: `none` (exact), `d435`, `d435-hard`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorProfile {
    name: &'static str,
    /// `None` for the exact sensor.
    errors: Option<SensorErrors>,
}

/// The strengths of a profile's errors. Disparities are in pixels of the depth imagers, which are as many pixels
/// wide as the image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct SensorErrors {
    /// Standard deviation of the disparity, pixels. Neighbouring pixels err alike.
    pub disparity_sigma_px: f32,
    /// Standard deviation of the place at which a pixel samples the scene, pixels of the image, each way.
    pub lateral_sigma_px: f32,
    /// Step in which disparity is reported, pixels.
    pub disparity_step_px: f32,
    /// Share of pixels without a value, anywhere.
    pub hole_share: f32,
    /// Farthest from a depth edge that it still does harm, pixels, 3 to [`edges::MAX_REACH`].
    pub edge_reach_px: u8,
    /// Surfaces that are seen at a larger angle from their normal than this are not measured, degrees.
    pub grazing_deg: f32,
    /// Standard deviation of a camera's error of scale in depth, a fraction.
    pub scale_sigma: f64,
    /// Standard deviation of a camera's displacement, metres.
    pub displacement_sigma_m: f64,
    /// Standard deviation of a camera's rotation, degrees.
    pub rotation_sigma_deg: f64,
    /// Standard deviation of the colour channels, 8-bit steps.
    pub color_sigma: f32,
    /// Nothing is measured nearer than this, whatever the camera model says, metres.
    pub depth_min_m: f32,
    /// Nothing is measured farther than this, whatever the camera model says, metres.
    pub depth_max_m: f32,
}

/// A profile that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("there is no sensor profile `{name}`; the profiles are: {}", SensorProfile::NAMES.join(", "))]
pub struct UnknownProfile {
    /// The name that was asked for.
    pub name: String,
}

impl SensorProfile {
    /// The names of all profiles.
    pub const NAMES: [&'static str; 3] = ["none", "d435", "d435-hard"];

    /// The profile of that name: `none` measures exactly, `d435` like a calibrated Intel RealSense D435 over a
    /// textured scene, `d435-hard` like one that is poorly calibrated, over poor texture.
    ///
    /// # Errors
    /// There is no such profile; the error lists them.
    pub fn named(name: &str) -> Result<SensorProfile, UnknownProfile> {
        match name {
            "none" => Ok(SensorProfile { name: "none", errors: None }),
            "d435" => Ok(SensorProfile { name: "d435", errors: Some(D435) }),
            "d435-hard" => Ok(SensorProfile { name: "d435-hard", errors: Some(D435_HARD) }),
            _ => Err(UnknownProfile { name: name.to_owned() }),
        }
    }

    /// The name by which results print it.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Draws what stays the same for an episode. Takes one number from the generator.
    pub fn episode(&self, rng: &mut ChaCha8Rng) -> SensorEpisode {
        SensorEpisode { profile: self.clone(), seed: rng.random() }
    }
}

/// Noise 0.08 pixels: at a width of 640 that is 1.0 mm at 0.5 m and 4.2 mm at 1 m. Scale error 0.75 %, mounted within 2 mm and 0.3 degrees.
const D435: SensorErrors = SensorErrors {
    disparity_sigma_px: 0.08,
    lateral_sigma_px: 0.5,
    disparity_step_px: 1.0 / 32.0,
    hole_share: 0.01,
    edge_reach_px: 3,
    grazing_deg: 78.0,
    scale_sigma: 0.0075,
    displacement_sigma_m: 0.002,
    rotation_sigma_deg: 0.3,
    color_sigma: 2.0,
    depth_min_m: 0.11,
    depth_max_m: 6.0,
};

const D435_HARD: SensorErrors = SensorErrors {
    disparity_sigma_px: 0.12,
    lateral_sigma_px: 0.8,
    hole_share: 0.04,
    edge_reach_px: 4,
    grazing_deg: 72.0,
    scale_sigma: 0.015,
    displacement_sigma_m: 0.004,
    rotation_sigma_deg: 0.6,
    color_sigma: 4.0,
    ..D435
};

/// A profile with the calibration errors of one episode. Each camera has its own, fixed by the episode's seed and
/// the camera's name.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorEpisode {
    profile: SensorProfile,
    seed: u64,
}

/// A frame as the sensor delivers it. Row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// 8-bit sRGB, `3 * width * height` values.
    pub color: Vec<u8>,
    /// Metres along the optical axis, `width * height` values; 0 where nothing was measured.
    pub depth: Vec<f32>,
}

/// One camera's errors of calibration.
struct Calibration {
    /// True pose of the camera in its nominal frame.
    offset: Pose,
    /// Measured depth over true depth.
    depth_scale: f64,
}

impl SensorEpisode {
    /// The profile it was drawn from.
    pub fn profile(&self) -> &SensorProfile {
        &self.profile
    }

    /// Where the camera really is: its nominal pose, displaced in any direction by a normal amount (2 mm for
    /// `d435`) and turned about any axis by a normal angle (0.3 degrees). Render with this one; tell the agent the
    /// nominal one.
    pub fn true_camera(&self, nominal: &CameraModel) -> CameraModel {
        CameraModel { pose: nominal.pose * self.calibration(&nominal.name).offset, ..nominal.clone() }
    }

    /// Measured depth over true depth of the camera of that name; 1 is perfect.
    pub fn depth_scale(&self, camera: &str) -> f64 {
        self.calibration(camera).depth_scale
    }

    /// What the sensor makes of an ideal frame. Of the camera its name, intrinsics and depth limits are used, so
    /// it does not matter whether it is the nominal or the true one.
    ///
    /// The exact sensor (`none`) only applies the camera's depth limits. The frame must be of the camera's size;
    /// pixels that it lacks are not measured.
    pub fn measure(&self, rendered: &Rendered, camera: &CameraModel, rng: &mut ChaCha8Rng) -> Measured {
        let Some(errors) = &self.profile.errors else {
            let range = camera.depth_min_m as f32..=camera.depth_max_m as f32;
            let depth = rendered.depth.iter().map(|z| if range.contains(z) { *z } else { 0.0 }).collect();
            return Measured { color: rendered.color.clone(), depth };
        };
        let depth_scale = self.depth_scale(&camera.name) as f32;
        Measured {
            color: color::measure(&rendered.color, errors.color_sigma, rng),
            depth: depth::measure(rendered, camera, errors, depth_scale, rng),
        }
    }

    fn calibration(&self, camera: &str) -> Calibration {
        let Some(errors) = &self.profile.errors else {
            return Calibration { offset: Pose::IDENTITY, depth_scale: 1.0 };
        };
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ name_hash(camera));
        let mut normal = |sigma: f64| {
            let deviation: f64 = StandardNormal.sample(&mut rng);
            sigma * deviation.clamp(-MAX_DEVIATIONS, MAX_DEVIATIONS)
        };
        let depth_scale = 1.0 + normal(errors.scale_sigma);
        let distance = normal(errors.displacement_sigma_m);
        let angle = normal(errors.rotation_sigma_deg.to_radians());
        let mut direction = || DVec3::from_array(UnitSphere.sample(&mut rng)).normalize();
        let translation = distance * direction();
        let rotation = DQuat::from_axis_angle(direction(), angle);
        Calibration { offset: Pose::new(translation, rotation), depth_scale }
    }
}

/// FNV-1a: a fixed hash, so that a camera's errors are the same in every build.
fn name_hash(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests;
