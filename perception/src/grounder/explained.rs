//! What stands on the plane as memory expects it. It is fitted on its own pixels, and only the rest is cut into things.

use super::bases::{Bodies, OFF_THE_PLANE_M};
use crate::{
    expected::{self, Ghost, Known, Remembered},
    fit::Evidence,
    hypotheses::{self, Context, Hypothesis, Measured},
    scan::Tint,
    scene::Scene,
    segments::{NONE, Segments},
};
use acm_concept::{ids::ObjectId, template::SeenBy};
use glam::DVec2;
use rayon::prelude::*;

/// Neighbours that are farther apart in depth are not of one blob, metres.
const STEP_M: f32 = 0.012;
/// A thing is expected in a blob where it finds so many pixels as predicted, or so much of what is visible of it.
const CLAIM_PX: usize = 60;
const CLAIM_SHARE: f64 = 0.2;
/// Share of what is visible of a thing that is where it was, before its place is fitted anew.
const IN_PLACE: f64 = 0.6;
/// Pixels that no known thing accounts for are noise of edges as long as they are nowhere thicker than this (half widths),
/// but for a few.
const EDGE_PX: usize = 2;
const FEW_PX: usize = 8;
/// The mean tint of a thing is the remembered one within this; single pixels within this and so many times its spread.
const SAME_TINT: f32 = 8.0;
const ODD_TINT: f32 = 14.0;
const ODD_SPREADS: f32 = 2.0;

/// A known thing that was found where memory expects it, with the fit that says so.
pub(super) struct Explained<'a> {
    pub id: ObjectId,
    pub known: Known<'a>,
    /// Its segment, once there are segments.
    pub label: u32,
    /// Its pixels, ascending.
    pub pixels: Vec<usize>,
    pub evidence: Evidence,
    pub fit: Hypothesis<'a>,
}

/// The things of memory that explain what stands in their place, pixel by pixel and by a fit: not one that was moved,
/// opened, replaced by something else, or that something new touches.
pub(super) fn find<'a>(scene: &Scene, context: Context<'a>, remembered: &'a Remembered) -> Vec<Explained<'a>> {
    let ghosts: Vec<&Ghost> = remembered.ghosts.iter().filter(|ghost| is_in_place(ghost)).collect();
    if ghosts.is_empty() {
        return Vec::new();
    }
    let (segments, explains) = claims(scene, &ghosts);
    let claimed: Vec<(usize, Vec<usize>)> =
        segments.pixels().into_iter().take(ghosts.len()).enumerate().filter(|(at, _)| explains[*at]).collect();
    let mut pieces: Vec<(f64, usize, Vec<usize>, Evidence)> = claimed
        .into_par_iter()
        .filter(|(at, pixels)| has_its_colors(scene, ghosts[*at], pixels))
        .map(|(at, pixels)| {
            let evidence = Evidence::of_segment(scene, &segments, &pixels);
            (scene.lowest_m(&pixels), at, pixels, evidence)
        })
        .collect();
    // From below, so that what stands on another thing finds it.
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut bodies = Bodies::default();
    for flat in remembered.ghosts.iter().filter(|ghost| ghost.flat && ghost.is_seen()) {
        bodies.add_lying(scene, &flat.solids);
    }
    let fit = |bodies: &Bodies, (lowest_m, at, pixels, evidence): (f64, usize, Vec<usize>, Evidence)| {
        let known = ghosts[at].known()?;
        let plan: Vec<DVec2> = evidence.points.iter().map(|p| p.position.truncate()).collect();
        let base = bodies.base_under(&plan, lowest_m, &evidence);
        let measured = Measured { plan, height_m: 0.0, base, seen_by: SeenBy::Depth };
        let fit = hypotheses::recognise(Context { remembered: Some(known), ..context }, &measured, &evidence)?;
        Some(Explained { id: ghosts[at].id, known, label: NONE, pixels, evidence, fit })
    };
    let above = pieces.split_off(pieces.partition_point(|piece| piece.0 < OFF_THE_PLANE_M));
    let mut found: Vec<Explained> = pieces.into_par_iter().filter_map(|piece| fit(&bodies, piece)).collect();
    found.iter().for_each(|thing| bodies.add(std::slice::from_ref(&thing.fit)));
    for piece in above {
        if let Some(thing) = fit(&bodies, piece) {
            bodies.add(std::slice::from_ref(&thing.fit));
            found.push(thing);
        }
    }
    found
}

/// Whether most of what is visible of a thing is where memory expects it. What was seen but a few times is measured anew,
/// beginning from the evidence: begun from memory's sizes its views would agree with memory more than they tell.
fn is_in_place(ghost: &Ghost) -> bool {
    let (agrees, differs) = ghost.agreement();
    !ghost.flat
        && !ghost.held
        && ghost.known().is_some_and(|known| known.settled)
        && agrees as f64 > IN_PLACE * (agrees + differs) as f64
        && agrees >= CLAIM_PX
}

/// The blobs of what stands on the plane, cut where two known things touch, and whether each of the known things explains
/// all that stands in its place. Known things have the first labels; what they do not explain has others, as their neighbour.
fn claims(scene: &Scene, ghosts: &[&Ghost]) -> (Segments, Vec<bool>) {
    let near = |a: usize, b: usize| (scene.scan.smooth[a] - scene.scan.smooth[b]).abs() < STEP_M;
    let (blobs, sizes) = scene.grid.components(&scene.rising, near);
    let mut claiming: Vec<Vec<usize>> = vec![Vec::new(); sizes.len()];
    for (at, ghost) in ghosts.iter().enumerate() {
        let mut agreeing = vec![0usize; sizes.len()];
        ghost.agreeing().filter(|&pixel| blobs[pixel] != NONE).for_each(|pixel| agreeing[blobs[pixel] as usize] += 1);
        let visible = ghost.agreement().0;
        for (blob, &count) in agreeing.iter().enumerate() {
            if count >= CLAIM_PX || count as f64 > CLAIM_SHARE * visible as f64 {
                claiming[blob].push(at);
            }
        }
    }
    // Which known thing each pixel is of: the nearest, if that is near enough.
    let to_world = scene.world;
    let of = |pixel: usize| -> Option<usize> {
        let claiming = claiming.get(blobs[pixel] as usize)?;
        let point = to_world.transform_point(scene.point[pixel].as_dvec3());
        let distance = |&at: &usize| (at, ghosts[at].distance_m(point));
        let (at, off) = claiming.iter().map(distance).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let tolerance = expected::tolerance_m(scene, f64::from(scene.scan.smooth[pixel]), false);
        (off.abs() < tolerance).then_some(at)
    };
    let owner: Vec<Option<usize>> = scene.grid.map(of);
    let mut strange = vec![0usize; sizes.len()];
    for pixel in (0..owner.len()).filter(|&pixel| blobs[pixel] != NONE && owner[pixel].is_none()) {
        let blob = blobs[pixel];
        if !claiming[blob as usize].is_empty()
            && is_thick(scene, pixel, |near| blobs[near] == blob && owner[near].is_none())
        {
            strange[blob as usize] += 1;
        }
    }
    // What shares a blob with something strange may be larger than it was, and what shares one with that may be too.
    let mut explains = vec![true; ghosts.len()];
    loop {
        let doubtful = |blob: &usize| strange[*blob] > FEW_PX || claiming[*blob].iter().any(|&at| !explains[at]);
        let dropped: Vec<usize> = (0..sizes.len()).filter(doubtful).flat_map(|blob| claiming[blob].clone()).collect();
        if dropped.iter().all(|&at| !explains[at]) {
            break;
        }
        dropped.into_iter().for_each(|at| explains[at] = false);
    }
    let label = |pixel: usize| match blobs[pixel] {
        NONE => NONE,
        blob => match claiming[blob as usize].as_slice() {
            [first, rest @ ..] if explains[*first] => {
                let own = if rest.is_empty() { Some(*first) } else { owner[pixel] };
                own.map_or(NONE, |at| at as u32)
            }
            _ => ghosts.len() as u32 + blob,
        },
    };
    let labels = scene.grid.map(label);
    let inner = vec![false; labels.len()];
    (Segments { count: ghosts.len() + sizes.len(), labels, inner }, explains)
}

/// Whether something holds of a pixel and of the square round it.
fn is_thick(scene: &Scene, pixel: usize, holds: impl Fn(usize) -> bool) -> bool {
    let reach = EDGE_PX as isize;
    (-reach..=reach).all(|dy| (-reach..=reach).all(|dx| scene.grid.offset(pixel, dx, dy).is_some_and(&holds)))
}

/// Whether some pixels have a thing's colours: all of them together, and each patch of them.
pub(super) fn has_its_colors(scene: &Scene, ghost: &Ghost, pixels: &[usize]) -> bool {
    let remembered = Tint::of(&ghost.appearance.mean);
    if pixels.is_empty() || Tint::of(&scene.scan.appearance(pixels).mean).distance(&remembered) > SAME_TINT {
        return false;
    }
    let limit = ODD_TINT + ODD_SPREADS * ghost.appearance.spread as f32;
    let odd = |pixel: usize| scene.scan.tint(pixel).distance(&remembered) > limit;
    let is_own = |pixel: usize| pixels.binary_search(&pixel).is_ok();
    let patches =
        pixels.iter().filter(|&&pixel| odd(pixel) && is_thick(scene, pixel, |near| odd(near) && is_own(near)));
    patches.count() <= FEW_PX
}
