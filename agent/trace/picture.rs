//! The pictures of a trace, read one after the other: a trace with full frames does not fit into memory.

use acm_actors::trace::viewer::{self, Raster};
use acm_concept::ids::FrameId;
use acm_runtime::trace::{Item, TraceReader};
use image::{RgbImage, codecs::jpeg::JpegEncoder, imageops};
use serde::Deserialize;
use std::{collections::BTreeMap, io::Cursor, path::Path};

/// JPEG quality of what is shown of full frames, 0-100.
const QUALITY: u8 = 82;

/// What a trace keeps of a frame's pixels.
#[derive(Debug, Clone, PartialEq)]
pub enum Picture {
    /// A small picture of the colour: a PNG.
    Thumbnail(Vec<u8>),
    /// All pixels.
    Full {
        /// 8-bit sRGB.
        color: RgbImage,
        /// Depth along the optical axis in metres, row by row; 0 where nothing was measured.
        depth: Vec<f32>,
    },
}

#[derive(Deserialize)]
struct FrameRecord {
    frame: FrameId,
    camera: String,
}

/// Gives each frame whose pixels the trace has to `take`, in the order in which they were taken.
///
/// # Errors
/// The file cannot be read, or what `take` says.
pub fn each(path: &Path, mut take: impl FnMut(FrameId, Picture) -> anyhow::Result<()>) -> anyhow::Result<()> {
    let mut reader = TraceReader::open(path)?;
    // The record that names a frame stands before its pixels, and its colour before its depth.
    let mut frames: BTreeMap<String, (FrameId, Option<RgbImage>)> = BTreeMap::new();
    while let Some(item) = reader.next_item() {
        let Item::Message(message) = item else { continue };
        if message.topic() == "/effect/frame" {
            if let Ok(record) = serde_json::from_slice::<FrameRecord>(&message.data) {
                frames.insert(format!("/{}", viewer::camera_frame(&record.camera)), (record.frame, None));
            }
            continue;
        }
        let Some((camera, what)) = message.topic().rsplit_once('/') else { continue };
        let Some((frame, color)) = frames.get_mut(camera) else { continue };
        let picture = match what {
            "thumbnail" => viewer::read_thumbnail(&message.data).map(Picture::Thumbnail),
            "color" => {
                *color = viewer::read_raster(&message.data).and_then(rgb);
                None
            }
            "depth" => {
                let depth = viewer::read_raster(&message.data).and_then(metres);
                depth.zip(color.take()).map(|(depth, color)| Picture::Full { color, depth })
            }
            _ => None,
        };
        if let Some(picture) = picture {
            take(*frame, picture)?;
        }
    }
    Ok(())
}

fn rgb(raster: Raster) -> Option<RgbImage> {
    (raster.encoding == "rgb8").then(|| RgbImage::from_raw(raster.width, raster.height, raster.data)).flatten()
}

fn metres(raster: Raster) -> Option<Vec<f32>> {
    (raster.encoding == "32FC1").then(|| {
        let values = raster.data.as_chunks::<4>().0;
        values.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    })
}

impl Picture {
    /// The picture at most `width` columns wide, with its media type.
    pub fn shown(self, width: u32) -> anyhow::Result<(&'static str, Vec<u8>)> {
        let color = match self {
            Picture::Thumbnail(png) => return Ok(("image/png", png)),
            Picture::Full { color, .. } => color,
        };
        let height = (u64::from(color.height()) * u64::from(width) / u64::from(color.width().max(1))).max(1) as u32;
        let color = if color.width() > width { imageops::thumbnail(&color, width, height) } else { color };
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(&color)?;
        Ok(("image/jpeg", bytes))
    }

    /// The colour; of a thumbnail what is left of it. None for a thumbnail that is no picture.
    pub fn color(self) -> Option<RgbImage> {
        match self {
            Picture::Full { color, .. } => Some(color),
            Picture::Thumbnail(png) => {
                let reader = image::ImageReader::with_format(Cursor::new(png), image::ImageFormat::Png);
                reader.decode().ok().map(|image| image.to_rgb8())
            }
        }
    }
}
