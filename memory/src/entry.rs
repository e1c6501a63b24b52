//! Entries of the dynamic memories.

use acm_concept::{
    color::Appearance,
    ids::{FrameId, ObjectId, PartId, SkillId, TransitionId},
    literal::{Literal, Place},
    object::GroundedPart,
    pose::Pose,
    skill::{FailureCause, SkillReport},
    time::Time,
};
use serde::{Deserialize, Serialize};

/// A moment across runs: the episode's number in this memory, counted from 1, and the time within it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Moment {
    /// Number of the episode.
    pub episode: u32,
    /// Virtual time within the episode.
    pub time: Time,
}

/// What memory currently believes of an object's whereabouts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Presence {
    /// Believed to be where its pose says.
    Present,
    /// In the robot's hand.
    Held,
    /// Not where it was last believed to be; where it is now is unknown.
    Missing,
}

/// What made a change of an object's place known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlaceCause {
    /// Seen standing there.
    Seen(FrameId),
    /// Put there by the robot's own action.
    Own(TransitionId),
    /// Taken into the hand by the robot's own action.
    Grasped(TransitionId),
    /// Seen gone from its place.
    Gone(FrameId),
}

/// One entry of an object's history h: where it was from when on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HistoryEntry {
    /// When it became known.
    pub moment: Moment,
    /// Where it was; `None` while held or missing.
    pub place: Option<Place>,
    /// How it became known.
    pub cause: PlaceCause,
    /// Whether a second view or an own action confirmed it.
    pub verified: bool,
}

/// An object of object memory: m = (id, c, {P_i}, T, s, h).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectEntry {
    /// Persistent identity.
    pub id: ObjectId,
    /// Most likely category.
    pub category: String,
    /// Probabilities of the nouns that fit, best first.
    pub categories: Vec<(String, f64)>,
    /// Parts with fused parameters, at their current poses.
    pub parts: Vec<GroundedPart>,
    /// Fused colour.
    pub appearance: Appearance,
    /// Whether it is there, held or missing.
    pub presence: Presence,
    /// What it rests on: a remembered object, or `None` for the bare support (or while held or missing).
    pub support: Option<ObjectId>,
    /// Symbolic state s beside pose and support.
    pub state: Vec<Literal>,
    /// Probability that the object exists as described, 0-1.
    pub confidence: f64,
    /// Whether two views or an own action confirmed it.
    pub verified: bool,
    /// When it was last seen.
    pub last_seen: Moment,
    /// The frame that last showed it.
    pub last_frame: Option<FrameId>,
    /// In how many frames it was seen.
    pub views: u32,
    /// Other identities it may be, with probabilities, if the last assignment was ambiguous.
    pub ambiguous_with: Vec<(ObjectId, f64)>,
    /// Where it was, oldest first.
    pub history: Vec<HistoryEntry>,
}

impl ObjectEntry {
    /// Pose of the main part's base frame; `None` for an entry without parts.
    pub fn pose(&self) -> Option<Pose> {
        self.parts.first().map(|part| part.pose.pose)
    }
    /// The current place: pose and support; `None` while held or missing.
    pub fn place(&self) -> Option<Place> {
        (self.presence == Presence::Present)
            .then(|| {
                self.pose().map(|pose| Place {
                    support: self.support,
                    pose,
                    tolerance_m: 0.03,
                    heading_tolerance_rad: None,
                })
            })
            .flatten()
    }
    /// Id of the main part.
    pub fn main_part(&self) -> PartId {
        PartId { object: self.id, index: 0 }
    }
}

/// How a transition ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TransitionResult {
    /// Executed; not yet compared with what is seen.
    Pending,
    /// What was predicted is what was seen or felt.
    Verified,
    /// What was seen or felt contradicts what was predicted, or the controller failed.
    Failed {
        /// The kind of failure.
        cause: FailureCause,
        /// In words.
        reason: String,
    },
    /// The bounded looks did not decide it.
    CannotTell,
}

/// An entry of transition memory: m = (id, P, u, s_pre, s_post, r), with the report it rests on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Transition {
    /// Its id.
    pub id: TransitionId,
    /// When the skill ended.
    pub moment: Moment,
    /// The subtask (from 0) of the instruction that it served, if any.
    pub subtask: Option<u32>,
    /// State literals before, as far as they concern the skill.
    pub before: Vec<Literal>,
    /// The effects that were predicted.
    pub predicted: Vec<Literal>,
    /// State literals after, once verified or contradicted.
    pub after: Vec<Literal>,
    /// How it ended.
    pub result: TransitionResult,
    /// What the executor reported: target, action u, bound parameters, measurements.
    pub report: SkillReport,
}

impl Transition {
    /// The skill's name u.
    pub fn skill(&self) -> &str {
        &self.report.invocation.skill
    }
    /// The object acted on.
    pub fn object(&self) -> ObjectId {
        self.report.invocation.part.object
    }
}

/// An entry of skill memory: m_u = (u, type, tau, target, pre, Phi, pi_exec, eta). Template-grounded entries
/// are consolidated from verified transitions and carry over to every part with the same template.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SkillEntry {
    /// Its id.
    pub id: SkillId,
    /// Skill name u.
    pub skill: String,
    /// Template type tau.
    pub template: String,
    /// Function kind: the execution backend.
    pub kind: String,
    /// Applicability conditions.
    pub preconditions: Vec<Literal>,
    /// Bound parameters Phi that worked, by name: running means.
    pub parameters: Vec<(String, f64)>,
    /// Tries so far.
    pub tries: u32,
    /// Verified successes so far.
    pub successes: u32,
    /// The verified transitions it rests on.
    pub transitions: Vec<TransitionId>,
    /// The failed transitions that count against it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failures: Vec<TransitionId>,
    /// What subtasks that are done have taught beyond statistics; `None` before the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub general: Option<Box<General>>,
}

impl SkillEntry {
    /// A bound parameter for a part with these geometric parameters: by its law where it has one, else its mean.
    /// With the standard deviation of what is left, where one is known. `None` for a name that was never bound.
    ///
    /// ```
    /// # use acm_memory::entry::{General, Law, LawTerm, SkillEntry};
    /// let term = LawTerm { parameter: "width".into(), slope: 1.0 };
    /// let law = Law { name: "radius".into(), terms: vec![term], constant: -0.05, residual: 0.002, count: 9 };
    /// let mut entry: SkillEntry = serde_json::from_str(
    ///     r#"{"id":"S1","skill":"open","template":"door-left","kind":"hinge-open","preconditions":[],
    ///         "parameters":[["radius",0.4]],"tries":9,"successes":9,"transitions":[]}"#).unwrap();
    /// assert_eq!(entry.bound("radius", &|_| Some(0.6)), Some((0.4, None)));
    /// entry.general = Some(Box::new(General { laws: vec![law], ..General::default() }));
    /// let (radius, residual) = entry.bound("radius", &|name| (name == "width").then_some(0.6)).unwrap();
    /// assert!((radius - 0.55).abs() < 1e-12 && residual == Some(0.002));
    /// ```
    pub fn bound(&self, name: &str, value_of: &dyn Fn(&str) -> Option<f64>) -> Option<(f64, Option<f64>)> {
        let law = self.general.iter().flat_map(|general| &general.laws).find(|law| law.name == name);
        let by_law = law.and_then(|law| {
            let mut sum = law.constant;
            for term in &law.terms {
                sum += term.slope * value_of(&term.parameter)?;
            }
            Some((sum, Some(law.residual)))
        });
        let mean = || self.parameters.iter().find(|(known, _)| known == name).map(|(_, mean)| (*mean, None));
        by_law.or_else(mean)
    }
}

/// What verified executions of one skill on parts of one template have in common.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct General {
    /// The parts on which it succeeded.
    pub target: TargetSchema,
    /// Conditions that nobody declared: they held in every success, and tries without them failed.
    pub learned: Vec<LearnedCondition>,
    /// Tries in which no learned condition was known not to hold, and how many of these succeeded.
    pub sound: (u32, u32),
    /// How bound parameters follow from the part's geometry, where that tells more than their mean.
    pub laws: Vec<Law>,
}

/// Target schema: what the parts had in common on which a skill succeeded.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TargetSchema {
    /// Categories of their objects, in order.
    pub categories: Vec<String>,
    /// Affordances that all of them had, in order.
    pub affordances: Vec<String>,
    /// Least and greatest value of each geometric parameter, in the template's units.
    pub parameters: Vec<(String, f64, f64)>,
}

/// A condition read out of successes and failures, over `?self`, `?object` (where the part is not the whole object) and
/// `?support`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LearnedCondition {
    /// The condition.
    pub literal: Literal,
    /// Successes before which it was believed to hold. It was believed not to hold before none.
    pub successes: u32,
    /// Failures before which it was believed to hold.
    pub failures_with: u32,
    /// Failures before which it was believed not to hold.
    pub failures_without: u32,
}

/// A bound parameter as a linear function of geometric parameters of the part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Law {
    /// The bound parameter.
    pub name: String,
    /// One or two terms.
    pub terms: Vec<LawTerm>,
    /// What is added to them.
    pub constant: f64,
    /// Standard deviation of what the law leaves open, in the bound parameter's unit.
    pub residual: f64,
    /// Verified executions that it was fitted to.
    pub count: u32,
}

/// A term of a [`Law`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LawTerm {
    /// A geometric parameter of the template.
    pub parameter: String,
    /// Its factor.
    pub slope: f64,
}

/// Where the agent is in its instruction. It lives in memory so that a wiped memory forgets it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TaskProgress {
    /// Subtasks of the instruction that are done, in order, with the moment each was found done.
    pub done: Vec<(u32, Moment)>,
    /// When the instruction was given.
    pub instructed: Moment,
}

impl TaskProgress {
    /// Index of the first subtask that is not done.
    pub fn current(&self) -> u32 {
        self.done.last().map_or(0, |(index, _)| index + 1)
    }
    /// When the current subtask began: when the one before was done, or when the instruction was given.
    pub fn current_since(&self) -> Moment {
        self.done.last().map_or(self.instructed, |(_, moment)| *moment)
    }
}
