//! Marks, lamps and needles read from pixels, with a stated confidence.
//!
//! A thing's plane faces are found by depth, and each is seen as if from straight ahead. On a face spots of other colours
//! than its ground's are marks, lamps, dials, or grounds themselves, such as displays and labels. What stays in doubt is
//! [`Unreadable`], with its reason; what does not look like writing at all gives no reading.
//!
//! | module | holds |
//! |---|---|
//! | `face` | plane faces of a thing, and their coordinates |
//! | `ink`, `shape` | ground and spots; the shape of a spot |
//! | `strokes`, `glyph` | how marks are drawn; what a patch of ink looks most like |
//! | `marks`, `text` | strokes that make marks; marks in lines, which way up |
//! | `round` | lamps; dials and their needles |

mod face;
mod glyph;
mod ink;
mod marks;
mod round;
mod shape;
mod strokes;
#[cfg(test)]
mod tests;
mod text;

use crate::scene::{Scene, convex_hull};
use acm_concept::{
    object::{GroundedObject, PixelSupport},
    reading::{Content, Reading, Unreadable, Upright},
};
use face::Face;
use glam::DVec2;
use ink::Spot;
use shape::Shape;
use text::{Line, Ways};

/// Readings that have this share of their place in common are of one thing.
const SAME_PLACE: f64 = 0.5;
/// Grounds within grounds: a display on a plate on a thing.
const MAX_DEPTH: usize = 3;
/// Spots of fewer pixels hold nothing.
const LEAST_GROUND_PX: usize = 80;
/// More readings on one thing are a texture.
const MAX_READINGS: usize = 16;
/// Ink on a panel is so far from its colour at least, CIELAB.
const STRANGE: f32 = 12.0;
/// A rectangle fills its box so far, seen by a camera; a mark does not.
const PANEL_FILL: f64 = 0.87;
/// What is so much of the outer ground's colour shows that ground.
const BARE: f32 = 0.8;
/// Beside more spots that are no marks there are no lamps.
const MOST_UNREAD: usize = 3;
/// As many lamps of one size are a pattern.
const MAX_LAMPS: usize = 4;
/// A lone bar is no longer than this share of the ground it stands on.
const BAR_OF_GROUND: f64 = 0.5;
/// The share of saturated pixels that is glare, and the lightness from which a pixel is that.
const GLARE_SHARE: f64 = 0.25;
const SATURATED: f32 = 99.0;

/// Reads what stands on a thing, given its pixels. Positions are in the world.
pub(crate) fn read(scene: &Scene, white: f64, support: &PixelSupport) -> Vec<Reading> {
    let mut readings: Vec<Reading> = Vec::new();
    for face in face::find(scene, support) {
        let reader = Reader { scene, face: &face, white };
        let mut found = Vec::new();
        reader.ground(&face.mask, None, 0, &mut found);
        // A face that noise splits in two is read twice.
        for reading in found {
            match readings.iter().position(|known| overlap(known, &reading) > SAME_PLACE) {
                Some(at) if worth(&reading) > worth(&readings[at]) => readings[at] = reading,
                Some(_) => {}
                None => readings.push(reading),
            }
        }
    }
    if readings.len() > MAX_READINGS {
        readings.clear();
    }
    readings
}

/// The common share of the places of two readings, of the smaller one's.
fn overlap(a: &Reading, b: &Reading) -> f64 {
    let side =
        |k: usize| f64::from((a.bounds[k + 2].min(b.bounds[k + 2]) + 1).saturating_sub(a.bounds[k].max(b.bounds[k])));
    side(0) * side(1) / area(a).min(area(b)).max(1.0)
}

fn area(reading: &Reading) -> f64 {
    let [left, top, right, bottom] = reading.bounds.map(f64::from);
    (right + 1.0 - left) * (bottom + 1.0 - top)
}

/// Of two readings of one place the one that says something is kept, then the one of more.
fn worth(reading: &Reading) -> f64 {
    match reading.content {
        Content::Unreadable { .. } => 0.0,
        _ => reading.confidence * area(reading),
    }
}

/// A label that was taken for a thing of its own is read with the thing that it is on, too. What two things show in one
/// place is the one's that says more of it, the smaller one's if both say the same. `objects` are ordered by size.
pub(crate) fn part(objects: &mut [GroundedObject]) {
    for small in 1..objects.len() {
        let (larger, rest) = objects.split_at_mut(small);
        let Some(label) = rest.first_mut() else { return };
        for large in larger {
            let rival = |own: &Reading, others: &[Reading], least: f64| {
                others.iter().any(|other| overlap(own, other) > SAME_PLACE && worth(other) > worth(own) + least)
            };
            label.readings.retain(|own| !rival(own, &large.readings, 1.0));
            large.readings.retain(|own| !rival(own, &label.readings, -1.0));
        }
    }
}

/// The lightness of the brightest matt surfaces of a frame: what 19 of 20 pixels do not exceed.
pub(crate) fn white(scene: &Scene) -> f64 {
    let mut sample: Vec<f32> = scene.scan.lab.iter().step_by(61).map(|lab| lab[0]).collect();
    let at = sample.len() * 19 / 20;
    let at = at.min(sample.len().saturating_sub(1));
    if sample.is_empty() {
        return 100.0;
    }
    let (_, white, _) = sample.select_nth_unstable_by(at, f32::total_cmp);
    f64::from(*white)
}

struct Reader<'a> {
    scene: &'a Scene<'a>,
    face: &'a Face,
    white: f64,
}

impl Reader<'_> {
    /// Reads what stands on a ground, and on the grounds in it. `outer` is the colour round it, which shows in holes.
    fn ground(&self, mask: &[bool], outer: Option<[f32; 3]>, depth: usize, out: &mut Vec<Reading>) {
        let Some(drawing) = ink::spots(self.scene.scan, self.face, mask) else { return };
        let mut taken = vec![false; drawing.spots.len()];
        let mut lamps = Vec::new();
        for (spot, taken) in drawing.spots.iter().zip(&mut taken) {
            if let Some(reading) = self.round(spot) {
                *taken = true;
                let hole = outer.is_some_and(|outer| ink::distance(outer, spot.color) < STRANGE);
                match reading.content {
                    Content::Lamp { .. } if hole => {}
                    Content::Lamp { .. } => lamps.push(reading),
                    _ => out.push(reading),
                }
            } else if depth < MAX_DEPTH && self.is_panel(spot, &drawing) {
                let grid = self.face.window.grid;
                let mut panel = vec![false; grid.len()];
                let solid = spot.solid(grid);
                solid.iter().for_each(|&at| panel[at] = true);
                let mut within = Vec::new();
                self.ground(&panel, Some(drawing.ground), depth + 1, &mut within);
                // A block letter with eyes is filled like a panel, too, but what shows within says nothing.
                *taken = !within.is_empty() || !self.is_open(spot, &solid, drawing.ground);
                out.extend(within);
            }
        }
        let ways = self.ways(mask, depth);
        let mut left = drawing.spots.iter().zip(&taken).filter(|(spot, taken)| !**taken && !spot.cut).count();
        for line in text::lines(self.scene.scan, self.face, &drawing, &taken, ways) {
            left = left.saturating_sub(line.spots.len());
            out.push(self.line(&line, &drawing.spots));
        }
        // Among many spots that say nothing, round ones are a pattern too.
        if lamps.len() <= MAX_LAMPS && left <= MOST_UNREAD {
            // What shows within a mark is no lamp.
            lamps.retain(|lamp| out.iter().all(|known| overlap(known, lamp) < SAME_PLACE));
            out.extend(lamps);
        }
    }

    /// Whether a spot is a ground of its own, such as a display or a label, rather than a mark: it is filled like a
    /// rectangle or an ellipse, and what is in it is not of the outer ground's colour, or it is a rectangle with more
    /// ground than a mark has ink.
    fn is_panel(&self, spot: &Spot, drawing: &ink::Drawing) -> bool {
        if spot.pixels.len() < LEAST_GROUND_PX {
            return false;
        }
        let grid = self.face.window.grid;
        let inside = spot.solid(grid);
        let scan = self.scene.scan;
        let lab = |at: usize| scan.lab[self.face.window.pixel(at, scan.grid)];
        let Some((own, _)) = ink::ground(&inside, lab) else { return false };
        let other = ink::distance(own, drawing.ground);
        if other < 12.0 || spot.pixels.len() * 2 < inside.len() {
            return false;
        }
        let Some(shape::Frame { fill, .. }) = shape::frame(self.face, &inside) else { return false };
        // Ink in it that a hole of a mark does not show.
        let strange = inside
            .iter()
            .filter(|&&at| ink::distance(lab(at), own) > STRANGE && !ink::is_between(lab(at), own, drawing.ground))
            .count();
        let holes = inside.len() - spot.pixels.len();
        // Ink whose colour lies between the panel's and the outer ground's: within a mark there is bare ground.
        let other_ink = holes * 25 > inside.len() && self.bare(spot, &inside, drawing.ground) * 5 < holes;
        fill > 0.72 && (other_ink || strange * 25 > inside.len())
            || fill > PANEL_FILL && (holes * 50 > inside.len() || strange * 50 > inside.len())
    }

    /// How many pixels within a spot show the ground that it stands on.
    fn bare(&self, spot: &Spot, inside: &[usize], ground: [f32; 3]) -> usize {
        let scan = self.scene.scan;
        let lab = |at: usize| scan.lab[self.face.window.pixel(at, scan.grid)];
        inside.iter().filter(|&&at| ink::share(lab(at), spot.color, ground) > BARE).count()
    }

    /// Whether what shows within a spot is mostly the ground that it stands on.
    fn is_open(&self, spot: &Spot, inside: &[usize], ground: [f32; 3]) -> bool {
        let holes = inside.len() - spot.pixels.len();
        holes > 0 && self.bare(spot, inside, ground) * 2 > holes
    }

    /// The lamp or needle that a round spot is.
    fn round(&self, spot: &Spot) -> Option<Reading> {
        let grid = self.face.window.grid;
        if spot.cut {
            return None;
        }
        // What is not round with its holes filled is not looked at further.
        let outer = Shape::of(self.face, &spot.pixels, DVec2::Y)?;
        if (outer.size().x / outer.size().y).ln().abs() > 0.35 {
            return None;
        }
        let solid = spot.solid(grid);
        let shape = Shape::of(self.face, &solid, DVec2::Y)?;
        let scan = self.scene.scan;
        let (content, confidence) = round::needle(scan, self.face, &shape)
            .or_else(|| round::lamp(scan, self.face, &solid, &shape, self.white))?;
        Some(self.reading(content, confidence, &solid, shape.size().y * shape.px_per_m))
    }

    fn line(&self, line: &Line, spots: &[Spot]) -> Reading {
        let pixels: Vec<usize> = line.spots.iter().flat_map(|&spot| spots[spot].pixels.iter().copied()).collect();
        let up = self.face.right * line.up.x + self.face.up * line.up.y;
        let upright = Upright { up: self.scene.world.transform_vector(up), assumed: self.face.level };
        let content = match &line.text {
            Ok(text) => Content::Text { text: text.clone(), upright, turned: line.turned.clone() },
            Err(reason) => {
                Content::Unreadable { reason: if self.glares(&pixels) { Unreadable::Glare } else { *reason } }
            }
        };
        self.reading(content, line.confidence, &pixels, line.height_px)
    }

    fn reading(&self, content: Content, confidence: f64, pixels: &[usize], height_px: f64) -> Reading {
        let middle = pixels.iter().map(|&at| self.face.place_of(at)).sum::<DVec2>() / pixels.len().max(1) as f64;
        let content = match content {
            Content::Needle { angle_deg, upright } => {
                let upright = Upright { up: self.scene.world.transform_vector(upright.up), ..upright };
                Content::Needle { angle_deg, upright }
            }
            other => other,
        };
        let position = self.scene.world.transform_point(self.face.point(middle));
        Reading { content, confidence, bounds: self.bounds(pixels), height_px, position }
    }

    /// Bounds of pixels of the window, in the image.
    fn bounds(&self, pixels: &[usize]) -> [u32; 4] {
        let window = &self.face.window;
        let start = [u32::MAX, u32::MAX, 0, 0];
        pixels.iter().fold(start, |[left, top, right, bottom], &at| {
            let column = (window.left + window.grid.column(at)) as u32;
            let row = (window.top + window.grid.row(at)) as u32;
            [left.min(column), top.min(row), right.max(column), bottom.max(row)]
        })
    }

    /// Whether much round some pixels is saturated.
    fn glares(&self, pixels: &[usize]) -> bool {
        let [left, top, right, bottom] = self.bounds(pixels).map(|value| value as usize);
        let scan = self.scene.scan;
        let (mut count, mut all) = (0usize, 0usize);
        for row in top..=bottom {
            for column in left..=right {
                all += 1;
                count += usize::from(scan.lab[scan.grid.index(column, row)][0] > SATURATED);
            }
        }
        count as f64 > GLARE_SHARE * all as f64 && self.white < f64::from(SATURATED)
    }

    /// Which ways up text may stand: upright on a face that has an up, along the ground's edges on one that looks up.
    fn ways(&self, mask: &[bool], depth: usize) -> Ways {
        let grid = self.face.window.grid;
        let rim = (0..grid.len()).filter(|&at| mask[at] && grid.neighbours(at).any(|other| !mask[other]));
        let hull = convex_hull(rim.map(|at| self.face.place_of(at)).collect());
        let (size, up) = shape::smallest_box(&hull).unwrap_or((DVec2::ZERO, DVec2::Y));
        Ways {
            up: if self.face.level { up } else { DVec2::Y },
            open: self.face.level,
            longest_bar_m: BAR_OF_GROUND * size.max_element(),
            panel: depth > 0,
        }
    }
}
