//! Reads a colour and a depth image from files.

use crate::{GrounderConfig, level};
use acm_concept::{
    camera::{FrameHeader, FrameSizeError, Intrinsics, MAX_PIXELS, RgbdFrame},
    ids::FrameId,
    pose::Pose,
    time::Time,
};
use image::{DynamicImage, ImageReader};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Largest image file that is read, bytes.
pub const MAX_FILE_BYTES: u64 = 256 * 1024 * 1024;

/// Why a pair of files is not a frame.
#[derive(Debug, Error)]
pub enum ReadFrameError {
    /// The file cannot be opened.
    #[error("cannot open {}: {source}; check the path", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: std::io::Error,
    },
    /// The file or the image in it is larger than we read.
    #[error("{} is too large: {what}; scale it down or crop it", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Which limit it passes.
        what: String,
    },
    /// Not an image that can be decoded.
    #[error("{} cannot be read as a PNG image: {source}", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// The decoder's message.
        source: image::ImageError,
    },
    /// An image of a kind that its role does not allow.
    #[error("{} is {actual}, but a {role} image must be {expected}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// `colour` or `depth`.
        role: &'static str,
        /// What it is.
        actual: String,
        /// What it must be.
        expected: &'static str,
    },
    /// Colour and depth do not have the same size.
    #[error(
        "{} is {color_size:?} pixels but {} is {depth_size:?}: register the depth to the colour image first",
        color.display(), depth.display()
    )]
    SizeMismatch {
        /// The colour file.
        color: PathBuf,
        /// Its width and height.
        color_size: (u32, u32),
        /// The depth file.
        depth: PathBuf,
        /// Its width and height.
        depth_size: (u32, u32),
    },
    /// Intrinsics or a depth scale that no camera has.
    #[error("{what} must be positive and finite, but is {value}")]
    Calibration {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A principal point outside the image: the intrinsics are in another order or of another image size.
    #[error(
        "{what} is {value}, but {} has {limit} pixels that way: the intrinsics are fx,fy,cx,cy of this image size",
        color.display()
    )]
    OutsideImage {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The colour file.
        color: PathBuf,
        /// Its width or height.
        limit: u32,
    },
    /// A camera pose that is no rigid motion.
    #[error("the camera pose is no rigid motion: its quaternion must have unit length and all numbers must be finite")]
    Pose,
    /// The planes do not fit their header: a mistake of ours.
    #[error(transparent)]
    Size(#[from] FrameSizeError),
}

/// Reads a frame from an 8-bit RGB or RGBA PNG and a registered 16-bit grey depth PNG.
///
/// `intrinsics` is (fx, fy, cx, cy) in pixels; `depth_scale_m` is metres per unit of the depth image, whose 0 means
/// "not measured". Without a `camera_pose` the frame is levelled: its world has z = 0 on the dominant plane, x to the
/// camera's right and the origin under the camera (see [`level`](fn@crate::level)); if there is no plane either, the
/// pose is the identity and grounding will answer that it sees no support.
///
/// Errors name the file and what to do. Limits: [`MAX_FILE_BYTES`], [`MAX_PIXELS`].
pub fn read_pair(
    color: &Path,
    depth: &Path,
    intrinsics: (f64, f64, f64, f64),
    depth_scale_m: f64,
    camera_pose: Option<Pose>,
    id: FrameId,
    time: Time,
) -> Result<RgbdFrame, ReadFrameError> {
    let (fx, fy, cx, cy) = intrinsics;
    for (what, value) in [("fx", fx), ("fy", fy), ("the depth scale", depth_scale_m)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(ReadFrameError::Calibration { what, value });
        }
    }
    for (what, value) in [("cx", cx), ("cy", cy)] {
        if !(value.is_finite() && value >= 0.0) {
            return Err(ReadFrameError::Calibration { what, value });
        }
    }
    if camera_pose.is_some_and(|pose| !pose.is_valid()) {
        return Err(ReadFrameError::Pose);
    }
    let color_image = color_plane(open(color)?, color)?;
    let depth_image = depth_plane(open(depth)?, depth)?;
    let (color_size, depth_size) = (color_image.dimensions(), depth_image.dimensions());
    if color_size != depth_size {
        let (color, depth) = (color.to_path_buf(), depth.to_path_buf());
        return Err(ReadFrameError::SizeMismatch { color, color_size, depth, depth_size });
    }
    for (what, value, limit) in [("cx", cx, color_size.0), ("cy", cy, color_size.1)] {
        if value > f64::from(limit) {
            return Err(ReadFrameError::OutsideImage { what, value, color: color.to_path_buf(), limit });
        }
    }
    let metres: Vec<f32> = depth_image.into_raw().into_iter().map(|d| (f64::from(d) * depth_scale_m) as f32).collect();
    let (width, height) = color_size;
    let header = FrameHeader {
        id,
        camera: "file".into(),
        time,
        intrinsics: Intrinsics { width, height, fx, fy, cx, cy },
        camera_pose: camera_pose.unwrap_or(Pose::IDENTITY),
    };
    let mut frame = RgbdFrame::new(header, color_image.into_raw().into(), metres.into())?;
    if camera_pose.is_none()
        && let Some(pose) = level(&frame, &GrounderConfig::default())
    {
        frame.header.camera_pose = pose;
    }
    Ok(frame)
}

fn open(path: &Path) -> Result<DynamicImage, ReadFrameError> {
    let cannot_open = |source| ReadFrameError::Open { path: path.to_path_buf(), source };
    let undecodable = |source| ReadFrameError::Decode { path: path.to_path_buf(), source };
    let too_large = |what| ReadFrameError::TooLarge { path: path.to_path_buf(), what };
    let bytes = std::fs::metadata(path).map_err(cannot_open)?.len();
    if bytes > MAX_FILE_BYTES {
        return Err(too_large(format!("{bytes} bytes, at most {MAX_FILE_BYTES}")));
    }
    let reader = || ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(cannot_open);
    let (width, height) = reader()?.into_dimensions().map_err(undecodable)?;
    if width as usize * height as usize > MAX_PIXELS {
        return Err(too_large(format!("{width}x{height} pixels, at most {MAX_PIXELS}")));
    }
    reader()?.decode().map_err(undecodable)
}

fn color_plane(image: DynamicImage, path: &Path) -> Result<image::RgbImage, ReadFrameError> {
    match image {
        DynamicImage::ImageRgb8(image) => Ok(image),
        DynamicImage::ImageRgba8(_) => Ok(image.into_rgb8()),
        other => Err(wrong_kind(path, "colour", &other, "8-bit RGB or RGBA")),
    }
}

fn depth_plane(
    image: DynamicImage,
    path: &Path,
) -> Result<image::ImageBuffer<image::Luma<u16>, Vec<u16>>, ReadFrameError> {
    match image {
        DynamicImage::ImageLuma16(image) => Ok(image),
        other => Err(wrong_kind(path, "depth", &other, "16-bit grey")),
    }
}

fn wrong_kind(path: &Path, role: &'static str, image: &DynamicImage, expected: &'static str) -> ReadFrameError {
    let color = image.color();
    let channels = color.channel_count();
    let bits = color.bits_per_pixel() / u16::from(channels.max(1));
    let actual = match channels {
        1 => format!("{bits}-bit grey"),
        2 => format!("{bits}-bit grey with alpha"),
        3 => format!("{bits}-bit RGB"),
        _ => format!("{bits}-bit RGBA"),
    };
    ReadFrameError::Kind { path: path.to_path_buf(), role, actual, expected }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // A failed unwrap is a failed test.
    use super::*;
    use std::fs;

    const INTRINSICS: (f64, f64, f64, f64) = (50.0, 50.0, 15.5, 11.5);

    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Folder {
            let path = std::env::temp_dir().join(format!("acm-frames-{name}-{}", std::process::id()));
            fs::create_dir_all(&path).unwrap();
            Folder(path)
        }
        fn color(&self, width: u32, height: u32) -> PathBuf {
            let path = self.0.join("color.png");
            image::RgbImage::from_pixel(width, height, image::Rgb([10, 200, 30])).save(&path).unwrap();
            path
        }
        fn depth(&self, value: u16) -> PathBuf {
            let path = self.0.join("depth.png");
            image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(32, 24, image::Luma([value])).save(&path).unwrap();
            path
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            fs::remove_dir_all(&self.0).ok();
        }
    }

    fn read(color: &Path, depth: &Path) -> Result<RgbdFrame, ReadFrameError> {
        read_pair(color, depth, INTRINSICS, 0.001, Some(Pose::IDENTITY), FrameId(3), Time::ZERO)
    }

    #[test]
    fn a_pair_becomes_a_frame_in_metres() {
        let folder = Folder::new("pair");
        let frame = read(&folder.color(32, 24), &folder.depth(1250)).unwrap();
        assert_eq!((frame.rgb(5), frame.depth[7]), ([10, 200, 30], 1.25));
        assert_eq!((frame.header.intrinsics.width, frame.header.id), (32, FrameId(3)));
    }

    #[test]
    fn mistakes_are_named_with_their_file() {
        let folder = Folder::new("mistakes");
        let (color, depth) = (folder.color(32, 24), folder.depth(800));
        let message = |result: Result<RgbdFrame, ReadFrameError>| result.unwrap_err().to_string();
        let missing = message(read(&folder.0.join("nothing.png"), &depth));
        assert!(missing.contains("nothing.png") && missing.contains("cannot open"), "{missing}");
        let swapped = message(read(&color, &color));
        assert!(swapped.contains("8-bit RGB") && swapped.contains("16-bit grey"), "{swapped}");
        assert!(message(read(&depth, &depth)).contains("16-bit grey, but a colour image must be 8-bit RGB"));
        let sizes = message(read(&folder.color(16, 24), &depth));
        assert!(sizes.contains("(16, 24)") && sizes.contains("(32, 24)"), "{sizes}");
        let text = folder.0.join("text.png");
        fs::write(&text, "no image").unwrap();
        assert!(message(read(&text, &depth)).contains("text.png cannot be read as a PNG"));
        let color = folder.color(32, 24);
        let scaled = read_pair(&color, &depth, INTRINSICS, 0.0, None, FrameId(0), Time::ZERO);
        assert!(message(scaled).contains("depth scale must be positive"));
        let flat = read_pair(&color, &depth, (0.0, 50.0, 1.0, 1.0), 0.001, None, FrameId(0), Time::ZERO);
        assert!(message(flat).contains("fx must be positive"));
    }
}
