//! The frames of a trace as point clouds in the world, in binary PLY.

use crate::trace::{
    picture::{self, Picture},
    run_file::RunFile,
    sight,
};
use acm_actors::trace::points::points;
use acm_concept::{camera::FrameHeader, ids::FrameId};
use anyhow::{Context, bail};
use image::RgbImage;
use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::Path,
};

/// Writes one file a frame into a folder, or that of one frame alone. Gives their number.
///
/// # Errors
/// The trace keeps no full frames, or not the one that is wanted; or something cannot be read or written.
pub fn write(trace: &Path, folder: &Path, only: Option<FrameId>) -> anyhow::Result<usize> {
    let sights = sight::sights(&RunFile::read(trace)?);
    if let Some(frame) = only.filter(|frame| !sights.contains_key(frame)) {
        let held = sights.keys().next().zip(sights.keys().next_back());
        let held = held.map_or_else(|| "no frame".into(), |(first, last)| format!("{first} to {last}"));
        bail!("there is no frame {frame}: the trace has {held}");
    }
    let mut written = 0;
    picture::each(trace, |frame, picture| {
        let Picture::Full { color, depth } = picture else { return Ok(()) };
        let Some(sight) = sights.get(&frame).filter(|_| only.is_none_or(|only| only == frame)) else { return Ok(()) };
        std::fs::create_dir_all(folder).with_context(|| format!("the folder {} cannot be made", folder.display()))?;
        let path = folder.join(format!("{frame}.ply"));
        let named = || format!("the point cloud {} cannot be written", path.display());
        let mut out = BufWriter::new(File::create(&path).with_context(named)?);
        cloud(&sight.header, &color, &depth, &mut out).and_then(|()| out.flush()).with_context(named)?;
        written += 1;
        Ok(())
    })?;
    if written == 0 {
        bail!("{} keeps no depth: record it with --trace-frames full", trace.display());
    }
    Ok(written)
}

/// Writes the pixels that have a depth as points of the world, metres, with their colours.
fn cloud(header: &FrameHeader, color: &RgbImage, depth: &[f32], out: &mut impl Write) -> io::Result<()> {
    let all = || points(&header.intrinsics, color.as_raw(), depth, 1);
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment frame {} of {} in the world, metres\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        header.id,
        header.camera.replace(['\n', '\r'], " "),
        all().count()
    )?;
    for point in all() {
        for value in header.camera_pose.transform_point(point.at).as_vec3().to_array() {
            out.write_all(&value.to_le_bytes())?;
        }
        out.write_all(&point.color)?;
    }
    Ok(())
}
