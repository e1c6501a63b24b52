//! RGB-D frames, calibration as the agent knows it, and the trait of a camera.

use crate::{ids::FrameId, plane::Plane, pose::Pose, time::Time};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Most pixels of a frame that any of our readers accepts.
pub const MAX_PIXELS: usize = 4096 * 4096;

/// A pinhole camera without distortion. Pixel (0, 0) has its centre at image coordinates (0, 0).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Horizontal focal length, pixels.
    pub fx: f64,
    /// Vertical focal length, pixels.
    pub fy: f64,
    /// Column of the principal point, pixels.
    pub cx: f64,
    /// Row of the principal point, pixels.
    pub cy: f64,
}

impl Intrinsics {
    /// Square pixels, principal point in the middle, and a full vertical opening angle in radians.
    ///
    /// ```
    /// # use acm_concept::camera::Intrinsics;
    /// let i = Intrinsics::from_vertical_fov(640, 480, 50f64.to_radians());
    /// assert!((i.fy - 514.7).abs() < 0.1 && i.cx == 319.5);
    /// ```
    pub fn from_vertical_fov(width: u32, height: u32, fov_y: f64) -> Intrinsics {
        let focal = f64::from(height) * 0.5 / (fov_y * 0.5).tan();
        Intrinsics {
            width,
            height,
            fx: focal,
            fy: focal,
            cx: (f64::from(width) - 1.0) * 0.5,
            cy: (f64::from(height) - 1.0) * 0.5,
        }
    }
    /// The direction of a pixel's ray in the camera frame, scaled so that its z is 1.
    #[inline]
    pub fn ray(&self, column: f64, row: f64) -> DVec3 {
        DVec3::new((column - self.cx) / self.fx, (row - self.cy) / self.fy, 1.0)
    }
    /// Image coordinates of a point of the camera frame, or `None` if it lies behind the camera.
    #[inline]
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        (point.z > 1e-6)
            .then(|| DVec2::new(self.fx * point.x / point.z + self.cx, self.fy * point.y / point.z + self.cy))
    }
    /// Whether image coordinates fall on the sensor.
    pub fn contains(&self, pixel: DVec2) -> bool {
        pixel.x >= -0.5
            && pixel.y >= -0.5
            && pixel.x < f64::from(self.width) - 0.5
            && pixel.y < f64::from(self.height) - 0.5
    }
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// What carries a camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mount {
    /// It stands still.
    #[default]
    World,
    /// It moves with the robot's hand.
    Hand,
}

/// A camera as the agent is told of it: the *nominal* calibration, never the true one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraModel {
    /// Name that the source answers to.
    pub name: String,
    /// Nominal intrinsics, shared by colour and registered depth.
    pub intrinsics: Intrinsics,
    /// Nominal pose of the camera frame (x right, y down, z forward) in the world, or in the frame of the tool centre
    /// point where the hand carries it.
    pub pose: Pose,
    /// What carries it.
    #[serde(default)]
    pub mount: Mount,
    /// Depths nearer than this are not measured, metres.
    pub depth_min_m: f64,
    /// Depths farther than this are not measured, metres.
    pub depth_max_m: f64,
}

/// What is known of a frame without its pixels: enough to name it in a journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameHeader {
    /// The frame's number in its source.
    pub id: FrameId,
    /// Camera that took it.
    pub camera: String,
    /// When it was taken.
    pub time: Time,
    /// Nominal intrinsics.
    pub intrinsics: Intrinsics,
    /// Nominal camera pose in the world when it was taken.
    pub camera_pose: Pose,
}

/// A colour image with registered depth. Planes are shared: cloning a frame copies no pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct RgbdFrame {
    /// Number, camera, time, calibration.
    pub header: FrameHeader,
    /// 8-bit sRGB, row by row, `3 * width * height` bytes.
    pub color: Plane<u8>,
    /// Depth along the optical axis in metres, `width * height` values; 0 where nothing was measured.
    pub depth: Plane<f32>,
}

/// Planes that do not belong to the header.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("a {width}x{height} frame needs {expected} {plane} values, but {actual} were given")]
pub struct FrameSizeError {
    width: u32,
    height: u32,
    plane: &'static str,
    expected: usize,
    actual: usize,
}

impl RgbdFrame {
    /// Joins a header and its planes.
    pub fn new(header: FrameHeader, color: Plane<u8>, depth: Plane<f32>) -> Result<RgbdFrame, FrameSizeError> {
        let pixels = header.intrinsics.pixels();
        let check = |plane, expected, actual| {
            if expected == actual {
                return Ok(());
            }
            let (width, height) = (header.intrinsics.width, header.intrinsics.height);
            Err(FrameSizeError { width, height, plane, expected, actual })
        };
        check("colour", 3 * pixels, color.len())?;
        check("depth", pixels, depth.len())?;
        Ok(RgbdFrame { header, color, depth })
    }
    /// The colour of one pixel.
    pub fn rgb(&self, index: usize) -> [u8; 3] {
        [self.color[3 * index], self.color[3 * index + 1], self.color[3 * index + 2]]
    }
}

/// Why a frame could not be had.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CameraError {
    /// No camera of that name.
    #[error("there is no camera `{name}`; this source has: {known}")]
    UnknownCamera {
        /// The name that was asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The device or its process failed.
    #[error("the camera `{name}` gave no frame: {reason}")]
    Failed {
        /// The camera's name.
        name: String,
        /// What went wrong.
        reason: String,
    },
}

/// Something that takes RGB-D frames: a simulator, a driver, a folder.
pub trait CameraSource: Send {
    /// The cameras, with nominal calibration.
    fn cameras(&self) -> &[CameraModel];
    /// Takes one frame now. Taking a frame does not advance time.
    fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError>;
}
