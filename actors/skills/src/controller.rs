//! What a controller is, how one is started, and why one cannot be.

use crate::{
    arm::choice::choose,
    functions::{
        articulated::{HINGED, Jointed, SLIDING},
        *,
    },
    hand::Hand,
    run::{Function, Run},
    sequence::Sequence,
};
use acm_concept::{
    embodiment::{Command, Feedback, RobotDescription},
    skill::{SkillInvocation, SkillReport},
};
use glam::DVec3;
use thiserror::Error;

/// A running skill. It ends by itself: every primitive has a time limit.
pub trait Controller: Send {
    /// Takes the newest feedback and says what to do for the next control tick. The first call gets the feedback
    /// of the moment. After it has finished, every further call returns the same report.
    fn tick(&mut self, feedback: &Feedback) -> Tick;
}

/// What a controller wants.
#[derive(Debug, Clone, PartialEq)]
pub enum Tick {
    /// Perform this command for [`RobotDescription::tick_s`] seconds, then call again.
    Act(Command),
    /// The skill has ended, well or badly.
    Finished(Box<SkillReport>),
}

/// Why a skill was not even begun. Nothing has moved.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StartError {
    /// No controller of that kind.
    #[error("there is no function kind `{kind}`; this build has: {known}")]
    UnknownKind {
        /// The kind that was asked for.
        kind: String,
        /// The kinds there are.
        known: String,
    },
    /// An argument that the kind needs is absent, not finite or not positive.
    #[error("`{kind}` needs a positive argument `{argument}`, got {got}: bind it in the template's function")]
    Argument {
        /// The function kind.
        kind: String,
        /// The argument's name.
        argument: &'static str,
        /// What was given.
        got: String,
    },
    /// A pose the hand would have to take lies outside the workspace.
    #[error("{what} at ({:.3}, {:.3}, {:.3}) m is outside the workspace ({:.3}, {:.3}, {:.3}) to ({:.3}, {:.3}, {:.3}) m",
        position.x, position.y, position.z, min.x, min.y, min.z, max.x, max.y, max.z)]
    OutOfReach {
        /// Which pose.
        what: &'static str,
        /// TCP position, world frame, metres.
        position: DVec3,
        /// Smallest corner of the workspace.
        min: DVec3,
        /// Largest corner of the workspace.
        max: DVec3,
    },
    /// The part is wider than the hand opens, across every side that can be grasped.
    #[error("the part is {:.1} mm wide and the hand opens {:.1} mm: take another part or another function",
        1e3 * width_m, 1e3 * opening_m)]
    TooWide {
        /// Narrowest side, metres.
        width_m: f64,
        /// Largest opening, metres.
        opening_m: f64,
    },
    /// Perceived neighbours leave no room for the hand in any heading it could take.
    #[error("no free way to {what}: in the freest heading the hand would be {:.1} mm inside a perceived neighbour: clear it first",
        1e3 * overlap_m)]
    Blocked {
        /// What the hand was to do.
        what: &'static str,
        /// How deep the hand would be inside the neighbour, metres.
        overlap_m: f64,
    },
    /// The skill needs an empty hand, but the fingers hold something.
    #[error("`{kind}` needs an empty hand, but the fingers are held open at {:.1} mm: place what they hold first", 1e3 * opening_m)]
    HandNotEmpty {
        /// The function kind.
        kind: String,
        /// Measured opening, metres.
        opening_m: f64,
    },
    /// The skill needs something in the hand, and the invocation does not say what.
    #[error(
        "`{kind}` needs what is held and how it sits in the hand, but the invocation names nothing: grasp it first"
    )]
    NothingHeld {
        /// The function kind.
        kind: String,
    },
    /// The skill needs a destination.
    #[error("`{kind}` needs a destination, but the invocation has none: bind `?destination`")]
    NoDestination {
        /// The function kind.
        kind: String,
    },
    /// The hand would have to come from where it cannot.
    #[error("for that the hand would have to tilt by {:.0} degrees from pointing down; take it in another way", tilt_rad.to_degrees())]
    Tilted {
        /// Angle between the approach direction and straight down, radians.
        tilt_rad: f64,
    },
}

/// Starts a function kind.
type Start = fn(&SkillInvocation, Hand, &Feedback) -> Result<Box<dyn Controller>, StartError>;

/// A function kind: its name, the arguments that it cannot do without, and what starts it.
type Kind = (&'static str, &'static [&'static str], Start);

/// The function kinds, in alphabetical order.
const KINDS: &[Kind] = &[
    ("flip", &["grip_width", "height"], |i, h, f| Ok(run(i, Sequence::new(flip::Flip::plan(i, &h, f)?), h))),
    ("grasp-along", &["grip_width", "height"], |i, h, f| {
        Ok(run(i, Sequence::new(grasp_along::GraspAlong::plan(i, &h, f)?), h))
    }),
    // What a hand does to take a part from above depends on the hand.
    ("grasp-from-above", &["grip_width", "height"], |i, h, f| match h.robot.suction.is_some() {
        true => Ok(run(i, suck_from_above::SuckFromAbove::plan(i, &h, f)?, h)),
        false => Ok(run(i, grasp_from_above::GraspFromAbove::plan(i, &h, f)?, h)),
    }),
    ("hinge-close", &[HINGED.travel], |i, h, _| close_it(i, h, HINGED)),
    ("hinge-open", &[HINGED.travel], |i, h, _| open_it(i, h, HINGED)),
    ("insert-along", &["depth", "clearance"], |i, h, f| {
        Ok(run(i, Sequence::new(insert_along::InsertAlong::plan(i, &h, f)?), h))
    }),
    ("move-to", &[], |i, h, _| Ok(run(i, Sequence::new(move_to::plan(i, &h)?), h))),
    ("place-upright", &["height"], |i, h, f| Ok(run(i, place_upright::PlaceUpright::plan(i, &h, f)?, h))),
    ("press", &["stroke", "force"], |i, h, f| Ok(run(i, Sequence::new(press::Press::plan(i, &h, f)?), h))),
    ("press-down", &["stroke", "force"], |i, h, f| Ok(run(i, press_down::PressDown::plan(i, &h, f)?, h))),
    ("pull-along", &["grip_width", "travel"], |i, h, _| Ok(run(i, Sequence::new(pull_along::plan(i, &h)?), h))),
    ("push-along", &["travel"], |i, h, _| Ok(run(i, Sequence::new(push_along::plan(i, &h)?), h))),
    ("reach", &["distance"], |i, h, _| Ok(run(i, Sequence::new(reach::Reach::plan(i, &h)?), h))),
    ("release", &[], |i, h, _| Ok(run(i, Sequence::new(release::Release::plan(i)?), h))),
    ("rotate", &["angle"], |i, h, _| Ok(run(i, Sequence::new(rotate::plan(i, &h)?), h))),
    ("slice", &["force"], |i, h, _| Ok(run(i, Sequence::new(slice::Slice::plan(i, &h)?), h))),
    ("slide-close", &[SLIDING.travel], |i, h, _| close_it(i, h, SLIDING)),
    ("slide-open", &[SLIDING.travel], |i, h, _| open_it(i, h, SLIDING)),
    ("turn", &["grip_width", "angle"], |i, h, _| Ok(run(i, Sequence::new(turn::plan(i, &h)?), h))),
];

/// By its handle where there is one to take, else by its edge.
fn open_it(invocation: &SkillInvocation, hand: Hand, jointed: Jointed) -> Result<Box<dyn Controller>, StartError> {
    match invocation.arguments.contains_key("grip_width") {
        true => Ok(run(invocation, Sequence::new(open::draw(invocation, &hand, jointed)?), hand)),
        false => Ok(run(invocation, Sequence::new(open::drag(invocation, &hand, jointed)?), hand)),
    }
}

/// By its handle where there is one to take, else by a push from outside.
fn close_it(invocation: &SkillInvocation, hand: Hand, jointed: Jointed) -> Result<Box<dyn Controller>, StartError> {
    match invocation.arguments.contains_key("grip_width") {
        true => Ok(run(invocation, Sequence::new(close::draw(invocation, &hand, jointed)?), hand)),
        false => Ok(run(invocation, Sequence::new(close::push(invocation, &hand, jointed)?), hand)),
    }
}

fn run(invocation: &SkillInvocation, function: impl Function + 'static, hand: Hand) -> Box<dyn Controller> {
    Box::new(Run::new(invocation, hand, function))
}

/// The function kinds that this build can run, in alphabetical order.
pub fn kinds() -> Vec<&'static str> {
    KINDS.iter().map(|(kind, ..)| *kind).collect()
}

/// The arguments that a function kind cannot do without; `None` if there is no such kind.
pub fn required_arguments(kind: &str) -> Option<&'static [&'static str]> {
    KINDS.iter().find(|(name, ..)| *name == kind).map(|(_, required, _)| *required)
}

/// Starts the controller of `invocation.kind`. The feedback must be the present one: the motion begins where the
/// hand is. Geometry is checked here, so that what cannot be done is refused before anything moves.
pub fn start(
    invocation: &SkillInvocation,
    robot: &RobotDescription,
    feedback: &Feedback,
) -> Result<Box<dyn Controller>, StartError> {
    let Some((_, required, start)) = KINDS.iter().find(|(kind, ..)| *kind == invocation.kind) else {
        return Err(StartError::UnknownKind { kind: invocation.kind.clone(), known: kinds().join(", ") });
    };
    for name in *required {
        argument(invocation, name)?;
    }
    let arm = choose(invocation, robot, feedback);
    let hand = Hand::for_skill(invocation, robot, feedback, arm);
    start(invocation, hand, feedback.of_arm(arm).unwrap_or(feedback))
}
