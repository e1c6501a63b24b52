//! A doubtful identity under further views: which of several alike this is becomes clearer the longer it is seen.
//!
//! When a frame leaves open which of several objects a percept is, how they looked *before* is kept beside what is
//! measured of it *since*. Each further view sharpens the second, and the probabilities follow.

use super::{
    Percept,
    likelihood::{Look, look_ratio},
};
use crate::{entry::ObjectEntry, fusion, geometry::Body};
use acm_concept::{
    color::Appearance,
    ids::ObjectId,
    object::{GroundedPart, Observability},
    template::TemplateLibrary,
};
use serde::{Deserialize, Serialize};

/// Other identities below this probability are not worth a word.
const WORTH_NAMING: f64 = 0.02;

/// How something looks: parts and colour.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Looks {
    parts: Vec<GroundedPart>,
    appearance: Appearance,
}

/// One of the objects that it may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    object: ObjectId,
    /// How it looked before.
    before: Looks,
    /// Log-likelihood of everything but the looks.
    place: f64,
}

/// A doubtful identity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Doubt {
    /// The first is what it is taken for.
    candidates: Vec<Candidate>,
    since: Looks,
    views: u32,
}

impl Doubt {
    /// The doubt that a first view leaves between objects, with the probabilities that their assignment gave them.
    pub(crate) fn new(
        percept: &Percept<'_>,
        candidates: &[(&ObjectEntry, f64)],
        library: &TemplateLibrary,
    ) -> Option<Doubt> {
        let since = Looks { parts: percept.parts.clone(), appearance: percept.object.appearance };
        let candidate = |(entry, probability): &(&ObjectEntry, f64)| {
            let before = Looks { parts: entry.parts.clone(), appearance: entry.appearance };
            let looks = ratio(&since, &before, library)?;
            Some(Candidate { object: entry.id, before, place: probability.max(1e-9).ln() - looks })
        };
        let candidates = candidates.iter().map(candidate).collect::<Option<Vec<_>>>()?;
        Some(Doubt { candidates, since, views: 1 })
    }

    /// Takes a further whole view of it in.
    pub(crate) fn see(&mut self, percept: &Percept<'_>, library: &TemplateLibrary) {
        let measured = |part: &GroundedPart| part.parameters.iter().any(|p| p.observability == Observability::Observed);
        if percept.object.truncated || !percept.parts.iter().any(measured) {
            return;
        }
        let Some(parts) = fusion::fuse_parts(&self.since.parts, &percept.parts, false, library) else { return };
        let appearance = fusion::fuse_appearance(&self.since.appearance, &percept.object.appearance, self.views);
        self.since = Looks { parts, appearance };
        self.views = self.views.saturating_add(1);
    }

    /// The other objects that it may be, with their probabilities, best first.
    pub(crate) fn alternatives(&self, library: &TemplateLibrary) -> Vec<(ObjectId, f64)> {
        let score = |c: &Candidate| c.place + ratio(&self.since, &c.before, library).unwrap_or(0.0);
        let scores: Vec<f64> = self.candidates.iter().map(score).collect();
        let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let odds: Vec<f64> = scores.iter().map(|score| (score - best).exp()).collect();
        let total: f64 = odds.iter().sum();
        let others = self.candidates.iter().zip(&odds).skip(1).map(|(c, odd)| (c.object, odd / total));
        let mut others: Vec<_> = others.filter(|(_, probability)| *probability >= WORTH_NAMING).collect();
        others.sort_by(|a, b| b.1.total_cmp(&a.1));
        others
    }
}

fn ratio(since: &Looks, before: &Looks, library: &TemplateLibrary) -> Option<f64> {
    let (seen, known) = (Body::of(&since.parts, library)?, Body::of(&before.parts, library)?);
    let seen = Look { parts: &since.parts, appearance: &since.appearance, body: &seen, truncated: false };
    let known = Look { parts: &before.parts, appearance: &before.appearance, body: &known, truncated: false };
    Some(look_ratio(seen, known, library))
}
