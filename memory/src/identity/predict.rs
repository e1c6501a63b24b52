//! Where each remembered object may be now: the transitions and the present frame's evidence of absence applied.

use crate::{
    entry::{ObjectEntry, Presence},
    event::Track,
    geometry::Body,
    state::State,
};
use acm_concept::{
    ids::ObjectId,
    object::{ExpectedView, GroundedPart, Visibility},
    pose::Pose,
    template::TemplateLibrary,
};
use glam::DVec3;
use std::collections::BTreeMap;

/// Systematic error between two views of the same thing, metres: calibration and depth bias differ with the view.
pub(crate) const VIEW_SIGMA_M: DVec3 = DVec3::new(0.005, 0.005, 0.007);
/// Uncertainty of where the hand carries or leaves a thing, metres.
pub(crate) const HAND_SIGMA_M: f64 = 0.012;
/// Uncertainty of a thing's place in the hand if only the hand's pose is known, metres.
const LOOSE_GRIP_SIGMA_M: f64 = 0.06;
/// Probability that a thing was moved between two views where its place is hidden.
const MOVED_UNSEEN: f64 = 0.03;
/// The same where its place is in view, but nothing says whether it is still there.
const MOVED_UNTOLD: f64 = 0.003;
/// How far an unlucky push may shift a thing, metres.
const PUSHED_SIGMA_M: f64 = 0.04;

/// One place where an object may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hypothesis {
    /// Probability that it is there.
    pub(crate) weight: f64,
    /// Base of its main part, world frame, metres.
    pub(crate) position: DVec3,
    /// Variance along the world's axes, square metres.
    pub(crate) variance: DVec3,
}

/// An object with the places where it may be.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Prediction {
    pub(crate) id: ObjectId,
    pub(crate) parts: Vec<GroundedPart>,
    pub(crate) appearance: acm_concept::color::Appearance,
    pub(crate) support: Option<ObjectId>,
    pub(crate) body: Body,
    /// The believed place first.
    pub(crate) places: Vec<Hypothesis>,
    /// Probability that it is anywhere else.
    pub(crate) elsewhere: f64,
    /// Whether the camera should see it if it is where it is believed to be.
    pub(crate) due: bool,
}

/// Predictions for all objects whose shape is known.
pub(crate) fn predictions(state: &State, views: &[ExpectedView], library: &TemplateLibrary) -> Vec<Prediction> {
    let views: BTreeMap<ObjectId, &ExpectedView> = views.iter().map(|view| (view.object, view)).collect();
    let of = |entry: &ObjectEntry| predict(state, entry, views.get(&entry.id).copied(), library);
    state.objects.iter().filter_map(of).collect()
}

fn predict(
    state: &State,
    entry: &ObjectEntry,
    view: Option<&ExpectedView>,
    library: &TemplateLibrary,
) -> Option<Prediction> {
    let track = state.track(entry.id);
    let (parts, loose) = predicted_parts(state, entry, &track);
    let main = parts.first()?;
    let mut sigma = main.pose.position_sigma_m + VIEW_SIGMA_M;
    let elsewhere = match entry.presence {
        Presence::Held => {
            sigma = sigma.max(DVec3::splat(if loose { LOOSE_GRIP_SIGMA_M } else { HAND_SIGMA_M }));
            0.02
        }
        // What memory only supposes to exist is a poor explanation of something new.
        Presence::Missing => 0.95 * if entry.verified { 1.0 } else { entry.confidence.max(0.05) },
        Presence::Present => probability_elsewhere(state, entry, &track, view),
    };
    let place = |weight, position, sigma: DVec3| Hypothesis { weight, position, variance: sigma * sigma };
    let mut places = vec![place(1.0 - elsewhere, main.pose.pose.translation, sigma)];
    if track.disturbed || track.unconfirmed.is_some() {
        places.push(place(0.3, main.pose.pose.translation, sigma + PUSHED_SIGMA_M));
    }
    if let Some(part) = track.pending.as_ref().and_then(|pending| pending.parts.first()) {
        places.push(place(0.3, part.pose.pose.translation, part.pose.position_sigma_m + VIEW_SIGMA_M));
    }
    let body = Body::of(&parts, library)?;
    let hidden = |view: &ExpectedView| matches!(view.visibility, Visibility::Occluded | Visibility::OutOfView);
    let due = entry.presence == Presence::Present && !view.is_some_and(hidden);
    Some(Prediction {
        id: entry.id,
        parts,
        appearance: entry.appearance,
        support: entry.support,
        body,
        places,
        elsewhere,
        due,
    })
}

/// Probability that an object believed present is not where it is believed to be.
fn probability_elsewhere(state: &State, entry: &ObjectEntry, track: &Track, view: Option<&ExpectedView>) -> f64 {
    let seen = view.map_or(MOVED_UNTOLD, |view| match view.visibility {
        Visibility::Seen => 0.005,
        Visibility::SeenThrough => 0.9 * view.fraction.clamp(0.1, 1.0),
        Visibility::NotMeasured => MOVED_UNTOLD,
        Visibility::Occluded | Visibility::OutOfView => MOVED_UNSEEN,
    });
    let acted_on = if track.disturbed || track.unconfirmed.is_some() { 0.3 } else { 0.0 };
    let earlier_run = if entry.last_seen.episode < state.next.episode { 0.3 } else { 0.0 };
    f64::max(seen, f64::max(acted_on, earlier_run))
}

/// The parts where they are believed to be; what is held follows the hand. The second value says that only the
/// hand's pose is known, not how the object sits in it.
pub(crate) fn predicted_parts(state: &State, entry: &ObjectEntry, track: &Track) -> (Vec<GroundedPart>, bool) {
    let (Presence::Held, Some(glance)) = (entry.presence, &state.glance) else { return (entry.parts.clone(), false) };
    let Some(main) = entry.parts.first() else { return (Vec::new(), false) };
    let base = track.grip.map_or(Pose::new(glance.tcp.translation, main.pose.pose.rotation), |grip| glance.tcp * grip);
    (carried(&entry.parts, &base), track.grip.is_none())
}

/// All parts moved rigidly so that the main part's base frame comes to `base`.
pub(crate) fn carried(parts: &[GroundedPart], base: &Pose) -> Vec<GroundedPart> {
    let Some(main) = parts.first() else { return Vec::new() };
    let motion = *base * main.pose.pose.inverse();
    let mut parts = parts.to_vec();
    for part in &mut parts {
        part.pose.pose = motion * part.pose.pose;
    }
    if let Some(main) = parts.first_mut() {
        // Free of the rounding of the motion's two products.
        main.pose.pose = *base;
    }
    parts
}
