//! The shape of a spot on its face.

use super::face::Face;
use crate::scene::convex_hull;
use glam::{DVec2, Vec2Swizzles};

/// Extents, middle and thickness of a spot, metres, in axes of which `up` is one.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    pub low: DVec2,
    pub high: DVec2,
    /// Mean width of its strokes.
    pub stroke_m: f64,
    /// Pixels to a metre, the geometric mean over directions.
    pub px_per_m: f64,
    /// Its area.
    pub area_m2: f64,
}

impl Shape {
    /// `None` for what the camera does not see from the front.
    pub fn of(face: &Face, pixels: &[usize], up: DVec2) -> Option<Shape> {
        let right = DVec2::new(up.y, -up.x);
        let grid = face.window.grid;
        let first = face.place_of(*pixels.get(pixels.len() / 2)?);
        let scale = DVec2::new(face.pixels_per_metre(first, right), face.pixels_per_metre(first, up));
        if scale.min_element() <= 0.0 {
            return None;
        }
        let (mut low, mut high, mut rim) = (DVec2::INFINITY, DVec2::NEG_INFINITY, 0usize);
        for (at, &pixel) in pixels.iter().enumerate() {
            // Of sorted pixels only those at the ends of a run can be extreme.
            let inner = at > 0
                && at + 1 < pixels.len()
                && pixels[at - 1] + 1 == pixel
                && pixels[at + 1] == pixel + 1
                && grid.column(pixel) > 0;
            let surrounded = inner && grid.neighbours(pixel).all(|other| pixels.binary_search(&other).is_ok());
            rim += usize::from(!surrounded);
            if !surrounded {
                let place = face.place_of(pixel);
                let place = DVec2::new(right.dot(place), up.dot(place));
                (low, high) = (low.min(place), high.max(place));
            }
        }
        let px_per_m = (scale.x * scale.y).sqrt();
        let half = 0.5 / scale;
        let stroke_px = 2.0 * pixels.len() as f64 / rim.max(1) as f64;
        Some(Shape {
            low: low - half,
            high: high + half,
            stroke_m: stroke_px / px_per_m,
            px_per_m,
            area_m2: pixels.len() as f64 / area_scale(face, first, right, up),
        })
    }
    pub fn middle(&self) -> DVec2 {
        0.5 * (self.low + self.high)
    }
    pub fn size(&self) -> DVec2 {
        self.high - self.low
    }
    /// How far the boxes of two spots are apart.
    pub fn apart(&self, other: &Shape) -> f64 {
        let gap = (self.low - other.high).max(other.low - self.high).max(DVec2::ZERO);
        gap.length()
    }
    /// Its area over that of the ellipse in its box.
    pub fn ellipse_fill(&self) -> f64 {
        let size = self.size();
        self.area_m2 / (0.25 * std::f64::consts::PI * size.x * size.y).max(1e-12)
    }
    /// Whether it is as wide as high and fills the ellipse in its box, within a tolerance.
    pub fn is_round(&self, tolerance: f64) -> bool {
        let size = self.size();
        (size.x / size.y).ln().abs() < tolerance && (self.ellipse_fill() - 1.0).abs() < tolerance
    }
}

/// Pixels to a square metre.
fn area_scale(face: &Face, place: DVec2, right: DVec2, up: DVec2) -> f64 {
    let step = 1e-3;
    let at = |offset: DVec2| face.project(place + offset * step);
    match (at(DVec2::ZERO), at(right), at(up)) {
        (Some(origin), Some(x), Some(y)) => ((x - origin).perp_dot(y - origin) / (step * step)).abs().max(1e-6),
        _ => 1e-6,
    }
}

/// The smallest rectangle round some pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// The share of it that they fill.
    pub fill: f64,
    /// The direction of its side that is nearest to up.
    pub up: DVec2,
    /// Its sides across that and along it, metres.
    pub size: DVec2,
}

/// The smallest rectangle round some pixels, ascending.
pub(super) fn frame(face: &Face, pixels: &[usize]) -> Option<Frame> {
    let grid = face.window.grid;
    // The ends of rows and columns hold the hull.
    let ends = pixels.iter().enumerate().filter(|(k, at)| {
        let (before, after) = (k.checked_sub(1).and_then(|k| pixels.get(k)), pixels.get(k + 1));
        before.is_none_or(|b| b + 1 != **at) || after.is_none_or(|a| **at + 1 != *a)
    });
    let half = 0.5;
    let corners = ends.flat_map(|(_, &at)| {
        let (x, y) = (grid.column(at) as f64, grid.row(at) as f64);
        [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(dx, dy)| face.place(x + dx, y + dy))
    });
    let hull = convex_hull(corners.collect());
    let (size, up) = smallest_box(&hull)?;
    let middle = face.place_of(*pixels.get(pixels.len() / 2)?);
    let area = pixels.len() as f64 / area_scale(face, middle, DVec2::X, DVec2::Y);
    Some(Frame { fill: area / (size.x * size.y).max(1e-9), up, size })
}

/// The sides of the smallest rectangle round a convex polygon, the second of which is nearer to up, and its direction.
pub(super) fn smallest_box(hull: &[DVec2]) -> Option<(DVec2, DVec2)> {
    let mut best: Option<(f64, DVec2, DVec2)> = None;
    for (at, &corner) in hull.iter().enumerate() {
        let Some(along) = (hull[(at + 1) % hull.len()] - corner).try_normalize() else { continue };
        let across = along.perp();
        let spread = |axis: DVec2| {
            let values = hull.iter().map(|p| p.dot(axis));
            values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
        };
        let extent = DVec2::new(spread(along), spread(across));
        if best.is_none_or(|(least, ..)| extent.x * extent.y < least) {
            // Of the four directions the one nearest to up.
            let (one, two) = if along.y.abs() > across.y.abs() { (along, extent.yx()) } else { (across, extent) };
            best = Some((extent.x * extent.y, two, if one.y < 0.0 { -one } else { one }));
        }
    }
    best.map(|(_, size, up)| (size, up))
}
