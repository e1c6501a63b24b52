//! A symbolic world with a memory of it: objects stand where they were put, skills bring about their declared
//! effects unless a fault is scripted. It implements [`MemoryView`] on its own, so that the planner is tested
//! against the interface and not against one memory.
#![allow(dead_code, reason = "each test program uses a part of it")]

use acm_concept::{
    color::{Appearance, Lab},
    embodiment::{Feedback, RobotDescription},
    ids::{FrameId, ObjectId, PartId, TransitionId},
    literal::{Belief, Evidence, Literal, Place, Term, Truth},
    object::{GroundedPart, Observability, ParameterEstimate, PoseEstimate, SupportPlane},
    pose::Pose,
    skill::{FailureCause, SkillInvocation, SkillReport},
    task::OnUnknown,
    template::{Template, TemplateLibrary},
    time::Time,
};
use acm_memory::{
    MemoryView,
    entry::{
        HistoryEntry, Moment, ObjectEntry, PlaceCause, Presence, SkillEntry, TaskProgress, Transition, TransitionResult,
    },
    query::{Hit, ObjectQuery, PlaceReference, Prediction, Recall, Retrieval, SkillCandidate},
};
use acm_planner::{Decision, PlanOptions, Planner, Situation, Step, Task};
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};

pub const RED: [u8; 3] = [210, 30, 30];
pub const BLUE: [u8; 3] = [0, 128, 254];
pub const GREEN: [u8; 3] = [30, 150, 60];
pub const GREY: [u8; 3] = [140, 140, 140];
/// Height of the table in the world, metres.
pub const TABLE_Z: f64 = 0.74;

/// What goes wrong with a skill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// The controller fails and nothing changes.
    Fails(FailureCause),
    /// What is held falls here, unseen until the next look.
    SlipsTo(DVec2),
    /// Nothing can be seen or felt of the effect.
    CannotTell,
}

/// The world and the memory of it.
#[derive(Clone)]
pub struct World {
    pub library: TemplateLibrary,
    pub objects: Vec<ObjectEntry>,
    pub transitions: Vec<Transition>,
    pub progress: TaskProgress,
    pub support: Option<SupportPlane>,
    pub frames: u32,
    pub now: Time,
    /// Whether memory keeps histories.
    pub remembers: bool,
    /// Places that memory offers where it does not know.
    pub candidates: Vec<(Place, f64)>,
    /// Where things lie that memory holds to be missing.
    pub lost: BTreeMap<ObjectId, DVec2>,
    pub faults: Vec<(&'static str, u32, Fault)>,
    /// What holds besides what follows from where things stand, as literals in text.
    pub facts: BTreeSet<String>,
    /// Predicates of which the robot can see whether they hold.
    pub visible: BTreeSet<String>,
    runs: BTreeMap<String, u32>,
    pub done_skills: Vec<String>,
}

/// A thing whose two ends differ: turned by half a turn it is not what it was.
const CELL: &str = r#"
template = "cell"
seen_by = "depth"
prior = 0.5
affordances = ["graspable"]
constraints = []

[synopsis]
description = "a block whose ends differ"
affordance = "it can be grasped across its sides"
intended_use = "to give current"
nouns = [{ noun = "cell" }]

[[parameter]]
name = "length"
unit = "m"
min = 0.02
max = 0.1
initial = "extent_x"

[[parameter]]
name = "width"
unit = "m"
min = 0.01
max = 0.06
initial = "extent_y"

[[parameter]]
name = "height"
unit = "m"
min = 0.01
max = 0.06
initial = "extent_z"

[[solid]]
shape = "box"
size = ["length", "width", "height"]
position = ["0", "0", "height / 2"]

[[frame]]
name = "base"
position = ["0", "0", "0"]

[[function]]
name = "pick"
kind = "grasp-from-above"
frame = "base"
arguments = { grip_width = "width", cross_width = "length", height = "height" }
preconditions = ["hand-empty()", "clear(?self)"]
effects = ["holding(?self)", "not hand-empty()"]

[[function]]
name = "place"
kind = "place-upright"
frame = "base"
arguments = { grip_width = "width", height = "height" }
preconditions = ["holding(?self)"]
effects = ["at(?self, ?destination)", "not holding(?self)", "hand-empty()"]
"#;

pub fn library() -> TemplateLibrary {
    TemplateLibrary::parse([
        ("box.toml", include_str!("../../../../memory/library/box.toml")),
        ("button.toml", include_str!("../../../../memory/library/button.toml")),
        ("cylinder.toml", include_str!("../../../../memory/library/cylinder.toml")),
        ("mat.toml", include_str!("../../../../memory/library/mat.toml")),
        ("cover.toml", include_str!("../../../../memory/library/household/cover.toml")),
        ("cell.toml", CELL),
    ])
    .unwrap()
}

impl World {
    pub fn new() -> World {
        let appearance = Appearance::plain(Lab::from_srgb([180, 170, 150]), 3.0);
        World {
            library: library(),
            objects: Vec::new(),
            transitions: Vec::new(),
            progress: TaskProgress { done: Vec::new(), instructed: moment(Time::from_seconds(1.0)) },
            support: Some(SupportPlane { normal: DVec3::Z, offset_m: TABLE_Z, residual_m: 0.001, appearance }),
            frames: 1,
            now: Time::from_seconds(1.0),
            remembers: true,
            candidates: Vec::new(),
            lost: BTreeMap::new(),
            faults: Vec::new(),
            facts: BTreeSet::new(),
            visible: BTreeSet::new(),
            runs: BTreeMap::new(),
            done_skills: Vec::new(),
        }
    }
    /// Mats evenly round (0.1, -0.1), a red cube on one of them, a button to the left.
    pub fn with_mats(mats: u32, start: u32) -> World {
        let mut world = World::new();
        for mat in 0..mats {
            let angle = std::f64::consts::TAU * f64::from(mat) / f64::from(mats) + 0.2;
            world.mat(DVec2::new(0.1, -0.1) + DVec2::from_angle(angle) * 0.12, BLUE);
        }
        let on = world.objects[start as usize].id;
        let spot = world.spot(on);
        world.cube(spot, RED, Some(on));
        world.button(DVec2::new(-0.25, -0.1));
        world
    }
    pub fn mat(&mut self, at: DVec2, color: [u8; 3]) -> ObjectId {
        self.add("mat", &[("length", 0.08), ("width", 0.08), ("thickness", 0.001)], at, color, None)
    }
    pub fn cube(&mut self, at: DVec2, color: [u8; 3], on: Option<ObjectId>) -> ObjectId {
        self.block(at, 0.04, color, on)
    }
    pub fn block(&mut self, at: DVec2, edge: f64, color: [u8; 3], on: Option<ObjectId>) -> ObjectId {
        self.add("box", &[("length", edge), ("width", edge), ("height", edge)], at, color, on)
    }
    pub fn cover(&mut self, at: DVec2) -> ObjectId {
        self.add(
            "cover",
            &[("length", 0.1), ("width", 0.1), ("height", 0.09), ("grip", 0.02), ("rise", 0.02)],
            at,
            GREY,
            None,
        )
    }
    pub fn cell(&mut self, at: DVec2) -> ObjectId {
        self.add("cell", &[("length", 0.06), ("width", 0.03), ("height", 0.03)], at, BLUE, None)
    }
    pub fn button(&mut self, at: DVec2) -> ObjectId {
        self.add("button", &[("radius", 0.03), ("height", 0.02)], at, RED, None)
    }
    /// A thing of a template with these parameters.
    pub fn add(
        &mut self,
        template: &str,
        values: &[(&str, f64)],
        at: DVec2,
        color: [u8; 3],
        on: Option<ObjectId>,
    ) -> ObjectId {
        let id = ObjectId(self.objects.len() as u64 + 1);
        let z = on.map_or(TABLE_Z, |on| self.top(on));
        let pose = Pose::from_translation(at.extend(z));
        let appearance = Appearance::plain(Lab::from_srgb(color), 2.0);
        let known = self.library.get(template).unwrap();
        let parameter = |(name, value): &(&str, f64)| ParameterEstimate {
            name: (*name).into(),
            value: *value,
            sigma: 0.001,
            observability: Observability::Observed,
        };
        let part = GroundedPart {
            name: acm_concept::template::WHOLE.into(),
            template: template.into(),
            parameters: values.iter().map(parameter).collect(),
            pose: PoseEstimate { pose, position_sigma_m: DVec3::splat(0.001), yaw_sigma_rad: 0.01 },
            affordances: known.affordances().map(String::from).collect(),
            functions: known.functions.iter().map(|f| f.name.clone()).collect(),
            appearance,
        };
        let nouns: Vec<(String, f64)> = known.nouns(values).iter().map(|noun| ((*noun).to_owned(), 0.9)).collect();
        self.objects.push(ObjectEntry {
            id,
            category: nouns[0].0.clone(),
            categories: nouns,
            parts: vec![part],
            appearance,
            presence: Presence::Present,
            support: on,
            state: Vec::new(),
            confidence: 0.95,
            verified: true,
            last_seen: moment(Time::ZERO),
            last_frame: Some(FrameId(0)),
            views: 2,
            ambiguous_with: Vec::new(),
            history: vec![HistoryEntry {
                moment: moment(Time::ZERO),
                place: Some(Place { support: on, pose, tolerance_m: 0.03, heading_tolerance_rad: None }),
                cause: PlaceCause::Seen(FrameId(0)),
                verified: true,
            }],
        });
        id
    }
    /// Turns a thing about the vertical as if it had been so from the beginning.
    pub fn turn(&mut self, id: ObjectId, yaw: f64) {
        let entry = self.entry_mut(id);
        let pose = Pose::from_yaw(entry.parts[0].pose.pose.translation, yaw);
        entry.parts[0].pose.pose = pose;
        entry.history[0].place.as_mut().unwrap().pose = pose;
    }
    /// What can be read on a thing from now on.
    pub fn shows(&mut self, id: ObjectId, what: &str) {
        let state = &mut self.entry_mut(id).state;
        state.retain(|literal| literal.predicate != "shows");
        state.push(Literal::parse(&format!("shows({id}, {what})")).unwrap());
    }
    pub fn entry(&self, id: ObjectId) -> &ObjectEntry {
        self.objects.iter().find(|entry| entry.id == id).unwrap()
    }
    pub fn entry_mut(&mut self, id: ObjectId) -> &mut ObjectEntry {
        self.objects.iter_mut().find(|entry| entry.id == id).unwrap()
    }
    pub fn spot(&self, id: ObjectId) -> DVec2 {
        self.entry(id).pose().unwrap().translation.truncate()
    }
    fn top(&self, id: ObjectId) -> f64 {
        let part = &self.entry(id).parts[0];
        let height = part.value("height").or(part.value("thickness")).unwrap();
        part.pose.pose.translation.z + height
    }
    /// Forgets everything but what is seen now.
    pub fn wipe(&mut self) {
        self.transitions.clear();
        self.progress = TaskProgress::default();
        let now = moment(self.now);
        for entry in &mut self.objects {
            let place = entry.place();
            entry.history =
                vec![HistoryEntry { moment: now, place, cause: PlaceCause::Seen(FrameId(99)), verified: true }];
        }
    }
    /// A frame in which everything can be seen.
    fn see(&mut self) {
        self.now = self.now + 0.1;
        let now = moment(self.now);
        self.objects.iter_mut().for_each(|entry| entry.last_seen = now);
    }
    /// A look: what was lost is seen where it lies.
    pub fn look(&mut self) {
        self.see();
        let now = moment(self.now);
        for (id, at) in std::mem::take(&mut self.lost) {
            let pose = Pose::from_translation(at.extend(TABLE_Z));
            self.put(
                id,
                Place { support: None, pose, tolerance_m: 0.03, heading_tolerance_rad: None },
                PlaceCause::Seen(FrameId(7)),
                now,
            );
        }
    }
    /// Somebody else takes an object away and puts it down before the eyes of the robot.
    pub fn seen_moving(&mut self, id: ObjectId, to: Place) {
        let now = moment(self.now);
        self.unplace(id, Presence::Missing, PlaceCause::Gone(FrameId(3)), now);
        self.put(id, to, PlaceCause::Seen(FrameId(4)), now);
    }
    fn put(&mut self, id: ObjectId, place: Place, cause: PlaceCause, moment: Moment) {
        let remembers = self.remembers;
        let entry = self.entry_mut(id);
        entry.presence = Presence::Present;
        entry.support = place.support;
        entry.parts[0].pose.pose = place.pose;
        if !remembers {
            entry.history.clear();
        }
        entry.history.push(HistoryEntry { moment, place: Some(place), cause, verified: true });
    }
    fn unplace(&mut self, id: ObjectId, presence: Presence, cause: PlaceCause, moment: Moment) {
        let remembers = self.remembers;
        let entry = self.entry_mut(id);
        (entry.presence, entry.support) = (presence, None);
        if remembers {
            entry.history.push(HistoryEntry { moment, place: None, cause, verified: true });
        } else {
            entry.history.clear();
        }
    }
    /// Runs a skill and settles its transition.
    pub fn execute(&mut self, step: &Step, invocation: SkillInvocation) {
        let skill = invocation.skill.clone();
        let run = self.runs.entry(skill.clone()).or_default();
        *run += 1;
        let fault = self.faults.iter().find(|(name, n, _)| *name == skill && n == run).map(|(_, _, fault)| *fault);
        self.done_skills.push(format!("{skill} {}", invocation.part));
        let started = self.now;
        self.now = self.now + 2.0;
        let (id, when) = (TransitionId(self.transitions.len() as u64 + 1), moment(self.now));
        let object = invocation.part.object;
        let held = self.held().map(|entry| entry.id);
        let result = match fault {
            Some(Fault::Fails(cause)) => TransitionResult::Failed { cause, reason: "scripted".into() },
            Some(Fault::SlipsTo(at)) => {
                self.lost.insert(object, at);
                self.unplace(object, Presence::Missing, PlaceCause::Gone(FrameId(5)), when);
                TransitionResult::Failed { cause: FailureCause::Grasp, reason: "the fingers are empty".into() }
            }
            Some(Fault::CannotTell) => TransitionResult::CannotTell,
            None => {
                for effect in &step.candidate.effects {
                    assert!(
                        step.candidate.preconditions.iter().all(|l| self.belief(l).truth == Truth::Yes)
                            || effect.predicate != "holding",
                        "a skill was run whose preconditions do not hold"
                    );
                }
                self.apply(&step.candidate.effects, object, id, when, held);
                TransitionResult::Verified
            }
        };
        let now_held = self.held().map(|entry| (entry.id, Pose::from_translation(DVec3::new(0.0, 0.0, 0.03))));
        self.transitions.push(Transition {
            id,
            moment: when,
            subtask: Some(step.subtask),
            before: step.candidate.preconditions.clone(),
            predicted: step.candidate.effects.clone(),
            after: Vec::new(),
            result,
            report: SkillReport {
                invocation,
                failure: None,
                primitives: Vec::new(),
                started,
                ended: self.now,
                measured: BTreeMap::new(),
                felt: Vec::new(),
                left_at: None,
                held: now_held,
            },
        });
    }
    fn apply(&mut self, effects: &[Literal], object: ObjectId, id: TransitionId, when: Moment, held: Option<ObjectId>) {
        for effect in effects {
            match (effect.predicate.as_str(), effect.negated, effect.arguments.get(1)) {
                ("holding", false, _) => {
                    assert_eq!(held, None, "grasped with a full hand");
                    self.unplace(object, Presence::Held, PlaceCause::Grasped(id), when);
                }
                ("at", false, Some(Term::Place(place))) => {
                    assert_eq!(held, Some(object), "placed what is not held");
                    self.put(object, *place, PlaceCause::Own(id), when);
                }
                _ => {}
            }
        }
    }
    fn truth(&self, literal: &Literal) -> Option<bool> {
        let entry = literal.subject().and_then(|id| self.objects.iter().find(|entry| entry.id == id));
        Some(match literal.predicate.as_str() {
            "hand-empty" => self.held().is_none(),
            "holding" => entry?.presence == Presence::Held,
            "clear" => {
                let id = entry?.id;
                !self.objects.iter().any(|e| e.presence == Presence::Present && e.support == Some(id))
            }
            "at" => match (entry?.presence, &literal.arguments[1]) {
                (Presence::Present, Term::Place(place)) => {
                    let turn = acm_concept::pose::wrap_angle(entry?.pose()?.yaw() - place.pose.yaw()).abs();
                    self.spot(entry?.id).distance(place.pose.translation.truncate()) <= place.tolerance_m
                        && place.heading_tolerance_rad.is_none_or(|allowed| turn <= allowed)
                }
                (Presence::Held, _) => false,
                _ => return None,
            },
            other if !literal.arguments.is_empty() && self.visible.contains(other) => {
                self.facts.contains(&literal.to_string())
            }
            _ => return None,
        })
    }
}

impl MemoryView for World {
    fn library(&self) -> &TemplateLibrary {
        &self.library
    }
    fn objects(&self) -> &[ObjectEntry] {
        &self.objects
    }
    fn transitions(&self) -> &[Transition] {
        &self.transitions
    }
    fn skills(&self) -> &[SkillEntry] {
        &[]
    }
    fn progress(&self) -> &TaskProgress {
        &self.progress
    }
    fn support(&self) -> Option<&SupportPlane> {
        self.support.as_ref()
    }
    fn frames_seen(&self) -> u32 {
        self.frames
    }
    fn retrieve(&self, query: &ObjectQuery) -> Retrieval {
        let mut retrieval = Retrieval::default();
        for entry in &self.objects {
            let has = |f: &dyn Fn(&GroundedPart) -> bool| entry.parts.iter().any(f);
            let dropped = if query.exclude.contains(&entry.id) {
                Some("exclude")
            } else if !query.nouns.is_empty() && !entry.categories.iter().any(|(noun, _)| query.nouns.contains(noun)) {
                Some("nouns")
            } else if query.function.as_ref().is_some_and(|f| !has(&|part| part.functions.contains(f))) {
                Some("function")
            } else if query.affordance.as_ref().is_some_and(|a| !has(&|part| part.affordances.contains(a))) {
                Some("affordance")
            } else if query.color.is_some_and(|(lab, reach)| lab.distance(&entry.appearance.mean) > reach) {
                Some("color")
            } else if entry.presence == Presence::Missing && !query.include_missing {
                Some("missing")
            } else {
                None
            };
            match dropped {
                Some(filter) => retrieval.dropped.push((entry.id, filter.into())),
                None => retrieval.hits.push(Hit { object: entry.id, score: entry.confidence, terms: Vec::new() }),
            }
        }
        retrieval.scored = retrieval.hits.len() as u32;
        retrieval.hits.sort_by(|a, b| b.score.total_cmp(&a.score));
        retrieval
    }
    fn recall_place(&self, object: ObjectId, _reference: PlaceReference) -> Recall<Place> {
        let history = &self.entry(object).history;
        let first_gone = history.iter().position(|h| h.place.is_none());
        match first_gone.and_then(|at| history[..at].last()).and_then(|h| h.place) {
            Some(value) => {
                let left = first_gone.map(|at| match history[at].cause {
                    PlaceCause::Grasped(transition) | PlaceCause::Own(transition) => Evidence::Transition(transition),
                    PlaceCause::Seen(frame) | PlaceCause::Gone(frame) => Evidence::Frame(frame),
                });
                let evidence = [Evidence::Frame(FrameId(0))].into_iter().chain(left).collect();
                Recall::Known { value, confidence: 0.9, evidence }
            }
            None => {
                Recall::Unknown { reason: "no move of it was seen or made".into(), candidates: self.candidates.clone() }
            }
        }
    }
    fn belief(&self, literal: &Literal) -> Belief {
        let positive = Literal { negated: false, ..literal.clone() };
        let Some(holds) = self.truth(&positive) else { return Belief::unknown("nothing is known of it") };
        let truth = if holds != literal.negated { Truth::Yes } else { Truth::No };
        Belief { truth, confidence: 0.9, evidence: vec![Evidence::Frame(FrameId(0))], reason: "seen".into() }
    }
    fn skill_candidates(&self, object: ObjectId, destination: Option<Place>) -> Vec<SkillCandidate> {
        let entry = self.entry(object);
        let template: &Template = self.library.get(&entry.parts[0].template).unwrap();
        let bind = |name: &str| match name {
            "self" => Some(Term::Object(object)),
            "destination" => destination.map(Term::Place),
            _ => None,
        };
        let candidate = |function: &acm_concept::template::FunctionBinding| {
            let ground = |literals: &[Literal]| literals.iter().map(|l| l.substitute(&bind)).collect::<Vec<_>>();
            let effects = ground(&function.effects);
            let places = function.effects.iter().any(|l| l.arguments.contains(&Term::Variable("destination".into())));
            effects.iter().all(Literal::is_ground).then(|| SkillCandidate {
                skill: function.name.clone(),
                template: template.name.clone(),
                kind: function.kind.clone(),
                part: PartId { object, index: 0 },
                destination: destination.filter(|_| places),
                entry: None,
                preconditions: ground(&function.preconditions),
                effects,
                success: 0.8,
            })
        };
        template.functions.iter().filter_map(candidate).collect()
    }
    fn predict(&self, candidate: &SkillCandidate) -> Prediction {
        let effects = candidate.effects.iter().map(|effect| (effect.clone(), candidate.success)).collect();
        Prediction { effects, success: candidate.success, tries: 0, successes: 0 }
    }
}

pub fn moment(time: Time) -> Moment {
    Moment { episode: 1, time }
}

pub fn robot() -> RobotDescription {
    RobotDescription {
        name: "hand".into(),
        hand: vec![],
        finger: vec![],
        max_opening_m: 0.08,
        max_grip_force_n: 30.0,
        pad_half_length_m: 0.01,
        workspace_min: DVec3::new(-0.6, -0.6, 0.7),
        workspace_max: DVec3::new(0.6, 0.6, 1.3),
        max_speed_m_s: 0.5,
        max_turn_rad_s: 2.0,
        tick_s: 0.02,
        home: Pose::IDENTITY,
        ..RobotDescription::default()
    }
}

pub fn situation(world: &World, looks: u32) -> Situation {
    Situation {
        time: world.now,
        feedback: Feedback {
            time: world.now,
            tcp: Pose::IDENTITY,
            joints: Vec::new(),
            opening_m: 0.08,
            commanded_opening_m: 0.08,
            pad_force_n: [DVec3::ZERO; 2],
            wrist_force_n: DVec3::ZERO,
            ..Feedback::default()
        },
        looks,
        deadline: Time::from_seconds(1200.0),
        skills_left: 200,
    }
}

pub fn options(on_unknown: OnUnknown, seed: u64) -> PlanOptions {
    PlanOptions { on_unknown, seed }
}

/// Runs a task to its end; `between` may change the world after each decision. More than 400 decisions fail.
pub fn run(
    world: &mut World,
    task: &Task,
    options: &PlanOptions,
    mut between: impl FnMut(&mut World, &Decision),
) -> Decision {
    let planner = Planner::new().unwrap();
    let mut looks = 0;
    for _ in 0..400 {
        let decision = planner.decide(task, world, &situation(world, looks), options);
        looks = if matches!(decision, Decision::Look { .. }) { looks + 1 } else { 0 };
        match &decision {
            Decision::Act { step, explanation } => {
                assert!(!explanation.plan.is_empty() && !explanation.to_string().is_empty());
                let invocation = planner.bind(step, world, &robot()).unwrap();
                world.execute(step, invocation);
                world.see();
            }
            Decision::Look { .. } => world.look(),
            Decision::SubtaskDone { index, .. } => {
                world.now = world.now + 0.01;
                let now = moment(world.now);
                world.progress.done.push((*index, now));
            }
            Decision::Done { .. } | Decision::GiveUp { .. } => return decision,
        }
        between(world, &decision);
    }
    panic!("no end after 400 decisions: {:?}", world.done_skills);
}
