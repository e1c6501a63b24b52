//! Grasp: bring the open fingers to both sides of a part along the hand's approach direction and close them on it.

use super::{Failure, Outcome, Primitive, Step, check_collision};
use crate::{
    advance::{Advance, Progress},
    hand::{CLOSED_M, Hand, pads_in_contact},
    motion::{Pace, Path},
};
use acm_concept::{embodiment::Feedback, pose::Pose, primitive::Primitive as Kind, skill::FailureCause};
use glam::DVec3;
use std::collections::VecDeque;

/// Speed of the open fingers on their way to the part, m/s.
const APPROACH_M_S: f64 = 0.05;
/// Force against the approach that tells that the finger tips touch something, newtons.
const TOUCH_N: f64 = 4.0;
/// How far the hand is drawn back from what it touched before the fingers close, metres.
const BACK_OFF_M: f64 = 0.003;
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
/// How fast the hand yields to a part that does not follow the fingers: m/s for a newton, and at most; m/s.
const YIELDING_M_S_N: f64 = 0.005;
const YIELDING_M_S: f64 = 0.04;
/// What closing may take, seconds.
const CLOSING_LIMIT_S: f64 = 2.0;

/// The numbers of a grasp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GraspPlan {
    /// How far the TCP goes along the approach direction before the fingers close, metres.
    pub travel_m: f64,
    /// Perceived distance between the faces that the fingers close on, metres.
    pub width_m: f64,
    /// Tips that touch before the TCP has gone this far have landed on the part or a neighbour, not on what is
    /// behind it; metres.
    pub landed_before_m: f64,
    /// Whether the part belongs to something that does not follow the fingers, as a handle does: then the hand
    /// follows the part instead.
    pub attached: bool,
}

#[derive(Debug)]
enum Phase {
    Approach(Advance),
    BackOff(Path),
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
    start: DVec3,
    along: DVec3,
    open_m: f64,
    phase: Phase,
    touched: bool,
    limit_s: f64,
}

impl Grasp {
    pub fn new(hand: &Hand, plan: GraspPlan) -> Grasp {
        let start = hand.command.tcp;
        let along = start.transform_vector(DVec3::Z);
        let advance = Advance::new(hand, along, plan.travel_m, APPROACH_M_S, TOUCH_N);
        let limit_s = advance.duration_s() + CLOSING_LIMIT_S;
        let open_m = hand.command.opening_m;
        Grasp {
            plan,
            start: start.translation,
            along,
            open_m,
            phase: Phase::Approach(advance),
            touched: false,
            limit_s,
        }
    }

    fn close(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let Phase::Close { gaps, one_sided_ticks } = &mut self.phase else { return Step::Act };
        let gap_m = feedback.opening_m;
        // A thin handle is narrower than what counts as closed fingers elsewhere.
        if gap_m < CLOSED_M.min(0.5 * self.plan.width_m) {
            return Step::Failed(nothing(format!("the fingers closed on nothing: the gap is {:.1} mm", 1e3 * gap_m)));
        }
        hand.command.grip_force_n = CLOSING_N.min(hand.robot.max_grip_force_n);
        hand.turn_opening(0.0, CLOSING_M_S);
        if self.plan.attached {
            follow_part(hand);
        }
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
            Phase::Approach(advance) => match advance.tick(hand) {
                Progress::Onward => {}
                Progress::End => self.phase = closing(),
                Progress::Touched => {
                    let gone_m = (feedback.tcp.translation - self.start).dot(self.along);
                    if gone_m < self.plan.landed_before_m {
                        let reason = format!(
                            "the fingers landed on something {:.1} mm before where they may",
                            1e3 * (self.plan.landed_before_m - gone_m)
                        );
                        return Step::Failed(nothing(reason));
                    }
                    self.touched = true;
                    // Off what was touched: from where the hand is, not from where a yielding wrist was told to be.
                    let off_m = gone_m - BACK_OFF_M - advance.gone_m();
                    let to = hand.command.tcp.translation + off_m * self.along;
                    let to = [Pose::new(to, hand.command.tcp.rotation)];
                    let pace = Pace::gentle(&hand.robot);
                    self.phase = Phase::BackOff(Path::through(hand.command.tcp, &to, pace, hand.robot.tick_s));
                }
            },
            Phase::BackOff(path) => match path.advance() {
                Some(next) => hand.command.tcp = next,
                None => self.phase = closing(),
            },
            Phase::Close { .. } => return self.close(hand, feedback),
            Phase::Squeeze { gaps, width_m } => {
                if self.plan.attached {
                    follow_part(hand);
                }
                let (gap_m, width_m) = (feedback.opening_m, *width_m);
                if gap_m < CLOSED_M.min(0.5 * width_m) {
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

/// Lets the hand yield along the direction in which the fingers close, so that both pads bear alike.
fn follow_part(hand: &mut Hand) {
    let across = hand.command.tcp.transform_vector(DVec3::Y);
    let speed_m_s = (YIELDING_M_S_N * hand.felt_n().dot(across)).clamp(-YIELDING_M_S, YIELDING_M_S);
    hand.command.tcp.translation += speed_m_s * hand.robot.tick_s * across;
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
