//! The view of a memory that keeps the run's first frame.

use acm_concept::{
    ids::{FrameId, ObjectId},
    literal::{Belief, Evidence, Literal, Place},
    object::SupportPlane,
    template::TemplateLibrary,
};
use acm_memory::{
    MemoryView, Snapshot,
    entry::{ObjectEntry, SkillEntry, TaskProgress, Transition},
    query::{ObjectQuery, PlaceReference, Prediction, Recall, Retrieval, SkillCandidate},
};

/// How sure a place is that one frame has shown.
const CONFIDENCE: f64 = 0.7;

/// What is kept, and beside it where things stood in the first frame. Where something was before is where the first frame
/// shows it, also where it stands there again: that it has been elsewhere in between is not kept.
pub(crate) struct FirstFrame {
    now: Snapshot,
    frame: FrameId,
    places: Vec<(ObjectId, Place)>,
}

impl FirstFrame {
    /// Joins what is kept now and the first frame.
    pub fn new(now: Snapshot, frame: FrameId, places: Vec<(ObjectId, Place)>) -> FirstFrame {
        FirstFrame { now, frame, places }
    }
}

impl MemoryView for FirstFrame {
    fn library(&self) -> &TemplateLibrary {
        self.now.library()
    }
    fn objects(&self) -> &[ObjectEntry] {
        self.now.objects()
    }
    fn transitions(&self) -> &[Transition] {
        self.now.transitions()
    }
    fn skills(&self) -> &[SkillEntry] {
        self.now.skills()
    }
    fn progress(&self) -> &TaskProgress {
        self.now.progress()
    }
    fn support(&self) -> Option<&SupportPlane> {
        self.now.support()
    }
    fn frames_seen(&self) -> u32 {
        self.now.frames_seen()
    }
    fn retrieve(&self, query: &ObjectQuery) -> Retrieval {
        self.now.retrieve(query)
    }
    fn recall_place(&self, object: ObjectId, reference: PlaceReference) -> Recall<Place> {
        let recall = self.now.recall_place(object, reference);
        let first = self.places.iter().find(|(id, _)| *id == object);
        match (recall, first) {
            (Recall::Unknown { .. }, Some((_, place))) if reference != PlaceReference::Now => {
                Recall::Known { value: *place, confidence: CONFIDENCE, evidence: vec![Evidence::Frame(self.frame)] }
            }
            (recall, _) => recall,
        }
    }
    fn belief(&self, literal: &Literal) -> Belief {
        self.now.belief(literal)
    }
    fn skill_candidates(&self, object: ObjectId, destination: Option<Place>) -> Vec<SkillCandidate> {
        self.now.skill_candidates(object, destination)
    }
    fn predict(&self, candidate: &SkillCandidate) -> Prediction {
        self.now.predict(candidate)
    }
    fn object(&self, id: ObjectId) -> Option<&ObjectEntry> {
        self.now.object(id)
    }
}
