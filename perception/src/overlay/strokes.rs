//! Lines over a picture: outlines of segments and edges of solids, each with a dark rim.

use super::blend;
use crate::{fit::corners, labels};
use acm_concept::{
    object::Percepts,
    solid::{PlacedSolid, Solid},
};
use glam::DVec3;
use image::{Rgb, RgbImage};

/// Lines that are painted at last: first the dark rims of all, then their colours.
pub(super) struct Strokes {
    width: u32,
    height: u32,
    scale: i64,
    dots: Vec<(i64, i64, Rgb<u8>)>,
}

impl Strokes {
    /// Strokes for a picture of a size, `scale` pixels wide.
    pub fn new(width: u32, height: u32, scale: i64) -> Strokes {
        Strokes { width, height, scale, dots: Vec::new() }
    }
    fn dot(&mut self, column: i64, row: i64, color: Rgb<u8>) {
        if (0..i64::from(self.width)).contains(&column) && (0..i64::from(self.height)).contains(&row) {
            self.dots.push((column, row, color));
        }
    }
    pub fn paint(&self, image: &mut RgbImage) {
        let half = self.scale / 2;
        let square = |grown: i64| {
            let range = -half - grown..self.scale - half + grown;
            range.clone().flat_map(move |dy| range.clone().map(move |dx| (dx, dy)))
        };
        // Each pixel of a rim once: rims of neighbouring dots must not add up to black.
        let mut dark = vec![false; self.width as usize * self.height as usize];
        for &(column, row, _) in &self.dots {
            for (x, y) in square(1).map(|(dx, dy)| (column + dx, row + dy)) {
                if (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y) {
                    dark[(y * i64::from(self.width) + x) as usize] = true;
                }
            }
        }
        for index in (0..dark.len()).filter(|&i| dark[i]) {
            let (column, row) = (index % self.width as usize, index / self.width as usize);
            blend(image, column as i64, row as i64, Rgb([0, 0, 0]), 0.45);
        }
        for &(column, row, color) in &self.dots {
            for (dx, dy) in square(0) {
                blend(image, column + dx, row + dy, color, 0.9);
            }
        }
    }
}

/// The border of a label's pixels.
pub(super) fn outline(strokes: &mut Strokes, owners: &labels::LabelImage, label: u16, color: Rgb<u8>) {
    let (width, height) = owners.dimensions();
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
                strokes.dot(i64::from(column), i64::from(row), color);
            }
        }
    }
}

/// The edges of a solid.
pub(super) fn wire_frame(strokes: &mut Strokes, percepts: &Percepts, solid: &PlacedSolid, color: Rgb<u8>) {
    let in_camera = PlacedSolid { solid: solid.solid, pose: percepts.frame.camera_pose.inverse() * solid.pose };
    let mut walked = 0;
    for corners in corners(&solid.solid) {
        let count = corners.len();
        let edges: Vec<(usize, usize)> = match solid.solid {
            Solid::Box { .. } => {
                (0..8).flat_map(|i: usize| [1, 2, 4].map(|bit| (i, i | bit))).filter(|(a, b)| a != b).collect()
            }
            // Even corners are the lower rim, odd ones the upper; a few uprights join them.
            Solid::Cylinder { .. } | Solid::Ellipsoid { .. } | Solid::Revolved { .. } => {
                (0..count).map(|i| (i, (i + 2) % count)).chain((0..count).step_by(12).map(|i| (i, i + 1))).collect()
            }
        };
        for (a, b) in edges {
            let ends = [corners[a], corners[b]].map(|corner| in_camera.pose.transform_point(corner));
            walked = line(strokes, percepts, &in_camera, ends, walked, color);
        }
    }
}

/// Draws a line between two points of the camera frame, dotted where the solid itself hides it. `walked` counts the
/// steps before it, so that dots go on evenly round a rim; returns the count after it.
fn line(
    strokes: &mut Strokes,
    percepts: &Percepts,
    solid: &PlacedSolid,
    [from, to]: [DVec3; 2],
    walked: usize,
    color: Rgb<u8>,
) -> usize {
    let project = |p: DVec3| percepts.frame.intrinsics.project(p);
    let (Some(a), Some(b)) = (project(from), project(to)) else { return walked };
    let steps = (a.distance(b) * 1.5).clamp(1.0, 6000.0) as usize;
    for step in 0..=steps {
        let share = step as f64 / steps as f64;
        let point = from.lerp(to, share);
        // The ray reaches the point at 1; a polygon's edge lies a little inside or outside of the round solid.
        let hidden = solid.intersect_ray(DVec3::ZERO, point).is_some_and(|(enter, _)| enter < 0.985);
        let gap = 4 * strokes.scale as usize;
        if hidden && !(walked + step).is_multiple_of(gap) {
            continue;
        }
        if let Some(at) = project(point) {
            strokes.dot(at.x.round() as i64, at.y.round() as i64, color);
        }
    }
    walked + steps
}
