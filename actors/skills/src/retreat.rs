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

/// A running retreat: straight up to the height of home, level to above it, then to it. Fingers stay as they are. Arms go
/// home one after the other; the one that moved last stays the one that is reported, and so goes last.
#[derive(Debug)]
pub struct Retreat {
    robot: RobotDescription,
    flight: Flight,
    /// Arms that are not home yet, the next one last.
    waiting: Vec<usize>,
    started: Option<Time>,
    failure: Option<String>,
    finished: Option<PrimitiveReport>,
}

/// One hand on its way home.
#[derive(Debug)]
struct Flight {
    hand: Hand,
    path: Path,
    holding: bool,
    settle_ticks: u32,
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
    let away = |arm: &usize| {
        let home = robot.of_arm(*arm).map(|robot| robot.home.translation);
        let here = feedback.of_arm(*arm).map(|felt| felt.tcp.translation);
        home.zip(here).is_some_and(|(home, here)| home.distance(here) > THERE_M)
    };
    let mut waiting = vec![feedback.arm];
    waiting.extend((0..robot.arms()).rev().filter(|arm| *arm != feedback.arm).filter(away));
    let first = waiting.pop().unwrap_or(feedback.arm);
    let flight = Flight::begin(robot, feedback, first);
    Retreat { robot: robot.clone(), flight, waiting, started: None, failure: None, finished: None }
}

impl Retreat {
    /// Takes the newest feedback and says what to do for the next control tick. Bounded by the paths' lengths.
    pub fn tick(&mut self, feedback: &Feedback) -> RetreatTick {
        self.started.get_or_insert(feedback.time);
        if let Some(report) = &self.finished {
            return RetreatTick::Finished(report.clone());
        }
        loop {
            match self.flight.tick(feedback, &mut self.failure) {
                Some(command) => return RetreatTick::Act(command),
                None => match self.waiting.pop() {
                    Some(arm) => self.flight = Flight::begin(&self.robot, feedback, arm),
                    None => return self.finish(feedback),
                },
            }
        }
    }

    fn finish(&mut self, feedback: &Feedback) -> RetreatTick {
        let started = self.started.unwrap_or(feedback.time);
        let failure = self.failure.take();
        let report = PrimitiveReport { primitive: Primitive::Reach, started, ended: feedback.time, failure };
        self.finished = Some(report.clone());
        RetreatTick::Finished(report)
    }
}

impl Flight {
    fn begin(robot: &RobotDescription, feedback: &Feedback, arm: usize) -> Flight {
        let hand = Hand::of_arm(robot, feedback, arm);
        let feedback = feedback.of_arm(arm).unwrap_or(feedback);
        let (robot, holding) = (&hand.robot, holds_something(feedback));
        let pace = if holding { Pace::carrying(robot) } else { Pace::free(robot) };
        let heading = robot.home.yaw();
        // Half a turn more or less looks the same to a floating hand; an arm goes home to the joints it waits at.
        let turn = if robot.arm.is_some() { 0.0 } else { nearest_heading(heading, feedback.tcp.yaw()) - heading };
        let home = Pose::new(robot.home.translation, DQuat::from_rotation_z(turn) * robot.home.rotation);
        let path = Path::over(hand.command.tcp, home, home.translation.z, pace, robot.tick_s);
        Flight { hand, path, holding, settle_ticks: 0 }
    }

    /// The next command, or `None` when this hand has ended; a failure on the way is noted.
    fn tick(&mut self, feedback: &Feedback, failure: &mut Option<String>) -> Option<Command> {
        let feedback = feedback.of_arm(self.hand.command.arm).unwrap_or(feedback);
        self.hand.observe(feedback);
        let lost = feedback.opening_m < CLOSED_M && !holds_something(feedback);
        if self.holding && lost {
            self.holding = false;
            failure.get_or_insert("what was held was lost on the way".into());
        }
        let force_n = self.hand.felt_n().length();
        if force_n > COLLISION_N {
            failure.get_or_insert(format!("felt {force_n:.0} N on the way home"));
            return None;
        }
        if self.hand.follow(&mut self.path) {
            let command = self.hand.command();
            return match self.hand.fault() {
                Some(reason) => {
                    failure.get_or_insert(reason);
                    None
                }
                None => Some(command),
            };
        }
        let distance_m = feedback.tcp.translation.distance(self.path.end().translation);
        if distance_m < THERE_M {
            return None;
        }
        self.settle_ticks += 1;
        if self.settle_ticks > self.hand.ticks(SETTLE_S) {
            failure.get_or_insert(format!("came to rest {:.1} mm from home", 1e3 * distance_m));
            return None;
        }
        Some(self.hand.command())
    }
}
