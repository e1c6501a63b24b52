//! Which percept is which remembered object.
//!
//! Every remembered object is predicted ([`predict`]), every pair of percept and object gets a log-likelihood
//! ratio against "this is something else" ([`likelihood`]), and the assignment that explains the whole frame
//! best is taken ([`assignment`]), with the probability of each of its pairs. The paper's rule, each detection on
//! its own by a weighted score over a threshold, is kept for comparison ([`paper`]).

pub(crate) mod assignment;
pub mod doubt;
pub(crate) mod likelihood;
pub(crate) mod paper;
pub(crate) mod predict;

use crate::{geometry::Body, state::State};
use acm_concept::{
    ids::ObjectId,
    object::{ExpectedView, GroundedObject, GroundedPart, Observability, PoseEstimate},
    template::TemplateLibrary,
};

/// How percepts are given identities.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum IdentityRule {
    /// Global gated assignment with a "new" option.
    #[default]
    Global,
    /// The paper's rule: each percept on its own takes the best score over a threshold.
    Paper,
}

/// Most percepts of one frame that are given identities; the smallest beyond are left out.
pub const MAX_PERCEPTS: usize = 256;

/// A percept that can be reasoned about: its numbers are finite and its templates are in the library.
#[derive(Debug, Clone)]
pub(crate) struct Percept<'a> {
    /// Index into the frame's objects.
    pub(crate) index: usize,
    pub(crate) object: &'a GroundedObject,
    pub(crate) parts: Vec<GroundedPart>,
    /// Pose of the main part.
    pub(crate) pose: PoseEstimate,
    pub(crate) body: Body,
}

impl<'a> Percept<'a> {
    /// `None` for a percept with numbers that are not finite, without parts, or of an unknown template.
    pub(crate) fn read(index: usize, object: &'a GroundedObject, library: &TemplateLibrary) -> Option<Percept<'a>> {
        let mut parts = object.parts.clone();
        for parameter in parts.iter_mut().flat_map(|part| &mut part.parameters) {
            if let Observability::Interval { low, high } = &mut parameter.observability {
                // An open interval has no JSON; a kilometre is as good as infinity here.
                (*low, *high) = (low.max(-1e3), high.min(1e3));
            }
        }
        let color_is_finite = |a: &acm_concept::color::Appearance| {
            [a.mean.l, a.mean.a, a.mean.b, a.spread].iter().all(|value| value.is_finite())
        };
        let part_is_finite = |part: &GroundedPart| {
            let pose = &part.pose;
            let sigma_is_sane = |sigma: f64| sigma.is_finite() && sigma >= 0.0;
            pose.pose.is_valid()
                && pose.position_sigma_m.to_array().into_iter().all(sigma_is_sane)
                && sigma_is_sane(pose.yaw_sigma_rad)
                && part.parameters.iter().all(|p| p.value.is_finite() && sigma_is_sane(p.sigma))
                && color_is_finite(&part.appearance)
        };
        let sane = (0.0..=1.0).contains(&object.confidence)
            && color_is_finite(&object.appearance)
            && parts.iter().all(part_is_finite)
            // Sums of probabilities round to a little over one.
            && object.categories.iter().all(|(_, probability)| (0.0..=1.0 + 1e-9).contains(probability));
        let body = sane.then(|| Body::of(&parts, library)).flatten()?;
        let pose = parts.first()?.pose;
        Some(Percept { index, object, parts, pose, body })
    }
    /// Whether the outline is its own and the grounding good enough to change what is believed.
    pub(crate) fn is_reliable(&self) -> bool {
        self.object.confidence >= 0.5
    }
}

/// A percept and the object it was found to be.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Match {
    /// Index into the percepts.
    pub(crate) percept: usize,
    /// The object; `None` if it is none of those remembered.
    pub(crate) object: Option<ObjectId>,
    /// Probability of this answer, 0-1.
    pub(crate) probability: f64,
    /// Other objects that it may be, best first.
    pub(crate) alternatives: Vec<(ObjectId, f64)>,
    /// All objects that it could be if it were the only thing in the frame.
    pub(crate) possible: Vec<ObjectId>,
}

/// Gives every percept its best identity, in the order of the percepts.
pub(crate) fn resolve(
    rule: IdentityRule,
    state: &State,
    percepts: &[Percept<'_>],
    views: &[ExpectedView],
    library: &TemplateLibrary,
) -> Vec<Match> {
    let predictions = predict::predictions(state, views, library);
    match rule {
        IdentityRule::Global => {
            let scores = likelihood::scores(percepts, &predictions, library);
            assignment::assign(&scores, &predictions)
        }
        IdentityRule::Paper => paper::assign(percepts, &predictions, library),
    }
}
