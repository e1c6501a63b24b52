//! Gathers what is left of a low or thin thing that the plane takes a share of: of a tray the rims alone stand clear of the
//! surface, and colour shows that one floor lies between them.

use crate::{
    hypotheses::{Context, Hypothesis},
    joins,
    raster,
    scene::Scene,
    segments::{NONE, Segments},
    scan::Tint,
};
use std::ops::Range;

/// What explains a gathering explains these shares of its surface and of its outline,
const ON_SURFACE: f64 = 0.96;
const ON_OUTLINE: f64 = 0.7;
/// and no more than this share of it is empty: bare surface by its colour, or so much behind it, beyond what noise does.
const EMPTY: f64 = 0.06;
const BEHIND_M: f64 = 0.008;
/// What a gathered thing shows is measured this near to it.
const NEAR_M: f32 = 0.008;
/// So many of those that fit best are looked at.
const RUNNERS_UP: usize = 3;

/// Neighbouring pixels of one colour differ by less: in tint, and in lightness, which shade changes (CIELAB).
const ALIKE: f32 = 14.0;
const ALIKE_LIGHTNESS: f32 = 25.0;
/// A segment of which more than this share has the colour belongs to it whole, with what is drawn on it.
const MOSTLY: f64 = 0.5;
/// What is gathered is worth a fit if it is other than a segment that is there by more than this share of its pixels.
const NEWS: f64 = 0.05;

/// Makes one segment of all that stands up of an area of one colour, where a thing that the instruction speaks of, and that
/// is on call, explains it. Segments with the labels in `known` are left as they are.
pub(crate) fn gather(scene: &Scene, segments: &mut Segments, context: Context, known: &Range<u32>) {
    if !context.library.iter().any(|template| template.on_call && context.tries(template)) {
        return;
    }
    let labels = &segments.labels;
    let stands = |at: usize| labels[at] != NONE && !known.contains(&labels[at]);
    let level = |at: usize| scene.in_plane[at] || scene.rising[at] || !scene.is_known(at);
    let free = |at: usize| labels[at] == NONE && !scene.own[at] && level(at);
    let colored = scene.grid.map(|at| stands(at) || free(at) && scene.is_unlike_surface(at));
    let alike = |a: usize, b: usize| {
        let lightness = (scene.scan.lab[a][0] - scene.scan.lab[b][0]).abs();
        scene.scan.tint(a).distance(&scene.scan.tint(b)) < ALIKE && lightness < ALIKE_LIGHTNESS
    };
    let (blobs, sizes) = scene.grid.components(&colored, alike);
    let pixels = segments.pixels();
    for (blob, _) in (0u32..).zip(&sizes).filter(|(_, size)| **size >= scene.min_segment_px()) {
        let of_blob = |list: &[usize]| list.iter().filter(|&&at| blobs[at] == blob).count();
        let mut gathered: Vec<usize> = Vec::new();
        let mut largest = 0;
        for (label, list) in (0u32..).zip(&pixels).filter(|(label, _)| !known.contains(label)) {
            let inside = of_blob(list);
            let whole = inside as f64 > MOSTLY * list.len() as f64;
            largest = largest.max(if whole { list.len() } else { inside });
            gathered.extend(list.iter().filter(|&&at| segments.labels[at] == label && (whole || blobs[at] == blob)));
        }
        gathered.sort_unstable();
        let news = gathered.len() - largest.min(gathered.len());
        if gathered.len() < scene.min_segment_px() || (news as f64) < NEWS * gathered.len() as f64 {
            continue;
        }
        let mut joined =
            Segments { labels: segments.labels.clone(), count: segments.count, inner: segments.inner.clone() };
        let label = joined.lay(&gathered);
        let Some(piece) = joins::Piece::measure(scene, &joined, label, gathered) else { continue };
        let explains = |found: &Hypothesis| {
            let (on_surface, on_outline) = found.explained(piece.evidence());
            on_surface > ON_SURFACE && on_outline > ON_OUTLINE && empty(scene, found) < EMPTY
        };
        let best = piece.fits(context).into_iter().take(RUNNERS_UP).find(explains);
        if let Some(best) = best.filter(|best| best.model.template.on_call) {
            *segments = joined;
            claim(scene, segments, label, known, &best);
        }
    }
    segments.drop_specks(scene.min_segment_px(), known);
}

/// Drops the best of what may explain a segment while it is on call and partly empty, and something else is left.
pub(crate) fn drop_empty(scene: &Scene, ranked: &mut Vec<Hypothesis>) {
    while ranked.len() > 1 && ranked[0].model.template.on_call && empty(scene, &ranked[0]) > EMPTY {
        ranked.remove(0);
    }
}

/// Share of what a hypothesis shows to the camera where there is nothing.
fn empty(scene: &Scene, found: &Hypothesis) -> f64 {
    let solids = found.model.solids(&found.minimum.state);
    let hits = raster::cast(&scene.scan.intrinsics, scene.grid, &scene.camera, &solids).hits;
    let behind = |pixel: usize, depth: f64| {
        let seen = f64::from(scene.scan.smooth[pixel]);
        let noise_m = scene.noise_ratio * scene.config.depth_sigma_m(seen);
        scene.is_known(pixel) && seen - depth > BEHIND_M + 3.0 * noise_m
    };
    let bare = |pixel: usize| scene.in_plane[pixel] && !scene.is_unlike_surface(pixel);
    let nothing = hits.iter().filter(|&&(pixel, depth)| bare(pixel) || behind(pixel, depth)).count();
    nothing as f64 / hits.len().max(1) as f64
}

/// Gives a gathered thing what lies on it in its own colours, and was taken for a part of something that stands on it.
fn claim(scene: &Scene, segments: &mut Segments, label: u32, known: &Range<u32>, found: &Hypothesis) {
    let solids = found.model.solids(&found.minimum.state);
    let own: Vec<usize> = (0..scene.grid.len()).filter(|&at| segments.labels[at] == label).collect();
    let appearance = scene.scan.appearance(&own).mean;
    let color = Tint::of(&appearance);
    for (at, depth) in raster::cast(&scene.scan.intrinsics, scene.grid, &scene.camera, &solids).hits {
        let other = segments.labels[at];
        let shown = (scene.scan.smooth[at] - depth as f32).abs() < NEAR_M;
        if other != NONE && other != label && !known.contains(&other) && shown {
            let alike = scene.scan.tint(at).distance(&color) < 1.5 * ALIKE;
            if alike {
                segments.labels[at] = label;
            }
        }
    }
}
