//! The motion home, so that the cameras see the table.

use crate::{
    geometry::nearest_heading,
    hand::{CLOSED_M, Hand, holds_something},
    motion::{Pace, Path},
};
use acm_concept::{
    embodiment::{Command, Feedback, RobotDescription},
    pose::Pose,
    primitive::Primitive,
    skill::PrimitiveReport,
    time::Time,
};
use glam::DQuat;

/// How long the hand may take to come to rest at home after its last command, seconds.
const SETTLE_S: f64 = 0.5;
/// How near home counts as there, metres.
const THERE_M: f64 = 0.005;
/// A filtered force beyond this during the motion is a collision, newtons.
const COLLISION_N: f64 = 30.0;

/// A running retreat: straight up to the height of home, level to above it, then to it. Fingers stay as they are.
#[derive(Debug)]
pub struct Retreat {
    hand: Hand,
    path: Path,
    holding: bool,
    started: Option<Time>,
    settle_ticks: u32,
    failure: Option<String>,
    finished: Option<PrimitiveReport>,
}

/// What a retreat wants.
#[derive(Debug, Clone, PartialEq)]
pub enum RetreatTick {
    /// Perform this command for one control tick, then call again.
    Act(Command),
    /// The hand is home, or the motion ended early; then `failure` says why. A loss on the way is a failure too,
    /// but the hand goes home all the same.
    Finished(PrimitiveReport),
}

/// Starts the motion home. What the hand holds stays in it, at home's height or higher all the way.
///
/// ```
/// # use acm_concept::{embodiment::{Embodiment, EmbodimentError}, skill::PrimitiveReport};
/// # use acm_skills::{RetreatTick, retreat};
/// fn go_home(arm: &mut dyn Embodiment) -> Result<PrimitiveReport, EmbodimentError> {
///     let mut feedback = arm.feedback();
///     let mut retreat = retreat(arm.description(), &feedback);
///     loop {
///         match retreat.tick(&feedback) {
///             RetreatTick::Act(command) => feedback = arm.command(&command)?,
///             RetreatTick::Finished(report) => return Ok(report),
///         }
///     }
/// }
/// ```
pub fn retreat(robot: &RobotDescription, feedback: &Feedback) -> Retreat {
    let hand = Hand::new(robot, feedback);
    let robot = &robot.only(feedback.arm);
    let holding = holds_something(feedback);
    let pace = if holding { Pace::carrying(robot) } else { Pace::free(robot) };
    let heading = robot.home.yaw();
    // Half a turn more or less looks the same to a floating hand; an arm goes home to the joints it waits at.
    let turn = if robot.arm.is_some() { 0.0 } else { nearest_heading(heading, feedback.tcp.yaw()) - heading };
    let home = Pose::new(robot.home.translation, DQuat::from_rotation_z(turn) * robot.home.rotation);
    let path = Path::over(hand.command.tcp, home, home.translation.z, pace, robot.tick_s);
    Retreat { hand, path, holding, started: None, settle_ticks: 0, failure: None, finished: None }
}

impl Retreat {
    /// Takes the newest feedback and says what to do for the next control tick. Bounded by the path's length.
    pub fn tick(&mut self, feedback: &Feedback) -> RetreatTick {
        self.started.get_or_insert(feedback.time);
        self.hand.observe(feedback);
        if let Some(report) = &self.finished {
            return RetreatTick::Finished(report.clone());
        }
        let lost = feedback.opening_m < CLOSED_M && !holds_something(feedback);
        if self.holding && lost {
            self.holding = false;
            self.failure = Some("what was held was lost on the way".into());
        }
        let force_n = self.hand.felt_n().length();
        if force_n > COLLISION_N {
            return self.finish(feedback, Some(format!("felt {force_n:.0} N on the way home")));
        }
        if self.hand.follow(&mut self.path) {
            let command = self.hand.command();
            return match self.hand.fault() {
                Some(reason) => self.finish(feedback, Some(reason)),
                None => RetreatTick::Act(command),
            };
        }
        let distance_m = feedback.tcp.translation.distance(self.path.end().translation);
        if distance_m < THERE_M {
            let failure = self.failure.take();
            return self.finish(feedback, failure);
        }
        self.settle_ticks += 1;
        if self.settle_ticks > self.hand.ticks(SETTLE_S) {
            return self.finish(feedback, Some(format!("came to rest {:.1} mm from home", 1e3 * distance_m)));
        }
        RetreatTick::Act(self.hand.command())
    }

    fn finish(&mut self, feedback: &Feedback, failure: Option<String>) -> RetreatTick {
        let started = self.started.unwrap_or(feedback.time);
        let report = PrimitiveReport { primitive: Primitive::Reach, started, ended: feedback.time, failure };
        self.finished = Some(report.clone());
        RetreatTick::Finished(report)
    }
}
