//! A picture of what was grounded, for a person to judge: outlines, names, wire-frames and sizes.

mod font;

use crate::{expected, fit::corners, labels};
use acm_concept::{
    camera::RgbdFrame,
    object::{GroundedObject, Observability, Percepts},
    pose::Pose,
    solid::{PlacedSolid, Solid},
    template::TemplateLibrary,
};
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};

/// Draws the frame with every object's outline and fitted solids in a colour of its own, and a line of text with its
/// name, category, size in centimetres (`~` before sizes that were not observed) and confidence.
///
/// `names` are the labels of the objects, such as their ids; objects without one are numbered.
pub fn draw(frame: &RgbdFrame, percepts: &Percepts, names: &[Option<String>], library: &TemplateLibrary) -> RgbImage {
    let (width, height) = (frame.header.intrinsics.width, frame.header.intrinsics.height);
    let mut image =
        RgbImage::from_raw(width, height, frame.color.to_vec()).unwrap_or_else(|| RgbImage::new(width, height));
    for pixel in image.pixels_mut() {
        // Dimmed, so that the drawing stands out.
        pixel.0 = pixel.0.map(|value| (u16::from(value) * 3 / 5 + 30) as u8);
    }
    let owners = labels::draw(percepts);
    for (index, object) in percepts.objects.iter().enumerate() {
        let color = PALETTE[index % PALETTE.len()];
        outline(&mut image, &owners, index as u16 + 1, color);
        for solid in expected::solids(&object.parts, library) {
            wire_frame(&mut image, percepts, &solid, color);
        }
    }
    let boxes: Vec<[i64; 4]> = percepts.objects.iter().map(|o| o.support.bounds.map(i64::from)).collect();
    let mut taken: Vec<[i64; 4]> = Vec::new();
    for (index, object) in percepts.objects.iter().enumerate() {
        let name = names.get(index).cloned().flatten().unwrap_or_else(|| format!("#{index}"));
        let lines = [format!("{name} {}", object.category), size_text(object, library)];
        let place = place_of(&image, &lines, boxes[index], &boxes, &taken);
        caption(&mut image, place, &lines, boxes[index], PALETTE[index % PALETTE.len()]);
        taken.push(place);
    }
    if let Some(blindness) = percepts.blindness {
        font::text(&mut image, 8, 8, &format!("blind: {blindness:?}"), Rgb([255, 80, 80]));
    }
    image
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

/// Length, width and height, or diameter and height, of the main part, and the confidence in per cent.
fn size_text(object: &GroundedObject, library: &TemplateLibrary) -> String {
    let Some(part) = object.parts.first() else { return String::new() };
    let unsure = part.parameters.iter().any(|p| !matches!(p.observability, Observability::Observed));
    let flat = library.get(&part.template).is_some_and(|t| t.parameters.iter().any(|p| p.fixed));
    let mark = if unsure && !flat { "~" } else { "" };
    let centimetres = |metres: f64| format!("{:.1}", metres * 100.0);
    let size = match expected::solids(&object.parts, library).first().map(|s| s.solid) {
        Some(Solid::Box { size }) => {
            format!("{}x{}x{}", centimetres(size.x), centimetres(size.y), centimetres(size.z))
        }
        Some(Solid::Cylinder { radius, height }) => {
            format!("D{}x{}", centimetres(2.0 * radius), centimetres(height))
        }
        None => part.template.clone(),
    };
    format!("{mark}{size}cm {:.0}%", object.confidence * 100.0)
}

fn outline(image: &mut RgbImage, owners: &labels::LabelImage, label: u16, color: Rgb<u8>) {
    let (width, height) = image.dimensions();
    for row in 1..height.saturating_sub(1) {
        for column in 1..width.saturating_sub(1) {
            let own = |x: u32, y: u32| owners.get_pixel(x, y).0[0] == label;
            let around = [(column - 1, row), (column + 1, row), (column, row - 1), (column, row + 1)];
            // A lone foreign pixel is a hole in the depth, not a border.
            let is_hole = |x: u32, y: u32| {
                let near = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
                near.iter().filter(|&&(x, y)| x < width && y < height && own(x, y)).count() >= 3
            };
            if own(column, row) && around.iter().any(|&(x, y)| !own(x, y) && !is_hole(x, y)) {
                blend(image, i64::from(column), i64::from(row), color, 0.7);
            }
        }
    }
}

fn wire_frame(image: &mut RgbImage, percepts: &Percepts, solid: &PlacedSolid, color: Rgb<u8>) {
    let to_camera = percepts.frame.camera_pose.inverse() * solid.pose;
    let corners = corners(&solid.solid);
    let count = corners.len();
    let edges: Vec<(usize, usize)> = match solid.solid {
        Solid::Box { .. } => {
            (0..8).flat_map(|i: usize| [1, 2, 4].map(|bit| (i, i | bit))).filter(|(a, b)| a != b).collect()
        }
        // Even corners are the lower rim, odd ones the upper; a few uprights join them.
        Solid::Cylinder { .. } => {
            (0..count).map(|i| (i, (i + 2) % count)).chain((0..count).step_by(12).map(|i| (i, i + 1))).collect()
        }
    };
    for (a, b) in edges {
        line(image, percepts, &to_camera, corners[a], corners[b], color);
    }
}

fn line(image: &mut RgbImage, percepts: &Percepts, to_camera: &Pose, a: DVec3, b: DVec3, color: Rgb<u8>) {
    let project = |p: DVec3| percepts.frame.intrinsics.project(to_camera.transform_point(p));
    let (Some(a), Some(b)) = (project(a), project(b)) else { return };
    let steps = (a.distance(b) * 1.5).clamp(1.0, 6000.0) as usize;
    for step in 0..=steps {
        let at: DVec2 = a.lerp(b, step as f64 / steps as f64);
        blend(image, at.x.round() as i64, at.y.round() as i64, color, 0.9);
    }
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
    let width = lines.iter().map(|line| font::width(line)).max().unwrap_or(0) + 4;
    let height = lines.len() as i64 * font::LINE + 3;
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
    for row in top..bottom {
        for column in left..right {
            blend(image, column, row, Rgb([0, 0, 0]), 0.65);
        }
    }
    for (index, text) in lines.iter().enumerate() {
        font::text(image, left + 2, top + 2 + index as i64 * font::LINE, text, color);
    }
}
