//! The pixels in question, cut out of the frames and written as PNG files.

use super::Why;
use crate::trace::{picture, run_file::RunFile, sight};
use acm_concept::ids::FrameId;
use anyhow::Context;
use image::imageops;
use std::{collections::BTreeSet, path::Path};

/// Margin around an object, share of its size on each side.
const MARGIN: f64 = 0.35;
/// Crops are enlarged to about this many columns: what they are cut from may be a thumbnail.
const WIDTH: u32 = 240;

/// Writes one file for each crop that has pixels, named after frame and object, and says in `why` which.
///
/// # Errors
/// The folder or a file cannot be written, or the trace cannot be read again.
pub fn write(why: &mut Why, trace: &Path, run: &RunFile, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("the folder {} cannot be made", folder.display()))?;
    let sights = sight::sights(run);
    let wanted: BTreeSet<FrameId> = why.nodes.iter().flat_map(|node| &node.crops).map(|crop| crop.frame).collect();
    let mut kept = BTreeSet::new();
    picture::each(trace, |frame, picture| {
        let (Some(sight), true) = (sights.get(&frame), wanted.contains(&frame)) else { return Ok(()) };
        let Some(color) = picture.color() else { return Ok(()) };
        kept.insert(frame);
        let crops = why.nodes.iter_mut().flat_map(|node| &mut node.crops);
        for crop in crops.filter(|crop| crop.frame == frame) {
            let Some(bounds) = crop.bounds else { continue };
            let scale = f64::from(color.width()) / f64::from(sight.header.intrinsics.width.max(1));
            let [left, top, width, height] = cut(bounds, scale, color.dimensions());
            let part = imageops::crop_imm(&color, left, top, width, height).to_image();
            let times = (WIDTH / width.max(1)).max(1);
            let part = imageops::resize(&part, width * times, height * times, imageops::FilterType::Nearest);
            let file = folder.join(format!("{frame}-{}.png", crop.object));
            part.save(&file).with_context(|| format!("the crop {} cannot be written", file.display()))?;
            crop.file = Some(file.display().to_string());
        }
        Ok(())
    })?;
    let missing: Vec<String> = wanted.difference(&kept).map(FrameId::to_string).collect();
    if !missing.is_empty() {
        why.lacks.push(format!(
            "no pixels of {} are kept (--trace-frames thumbnail or full keeps them)",
            missing.join(", ")
        ));
    }
    Ok(())
}

/// Left, top, width and height of a box with its margin, in a picture that is `scale` times the frame.
fn cut([left, top, right, bottom]: [u32; 4], scale: f64, (columns, rows): (u32, u32)) -> [u32; 4] {
    let side = |low: u32, high: u32, most: u32| {
        let (low, high) = (f64::from(low), f64::from(high) + 1.0);
        let margin = MARGIN * (high - low);
        let low = ((low - margin) * scale).floor().clamp(0.0, f64::from(most.saturating_sub(1))) as u32;
        let high = ((high + margin) * scale).ceil().clamp(f64::from(low) + 1.0, f64::from(most.max(low + 1))) as u32;
        (low, high - low)
    };
    let ((left, width), (top, height)) = (side(left, right, columns), side(top, bottom, rows));
    [left, top, width, height]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_stays_within_the_picture_and_is_never_empty() {
        assert_eq!(cut([100, 100, 199, 199], 1.0, (640, 480)), [65, 65, 170, 170]);
        assert_eq!(cut([100, 100, 199, 199], 0.25, (160, 120)), [16, 16, 43, 43]);
        assert_eq!(cut([630, 470, 639, 479], 1.0, (640, 480)), [626, 466, 14, 14]);
        let [left, top, width, height] = cut([9000, 9000, 9001, 9001], 1.0, (640, 480));
        assert!(left < 640 && top < 480 && width >= 1 && height >= 1);
    }
}
