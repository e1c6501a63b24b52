//! Lines of marks: which spots make a mark, which marks a line, which way up it stands, and how sure that is.

use super::{
    face::Face,
    glyph::{self, Match, Patch},
    ink::{self, Drawing},
    marks,
    shape::{self, Shape},
};
use crate::scan::Scan;
use acm_concept::reading::Unreadable;
use glam::DVec2;

/// Marks of fewer pixels in height are too small to be read, and of fewer still not even seen as marks.
const LEAST_HEIGHT_PX: f64 = 9.0;
const LEAST_MARK_PX: f64 = 5.0;
/// Larger than this, a mark is a thing's own shape.
const MOST_MARK_PX: f64 = 200.0;
/// What is cut off and thinner is the border of a face, where the next one shows.
const SLIVER_PX: f64 = 4.5;
/// More marks are a texture or a paragraph.
const MAX_MARKS: usize = 24;
const MAX_IN_LINE: usize = 8;
/// Samples of a patch along its longer side.
const MOST_SAMPLES: f64 = 72.0;
/// A bar fills its box, and is so many times longer than wide.
const BAR_FILL: f64 = 0.72;
/// One that stands alone is a mark from this length over its width on.
const LONE_BAR: f64 = 2.8;
/// One of two segments with a gap is longer and fills less.
const LONG_BAR: f64 = 3.2;
const BROKEN_FILL: f64 = 0.5;
/// Cosine of the angle at which one may lean.
const BAR_UPRIGHT: f64 = 0.95;
const BAR_LENGTH: f64 = 2.2;
/// What fills its box further is a plain shape.
const SOLID_FILL: f64 = 0.86;
/// The up nearest to the face's own is taken for what reads as well every way up.
const UPRIGHT: f32 = 0.03;
/// Marks in a row speak for the direction of their row, as much as this difference of distances.
const ROW: f32 = 0.12;

/// A line that was read or should have been.
#[derive(Debug, Clone)]
pub(super) struct Line {
    pub text: Result<String, Unreadable>,
    /// What it says upside down, if that reads as well.
    pub turned: Option<String>,
    pub confidence: f64,
    /// Quarter turns, clockwise, from the face's own up to the line's.
    pub up: DVec2,
    /// Its spots, in the drawing.
    pub spots: Vec<usize>,
    pub height_px: f64,
    /// Its marks, in the order in which they were found.
    marks: Vec<usize>,
}

/// Which ways up a line may stand on a ground: along which axes, and whether quarter turns are open.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ways {
    /// The up nearest to the face's own.
    pub up: DVec2,
    pub open: bool,
    /// Largest extent of a lone bar that may be a mark, metres.
    pub longest_bar_m: f64,
    /// Whether the ground is itself drawn on the face: a display or a label, made to be read.
    pub panel: bool,
}

/// Spots that make one mark.
pub(super) struct Mark {
    pub spots: Vec<usize>,
    patch: Patch,
    pub cut: bool,
    /// Corners in the ground's axes, metres.
    low: DVec2,
    high: DVec2,
    fill: f64,
    /// Whether it is a straight bar, along up or across.
    bar: bool,
    /// Pixels to a metre across and up.
    scale: DVec2,
}

/// A mark read one way up.
#[derive(Debug, Clone)]
pub(super) struct Read {
    pub matches: Vec<Match>,
    pub bar: bool,
}

/// The lines that the spots of a drawing make, without those that are taken for something else.
pub(super) fn lines(scan: &Scan, face: &Face, drawing: &Drawing, taken: &[bool], ways: Ways) -> Vec<Line> {
    let shapes: Vec<Option<Shape>> = drawing
        .spots
        .iter()
        .zip(taken)
        .map(|(spot, taken)| {
            (!taken).then(|| Shape::of(face, &spot.pixels, ways.up)).flatten().filter(|shape| !is_disc(shape))
        })
        .collect();
    let draw = |spots| mark(scan, face, drawing, &shapes, spots, ways);
    let mut marks: Vec<Mark> = marks::groups(face, drawing, &shapes)
        .into_iter()
        .filter_map(draw)
        .filter(|mark| !mark.cut || mark.size_px().min_element() > SLIVER_PX)
        .collect();
    // What is cut off and goes round another is the rim of a face that is mostly display.
    let middles: Vec<DVec2> = marks.iter().map(|mark| 0.5 * (mark.low + mark.high)).collect();
    let around = |mark: &Mark| {
        let own = 0.5 * (mark.low + mark.high);
        middles.iter().any(|m| *m != own && m.cmpgt(mark.low).all() && m.cmplt(mark.high).all())
    };
    marks.retain(|mark| !(mark.cut && around(mark)));
    if marks.is_empty() || marks.len() > MAX_MARKS {
        return Vec::new();
    }
    let quarters: &[u8] = if ways.open { &[0, 1, 2, 3] } else { &[0] };
    marks = marks::rejoin(marks, quarters, draw);
    let mut best: Option<(f32, u8, Vec<Line>)> = None;
    let mut all = Vec::new();
    for &quarter in quarters {
        let reads: Vec<Option<Read>> = marks.iter().map(|mark| read(mark, quarter)).collect();
        let (score, lines) = arrange(&marks, &reads, quarter, ways);
        if best.as_ref().is_none_or(|(most, ..)| score > *most) {
            best = Some((score, quarter, lines.clone()));
        }
        all.push((reads, lines));
    }
    let Some((_, quarter, mut lines)) = best else { return Vec::new() };
    for line in &mut lines {
        compare(line, quarter, &all);
    }
    lines
}

/// Whether a spot is a filled disc, which no mark is.
fn is_disc(shape: &Shape) -> bool {
    shape.size().min_element() * shape.px_per_m > 8.0 && shape.is_round(0.15)
}

/// Lowers the confidence of a line by how well it reads the other ways up; upside down is told as well. Arrows and
/// crosses read as well every way up, and mean the same with the up that is stated.
fn compare(line: &mut Line, quarter: u8, all: &[(Vec<Option<Read>>, Vec<Line>)]) {
    let Ok(text) = &line.text else { return };
    let turns = text.chars().all(|mark| "+X-\u{2190}\u{2191}\u{2192}\u{2193}".contains(mark));
    let mut others = 0.0;
    let far = |reads: &[Option<Read>]| -> f32 {
        let distance = |&at: &usize| reads[at].as_ref().map_or(glyph::FARTHEST, |read| read.matches[0].distance);
        line.marks.iter().map(distance).sum()
    };
    let own = all.get(usize::from(quarter)).map_or(0.0, |(reads, _)| far(reads));
    for (other, (reads, lines)) in all.iter().enumerate().filter(|(other, _)| *other != usize::from(quarter)) {
        let same = lines.iter().find(|rival| rival.spots.iter().all(|spot| line.spots.contains(spot)));
        let says =
            same.filter(|rival| rival.spots.len() == line.spots.len()).and_then(|rival| rival.text.as_ref().ok());
        if turns || says.is_some_and(|says| says == text) {
            continue;
        }
        let upside_down = (other + 2) % 4 == usize::from(quarter);
        let apart = if upside_down { 0.0 } else { ROW * (line.marks.len() - 1) as f32 };
        let odds = f64::from((own - far(reads) - apart) / TEMPERATURE).min(0.0).exp();
        if let Some(says) = says
            && odds > 0.2
            && upside_down
        {
            line.turned = Some(says.clone());
        }
        others += odds;
    }
    line.confidence /= 1.0 + others;
    let least = if line.marks.len() == 1 { LEAST_ALONE } else { LEAST_CONFIDENCE };
    if line.confidence < least && line.turned.is_none() {
        line.text = Err(Unreadable::Ambiguous);
    }
}

/// A mark read one way up is e times as likely as one that is farther by this.
const TEMPERATURE: f32 = 0.025;
/// What is less sure than this is not told as read.
const LEAST_CONFIDENCE: f64 = 0.7;
/// And a mark without company, as which some scratch may pass.
const LEAST_ALONE: f64 = 0.8;

fn mark(
    scan: &Scan,
    face: &Face,
    drawing: &Drawing,
    shapes: &[Option<Shape>],
    spots: Vec<usize>,
    ways: Ways,
) -> Option<Mark> {
    let parts: Vec<&Shape> = spots.iter().filter_map(|&spot| shapes[spot].as_ref()).collect();
    let low = parts.iter().fold(DVec2::INFINITY, |low, shape| low.min(shape.low));
    let high = parts.iter().fold(DVec2::NEG_INFINITY, |high, shape| high.max(shape.high));
    let (right, up) = (DVec2::new(ways.up.y, -ways.up.x), ways.up);
    let place = |at: DVec2| right * at.x + up * at.y;
    let middle = place(0.5 * (low + high));
    let scale = DVec2::new(face.pixels_per_metre(middle, right), face.pixels_per_metre(middle, up));
    let size_px = (high - low) * scale;
    let longer = size_px.max_element();
    if !(LEAST_MARK_PX..=MOST_MARK_PX).contains(&longer) {
        return None;
    }
    let margin = 1.6 / scale.min_element().max(1.0);
    let (low, high) = (low - margin, high + margin);
    let size = high - low;
    let step = (0.5 / scale.max_element()).max(size.max_element() / MOST_SAMPLES);
    let (columns, rows) = ((size.x / step).ceil() as usize, (size.y / step).ceil() as usize);
    // Within a mark the view is an affine one.
    let origin = face.project(place(DVec2::new(low.x, high.y)))?;
    let across = (face.project(place(high))? - origin) / size.x * step;
    let down = (face.project(place(low))? - origin) / size.y * step;
    let color = drawing.spots.get(*spots.first()?)?.color;
    let mine = |at: usize| {
        let owner = drawing.owner[at];
        if owner != u32::MAX && !spots.contains(&(owner as usize)) {
            return 0.0;
        }
        ink::share(scan.lab[face.window.pixel(at, scan.grid)], drawing.ground, color)
    };
    let grid = face.window.grid;
    let value = |x: f64, y: f64| {
        let inside = x >= 0.0 && y >= 0.0 && (x as usize) < grid.width && (y as usize) < grid.height;
        if inside { mine(grid.index(x as usize, y as usize)) } else { 0.0 }
    };
    let mut ink = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let at = origin + across * (column as f64 + 0.5) + down * (row as f64 + 0.5);
            let (x, y) = (at.x.floor(), at.y.floor());
            let (fx, fy) = ((at.x - x) as f32, (at.y - y) as f32);
            let line = |y: f64| value(x, y) * (1.0 - fx) + value(x + 1.0, y) * fx;
            ink.push(line(y) * (1.0 - fy) + line(y + 1.0) * fy);
        }
    }
    let patch = Patch { width: columns, height: rows, ink };
    let [left, top, right_end, bottom] = patch.extent()?.map(f64::from);
    let within = patch.ink.iter().filter(|value| **value > 0.5).count() as f64;
    let mut pixels: Vec<usize> = spots.iter().flat_map(|&spot| drawing.spots[spot].pixels.iter().copied()).collect();
    pixels.sort_unstable();
    let frame = shape::frame(face, &pixels)?;
    let length = frame.size.max_element() / frame.size.min_element().max(1e-6);
    Some(Mark {
        bar: length > BAR_LENGTH
            && (frame.fill > BAR_FILL || length > LONG_BAR && frame.fill > BROKEN_FILL)
            && frame.up.dot(ways.up).abs() > BAR_UPRIGHT,
        fill: within / ((right_end - left) * (bottom - top)).max(1.0),
        low: DVec2::new(low.x + left * step, high.y - bottom * step),
        high: DVec2::new(low.x + right_end * step, high.y - top * step),
        cut: spots.iter().any(|&spot| drawing.spots[spot].cut),
        spots,
        patch,
        scale,
    })
}

/// What a mark looks like with its up a number of quarter turns clockwise from the ground's.
pub(super) fn read(mark: &Mark, quarter: u8) -> Option<Read> {
    // Its up on the right means that it is to be turned back, counter-clockwise.
    let features = mark.patch.turned((4 - quarter) % 4).features()?;
    let size = mark.size(quarter);
    if mark.bar {
        let mark = if size.x > size.y { '-' } else { '1' };
        return Some(Read { matches: vec![Match { mark, distance: 0.0 }], bar: true });
    }
    (mark.fill < SOLID_FILL).then(|| Read { matches: glyph::matches(&features), bar: false })
}

impl Mark {
    /// Its corners with up a number of quarter turns clockwise from the ground's.
    pub fn corners(&self, quarter: u8) -> (DVec2, DVec2) {
        let turn = |p: DVec2| match quarter % 4 {
            0 => p,
            // Up is what was right, right is what was down.
            1 => DVec2::new(-p.y, p.x),
            2 => -p,
            _ => DVec2::new(p.y, -p.x),
        };
        let (a, b) = (turn(self.low), turn(self.high));
        (a.min(b), a.max(b))
    }
    fn size(&self, quarter: u8) -> DVec2 {
        let (low, high) = self.corners(quarter);
        high - low
    }
    fn height_px(&self, quarter: u8) -> f64 {
        self.size(quarter).y * if quarter.is_multiple_of(2) { self.scale.y } else { self.scale.x }
    }
    /// Whether a bar that stands alone may be a mark: thin, and short on its ground, unlike a slot or a blank label.
    fn is_lone_bar(&self, ways: Ways) -> bool {
        let size = self.high - self.low;
        size.max_element() < ways.longest_bar_m && size.max_element() > LONE_BAR * size.min_element()
    }
    fn size_px(&self) -> DVec2 {
        (self.high - self.low) * self.scale
    }
    fn longer_px(&self) -> f64 {
        self.size_px().max_element()
    }
}

/// Lays marks in lines one way up; the score says how well they read so.
fn arrange(marks: &[Mark], reads: &[Option<Read>], quarter: u8, ways: Ways) -> (f32, Vec<Line>) {
    let plausible = |at: usize| {
        // What is too small to be read may look like much else.
        let small = marks[at].longer_px() < LEAST_HEIGHT_PX;
        let most = if small { 2.0 * glyph::FARTHEST } else { glyph::FARTHEST };
        marks[at].cut || reads[at].as_ref().is_some_and(|read| read.matches[0].distance < most)
    };
    let mut order: Vec<usize> = (0..marks.len()).filter(|&at| plausible(at)).collect();
    order.sort_by(|&a, &b| marks[a].corners(quarter).0.x.total_cmp(&marks[b].corners(quarter).0.x));
    let mut rows: Vec<Vec<usize>> = Vec::new();
    for at in order {
        let joins = |row: &&mut Vec<usize>| row.last().is_some_and(|&last| follows(&marks[last], &marks[at], quarter));
        match rows.iter_mut().find(joins) {
            Some(row) => row.push(at),
            None => rows.push(vec![at]),
        }
    }
    let mut score = 0f32;
    let mut lines = Vec::new();
    for row in rows.iter().filter(|row| row.len() <= MAX_IN_LINE) {
        for &at in row {
            if let Some(read) = &reads[at] {
                score += glyph::FARTHEST - read.matches[0].distance.min(glyph::FARTHEST);
            }
        }
        score += ROW * (row.len() - 1) as f32;
        lines.extend(line(marks, reads, row, quarter, ways));
    }
    (score + if quarter == 0 { UPRIGHT } else { 0.0 }, lines)
}

/// Whether a mark stands behind another in one line.
fn follows(last: &Mark, next: &Mark, quarter: u8) -> bool {
    let ((a_low, a_high), (b_low, b_high)) = (last.corners(quarter), next.corners(quarter));
    let (a, b) = (a_high.y - a_low.y, b_high.y - b_low.y);
    let taller = a.max(b).max(0.6 * (a_high.x - a_low.x)).max(0.6 * (b_high.x - b_low.x));
    let common = a_high.y.min(b_high.y) - a_low.y.max(b_low.y);
    let gap = b_low.x - a_high.x;
    common > 0.7 * a.min(b) && gap < 0.9 * taller && gap > -0.3 * taller && a.max(b) < 6.0 * a.min(b)
}

fn line(marks: &[Mark], reads: &[Option<Read>], row: &[usize], quarter: u8, ways: Ways) -> Option<Line> {
    let alone = row.len() == 1;
    let whole = || row.iter().filter(|&&at| !marks[at].cut);
    let height_px = whole().map(|&at| marks[at].height_px(quarter)).fold(0.0, f64::max);
    let size_px = whole().map(|&at| marks[at].longer_px()).fold(0.0, f64::max);
    let turn = f64::from(quarter) * -std::f32::consts::FRAC_PI_2 as f64;
    let mut line = Line {
        text: Ok(String::new()),
        turned: None,
        confidence: 1.0,
        up: DVec2::from_angle(turn).rotate(ways.up),
        spots: row.iter().flat_map(|&at| marks[at].spots.iter().copied()).collect(),
        height_px,
        marks: row.iter().copied().filter(|&at| !marks[at].cut).collect(),
    };
    // What is cut off and not half as high is the border's.
    let cut = row.iter().filter(|&&at| marks[at].cut && 2.0 * marks[at].height_px(quarter) > height_px).count();
    if row.iter().all(|&at| marks[at].cut) {
        return None;
    }
    let bars = row.iter().filter(|&&at| reads[at].as_ref().is_some_and(|read| read.bar)).count();
    if bars == row.len() && !alone && !ways.panel {
        // Stripes.
        return None;
    }
    let mut text = String::new();
    for &at in row {
        if marks[at].cut {
            continue;
        }
        let read = reads[at].as_ref()?;
        let sure = if !read.bar {
            glyph::confidence(&read.matches, height_px.min(marks[at].longer_px().max(0.7 * height_px)))
        } else if !alone {
            BAR_IN_LINE
        } else if ways.open || !marks[at].is_lone_bar(ways) {
            return None;
        } else if ways.panel {
            BAR_ON_PANEL
        } else {
            BAR_ALONE
        };
        line.confidence *= sure;
        text.push(read.matches[0].mark);
    }
    line.text = if size_px < LEAST_HEIGHT_PX {
        // A speck is no writing: only what stands in a row, or on something made to be read.
        if alone && !ways.panel {
            return None;
        }
        Err(Unreadable::TooSmall)
    } else if cut > 0 {
        Err(Unreadable::Covered)
    } else if line.confidence < 0.3 {
        Err(Unreadable::Ambiguous)
    } else {
        Ok(text)
    };
    Some(line)
}

/// How often a bar is the digit 1 or a minus: beside other marks, alone on a display or label, alone on a thing.
const BAR_IN_LINE: f64 = 0.98;
const BAR_ON_PANEL: f64 = 0.9;
const BAR_ALONE: f64 = 0.8;
