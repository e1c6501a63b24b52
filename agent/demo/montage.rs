//! Four pictures of the story in one, for the README.

use super::{
    page::Page,
    reel::{Chapter, Step},
};
use crate::video::text;
use anyhow::Context;
use image::{Rgb, RgbImage, imageops};
use std::path::Path;

/// Height of a caption, pixels.
const CAPTION: u32 = 3 * text::LINE + 6;
/// Distance between pictures, pixels.
const GAP: u32 = 4;
const BACK: Rgb<u8> = Rgb([18, 20, 24]);
const INK: Rgb<u8> = Rgb([235, 235, 235]);
const HEAD: Rgb<u8> = Rgb([255, 225, 60]);

/// Draws the first sight, what is out of sight, how it ended, and how it ends without memory.
pub fn write(page: &Page, path: &Path) -> anyhow::Result<()> {
    let [with, without] = page.steps();
    let open: Vec<&Step> = with.iter().filter(|step| step.chapter == Chapter::Watch && is_open(step)).collect();
    let hidden = open.get(open.len() / 2).copied();
    let shown = [
        ("1 it sees two that look the same", with.first()),
        ("2 someone moves one out of its sight", hidden),
        ("3 asked, it puts the right one back", with.last()),
        ("4 without memory it says so", without.last()),
    ];
    let size = with.first().context("nothing was seen that could be drawn")?.image.dimensions();
    let (width, height) = (size.0 * 3 / 4, size.1 * 3 / 4);
    let mut picture = RgbImage::from_pixel(2 * width + GAP, 2 * (height + CAPTION) + GAP, BACK);
    for ((title, step), place) in shown.into_iter().zip(0..) {
        let Some(step) = step else { continue };
        let (left, top) = ((place % 2) * (width + GAP), (place / 2) * (height + CAPTION + GAP));
        let small = imageops::resize(&step.image, width, height, imageops::FilterType::Triangle);
        imageops::replace(&mut picture, &small, i64::from(left), i64::from(top + CAPTION));
        text::write(&mut picture, i64::from(left) + 4, i64::from(top) + 4, title, HEAD);
        let room = (width / text::ADVANCE).saturating_sub(1).max(1) as usize;
        let signs: Vec<char> = step.caption.chars().collect();
        for (line, below) in signs.chunks(room).take(2).zip(1..) {
            let line: String = line.iter().collect();
            let top = i64::from(top + below * text::LINE) + 4;
            text::write(&mut picture, i64::from(left) + 4, top, line.trim_start(), INK);
        }
    }
    picture.save(path).with_context(|| {
        format!("the picture {} cannot be written; name a file .png or .jpg in a folder that exists", path.display())
    })
}

/// Whether something is believed that the frame does not show.
fn is_open(step: &Step) -> bool {
    step.objects.iter().any(|object| object.state == "unknown" || object.state == "believed")
}
