//! Pictures into a GIF that stays small.

use anyhow::{Context, bail};
use gif::{DisposalMethod, Encoder, Frame, Repeat};
use image::{RgbImage, imageops};

/// Largest file, bytes.
pub const MAX_BYTES: usize = 5_000_000;
/// A pixel that differs by no more than this in every colour from what stands there already stays: the camera's noise
/// would cost most of the file.
const SAME: u8 = 18;
/// How thoroughly colours are chosen, from 1 (slow) to 30.
const COLOR_SPEED: i32 = 20;
/// Sizes that are tried one after the other until the file is small enough, in percent.
const SIZES: [u32; 3] = [100, 75, 50];

/// One picture and how long it stands.
#[derive(Debug, Clone)]
pub struct Picture {
    /// The picture; all of a film have the size of the first.
    pub image: RgbImage,
    /// How long it stands, seconds.
    pub seconds: f64,
}

/// The pictures as a GIF of at most [`MAX_BYTES`]: smaller pictures where whole ones would not fit, and of a film that
/// is too long even then, no more than fits.
pub fn encode(pictures: &[Picture]) -> anyhow::Result<Vec<u8>> {
    if pictures.is_empty() {
        bail!("there is nothing to draw: no frame was perceived");
    }
    let mut count = pictures.len();
    loop {
        for percent in SIZES {
            let bytes = encode_at(pictures.get(..count).unwrap_or_default(), percent)?;
            if bytes.len() <= MAX_BYTES {
                return Ok(bytes);
            }
        }
        count /= 2;
        if count == 0 {
            bail!("one picture alone is larger than {MAX_BYTES} bytes");
        }
    }
}

fn encode_at(pictures: &[Picture], percent: u32) -> anyhow::Result<Vec<u8>> {
    let Some(first) = pictures.first() else { bail!("a film without pictures") };
    let (width, height) = (first.image.width() * percent / 100, first.image.height() * percent / 100);
    let (columns, rows) = (u16::try_from(width).context("too wide")?, u16::try_from(height).context("too high")?);
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, columns, rows, &[])?;
    encoder.set_repeat(Repeat::Infinite)?;
    let mut shown: Option<RgbImage> = None;
    for picture in pictures {
        let fitted = match percent {
            100 => picture.image.clone(),
            _ => imageops::thumbnail(&picture.image, width, height),
        };
        if fitted.dimensions() != (width, height) {
            bail!("the pictures of a film must have one size");
        }
        let mut pixels = changes(shown.as_ref(), &fitted);
        let mut frame = Frame::from_rgba_speed(columns, rows, &mut pixels, COLOR_SPEED);
        // What does not change is transparent, and what was there stays.
        frame.dispose = DisposalMethod::Keep;
        frame.delay = (picture.seconds * 100.0).clamp(2.0, 6000.0) as u16;
        encoder.write_frame(&frame)?;
        match &mut shown {
            Some(shown) => update(shown, &fitted),
            None => shown = Some(fitted),
        }
        if bytes_so_far(&encoder) > MAX_BYTES {
            break;
        }
    }
    drop(encoder);
    Ok(bytes)
}

fn bytes_so_far(encoder: &Encoder<&mut Vec<u8>>) -> usize {
    encoder.get_ref().len()
}

/// The pixels that differ from what is shown; the others are transparent.
fn changes(shown: Option<&RgbImage>, next: &RgbImage) -> Vec<u8> {
    let opaque = |pixel: &image::Rgb<u8>| [pixel.0[0], pixel.0[1], pixel.0[2], 255];
    match shown {
        None => next.pixels().flat_map(opaque).collect(),
        Some(shown) => shown
            .pixels()
            .zip(next.pixels())
            .flat_map(|(old, new)| if differs(old, new) { opaque(new) } else { [0; 4] })
            .collect(),
    }
}

fn update(shown: &mut RgbImage, next: &RgbImage) {
    for (old, new) in shown.pixels_mut().zip(next.pixels()) {
        if differs(old, new) {
            *old = *new;
        }
    }
}

fn differs(old: &image::Rgb<u8>, new: &image::Rgb<u8>) -> bool {
    old.0.iter().zip(new.0).any(|(old, new)| old.abs_diff(new) > SAME)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;
    use image::Rgb;

    fn picture(color: u8, dot: u32) -> Picture {
        let mut image = RgbImage::from_pixel(64, 48, Rgb([color; 3]));
        image.put_pixel(dot, 10, Rgb([255, 0, 0]));
        Picture { image, seconds: 0.5 }
    }

    #[test]
    fn a_film_comes_back_with_its_pictures_and_times() {
        let bytes = encode(&[picture(40, 1), picture(40, 2), picture(200, 3)]).unwrap();
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(bytes.as_slice()).unwrap();
        let mut alphas = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            assert_eq!((frame.width, frame.height, frame.delay), (64, 48, 50));
            alphas.push(frame.buffer.chunks(4).filter(|pixel| pixel[3] > 0).count());
        }
        // All of the first, the two dots of the second, and all of the third but the pixel that stays red... none does.
        assert_eq!(alphas, [64 * 48, 2, 64 * 48]);
    }

    #[test]
    fn a_film_that_is_too_large_becomes_smaller() {
        let noise = |seed: u32| {
            let at = |x: u32, y: u32| {
                (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503) ^ seed).wrapping_mul(2_246_822_519)
            };
            let image = RgbImage::from_fn(640, 480, |x, y| {
                Rgb([(at(x, y) >> 8) as u8, (at(y, x) >> 16) as u8, (at(x, x ^ y) >> 24) as u8])
            });
            Picture { image, seconds: 0.1 }
        };
        let film: Vec<Picture> = (0..30).map(noise).collect();
        assert!(encode(&film).unwrap().len() <= MAX_BYTES);
        assert!(encode(&[]).is_err());
    }
}
