//! A frame in which all that is verified seems to have moved by one common motion: then the camera was moved, or its depth
//! is stretched, and not the world. Single poses cannot tell; that the whole constellation of things fits can (joint
//! compatibility, Neira and Tardos 2001).

use crate::{
    entry::{ObjectEntry, Presence},
    geometry::Body,
    identity::Percept,
    observation::{Displaced, Displacement},
    observe::MOVED_M,
    state::State,
};
use acm_concept::{color::Appearance, ids::ObjectId, pose::Pose, template::TemplateLibrary};
use glam::{DVec2, DVec3};
use std::collections::BTreeSet;

/// How far a thing may be from where the common motion takes it, metres: noise of a view, and tilts that are not fitted.
const FITS_M: f64 = 0.03;
/// A motion is told from fewer things only by chance.
const LEAST_MOVED: usize = 3;
/// One thing that stays in its place is a chance likeness among so many that moved in common.
const MOVED_FOR_A_STAY: usize = 4;
/// At least one in so many of the things that stand apart has to be found where the motion takes it.
const LEAST_SHARE: usize = 3;
/// A motion that is told with such a residual can be undone, metres.
const RESIDUAL_TO_UNDO_M: f64 = 0.01;
/// The things that tell a motion to undo are spread at least so widely: less does not fix its turn, metres.
const SPREAD_TO_UNDO_M: f64 = 0.1;
/// Two things nearer to each other than this do not tell a turn, metres.
const LEAST_BASE_M: f64 = 0.05;
/// Depths that are wrong by less than this are within the camera's ordinary error.
const LEAST_STRETCH: f64 = 0.03;
/// Colours nearer than this in the a-b plane, and sizes within this factor, may be one thing's.
const ALIKE_COLOR: f64 = 20.0;
const ALIKE_SIZE: f64 = 1.45;
/// Most pairs of a thing and a percept that motions are tried from.
const MAX_PAIRS: usize = 96;

/// A verified thing of which nobody expects that it moved.
struct Witness<'a> {
    position: DVec3,
    extents: [f64; 3],
    appearance: &'a Appearance,
    /// What it stands on at the bottom of its pile: things that are carried together tell of one motion only.
    pile: ObjectId,
}

/// A thing and a percept that may be its view.
#[derive(Clone, Copy)]
struct Pair {
    witness: usize,
    percept: usize,
    from: DVec3,
    to: DVec3,
}

/// A motion with the pairs that it explains.
struct Fit {
    displacement: Displacement,
    pairs: Vec<Pair>,
    residual_m: f64,
}

/// The common motion of what is verified, if all that a frame shows of it moved in common. `eye` is where the frame was
/// taken from, world, metres.
pub(crate) fn displaced(
    state: &State,
    percepts: &[Percept<'_>],
    eye: DVec3,
    library: &TemplateLibrary,
) -> Option<Displaced> {
    let witnesses = witnesses(state, library);
    let piles = |pairs: &mut dyn Iterator<Item = usize>| -> usize {
        pairs.filter_map(|at| witnesses.get(at)).map(|witness| witness.pile).collect::<BTreeSet<_>>().len()
    };
    let all = piles(&mut (0..witnesses.len()));
    if all < LEAST_MOVED {
        return None;
    }
    let pairs = pairs(&witnesses, percepts);
    let still: Vec<&Pair> = pairs.iter().filter(|pair| pair.from.distance(pair.to) <= MOVED_M).collect();
    if piles(&mut still.iter().map(|pair| pair.witness)) * (MOVED_FOR_A_STAY - 1) > all {
        return None;
    }
    let fit = best(&pairs, eye)?;
    let moves = |pair: &&Pair| moved(&fit.displacement, eye, pair.from).distance(pair.from) > MOVED_M;
    let moved = piles(&mut fit.pairs.iter().filter(moves).map(|pair| pair.witness));
    // A percept that the motion gives to another thing is no sign that this one stayed.
    let free =
        |pair: &&&Pair| !fit.pairs.iter().any(|taken| taken.percept == pair.percept && taken.witness != pair.witness);
    let stays = |pair: &&&Pair| !fit.pairs.iter().any(|found| found.witness == pair.witness);
    let stayed = piles(&mut still.iter().filter(free).filter(stays).map(|pair| pair.witness));
    if moved < LEAST_MOVED || stayed * MOVED_FOR_A_STAY > moved || moved * LEAST_SHARE < all {
        return None;
    }
    let undone = matches!(fit.displacement, Displacement::Camera(_))
        && fit.residual_m <= RESIDUAL_TO_UNDO_M
        && spread_m(&fit.pairs) >= SPREAD_TO_UNDO_M;
    Some(Displaced { by: fit.displacement, things: moved as u32, residual_m: fit.residual_m, undone })
}

/// Percepts as they would be had the camera been where it is said to be.
pub(crate) fn undo<'a>(
    displaced: &Displaced,
    percepts: Vec<Percept<'a>>,
    library: &TemplateLibrary,
) -> Vec<Percept<'a>> {
    let Displacement::Camera(motion) = displaced.by else { return percepts };
    let back = motion.inverse();
    let put_back = |mut percept: Percept<'a>| {
        for part in &mut percept.parts {
            part.pose.pose = back * part.pose.pose;
            part.pose.position_sigma_m += displaced.residual_m;
        }
        percept.pose = percept.parts.first()?.pose;
        percept.body = Body::of(&percept.parts, library)?;
        Some(percept)
    };
    percepts.into_iter().filter_map(put_back).collect()
}

/// What is verified in this run, stands where it was seen, and was not touched since, nor what it stands on.
fn witnesses<'a>(state: &'a State, library: &TemplateLibrary) -> Vec<Witness<'a>> {
    let of = |entry: &'a ObjectEntry| {
        let pile = pile(state, entry)?;
        let verified = entry.verified && entry.last_seen.episode == state.next.episode;
        let extents = Body::of(&entry.parts, library).filter(|_| verified)?.extents();
        Some(Witness { position: entry.pose()?.translation, extents, appearance: &entry.appearance, pile })
    };
    state.objects.iter().filter_map(of).collect()
}

/// The thing at the bottom of the pile in which another stands; `None` if an action may have moved any of them.
fn pile(state: &State, entry: &ObjectEntry) -> Option<ObjectId> {
    let mut at = entry;
    // No pile is higher than there are things.
    for _ in 0..=state.objects.len() {
        let track = state.track(at.id);
        if at.presence != Presence::Present || track.disturbed || track.unconfirmed.is_some() {
            return None;
        }
        match at.support.and_then(|below| state.object(below)) {
            Some(below) => at = below,
            None => return Some(at.id),
        }
    }
    None
}

/// All that may be views of the witnesses; the middle of a cut outline says nothing.
fn pairs(witnesses: &[Witness<'_>], percepts: &[Percept<'_>]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (number, witness) in witnesses.iter().enumerate() {
        for (index, percept) in percepts.iter().enumerate().filter(|(_, percept)| !percept.object.truncated) {
            let color = witness.appearance.mean.chroma_distance(&percept.object.appearance.mean) <= ALIKE_COLOR;
            let size = witness.extents.iter().zip(percept.body.extents()).all(|(known, seen)| {
                (seen.max(1e-3) / known.max(1e-3)).ln().abs() <= ALIKE_SIZE.ln() || (seen - known).abs() <= MOVED_M
            });
            if color && size {
                let to = percept.pose.pose.translation;
                pairs.push(Pair { witness: number, percept: index, from: witness.position, to });
            }
        }
    }
    pairs
}

/// Where a displacement takes a point of the world.
fn moved(displacement: &Displacement, eye: DVec3, point: DVec3) -> DVec3 {
    match displacement {
        Displacement::Camera(motion) => motion.transform_point(point),
        Displacement::Depth(stretch) => eye + *stretch * (point - eye),
    }
}

/// The motion that explains most pairs, or as many with the smaller residual.
fn best(pairs: &[Pair], eye: DVec3) -> Option<Fit> {
    let tried = pairs.get(..MAX_PAIRS.min(pairs.len()))?;
    let stretches = tried.iter().filter_map(|pair| stretch(std::slice::from_ref(pair), eye));
    let motions = tried.iter().enumerate().flat_map(|(at, a)| {
        tried.iter().skip(at + 1).filter_map(move |b| {
            let apart = (a.from.distance(b.from) - a.to.distance(b.to)).abs();
            (a.witness != b.witness && a.percept != b.percept && apart <= FITS_M).then(|| motion(&[*a, *b])).flatten()
        })
    });
    let mut best: Option<Fit> = None;
    for displacement in stretches.map(Displacement::Depth).chain(motions.map(Displacement::Camera)) {
        let Some(fit) = refined(displacement, pairs, eye) else { continue };
        let better = best.as_ref().is_none_or(|best| {
            (fit.pairs.len(), -fit.residual_m).partial_cmp(&(best.pairs.len(), -best.residual_m))
                == Some(std::cmp::Ordering::Greater)
        });
        if better {
            best = Some(fit);
        }
    }
    best
}

/// A displacement fitted to all that it explains, and what it explains then.
fn refined(displacement: Displacement, pairs: &[Pair], eye: DVec3) -> Option<Fit> {
    let first = explained(&displacement, pairs, eye);
    if first.len() < LEAST_MOVED {
        return None;
    }
    let displacement = match displacement {
        Displacement::Camera(_) => Displacement::Camera(motion(&first)?),
        Displacement::Depth(_) => Displacement::Depth(stretch(&first, eye)?),
    };
    let pairs = explained(&displacement, pairs, eye);
    let squares: f64 = pairs.iter().map(|pair| moved(&displacement, eye, pair.from).distance_squared(pair.to)).sum();
    let residual_m = (squares / pairs.len().max(1) as f64).sqrt();
    (pairs.len() >= LEAST_MOVED).then_some(Fit { displacement, pairs, residual_m })
}

/// The pairs within reach of a displacement, each thing and each percept once, the nearest first.
fn explained(displacement: &Displacement, pairs: &[Pair], eye: DVec3) -> Vec<Pair> {
    let off = |pair: &Pair| moved(displacement, eye, pair.from).distance(pair.to);
    let mut near: Vec<(f64, Pair)> =
        pairs.iter().map(|pair| (off(pair), *pair)).filter(|(off, _)| *off <= FITS_M).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut taken: Vec<Pair> = Vec::new();
    for (_, pair) in near {
        if !taken.iter().any(|other| other.witness == pair.witness || other.percept == pair.percept) {
            taken.push(pair);
        }
    }
    taken
}

/// The upright motion that takes the pairs' first points nearest to their second ones; `None` where they tell no turn.
fn motion(pairs: &[Pair]) -> Option<Pose> {
    let count = pairs.len() as f64;
    let mean = |of: fn(&Pair) -> DVec3| pairs.iter().map(of).sum::<DVec3>() / count;
    let (from, to) = (mean(|pair| pair.from), mean(|pair| pair.to));
    let (mut along, mut across, mut base) = (0.0, 0.0, 0.0f64);
    for pair in pairs {
        let (a, b): (DVec2, DVec2) = ((pair.from - from).truncate(), (pair.to - to).truncate());
        (along, across, base) = (along + a.dot(b), across + a.perp_dot(b), base.max(a.length()));
    }
    let turn = Pose::from_yaw(DVec3::ZERO, across.atan2(along));
    (2.0 * base >= LEAST_BASE_M).then(|| Pose { translation: to - turn.transform_vector(from), ..turn })
}

/// The factor on depth that takes the pairs' first points nearest to their second ones; `None` if depths are right.
fn stretch(pairs: &[Pair], eye: DVec3) -> Option<f64> {
    let sums = pairs.iter().map(|pair| ((pair.to - eye).dot(pair.from - eye), (pair.from - eye).length_squared()));
    let (product, square) = sums.fold((0.0, 0.0), |sum, next| (sum.0 + next.0, sum.1 + next.1));
    let stretch = product / square;
    (stretch.is_finite() && (stretch - 1.0).abs() >= LEAST_STRETCH).then_some(stretch)
}

/// How far the outermost of the things is from their middle, metres.
fn spread_m(pairs: &[Pair]) -> f64 {
    let middle = pairs.iter().map(|pair| pair.from).sum::<DVec3>() / pairs.len().max(1) as f64;
    pairs.iter().map(|pair| pair.from.distance(middle)).fold(0.0, f64::max)
}
