//! The comparison of a frame with what memory expects to see in it.

use crate::{
    raster::{self, Cast},
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
    template::TemplateLibrary,
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
/// Expected objects split a segment if each finds at least so many of its pixels in it, and so much of itself.
const SPLIT_PX: usize = 60;
const SPLIT_SHARE: f64 = 0.4;

/// One expected object, ray-cast.
struct Ghost {
    id: ObjectId,
    template: Option<String>,
    appearance: Appearance,
    solids: Vec<PlacedSolid>,
    flat: bool,
    held: bool,
    cast: Cast,
}

/// The expected objects, ray-cast into the frame.
pub(crate) struct Remembered {
    ghosts: Vec<Ghost>,
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
    pub fn cast(scene: &Scene, camera_pose: &Pose, expectation: &Expectation, library: &TemplateLibrary) -> Remembered {
        let ghost = |object: &ExpectedObject| {
            let solids = solids(&object.parts, library);
            let cast = raster::cast(&scene.scan.intrinsics, scene.grid, camera_pose, &solids);
            Ghost {
                id: object.id,
                template: object.parts.first().map(|part| part.template.clone()),
                appearance: object.appearance,
                flat: is_flat(&solids),
                held: object.held,
                solids,
                cast,
            }
        };
        Remembered { ghosts: expectation.objects.iter().map(ghost).collect() }
    }

    /// The template of the expected object that covers these pixels (ascending) best.
    pub fn template_at(&self, pixels: &[usize]) -> Option<&str> {
        let overlaps = self.ghosts.iter().map(|ghost| (overlap(ghost, pixels), ghost));
        let (best, ghost) = overlaps.max_by(|a, b| a.0.total_cmp(&b.0))?;
        ghost.template.as_deref().filter(|_| best > SAME_OVERLAP)
    }
}

/// The solids of parts in the world; parts of unknown templates have none.
pub(crate) fn solids(parts: &[GroundedPart], library: &TemplateLibrary) -> Vec<PlacedSolid> {
    let of_part = |part: &GroundedPart| {
        let local = library.get(&part.template).and_then(|t| t.solids(&part.values()).ok()).unwrap_or_default();
        let place = part.pose.pose;
        local.into_iter().map(move |s| PlacedSolid { solid: s.solid, pose: place * s.pose }).collect::<Vec<_>>()
    };
    parts.iter().flat_map(of_part).collect()
}

fn is_flat(solids: &[PlacedSolid]) -> bool {
    !solids.is_empty() && solids.iter().all(|s| 2.0 * s.solid.half_extents().z < FLAT_M)
}

/// Intersection over union of a ghost's pixels with a percept's (ascending).
fn overlap(ghost: &Ghost, pixels: &[usize]) -> f64 {
    let common = ghost.cast.hits.iter().filter(|(pixel, _)| pixels.binary_search(pixel).is_ok()).count();
    let union = ghost.cast.hits.len() + pixels.len() - common;
    common as f64 / union.max(1) as f64
}

fn vote(scene: &Scene, ghost: &Ghost, pixel: usize, predicted: f64) -> Vote {
    if scene.own[pixel] {
        return Vote::Nearer;
    }
    let measured = f64::from(scene.scan.smooth[pixel]);
    if measured == 0.0 {
        return Vote::Unmeasured;
    }
    let place_m = if ghost.held { 0.03 } else { 0.01 };
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
fn flat_vote(scene: &Scene, ghost: &Ghost, support: &SupportPlane, pixel: usize) -> Vote {
    if scene.own[pixel] || scene.rising[pixel] {
        return Vote::Nearer;
    }
    let (own, bare) = (Tint::of(&ghost.appearance.mean), Tint::of(&support.appearance.mean));
    if !scene.is_known(pixel) || own.distance(&bare) < 8.0 {
        return Vote::Unmeasured;
    }
    let here = scene.scan.tint(pixel);
    if here.distance(&own) < here.distance(&bare) { Vote::Agrees } else { Vote::Farther }
}

/// The verdicts on all expected objects.
pub(crate) fn views(scene: &Scene, remembered: &Remembered, support: &SupportPlane) -> Vec<ExpectedView> {
    remembered.ghosts.iter().map(|ghost| view(scene, ghost, support)).collect()
}

fn view(scene: &Scene, ghost: &Ghost, support: &SupportPlane) -> ExpectedView {
    let total = ghost.cast.hits.len();
    let answer = |visibility, fraction| ExpectedView { object: ghost.id, visibility, fraction };
    if total < 12 || ghost.cast.in_view < IN_VIEW {
        return answer(Visibility::OutOfView, 1.0 - ghost.cast.in_view);
    }
    let mut votes = [0usize; 4];
    for &(pixel, predicted) in &ghost.cast.hits {
        let vote =
            if ghost.flat { flat_vote(scene, ghost, support, pixel) } else { vote(scene, ghost, pixel, predicted) };
        votes[vote as usize] += 1;
    }
    let [agrees, nearer, farther, unmeasured] = votes.map(|count| count as f64 / total as f64);
    if agrees + farther >= DECIDED {
        return if agrees >= farther {
            answer(Visibility::Seen, agrees)
        } else {
            answer(Visibility::SeenThrough, farther)
        };
    }
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

/// Cuts segments in which two or more expected objects are found, each pixel going to the nearest of them.
pub(crate) fn split(scene: &Scene, remembered: &Remembered, segments: &mut Segments) {
    let mut found: BTreeMap<u32, Vec<&Ghost>> = BTreeMap::new();
    for ghost in remembered.ghosts.iter().filter(|ghost| !ghost.flat) {
        let mut agreeing: BTreeMap<u32, usize> = BTreeMap::new();
        let mut visible = 0usize;
        for &(pixel, predicted) in &ghost.cast.hits {
            let vote = vote(scene, ghost, pixel, predicted);
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
