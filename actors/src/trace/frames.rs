//! The frames that a camera gave.

use super::{Trace, json, viewer::CameraChannels};
use acm_concept::camera::{CameraError, CameraModel, CameraSource, RgbdFrame};
use acm_runtime::{journal::JournalError, trace};
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    str::FromStr,
    sync::{Arc, atomic::Ordering},
};
use thiserror::Error;

/// How much of each frame a trace keeps, beside its hash.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FrameDetail {
    /// All pixels, colour and depth.
    Full,
    /// A small picture of the colour.
    #[default]
    Thumbnail,
    /// Nothing more.
    Hash,
}

/// A text that is no frame detail.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("`{0}` is no frame detail: full, thumbnail or hash")]
pub struct ParseDetailError(String);

impl FromStr for FrameDetail {
    type Err = ParseDetailError;
    fn from_str(text: &str) -> Result<Self, ParseDetailError> {
        match text {
            "full" => Ok(FrameDetail::Full),
            "thumbnail" => Ok(FrameDetail::Thumbnail),
            "hash" => Ok(FrameDetail::Hash),
            _ => Err(ParseDetailError(text.into())),
        }
    }
}

/// A frame as `/effect/frame` names it.
#[derive(Debug, Serialize)]
struct FrameRecord<'a> {
    seq: u64,
    frame: acm_concept::ids::FrameId,
    camera: &'a str,
    t: u64,
    width: u32,
    height: u32,
    color_blake3: String,
    depth_blake3: String,
    stored: FrameDetail,
}

/// A camera whose frames are written down before the agent gets them.
pub(super) struct TracedCamera {
    cameras: Box<dyn CameraSource>,
    trace: Arc<Trace>,
    channels: BTreeMap<String, CameraChannels>,
}

impl TracedCamera {
    pub(super) fn new(cameras: Box<dyn CameraSource>, trace: Arc<Trace>) -> TracedCamera {
        TracedCamera { cameras, trace, channels: BTreeMap::new() }
    }

    fn write(&mut self, frame: &RgbdFrame) -> Result<(), JournalError> {
        let (trace, header) = (&self.trace, &frame.header);
        let seq = trace.seq.load(Ordering::Relaxed);
        let record = FrameRecord {
            seq,
            frame: header.id,
            camera: &header.camera,
            t: header.time.0,
            width: header.intrinsics.width,
            height: header.intrinsics.height,
            color_blake3: trace::hash(&frame.color),
            depth_blake3: trace::hash(bytemuck::cast_slice(&frame.depth)),
            stored: trace.detail,
        };
        trace.writer.put(trace.frames, seq, header.time.0, &json(&record)?)?;
        let channels = match self.channels.get(&header.camera) {
            Some(channels) => *channels,
            None => {
                let channels = CameraChannels::new(&trace.writer, &header.camera, trace.detail)?;
                self.channels.insert(header.camera.clone(), channels);
                channels
            }
        };
        channels.frame(&trace.writer, seq, frame)
    }
}

impl CameraSource for TracedCamera {
    fn cameras(&self) -> &[CameraModel] {
        self.cameras.cameras()
    }
    fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError> {
        let frame = self.cameras.capture(camera)?;
        // A frame that cannot be written down is not handed on: the run could not be looked at afterwards.
        let trace = Arc::clone(&self.trace);
        let written = trace.counted(|| self.write(&frame));
        written.map_err(|e| CameraError::Failed { name: camera.into(), reason: e.to_string() })?;
        Ok(frame)
    }
}
