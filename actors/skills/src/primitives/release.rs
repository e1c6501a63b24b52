//! Release: open the fingers gently until both pads are free.

use super::{Failure, Outcome, Primitive, Step};
use crate::hand::{Hand, pads_in_contact};
use acm_concept::{embodiment::Feedback, primitive::Primitive as Kind, skill::FailureCause};

/// Speed of the first opening, m/s.
const OPENING_M_S: f64 = 0.1;
/// The gap must grow by at least this before free pads count, metres.
const GROWN_M: f64 = 0.004;
/// How long the hand waits, open, for what it let go to come to rest, seconds.
const REST_S: f64 = 0.1;
/// What waiting for free pads may take once the fingers are open, seconds.
const STUCK_S: f64 = 1.0;

/// Opens from a gap to an opening; the hand stands still.
#[derive(Debug)]
pub(crate) struct Release {
    gap_m: f64,
    opening_m: f64,
    free_ticks: u32,
    stuck_ticks: u32,
}

impl Release {
    pub fn new(gap_m: f64, opening_m: f64) -> Release {
        Release { gap_m, opening_m, free_ticks: 0, stuck_ticks: 0 }
    }
}

impl Primitive for Release {
    fn kind(&self) -> Kind {
        Kind::Release
    }
    fn limit_s(&self) -> f64 {
        self.opening_m / OPENING_M_S + STUCK_S + REST_S + 1.0
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        // Opening starts from the gap, not from the closed command that kept the force up.
        hand.command.opening_m = hand.command.opening_m.max(self.gap_m.min(hand.robot.max_opening_m));
        let open = hand.turn_opening(self.opening_m, OPENING_M_S);
        let grown_m = GROWN_M.min(0.5 * (self.opening_m - self.gap_m));
        let free = pads_in_contact(feedback) == [false, false] && feedback.opening_m > self.gap_m + grown_m;
        self.free_ticks = if free { self.free_ticks + 1 } else { 0 };
        if open && self.free_ticks > hand.ticks(REST_S) {
            return Step::Done(Outcome::Released);
        }
        self.stuck_ticks += u32::from(open && !free);
        if self.stuck_ticks > hand.ticks(STUCK_S) {
            let gap_mm = 1e3 * feedback.opening_m;
            let reason = format!("the fingers were opened, but a pad still feels something at {gap_mm:.1} mm");
            return Step::Failed(Failure::new(FailureCause::Place, reason));
        }
        Step::Act
    }
}
