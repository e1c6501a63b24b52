//! A picture of what was grounded, for a person to judge: outlines, names, wire-frames and sizes.

mod font;
mod strokes;

use crate::{expected, labels};
use acm_concept::{
    camera::RgbdFrame,
    object::{Blindness, GroundedObject, Observability, Percepts},
    solid::{Enclosure, PlacedSolid},
    template::TemplateLibrary,
};
use font::Font;
use image::{Rgb, RgbImage};
use strokes::{Strokes, outline, wire_frame};

/// Draws the frame with every object's outline and fitted solids in a colour of its own, and a line of text with its
/// name, category, size in centimetres (`~` before sizes that were not observed) and confidence.
///
/// Edges of a solid that it hides itself are dotted. Every line has a dark rim, so that it shows on any background;
/// letters and lines grow with the picture. `names` are the labels of the objects, such as their ids; objects without
/// one are numbered.
pub fn draw(frame: &RgbdFrame, percepts: &Percepts, names: &[Option<String>], library: &TemplateLibrary) -> RgbImage {
    let (width, height) = (frame.header.intrinsics.width, frame.header.intrinsics.height);
    let mut image =
        RgbImage::from_raw(width, height, frame.color.to_vec()).unwrap_or_else(|| RgbImage::new(width, height));
    for pixel in image.pixels_mut() {
        // Dimmed, so that the drawing stands out.
        pixel.0 = pixel.0.map(|value| (u16::from(value) * 3 / 5 + 30) as u8);
    }
    let owners = labels::draw(percepts);
    let mut strokes = Strokes::new(width, height, scale(&image));
    for (index, object) in percepts.objects.iter().enumerate() {
        let color = PALETTE[index % PALETTE.len()];
        outline(&mut strokes, &owners, index as u16 + 1, color);
        for solid in expected::solids(&object.parts, library) {
            wire_frame(&mut strokes, percepts, &solid, color);
        }
    }
    strokes.paint(&mut image);
    let boxes: Vec<[i64; 4]> = percepts.objects.iter().map(|o| o.support.bounds.map(i64::from)).collect();
    let mut taken: Vec<[i64; 4]> = Vec::new();
    for (index, object) in percepts.objects.iter().enumerate() {
        let name = names.get(index).cloned().flatten().unwrap_or_else(|| format!("#{index}"));
        let mut lines = vec![format!("{name} {}", object.category), size_text(object, library)];
        lines.extend(object.readings.iter().take(MAX_READINGS).map(ToString::to_string));
        let place = place_of(&image, &lines, boxes[index], &boxes, &taken);
        caption(&mut image, place, &lines, boxes[index], PALETTE[index % PALETTE.len()]);
        taken.push(place);
    }
    if let Some(blindness) = percepts.blindness {
        let reason = match blindness {
            Blindness::NoDepth => "blind: no depth",
            Blindness::DepthScale => "blind: the depth is in another unit",
            Blindness::NoColor => "blind: the colour image is black",
            Blindness::Overexposed => "blind: the colour image is white",
            Blindness::NoSupport => "blind: no surface on which things could stand",
            Blindness::Frozen => "blind: the last picture again",
        };
        note(&mut image, &[reason.into()]);
    }
    image
}

/// Writes lines into the lower left corner of a picture, such as the names of what is not in it.
pub fn note(image: &mut RgbImage, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let font = Font { scale: scale(image) };
    let width = lines.iter().map(|line| font.width(line)).max().unwrap_or(0) + 4 * font.scale;
    let height = lines.len() as i64 * font.line() + 3 * font.scale;
    let top = i64::from(image.height()) - height;
    plate(image, [0, top, width, top + height]);
    for (index, text) in lines.iter().enumerate() {
        let at = top + 2 * font.scale + index as i64 * font.line();
        font.write(image, 2 * font.scale, at, text, Rgb([255, 255, 255]));
    }
}

/// Most readings of an object that its caption tells.
const MAX_READINGS: usize = 4;

/// Pixels a dot: 1 up to 960 columns, 2 for full HD.
fn scale(image: &RgbImage) -> i64 {
    ((i64::from(image.width()) + 320) / 640).clamp(1, 6)
}

const PALETTE: [Rgb<u8>; 10] = [
    Rgb([255, 225, 60]),
    Rgb([80, 220, 255]),
    Rgb([120, 255, 120]),
    Rgb([255, 130, 220]),
    Rgb([255, 160, 60]),
    Rgb([160, 170, 255]),
    Rgb([255, 255, 255]),
    Rgb([60, 255, 210]),
    Rgb([255, 110, 100]),
    Rgb([200, 230, 100]),
];

/// Length, width and height, or diameter and height of a single cylinder, and the confidence in per cent.
fn size_text(object: &GroundedObject, library: &TemplateLibrary) -> String {
    let Some(part) = object.parts.first() else { return String::new() };
    let unsure = part.parameters.iter().any(|p| !matches!(p.observability, Observability::Observed));
    let flat = library.get(&part.template).is_some_and(|t| t.parameters.iter().any(|p| p.fixed));
    let mark = if unsure && !flat { "~" } else { "" };
    let centimetres = |metres: f64| format!("{:.1}", metres * 100.0);
    let size = match (expected::solids(&object.parts, library).as_slice(), library.extents_of(&object.parts)) {
        ([PlacedSolid { solid, .. }], _) if let Enclosure::Cylinder { radius, height } = solid.enclosure() => {
            format!("D{}x{}", centimetres(2.0 * radius), centimetres(height))
        }
        (_, Some(size)) => size.to_array().map(centimetres).join("x"),
        (_, None) => part.template.clone(),
    };
    format!("{mark}{size}cm {:.0}%", object.confidence * 100.0)
}

fn blend(image: &mut RgbImage, column: i64, row: i64, color: Rgb<u8>, share: f32) {
    let (Ok(column), Ok(row)) = (u32::try_from(column), u32::try_from(row)) else { return };
    if let Some(pixel) = image.get_pixel_mut_checked(column, row) {
        for (old, new) in pixel.0.iter_mut().zip(color.0) {
            *old = (f32::from(*old) * (1.0 - share) + f32::from(new) * share) as u8;
        }
    }
}

/// The rectangle (left, top, right, bottom) for a caption: near its object, and over as little as possible of objects
/// and of other captions.
fn place_of(
    image: &RgbImage,
    lines: &[String],
    object: [i64; 4],
    objects: &[[i64; 4]],
    taken: &[[i64; 4]],
) -> [i64; 4] {
    let font = Font { scale: scale(image) };
    let width = lines.iter().map(|line| font.width(line)).max().unwrap_or(0) + 4 * font.scale;
    let height = lines.len() as i64 * font.line() + 3 * font.scale;
    let (middle, centre) = ((object[0] + object[2]) / 2, (object[1] + object[3]) / 2);
    let mut best = (i64::MAX, [0; 4]);
    for step in 0..12i64 {
        let gap = 4 + 8 * step;
        let corners = [
            (middle - width / 2, object[1] - height - gap),
            (middle - width / 2, object[3] + gap),
            (object[2] + gap, centre - height / 2),
            (object[0] - width - gap, centre - height / 2),
            (object[2] + gap, object[1] - height - gap),
            (object[0] - width - gap, object[3] + gap),
        ];
        for (left, top) in corners {
            let left = left.clamp(0, (i64::from(image.width()) - width).max(0));
            let top = top.clamp(0, (i64::from(image.height()) - height).max(0));
            let place = [left, top, left + width, top + height];
            let covered: i64 = objects.iter().map(|o| common_area(&place, o)).sum();
            let overwritten: i64 = taken.iter().map(|t| common_area(&place, t)).sum();
            let cost = covered + 20 * overwritten + 12 * gap;
            if cost < best.0 {
                best = (cost, place);
            }
        }
    }
    best.1
}

fn common_area(a: &[i64; 4], b: &[i64; 4]) -> i64 {
    (a[2].min(b[2]) - a[0].max(b[0])).max(0) * (a[3].min(b[3]) - a[1].max(b[1])).max(0)
}

/// Writes lines into a rectangle and joins it to its object.
fn caption(image: &mut RgbImage, place: [i64; 4], lines: &[String], object: [i64; 4], color: Rgb<u8>) {
    let [left, top, right, bottom] = place;
    let nearest = |value: i64, low: i64, high: i64| value.clamp(low, high);
    let to = [(object[0] + object[2]) / 2, (object[1] + object[3]) / 2];
    let from = [nearest(to[0], left, right), nearest(to[1], top, bottom)];
    let end = [nearest(from[0], object[0], object[2]), nearest(from[1], object[1], object[3])];
    let steps = (end[0] - from[0]).abs().max((end[1] - from[1]).abs()).clamp(1, 400);
    for step in (0..=steps).step_by(2) {
        let at = |axis: usize| from[axis] + (end[axis] - from[axis]) * step / steps;
        blend(image, at(0), at(1), color, 0.8);
    }
    plate(image, place);
    let font = Font { scale: scale(image) };
    for (index, text) in lines.iter().enumerate() {
        let at = top + 2 * font.scale + index as i64 * font.line();
        font.write(image, left + 2 * font.scale, at, text, color);
    }
}

/// Darkens a rectangle so that letters show on it.
fn plate(image: &mut RgbImage, [left, top, right, bottom]: [i64; 4]) {
    for row in top..bottom {
        for column in left..right {
            blend(image, column, row, Rgb([0, 0, 0]), 0.75);
        }
    }
}

#[cfg(test)]
mod tests;
