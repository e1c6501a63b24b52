//! One mark at a time: what a patch of ink looks most like.
//!
//! Every way to draw a mark is drawn with pens and slants of all kinds, and of drawing and patch the same numbers are
//! taken: how much ink and how many edges of which direction lie where in its box. The nearest drawing of each mark
//! says how far the patch is from that mark.

use super::strokes::{MODELS, Model};
use rayon::prelude::*;
use std::sync::OnceLock;

/// A patch of ink seen from the front, rows from the top; 0 ground, 1 ink.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    pub width: usize,
    pub height: usize,
    pub ink: Vec<f32>,
}

/// Size of the box that every mark is brought to.
const WIDE: usize = 24;
const HIGH: usize = 32;
/// Cells of the box in which numbers are taken, and directions of edges.
const CELLS: (usize, usize) = (6, 8);
const DIRECTIONS: usize = 4;
const LENGTH: usize = CELLS.0 * CELLS.1 * (DIRECTIONS + 1);
/// Thinner than this, marks keep their shape in the box: a bar does not become a square.
const THIN: f32 = 0.4;
/// Weight of a difference of widths, in their logarithm.
const ASPECT_WEIGHT: f32 = 0.1;

/// Less ink than this is none, such as a dark segment's, and so much less than full is full.
const FAINT: f32 = 0.15;
/// A drawing is no farther: two that share nothing, squared.
const NOTHING_ALIKE: f32 = 4.0;
/// Numbers that are compared at a time.
const CHUNK: usize = 48;

/// The numbers that are taken of a patch.
#[derive(Debug, Clone)]
pub(super) struct Features {
    values: Vec<f32>,
    /// Logarithm of width over height.
    aspect: f32,
}

/// How far a patch is from the nearest drawing of a mark; 0 is equal, 4 has nothing in common.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Match {
    pub mark: char,
    pub distance: f32,
}

impl Patch {
    /// Its value at a place between pixels; 0 outside.
    fn at(&self, x: f32, y: f32) -> f32 {
        let (left, top) = (x.floor(), y.floor());
        let value = |dx: f32, dy: f32| {
            let (x, y) = (left + dx, top + dy);
            let inside = x >= 0.0 && y >= 0.0 && (x as usize) < self.width && (y as usize) < self.height;
            if inside { self.ink[y as usize * self.width + x as usize] } else { 0.0 }
        };
        let (fx, fy) = (x - left, y - top);
        let across = |dy: f32| value(0.0, dy) * (1.0 - fx) + value(1.0, dy) * fx;
        across(0.0) * (1.0 - fy) + across(1.0) * fy
    }

    /// Left, top, right and bottom of its ink, in pixels from the upper left pixel's outer corner.
    pub fn extent(&self) -> Option<[f32; 4]> {
        let mut columns = vec![0f32; self.width];
        let mut rows = vec![0f32; self.height];
        for (at, &value) in self.ink.iter().enumerate() {
            let (x, y) = (at % self.width, at / self.width);
            columns[x] = columns[x].max(value);
            rows[y] = rows[y].max(value);
        }
        let (left, right) = ends(&columns)?;
        let (top, bottom) = ends(&rows)?;
        Some([left, top, right, bottom])
    }

    /// The patch turned by quarter turns clockwise.
    pub fn turned(&self, quarters: u8) -> Patch {
        let mut patch = self.clone();
        for _ in 0..quarters % 4 {
            let (width, height) = (patch.height, patch.width);
            let old = |x: usize, y: usize| patch.ink[(patch.height - 1 - x) * patch.width + y];
            let ink = (0..width * height).map(|at| old(at % width, at / width)).collect();
            patch = Patch { width, height, ink };
        }
        patch
    }

    /// The numbers of its ink; `None` without ink.
    pub fn features(&self) -> Option<Features> {
        let [left, top, right, bottom] = self.extent()?;
        let (width, height) = ((right - left).max(0.5), (bottom - top).max(0.5));
        let aspect = width / height;
        let (mut span_x, mut span_y) = (WIDE as f32, HIGH as f32);
        if aspect < THIN {
            span_x *= aspect / THIN;
        } else if aspect > 1.0 / THIN {
            span_y /= aspect * THIN;
        }
        let (step_x, step_y) = (width / span_x, height / span_y);
        let (from_x, from_y) =
            (left - 0.5 * (WIDE as f32 - span_x) * step_x, top - 0.5 * (HIGH as f32 - span_y) * step_y);
        const PAD: usize = 2;
        let (across, down) = (WIDE + 2 * PAD, HIGH + 2 * PAD);
        let mut field = vec![0f32; across * down];
        for (at, value) in field.iter_mut().enumerate() {
            let x = from_x + ((at % across) as f32 - PAD as f32 + 0.5) * step_x - 0.5;
            let y = from_y + ((at / across) as f32 - PAD as f32 + 0.5) * step_y - 0.5;
            *value = ((self.at(x, y) - FAINT) / (1.0 - 2.0 * FAINT)).clamp(0.0, 1.0);
        }
        Some(Features { values: numbers(&field, across, down), aspect: aspect.ln() })
    }
}

/// Where a profile passes one half, from its first and its last end, with places between pixels.
fn ends(profile: &[f32]) -> Option<(f32, f32)> {
    let first = profile.iter().position(|value| *value > 0.5)?;
    let last = profile.iter().rposition(|value| *value > 0.5)?;
    let between = |inner: f32, outer: f32| (inner - 0.5) / (inner - outer).max(1e-3);
    let before = if first > 0 { profile[first - 1] } else { 0.0 };
    let after = profile.get(last + 1).copied().unwrap_or(0.0);
    Some((first as f32 + 0.5 - between(profile[first], before), last as f32 + 0.5 + between(profile[last], after)))
}

/// Ink and edges by direction in cells whose borders are soft, each of length one as a whole.
fn numbers(field: &[f32], across: usize, down: usize) -> Vec<f32> {
    let mut values = vec![0f32; LENGTH];
    let cells = CELLS.0 * CELLS.1;
    let cell = |at: usize, size: usize, count: usize| {
        let place = ((at as f32 + 0.5) / size as f32 * count as f32 - 0.5).clamp(0.0, count as f32 - 1.0);
        let low = place as usize;
        (low, (low + 1).min(count - 1), place - low as f32)
    };
    for y in 1..down - 1 {
        let (y0, y1, fy) = cell(y, down, CELLS.1);
        for x in 1..across - 1 {
            let at = y * across + x;
            let (gx, gy) = (field[at + 1] - field[at - 1], field[at + across] - field[at - across]);
            let strength = gx.hypot(gy);
            let ink = field[at];
            if ink <= 0.0 && strength <= 0.0 {
                continue;
            }
            let (x0, x1, fx) = cell(x, across, CELLS.0);
            let angle = (gy.atan2(gx) / std::f32::consts::PI).rem_euclid(1.0) * DIRECTIONS as f32;
            let (direction, part) = (angle as usize % DIRECTIONS, angle.fract());
            let next = (direction + 1) % DIRECTIONS;
            for (row, wy) in [(y0, 1.0 - fy), (y1, fy)] {
                for (column, wx) in [(x0, 1.0 - fx), (x1, fx)] {
                    let (cell, weight) = (row * CELLS.0 + column, wx * wy);
                    values[cell] += weight * ink;
                    values[cells * (1 + direction) + cell] += weight * strength * (1.0 - part);
                    values[cells * (1 + next) + cell] += weight * strength * part;
                }
            }
        }
    }
    // Roots, so that a thick stroke differs less from a thin one.
    for half in [0..cells, cells..LENGTH] {
        let total: f32 = values[half.clone()].iter().sum();
        for value in &mut values[half] {
            *value = (*value / total.max(1e-6)).sqrt();
        }
    }
    values
}

/// The distances to all marks, nearest first.
pub(super) fn matches(features: &Features) -> Vec<Match> {
    let mut found: Vec<Match> = Vec::new();
    for (mark, drawing) in drawings() {
        if found.last().is_none_or(|last| last.mark != *mark) {
            // The drawings of a mark stand together.
            found.push(Match { mark: *mark, distance: NOTHING_ALIKE });
        }
        let Some(known) = found.last_mut() else { continue };
        let mut distance = ASPECT_WEIGHT * excess(features.aspect - drawing.aspect);
        for (own, other) in features.values.chunks(CHUNK).zip(drawing.values.chunks(CHUNK)) {
            // Enough is known of a drawing that is farther than another of the same mark.
            if distance >= known.distance {
                break;
            }
            distance += own.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
        }
        known.distance = known.distance.min(distance);
    }
    found.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    found
}

/// What a width counts beyond what faces differ by.
fn excess(difference: f32) -> f32 {
    (difference.abs() - 0.35).max(0.0).powi(2)
}

fn drawings() -> &'static [(char, Features)] {
    static DRAWINGS: OnceLock<Vec<(char, Features)>> = OnceLock::new();
    DRAWINGS.get_or_init(|| MODELS.par_iter().flat_map_iter(drawings_of).collect())
}

/// A mark drawn with every pen, upright and slanted, as cameras see it from near and from afar, with feet and without.
fn drawings_of(model: &Model) -> Vec<(char, Features)> {
    let mut all = Vec::new();
    // Signs as wide as high, digits narrower.
    let width = if model.mark.is_ascii_alphanumeric() { 0.6 } else { 0.95 };
    for pen in PENS.iter().filter(|pen| pen.is_round() || model.is_written()) {
        for slant in SLANTS {
            for blur in BLURS {
                let with_feet: &[bool] =
                    if slant == 0.0 && !model.feet().is_empty() { &[false, true] } else { &[false] };
                let faces = with_feet.iter().map(|feet| draw(model, width, *pen, slant, blur, *feet));
                all.extend(faces.filter_map(|patch| Some((model.mark, patch.features()?))));
            }
        }
    }
    all
}

/// The end of a pen.
#[derive(Debug, Clone, Copy)]
struct Pen {
    /// Half axes, heights of a mark.
    half: (f32, f32),
    /// Angle of the first, radians from the right.
    angle: f32,
    /// Whether it is a rectangle, as the dots of coarse print are, and not an ellipse.
    square: bool,
}

impl Pen {
    fn is_round(self) -> bool {
        self.half.0 == self.half.1
    }
}

/// Round pens, one with thick down strokes, a broad nib as a hand holds it, and one that draws in dots.
const PENS: [Pen; 6] = [
    Pen { half: (0.05, 0.05), angle: 0.0, square: false },
    Pen { half: (0.08, 0.08), angle: 0.0, square: false },
    Pen { half: (0.115, 0.115), angle: 0.0, square: false },
    Pen { half: (0.08, 0.03), angle: 0.0, square: false },
    Pen { half: (0.085, 0.035), angle: 0.5, square: false },
    Pen { half: (0.12, 0.075), angle: 0.0, square: true },
];
const SLANTS: [f32; 3] = [0.0, 0.1, 0.2];
/// Half the width of an edge, heights of a mark: one of some 16 pixels, and one of half as many.
const BLURS: [f32; 2] = [0.04, 0.085];

/// Draws a mark one high with a pen, with feet or without.
fn draw(model: &Model, width: f32, pen: Pen, slant: f32, blur: f32, feet: bool) -> Patch {
    const SCALE: f32 = 32.0;
    const MARGIN: f32 = 8.0;
    let thick = pen.half.0.max(pen.half.1);
    // A round end reaches half the pen's width further.
    let gap = thick + 0.03;
    let mut lines = model.pieces((gap / width, gap));
    if feet {
        lines.extend(model.feet());
    }
    // In axes in which the pen's end is a disc of radius 1.
    let (sin, cos) = pen.angle.sin_cos();
    let bent = |(x, y): (f32, f32)| ((cos * x + sin * y) / pen.half.0, (cos * y - sin * x) / pen.half.1);
    let pieces: Vec<[(f32, f32); 2]> =
        lines.into_iter().map(|ends| ends.map(|(x, y)| bent((x * width + slant * y, y)))).collect();
    let size = |span: f32| (span * SCALE + 2.0 * MARGIN).ceil() as usize;
    let (columns, rows) = (size(width + slant), size(1.0));
    let edge = (pen.half.0 * pen.half.1).sqrt() / (2.0 * blur);
    let ink = (0..columns * rows).map(|at| {
        let (x, y) = ((at % columns) as f32, (at / columns) as f32);
        let (x, y) = bent(((x - MARGIN) / SCALE, 1.0 - (y - MARGIN) / SCALE));
        let away = pieces.iter().map(|ends| away(*ends, x, y, pen.square)).fold(f32::INFINITY, f32::min);
        (0.5 + (1.0 - away) * edge).clamp(0.0, 1.0)
    });
    Patch { width: columns, height: rows, ink: ink.collect() }
}

/// How far a point is from a line between two points; along the axes, if that is asked for.
fn away([a, b]: [(f32, f32); 2], x: f32, y: f32, square: bool) -> f32 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let share = (((x - a.0) * dx + (y - a.1) * dy) / (dx * dx + dy * dy).max(1e-6)).clamp(0.0, 1.0);
    let (x, y) = (x - a.0 - share * dx, y - a.1 - share * dy);
    if square { x.abs().max(y.abs()) } else { x.hypot(y) }
}

/// A patch farther from every drawing is no mark.
pub(super) const FARTHEST: f32 = 0.42;

/// The probability that the nearest mark is the right one, for a mark of a height in pixels.
pub(super) fn confidence(matches: &[Match], height_px: f64) -> f64 {
    let [first, second, ..] = matches else { return 0.0 };
    let margin = f64::from((second.distance - first.distance) / (second.distance + first.distance).max(1e-3));
    let odds = CALIBRATION[0]
        + CALIBRATION[1] * margin
        + CALIBRATION[2] * f64::from(first.distance)
        + CALIBRATION[3] * (height_px.max(1.0) / 14.0).ln();
    (1.0 / (1.0 + (-odds).exp())).min(MOST_CONFIDENCE)
}

/// No mark is surer: a face of type may draw it as nobody here knows.
const MOST_CONFIDENCE: f64 = 0.995;
/// Logarithm of the odds: constant, and of the margin over the second, the distance, the logarithm of the height.
const CALIBRATION: [f64; 4] = [2.0, 12.0, -8.0, 1.0];
