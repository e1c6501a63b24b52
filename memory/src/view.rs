//! The snapshot through which a memory is read.

use crate::{
    belief,
    entry::{ObjectEntry, SkillEntry, TaskProgress, Transition},
    query::{ObjectQuery, PlaceReference, Prediction, Recall, Retrieval, SkillCandidate},
    recall, retrieve, skill,
    state::State,
    traits::MemoryView,
};
use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Literal, Place},
    object::SupportPlane,
    template::TemplateLibrary,
};
use std::sync::Arc;

/// An immutable view; it shares its lists with the memory until that writes.
#[derive(Debug, Clone)]
pub struct Snapshot {
    state: State,
    library: Arc<TemplateLibrary>,
    columns: Arc<acm_store::State>,
}

impl Snapshot {
    pub(crate) fn new(state: State, library: Arc<TemplateLibrary>, columns: Arc<acm_store::State>) -> Snapshot {
        Snapshot { state, library, columns }
    }
    /// The engine's columns, folded from the same events: typed queries, nearest things, the past, what-if forks.
    pub fn columns(&self) -> &acm_store::State {
        &self.columns
    }
    /// Free places on which an object could have stood: tops of the most common kind of supportive thing, with
    /// equal probabilities. What a guess may choose from where nothing is known.
    pub fn free_places(&self, object: ObjectId) -> Vec<(Place, f64)> {
        self.object(object).map_or_else(Vec::new, |entry| recall::free_places(&self.state, &self.library, entry))
    }
}

impl MemoryView for Snapshot {
    fn library(&self) -> &TemplateLibrary {
        &self.library
    }
    fn objects(&self) -> &[ObjectEntry] {
        &self.state.objects
    }
    fn transitions(&self) -> &[Transition] {
        &self.state.transitions
    }
    fn skills(&self) -> &[SkillEntry] {
        &self.state.skills
    }
    fn progress(&self) -> &TaskProgress {
        &self.state.progress
    }
    fn support(&self) -> Option<&SupportPlane> {
        self.state.support.as_ref()
    }
    fn frames_seen(&self) -> u32 {
        self.state.frames_seen
    }
    fn retrieve(&self, query: &ObjectQuery) -> Retrieval {
        retrieve::retrieve(&self.state, &self.library, query)
    }
    fn recall_place(&self, object: ObjectId, reference: PlaceReference) -> Recall<Place> {
        recall::recall_place(&self.state, &self.library, object, reference)
    }
    fn belief(&self, literal: &Literal) -> Belief {
        belief::belief(&self.state, &self.library, literal)
    }
    fn skill_candidates(&self, object: ObjectId, destination: Option<Place>) -> Vec<SkillCandidate> {
        skill::candidates(&self.state, &self.library, object, destination)
    }
    fn predict(&self, candidate: &SkillCandidate) -> Prediction {
        skill::predict(&self.state, &self.library, candidate)
    }
    fn object(&self, id: ObjectId) -> Option<&ObjectEntry> {
        self.state.object(id)
    }
}
