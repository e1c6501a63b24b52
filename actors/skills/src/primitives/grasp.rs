//! Grasp: lower the open fingers on both sides of a part and close them on it.

use super::{Failure, Outcome, Primitive, Step, check_collision};
use crate::{
    descent::{Descent, Progress},
    hand::{CLOSED_M, Hand, pads_in_contact},
    motion::{Pace, Path},
};
use acm_concept::{embodiment::Feedback, primitive::Primitive as Kind, skill::FailureCause};
use std::collections::VecDeque;

/// Speed of lowering the open fingers, m/s.
const LOWERING_M_S: f64 = 0.05;
/// Upward force that tells that the fingers stand on something, newtons.
const TOUCH_N: f64 = 4.0;
/// How far the hand is lifted off what it touched before the fingers close, metres.
const LIFT_OFF_M: f64 = 0.003;
/// Speed at which the commanded opening closes, m/s: an object off the middle is shoved, not knocked.
const CLOSING_M_S: f64 = 0.12;
/// Force of closing, newtons: the width is measured before the full force dents pads or part.
const CLOSING_N: f64 = 6.0;
/// How long the gap must stay the same, seconds, and within what, metres.
const STALL_S: f64 = 0.05;
const STALL_M: f64 = 0.0004;
/// A gap narrower than the perceived width by more than this holds something else, or a corner; metres.
const NARROWER_M: f64 = 0.012;
/// A gap wider than the perceived width by more than this is jammed; metres.
const WIDER_M: f64 = 0.02;
/// Fingers commanded at least this much narrower than they are push, metres.
const PUSHING_M: f64 = 0.003;
/// How long one pad may wait for the other, seconds.
const ONE_SIDED_S: f64 = 0.3;
/// What closing may take, seconds.
const CLOSING_LIMIT_S: f64 = 2.0;

/// The numbers of a grasp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GraspPlan {
    /// TCP height at which the fingers close, metres.
    pub height_m: f64,
    /// Perceived distance between the faces that the fingers close on, metres.
    pub width_m: f64,
    /// Tips that touch above this height have landed on the part or a neighbour, not on the support; metres.
    pub landed_above_m: f64,
}

#[derive(Debug)]
enum Phase {
    Lower(Descent),
    LiftOff(Path),
    /// Gently, until the gap stalls.
    Close {
        gaps: Stall,
        one_sided_ticks: u32,
    },
    /// At full force around something of this width, until the gap stalls again.
    Squeeze {
        gaps: Stall,
        width_m: f64,
    },
    /// What was gripped is not the part as it should be: it is let go where it stands, and then the grasp fails.
    LetGo(Failure),
}

/// The last gaps, over the time in which they must not change.
#[derive(Debug, Default)]
struct Stall {
    gaps: VecDeque<f64>,
}

impl Stall {
    /// Takes a new gap; true once the gap has stopped changing.
    fn reached(&mut self, hand: &Hand, gap_m: f64) -> bool {
        let count = hand.ticks(STALL_S) as usize + 1;
        self.gaps.push_back(gap_m);
        if self.gaps.len() > count {
            self.gaps.pop_front();
        }
        self.gaps.len() == count && self.gaps.iter().all(|gap| (gap - gap_m).abs() < STALL_M)
    }
}

/// From above the part, fingers open, at rest and with the wrist's zero taken, to closed on it at full force.
#[derive(Debug)]
pub(crate) struct Grasp {
    plan: GraspPlan,
    open_m: f64,
    phase: Phase,
    touched: bool,
    limit_s: f64,
}

impl Grasp {
    pub fn new(hand: &Hand, plan: GraspPlan) -> Grasp {
        let descent = Descent::new(hand, plan.height_m, LOWERING_M_S, TOUCH_N);
        let limit_s = descent.duration_s(hand.command.tcp.translation.z) + CLOSING_LIMIT_S;
        Grasp { plan, open_m: hand.command.opening_m, phase: Phase::Lower(descent), touched: false, limit_s }
    }

    fn close(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let Phase::Close { gaps, one_sided_ticks } = &mut self.phase else { return Step::Act };
        let gap_m = feedback.opening_m;
        if gap_m < CLOSED_M {
            return Step::Failed(nothing(format!("the fingers closed on nothing: the gap is {:.1} mm", 1e3 * gap_m)));
        }
        hand.command.grip_force_n = CLOSING_N.min(hand.robot.max_grip_force_n);
        hand.turn_opening(0.0, CLOSING_M_S);
        let pushing = feedback.commanded_opening_m < gap_m - PUSHING_M;
        if !(gaps.reached(hand, gap_m) && pushing) {
            return Step::Act;
        }
        if pads_in_contact(feedback) != [true, true] {
            *one_sided_ticks += 1;
            if *one_sided_ticks > hand.ticks(ONE_SIDED_S) {
                let what = "the fingers stopped, but not both pads feel the object: gap";
                self.phase = Phase::LetGo(nothing(format!("{what} {:.1} mm", 1e3 * gap_m)));
            }
            return Step::Act;
        }
        if let Err(failure) = judge_gap(gap_m, self.plan.width_m) {
            self.phase = Phase::LetGo(failure);
            return Step::Act;
        }
        hand.command.opening_m = 0.0;
        hand.command.grip_force_n = hand.full_grip_n();
        self.phase = Phase::Squeeze { gaps: Stall::default(), width_m: gap_m };
        Step::Act
    }
}

impl Primitive for Grasp {
    fn kind(&self) -> Kind {
        Kind::Grasp
    }
    fn limit_s(&self) -> f64 {
        self.limit_s
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        if let Err(failure) = check_collision(hand, "while grasping") {
            return Step::Failed(failure);
        }
        match &mut self.phase {
            Phase::Lower(descent) => match descent.tick(hand) {
                Progress::Down => {}
                Progress::Floor => self.phase = closing(),
                Progress::Touched => {
                    let tip_m = hand.tip_height_m(&feedback.tcp);
                    if tip_m > self.plan.landed_above_m {
                        let reason = format!(
                            "the fingers landed on something {:.1} mm above where they may",
                            1e3 * (tip_m - self.plan.landed_above_m)
                        );
                        return Step::Failed(nothing(reason));
                    }
                    self.touched = true;
                    let off_m = feedback.tcp.translation.z + LIFT_OFF_M;
                    let pace = Pace::gentle(&hand.robot);
                    self.phase = Phase::LiftOff(Path::vertical(hand.command.tcp, off_m, pace, hand.robot.tick_s));
                }
            },
            Phase::LiftOff(path) => match path.advance() {
                Some(next) => hand.command.tcp = next,
                None => self.phase = closing(),
            },
            Phase::Close { .. } => return self.close(hand, feedback),
            Phase::Squeeze { gaps, width_m } => {
                let (gap_m, width_m) = (feedback.opening_m, *width_m);
                if gap_m < CLOSED_M {
                    return Step::Failed(nothing("the object slipped out when it was squeezed".into()));
                }
                if gaps.reached(hand, gap_m) {
                    let (tcp, touched) = (feedback.tcp, self.touched);
                    return Step::Done(Outcome::Grasped { width_m, gap_m, tcp, touched });
                }
            }
            Phase::LetGo(failure) => {
                hand.command.opening_m = hand.command.opening_m.max(feedback.opening_m.min(self.open_m));
                if hand.turn_opening(self.open_m, CLOSING_M_S) {
                    return Step::Failed(failure.clone());
                }
            }
        }
        Step::Act
    }
}

fn closing() -> Phase {
    Phase::Close { gaps: Stall::default(), one_sided_ticks: 0 }
}

/// The fingers hold nothing: they closed on nothing, never closed, or let go again.
fn nothing(reason: String) -> Failure {
    Failure::empty_handed(FailureCause::Grasp, reason)
}

/// Whether a gap at which the fingers stalled fits the perceived width.
fn judge_gap(gap_m: f64, width_m: f64) -> Result<(), Failure> {
    let (gap_mm, width_mm) = (1e3 * gap_m, 1e3 * width_m);
    if gap_m < width_m - NARROWER_M {
        let reason = format!("the fingers closed to {gap_mm:.1} mm, but the object should be {width_mm:.1} mm wide");
        return Err(nothing(reason));
    }
    if gap_m > width_m + WIDER_M {
        let reason = format!("the fingers stopped at {gap_mm:.1} mm, but the object should be {width_mm:.1} mm wide");
        return Err(nothing(reason));
    }
    Ok(())
}
