//! Whether what was grasped is still in the hand, from the fingers' gap and the pads.

use super::Failure;
use crate::hand::{CLOSED_M, Hand, SEALED, pads_in_contact};
use acm_concept::{embodiment::Feedback, skill::FailureCause};

/// A gap that changes by more than this is no longer around the same thing in the same way, metres.
const GAP_CHANGE_M: f64 = 0.003;
/// How long both pads may feel nothing, seconds.
const NO_CONTACT_S: f64 = 0.1;
/// A changed gap must stay within this for so long to count as a new hold; metres and seconds.
const SETTLED_M: f64 = 0.0003;
const SETTLED_S: f64 = 0.1;
/// How long the hand waits for a changed gap to settle, seconds.
const UNSURE_S: f64 = 0.6;
/// How often the object may shift in the grip before the hold is given up.
const MAX_SHIFTS: u32 = 3;

/// Watches the fingers while something is held.
#[derive(Debug, Clone)]
pub(crate) struct GripWatch {
    gap_m: f64,
    last_gap_m: f64,
    free_ticks: u32,
    unsure_ticks: u32,
    settled_ticks: u32,
    shifts: u32,
}

/// What the watch says of the grip.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Grip {
    /// Held as before.
    Firm,
    /// The gap has changed and has not come to rest: the hand should stand still.
    Unsure,
    /// Still held, in another way: the motion may go on.
    Shifted,
}

impl GripWatch {
    /// Around something that keeps the fingers `gap_m` apart.
    pub fn new(gap_m: f64) -> GripWatch {
        GripWatch { gap_m, last_gap_m: gap_m, free_ticks: 0, unsure_ticks: 0, settled_ticks: 0, shifts: 0 }
    }
    /// One tick. Fails once the fingers have closed, or the pads feel nothing any more.
    pub fn check(&mut self, hand: &Hand, feedback: &Feedback) -> Result<Grip, Failure> {
        let gap_m = feedback.opening_m;
        let lost = |how: &str| {
            let (before, now) = (1e3 * self.gap_m, 1e3 * gap_m);
            let reason = format!("the object was lost on the way: {how} (gap {before:.1} mm before, {now:.1} mm now)");
            Err(Failure::empty_handed(FailureCause::Grasp, reason))
        };
        if hand.robot.suction.is_some() {
            return if feedback.vacuum > SEALED { Ok(Grip::Firm) } else { lost("the cup has no vacuum") };
        }
        if gap_m < CLOSED_M {
            return lost("the fingers closed");
        }
        let pads = pads_in_contact(feedback);
        self.free_ticks = if pads == [false, false] { self.free_ticks + 1 } else { 0 };
        if self.free_ticks > hand.ticks(NO_CONTACT_S) {
            return lost("neither pad feels anything");
        }
        let still = (gap_m - self.last_gap_m).abs() < SETTLED_M;
        self.settled_ticks = if still { self.settled_ticks + 1 } else { 0 };
        self.last_gap_m = gap_m;
        if (gap_m - self.gap_m).abs() <= GAP_CHANGE_M {
            self.unsure_ticks = 0;
            return Ok(Grip::Firm);
        }
        self.unsure_ticks += 1;
        if self.settled_ticks >= hand.ticks(SETTLED_S) && pads == [true, true] && self.shifts < MAX_SHIFTS {
            (self.gap_m, self.unsure_ticks) = (gap_m, 0);
            self.shifts += 1;
            return Ok(Grip::Shifted);
        }
        if self.unsure_ticks > hand.ticks(UNSURE_S) {
            return lost("the gap does not come to rest");
        }
        Ok(Grip::Unsure)
    }
}
