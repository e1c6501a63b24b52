//! Gathers what is left of a low or thin thing that the plane takes a share of: of a tray the rims alone stand clear of the
//! surface, and colour shows that one floor lies between them.

use crate::{
    hypotheses::{Context, Hypothesis},
    joins::{self, SPOKEN_OF},
    measure, raster,
    scan::Tint,
    scene::Scene,
    segments::{NONE, Segments},
};
use glam::DVec2;
use std::{
    collections::{BTreeMap, BTreeSet},
    f64::consts::{FRAC_PI_2, PI},
    ops::Range,
};

/// What explains a gathering explains these shares of its surface and of its outline,
const ON_SURFACE: f64 = 0.96;
const ON_OUTLINE: f64 = 0.7;
/// and no more than this share of it is empty (of anything else more than the second): bare surface by its colour, or so much
/// behind it, beyond what noise does.
const EMPTY: f64 = 0.06;
const MOSTLY_EMPTY: f64 = 0.35;
const BEHIND_M: f64 = 0.008;
/// What a gathered thing shows is measured this near to it.
const NEAR_M: f32 = 0.008;
/// So many of those that fit best are looked at.
const RUNNERS_UP: usize = 3;

/// What is at an end narrower than this share of the widest is taken off, in slices so thick, if so much is left.
const THIN: f64 = 0.55;
const SLICE_M: f64 = 0.004;
const CORE: f64 = 0.6;

/// What is darker than the surface by this much (CIELAB) does not lie in the shade.
const DARKER: f32 = 45.0;

/// So few pieces may be as many things.
const FEW: usize = 2;

/// Neighbouring pixels of one colour differ by less: in tint, and in lightness, which shade changes (CIELAB).
const ALIKE: f32 = 14.0;
const ALIKE_LIGHTNESS: f32 = 25.0;
/// Parts of one thing have tints that differ by less.
const OTHER: f32 = 20.0;
/// Below this lightness, and the more the darker, tints are mostly noise.
const DARK: f32 = 25.0;
/// A segment of which more than this share has the colour belongs to it whole, with what is drawn on it.
const MOSTLY: f64 = 0.5;
/// What is gathered is worth a fit if it is other than a segment that is there by more than this share of its pixels.
const NEWS: f64 = 0.03;

/// Makes one segment of all that stands up of an area of one colour, where a thing that the instruction speaks of, and that
/// is on call, explains it. Segments with the labels in `known` are left as they are. Returns the labels of what was gathered,
/// which is whole.
pub(crate) fn gather(scene: &Scene, segments: &mut Segments, context: Context, known: &Range<u32>) -> BTreeSet<u32> {
    let mut whole = BTreeSet::new();
    if !context.library.iter().any(|template| template.on_call && context.tries(template)) {
        return whole;
    }
    let labels = &segments.labels;
    let stands = |at: usize| labels[at] != NONE && !known.contains(&labels[at]);
    let level = |at: usize| scene.in_plane[at] || scene.rising[at] || !scene.is_known(at);
    let free = |at: usize| labels[at] == NONE && !scene.own[at] && level(at);
    let colored = scene.grid.map(|at| stands(at) || free(at) && is_foreign(scene, at));
    let alike = |a: usize, b: usize| {
        let [light, other] = [a, b].map(|at| scene.scan.lab[at][0]);
        // Noise gives dark pixels any tint.
        let tolerance = ALIKE + (DARK - light.min(other)).max(0.0);
        scene.scan.tint(a).distance(&scene.scan.tint(b)) < tolerance && (light - other).abs() < ALIKE_LIGHTNESS
    };
    let (blobs, sizes) = scene.grid.components(&colored, alike);
    let pixels = segments.pixels();
    for (blob, _) in (0u32..).zip(&sizes).filter(|(_, size)| **size >= scene.min_segment_px()) {
        let share = |(label, list): (u32, &Vec<usize>)| {
            let left = |at: &usize| segments.labels[*at] == label;
            let inside: Vec<usize> = list.iter().copied().filter(|at| left(at) && blobs[*at] == blob).collect();
            let whole = inside.len() as f64 > MOSTLY * list.len() as f64;
            if whole { (list.iter().copied().filter(left).collect(), true) } else { (inside, false) }
        };
        let shares = (0u32..).zip(&pixels).filter(|(label, _)| !known.contains(label)).map(share);
        let mut shares: Vec<(Vec<usize>, bool)> = shares.filter(|(share, _)| !share.is_empty()).collect();
        shares.sort_by_key(|(share, _)| share.len());
        // The lesser part of a segment is the other colour of a thing of two.
        if shares.last().is_none_or(|(_, whole)| !whole) {
            continue;
        }
        let mut shares: Vec<Vec<usize>> = shares.into_iter().map(|(share, _)| share).collect();
        // Where colours run into each other a blob goes on into the next thing.
        let tint = |share: &Vec<usize>| Tint::of(&scene.scan.appearance(share).mean);
        if let Some(main) = shares.last().map(tint) {
            shares.retain(|share| tint(share).distance(&main) < OTHER);
        }
        // All of it, or what lies before a larger thing of the same colour; then without what sticks out.
        let least = scene.min_segment_px();
        let (mut candidates, mut cores) = (Vec::new(), Vec::new());
        for taken in [shares.len(), shares.len().saturating_sub(1)] {
            let mut all: Vec<usize> = shares.iter().take(taken).flatten().copied().collect();
            all.sort_unstable();
            let largest = shares.iter().take(taken).map(Vec::len).max().unwrap_or(0);
            let is_news = all.len() - largest > (NEWS * all.len() as f64) as usize;
            cores.extend(core(scene, &all).map(|core| (core, true)));
            candidates.push((all, is_news));
        }
        candidates.append(&mut cores);
        candidates.retain(|(candidate, _)| candidate.len() >= least);
        candidates.dedup();
        let measured = |share: &Vec<usize>| {
            let label = share.first().map(|&at| segments.labels[at])?;
            joins::Piece::measure(scene, segments, label, share.clone())
        };
        let pieces: Vec<joins::Piece> =
            shares.iter().filter(|share| share.len() >= least).filter_map(measured).collect();
        let explained = |(pixels, is_news)| Some((explained(scene, segments, context, pixels, &pieces)?, is_news));
        // What is one segment already, and explained, is left as it is.
        if let Some((found, true)) = candidates.into_iter().find_map(explained) {
            whole.insert(found.label);
            *segments = found.segments;
            claim(scene, segments, found.label, known, &found.best);
        }
    }
    // What a segment has left where something was taken from it may be its edge alone.
    let mut left = vec![0usize; segments.count];
    segments.labels.iter().filter(|label| **label != NONE).for_each(|label| left[*label as usize] += 1);
    let lost = |label: u32| pixels.get(label as usize).is_some_and(|list| left[label as usize] < list.len());
    segments.drop_scraps(scene.grid, scene.min_segment_px(), |label| !known.contains(&label) && lost(label));
    whole
}

/// A gathering that something on call explains.
struct Gathered<'a> {
    segments: Segments,
    label: u32,
    best: Hypothesis<'a>,
}

fn explained<'a>(
    scene: &Scene,
    segments: &Segments,
    context: Context<'a>,
    pixels: Vec<usize>,
    pieces: &[joins::Piece],
) -> Option<Gathered<'a>> {
    let mut segments =
        Segments { labels: segments.labels.clone(), count: segments.count, inner: segments.inner.clone() };
    let label = segments.lay(&pixels);
    let piece = joins::Piece::measure(scene, &segments, label, pixels)?;
    let explains = |found: &Hypothesis| {
        let (on_surface, on_outline) = found.explained(piece.evidence());
        on_surface > ON_SURFACE && on_outline > ON_OUTLINE && empty(scene, found) < EMPTY
    };
    let fits = piece.fits(context);
    let least = fits.first()?.score - SPOKEN_OF;
    let on_call = |found: &Hypothesis| found.model.template.on_call && found.score > least;
    let best = fits.into_iter().take(RUNNERS_UP).find(|found| on_call(found) && explains(found))?;
    let few = pieces.len() <= FEW;
    (!few || joins::is_one(context, &best, &piece, pieces)).then_some(Gathered { segments, label, best })
}

/// What is left of some pixels without what is thin at an end, as seen from above; `None` if that is nearly all or too
/// little.
fn core(scene: &Scene, pixels: &[usize]) -> Option<Vec<usize>> {
    let at = |pixel: &usize| scene.point[*pixel].truncate().as_dvec2();
    let known: Vec<usize> = pixels.iter().copied().filter(|&pixel| scene.is_known(pixel)).collect();
    let plan: Vec<DVec2> = known.iter().step_by(3).map(at).collect();
    let rectangle = measure::smallest(&measure::rectangles(&plan, PI / 60.0, 0.003))?;
    let mut core = known;
    for turn in [0.0, FRAC_PI_2] {
        let (along, across) =
            (DVec2::from_angle(rectangle.yaw + turn), DVec2::from_angle(rectangle.yaw + turn + FRAC_PI_2));
        let slice = |pixel: &usize| (at(pixel).dot(along) / SLICE_M).floor() as i64;
        let mut widths: BTreeMap<i64, (f64, f64)> = BTreeMap::new();
        for pixel in &core {
            let v = at(pixel).dot(across);
            let width = widths.entry(slice(pixel)).or_insert((v, v));
            *width = (width.0.min(v), width.1.max(v));
        }
        let widest = widths.values().map(|(low, high)| high - low).fold(0.0, f64::max);
        let wide = |(_, (low, high)): &(&i64, &(f64, f64))| high - low > THIN * widest;
        let (first, last) = (widths.iter().find(wide)?.0, widths.iter().rev().find(wide)?.0);
        core.retain(|pixel| (*first..=*last).contains(&slice(pixel)));
    }
    let share = core.len() as f64 / pixels.len().max(1) as f64;
    (CORE..1.0 - NEWS).contains(&share).then_some(core)
}

/// Drops the best of what may explain a segment while it is partly empty, if it is on call, or mostly, and something else
/// is left.
pub(crate) fn drop_empty(scene: &Scene, ranked: &mut Vec<Hypothesis>) {
    let limit = |found: &Hypothesis| if found.model.template.on_call { EMPTY } else { MOSTLY_EMPTY };
    let is_full = |found: &Hypothesis| empty(scene, found) <= limit(found);
    let Some(best) = ranked.first().map(|best| (best.model.template.on_call, best.score)) else { return };
    if let Some(full) = ranked.iter().position(is_full) {
        // What explains all else much better may be right, and the bare surface of its colour.
        if best.0 || ranked[full].score > best.1 - SPOKEN_OF {
            ranked.drain(..full);
        }
    }
}

/// Whether a pixel has another colour than the surface, and not for lying in the shade.
fn is_foreign(scene: &Scene, pixel: usize) -> bool {
    scene.tint().is_some_and(|tint| tint.is_unlike(scene, pixel) || tint.is_darker(scene, pixel, DARKER))
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
    let bare = |pixel: usize| scene.in_plane[pixel] && !is_foreign(scene, pixel);
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
            let dark = (DARK - scene.scan.lab[at][0]).max(0.0);
            let alike = scene.scan.tint(at).distance(&color) < OTHER + dark;
            if alike {
                segments.labels[at] = label;
            }
        }
    }
}
