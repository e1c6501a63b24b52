//! A skill bound to a grounded part, and what came of it.

use crate::{
    ids::{ObjectId, PartId, SkillId},
    literal::{Literal, Place},
    object::GroundedPart,
    pose::Pose,
    primitive::Primitive,
    solid::PlacedSolid,
    time::Time,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A manipulation function bound to a part: all that a controller needs, in perceived geometry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SkillInvocation {
    /// The skill's name, which is the function's name in the template: `pick`, `place`, `press`.
    pub skill: String,
    /// The entry of skill memory it was taken from, if any.
    pub entry: Option<SkillId>,
    /// Function kind: which controller of acm-skills runs it.
    pub kind: String,
    /// The part it acts on.
    pub part: PartId,
    /// The part as remembered now.
    pub target: GroundedPart,
    /// Pose of the function's frame in the world (the template's frame expressions at the part's parameters).
    pub frame: Pose,
    /// The function's arguments, evaluated at the part's parameters: widths, depths, forces.
    pub arguments: BTreeMap<String, f64>,
    /// Where what is held shall stand, for skills that place.
    pub destination: Option<Place>,
    /// Perceived solids in the world, with the object each belongs to. The target's own are among them, for the links of
    /// an arm; the hand works at the target and keeps clear of the others.
    pub obstacles: Vec<(ObjectId, PlacedSolid)>,
    /// Perceived height of the surface under the target or destination, world z, metres.
    pub support_height_m: f64,
    /// How what is held sits in the hand: pose of its base frame in the TCP frame, and its part.
    pub held: Option<(ObjectId, Pose, GroundedPart)>,
    /// The perceived solids of what is held, in its base frame.
    #[serde(default)]
    pub held_solids: Vec<PlacedSolid>,
    /// 0 for the first try; each retry takes other parameters (another grasp heading, a deeper press).
    pub attempt: u32,
}

/// How one primitive of a skill ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PrimitiveReport {
    /// Which primitive.
    pub primitive: Primitive,
    /// When it began.
    pub started: Time,
    /// When it ended.
    pub ended: Time,
    /// `None` if its intermediate checks held; otherwise the check that failed, in words.
    pub failure: Option<String>,
}

/// The kinds of failure that reports and statistics tell apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailureCause {
    /// Something was not seen, or seen wrongly.
    Perception,
    /// The wrong object was taken for another.
    Identity,
    /// No plan, or a wrong one.
    Plan,
    /// The fingers did not hold the object.
    Grasp,
    /// The object did not come to stand where it should.
    Place,
    /// A button or switch did not take the press.
    Press,
    /// The hand touched something it should not, or a limit was reached.
    Motion,
}

impl FailureCause {
    /// The word used in tables.
    pub fn word(self) -> &'static str {
        match self {
            FailureCause::Perception => "perception",
            FailureCause::Identity => "identity",
            FailureCause::Plan => "plan",
            FailureCause::Grasp => "grasp",
            FailureCause::Place => "place",
            FailureCause::Press => "press",
            FailureCause::Motion => "motion",
        }
    }
}

/// What the executor reports of a finished skill: what the robot itself felt, never what the world is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SkillReport {
    /// What was run.
    pub invocation: SkillInvocation,
    /// `None` if the controller's own checks held to the end.
    pub failure: Option<(FailureCause, String)>,
    /// The primitives in order.
    pub primitives: Vec<PrimitiveReport>,
    /// When the first tick was sent.
    pub started: Time,
    /// When the last tick ended.
    pub ended: Time,
    /// Measured numbers by name with units last: `grip_width_m`, `press_force_n`, `press_travel_m`, ...
    pub measured: BTreeMap<String, f64>,
    /// Literals that the robot felt to be so, with a confidence each: `holding(O1)` from the fingers' gap.
    pub felt: Vec<(Literal, f64)>,
    /// Where the skill believes to have left the object (base frame in the world), from the arm's own pose.
    pub left_at: Option<Pose>,
    /// How what is now held sits in the hand (base frame in the TCP frame).
    pub held: Option<(ObjectId, Pose)>,
}
