//! What a segment offers to a fit: points of its surface and points of its outline.

use crate::{
    scene::Scene,
    segments::{NONE, Segments},
};
use acm_concept::{camera::Intrinsics, pose::Pose};
use glam::{DVec2, DVec3};

/// A measured point of the surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfacePoint {
    /// Support frame, metres.
    pub position: DVec3,
    /// Standard deviation, metres.
    pub sigma_m: f64,
}

/// What lies on the other side of an outline point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OutlineKind {
    /// Something farther: the outline is the thing's own.
    Own,
    /// Something as near, such as the surface it stands on: the thing reaches at least to here.
    Contact,
    /// Something nearer, the robot, or the image border: the thing reaches at least to here.
    Cut,
}

/// A point of a segment's outline.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OutlinePoint {
    pub pixel: DVec2,
    pub sigma_px: f64,
    pub kind: OutlineKind,
    /// Whether depth shows something farther on the other side.
    pub falls_off: bool,
    /// Segment on the other side, [`NONE`] for the surface and everything else.
    pub beyond: u32,
}

/// Everything that a fit compares a template with.
#[derive(Debug, Clone)]
pub(crate) struct Evidence {
    /// Pose of the camera in the support frame.
    pub camera: Pose,
    pub intrinsics: Intrinsics,
    pub points: Vec<SurfacePoint>,
    /// Independent measurements per point: neighbouring depths err together.
    pub point_weight: f64,
    pub outline: Vec<OutlinePoint>,
    /// Independent measurements per outline point.
    pub outline_weight: f64,
}

/// Pixels over which depth errors are about equal.
const CORRELATED_PX: f64 = 15.0;
/// Outline pixels over which errors are about equal.
const CORRELATED_OUTLINE_PX: f64 = 3.0;
/// How far inside and outside of the border that the depth shows the colour's edge is looked for, pixels, how far from it
/// one is still as likely, and which change of colour (CIELAB) makes an edge.
const EDGE_INSIDE: isize = 3;
const EDGE_OUTSIDE: isize = 6;
const EDGE_SPREAD_PX: f64 = 2.5;
const EDGE_CONTRAST: f64 = 9.0;
/// What speaks against an edge counts for so much at most (log likelihood).
const EDGE_DOUBT: f64 = 3.0;
/// How far the other side of a hole is looked for, pixels.
const HOLE_REACH: usize = 32;

impl Evidence {
    /// Every so many-th point and outline point, each of which counts for as many: enough for a rough fit.
    pub fn thinned(&self, every: usize) -> Evidence {
        let count = every as f64;
        Evidence {
            points: self.points.iter().step_by(every).copied().collect(),
            point_weight: count * self.point_weight,
            outline: self.outline.iter().step_by(every).copied().collect(),
            outline_weight: count * self.outline_weight,
            ..*self
        }
    }
    /// The evidence of a segment of standing pixels.
    pub fn of_segment(scene: &Scene, segments: &Segments, pixels: &[usize]) -> Evidence {
        let noise = (1.3 * scene.noise_ratio).clamp(0.4, 1.2);
        let step = (pixels.len() / scene.config.max_fit_points.max(1)).max(1);
        let surface_point = |&pixel: &usize| {
            let position = scene.measured(pixel)?;
            let sigma = noise * scene.config.depth_sigma_m(f64::from(scene.scan.depth[pixel]));
            Some(SurfacePoint { position, sigma_m: sigma.hypot(0.0015) })
        };
        let outer = |pixel: &&usize| !segments.inner[**pixel];
        let points: Vec<SurfacePoint> = pixels.iter().filter(outer).step_by(step).filter_map(surface_point).collect();
        let outline = outline(scene, segments, pixels);
        Evidence::new(scene, points, pixels.len(), outline)
    }

    /// Evidence from parts; the outline is thinned and the weights are set for correlated errors.
    pub fn new(scene: &Scene, points: Vec<SurfacePoint>, pixels: usize, outline: Vec<OutlinePoint>) -> Evidence {
        let outline_pixels = outline.len();
        let step = (outline_pixels / scene.config.max_fit_outline.max(1)).max(1);
        let outline: Vec<OutlinePoint> = outline.into_iter().step_by(step).collect();
        let weight = |independent: f64, count: usize| (independent / count.max(1) as f64).min(1.0);
        Evidence {
            camera: scene.camera,
            intrinsics: scene.scan.intrinsics,
            point_weight: weight(pixels as f64 / CORRELATED_PX, points.len()),
            outline_weight: weight(outline_pixels as f64 / CORRELATED_OUTLINE_PX, outline.len()),
            points,
            outline,
        }
    }

    /// Height of the top over the plane, metres: of the points, all but the highest twentieth.
    pub fn top_m(&self) -> f64 {
        let mut heights: Vec<f64> = self.points.iter().map(|p| p.position.z).collect();
        heights.sort_by(f64::total_cmp);
        heights.get(heights.len() * 19 / 20).copied().unwrap_or(0.0)
    }
    /// Number of independent measurements.
    pub fn independent(&self) -> f64 {
        self.points.len() as f64 * self.point_weight + self.outline.len() as f64 * self.outline_weight
    }
    /// Share of the outline that borders a segment in one of the given ways.
    pub fn border_share(&self, segment: u32, kinds: &[OutlineKind]) -> f64 {
        let borders = |p: &&OutlinePoint| p.beyond == segment && kinds.contains(&p.kind);
        self.outline.iter().filter(borders).count() as f64 / self.outline.len().max(1) as f64
    }
    /// Share of the outline that something else, or the image border, cuts off.
    pub fn cut_share(&self) -> f64 {
        let cut = self.outline.iter().filter(|point| point.kind == OutlineKind::Cut).count();
        cut as f64 / self.outline.len().max(1) as f64
    }
}

/// Midpoints between pixels of the segment and their neighbours outside it.
fn outline(scene: &Scene, segments: &Segments, pixels: &[usize]) -> Vec<OutlinePoint> {
    let Some(&first) = pixels.first() else { return Vec::new() };
    let label = segments.labels[first];
    let mut points = Vec::new();
    for &pixel in pixels {
        for (dx, dy) in [(1isize, 0isize), (0, 1), (-1, 0), (0, -1)] {
            let next = scene.grid.offset(pixel, dx, dy);
            if next.is_some_and(|n| segments.labels[n] == label) {
                continue;
            }
            let Some((kind, beyond, over_hole)) = other_side(scene, segments, label, pixel, dx, dy) else { continue };
            let at = DVec2::new(scene.grid.column(pixel) as f64, scene.grid.row(pixel) as f64);
            let outwards = DVec2::new(dx as f64, dy as f64);
            // Where a nearer thing begins is no edge of this one.
            let edge = if kind == OutlineKind::Cut { None } else { color_edge(scene, pixel, dx, dy) };
            let falls_off = kind == OutlineKind::Own;
            let point = match edge {
                // The colour shows where it ends, also where it meets the surface.
                Some(px) => OutlinePoint {
                    pixel: at + outwards * px,
                    sigma_px: scene.config.color_edge_sigma_px,
                    kind: if beyond == NONE { OutlineKind::Own } else { kind },
                    falls_off,
                    beyond,
                },
                None => {
                    let sigma_px = scene.config.outline_sigma_px * if over_hole { 1.7 } else { 1.0 };
                    OutlinePoint { pixel: at + outwards * 0.5, sigma_px, kind, falls_off, beyond }
                }
            };
            points.push(point);
        }
    }
    points
}

/// How far from a border pixel, in a direction out of its segment, the colour changes most, pixels; `None` if it hardly
/// changes there. The border that the depth shows is ragged and lacks the foot, which no height tells from the surface.
fn color_edge(scene: &Scene, pixel: usize, dx: isize, dy: isize) -> Option<f64> {
    const SPAN: usize = (EDGE_INSIDE + EDGE_OUTSIDE + 3) as usize;
    let mut lab = [[0f32; 3]; SPAN];
    for (slot, value) in lab.iter_mut().enumerate() {
        let step = slot as isize - EDGE_INSIDE - 1;
        *value = scene.scan.lab[scene.grid.offset(pixel, dx * step, dy * step)?];
    }
    // Between the means of two pixels on either side of each gap: single ones are noisy.
    let contrast = |slot: usize| -> f64 {
        let difference = |c: usize| 0.5 * (lab[slot + 1][c] + lab[slot + 2][c] - lab[slot - 1][c] - lab[slot][c]);
        f64::from((0..3).map(|c| difference(c).powi(2)).sum::<f32>().sqrt())
    };
    let gaps: Vec<f64> = (1..SPAN - 2).map(contrast).collect();
    let away = |at: usize| at as f64 + 0.5 - EDGE_INSIDE as f64;
    // Of two samples of two pixels each; the light may change, as in a shadow.
    let unlike = |a: usize, b: usize| -> f64 {
        let difference = |c: usize| 0.5 * (lab[a][c] + lab[a + 1][c] - lab[b][c] - lab[b + 1][c]);
        f64::from((0.3 * difference(0)).powi(2) + difference(1).powi(2) + difference(2).powi(2)).sqrt()
    };
    // What lies beyond it goes on beyond it, unlike the next colour of a pattern, and what lies within is of the segment,
    // unlike a mat that the thing stands on.
    let beyond = |at: usize| unlike(at + 2, SPAN - 2);
    let within = |at: usize| (0..EDGE_INSIDE as usize).map(|own| unlike(at, own)).fold(f64::INFINITY, f64::min);
    let doubt = |at: usize| (beyond(at) / EDGE_CONTRAST).min(EDGE_DOUBT) + (within(at) / EDGE_CONTRAST).min(EDGE_DOUBT);
    let near = |at: usize| (-0.5 * ((away(at) - 0.5) / EDGE_SPREAD_PX).powi(2)).exp();
    let likely = |at: usize| gaps[at] * near(at) * (-doubt(at)).exp();
    let best = (0..gaps.len()).max_by(|a, b| likely(*a).total_cmp(&likely(*b)))?;
    if gaps[best] < EDGE_CONTRAST {
        return None;
    }
    // The middle of the three gaps round it, by what each exceeds the lowest of them.
    let near = best.saturating_sub(1)..(best + 2).min(gaps.len());
    let least = near.clone().map(|at| gaps[at]).fold(f64::INFINITY, f64::min);
    let (sum, weight) =
        near.fold((0.0, 1e-9), |(sum, weight), at| (sum + (gaps[at] - least) * away(at), weight + gaps[at] - least));
    Some(if weight > 1e-6 { sum / weight } else { away(best) })
}

/// What lies beyond a border pixel, which segment that is, and whether a hole had to be crossed; `None` if the
/// segment goes on beyond it.
fn other_side(
    scene: &Scene,
    segments: &Segments,
    label: u32,
    pixel: usize,
    dx: isize,
    dy: isize,
) -> Option<(OutlineKind, u32, bool)> {
    let z = scene.scan.smooth[pixel];
    let tolerance = 0.006 + 0.006 * z;
    for step in 1..=HOLE_REACH as isize {
        let Some(at) = scene.grid.offset(pixel, dx * step, dy * step) else {
            return Some((OutlineKind::Cut, NONE, step > 1));
        };
        if segments.labels[at] == label {
            return None;
        }
        if scene.own[at] {
            return Some((OutlineKind::Cut, NONE, step > 1));
        }
        if scene.is_known(at) {
            let gap = scene.scan.smooth[at] - z;
            let kind = if gap > tolerance {
                OutlineKind::Own
            } else if gap < -tolerance && segments.labels[at] != NONE {
                OutlineKind::Cut
            } else {
                OutlineKind::Contact
            };
            return Some((kind, segments.labels[at], step > 1));
        }
    }
    Some((OutlineKind::Own, NONE, true))
}
