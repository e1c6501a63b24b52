//! A scene that is known and does not change, as a view of memory: things stand where a task's file says.

use acm_concept::{
    color::{Appearance, Lab},
    ids::{FrameId, ObjectId},
    literal::{Belief, Literal, Place},
    object::{GroundedPart, Observability, ParameterEstimate, PoseEstimate, SupportPlane},
    pose::Pose,
    template::{Template, TemplateLibrary, WHOLE},
    time::Time,
};
use acm_memory::{
    MemoryView,
    entry::{HistoryEntry, Moment, ObjectEntry, PlaceCause, Presence, SkillEntry, TaskProgress, Transition},
    query::{Hit, ObjectQuery, PlaceReference, Prediction, Recall, Retrieval, SkillCandidate},
};
use glam::DVec3;

/// The scene.
pub struct Scene {
    library: TemplateLibrary,
    objects: Vec<ObjectEntry>,
    progress: TaskProgress,
    support: SupportPlane,
}

/// A thing to be put into a scene.
pub struct Thing<'a> {
    /// The template that it is of.
    pub template: &'a str,
    /// Length, width and height, metres.
    pub size_m: DVec3,
    /// The middle of its bottom in the world, metres.
    pub at: DVec3,
    /// Its colour.
    pub color: Lab,
    /// What it stands on.
    pub on: Option<ObjectId>,
}

fn began() -> Moment {
    Moment { episode: 1, time: Time::ZERO }
}

impl Scene {
    /// An empty one.
    pub fn new(library: TemplateLibrary) -> Scene {
        let appearance = Appearance::plain(Lab::from_srgb([180, 170, 150]), 3.0);
        let support = SupportPlane { normal: DVec3::Z, offset_m: 0.0, residual_m: 0.001, appearance };
        let progress = TaskProgress { done: Vec::new(), instructed: began() };
        Scene { library, objects: Vec::new(), progress, support }
    }
    /// Puts a thing there.
    pub fn put(&mut self, thing: &Thing<'_>) -> Option<ObjectId> {
        let id = ObjectId(self.objects.len() as u64 + 1);
        let part = self.part(thing, WHOLE)?;
        let template = self.library.get(thing.template)?;
        let values: Vec<(&str, f64)> = part.values();
        let nouns: Vec<(String, f64)> = template.nouns(&values).iter().map(|noun| ((*noun).to_owned(), 0.9)).collect();
        let place = Place {
            support: thing.on,
            pose: Pose::from_translation(thing.at),
            tolerance_m: 0.03,
            heading_tolerance_rad: None,
        };
        self.objects.push(ObjectEntry {
            id,
            category: nouns.first()?.0.clone(),
            categories: nouns,
            appearance: part.appearance,
            parts: vec![part],
            presence: Presence::Present,
            support: thing.on,
            state: Vec::new(),
            confidence: 0.95,
            verified: true,
            last_seen: began(),
            last_frame: Some(FrameId(0)),
            views: 2,
            ambiguous_with: Vec::new(),
            history: vec![HistoryEntry {
                moment: began(),
                place: Some(place),
                cause: PlaceCause::Seen(FrameId(0)),
                verified: true,
            }],
        });
        Some(id)
    }
    /// Gives a thing a further part.
    pub fn add_part(&mut self, object: ObjectId, name: &str, part: &Thing<'_>) -> Option<()> {
        let part = self.part(part, name)?;
        self.objects.iter_mut().find(|entry| entry.id == object)?.parts.push(part);
        Some(())
    }

    fn part(&self, thing: &Thing<'_>, name: &str) -> Option<GroundedPart> {
        let template: &Template = self.library.get(thing.template)?;
        let appearance = Appearance::plain(thing.color, 2.0);
        let parameter = |(name, value): (&str, f64)| ParameterEstimate {
            name: name.into(),
            value,
            sigma: 0.001,
            observability: Observability::Observed,
        };
        let sizes = [("length", thing.size_m.x), ("width", thing.size_m.y), ("height", thing.size_m.z)];
        Some(GroundedPart {
            name: name.into(),
            template: thing.template.into(),
            parameters: sizes.into_iter().map(parameter).collect(),
            pose: PoseEstimate {
                pose: Pose::from_translation(thing.at),
                position_sigma_m: DVec3::splat(0.001),
                yaw_sigma_rad: 0.01,
            },
            affordances: template.affordances().map(String::from).collect(),
            functions: template.functions.iter().map(|function| function.name.clone()).collect(),
            appearance,
        })
    }
}

impl MemoryView for Scene {
    fn library(&self) -> &TemplateLibrary {
        &self.library
    }
    fn objects(&self) -> &[ObjectEntry] {
        &self.objects
    }
    fn transitions(&self) -> &[Transition] {
        &[]
    }
    fn skills(&self) -> &[SkillEntry] {
        &[]
    }
    fn progress(&self) -> &TaskProgress {
        &self.progress
    }
    fn support(&self) -> Option<&SupportPlane> {
        Some(&self.support)
    }
    fn frames_seen(&self) -> u32 {
        1
    }
    fn retrieve(&self, query: &ObjectQuery) -> Retrieval {
        let mut retrieval = Retrieval::default();
        for entry in &self.objects {
            let has = |fits: &dyn Fn(&GroundedPart) -> bool| entry.parts.iter().any(fits);
            let named = |(noun, _): &(String, f64)| query.nouns.contains(noun);
            let dropped = if query.exclude.contains(&entry.id) {
                Some("exclude")
            } else if !query.nouns.is_empty() && !entry.categories.iter().any(named) {
                Some("nouns")
            } else if query.function.as_ref().is_some_and(|f| !has(&|part| part.functions.contains(f))) {
                Some("function")
            } else if query.affordance.as_ref().is_some_and(|a| !has(&|part| part.affordances.contains(a))) {
                Some("affordance")
            } else if query.color.is_some_and(|(lab, reach)| lab.distance(&entry.appearance.mean) > reach) {
                Some("color")
            } else {
                None
            };
            match dropped {
                Some(filter) => retrieval.dropped.push((entry.id, filter.into())),
                None => retrieval.hits.push(Hit { object: entry.id, score: entry.confidence, terms: Vec::new() }),
            }
        }
        retrieval.scored = retrieval.hits.len() as u32;
        retrieval
    }
    fn recall_place(&self, _object: ObjectId, _reference: PlaceReference) -> Recall<Place> {
        Recall::Unknown { reason: "nothing has moved here".into(), candidates: Vec::new() }
    }
    fn belief(&self, _literal: &Literal) -> Belief {
        Belief::unknown("the scene says nothing of it")
    }
    fn skill_candidates(&self, _object: ObjectId, _destination: Option<Place>) -> Vec<SkillCandidate> {
        Vec::new()
    }
    fn predict(&self, _candidate: &SkillCandidate) -> Prediction {
        Prediction { effects: Vec::new(), success: 0.0, tries: 0, successes: 0 }
    }
}
