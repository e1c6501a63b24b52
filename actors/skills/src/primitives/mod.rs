//! The primitives: small state machines with intermediate checks and an outcome.

mod carry;
mod follow;
mod grasp;
mod grip;
mod insert;
mod press;
mod reach;
mod release;
mod suck;

pub(crate) use carry::{Carry, Lower};
pub(crate) use follow::{Follow, FollowPlan, Hold, Pressing};
pub(crate) use grasp::{Grasp, GraspPlan};
pub(crate) use grip::{Grip, GripWatch};
pub(crate) use insert::{Insert, InsertPlan};
pub(crate) use press::{Press, PressPlan};
pub(crate) use reach::Reach;
pub(crate) use release::Release;
pub(crate) use suck::Suck;

use crate::{articulation::Articulation, hand::Hand};
use acm_concept::{embodiment::Feedback, pose::Pose, primitive::Primitive as Kind, skill::FailureCause};
use glam::DVec3;
use std::collections::VecDeque;

/// A filtered force beyond this while nothing should touch the hand is a collision, newtons.
const COLLISION_N: f64 = 30.0;
/// How long the hand stands still before its wrist's zero is taken, seconds.
const REST_S: f64 = 0.14;
/// Readings that make a new zero.
const BASELINE_READINGS: usize = 6;
/// How near the measured TCP must come to the commanded one, metres and radians.
const ARRIVED_M: f64 = 0.003;
const ARRIVED_RAD: f64 = 0.035;

/// One atomic motion. Each tick it either edits the hand's command, or ends without having done so.
pub(crate) trait Primitive: Send {
    /// Which of the nine it is.
    fn kind(&self) -> Kind;
    /// Longest time it may take, seconds.
    fn limit_s(&self) -> f64;
    /// One tick.
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step;
}

/// What a tick of a primitive came to.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Step {
    /// The hand's command is to be sent.
    Act,
    /// The primitive's checks held to the end.
    Done(Outcome),
    /// A check failed.
    Failed(Failure),
}

/// What a primitive found out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// The hand is where it should be.
    Arrived,
    /// What is held touched something with this force at this measured TCP height, or `None` if it never did.
    Lowered { touch_n: Option<f64>, height_m: f64 },
    /// The fingers stopped around something of this width, and at this gap under full force, with the TCP there;
    /// the tips had touched something on the way down or not.
    Grasped { width_m: f64, gap_m: f64, tcp: Pose, touched: bool },
    /// The greatest force, and how far the hand went on after the first touch.
    Pushed { force_n: f64, travel_m: f64 },
    /// How far the part went, metres or radians, the joint as its way told it, the greatest force along the way, and
    /// whether the part stopped by itself.
    Followed { travelled: f64, joint: Articulation, resistance_n: f64, stopped: bool },
    /// How deep what was held went in, how far off the opening was searched for, and the greatest force.
    Inserted { depth_m: f64, searched_m: f64, force_n: f64 },
    /// The fingers are open; whether both pads are free.
    Released { free: bool },
}

/// A check that failed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Failure {
    pub cause: FailureCause,
    pub reason: String,
    /// Whether the fingers feel that they hold nothing.
    pub empty_handed: bool,
}

impl Failure {
    pub fn new(cause: FailureCause, reason: String) -> Failure {
        Failure { cause, reason, empty_handed: false }
    }
    pub fn empty_handed(cause: FailureCause, reason: String) -> Failure {
        Failure { cause, reason, empty_handed: true }
    }
}

/// Fails if the wrist feels a collision.
fn check_collision(hand: &Hand, doing: &str) -> Result<(), Failure> {
    let force = hand.felt_n();
    if force.length() <= COLLISION_N {
        return Ok(());
    }
    let (at, force_n) = (hand.command.tcp.translation, force.length());
    let reason = format!("felt {force_n:.0} N {doing} at ({:.3}, {:.3}, {:.3}) m", at.x, at.y, at.z);
    Err(Failure::new(FailureCause::Motion, reason))
}

/// Waits until the hand stands where it was told to and takes the wrist's zero there.
#[derive(Debug, Clone, Default)]
struct Rest {
    ticks: u32,
    readings: VecDeque<DVec3>,
}

impl Rest {
    /// One tick of standing still; true once the hand is at rest and its zero is taken.
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> bool {
        self.ticks += 1;
        self.readings.push_back(feedback.wrist_force_n);
        if self.readings.len() > BASELINE_READINGS {
            self.readings.pop_front();
        }
        let distance_m = feedback.tcp.translation.distance(hand.command.tcp.translation);
        let there = distance_m < ARRIVED_M && feedback.tcp.angle_to(&hand.command.tcp) < ARRIVED_RAD;
        if !there || self.ticks < hand.ticks(REST_S) {
            return false;
        }
        let mean = self.readings.iter().sum::<DVec3>() / self.readings.len() as f64;
        hand.tare(mean);
        true
    }
}
