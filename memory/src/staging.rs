//! Hand-made percepts and reports, for tests of this and other memories: what perception and the executor would
//! say, written down in a line. Behind the feature `staging`.

use crate::{
    observation::{Executed, Grounding, LiteralVerdict, Note, Observation, Outcome, Verdict},
    query::SkillCandidate,
    traits::{Memory, MemoryError, MemoryView},
};
use acm_concept::{
    camera::{FrameHeader, Intrinsics, RgbdFrame},
    color::{Appearance, Lab},
    embodiment::Feedback,
    ids::{FrameId, ObjectId, TransitionId},
    literal::{Literal, Place, Term, Truth},
    object::{
        Blindness, ExpectedView, GroundedObject, GroundedPart, Observability, ParameterEstimate, Percepts,
        PixelSupport, PoseEstimate, SupportPlane, Visibility,
    },
    pose::Pose,
    skill::{FailureCause, SkillInvocation, SkillReport},
    time::Time,
};
use glam::DVec3;
use std::collections::BTreeMap;

/// How surely staged positions and sizes are seen, metres.
pub const SIGMA_M: f64 = 0.003;

/// Something that a camera shows, as perception would ground it.
#[derive(Debug, Clone, PartialEq)]
pub struct Thing {
    /// The one part.
    pub part: GroundedPart,
    /// Its nouns with probabilities, best first.
    pub nouns: Vec<(String, f64)>,
    /// Confidence of the percept.
    pub confidence: f64,
    /// Whether its outline is cut off.
    pub truncated: bool,
    /// Perception's hint.
    pub expected: Option<ObjectId>,
}

impl Thing {
    fn new(template: &str, parameters: &[(&str, f64)], words: &[&str], functions: &[&str], nouns: &[&str]) -> Thing {
        let estimate = |(name, value): &(&str, f64)| ParameterEstimate {
            name: (*name).into(),
            value: *value,
            sigma: SIGMA_M,
            observability: Observability::Observed,
        };
        let owned = |words: &[&str]| words.iter().map(|word| word.to_string()).collect();
        let share = 1.0 / nouns.len().max(1) as f64;
        let appearance = Appearance::plain(Lab::from_srgb([128, 128, 128]), 3.0);
        let pose = PoseEstimate { pose: Pose::IDENTITY, position_sigma_m: DVec3::splat(SIGMA_M), yaw_sigma_rad: 0.03 };
        let part = GroundedPart {
            name: acm_concept::template::WHOLE.into(),
            template: template.into(),
            parameters: parameters.iter().map(estimate).collect(),
            pose,
            affordances: owned(words),
            functions: owned(functions),
            appearance,
        };
        let nouns = nouns.iter().map(|noun| (noun.to_string(), share)).collect();
        Thing { part, nouns, confidence: 0.9, truncated: false, expected: None }
    }
    /// A box with the given sides, metres.
    pub fn block([length, width, height]: [f64; 3]) -> Thing {
        let parameters = [("length", length), ("width", width), ("height", height)];
        let cube = length.max(height) < 1.35 * width.min(height) && length < 0.12;
        let nouns: &[&str] = match (cube, length < 0.15) {
            (true, _) => &["cube", "block", "box"],
            (false, true) => &["block", "box"],
            (false, false) => &["box"],
        };
        Thing::new("box", &parameters, &["graspable", "supportive"], &["pick", "place"], nouns)
    }
    /// An upright cylinder, metres.
    pub fn can(radius: f64, height: f64) -> Thing {
        let parameters = [("radius", radius), ("height", height)];
        Thing::new("cylinder", &parameters, &["graspable", "supportive"], &["pick", "place"], &["can", "cylinder"])
    }
    /// A flat mat, metres.
    pub fn mat(length: f64, width: f64) -> Thing {
        let parameters = [("length", length), ("width", width), ("thickness", 0.001)];
        Thing::new("mat", &parameters, &["supportive"], &[], &["mat", "pad", "marker"])
    }
    /// A button, metres.
    pub fn button(radius: f64, height: f64) -> Thing {
        let parameters = [("radius", radius), ("height", height)];
        Thing::new("button", &parameters, &["pressable"], &["press"], &["button", "key", "switch"])
    }
    /// The same with the middle of its base at a point of the world, metres.
    pub fn at(mut self, x: f64, y: f64, z: f64) -> Thing {
        self.part.pose.pose.translation = DVec3::new(x, y, z);
        self
    }
    /// The same with another heading, radians.
    pub fn turned(mut self, yaw: f64) -> Thing {
        self.part.pose.pose = Pose::from_yaw(self.part.pose.pose.translation, yaw);
        self
    }
    /// The same in another colour, 8-bit sRGB.
    pub fn colored(mut self, rgb: [u8; 3]) -> Thing {
        self.part.appearance.mean = Lab::from_srgb(rgb);
        self
    }
    /// The same with another confidence.
    pub fn sure(mut self, confidence: f64) -> Thing {
        self.confidence = confidence;
        self
    }
    /// The same with its outline cut off.
    pub fn cut(mut self) -> Thing {
        self.truncated = true;
        self
    }
    /// The same, with positions known to the given standard deviation, metres.
    pub fn spread(mut self, sigma_m: f64) -> Thing {
        self.part.pose.position_sigma_m = DVec3::splat(sigma_m);
        self
    }
    /// Its parts.
    pub fn parts(&self) -> Vec<GroundedPart> {
        vec![self.part.clone()]
    }
    /// The percept.
    pub fn grounded(&self) -> GroundedObject {
        GroundedObject {
            category: self.nouns.first().map_or_else(String::new, |(noun, _)| noun.clone()),
            categories: self.nouns.clone(),
            parts: self.parts(),
            appearance: self.part.appearance,
            support: PixelSupport { count: 100, bounds: [0, 0, 9, 9], runs: vec![0, 100] },
            confidence: self.confidence,
            truncated: self.truncated,
            expected: self.expected,
            readings: Vec::new(),
        }
    }
}

/// An empty open hand, high above the table.
pub fn open_hand(seconds: f64) -> Feedback {
    Feedback {
        time: Time::from_seconds(seconds),
        tcp: Pose::from_translation(DVec3::new(0.0, -0.3, 0.3)),
        joints: Vec::new(),
        opening_m: 0.08,
        commanded_opening_m: 0.08,
        pad_force_n: [DVec3::ZERO; 2],
        wrist_force_n: DVec3::ZERO,
        ..Feedback::default()
    }
}

/// A hand that grips something 4 cm wide.
pub fn gripping_hand(seconds: f64) -> Feedback {
    Feedback {
        opening_m: 0.04,
        commanded_opening_m: 0.0,
        pad_force_n: [DVec3::new(0.0, -8.0, 0.0), DVec3::new(0.0, 8.0, 0.0)],
        ..open_hand(seconds)
    }
}

/// Header of a staged frame: a tiny image, for memories look at percepts only.
fn header(frame: u64, seconds: f64) -> FrameHeader {
    FrameHeader {
        id: FrameId(frame),
        camera: "head".into(),
        time: Time::from_seconds(seconds),
        intrinsics: Intrinsics { width: 1, height: 1, fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 },
        camera_pose: Pose::IDENTITY,
    }
}

/// The table under all staged things: z = 0.
pub fn table() -> SupportPlane {
    let appearance = Appearance::plain(Lab::from_srgb([230, 230, 230]), 2.0);
    SupportPlane { normal: DVec3::Z, offset_m: 0.0, residual_m: 0.001, appearance }
}

/// Shows a memory a frame with the given things, and what it says of expected objects.
pub fn look(
    memory: &mut dyn Memory,
    frame: u64,
    seconds: f64,
    things: &[Thing],
    views: &[(ObjectId, Visibility, f64)],
    hand: &Feedback,
) -> Result<Grounding, MemoryError> {
    let view = |(object, visibility, fraction): &(ObjectId, Visibility, f64)| ExpectedView {
        object: *object,
        visibility: *visibility,
        fraction: *fraction,
    };
    let percepts = Percepts {
        frame: header(frame, seconds),
        support: Some(table()),
        objects: things.iter().map(Thing::grounded).collect(),
        expected: views.iter().map(view).collect(),
        blindness: None,
        depth_fraction: 0.9,
    };
    show(memory, &percepts, hand)
}

/// Shows a memory a frame without any depth.
pub fn look_blind(
    memory: &mut dyn Memory,
    frame: u64,
    seconds: f64,
    hand: &Feedback,
) -> Result<Grounding, MemoryError> {
    let percepts = Percepts {
        frame: header(frame, seconds),
        support: None,
        objects: Vec::new(),
        expected: Vec::new(),
        blindness: Some(Blindness::NoDepth),
        depth_fraction: 0.0,
    };
    show(memory, &percepts, hand)
}

fn show(memory: &mut dyn Memory, percepts: &Percepts, hand: &Feedback) -> Result<Grounding, MemoryError> {
    let header = percepts.frame.clone();
    let frame = RgbdFrame { header, color: vec![0; 3].into(), depth: vec![0.0].into() };
    memory.observe(&Observation { percepts, frame: &frame, feedback: hand })
}

/// Begins a run and gives an instruction.
pub fn begin(memory: &mut dyn Memory) -> Result<(), MemoryError> {
    memory.note(&Note::EpisodeBegan)?;
    memory.note(&Note::Instructed { time: Time::ZERO, text: "put it back where it came from".into() })
}

/// A report of a skill on an object, run for two seconds until `ended_s`, that felt and left nothing.
pub fn report(view: &dyn MemoryView, skill: &str, object: ObjectId, ended_s: f64) -> Option<Executed> {
    let entry = view.object(object)?;
    let target = entry.parts.first()?.clone();
    let function = view.library().get(&target.template)?.function(skill)?;
    let invocation = SkillInvocation {
        skill: skill.into(),
        entry: None,
        kind: function.kind.clone(),
        part: entry.main_part(),
        frame: target.pose.pose,
        target,
        arguments: BTreeMap::from([("grip_width".to_string(), 0.04)]),
        destination: None,
        obstacles: Vec::new(),
        support_height_m: 0.0,
        held: None,
        held_solids: vec![],
        attempt: 0,
    };
    let report = SkillReport {
        invocation,
        failure: None,
        primitives: Vec::new(),
        started: Time::from_seconds(ended_s - 2.0),
        ended: Time::from_seconds(ended_s),
        measured: BTreeMap::new(),
        felt: Vec::new(),
        left_at: None,
        held: None,
    };
    Some(Executed { report, subtask: Some(view.progress().current()), predicted: Vec::new() })
}

impl Executed {
    /// The same, with effects that were predicted.
    pub fn predicting(mut self, candidate: &SkillCandidate) -> Executed {
        self.predicted.clone_from(&candidate.effects);
        self
    }
    /// The same, having felt a literal for certain.
    pub fn feeling(mut self, literal: Literal) -> Executed {
        self.report.felt.push((literal, 0.95));
        self
    }
    /// The same, with the object in the hand, 2 cm below the fingertips.
    pub fn holding(mut self) -> Executed {
        let object = self.report.invocation.part.object;
        self.report.held = Some((object, Pose::from_translation(DVec3::new(0.0, 0.0, -0.02))));
        self.report.felt.push((Literal::new("holding", vec![Term::Object(object)]), 0.95));
        self
    }
    /// The same, with the object left standing at a place.
    pub fn leaving(mut self, place: Place) -> Executed {
        self.report.invocation.destination = Some(place);
        self.report.left_at = Some(place.pose);
        self.report.felt.push((Literal::new("hand-empty", Vec::new()), 0.95));
        self
    }
    /// The same, failed.
    pub fn failing(mut self, cause: FailureCause, reason: &str) -> Executed {
        self.report.failure = Some((cause, reason.into()));
        self
    }
}

/// Judges a transition as a verifier would, by its report and by what memory believes of its predicted effects,
/// and settles it.
pub fn verify(memory: &mut dyn Memory, transition: TransitionId) -> Result<Outcome, MemoryError> {
    let view = memory.view();
    let known = view.transitions().iter().find(|known| known.id == transition);
    let known = known.ok_or(MemoryError::UnknownTransition(transition))?;
    let (predicted, failed) = (known.predicted.clone(), known.report.failure.is_some());
    let judge = |literal: Literal| {
        let observed = view.belief(&literal);
        let outcome = match observed.truth {
            Truth::Yes => Outcome::Verified,
            Truth::No => Outcome::Contradicted,
            Truth::Unknown => Outcome::CannotTell,
        };
        LiteralVerdict { literal, observed, outcome }
    };
    let literals: Vec<LiteralVerdict> = predicted.into_iter().map(judge).collect();
    let any = |outcome| literals.iter().any(|literal| literal.outcome == outcome);
    let outcome = if failed || any(Outcome::Contradicted) {
        Outcome::Contradicted
    } else if any(Outcome::CannotTell) {
        Outcome::CannotTell
    } else {
        Outcome::Verified
    };
    memory.settle(transition, &Verdict { outcome, literals, reason: "compared with the last look".into() })?;
    Ok(outcome)
}
