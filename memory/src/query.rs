//! What memory can be asked, and its answers with their reasons.

use acm_concept::{
    color::Lab,
    ids::{ObjectId, PartId, SkillId},
    literal::{Belief, Evidence, Literal, Place},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A description of the objects that are looked for. Empty fields do not filter.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectQuery {
    /// Any of these nouns (coarse stage: categories and templates).
    pub nouns: Vec<String>,
    /// Affordance that a part must have.
    pub affordance: Option<String>,
    /// Function that a part must support.
    pub function: Option<String>,
    /// Colour that it should have: rank by closeness, drop what is farther than the given delta E.
    pub color: Option<(Lab, f64)>,
    /// Prefer objects near this point, metres.
    pub near: Option<DVec3>,
    /// Objects that are not meant.
    pub exclude: Vec<ObjectId>,
    /// Also objects whose whereabouts are unknown.
    pub include_missing: bool,
}

/// One ranked answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hit {
    /// The object.
    pub object: ObjectId,
    /// Score in (0, 1], higher is better: product of the terms.
    pub score: f64,
    /// The terms by name: `category`, `color`, `near`, `confidence`.
    pub terms: Vec<(String, f64)>,
}

/// The answer to an [`ObjectQuery`]: ranked hits, and why the others dropped out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Retrieval {
    /// Best first.
    pub hits: Vec<Hit>,
    /// Objects that a hard filter dropped, with the filter's name.
    pub dropped: Vec<(ObjectId, String)>,
    /// Entries that were scored after the hard filters (retrieval effort a).
    pub scored: u32,
}

/// Which of an object's places is meant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlaceReference {
    /// Where it is now.
    Now,
    /// Where it was before it was first moved in this episode ("where it came from", "where it was"): needs a
    /// seen or an own move.
    BeforeMoved,
    /// Where it was when the episode began ("where it was at the start").
    AtStart,
}

/// An answer that may be known, open between candidates, or unknown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Recall<T> {
    /// Known.
    Known {
        /// The answer.
        value: T,
        /// Probability that it is right, 0-1.
        confidence: f64,
        /// What it rests on.
        evidence: Vec<Evidence>,
    },
    /// Not decided; `candidates` are what it may be, with probabilities, best first; may be empty.
    Unknown {
        /// Why memory does not know, in words that name what is missing.
        reason: String,
        /// Possible answers.
        candidates: Vec<(T, f64)>,
    },
}

/// Whether a skill's preconditions hold: Applicable(u, G) = pre(u) subset of state(G).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Applicability {
    /// Every precondition with what is believed of it.
    pub conditions: Vec<(Literal, Belief)>,
}

impl Applicability {
    /// Whether all conditions are believed to hold.
    pub fn holds(&self) -> bool {
        self.failed().next().is_none()
    }
    /// The conditions that do not hold or are unknown.
    pub fn failed(&self) -> impl Iterator<Item = &(Literal, Belief)> {
        self.conditions.iter().filter(|(_, belief)| belief.truth != acm_concept::literal::Truth::Yes)
    }
}

/// A skill that could be run on a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SkillCandidate {
    /// Skill name u.
    pub skill: String,
    /// Template type of the part.
    pub template: String,
    /// Function kind that executes it.
    pub kind: String,
    /// The part.
    pub part: PartId,
    /// Where what is held shall stand, for skills that place.
    pub destination: Option<Place>,
    /// The entry of skill memory with its statistics, if there is one.
    pub entry: Option<SkillId>,
    /// Ground preconditions.
    pub preconditions: Vec<Literal>,
    /// Ground declared effects.
    pub effects: Vec<Literal>,
    /// Expected probability of success: (successes + 1) / (tries + 2) over this template's tries.
    pub success: f64,
}

/// What a skill is expected to bring about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Literals with the probability of each.
    pub effects: Vec<(Literal, f64)>,
    /// Probability that all of them come about.
    pub success: f64,
    /// Tries and successes of this skill on this template that the probability rests on.
    pub tries: u32,
    /// See `tries`.
    pub successes: u32,
}
