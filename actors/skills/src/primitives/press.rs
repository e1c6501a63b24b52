//! Press: push along the hand's approach direction with closed fingers until the force or the travel says that it is
//! enough.

use super::{Failure, Outcome, Primitive, Step};
use crate::{advance::Advance, hand::Hand};
use acm_concept::{embodiment::Feedback, primitive::Primitive as Kind, skill::FailureCause};
use glam::DVec3;

/// Speed of pressing, m/s.
const PRESSING_M_S: f64 = 0.03;
/// Force against the motion that tells that the fingers touch something, newtons.
const TOUCH_N: f64 = 2.0;
/// Below this the fingers are taken to be free; the last such place is where the touch began, newtons. So many
/// readings in a row are asked for, since a weak spring and noise together dip below it now and then.
const FREE_N: f64 = 0.6;
const FREE_READINGS: u32 = 3;
/// Most force that is ever applied, newtons.
const MOST_N: f64 = 25.0;
/// How far beyond the stroke the hand may follow a cap that has no end, metres.
const OVERTRAVEL_M: f64 = 0.004;
/// How long the cap is held down, seconds.
const HOLD_S: f64 = 0.1;

/// The numbers of a press.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PressPlan {
    /// How far the TCP goes to the perceived touch, metres.
    pub surface_m: f64,
    /// How far beyond it a touch is still looked for, metres.
    pub search_m: f64,
    /// How far the pressed thing may have to travel, metres.
    pub stroke_m: f64,
    /// The force at which it is taken to be at its end, newtons; at most 25 N are used.
    pub force_n: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Seek,
    Press,
    Hold { ticks: u32 },
}

/// From before the part, fingers closed, at rest and with the wrist's zero taken, to pressed.
#[derive(Debug)]
pub(crate) struct Press {
    plan: PressPlan,
    phase: Phase,
    advance: Advance,
    start: DVec3,
    farthest_seek_m: f64,
    free_readings: u32,
    touch_at_m: f64,
    travel_m: f64,
    force_n: f64,
    limit_s: f64,
}

impl Press {
    pub fn new(hand: &Hand, plan: PressPlan) -> Press {
        let along = hand.command.tcp.transform_vector(DVec3::Z);
        let farthest_seek_m = plan.surface_m + plan.search_m;
        // The wrist yields under force, so the command goes on a little beyond where the hand is.
        let travel_m = farthest_seek_m + plan.stroke_m + 2.0 * OVERTRAVEL_M;
        let advance = Advance::new(hand, along, travel_m, PRESSING_M_S, MOST_N);
        let limit_s = advance.duration_s() + HOLD_S;
        Press {
            plan: PressPlan { force_n: plan.force_n.min(MOST_N), ..plan },
            phase: Phase::Seek,
            advance,
            start: hand.command.tcp.translation,
            farthest_seek_m,
            free_readings: 0,
            touch_at_m: 0.0,
            travel_m: 0.0,
            force_n: 0.0,
            limit_s,
        }
    }
}

impl Primitive for Press {
    fn kind(&self) -> Kind {
        Kind::Push
    }
    fn limit_s(&self) -> f64 {
        self.limit_s
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let along = self.advance.direction();
        let force_n = self.advance.resistance_n(hand);
        let at_m = (feedback.tcp.translation - self.start).dot(along);
        if self.phase == Phase::Seek {
            self.free_readings = if force_n < FREE_N { self.free_readings + 1 } else { 0 };
            if self.free_readings >= FREE_READINGS {
                self.touch_at_m = at_m;
            }
            if force_n > TOUCH_N {
                self.phase = Phase::Press;
            } else if self.advance.gone_m() >= self.farthest_seek_m {
                let reason =
                    format!("touched nothing up to {:.0} mm beyond the perceived surface", 1e3 * self.plan.search_m);
                return Step::Failed(Failure::new(FailureCause::Press, reason));
            }
        }
        if self.phase != Phase::Seek {
            self.force_n = self.force_n.max(force_n);
            self.travel_m = self.travel_m.max(at_m - self.touch_at_m);
        }
        if let Phase::Hold { ticks } = &mut self.phase {
            *ticks += 1;
            if *ticks > hand.ticks(HOLD_S) {
                return Step::Done(Outcome::Pushed { force_n: self.force_n, travel_m: self.travel_m });
            }
            return Step::Act;
        }
        let newest_n = -(feedback.wrist_force_n - hand.baseline_n()).dot(along);
        let pressed = self.phase == Phase::Press
            && (force_n >= self.plan.force_n || self.travel_m > self.plan.stroke_m + OVERTRAVEL_M);
        if pressed || newest_n >= MOST_N || !self.advance.step(hand) {
            self.force_n = self.force_n.max(force_n);
            self.phase = Phase::Hold { ticks: 0 };
        }
        Step::Act
    }
}
