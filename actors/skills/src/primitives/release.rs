//! Release: open the fingers gently until both pads are free, or have had time to be; or vent the cup.

use super::{Outcome, Primitive, Step};
use crate::hand::{Hand, pads_in_contact};
use acm_concept::{embodiment::Feedback, primitive::Primitive as Kind};

/// Speed of the first opening, m/s.
const OPENING_M_S: f64 = 0.1;
/// Below this share of the pump's best vacuum a cup holds nothing.
const VENTED: f64 = 0.02;
/// The gap must grow by at least this before free pads count, metres.
const GROWN_M: f64 = 0.004;
/// How long the hand waits, open, for what it let go to come to rest, seconds.
const REST_S: f64 = 0.1;
/// How long free pads are waited for once the fingers are open, seconds. A pad may read wrong, or what was held may
/// lean on it: then rising decides.
const LEANING_S: f64 = 0.4;

/// Opens from a gap to an opening; the hand stands still.
#[derive(Debug)]
pub(crate) struct Release {
    gap_m: f64,
    opening_m: f64,
    free_ticks: u32,
    leaning_ticks: u32,
}

impl Release {
    pub fn new(gap_m: f64, opening_m: f64) -> Release {
        Release { gap_m, opening_m, free_ticks: 0, leaning_ticks: 0 }
    }
}

impl Primitive for Release {
    fn kind(&self) -> Kind {
        Kind::Release
    }
    fn limit_s(&self) -> f64 {
        self.opening_m / OPENING_M_S + LEANING_S + REST_S + 1.0
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        if hand.robot.suction.is_some() {
            hand.command.vacuum = false;
            self.free_ticks = if feedback.vacuum < VENTED { self.free_ticks + 1 } else { 0 };
            let free = self.free_ticks > hand.ticks(REST_S);
            return if free { Step::Done(Outcome::Released { free: true }) } else { Step::Act };
        }
        // Opening starts from the gap, not from the closed command that kept the force up.
        hand.command.opening_m = hand.command.opening_m.max(self.gap_m.min(hand.robot.max_opening_m));
        let open = hand.turn_opening(self.opening_m, OPENING_M_S);
        let grown_m = GROWN_M.min(0.5 * (self.opening_m - self.gap_m));
        let free = pads_in_contact(feedback) == [false, false] && feedback.opening_m > self.gap_m + grown_m;
        self.free_ticks = if free { self.free_ticks + 1 } else { 0 };
        if open && self.free_ticks > hand.ticks(REST_S) {
            return Step::Done(Outcome::Released { free: true });
        }
        self.leaning_ticks += u32::from(open && !free);
        if self.leaning_ticks > hand.ticks(LEANING_S) {
            return Step::Done(Outcome::Released { free: false });
        }
        Step::Act
    }
}
