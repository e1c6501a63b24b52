//! Flat patches: areas of the plane that differ from it by colour alone, and plates too low to stand on it.

use crate::{
    fit::{Evidence, OutlineKind, OutlinePoint},
    grid::Grid,
    measure::{self, Rectangle},
    scan::Tint,
    scene::Scene,
    segments::NONE,
    surface_tint::mean,
};
use glam::DVec2;

/// A patch of the plane with a colour of its own.
pub(crate) struct Patch {
    /// Its visible pixels, ascending.
    pub pixels: Vec<usize>,
    /// Where the rays of those pixels meet the plane, thinned out.
    pub plan: Vec<DVec2>,
    pub evidence: Evidence,
    /// Share of its rectangle's visible area that has its colour, 0-1.
    pub fill: f64,
}

/// Tints of one patch differ by less than this.
const ALIKE: f32 = 14.0;

/// From so many pieces on that fill a rectangle together they are one patch with a pattern; two may be two patches.
const PATTERN_PIECES: usize = 3;
/// What is joined fills its rectangle by more than this, and that is shorter than this.
const FULL: f64 = 0.9;
const LONGEST_M: f64 = 0.45;

/// A common rectangle may be this much less full than its pieces' own: a gap of 1 cm between two mats of 8 cm
/// takes three times as much.
const JOINT_LOSS: f64 = 0.02;

/// Print covers no more than this share of what is left bare round it.
const PRINT: f64 = 0.5;

/// How a pixel counts in the search for patches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ground {
    /// The bare surface.
    Bare,
    /// A different colour in the plane.
    Tinted,
    /// Covered by something that stands there, by the robot, or without depth.
    Unknown,
}

pub(crate) fn find(scene: &Scene, standing: &[bool]) -> Vec<Patch> {
    if scene.tint().is_none() {
        return Vec::new();
    }
    let covered = scene.grid.dilate(standing, 4);
    let ground = scene.grid.map(|i| classify(scene, &covered, i));
    let tinted: Vec<bool> = ground.iter().map(|g| *g == Ground::Tinted).collect();
    let firm = scene.grid.dilate(&scene.grid.erode(&tinted, 1), 1);
    let mask: Vec<bool> = (0..tinted.len()).map(|i| tinted[i] && firm[i]).collect();
    let alike = |a: usize, b: usize| scene.scan.tint(a).distance(&scene.scan.tint(b)) < ALIKE;
    let mut pieces = areas(scene, scene.grid.components(&mask, alike));
    for blob in areas(scene, scene.grid.blobs(&mask)) {
        let colors = pieces.iter().filter(|piece| piece.iter().any(|at| blob.binary_search(at).is_ok())).count();
        if colors >= PATTERN_PIECES && is_full(scene, &ground, &blob) {
            pieces.retain(|piece| !piece.iter().any(|at| blob.binary_search(at).is_ok()));
            pieces.push(blob);
        }
    }
    join_pieces(scene, &ground, &mut pieces);
    take_prints(scene, &covered, &mut pieces);
    pieces.into_iter().filter_map(|pixels| patch(scene, &ground, pixels)).collect()
}

/// The pixels of components that are not too small, each ascending.
fn areas(scene: &Scene, (labels, sizes): (Vec<u32>, Vec<usize>)) -> Vec<Vec<usize>> {
    let mut areas: Vec<Vec<usize>> = vec![Vec::new(); sizes.len()];
    for (index, &label) in labels.iter().enumerate() {
        if sizes.get(label as usize).is_some_and(|size| *size >= scene.min_segment_px() / 2) {
            areas[label as usize].push(index);
        }
    }
    areas.retain(|pixels| !pixels.is_empty());
    areas
}

/// Adds to each piece what is printed on it. What shows of the piece within print, such as the eyes of an 8, is no patch
/// of its own.
fn take_prints(scene: &Scene, covered: &[bool], pieces: &mut Vec<Vec<usize>>) {
    let tints: Vec<Option<Tint>> = pieces.iter().map(|piece| mean_tint(scene, piece)).collect();
    let mut eye = vec![false; pieces.len()];
    for at in 0..pieces.len() {
        take_print(scene.grid, covered, &mut pieces[at]);
        let held = |other: usize| {
            let alike = tints[at].zip(tints[other]).is_some_and(|(a, b)| a.distance(&b) < ALIKE);
            other != at && alike && pieces[other].iter().all(|pixel| pieces[at].binary_search(pixel).is_ok())
        };
        (0..pieces.len()).for_each(|other| eye[other] |= held(other));
    }
    let mut eyes = eye.into_iter();
    pieces.retain(|_| !eyes.next().unwrap_or(false));
}

fn mean_tint(scene: &Scene, pixels: &[usize]) -> Option<Tint> {
    mean(pixels.iter().map(|&at| scene.scan.tint(at)))
}

/// Adds to a piece what is printed on it: what it encloses, where nothing stands and that is not too much of it.
fn take_print(grid: Grid, covered: &[bool], piece: &mut Vec<usize>) {
    let columns = || piece.iter().map(|&at| grid.column(at));
    let (Some(left), Some(right)) = (columns().min(), columns().max()) else { return };
    let (Some(&first), Some(&last)) = (piece.first(), piece.last()) else { return };
    let (width, height) = (right - left + 3, grid.row(last) - grid.row(first) + 3);
    // The piece in a window with a margin of one pixel, from which the outside is flooded.
    let mut window = vec![false; width * height];
    for &at in piece.iter() {
        window[(grid.row(at) - grid.row(first) + 1) * width + grid.column(at) - left + 1] = true;
    }
    let mut front = vec![0usize];
    let mut outside = vec![false; width * height];
    outside[0] = true;
    while let Some(at) = front.pop() {
        let (column, row) = (at % width, at / width);
        let near = [
            (column > 0).then(|| at - 1),
            (column + 1 < width).then(|| at + 1),
            (row > 0).then(|| at - width),
            (row + 1 < height).then(|| at + width),
        ];
        for next in near.into_iter().flatten().filter(|&next| !window[next]) {
            if !std::mem::replace(&mut outside[next], true) {
                front.push(next);
            }
        }
    }
    let pixel = |at: usize| grid.index(at % width + left - 1, at / width + grid.row(first) - 1);
    let print: Vec<usize> = (0..window.len()).filter(|&at| !window[at] && !outside[at]).map(pixel).collect();
    if print.len() as f64 > PRINT * piece.len() as f64 || print.iter().any(|&at| covered[at]) {
        return;
    }
    piece.extend(print);
    piece.sort_unstable();
}

/// Whether an area fills a rectangle on the surface as a patch does.
fn is_full(scene: &Scene, ground: &[Ground], pixels: &[usize]) -> bool {
    rectangle(&plan(scene, pixels)).is_some_and(|r| r.length < LONGEST_M && fill(scene, ground, &r, pixels) > FULL)
}

fn classify(scene: &Scene, covered: &[bool], index: usize) -> Ground {
    let dark = scene.scan.lab[index][0] < 8.0;
    // What rises a little, and was too low to be a thing, is a plate that lies there.
    let level = scene.in_plane[index] || scene.rising[index];
    if covered[index] || scene.own[index] || !level || dark {
        return Ground::Unknown;
    }
    if scene.is_unlike_surface(index) { Ground::Tinted } else { Ground::Bare }
}

/// Where the rays of some of the pixels meet the plane.
fn plan(scene: &Scene, pixels: &[usize]) -> Vec<DVec2> {
    let step = (pixels.len() / 500).max(1);
    let at = |&pixel: &usize| DVec2::new(scene.grid.column(pixel) as f64, scene.grid.row(pixel) as f64);
    pixels.iter().step_by(step).filter_map(|pixel| scene.foot_of_ray(at(pixel))).collect()
}

fn rectangle(plan: &[DVec2]) -> Option<Rectangle> {
    measure::smallest(&measure::rectangles(plan, std::f64::consts::PI / 60.0, 0.003))
}

/// Joins pieces of one patch that something standing on it, or the robot, cuts apart: pieces of one colour whose
/// common rectangle is as full as their own. Where bare surface shows between them they are two patches.
fn join_pieces(scene: &Scene, ground: &[Ground], pieces: &mut Vec<Vec<usize>>) {
    let mut first = 0;
    while first < pieces.len() {
        let mut second = first + 1;
        while second < pieces.len() {
            let tints = mean_tint(scene, &pieces[first]).zip(mean_tint(scene, &pieces[second]));
            let alike = tints.is_some_and(|(a, b)| a.distance(&b) < ALIKE);
            let joined: Vec<usize> = if alike {
                let mut both: Vec<usize> = pieces[first].iter().chain(&pieces[second]).copied().collect();
                both.sort_unstable();
                both
            } else {
                Vec::new()
            };
            let fullness = |pixels: &[usize]| {
                rectangle(&plan(scene, pixels))
                    .filter(|r| r.length < LONGEST_M)
                    .map(|r| fill(scene, ground, &r, pixels))
            };
            let fits = alike
                && fullness(&joined)
                    .zip(fullness(&pieces[first]))
                    .zip(fullness(&pieces[second]))
                    .is_some_and(|((joined, first), second)| joined > FULL && joined > first.min(second) - JOINT_LOSS);
            if fits {
                pieces[first] = joined;
                pieces.remove(second);
                second = first + 1;
            } else {
                second += 1;
            }
        }
        first += 1;
    }
}

/// Share of a rectangle's visible area that is the patch's, print and all.
fn fill(scene: &Scene, ground: &[Ground], rectangle: &Rectangle, pixels: &[usize]) -> f64 {
    const CELLS: usize = 24;
    let axis = DVec2::from_angle(rectangle.yaw);
    let (mut inside, mut known) = (0usize, 0usize);
    for i in 0..CELLS * CELLS {
        let (u, v) = ((i % CELLS) as f64 + 0.5, (i / CELLS) as f64 + 0.5);
        let local =
            DVec2::new(u / CELLS as f64 - 0.5, v / CELLS as f64 - 0.5) * DVec2::new(rectangle.length, rectangle.width);
        let at = rectangle.centre + axis.rotate(local);
        let Some(pixel) = scene.project(at.extend(0.0)).filter(|p| scene.scan.intrinsics.contains(*p)) else {
            continue;
        };
        let index = scene.grid.index(pixel.x.round().max(0.0) as usize, pixel.y.round().max(0.0) as usize);
        match ground[index] {
            Ground::Unknown => {}
            // Print may have the colour of the bare surface.
            Ground::Bare | Ground::Tinted => {
                known += 1;
                inside += usize::from(pixels.binary_search(&index).is_ok());
            }
        }
    }
    if known == 0 { 0.0 } else { inside as f64 / known as f64 }
}

fn patch(scene: &Scene, ground: &[Ground], pixels: Vec<usize>) -> Option<Patch> {
    let plan = plan(scene, &pixels);
    let rectangle = rectangle(&plan)?;
    let fill = fill(scene, ground, &rectangle, &pixels);
    if pixels.len() < scene.min_segment_px() || rectangle.width < scene.config.min_patch_m || fill < 0.8 {
        return None;
    }
    let outline = outline(scene, ground, &pixels);
    let own = outline.iter().filter(|point| point.kind == OutlineKind::Own).count();
    if own * 3 < outline.len() {
        return None;
    }
    let evidence = Evidence::new(scene, Vec::new(), 0, outline);
    Some(Patch { pixels, plan, evidence, fill })
}

fn outline(scene: &Scene, ground: &[Ground], pixels: &[usize]) -> Vec<OutlinePoint> {
    let mut inside = vec![false; scene.grid.len()];
    for &pixel in pixels {
        inside[pixel] = true;
    }
    let mut points = Vec::new();
    for &pixel in pixels {
        for (dx, dy) in [(1isize, 0isize), (0, 1), (-1, 0), (0, -1)] {
            let next = scene.grid.offset(pixel, dx, dy);
            if next.is_some_and(|n| inside[n]) {
                continue;
            }
            let kind = match next.map(|n| ground[n]) {
                Some(Ground::Bare) => OutlineKind::Own,
                // Another colour in the plane: an edge of this patch all the same.
                Some(Ground::Tinted) => OutlineKind::Own,
                Some(Ground::Unknown) | None => OutlineKind::Cut,
            };
            let at = DVec2::new(scene.grid.column(pixel) as f64, scene.grid.row(pixel) as f64);
            points.push(OutlinePoint {
                pixel: at + DVec2::new(dx as f64, dy as f64) * 0.5,
                sigma_px: 1.0,
                kind,
                falls_off: false,
                beyond: NONE,
            });
        }
    }
    points
}
