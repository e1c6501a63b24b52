//! The comparison of a frame with what memory expects to see in it.

mod cut;

pub(crate) use cut::{merge, split};

use crate::{raster, scan::Tint, scene::Scene};
use acm_concept::{
    color::Appearance,
    expectation::{Expectation, ExpectedObject},
    ids::ObjectId,
    object::{ExpectedView, GroundedObject, GroundedPart, SupportPlane, Visibility},
    pose::Pose,
    solid::PlacedSolid,
    template::{SeenBy, TemplateLibrary},
};
use glam::DVec3;
use rayon::prelude::*;

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

/// One expected object, ray-cast.
pub(crate) struct Ghost {
    pub id: ObjectId,
    main: Option<GroundedPart>,
    pub appearance: Appearance,
    pub views: u32,
    pub held: bool,
    /// Whether the robot put it there.
    pub was_put: bool,
    pub solids: Vec<PlacedSolid>,
    /// Told by its colour alone.
    pub flat: bool,
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
    /// Whether it was seen often enough, or put there, that its parameters need not be measured anew.
    pub settled: bool,
}

impl Ghost {
    /// What memory expects here; nothing of a thing without parts.
    pub fn known(&self) -> Option<Known<'_>> {
        let part = self.main.as_ref()?;
        Some(Known { part, settled: self.was_put || self.views >= SETTLED_VIEWS })
    }
    /// Its predicted pixels in which it is seen, ascending.
    pub fn agreeing(&self) -> impl Iterator<Item = usize> + '_ {
        self.votes.iter().filter(|(_, vote)| *vote == Vote::Agrees).map(|(pixel, _)| *pixel)
    }
    /// In how many of its pixels it is seen, and through how many the camera looks.
    pub fn agreement(&self) -> (usize, usize) {
        let count = |vote| self.votes.iter().filter(|(_, v)| *v == vote).count();
        (count(Vote::Agrees), count(Vote::Farther))
    }
    /// Whether it is seen where it is expected.
    pub fn is_seen(&self) -> bool {
        view(self).visibility == Visibility::Seen
    }
    /// Signed distance of a point of the world from its surface, metres.
    pub fn distance_m(&self, point: DVec3) -> f64 {
        self.solids.iter().map(|solid| solid.signed_distance(point)).fold(f64::INFINITY, f64::min)
    }
}

/// The expected objects, ray-cast into the frame and compared with it.
pub(crate) struct Remembered {
    pub ghosts: Vec<Ghost>,
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
                appearance: object.appearance,
                views: object.views,
                held: object.held,
                was_put: object.was_put,
                flat,
                in_view: cast.in_view,
                votes: cast.hits.into_iter().map(vote).collect(),
                solids,
            }
        };
        let ghosts: Vec<Ghost> = expectation.objects.par_iter().map(ghost).collect();
        let elsewhere = ghosts.iter().filter(|ghost| !ghost.is_seen());
        Remembered { displaced: elsewhere.filter_map(|ghost| ghost.main.clone()).collect(), ghosts }
    }

    /// The expected object that explains these pixels (ascending) best, if one explains most of them or is mostly
    /// covered by them.
    pub fn at(&self, pixels: &[usize], seen_by: SeenBy) -> Option<Known<'_>> {
        let flat = seen_by == SeenBy::Color;
        let explained = |ghost: &Ghost| {
            let agrees = ghost.agreeing().filter(|pixel| pixels.binary_search(pixel).is_ok());
            agrees.count() as f64 / pixels.len().max(1) as f64
        };
        let candidates = self.ghosts.iter().filter(|ghost| ghost.flat == flat);
        let (best, ghost) = candidates.map(|ghost| (explained(ghost), ghost)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        ghost.known().filter(|_| best > EXPLAINED || overlap(ghost, pixels) > SAME_OVERLAP)
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
    let (mut common, mut visible, mut rest) = (0usize, 0usize, pixels.iter().peekable());
    for (pixel, _) in ghost.votes.iter().filter(|(_, vote)| *vote != Vote::Nearer) {
        visible += 1;
        while rest.next_if(|own| *own < pixel).is_some() {}
        common += usize::from(rest.peek() == Some(&pixel));
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
    let tolerance = tolerance_m(scene, measured, held);
    if measured < predicted - tolerance {
        Vote::Nearer
    } else if measured > predicted + tolerance {
        Vote::Farther
    } else {
        Vote::Agrees
    }
}

/// How far what is where it is expected may be from there, at a measured depth: errors of places and noise, metres.
pub(crate) fn tolerance_m(scene: &Scene, measured: f64, held: bool) -> f64 {
    let place_m = if held { 0.03 } else { 0.01 };
    place_m + 2.5 * scene.config.depth_sigma_m(measured)
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
