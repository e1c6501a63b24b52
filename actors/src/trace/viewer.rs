//! What robot viewers read: lines, images, point clouds, calibration and transforms as Foxglove's protobuf messages.
//!
//! The one place that names that library. Of it we take the message types and their schemas; the file is our own.

use super::{points, words};
use crate::message::Message;
use acm_concept::{
    camera::{FrameHeader, RgbdFrame},
    pose::Pose,
};
use acm_runtime::{
    envelope::Envelope,
    journal::JournalError,
    trace::{Channel, Schema, TraceError, TraceWriter},
};
use foxglove::{
    Decode, Encode,
    messages::{
        CameraCalibration, CompressedImage, FrameTransform, Log, PackedElementField, PointCloud, Quaternion, RawImage,
        Timestamp, Vector3, log::Level, packed_element_field::NumericType,
    },
};
use image::{ImageFormat, RgbImage, imageops};
use std::io::Cursor;

/// Name of the world's frame in transforms.
const WORLD: &str = "world";
/// Width of a thumbnail, pixels; smaller frames keep theirs.
pub const THUMBNAIL_WIDTH: u32 = 160;

/// The channels that do not depend on a camera.
pub(super) struct Viewer {
    log: Channel,
    transforms: Channel,
}

impl Viewer {
    pub(super) fn new(writer: &TraceWriter) -> Result<Viewer, TraceError> {
        Ok(Viewer { log: channel::<Log>(writer, "/log")?, transforms: channel::<FrameTransform>(writer, "/tf")? })
    }

    /// One line for a person, and where the hand is wherever the arm says so.
    pub(super) fn message(&self, writer: &TraceWriter, message: &Envelope<Message>) -> Result<(), JournalError> {
        let (level, text) = words::line(&message.body);
        let line = Log {
            timestamp: Some(timestamp(message.time_ns)),
            level: match level {
                words::Level::Routine => Level::Debug,
                words::Level::Normal => Level::Info,
                words::Level::Trouble => Level::Warning,
            } as i32,
            message: text,
            name: format!("{} > {}", message.from, message.to),
            file: "message".into(),
            line: u32::try_from(message.seq).unwrap_or(u32::MAX),
        };
        writer.put(self.log, message.seq, message.time_ns, &encode(&line)?)?;
        match &message.body {
            Message::Moved(feedback) => {
                self.transform(writer, message.seq, message.time_ns, "tcp", &feedback.tcp)?;
            }
            Message::Frame { header, feedback } => {
                self.transform(writer, message.seq, message.time_ns, "tcp", &feedback.tcp)?;
                let camera = camera_frame(&header.camera);
                self.transform(writer, message.seq, message.time_ns, &camera, &header.camera_pose)?;
            }
            _ => {}
        }
        Ok(())
    }

    fn transform(
        &self,
        writer: &TraceWriter,
        seq: u64,
        time_ns: u64,
        child: &str,
        pose: &Pose,
    ) -> Result<(), JournalError> {
        let (at, turn) = (pose.translation, pose.rotation);
        let transform = FrameTransform {
            timestamp: Some(timestamp(time_ns)),
            parent_frame_id: WORLD.into(),
            child_frame_id: child.into(),
            translation: Some(Vector3 { x: at.x, y: at.y, z: at.z }),
            rotation: Some(Quaternion { x: turn.x, y: turn.y, z: turn.z, w: turn.w }),
        };
        Ok(writer.put(self.transforms, seq, time_ns, &encode(&transform)?)?)
    }
}

/// Where all of a frame goes.
#[derive(Debug, Clone, Copy)]
struct FullChannels {
    color: Channel,
    depth: Channel,
    points: Channel,
}

/// The channels of one camera.
#[derive(Debug, Clone, Copy)]
pub(super) struct CameraChannels {
    full: Option<FullChannels>,
    thumbnail: Option<Channel>,
    calibration: Channel,
}

impl CameraChannels {
    pub(super) fn new(
        writer: &TraceWriter,
        camera: &str,
        detail: super::FrameDetail,
    ) -> Result<CameraChannels, TraceError> {
        let topic = |end: &str| format!("/{}/{end}", camera_frame(camera));
        let full = detail == super::FrameDetail::Full;
        let thumbnail = detail == super::FrameDetail::Thumbnail;
        let full_channels = || -> Result<FullChannels, TraceError> {
            Ok(FullChannels {
                color: channel::<RawImage>(writer, &topic("color"))?,
                depth: channel::<RawImage>(writer, &topic("depth"))?,
                points: channel::<PointCloud>(writer, &topic("points"))?,
            })
        };
        Ok(CameraChannels {
            full: if full { Some(full_channels()?) } else { None },
            thumbnail: if thumbnail { Some(channel::<CompressedImage>(writer, &topic("thumbnail"))?) } else { None },
            calibration: channel::<CameraCalibration>(writer, &topic("calibration"))?,
        })
    }

    /// Writes a frame's calibration and as many of its pixels as are wanted.
    pub(super) fn frame(&self, writer: &TraceWriter, seq: u64, frame: &RgbdFrame) -> Result<(), JournalError> {
        let time_ns = frame.header.time.0;
        let put = |channel: Channel, bytes: Vec<u8>| writer.put(channel, seq, time_ns, &bytes);
        put(self.calibration, encode(&calibration(&frame.header))?)?;
        if let Some(channels) = self.full {
            put(channels.color, encode(&raw_image(&frame.header, "rgb8", 3, frame.color.to_vec()))?)?;
            let metres: &[u8] = bytemuck::cast_slice(&frame.depth);
            put(channels.depth, encode(&raw_image(&frame.header, "32FC1", 4, metres.to_vec()))?)?;
            put(channels.points, encode(&point_cloud(frame))?)?;
        }
        if let Some(channel) = self.thumbnail {
            put(channel, encode(&thumbnail(frame)?)?)?;
        }
        Ok(())
    }
}

/// The line that a trace's `/log` channel has for a message: the message's number and the text.
pub fn read_line(bytes: &[u8]) -> Option<(u64, String)> {
    let line = Log::decode(bytes).ok()?;
    Some((u64::from(line.line), line.message))
}

/// An image of a trace that was not compressed.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `rgb8` or `32FC1`.
    pub encoding: String,
    /// The pixels, row by row without gaps.
    pub data: Vec<u8>,
}

/// The image that a channel for raw images has; none for bytes of another form or of another length than they say.
pub fn read_raster(bytes: &[u8]) -> Option<Raster> {
    let RawImage { width, height, encoding, data, .. } = RawImage::decode(bytes).ok()?;
    let pixel_bytes = match encoding.as_str() {
        "rgb8" => 3,
        "32FC1" => 4,
        _ => return None,
    };
    let whole = u64::from(width) * u64::from(height) * pixel_bytes == data.len() as u64;
    whole.then(|| Raster { width, height, encoding, data: data.into() })
}

/// The PNG that a channel for thumbnails has.
pub fn read_thumbnail(bytes: &[u8]) -> Option<Vec<u8>> {
    let image = CompressedImage::decode(bytes).ok()?;
    (image.format == "png").then(|| image.data.into())
}

/// The name of a camera's frame, which begins its topics too.
pub fn camera_frame(camera: &str) -> String {
    let plain = |sign: char| if sign.is_ascii_alphanumeric() || sign == '-' || sign == '_' { sign } else { '_' };
    format!("camera/{}", camera.chars().take(64).map(plain).collect::<String>())
}

fn calibration(header: &FrameHeader) -> CameraCalibration {
    let i = &header.intrinsics;
    CameraCalibration {
        timestamp: Some(timestamp(header.time.0)),
        frame_id: camera_frame(&header.camera),
        width: i.width,
        height: i.height,
        distortion_model: String::new(),
        d: Vec::new(),
        k: vec![i.fx, 0.0, i.cx, 0.0, i.fy, i.cy, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![i.fx, 0.0, i.cx, 0.0, 0.0, i.fy, i.cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

fn raw_image(header: &FrameHeader, encoding: &str, pixel_bytes: u32, data: Vec<u8>) -> RawImage {
    let (width, height) = (header.intrinsics.width, header.intrinsics.height);
    RawImage {
        timestamp: Some(timestamp(header.time.0)),
        frame_id: camera_frame(&header.camera),
        width,
        height,
        encoding: encoding.into(),
        step: width * pixel_bytes,
        data: data.into(),
    }
}

/// The frame's points in its camera's frame, thinned. Each has three 32-bit floats, metres, and four bytes of colour.
fn point_cloud(frame: &RgbdFrame) -> PointCloud {
    const POSITION: [&str; 3] = ["x", "y", "z"];
    const COLOR: [&str; 4] = ["red", "green", "blue", "alpha"];
    let field = |name: &str, offset: usize, kind: NumericType| PackedElementField {
        name: name.into(),
        offset: offset as u32,
        r#type: kind as i32,
    };
    let position = POSITION.iter().enumerate().map(|(i, name)| field(name, 4 * i, NumericType::Float32));
    let color = COLOR.iter().enumerate().map(|(i, name)| field(name, 12 + i, NumericType::Uint8));
    let intrinsics = &frame.header.intrinsics;
    let mut data = Vec::new();
    for point in points::points(intrinsics, &frame.color, &frame.depth, points::stride(intrinsics)) {
        data.extend(point.at.as_vec3().to_array().into_iter().flat_map(f32::to_le_bytes));
        data.extend(point.color);
        data.push(u8::MAX);
    }
    PointCloud {
        timestamp: Some(timestamp(frame.header.time.0)),
        frame_id: camera_frame(&frame.header.camera),
        pose: Some(foxglove::messages::Pose {
            position: Some(Vector3 { x: 0.0, y: 0.0, z: 0.0 }),
            orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
        }),
        point_stride: 16,
        fields: position.chain(color).collect(),
        data: data.into(),
    }
}

fn thumbnail(frame: &RgbdFrame) -> Result<CompressedImage, JournalError> {
    let (width, height) = (frame.header.intrinsics.width, frame.header.intrinsics.height);
    let image = RgbImage::from_raw(width, height, frame.color.to_vec())
        .ok_or_else(|| JournalError(format!("frame {} is not {width}x{height}", frame.header.id)))?;
    let small_width = width.min(THUMBNAIL_WIDTH);
    let small = imageops::thumbnail(&image, small_width, (height * small_width / width.max(1)).max(1));
    let mut png = Cursor::new(Vec::new());
    small
        .write_to(&mut png, ImageFormat::Png)
        .map_err(|e| JournalError(format!("frame {} has no thumbnail: {e}", frame.header.id)))?;
    Ok(CompressedImage {
        timestamp: Some(timestamp(frame.header.time.0)),
        frame_id: camera_frame(&frame.header.camera),
        data: png.into_inner().into(),
        format: "png".into(),
    })
}

fn timestamp(time_ns: u64) -> Timestamp {
    let seconds = u32::try_from(time_ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (time_ns % 1_000_000_000) as u32)
}

fn channel<T: Encode>(writer: &TraceWriter, topic: &str) -> Result<Channel, TraceError> {
    let messages = T::get_message_encoding();
    let schema = T::get_schema();
    let (name, encoding, data) =
        schema.as_ref().map_or(("", "", &[][..]), |schema| (&schema.name, &schema.encoding, &schema.data));
    writer.channel(topic, &Schema { name, encoding, data, messages: &messages })
}

fn encode<T: Encode>(message: &T) -> Result<Vec<u8>, JournalError> {
    let mut bytes = Vec::with_capacity(message.encoded_len().unwrap_or_default());
    message.encode(&mut bytes).map_err(|e| JournalError(format!("a viewer's message cannot be encoded: {e}")))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;
    use acm_concept::camera::Intrinsics;

    #[test]
    fn a_point_cloud_holds_the_measured_pixels_in_the_frame_of_their_camera() {
        let intrinsics = Intrinsics { width: 3, height: 2, fx: 2.0, fy: 2.0, cx: 1.0, cy: 0.0 };
        let header = FrameHeader {
            id: acm_concept::ids::FrameId(7),
            camera: "head".into(),
            time: acm_concept::time::Time(1_500_000_000),
            intrinsics,
            camera_pose: Pose { translation: glam::DVec3::splat(9.0), ..Pose::IDENTITY },
        };
        let color: Vec<u8> = (0..18).collect();
        let depth = vec![0.0, 0.5, 2.0, f32::NAN, -1.0, f32::INFINITY];
        let frame = RgbdFrame::new(header, color.into(), depth.into()).unwrap();
        let cloud = PointCloud::decode(&encode(&point_cloud(&frame)).unwrap()[..]).unwrap();
        assert_eq!((cloud.frame_id.as_str(), cloud.timestamp), ("camera/head", Some(Timestamp::new(1, 500_000_000))));
        let names: Vec<&str> = cloud.fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names, ["x", "y", "z", "red", "green", "blue", "alpha"]);
        let (points, rest) = cloud.data.as_chunks::<16>();
        assert!(rest.is_empty() && cloud.point_stride == 16);
        let read = |point: &[u8; 16]| {
            let metres: Vec<f32> =
                point[..12].as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            (metres, point[12..].to_vec())
        };
        // The camera's own frame: where the camera stands makes no difference.
        let expected = [(vec![0.0, 0.0, 0.5], vec![3, 4, 5, 255]), (vec![1.0, 0.0, 2.0], vec![6, 7, 8, 255])];
        assert_eq!(points.iter().map(read).collect::<Vec<_>>(), expected);
    }
}
