//! The comparison of a frame with what memory expects to see in it.

use crate::{
    raster,
    scan::Tint,
    scene::Scene,
    segments::{NONE, Segments},
};
use acm_concept::{
    color::Appearance,
    expectation::{Expectation, ExpectedObject},
    ids::ObjectId,
    object::{ExpectedView, GroundedObject, GroundedPart, SupportPlane, Visibility},
    pose::Pose,
    solid::PlacedSolid,
    template::{SeenBy, TemplateLibrary},
};
use std::collections::BTreeMap;

/// Solids thinner than this lie in the plane for the depth camera: colour decides.
const FLAT_M: f64 = 0.006;
/// Below this share of its area on the sensor an object is out of view.
const IN_VIEW: f64 = 0.25;
/// A verdict of seen or seen through needs this share of the predicted pixels.
const DECIDED: f64 = 0.25;
/// Least overlap (intersection over union) of a percept with an expected object that is called the same.
const SAME_OVERLAP: f64 = 0.25;
/// A percept is taken for what is expected if that explains so much of it.
const EXPLAINED: f64 = 0.6;
/// From so many views on a thing's parameters are taken as known while they explain what is seen.
const SETTLED_VIEWS: u32 = 6;
/// An expected object claims a segment of which it explains so much.
const CLAIMED: f64 = 0.75;
/// Expected objects split a segment if each finds at least so many of its pixels in it, and so much of itself.
const SPLIT_PX: usize = 60;
const SPLIT_SHARE: f64 = 0.4;

/// One expected object, ray-cast.
struct Ghost {
    id: ObjectId,
    main: Option<GroundedPart>,
    views: u32,
    solids: Vec<PlacedSolid>,
    flat: bool,
    /// Share of it that the sensor covers.
    in_view: f64,
    /// Its predicted pixels, ascending, and what each says.
    votes: Vec<(usize, Vote)>,
}

/// What memory expects where something was found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known<'a> {
    /// The main part.
    pub part: &'a GroundedPart,
    /// Whether it was seen often enough that its parameters need not be measured anew.
    pub settled: bool,
}

/// The expected objects, ray-cast into the frame and compared with it.
pub(crate) struct Remembered {
    ghosts: Vec<Ghost>,
    /// The main parts of those that are not seen where they are expected.
    pub displaced: Vec<GroundedPart>,
}

/// What one predicted pixel says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Vote {
    Agrees,
    Nearer,
    Farther,
    Unmeasured,
}

impl Remembered {
    pub fn cast(
        scene: &Scene,
        camera_pose: &Pose,
        support: &SupportPlane,
        expectation: &Expectation,
        library: &TemplateLibrary,
    ) -> Remembered {
        let ghost = |object: &ExpectedObject| {
            let solids = solids(&object.parts, library);
            let flat = is_flat(&solids);
            let cast = raster::cast(&scene.scan.intrinsics, scene.grid, camera_pose, &solids);
            let vote = |(pixel, depth): (usize, f64)| {
                let vote = if flat {
                    flat_vote(scene, &object.appearance, support, pixel)
                } else {
                    depth_vote(scene, object.held, pixel, depth)
                };
                (pixel, vote)
            };
            Ghost {
                id: object.id,
                main: object.parts.first().cloned(),
                views: object.views,
                flat,
                in_view: cast.in_view,
                votes: cast.hits.into_iter().map(vote).collect(),
                solids,
            }
        };
        let ghosts: Vec<Ghost> = expectation.objects.iter().map(ghost).collect();
        let elsewhere = ghosts.iter().filter(|ghost| view(ghost).visibility != Visibility::Seen);
        Remembered { displaced: elsewhere.filter_map(|ghost| ghost.main.clone()).collect(), ghosts }
    }

    /// The expected object that explains these pixels (ascending) best, if one explains most of them or is mostly
    /// covered by them.
    pub fn at(&self, pixels: &[usize], seen_by: SeenBy) -> Option<Known<'_>> {
        let flat = seen_by == SeenBy::Color;
        let explained = |ghost: &Ghost| {
            let agrees = |(pixel, vote): &&(usize, Vote)| *vote == Vote::Agrees && pixels.binary_search(pixel).is_ok();
            ghost.votes.iter().filter(agrees).count() as f64 / pixels.len().max(1) as f64
        };
        let candidates = self.ghosts.iter().filter(|ghost| ghost.flat == flat);
        let (best, ghost) = candidates.map(|ghost| (explained(ghost), ghost)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        let part = ghost.main.as_ref().filter(|_| best > EXPLAINED || overlap(ghost, pixels) > SAME_OVERLAP)?;
        Some(Known { part, settled: ghost.views >= SETTLED_VIEWS })
    }
}

/// The solids of parts in the world; parts of unknown templates have none.
pub(crate) fn solids(parts: &[GroundedPart], library: &TemplateLibrary) -> Vec<PlacedSolid> {
    let of_part = |part: &GroundedPart| {
        let local = library.solids_of(part).unwrap_or_default();
        let place = part.pose.pose;
        local.into_iter().map(move |s| PlacedSolid { solid: s.solid, pose: place * s.pose }).collect::<Vec<_>>()
    };
    parts.iter().flat_map(of_part).collect()
}

fn is_flat(solids: &[PlacedSolid]) -> bool {
    !solids.is_empty() && solids.iter().all(|s| 2.0 * s.solid.half_extents().z < FLAT_M)
}

/// Intersection over union of a ghost's pixels, those that something nearer covers left out, with a percept's
/// (ascending).
fn overlap(ghost: &Ghost, pixels: &[usize]) -> f64 {
    let (mut common, mut visible) = (0usize, 0usize);
    for (pixel, _) in ghost.votes.iter().filter(|(_, vote)| *vote != Vote::Nearer) {
        visible += 1;
        common += usize::from(pixels.binary_search(pixel).is_ok());
    }
    common as f64 / (visible + pixels.len() - common).max(1) as f64
}

fn depth_vote(scene: &Scene, held: bool, pixel: usize, predicted: f64) -> Vote {
    if scene.own[pixel] {
        return Vote::Nearer;
    }
    let measured = f64::from(scene.scan.smooth[pixel]);
    if measured == 0.0 {
        return Vote::Unmeasured;
    }
    let place_m = if held { 0.03 } else { 0.01 };
    let tolerance = place_m + 2.5 * scene.config.depth_sigma_m(measured);
    if measured < predicted - tolerance {
        Vote::Nearer
    } else if measured > predicted + tolerance {
        Vote::Farther
    } else {
        Vote::Agrees
    }
}

/// The vote of a pixel on something flat: whether the surface there has its colour or the bare surface's.
fn flat_vote(scene: &Scene, appearance: &Appearance, support: &SupportPlane, pixel: usize) -> Vote {
    if scene.own[pixel] || scene.rising[pixel] {
        return Vote::Nearer;
    }
    let (own, bare) = (Tint::of(&appearance.mean), Tint::of(&support.appearance.mean));
    if !scene.is_known(pixel) || own.distance(&bare) < 8.0 {
        return Vote::Unmeasured;
    }
    let here = scene.scan.tint(pixel);
    if here.distance(&own) < here.distance(&bare) { Vote::Agrees } else { Vote::Farther }
}

/// The verdicts on all expected objects.
pub(crate) fn views(remembered: &Remembered) -> Vec<ExpectedView> {
    remembered.ghosts.iter().map(view).collect()
}

fn view(ghost: &Ghost) -> ExpectedView {
    let total = ghost.votes.len();
    let answer = |visibility, fraction| ExpectedView { object: ghost.id, visibility, fraction };
    if total < 12 || ghost.in_view < IN_VIEW {
        return answer(Visibility::OutOfView, 1.0 - ghost.in_view);
    }
    let share = |vote| ghost.votes.iter().filter(|(_, v)| *v == vote).count() as f64 / total as f64;
    let (agrees, farther) = (share(Vote::Agrees), share(Vote::Farther));
    if agrees + farther >= DECIDED {
        return if agrees >= farther {
            answer(Visibility::Seen, agrees)
        } else {
            answer(Visibility::SeenThrough, farther)
        };
    }
    let (nearer, unmeasured) = (share(Vote::Nearer), share(Vote::Unmeasured));
    if nearer >= unmeasured {
        answer(Visibility::Occluded, nearer)
    } else {
        answer(Visibility::NotMeasured, unmeasured)
    }
}

/// The verdicts of a blind frame.
pub(crate) fn unseen(expectation: &Expectation) -> Vec<ExpectedView> {
    let view = |object: &ExpectedObject| ExpectedView {
        object: object.id,
        visibility: Visibility::NotMeasured,
        fraction: 1.0,
    };
    expectation.objects.iter().map(view).collect()
}

/// Writes into each object the expected one that explains its pixels: one to one, best overlaps first.
pub(crate) fn hint(remembered: &Remembered, objects: &mut [GroundedObject], library: &TemplateLibrary) {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, object) in objects.iter().enumerate() {
        let (pixels, flat) = (object.support.indices(), is_flat(&solids(&object.parts, library)));
        for (j, ghost) in remembered.ghosts.iter().enumerate().filter(|(_, ghost)| ghost.flat == flat) {
            let overlap = overlap(ghost, &pixels);
            if overlap > SAME_OVERLAP {
                pairs.push((overlap, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut taken = vec![false; remembered.ghosts.len()];
    for (_, object, ghost) in pairs {
        if objects[object].expected.is_none() && !taken[ghost] {
            objects[object].expected = Some(remembered.ghosts[ghost].id);
            taken[ghost] = true;
        }
    }
}

/// Joins segments that one expected object explains: pieces of one thing between which noise has drawn an edge.
pub(crate) fn merge(remembered: &Remembered, segments: &mut Segments) {
    let mut size = vec![0usize; segments.count];
    for label in segments.labels.iter().filter(|label| **label != NONE) {
        size[*label as usize] += 1;
    }
    let mut claimed = vec![false; segments.count];
    for ghost in remembered.ghosts.iter().filter(|ghost| !ghost.flat) {
        let mut agreeing = vec![0usize; size.len()];
        for (pixel, _) in ghost.votes.iter().filter(|(_, vote)| *vote == Vote::Agrees) {
            if let Some(count) = agreeing.get_mut(segments.labels[*pixel] as usize) {
                *count += 1;
            }
        }
        let claims = |label: &usize| agreeing[*label] > 0 && agreeing[*label] as f64 > CLAIMED * size[*label] as f64;
        let pieces: Vec<usize> = (0..size.len()).filter(|label| !claimed[*label]).filter(claims).collect();
        let Some((&whole, rest)) = pieces.split_first() else { continue };
        for label in segments.labels.iter_mut().filter(|label| rest.contains(&(**label as usize))) {
            *label = whole as u32;
        }
        for label in pieces {
            claimed[label] = true;
        }
    }
}

/// Cuts segments in which two or more expected objects are found, each pixel going to the nearest of them.
pub(crate) fn split(scene: &Scene, remembered: &Remembered, segments: &mut Segments) {
    let mut found: BTreeMap<u32, Vec<&Ghost>> = BTreeMap::new();
    for ghost in remembered.ghosts.iter().filter(|ghost| !ghost.flat) {
        let mut agreeing: BTreeMap<u32, usize> = BTreeMap::new();
        let mut visible = 0usize;
        for &(pixel, vote) in &ghost.votes {
            visible += usize::from(vote != Vote::Nearer);
            if vote == Vote::Agrees && segments.labels[pixel] != NONE {
                *agreeing.entry(segments.labels[pixel]).or_insert(0) += 1;
            }
        }
        let enough = |(_, count): &(u32, usize)| *count >= SPLIT_PX && *count as f64 > SPLIT_SHARE * visible as f64;
        if let Some((label, _)) = agreeing.into_iter().max_by_key(|(_, count)| *count).filter(enough) {
            found.entry(label).or_default().push(ghost);
        }
    }
    let to_world = scene.world;
    for (label, ghosts) in found.into_iter().filter(|(_, ghosts)| ghosts.len() > 1) {
        let first = segments.count as u32;
        segments.count += ghosts.len();
        for pixel in 0..segments.labels.len() {
            if segments.labels[pixel] != label {
                continue;
            }
            let point = to_world.transform_point(scene.point[pixel].as_dvec3());
            let distance =
                |ghost: &&Ghost| ghost.solids.iter().map(|s| s.signed_distance(point)).fold(f64::INFINITY, f64::min);
            let nearest = ghosts.iter().map(distance).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((i, _)) = nearest.filter(|(_, d)| *d < 0.02) {
                segments.labels[pixel] = first + i as u32;
            }
        }
    }
}
