//! The view of the last frame, with the first beside it where that is kept.

use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Evidence, Literal, Place},
    object::SupportPlane,
    template::TemplateLibrary,
};
use acm_memory::{
    MemoryView, Snapshot,
    entry::{ObjectEntry, SkillEntry, TaskProgress, Transition},
    query::{ObjectQuery, PlaceReference, Prediction, Recall, Retrieval, SkillCandidate},
};
use std::sync::Arc;

/// Two things with colours nearer than this look the same, delta E.
const SAME_COLOR: f64 = 15.0;

/// The last frame; questions about the past are answered from `first`, and unknown where that says nothing.
pub(crate) struct LastFrame {
    frame: Snapshot,
    first: Arc<Vec<ObjectEntry>>,
}

impl LastFrame {
    /// Joins the last frame and what is kept of the first.
    pub(crate) fn new(frame: Snapshot, first: Arc<Vec<ObjectEntry>>) -> LastFrame {
        LastFrame { frame, first }
    }

    /// The place of the one object of the first frame that looks like this one; `None` if there is none, or
    /// several.
    fn recall_first(&self, object: ObjectId) -> Option<Recall<Place>> {
        let now = self.frame.object(object)?;
        let template = |entry: &ObjectEntry| entry.parts.first().map(|part| part.template.clone());
        let alike = |then: &&ObjectEntry| {
            template(then) == template(now) && then.appearance.mean.distance(&now.appearance.mean) < SAME_COLOR
        };
        let mut alike = self.first.iter().filter(alike);
        let then = match (alike.next(), alike.next()) {
            (Some(then), None) => then,
            // Among several that look the same an id that went on from the first frame decides.
            _ => self.first.iter().find(|then| then.id == object)?,
        };
        Some(Recall::Known {
            value: then.place()?,
            confidence: then.confidence,
            evidence: then.last_frame.map(Evidence::Frame).into_iter().collect(),
        })
    }
}

impl MemoryView for LastFrame {
    fn library(&self) -> &TemplateLibrary {
        self.frame.library()
    }
    fn objects(&self) -> &[ObjectEntry] {
        self.frame.objects()
    }
    fn transitions(&self) -> &[Transition] {
        self.frame.transitions()
    }
    fn skills(&self) -> &[SkillEntry] {
        self.frame.skills()
    }
    fn progress(&self) -> &TaskProgress {
        self.frame.progress()
    }
    fn support(&self) -> Option<&SupportPlane> {
        self.frame.support()
    }
    fn frames_seen(&self) -> u32 {
        self.frame.frames_seen()
    }
    fn retrieve(&self, query: &ObjectQuery) -> Retrieval {
        self.frame.retrieve(query)
    }
    fn recall_place(&self, object: ObjectId, reference: PlaceReference) -> Recall<Place> {
        if reference == PlaceReference::Now {
            return self.frame.recall_place(object, reference);
        }
        self.recall_first(object).unwrap_or_else(|| Recall::Unknown {
            reason: format!("the frames I keep do not show where {object} was before"),
            candidates: self.frame.free_places(object),
        })
    }
    fn belief(&self, literal: &Literal) -> Belief {
        if literal.predicate == "moved" {
            return Belief::unknown("I keep no history: I do not know what has moved");
        }
        self.frame.belief(literal)
    }
    fn skill_candidates(&self, object: ObjectId, destination: Option<Place>) -> Vec<SkillCandidate> {
        self.frame.skill_candidates(object, destination)
    }
    fn predict(&self, candidate: &SkillCandidate) -> Prediction {
        self.frame.predict(candidate)
    }
}
