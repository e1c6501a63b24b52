//! Reach: bring the empty hand to a pose without touching anything.

use super::{Outcome, Primitive, Rest, Step, check_collision};
use crate::{hand::Hand, motion::Path};
use acm_concept::{embodiment::Feedback, primitive::Primitive as Kind};

/// How fast the fingers are opened or closed on the way, m/s.
const FINGER_SPEED_M_S: f64 = 0.25;
/// How near the measured opening must come to the commanded one, metres.
const OPENED_M: f64 = 0.004;
/// What is allowed beyond the path's own time, seconds.
const SLACK_S: f64 = 1.5;

/// Flies a path while the fingers take an opening, then comes to rest and takes the wrist's zero.
#[derive(Debug)]
pub(crate) struct Reach {
    path: Path,
    opening_m: f64,
    /// `None` where the motion goes on at once and neither rest nor opening matter.
    rest: Option<Rest>,
}

impl Reach {
    /// Ends at rest, with the fingers where they should be.
    pub fn new(path: Path, opening_m: f64) -> Reach {
        Reach { path, opening_m, rest: Some(Rest::default()) }
    }
    /// Ends as soon as the path does.
    pub fn passing(path: Path, opening_m: f64) -> Reach {
        Reach { path, opening_m, rest: None }
    }
}

impl Primitive for Reach {
    fn kind(&self) -> Kind {
        Kind::Reach
    }
    fn limit_s(&self) -> f64 {
        self.path.longest_s() + SLACK_S
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        if let Err(failure) = check_collision(hand, "while reaching") {
            return Step::Failed(failure);
        }
        let commanded = hand.turn_opening(self.opening_m, FINGER_SPEED_M_S);
        if hand.follow(&mut self.path) {
            return Step::Act;
        }
        let Some(rest) = &mut self.rest else { return Step::Done(Outcome::Arrived) };
        let opened = commanded && (feedback.opening_m - self.opening_m).abs() < OPENED_M;
        let at_rest = rest.tick(hand, feedback);
        if at_rest && opened { Step::Done(Outcome::Arrived) } else { Step::Act }
    }
}
