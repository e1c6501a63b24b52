//! Grasp with a suction cup: press the cup lightly on a face until it is sealed.

use super::{Failure, Outcome, Primitive, Step, check_collision};
use crate::hand::Hand;
use acm_concept::{embodiment::Feedback, primitive::Primitive as Kind, skill::FailureCause};
use glam::DVec3;

/// Speed of the cup on its way to the face, m/s.
const APPROACH_M_S: f64 = 0.03;
/// The cup is pressed on when it feels this much, newtons.
const PRESSED_N: f64 = 2.5;
/// From this share of the pump's best vacuum on the face is taken to close the cup, after so long, seconds.
const SEALED: f64 = 0.8;
const STEADY_S: f64 = 0.06;
/// How long a pressed cup may take to be sealed, seconds.
const SEALING_S: f64 = 0.8;

/// From before the face, at rest and with the wrist's zero taken, to sealed on it.
#[derive(Debug)]
pub(crate) struct Suck {
    /// Farthest way of the cup along its approach, metres.
    travel_m: f64,
    gone_m: f64,
    pressed_ticks: u32,
    sealed_ticks: u32,
}

impl Suck {
    /// Along the approach direction for `travel_m` at most.
    pub fn new(travel_m: f64) -> Suck {
        Suck { travel_m, gone_m: 0.0, pressed_ticks: 0, sealed_ticks: 0 }
    }

    fn fail(hand: &mut Hand, reason: String) -> Step {
        hand.command.vacuum = false;
        Step::Failed(Failure::empty_handed(FailureCause::Grasp, reason))
    }
}

impl Primitive for Suck {
    fn kind(&self) -> Kind {
        Kind::Grasp
    }
    fn limit_s(&self) -> f64 {
        self.travel_m / APPROACH_M_S + SEALING_S + 1.0
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        if let Err(failure) = check_collision(hand, "while pressing the cup on") {
            return Step::Failed(failure);
        }
        hand.command.vacuum = true;
        let approach = hand.command.tcp.transform_vector(DVec3::Z);
        let resistance_n = -hand.felt_n().dot(approach);
        self.sealed_ticks = if feedback.vacuum >= SEALED { self.sealed_ticks + 1 } else { 0 };
        if self.sealed_ticks > hand.ticks(STEADY_S) {
            return Step::Done(Outcome::Grasped { width_m: 0.0, gap_m: 0.0, tcp: feedback.tcp, touched: true });
        }
        if self.pressed_ticks == 0 && resistance_n < PRESSED_N {
            let step_m = APPROACH_M_S * hand.robot.tick_s;
            if self.gone_m >= self.travel_m {
                let reason = format!("the cup met nothing within {:.0} mm", 1e3 * self.travel_m);
                return Suck::fail(hand, reason);
            }
            self.gone_m += step_m;
            hand.command.tcp.translation += step_m * approach;
            return Step::Act;
        }
        self.pressed_ticks += 1;
        if self.pressed_ticks > hand.ticks(SEALING_S) {
            let share = 100.0 * feedback.vacuum;
            return Suck::fail(
                hand,
                format!("the cup is pressed on, but the face does not close it: {share:.0} % of the vacuum"),
            );
        }
        Step::Act
    }
}
