//! Joins segments that are one thing seen in pieces: the inside and outside of something hollow, and the two ends of
//! something that a nearer thing covers in the middle.

use crate::{
    fit::{Base, Evidence, OutlineKind},
    hypotheses::{self, Context, Hypothesis, Measured},
    scan::Tint,
    scene::Scene,
    segments::{NONE, Segments},
};
use acm_concept::{solid::PlacedSolid, template::SeenBy};
use glam::DVec2;
use rayon::prelude::*;
use std::{collections::BTreeSet, ops::Range};

/// Most joins in one frame.
const MAX_JOINS: usize = 24;
/// Colours of the parts of one thing that are joined by their shape differ by less, in the units of a tint.
const SAME_TINT: f32 = 20.0;
/// Parts of one thing that do not touch in the image are nearer to each other than this.
const NEAR_M: f64 = 0.02;
/// What does not come lower than this stands on something else than the plane, or hangs.
const HOVERING_M: f64 = 0.022;
/// What keeps this off the plane does not stand on it.
const CLEAR_M: f64 = 0.015;
/// A handle is nearer to what it is fixed to than this.
const HANDLE_M: f64 = 0.032;
/// Share of a fringe's outline along which the thing cuts it off, and of its pixels that are two from its border.
const FRINGE_CUT: f64 = 0.3;
const FRINGE_THICK: f64 = 0.1;
/// So much less (log likelihood) is explained where what is no scrap is taken for one.
const SPOILT: f64 = 100.0;
/// Evidence (negative log likelihood) that it takes to believe that two things lie like the parts of one.
const COINCIDENCE: f64 = 15.0;
/// The same where the one is on call and the instruction speaks of it, and what it then explains of surface and outline.
pub(crate) const SPOKEN_OF: f64 = 60.0;
const SPOKEN_OF_SURFACE: f64 = 0.96;
const SPOKEN_OF_OUTLINE: f64 = 0.77;
/// Each of two things explains this share of its surface and of its outline.
const PARTED_SURFACE: f64 = 0.85;
const PARTED_OUTLINE: f64 = 0.75;
/// They explain so much more (log likelihood) than one does, and that one less than this share of either: a thing of two
/// colours is one.
const PARTED_GAIN: f64 = 10.0;
const ONE_SURFACE: f64 = 0.93;
const ONE_OUTLINE: f64 = 0.85;
const ONE_OF_EITHER: f64 = 0.5;
/// Tops of pieces of one thing are level within this.
const LEVEL_M: f64 = 0.016;

/// A segment with what the tests look at.
pub(crate) struct Piece {
    label: u32,
    pixels: Vec<usize>,
    evidence: Evidence,
    top_m: f64,
    lowest_m: f64,
}

impl Piece {
    pub fn measure(scene: &Scene, segments: &Segments, label: u32, pixels: Vec<usize>) -> Option<Piece> {
        let evidence = Evidence::of_segment(scene, segments, &pixels);
        let (top_m, lowest_m) = (evidence.top_m(), scene.lowest_m(&pixels));
        (!evidence.points.is_empty()).then_some(Piece { label, pixels, evidence, top_m, lowest_m })
    }
    pub fn evidence(&self) -> &Evidence {
        &self.evidence
    }
    /// What may explain it by itself, the most probable first.
    pub fn fits<'a>(&self, context: Context<'a>) -> Vec<Hypothesis<'a>> {
        fits(context, &self.evidence, self.lowest_m)
    }
    /// Least distance between some surface points of either, metres.
    fn distance_m(&self, other: &Piece) -> f64 {
        let some = |piece: &Piece| -> Vec<glam::DVec3> {
            let step = (piece.evidence.points.len() / 100).max(1);
            piece.evidence.points.iter().step_by(step).map(|p| p.position).collect()
        };
        let others = some(other);
        let to = |at: glam::DVec3| others.iter().map(move |b| at.distance(*b)).fold(f64::INFINITY, f64::min);
        some(self).into_iter().map(to).fold(f64::INFINITY, f64::min)
    }
    /// Share of the surface points near the top: large where a top face is seen, small on a wall.
    fn top_share(&self) -> f64 {
        let near = |p: &&crate::fit::SurfacePoint| p.position.z > self.top_m - 0.008;
        self.evidence.points.iter().filter(near).count() as f64 / self.evidence.points.len().max(1) as f64
    }
}

/// How two pieces belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Relation {
    /// The second is no thing at all.
    Artefact,
    /// The second is the floor of the hollow first.
    Floor,
    /// The second is more of the first's outer surface.
    Surface,
    /// The second sticks out of the first, as a handle does.
    Attached,
    /// The second is the inside of the first.
    Inside,
    /// The second is the far end of the first.
    OtherEnd,
    /// Both are parts of one template.
    OnePart,
}

/// Joins pieces until no two belong together. Pieces with the labels in `known` are whole as they are: no two of them are
/// joined, but to each may belong what is left beside it. To what is `whole` only its floor and the camera's artefacts belong.
pub(crate) fn join(scene: &Scene, segments: &mut Segments, context: Context, known: Range<u32>, whole: &BTreeSet<u32>) {
    let mut pieces: Vec<Piece> = (0..segments.count as u32)
        .into_par_iter()
        .zip(segments.pixels())
        .filter_map(|(label, pixels)| Piece::measure(scene, segments, label, pixels))
        .collect();
    // Pairs that the costly tests refused: asked again only when one of them has changed.
    let mut refused: BTreeSet<(Relation, u32, u32)> = BTreeSet::new();
    for _ in 0..MAX_JOINS {
        let Some((first, second, relation)) = related(scene, segments, context, &pieces, (&known, whole), &mut refused)
        else {
            return;
        };
        let name = if relation == Relation::Artefact { NONE } else { first };
        for (label, inner) in segments.labels.iter_mut().zip(&mut segments.inner).filter(|(l, _)| **l == second) {
            *label = name;
            *inner |= matches!(relation, Relation::Inside | Relation::Floor | Relation::Attached);
        }
        refused.retain(|(_, a, b)| ![first, second].contains(a) && ![first, second].contains(b));
        let mut joined = Vec::new();
        for piece in pieces.extract_if(.., |p| p.label == second || p.label == name) {
            joined.extend(piece.pixels);
        }
        for point in pieces.iter_mut().flat_map(|p| &mut p.evidence.outline).filter(|p| p.beyond == second) {
            point.beyond = name;
        }
        if name != NONE {
            joined.sort_unstable();
            pieces.extend(Piece::measure(scene, segments, first, joined));
        }
    }
}

/// The first two pieces that belong together, and how.
fn related(
    scene: &Scene,
    segments: &Segments,
    context: Context,
    pieces: &[Piece],
    (known, whole): (&Range<u32>, &BTreeSet<u32>),
    refused: &mut BTreeSet<(Relation, u32, u32)>,
) -> Option<(u32, u32, Relation)> {
    let relations = [
        Relation::Artefact,
        Relation::Floor,
        Relation::Surface,
        Relation::Attached,
        Relation::Inside,
        Relation::OtherEnd,
        Relation::OnePart,
    ];
    for relation in relations {
        let pairs = pieces.iter().flat_map(|a| pieces.iter().map(move |b| (a, b)));
        let unlike =
            |(a, b): &(&Piece, &Piece)| a.label != b.label && !(known.contains(&a.label) && known.contains(&b.label));
        for (a, b) in pairs.filter(unlike) {
            let key = (relation, a.label, b.label);
            let more = !matches!(relation, Relation::Artefact | Relation::Floor);
            if refused.contains(&key) || more && (whole.contains(&a.label) || whole.contains(&b.label)) {
                continue;
            }
            let holds = match relation {
                Relation::Artefact => is_ramp_of(a, b) || is_fringe_of(scene, a, b),
                Relation::Floor => is_floor_of(a, b),
                Relation::Surface => is_fragment_of(scene, segments, context, a, b),
                Relation::Attached => is_attached_to(scene, pieces, a, b),
                Relation::Inside => is_inside_of(scene, segments, context, a, b),
                Relation::OtherEnd => is_other_end(scene, segments, context, a, b),
                Relation::OnePart => is_one_with(scene, segments, context, a, b),
            };
            if holds {
                return Some((a.label, b.label, relation));
            }
            refused.insert(key);
        }
    }
    None
}

/// Whether `ramp` is the smooth rise that a depth camera draws at the foot of `whole`.
fn is_ramp_of(whole: &Piece, ramp: &Piece) -> bool {
    let touches = ramp.evidence.border_share(whole.label, &[OutlineKind::Contact, OutlineKind::Cut]);
    touches > 0.2 && ramp.top_m < 0.014_f64.min(0.3 * whole.top_m) && ramp.pixels.len() * 10 < whole.pixels.len()
}

/// Whether `fringe` is the band of depths between a thing and what is behind it that a depth camera draws along an edge:
/// nowhere thick, and cut off by the thing along one side.
fn is_fringe_of(scene: &Scene, whole: &Piece, fringe: &Piece) -> bool {
    if fringe.pixels.len() * 10 > whole.pixels.len()
        || fringe.evidence.border_share(whole.label, &[OutlineKind::Cut]) < FRINGE_CUT
    {
        return false;
    }
    let mut mask = vec![false; scene.grid.len()];
    fringe.pixels.iter().for_each(|&pixel| mask[pixel] = true);
    let thick = scene.grid.erode(&mask, 2).into_iter().filter(|inside| *inside).count();
    (thick as f64) < FRINGE_THICK * fringe.pixels.len() as f64
}

/// Whether `floor` lies within `outer`: bordered by it nearly all round, by nothing farther, and lower.
fn is_floor_of(outer: &Piece, floor: &Piece) -> bool {
    let bordered = floor.evidence.border_share(outer.label, &[OutlineKind::Cut, OutlineKind::Contact]);
    bordered > 0.6 && floor.top_m < outer.top_m + 0.005 && floor.pixels.len() < outer.pixels.len()
}

/// Whether `small` is a rim, handle or the like of `whole`: it touches it and does not rise above it, and either does
/// not reach the plane, so that it can stand on nothing else, or is a scrap of the same colour.
fn is_fragment_of(scene: &Scene, segments: &Segments, context: Context, whole: &Piece, small: &Piece) -> bool {
    let touches = small.evidence.border_share(whole.label, &[OutlineKind::Contact]);
    if touches < 0.12 || small.pixels.len() * 3 > whole.pixels.len() || small.top_m > whole.top_m + 0.005 {
        return false;
    }
    let tint = |piece: &Piece| Tint::of(&scene.scan.appearance(&piece.pixels).mean);
    let is_scrap = || small.pixels.len() * 8 < whole.pixels.len() && tint(small).distance(&tint(whole)) < 7.0;
    // What stands on the plane beside it may be a thing of its own, whose shape the one cannot take in.
    let spoils = || {
        let joint = union(scene, segments, whole, small, false);
        compare(context, &joint, whole, small).is_some_and(|both| both.together > both.apart + SPOILT)
    };
    small.lowest_m > HOVERING_M || is_scrap() && !spoils()
}

/// Whether `small` sticks out of `whole`, as a handle before a door: it is near it and no higher, and hangs in the air with
/// nothing under it to stand on, nor is it held.
fn is_attached_to(scene: &Scene, pieces: &[Piece], whole: &Piece, small: &Piece) -> bool {
    if small.pixels.len() * 3 > whole.pixels.len() || small.top_m > whole.top_m + 0.005 || small.lowest_m < CLEAR_M {
        return false;
    }
    let carries = |other: &&Piece| {
        let level = small.lowest_m - 0.03..small.lowest_m + 0.015;
        ![whole.label, small.label].contains(&other.label) && level.contains(&other.top_m)
    };
    let held = || small.pixels.iter().any(|&pixel| scene.grid.neighbours(pixel).any(|near| scene.own[near]));
    let stands = || pieces.iter().filter(carries).any(|other| other.distance_m(small) < NEAR_M);
    whole.distance_m(small) < HANDLE_M && !held() && !stands()
}

/// Whether `inner` is the inside of a hollow thing whose outside is `outer`: partly covered by it, its rim level
/// with the outer's, without a top face, and within the solid that fits the common outline.
fn is_inside_of(scene: &Scene, segments: &Segments, context: Context, outer: &Piece, inner: &Piece) -> bool {
    let covered = inner.evidence.border_share(outer.label, &[OutlineKind::Cut, OutlineKind::Contact]);
    if covered < 0.1 || (outer.top_m - inner.top_m).abs() > LEVEL_M || inner.top_share() > 0.4 || outer.lowest_m > 0.08
    {
        return false;
    }
    let joint = union(scene, segments, outer, inner, true);
    let Some(best) = fit(context, &joint, outer.lowest_m.min(inner.lowest_m)) else { return false };
    let (_, on_outline) = best.explained(&joint);
    let solids = best.model.solids(&best.minimum.state);
    let depth: Vec<f64> = inner.evidence.points.iter().map(|p| outside_m(&solids, p.position)).collect();
    let share = |limit: f64| depth.iter().filter(|d| **d < limit).count() as f64 / depth.len() as f64;
    on_outline > 0.4 && share(0.002) > 0.6 && share(0.012) > 0.8
}

/// Whether two pieces are the ends of one thing that a nearer one covers in the middle: one solid explains both
/// better than two do.
fn is_other_end(scene: &Scene, segments: &Segments, context: Context, a: &Piece, b: &Piece) -> bool {
    let cut_by =
        |piece: &Piece, label: u32| label != NONE && piece.evidence.border_share(label, &[OutlineKind::Cut]) > 0.08;
    let occluded_alike = a.evidence.outline.iter().any(|p| cut_by(a, p.beyond) && cut_by(b, p.beyond));
    if a.label > b.label || !occluded_alike || (a.top_m - b.top_m).abs() > LEVEL_M || a.lowest_m.min(b.lowest_m) > 0.03
    {
        return false;
    }
    let joint = union(scene, segments, a, b, false);
    let Some(comparison) = compare(context, &joint, a, b) else { return false };
    // Systematic errors of the sensor tell against the larger solid; two things in one line are rare.
    comparison.together < 1.5 * comparison.apart + 10.0 && comparison.on_surface > 0.9 && comparison.on_outline > 0.85
}

/// Whether two pieces that touch and look alike are parts of one thing, like a base and the lid over it: one template
/// explains both better than two do.
fn is_one_with(scene: &Scene, segments: &Segments, context: Context, a: &Piece, b: &Piece) -> bool {
    let either = [OutlineKind::Contact, OutlineKind::Cut, OutlineKind::Own];
    let touches = |piece: &Piece, other: &Piece| piece.evidence.border_share(other.label, &either) > 0.15;
    let tint = |piece: &Piece| Tint::of(&scene.scan.appearance(&piece.pixels).mean);
    if a.label > b.label || tint(a).distance(&tint(b)) > SAME_TINT {
        return false;
    }
    // Parts that are apart in the image, as the jaws of what stands open, are near each other in space.
    let touching = touches(a, b) || touches(b, a);
    if !touching && a.distance_m(b) > NEAR_M {
        return false;
    }
    let joint = union(scene, segments, a, b, false);
    let Some(comparison) = compare(context, &joint, a, b) else { return false };
    // Two things seldom lie as the parts of one do, least of all of one that is spoken of.
    let (coincidence, on_surface, on_outline) = match comparison.solids {
        1 => (0.0, 0.93, 0.85),
        _ if comparison.spoken_of => (SPOKEN_OF, SPOKEN_OF_SURFACE, SPOKEN_OF_OUTLINE),
        _ => (COINCIDENCE, 0.93, 0.85),
    };
    comparison.together < comparison.apart + coincidence
        && comparison.on_surface > on_surface
        && comparison.on_outline > on_outline
        && (touching || comparison.solids > 1)
}

/// What it costs to explain two pieces as one thing and as two, and how much the one explains.
struct Comparison {
    together: f64,
    apart: f64,
    /// Of which the one is made.
    solids: usize,
    /// Whether the one is tried only because the instruction speaks of it, or memory knows it.
    spoken_of: bool,
    on_surface: f64,
    on_outline: f64,
}

fn compare(context: Context, joint: &Evidence, a: &Piece, b: &Piece) -> Option<Comparison> {
    let apart = || rayon::join(|| fit(context, &a.evidence, 0.0), || fit(context, &b.evidence, 0.0));
    let (one, (left, right)) = rayon::join(|| fit(context, joint, 0.0), apart);
    let (one, left, right) = (one?, left?, right?);
    // The joint evidence is thinned to the same number of points: compare per independent measurement.
    let share = (a.evidence.independent() + b.evidence.independent()) / joint.independent().max(1.0);
    let (on_surface, on_outline) = one.explained(joint);
    Some(Comparison {
        together: penalised(&one, joint) * share.max(1.0),
        apart: penalised(&left, &a.evidence) + penalised(&right, &b.evidence),
        solids: one.model.solids(&one.minimum.state).len(),
        spoken_of: one.model.template.on_call,
        on_surface,
        on_outline,
    })
}

/// What it costs to explain evidence: its misfit, and the freedom that it took.
fn penalised(found: &Hypothesis, evidence: &Evidence) -> f64 {
    found.minimum.cost + 0.5 * found.minimum.state.len() as f64 * evidence.independent().max(2.0).ln()
}

/// Whether `one` explains a piece as well as its pieces are explained one by one; a coincidence speaks for it.
pub(crate) fn is_one(context: Context, one: &Hypothesis, whole: &Piece, pieces: &[Piece]) -> bool {
    let each = |piece: &Piece| Some(penalised(&fit(context, &piece.evidence, piece.lowest_m)?, &piece.evidence));
    let Some(apart) = pieces.par_iter().map(each).sum::<Option<f64>>() else { return true };
    let independent: f64 = pieces.iter().map(|piece| piece.evidence.independent()).sum();
    let share = independent / whole.evidence.independent().max(1.0);
    penalised(one, &whole.evidence) * share.max(1.0) < apart + COINCIDENCE
}

/// Whether two pieces, which are `whole` together, are two things: two templates explain them well and better than one.
pub(crate) fn apart_or_together(context: Context, whole: &Piece, a: &Piece, b: &Piece) -> bool {
    let one = |piece: &Piece| {
        let best = fit(context, &piece.evidence, piece.lowest_m)?;
        let cost = penalised(&best, &piece.evidence);
        let explained = best.explained(&piece.evidence);
        Some((cost, explained, best))
    };
    let (together, (left, right)) = rayon::join(|| one(whole), || rayon::join(|| one(a), || one(b)));
    let (Some((together, whole_explained, best)), Some((left, first, _)), Some((right, second, _))) =
        (together, left, right)
    else {
        return false;
    };
    let share = (a.evidence.independent() + b.evidence.independent()) / whole.evidence.independent().max(1.0);
    let explained = |(surface, outline): (f64, f64)| surface > PARTED_SURFACE && outline > PARTED_OUTLINE;
    // A small thing on a large one hardly counts in what is explained of both.
    let of_either = [a, b].iter().all(|half| best.explained(&half.evidence).0 > ONE_OF_EITHER);
    let well = whole_explained.0 > ONE_SURFACE && whole_explained.1 > ONE_OUTLINE && of_either;
    !well && explained(first) && explained(second) && left + right + PARTED_GAIN < together * share.max(1.0)
}

/// The evidence of two pieces as one; without the inner piece's surface if it is the inside of something hollow.
fn union(scene: &Scene, segments: &Segments, a: &Piece, b: &Piece, hollow: bool) -> Evidence {
    let mut joined = Segments { labels: segments.labels.clone(), count: segments.count, inner: segments.inner.clone() };
    for &pixel in &b.pixels {
        joined.labels[pixel] = a.label;
        joined.inner[pixel] |= hollow;
    }
    let mut pixels: Vec<usize> = a.pixels.iter().chain(&b.pixels).copied().collect();
    pixels.sort_unstable();
    Evidence::of_segment(scene, &joined, &pixels)
}

fn fit<'a>(context: Context<'a>, evidence: &Evidence, base_m: f64) -> Option<Hypothesis<'a>> {
    fits(context, evidence, base_m).into_iter().next()
}

fn fits<'a>(context: Context<'a>, evidence: &Evidence, base_m: f64) -> Vec<Hypothesis<'a>> {
    let base_m = if base_m > HOVERING_M { base_m } else { 0.0 };
    let plan: Vec<DVec2> = evidence.points.iter().map(|p| p.position.truncate()).collect();
    let height_m = evidence.top_m() - base_m;
    let measured = Measured { plan, height_m, base: Base::At(base_m), seen_by: SeenBy::Depth };
    hypotheses::rank(context, &measured, evidence)
}

fn outside_m(solids: &[PlacedSolid], point: glam::DVec3) -> f64 {
    solids.iter().map(|s| s.signed_distance(point)).fold(f64::INFINITY, f64::min)
}
