//! Which spots make a mark: strokes that touch or nearly so, and, where they then read better, strokes with wider gaps
//! between them, as a display's segments have and as thin lines get in few pixels.

use super::{
    face::Face,
    glyph::FARTHEST,
    ink::{self, Drawing},
    shape::Shape,
    text::{self, Mark},
};
use glam::DVec2;

/// Strokes of one mark, such as the segments of a digit, are no farther apart than this share of their width and this
/// many pixels.
const GAP_OF_STROKE: f64 = 0.5;
const GAP_PX: f64 = 0.7;
/// Strokes that may be of one mark are no farther apart than this share of the height that they have together.
const GAP_OF_HEIGHT: f64 = 0.3;
/// A mark is no wider than this share of its height, if it is put together.
const WIDEST: f64 = 1.3;
/// What is as high as this share of its line is a mark of its own.
const FULL_HEIGHT: f64 = 0.85;
/// More pieces are not tried together: a digit has seven segments; and more in all are a texture.
const MOST_PIECES: usize = 7;
const MOST_JOINED: usize = 20;
/// What every mark costs, in distances, and what a bar costs beside: it says little.
const EACH: f32 = 0.06;
const BAR: f32 = 0.06;
/// Times that what marks look like counts, and how far a mark that is put together may be from what it is read as.
const FIT: f32 = 2.0;
const JOINED: f32 = 0.28;
/// A piece that is no mark costs this.
const NO_MARK: f32 = FARTHEST + 0.1;
/// The face's own up is so much likelier than another.
const UPRIGHT: f32 = 0.03;

/// Joins the strokes of one mark.
pub(super) fn groups(face: &Face, drawing: &Drawing, shapes: &[Option<Shape>]) -> Vec<Vec<usize>> {
    let count = shapes.len();
    let mut group: Vec<usize> = (0..count).collect();
    for a in 0..count {
        for b in 0..a {
            let (Some(first), Some(second)) = (&shapes[a], &shapes[b]) else { continue };
            let (one, two) = (&drawing.spots[a], &drawing.spots[b]);
            let reach = GAP_OF_STROKE * first.stroke_m.min(second.stroke_m) + GAP_PX / first.px_per_m;
            if group[a] != group[b]
                && first.apart(second) < reach
                && ink::distance(one.color, two.color) < 30.0
                && gap(face, &one.pixels, &two.pixels) < reach + 1.0 / first.px_per_m
            {
                let (from, to) = (group[a], group[b]);
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    let members = |root: usize| (0..count).filter(|&at| group[at] == root && shapes[at].is_some()).collect();
    (0..count).filter(|&at| group[at] == at).map(members).filter(|spots: &Vec<usize>| !spots.is_empty()).collect()
}

/// The least distance between pixels of two spots, metres.
fn gap(face: &Face, a: &[usize], b: &[usize]) -> f64 {
    let grid = face.window.grid;
    let near = |&pixel: &usize| grid.neighbours(pixel).count() == 4;
    let places = |pixels: &[usize]| -> Vec<DVec2> {
        pixels.iter().filter(|p| near(p)).take(400).map(|&p| face.place_of(p)).collect()
    };
    let (one, two) = (places(a), places(b));
    let pairs = one.iter().flat_map(|p| two.iter().map(move |q| p.distance_squared(*q)));
    pairs.fold(f64::INFINITY, f64::min).sqrt()
}

/// Marks put together from pieces that read better together, the way up in which all read best. `draw` makes a mark of
/// spots.
pub(super) fn rejoin(pieces: Vec<Mark>, quarters: &[u8], draw: impl Fn(Vec<usize>) -> Option<Mark>) -> Vec<Mark> {
    let whole = pieces.iter().filter(|piece| !piece.cut).count();
    if !(2..=MOST_JOINED).contains(&whole) {
        return pieces;
    }
    let mut best: Option<(f32, Vec<Vec<usize>>)> = None;
    for &quarter in quarters {
        let (mut cost, groups) = parted(&pieces, quarter, &draw);
        cost += if quarter == 0 { 0.0 } else { UPRIGHT };
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, groups));
        }
    }
    let Some((_, groups)) = best else { return pieces };
    let joined = groups.iter().filter(|group| group.len() > 1);
    let drawn: Vec<Mark> = joined.clone().filter_map(|group| draw(spots(&pieces, group))).collect();
    let taken: Vec<usize> = joined.flatten().copied().collect();
    let left = pieces.into_iter().enumerate().filter(|(at, _)| !taken.contains(at));
    left.map(|(_, piece)| piece).chain(drawn).collect()
}

fn spots(pieces: &[Mark], group: &[usize]) -> Vec<usize> {
    group.iter().flat_map(|&at| pieces[at].spots.iter().copied()).collect()
}

/// The cheapest way to part pieces, from left to right one way up, into marks, and its cost.
fn parted(pieces: &[Mark], quarter: u8, draw: &impl Fn(Vec<usize>) -> Option<Mark>) -> (f32, Vec<Vec<usize>>) {
    let mut total = 0.0;
    let mut groups = Vec::new();
    for mut cluster in clusters(pieces, quarter) {
        let middle = |at: &usize| {
            let (low, high) = pieces[*at].corners(quarter);
            0.5 * (low.x + high.x)
        };
        cluster.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        let line = extent(pieces, &cluster, quarter);
        let line_m = line.1.y - line.0.y;
        let size = |&at: &usize| {
            let (low, high) = pieces[at].corners(quarter);
            (high - low).element_product()
        };
        let area: f64 = cluster.iter().map(size).sum();
        // The least cost up to each piece, and where its last mark begins.
        let mut least: Vec<(f32, usize)> = vec![(0.0, 0)];
        for end in 1..=cluster.len() {
            let mut best = (f32::INFINITY, end - 1);
            for start in end.saturating_sub(MOST_PIECES)..end {
                let group = &cluster[start..end];
                let price = if group.len() == 1 {
                    price(Some(&pieces[group[0]]), false, quarter, line, area)
                } else if is_compact(pieces, group, quarter, line_m) {
                    price(draw(spots(pieces, group)).as_ref(), true, quarter, line, area)
                } else {
                    f32::INFINITY
                };
                let cost = least[start].0 + price;
                if cost < best.0 {
                    best = (cost, start);
                }
            }
            least.push(best);
        }
        total += least[cluster.len()].0;
        let mut end = cluster.len();
        while end > 0 {
            let start = least[end].1;
            groups.push(cluster[start..end].to_vec());
            end = start;
        }
    }
    (total, groups)
}

/// What a mark costs among marks that cover an area in all: the less it looks like what it is read as, and the larger its
/// part is, the more. A bar that lies, but not half way up its line, is no mark.
fn price(mark: Option<&Mark>, joined: bool, quarter: u8, line: (DVec2, DVec2), area: f64) -> f32 {
    let Some(mark) = mark else { return f32::INFINITY };
    let (low, high) = mark.corners(quarter);
    let size = high - low;
    let share = FIT * (size.x * size.y / area.max(1e-9)) as f32;
    let height = (0.5 * (low.y + high.y) - line.0.y) / (line.1.y - line.0.y).max(1e-9);
    EACH + match text::read(mark, quarter) {
        Some(read) if read.bar && (size.y > size.x || (0.3..0.7).contains(&height)) => BAR,
        Some(read) => {
            let distance = read.matches.first().filter(|_| !read.bar).map_or(NO_MARK, |first| first.distance);
            if joined && distance > JOINED { f32::INFINITY } else { share * distance.min(NO_MARK) }
        }
        None => share * NO_MARK,
    }
}

/// Whether pieces could be one mark: together not too wide, none far from the rest, and no two side by side that are each
/// as high as the line.
fn is_compact(pieces: &[Mark], group: &[usize], quarter: u8, line_m: f64) -> bool {
    let (low, high) = extent(pieces, group, quarter);
    let size = high - low;
    let near = |&at: &usize| group.iter().any(|&b| at != b && gap_of(pieces, at, b) < GAP_OF_HEIGHT * size.y);
    let corners = group.iter().map(|&at| pieces[at].corners(quarter));
    let full: Vec<_> = corners.filter(|(low, high)| high.y - low.y > FULL_HEIGHT * line_m).collect();
    let beside = full.iter().any(|a| full.iter().any(|b| a.1.x < b.0.x));
    size.x < WIDEST * size.y && !beside && group.iter().all(near)
}

fn extent(pieces: &[Mark], group: &[usize], quarter: u8) -> (DVec2, DVec2) {
    group
        .iter()
        .map(|&at| pieces[at].corners(quarter))
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), (a, b)| (low.min(a), high.max(b)))
}

/// How far the boxes of two pieces are apart, metres.
fn gap_of(pieces: &[Mark], a: usize, b: usize) -> f64 {
    let ((a_low, a_high), (b_low, b_high)) = (pieces[a].corners(0), pieces[b].corners(0));
    (a_low - b_high).max(b_low - a_high).max(DVec2::ZERO).length()
}

/// Whole pieces that are near each other, measured by the larger of them.
fn clusters(pieces: &[Mark], quarter: u8) -> Vec<Vec<usize>> {
    let whole: Vec<usize> = (0..pieces.len()).filter(|&at| !pieces[at].cut).collect();
    let size = |at: usize| {
        let (low, high) = pieces[at].corners(quarter);
        (high - low).max_element()
    };
    let mut clusters: Vec<Vec<usize>> = Vec::new();
    for at in whole {
        let near = |&other: &usize| gap_of(pieces, at, other) < 0.5 * size(at).max(size(other));
        let (touching, apart): (Vec<_>, Vec<_>) = clusters.into_iter().partition(|cluster| cluster.iter().any(near));
        let mut joined: Vec<usize> = touching.into_iter().flatten().collect();
        joined.push(at);
        clusters = apart;
        clusters.push(joined);
    }
    clusters
}
