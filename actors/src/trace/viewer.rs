//! What robot viewers read: lines, images, calibration and transforms as Foxglove's protobuf messages.
//!
//! The one place that names that library. Of it we take the message types and their schemas; the file is our own.

use super::words;
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
        CameraCalibration, CompressedImage, FrameTransform, Log, Quaternion, RawImage, Timestamp, Vector3, log::Level,
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

/// The channels of one camera.
#[derive(Debug, Clone, Copy)]
pub(super) struct CameraChannels {
    raw: Option<(Channel, Channel)>,
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
        let raw = |end: &str| channel::<RawImage>(writer, &topic(end));
        Ok(CameraChannels {
            raw: if full { Some((raw("color")?, raw("depth")?)) } else { None },
            thumbnail: if thumbnail { Some(channel::<CompressedImage>(writer, &topic("thumbnail"))?) } else { None },
            calibration: channel::<CameraCalibration>(writer, &topic("calibration"))?,
        })
    }

    /// Writes a frame's calibration and as many of its pixels as are wanted.
    pub(super) fn frame(&self, writer: &TraceWriter, seq: u64, frame: &RgbdFrame) -> Result<(), JournalError> {
        let time_ns = frame.header.time.0;
        let put = |channel: Channel, bytes: Vec<u8>| writer.put(channel, seq, time_ns, &bytes);
        put(self.calibration, encode(&calibration(&frame.header))?)?;
        if let Some((color, depth)) = self.raw {
            put(color, encode(&raw_image(&frame.header, "rgb8", 3, frame.color.to_vec()))?)?;
            let metres: &[u8] = bytemuck::cast_slice(&frame.depth);
            put(depth, encode(&raw_image(&frame.header, "32FC1", 4, metres.to_vec()))?)?;
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
