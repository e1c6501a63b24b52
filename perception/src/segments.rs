//! Cuts what stands on the plane into segments: a graph over neighbouring pixels, broken where the depth jumps or
//! where the surface bends inwards, as it does where two solid things touch.

use crate::{grid::Grid, scene::Scene};
use glam::Vec3;
use std::collections::BTreeMap;

/// Label of pixels that belong to no segment.
pub(crate) const NONE: u32 = u32::MAX;

/// What stands on the plane, cut into things.
pub(crate) struct Segments {
    /// Segment of every pixel, [`NONE`] elsewhere.
    pub labels: Vec<u32>,
    /// Number of segments.
    pub count: usize,
    /// Pixels of the inside of hollow things: they belong to their segment but not to its outer surface.
    pub inner: Vec<bool>,
}

impl Segments {
    /// Pixels of every segment, ascending.
    pub fn pixels(&self) -> Vec<Vec<usize>> {
        let mut pixels = vec![Vec::new(); self.count];
        for (index, &label) in self.labels.iter().enumerate() {
            if let Some(list) = pixels.get_mut(label as usize) {
                list.push(index);
            }
        }
        pixels
    }
    /// Makes a segment of some pixels; those that had a label lose it. Returns its label.
    pub fn lay(&mut self, pixels: &[usize]) -> u32 {
        let label = self.count as u32;
        pixels.iter().for_each(|&pixel| self.labels[pixel] = label);
        self.count += 1;
        label
    }
    /// Drops connected pieces of fewer pixels than `least` of the segments of which `open` holds; all keep their labels.
    pub fn drop_scraps(&mut self, grid: Grid, least: usize, open: impl Fn(u32) -> bool) {
        let labels = &self.labels;
        let mask: Vec<bool> = labels.iter().map(|&label| label != NONE && open(label)).collect();
        let (pieces, sizes) = grid.components(&mask, |a, b| labels[a] == labels[b]);
        for (label, piece) in self.labels.iter_mut().zip(pieces) {
            if sizes.get(piece as usize).is_some_and(|size| *size < least) {
                *label = NONE;
            }
        }
    }
    /// Keeps the given segments and numbers them anew.
    pub fn keep(&mut self, kept: &[bool]) {
        let mut names = vec![NONE; self.count];
        let mut count = 0;
        for (label, _) in kept.iter().enumerate().filter(|(_, keep)| **keep) {
            names[label] = count;
            count += 1;
        }
        for label in &mut self.labels {
            *label = names.get(*label as usize).copied().unwrap_or(NONE);
        }
        self.count = count as usize;
    }
}

/// Half of the distance over which the bend of the surface is judged, pixels.
const BEND_STEP: usize = 4;

/// Cuts the open pixels, which stand on the plane, into things.
pub(crate) fn split(scene: &Scene, open: &[bool]) -> Segments {
    let normals = normals(scene, open);
    let core = scene.grid.map(|i| open[i] && !is_jump(scene, &normals, i));
    let bends = bends(scene, open, &normals);
    let step_m = |a: usize| 0.004 + 0.008 * scene.scan.smooth[a] + 2.0 * noise_m(scene, a);
    let joined =
        |a: usize, b: usize| (scene.scan.smooth[a] - scene.scan.smooth[b]).abs() < step_m(a) && !(bends[a] || bends[b]);
    let (mut labels, sizes) = scene.grid.components(&core, joined);
    let least = scene.min_segment_px() * 2 / 3;
    for label in &mut labels {
        if sizes.get(*label as usize).is_none_or(|size| *size < least) {
            *label = NONE;
        }
    }
    grow(scene, open, &mut labels, 12);
    let inner = vec![false; labels.len()];
    let mut segments = Segments { count: sizes.len(), labels, inner };
    adopt_remains(scene, open, &mut segments);
    merge_smooth(scene, &normals, &mut segments);
    drop_small(scene, &mut segments);
    segments
}

fn noise_m(scene: &Scene, pixel: usize) -> f32 {
    (scene.noise_ratio * scene.config.depth_sigma_m(f64::from(scene.scan.smooth[pixel]))) as f32
}

/// Half width of the differences that normals are taken from, pixels: wider the noisier the frame.
fn normal_reach(scene: &Scene) -> isize {
    (2.0 + 3.0 * scene.noise_ratio).round().clamp(3.0, 6.0) as isize
}

/// Unit normals towards the camera by differences over a few pixels, wider the noisier the frame; zero where unknown.
fn normals(scene: &Scene, open: &[bool]) -> Vec<Vec3> {
    let reach = normal_reach(scene);
    let eye = scene.camera.translation.as_vec3();
    let near = scene.grid.dilate(open, 2);
    scene.grid.map(|index| {
        if !near[index] || !scene.is_known(index) {
            return Vec3::ZERO;
        }
        let here = scene.point[index];
        let z = scene.scan.smooth[index];
        let gate = 0.01 + 0.02 * z + 2.0 * noise_m(scene, index);
        // The farthest neighbour in each direction that is still near in depth.
        let reach_to = |dx: isize, dy: isize| {
            (1..=reach).rev().find_map(|step| {
                let at = scene.grid.offset(index, dx * step, dy * step)?;
                (scene.is_known(at) && (scene.scan.smooth[at] - z).abs() < gate).then(|| scene.point[at])
            })
        };
        let across = reach_to(1, 0).unwrap_or(here) - reach_to(-1, 0).unwrap_or(here);
        let down = reach_to(0, 1).unwrap_or(here) - reach_to(0, -1).unwrap_or(here);
        let normal = across.cross(down).normalize_or_zero();
        if normal.dot(eye - here) < 0.0 { -normal } else { normal }
    })
}

/// Whether a pixel is next to a step in depth that the slope of its own surface does not explain, or next to a hole.
fn is_jump(scene: &Scene, normals: &[Vec3], index: usize) -> bool {
    let smooth = &scene.scan.smooth;
    if around(scene.grid, smooth, index, 1).any(|z| z <= 0.0) {
        return true;
    }
    let measured = around(scene.grid, smooth, index, 2).filter(|z| *z > 0.0);
    let (low, high) = measured.fold((f32::MAX, f32::MIN), |(low, high), z| (low.min(z), high.max(z)));
    let z = smooth[index];
    let eye = scene.camera.translation.as_vec3();
    let cosine = normals[index].dot((eye - scene.point[index]).normalize_or_zero()).clamp(0.2, 1.0);
    let slope = (1.0 - cosine * cosine).sqrt() / cosine;
    let expected = 4.0 * z / scene.scan.intrinsics.fx as f32 * slope;
    high - low > scene.config.depth_step_m + 0.004 * z + 1.3 * expected + 1.5 * noise_m(scene, index)
}

/// The values in the square of half width `reach` round a pixel.
fn around(grid: Grid, values: &[f32], index: usize, reach: usize) -> impl Iterator<Item = f32> + '_ {
    let (column, row) = (grid.column(index), grid.row(index));
    let columns = column.saturating_sub(reach)..(column + reach + 1).min(grid.width);
    let rows = row.saturating_sub(reach)..(row + reach + 1).min(grid.height);
    rows.flat_map(move |row| values[row * grid.width..][columns.clone()].iter().copied())
}

/// Pixels at which the surface bends inwards, in a row or in a column.
fn bends(scene: &Scene, open: &[bool], normals: &[Vec3]) -> Vec<bool> {
    let step = BEND_STEP as isize;
    let focal = scene.scan.intrinsics.fx as f32;
    // Error of a normal's slope: the noise over the width that it was taken from.
    let slope_sigma = |index: usize| {
        let width_m = 2.0 * normal_reach(scene) as f32 * scene.scan.smooth[index] / focal;
        1.4 * noise_m(scene, index) / width_m.max(1e-4)
    };
    let inwards = |index: usize, dx: isize, dy: isize| {
        let (Some(a), Some(b)) =
            (scene.grid.offset(index, -dx * step, -dy * step), scene.grid.offset(index, dx * step, dy * step))
        else {
            return false;
        };
        let (na, nb) = (normals[a], normals[b]);
        if na == Vec3::ZERO || nb == Vec3::ZERO {
            return false;
        }
        let across = scene.point[b] - scene.point[a];
        let length = across.length();
        let turn = (nb - na).dot(across) / (length + 1e-9);
        turn < -0.3 - 1.5 * (slope_sigma(index) - 0.2).max(0.0) && na.dot(nb) < 0.88 && length < 0.06
    };
    scene.grid.map(|i| open[i] && (inwards(i, 1, 0) || inwards(i, 0, 1)))
}

/// Gives unlabelled pixels of standing things to the segment that reaches them first, within `reach_px` steps and
/// 2 cm of where it began.
fn grow(scene: &Scene, open: &[bool], labels: &mut [u32], reach_px: usize) {
    let mut front: Vec<(usize, usize)> = Vec::new();
    for index in 0..labels.len() {
        if labels[index] != NONE && scene.grid.neighbours(index).any(|n| labels[n] == NONE && open[n]) {
            front.push((index, index));
        }
    }
    for _ in 0..reach_px {
        let mut next = Vec::new();
        for (index, seed) in front {
            for neighbour in scene.grid.neighbours(index) {
                let step = scene.point[neighbour].distance(scene.point[index]);
                let near = scene.point[neighbour].distance(scene.point[seed]) < 0.02 && step < 0.015;
                if labels[neighbour] == NONE && open[neighbour] && near {
                    labels[neighbour] = labels[index];
                    next.push((neighbour, seed));
                }
            }
        }
        front = next;
    }
}

/// Connected rests that no core was found in: those that touch a segment are part of it, the others, small or thin
/// things, become segments of their own.
fn adopt_remains(scene: &Scene, open: &[bool], segments: &mut Segments) {
    let rest: Vec<bool> = (0..scene.grid.len()).map(|i| open[i] && segments.labels[i] == NONE).collect();
    let joined = |a: usize, b: usize| (scene.scan.smooth[a] - scene.scan.smooth[b]).abs() < 0.012;
    let (labels, sizes) = scene.grid.components(&rest, joined);
    let mut touches: BTreeMap<u32, BTreeMap<u32, usize>> = BTreeMap::new();
    for index in (0..scene.grid.len()).filter(|&i| rest[i]) {
        for near in scene.grid.neighbours(index).filter(|&n| segments.labels[n] != NONE) {
            if scene.point[near].distance(scene.point[index]) < 0.015 {
                *touches.entry(labels[index]).or_default().entry(segments.labels[near]).or_insert(0) += 1;
            }
        }
    }
    let owner = |rest: u32| -> u32 {
        let most = touches.get(&rest).and_then(|near| near.iter().max_by_key(|(_, count)| **count));
        match most {
            Some((segment, count)) if *count >= 5 => *segment,
            _ if sizes[rest as usize] >= scene.min_segment_px() => segments.count as u32 + rest,
            _ => NONE,
        }
    };
    let owners: Vec<u32> = (0..sizes.len() as u32).map(owner).collect();
    for index in (0..scene.grid.len()).filter(|&i| rest[i]) {
        segments.labels[index] = owners[labels[index] as usize];
    }
    segments.count += sizes.len();
}

/// Joins neighbours whose common border is mostly without a step and without an inward bend.
fn merge_smooth(scene: &Scene, normals: &[Vec3], segments: &mut Segments) {
    for _ in 0..3 {
        let borders = borders(scene.grid, scene, normals, segments);
        let mut sets = crate::grid::DisjointSets::new(segments.count);
        let mut merged = false;
        for ((a, b), (smooth, total)) in borders {
            if total >= 8 && smooth as f64 > scene.config.smooth_border_share * total as f64 {
                sets.join(a as usize, b as usize);
                merged = true;
            }
        }
        if !merged {
            return;
        }
        for label in segments.labels.iter_mut().filter(|label| **label != NONE) {
            *label = sets.root(*label as usize) as u32;
        }
    }
}

/// For every pair of segments that touch in the image: border pixels that run on smoothly, and all of them.
fn borders(grid: Grid, scene: &Scene, normals: &[Vec3], segments: &Segments) -> BTreeMap<(u32, u32), (usize, usize)> {
    let mut borders = BTreeMap::new();
    let reach = BEND_STEP as isize + 1;
    for index in 0..grid.len() {
        let a = segments.labels[index];
        if a == NONE {
            continue;
        }
        for (dx, dy) in [(1, 0), (0, 1)] {
            let Some(next) = grid.offset(index, dx, dy) else { continue };
            let b = segments.labels[next];
            if b == NONE || b == a {
                continue;
            }
            let entry = borders.entry((a.min(b), a.max(b))).or_insert((0, 0));
            entry.1 += 1;
            let (Some(p), Some(q)) =
                (grid.offset(index, -dx * reach, -dy * reach), grid.offset(next, dx * reach, dy * reach))
            else {
                continue;
            };
            let inside = segments.labels[p] == a && segments.labels[q] == b;
            let step = (scene.scan.smooth[index] - scene.scan.smooth[next]).abs();
            let across = scene.point[q] - scene.point[p];
            let turn = (normals[q] - normals[p]).dot(across) / (across.length() + 1e-9);
            if inside && step < 0.006 + noise_m(scene, index) && turn > -0.12 && across.length() < 0.05 {
                entry.0 += 1;
            }
        }
    }
    borders
}

/// Drops segments that are too small or too flat to be things.
fn drop_small(scene: &Scene, segments: &mut Segments) {
    let pixels = segments.pixels();
    let is_thing = |list: &Vec<usize>| {
        if list.len() < scene.min_segment_px() {
            return false;
        }
        let mut heights: Vec<f32> = list.iter().map(|&i| scene.point[i].z / scene.height_limit_m(i)).collect();
        heights.sort_by(f32::total_cmp);
        // A thing reaches clearly above the limit; a ripple of the plane only just passes it.
        heights[heights.len() * 9 / 10] > 1.7
    };
    let kept: Vec<bool> = pixels.iter().map(is_thing).collect();
    segments.keep(&kept);
}
