//! What is drawn on a ground: the ground's colour, and spots of other colours on it.

use super::face::{Face, filled};
use crate::{grid::Grid, scan::Scan};

/// Colours this far apart are told apart at all, CIELAB.
const LEAST_CONTRAST: f32 = 14.0;
/// Nearer than this to the ground, and than four of its standard deviations, is ground.
const GROUND: f32 = 8.0;
/// The ground is no smaller a part of all than one in so many.
const GROUND_PARTS: usize = 5;
/// Width of a bin of the histogram in which the ground is the fullest.
const BIN: f32 = 8.0;
/// A mixture of two colours lies so near to the line between them, CIELAB: the camera mixes light, not lightness.
const MIXED: f32 = 10.0;
/// Spots of fewer pixels are noise.
const LEAST_PX: usize = 5;
/// A texture has more spots than a display or a label.
const MAX_SPOTS: usize = 60;

/// A connected spot of one colour on a ground.
#[derive(Debug, Clone)]
pub(super) struct Spot {
    /// Its pixels, ascending, in the window.
    pub pixels: Vec<usize>,
    /// Its own colour, where it is not mixed with the ground's.
    pub color: [f32; 3],
    /// Whether it reaches the border of its ground: it may go on beyond.
    pub cut: bool,
}

impl Spot {
    /// Its pixels and those that it surrounds, ascending.
    pub fn solid(&self, grid: Grid) -> Vec<usize> {
        let [left, top, right, bottom] = extent(grid, self);
        let own = Grid { width: right + 1 - left, height: bottom + 1 - top };
        let mut mask = vec![false; own.len()];
        for &pixel in &self.pixels {
            mask[own.index(grid.column(pixel) - left, grid.row(pixel) - top)] = true;
        }
        let solid = filled(own, &mask, |_| true);
        let set = (0..own.len()).filter(|&at| solid[at]);
        set.map(|at| grid.index(left + own.column(at), top + own.row(at))).collect()
    }
}

/// A ground and the spots on it.
#[derive(Debug)]
pub(super) struct Drawing {
    pub ground: [f32; 3],
    pub spots: Vec<Spot>,
    /// The spot of every pixel of the window, `u32::MAX` for none.
    pub owner: Vec<u32>,
}

/// Tells spots from their ground. `mask` is the ground with all that lies on it, over the face's window. `None` for a
/// ground without spots, one that is not of one colour, and a texture.
pub(super) fn spots(scan: &Scan, face: &Face, mask: &[bool]) -> Option<Drawing> {
    let grid = face.window.grid;
    let lab = |at: usize| scan.lab[face.window.pixel(at, scan.grid)];
    let inside: Vec<usize> = (0..grid.len()).filter(|&at| mask[at]).collect();
    let (ground, sigma) = ground(&inside, lab)?;
    let limit = GROUND.max(4.0 * sigma);
    if !inside.iter().any(|&at| distance(lab(at), ground) > limit) {
        return None;
    }
    // A border pixel mixes the colours of two faces.
    let inner = grid.erode(mask, 1);
    let differs: Vec<bool> = (0..grid.len()).map(|at| inner[at] && distance(lab(at), ground) > limit).collect();
    let mut owner = vec![u32::MAX; grid.len()];
    let mut spots = Vec::new();
    let mut core = vec![false; grid.len()];
    for rough in lists(grid, &differs) {
        if rough.len() < LEAST_PX {
            continue;
        }
        let color = strongest(&rough, lab, ground);
        if distance(color, ground) < LEAST_CONTRAST.max(2.0 * limit) {
            continue;
        }
        // A pixel belongs to the spot that is more of its colour than of the ground's.
        for &at in &rough {
            core[at] = share(lab(at), ground, color) > 0.5;
        }
        for pixels in take(grid, &mut core, &rough) {
            let cut = pixels.iter().any(|&at| border(grid, &inner, at));
            for &at in &pixels {
                owner[at] = spots.len() as u32;
            }
            spots.push(Spot { color: strongest(&pixels, lab, ground), pixels, cut });
        }
    }
    if spots.is_empty() || spots.len() > MAX_SPOTS {
        return None;
    }
    // The dark segments of a display.
    let extents: Vec<[usize; 4]> = spots.iter().map(|spot| extent(grid, spot)).collect();
    let ghost = |at: usize| {
        let others = spots.iter().zip(&extents);
        others.into_iter().any(|(other, around)| is_ghost((&spots[at], extents[at]), (other, *around), ground))
    };
    let ghosts: Vec<bool> = (0..spots.len()).map(ghost).collect();
    if ghosts.contains(&true) {
        let mut names = Vec::new();
        let mut kept = Vec::new();
        for (spot, ghost) in spots.into_iter().zip(ghosts) {
            names.push(if ghost { u32::MAX } else { kept.len() as u32 });
            if !ghost {
                kept.push(spot);
            }
        }
        for name in &mut owner {
            *name = names.get(*name as usize).copied().unwrap_or(u32::MAX);
        }
        spots = kept;
    }
    Some(Drawing { ground, spots, owner })
}

/// Whether a spot is a faint copy of what is beside it: its colour lies less than half way to the other's, and it is
/// smaller or as near as the segments of one digit are.
fn is_ghost((spot, a): (&Spot, [usize; 4]), (other, b): (&Spot, [usize; 4]), ground: [f32; 3]) -> bool {
    let way = share(spot.color, ground, other.color);
    if way > 0.5 || !is_between(spot.color, ground, other.color) {
        return false;
    }
    let size = |[left, top, right, bottom]: [usize; 4]| (right - left).max(bottom - top) + 1;
    let gap = |k: usize| a[k].saturating_sub(b[k + 2]).max(b[k].saturating_sub(a[k + 2]));
    gap(0).max(gap(1)) <= size(a).max(size(b))
}

fn extent(grid: Grid, spot: &Spot) -> [usize; 4] {
    spot.pixels.iter().fold([usize::MAX, usize::MAX, 0, 0], |[left, top, right, bottom], &at| {
        let (column, row) = (grid.column(at), grid.row(at));
        [left.min(column), top.min(row), right.max(column), bottom.max(row)]
    })
}

/// How much of a colour lies on the way from the ground's to the ink's, 0-1.
pub(super) fn share(color: [f32; 3], ground: [f32; 3], ink: [f32; 3]) -> f32 {
    let (mut dot, mut length) = (0.0, 0.0);
    for k in 0..3 {
        let way = ink[k] - ground[k];
        dot += way * (color[k] - ground[k]);
        length += way * way;
    }
    (dot / length.max(1e-6)).clamp(0.0, 1.0)
}

/// Whether a colour is a mixture of two others, within what noise does.
pub(super) fn is_between(color: [f32; 3], one: [f32; 3], other: [f32; 3]) -> bool {
    let share = share(color, one, other);
    let mixed: [f32; 3] = std::array::from_fn(|k| one[k] + share * (other[k] - one[k]));
    distance(color, mixed) < MIXED
}

pub(super) fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f32>().sqrt()
}

fn border(grid: Grid, mask: &[bool], at: usize) -> bool {
    let mut count = 0;
    grid.neighbours(at).any(|other| {
        count += 1;
        !mask[other]
    }) || count < 4
}

/// The colour of the fullest bin, and the standard deviation of what is near it; `None` if that is too small a
/// part of all.
pub(super) fn ground(inside: &[usize], lab: impl Fn(usize) -> [f32; 3]) -> Option<([f32; 3], f32)> {
    const SIDE: [usize; 3] = [14, 34, 34];
    let bin = |[l, a, b]: [f32; 3]| {
        let step = |value: f32, count: usize| ((value / BIN).max(0.0) as usize).min(count - 1);
        (step(l, SIDE[0]) * SIDE[1] + step(a + 128.0, SIDE[1])) * SIDE[2] + step(b + 128.0, SIDE[2])
    };
    let mut counts = vec![0u32; SIDE.iter().product()];
    for &at in inside {
        counts[bin(lab(at))] += 1;
    }
    let fullest = counts.iter().enumerate().max_by_key(|(_, count)| **count)?.0;
    let mut middle = mean(inside.iter().copied().filter(|&at| bin(lab(at)) == fullest), &lab)?;
    for _ in 0..2 {
        middle = mean(inside.iter().copied().filter(|&at| distance(lab(at), middle) < 1.2 * BIN), &lab)?;
    }
    let near = inside.iter().map(|&at| distance(lab(at), middle)).filter(|d| *d < 1.2 * BIN);
    let (mut count, mut sum) = (0usize, 0f32);
    for d in near {
        count += 1;
        sum += d * d;
    }
    (count * GROUND_PARTS > inside.len()).then(|| (middle, (sum / (3 * count) as f32).sqrt()))
}

pub(super) fn mean(pixels: impl Iterator<Item = usize>, lab: impl Fn(usize) -> [f32; 3]) -> Option<[f32; 3]> {
    let (mut sum, mut count) = ([0f32; 3], 0);
    for at in pixels {
        for (total, value) in sum.iter_mut().zip(lab(at)) {
            *total += value;
        }
        count += 1;
    }
    (count > 0).then(|| sum.map(|total| total / count as f32))
}

/// The mean colour of the third of the pixels that are farthest from the ground.
fn strongest(pixels: &[usize], lab: impl Fn(usize) -> [f32; 3], ground: [f32; 3]) -> [f32; 3] {
    let mut ranked: Vec<(f32, usize)> = pixels.iter().map(|&at| (distance(lab(at), ground), at)).collect();
    let keep = pixels.len().div_ceil(3);
    if keep < ranked.len() {
        ranked.select_nth_unstable_by(keep, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        ranked.truncate(keep);
        // In one order, so that sums do not depend on how they were chosen.
        ranked.sort_unstable_by_key(|(_, at)| *at);
    }
    mean(ranked.into_iter().map(|(_, at)| at), lab).unwrap_or(ground)
}

/// The pixels of each connected piece of a mask.
fn lists(grid: Grid, mask: &[bool]) -> Vec<Vec<usize>> {
    let (labels, sizes) = grid.blobs(mask);
    let mut lists: Vec<Vec<usize>> = sizes.iter().map(|&size| Vec::with_capacity(size)).collect();
    for (at, &label) in labels.iter().enumerate() {
        if let Some(list) = lists.get_mut(label as usize) {
            list.push(at);
        }
    }
    lists
}

/// Takes the connected pieces out of a mask whose pixels are all among `of`; of fewer than three pixels none is told.
fn take(grid: Grid, mask: &mut [bool], of: &[usize]) -> Vec<Vec<usize>> {
    let mut lists = Vec::new();
    for &start in of {
        if !mask[start] {
            continue;
        }
        mask[start] = false;
        let (mut list, mut next) = (Vec::new(), vec![start]);
        while let Some(at) = next.pop() {
            list.push(at);
            for other in grid.neighbours(at) {
                if mask[other] {
                    mask[other] = false;
                    next.push(other);
                }
            }
        }
        if list.len() >= 3 {
            list.sort_unstable();
            lists.push(list);
        }
    }
    lists
}
