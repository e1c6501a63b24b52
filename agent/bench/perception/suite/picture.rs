//! Pictures of a scene for a person who looks why something was lost.

use super::{score::Fate, view::View};
use acm_concept::{object::Percepts, template::TemplateLibrary};
use acm_perception::overlay;
use image::{Rgb, RgbImage};

/// The true outlines.
const TRUTH: Rgb<u8> = Rgb([255, 0, 0]);

/// What was reported over the colour image, what is true as red outlines, and what became of each thing.
pub fn draw(view: &View, percepts: &Percepts, fates: &[Fate], library: &TemplateLibrary) -> RgbImage {
    let frame = &view.frames[0];
    let mut picture = overlay::draw(frame, percepts, &[], library);
    let width = frame.header.intrinsics.width as usize;
    for (index, label) in view.labels.iter().enumerate() {
        let differs = |other: usize| view.labels.get(other).is_some_and(|neighbour| neighbour != label);
        if differs(index + 1) || differs(index + width) {
            let (column, row) = ((index % width) as u32, (index / width) as u32);
            if let Some(pixel) = picture.get_pixel_mut_checked(column, row) {
                *pixel = TRUTH;
            }
        }
    }
    let lines: Vec<String> =
        fates.iter().enumerate().map(|(at, fate)| format!("thing {at}: {}", fate.name().replace('_', " "))).collect();
    overlay::note(&mut picture, &lines);
    picture
}
