//! Why a step was chosen, for people and for the trace.

use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Literal, Place},
};
use acm_memory::query::{Applicability, Recall, Retrieval, SkillCandidate};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Why a step was chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// The goal in words.
    pub goal: String,
    /// The words of the instruction that ask for it.
    pub subtask: String,
    /// What the instruction's phrases were taken to mean.
    pub references: Vec<ResolvedReference>,
    /// The goal as ground literals with what memory believes of them.
    pub literals: Vec<(Literal, Belief)>,
    /// Preconditions of the chosen skill.
    pub applicability: Applicability,
    /// Skills that would serve but cannot be run now, or were not preferred.
    pub rejected: Vec<Rejected>,
    /// The remaining chain of steps, the chosen one first.
    pub plan: Vec<String>,
    /// Skill candidates that the search inspected.
    pub candidates_inspected: u32,
    /// What else a person should know: what is unverified, what was tried before.
    pub notes: Vec<String>,
}

/// What a decision that is not to act rests on.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Grounds {
    /// What the instruction's phrases were taken to mean.
    pub references: Vec<ResolvedReference>,
    /// Goals and preconditions that were weighed, with what memory believes of them.
    pub literals: Vec<(Literal, Belief)>,
}

/// What a phrase was taken to mean, and on what grounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResolvedReference {
    /// The words.
    pub phrase: String,
    /// The object, for phrases that mean one.
    pub object: Option<ObjectId>,
    /// The place, for phrases that mean one.
    pub place: Option<Place>,
    /// Memory's answer to the query for objects.
    pub retrieval: Option<Retrieval>,
    /// Memory's answer to the question about the past.
    pub recall: Option<Recall<Place>>,
    /// How it was decided.
    pub how: String,
    /// Whether it was drawn because memory did not decide.
    pub guessed: bool,
}

/// A skill that was considered and not chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// The skill on its part.
    pub candidate: String,
    /// The precondition that does not hold now, if that is the reason.
    pub failed: Option<(Literal, Belief)>,
    /// Why it was not chosen.
    pub reason: String,
}

/// A candidate in words: `place P1.0 at (0.100, -0.100)`.
pub(crate) fn step_words(candidate: &SkillCandidate) -> String {
    match &candidate.destination {
        Some(place) => {
            let at = acm_concept::literal::Term::Place(*place);
            format!("{} {} at {at}", candidate.skill, candidate.part)
        }
        None => format!("{} {}", candidate.skill, candidate.part),
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.goal, self.plan.join(" > "))?;
        for reference in &self.references {
            write!(f, "; \"{}\" is {}", reference.phrase, reference.how)?;
        }
        if let Some(rejected) = self.rejected.first() {
            write!(f, "; not {}: {}", rejected.candidate, rejected.reason)?;
        }
        for note in &self.notes {
            write!(f, "; {note}")?;
        }
        Ok(())
    }
}
