//! The thresholds of the pipeline, in one place.

use serde::{Deserialize, Serialize};

/// Thresholds of a [`Grounder`](crate::Grounder). The defaults hold for D435- and Kinect-class cameras that look at
/// a table from 0.4 to 2 m; lengths in metres, angles in radians, colour differences in units of CIELAB.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GrounderConfig {
    /// Seed of the sampling in the plane search. The same frame and seed give the same answer.
    pub seed: u64,
    /// Nearest depth that is believed.
    pub depth_min_m: f32,
    /// Farthest depth that is believed.
    pub depth_max_m: f32,
    /// Stereo noise is `noise_m * z^2` with z in metres: 0.08 pixels of disparity at 385 pixels and 50 mm baseline.
    pub noise_m: f64,
    /// Noise below which no depth is believed to be, at any distance.
    pub noise_floor_m: f64,
    /// A frame with less than this share of measured pixels is blind.
    pub min_depth_fraction: f64,
    /// A frame whose brighter pixels (95th percentile of 0-255) are darker than this is black.
    pub min_brightness: u8,
    /// The support must cover at least this share of the measured pixels.
    pub min_support_fraction: f64,
    /// Largest angle between the support's normal and the world's z axis.
    pub max_support_tilt_rad: f64,
    /// Tilts of the support up to this are taken for calibration error: objects are then reported exactly upright.
    pub upright_tolerance_rad: f64,
    /// How far the robot's own solids are grown before their pixels are taken out.
    pub robot_margin_m: f64,
    /// How far the robot's pixels are grown in the image.
    pub robot_margin_px: usize,
    /// Smallest height above the plane that counts as standing on it, before noise is taken into account.
    pub min_height_m: f32,
    /// Nothing higher than this above the support is an object on it.
    pub max_height_m: f32,
    /// Segments with fewer pixels are dropped.
    pub min_segment_px: usize,
    /// A step in depth that parts two surfaces is larger than this, beside what distance, slope and noise explain.
    pub depth_step_m: f32,
    /// Two surfaces are one where more than this share of their common border runs on without a step or an inward bend.
    pub smooth_border_share: f64,
    /// Most objects that one frame reports, the largest first.
    pub max_objects: usize,
    /// A flat patch must differ from the support's colour by this much chroma, illumination taken out.
    pub patch_contrast: f32,
    /// Shortest side of a flat patch.
    pub min_patch_m: f64,
    /// Most surface points that one fit looks at.
    pub max_fit_points: usize,
    /// Most outline points that one fit looks at.
    pub max_fit_outline: usize,
    /// Spread of outline points round the true outline, pixels.
    pub outline_sigma_px: f64,
    /// The same where the colour shows the outline.
    pub color_edge_sigma_px: f64,
    /// Factor on the odds of a template that carries a noun of the instruction.
    pub noun_boost: f64,
    /// Factor on the odds of the template under which memory knows the thing.
    pub memory_boost: f64,
    /// Factor from the fit's own standard deviation of a place or angle to a calibrated one.
    pub sigma_factor: f64,
    /// Systematic error of places that no averaging removes.
    pub sigma_floor_m: f64,
    /// Systematic error of places as a share of the distance.
    pub sigma_range: f64,
    /// Error of sizes that no averaging removes. The default holds for a calibrated camera; of an unknown one sizes were
    /// wrong by several millimetres, see [`GrounderConfig::of_unknown_camera`].
    pub size_sigma_floor_m: f64,
    /// Error of heights as a share of them.
    pub size_sigma_share: f64,
    /// Error of an extent between walls, which lean and are rounded at their edges, as a share of how far the outline
    /// misses the fitted one, beyond what noise leaves.
    pub size_sigma_walls: f64,
    /// Pixels by which noise lets the outline miss the fitted one.
    pub size_outline_px: f64,
    /// The same error per standard deviation by which the surface misses the fitted one, beyond what noise leaves.
    pub size_sigma_surface_m: f64,
    /// Standard deviations by which noise lets the surface miss the fitted one.
    pub size_surface: f64,
    /// The same error as a share of how much the walls lean.
    pub size_sigma_lean: f64,
    /// Error of the height of a top, which depth shows too, as a share of how far the outline misses the fitted one.
    pub size_sigma_top: f64,
    /// Whether digits, marks, lamps and needles are read from the faces of things: it takes some milliseconds a thing.
    pub read: bool,
    /// Objects with a lower confidence are not reported.
    pub min_confidence: f64,
}

impl Default for GrounderConfig {
    fn default() -> Self {
        GrounderConfig {
            seed: 0x0ac3,
            depth_min_m: 0.12,
            depth_max_m: 6.0,
            noise_m: 0.08 / (385.0 * 0.05),
            noise_floor_m: 0.001,
            min_depth_fraction: 0.02,
            min_brightness: 10,
            min_support_fraction: 0.08,
            max_support_tilt_rad: 10f64.to_radians(),
            upright_tolerance_rad: 2f64.to_radians(),
            robot_margin_m: 0.012,
            robot_margin_px: 3,
            min_height_m: 0.006,
            max_height_m: 0.6,
            min_segment_px: 120,
            depth_step_m: 0.005,
            smooth_border_share: 0.65,
            max_objects: 64,
            patch_contrast: 13.0,
            min_patch_m: 0.025,
            max_fit_points: 320,
            max_fit_outline: 140,
            outline_sigma_px: 1.5,
            color_edge_sigma_px: 0.8,
            noun_boost: 4.0,
            memory_boost: 1.5,
            sigma_factor: 1.7,
            sigma_floor_m: 0.003,
            sigma_range: 0.005,
            size_sigma_floor_m: 0.00045,
            size_sigma_share: 0.004,
            size_sigma_walls: 3.0,
            size_outline_px: 0.6,
            size_sigma_surface_m: 0.01,
            size_surface: 0.5,
            size_sigma_lean: 0.7,
            size_sigma_top: 0.2,
            read: false,
            min_confidence: 0.15,
        }
    }
}

impl GrounderConfig {
    /// Whether the values mean something: lengths, angles and factors that are positive numbers, shares from 0 to 1.
    ///
    /// # Errors
    /// The first field that does not, with its value.
    pub fn check(&self) -> Result<(), String> {
        let positive = [
            ("depth_min_m", f64::from(self.depth_min_m)),
            ("depth_max_m", f64::from(self.depth_max_m)),
            ("noise_m", self.noise_m),
            ("noise_floor_m", self.noise_floor_m),
            ("max_support_tilt_rad", self.max_support_tilt_rad),
            ("upright_tolerance_rad", self.upright_tolerance_rad),
            ("robot_margin_m", self.robot_margin_m),
            ("min_height_m", f64::from(self.min_height_m)),
            ("max_height_m", f64::from(self.max_height_m)),
            ("depth_step_m", f64::from(self.depth_step_m)),
            ("patch_contrast", f64::from(self.patch_contrast)),
            ("min_patch_m", self.min_patch_m),
            ("outline_sigma_px", self.outline_sigma_px),
            ("color_edge_sigma_px", self.color_edge_sigma_px),
            ("noun_boost", self.noun_boost),
            ("memory_boost", self.memory_boost),
            ("sigma_factor", self.sigma_factor),
            ("sigma_floor_m", self.sigma_floor_m),
            ("size_sigma_floor_m", self.size_sigma_floor_m),
            ("size_sigma_walls", self.size_sigma_walls),
            ("size_outline_px", self.size_outline_px),
            ("size_sigma_surface_m", self.size_sigma_surface_m),
            ("size_surface", self.size_surface),
            ("size_sigma_lean", self.size_sigma_lean),
            ("size_sigma_top", self.size_sigma_top),
        ];
        let shares = [
            ("min_depth_fraction", self.min_depth_fraction),
            ("min_support_fraction", self.min_support_fraction),
            ("smooth_border_share", self.smooth_border_share),
            ("sigma_range", self.sigma_range),
            ("size_sigma_share", self.size_sigma_share),
            ("min_confidence", self.min_confidence),
        ];
        let counts = [
            ("min_segment_px", self.min_segment_px),
            ("max_objects", self.max_objects),
            ("max_fit_points", self.max_fit_points),
            ("max_fit_outline", self.max_fit_outline),
        ];
        let odd = |name: &str, value: f64, range: &str| Err(format!("{name} is {value}: it must be {range}"));
        if let Some((name, value)) = positive.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            return odd(name, value, "a positive number");
        }
        if let Some((name, value)) = shares.into_iter().find(|(_, value)| !(0.0..=1.0).contains(value)) {
            return odd(name, value, "from 0 to 1");
        }
        if let Some((name, value)) = counts.into_iter().find(|(_, value)| !(1..=1_000_000).contains(value)) {
            return odd(name, value as f64, "from 1 to a million");
        }
        Ok(())
    }
    /// The defaults for frames of a camera of which only the intrinsics are known: sizes of known things in images of such
    /// cameras were off by 4 mm (median) and up to 7 mm. What is written on things is read: nobody waits.
    pub fn of_unknown_camera() -> GrounderConfig {
        GrounderConfig { size_sigma_floor_m: 0.004, read: true, ..GrounderConfig::default() }
    }
    /// Standard deviation of a depth of `z` metres, metres.
    pub fn depth_sigma_m(&self, z: f64) -> f64 {
        (self.noise_m * z * z).max(self.noise_floor_m)
    }
}
