//! `press-down`: press a part straight down with closed fingers and let it spring back.
//!
//! Arguments: `stroke`, how far it may have to travel, metres; `force`, at which it is taken to be at its end,
//! newtons. The frame lies on the surface that is pressed. A thing that pushes back with less than about a newton is
//! not felt to give way.

use super::{argument, require_empty_hand, within_ceiling};
use crate::{
    clearance::{
        GUARD_M, PERCEPTION_ERROR_M, ROOMY_M, approach_clearance, obstacles, safe_height, within_guarded_reach,
        within_reach,
    },
    controller::StartError,
    geometry::{downward, nearest_heading},
    hand::Hand,
    motion::{Pace, Path},
    primitives::{Failure, Outcome, Press, PressPlan, Reach},
    run::{Function, Next, Notes, WayOut},
};
use acm_concept::{
    embodiment::Feedback,
    ids::ObjectId,
    literal::{Literal, Term},
    pose::Pose,
    skill::{FailureCause, SkillInvocation},
    solid::PlacedSolid,
};
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// How far below the perceived surface it is looked for, metres.
const SEARCH_M: f64 = 0.025;
/// How much harder each retry presses, as a share of the force.
const HARDER: f64 = 0.35;
/// Retries move off the middle along a spiral: metres times the square root of the attempt, up to a largest radius,
/// turned by the golden angle, which covers a disc evenly.
const SPIRAL_M: f64 = 0.004;
const LARGEST_SPIRAL_M: f64 = 0.01;
const GOLDEN_ANGLE_RAD: f64 = 2.399_963;
/// How far the hand goes up after the press, at least, metres.
const RISE_M: f64 = 0.08;
/// Travel below this means that the thing did not give, metres; from the second value on it surely did.
const GAVE_M: f64 = 0.002;
const GAVE_SURELY_M: f64 = 0.004;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Begin,
    Reaching,
    Pushing,
    Rising,
}

/// The running function.
pub(crate) struct PressDown {
    object: ObjectId,
    /// TCP pose at which the closed finger tips should touch.
    contact: Pose,
    plan: PressPlan,
    travel_height_m: f64,
    rise_height_m: f64,
    stage: Stage,
}

impl PressDown {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, feedback: &Feedback) -> Result<PressDown, StartError> {
        require_empty_hand(invocation, feedback)?;
        let (stroke_m, force_n) = (argument(invocation, "stroke")?, argument(invocation, "force")?);
        let at = invocation.frame.translation + spiral(invocation.attempt) + hand.tip_reach_m * DVec3::Z;
        within_guarded_reach(&hand.robot, "the press", at)?;
        within_reach(&hand.robot, "the pose above the press", at + GUARD_M * DVec3::Z)?;
        let obstacles = obstacles(invocation, invocation.support_height_m);
        let contact = choose_heading(invocation, hand, at, &obstacles)?;
        let surface_m = invocation.frame.translation.z;
        let start = hand.command.tcp.translation;
        let travel_height_m = safe_height(hand, start, at, &obstacles, surface_m, 0.0)?;
        Ok(PressDown {
            object: invocation.part.object,
            contact,
            plan: PressPlan {
                surface_m: GUARD_M,
                search_m: SEARCH_M,
                stroke_m,
                force_n: force_n * (1.0 + HARDER * f64::from(invocation.attempt.min(8))),
            },
            travel_height_m,
            rise_height_m: within_ceiling(hand, travel_height_m.max(at.z + RISE_M)),
            stage: Stage::Begin,
        })
    }
}

/// What a press came to: fails if the thing did not give way.
pub(crate) fn judge(object: ObjectId, last: Option<Outcome>, notes: &mut Notes) -> Result<(), Failure> {
    let Some(Outcome::Pushed { force_n, travel_m }) = last else {
        return Err(Failure::new(FailureCause::Press, "the push ended without a result".into()));
    };
    notes.measure("press_force_n", force_n);
    notes.measure("press_travel_m", travel_m);
    if travel_m < GAVE_M {
        let reason = format!("pressed with {force_n:.0} N, but it gave way by only {:.1} mm", 1e3 * travel_m);
        return Err(Failure::new(FailureCause::Press, reason));
    }
    let confidence = if travel_m >= GAVE_SURELY_M { 0.95 } else { 0.75 };
    notes.feel(Literal::new("pressed", vec![Term::Object(object)]), confidence);
    Ok(())
}

impl Function for PressDown {
    fn next(&mut self, hand: &Hand, _feedback: &Feedback, last: Option<Outcome>, notes: &mut Notes) -> Next {
        let (pace, tick_s) = (Pace::free(&hand.robot), hand.robot.tick_s);
        match self.stage {
            Stage::Begin => {
                self.stage = Stage::Reaching;
                let above = Pose::new(self.contact.translation + GUARD_M * DVec3::Z, self.contact.rotation);
                let path = Path::over(hand.command.tcp, above, self.travel_height_m, pace, tick_s);
                Next::Begin(Box::new(Reach::new(path, 0.0)))
            }
            Stage::Reaching => {
                self.stage = Stage::Pushing;
                Next::Begin(Box::new(Press::new(hand, self.plan)))
            }
            Stage::Pushing => {
                if let Err(failure) = judge(self.object, last, notes) {
                    return Next::Failed(failure);
                }
                self.stage = Stage::Rising;
                // Measured from where it was pressed, which need not be where it was perceived.
                let height_m = self.rise_height_m.max(hand.command.tcp.translation.z + RISE_M);
                let path = Path::vertical(hand.command.tcp, within_ceiling(hand, height_m), pace, tick_s);
                Next::Begin(Box::new(Reach::new(path, 0.0)))
            }
            Stage::Rising => Next::Done,
        }
    }
    fn way_out(&self) -> WayOut {
        WayOut::Up(self.rise_height_m)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}

fn spiral(attempt: u32) -> DVec3 {
    let radius = (SPIRAL_M * f64::from(attempt).sqrt()).min(LARGEST_SPIRAL_M);
    let angle = GOLDEN_ANGLE_RAD * f64::from(attempt);
    DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
}

/// The nearer of two crossed headings, or the freer one if that has no room.
fn choose_heading(
    invocation: &SkillInvocation,
    hand: &Hand,
    at: DVec3,
    obstacles: &[PlacedSolid],
) -> Result<Pose, StartError> {
    let now_rad = hand.command.tcp.yaw();
    let first_rad = nearest_heading(invocation.frame.yaw(), now_rad);
    let mut best: Option<(Pose, f64)> = None;
    for heading_rad in [first_rad, nearest_heading(first_rad + FRAC_PI_2, now_rad)] {
        let contact = downward(at, heading_rad);
        let clearance_m = approach_clearance(&hand.robot, &contact, 0.0, obstacles);
        if clearance_m >= ROOMY_M {
            return Ok(contact);
        }
        if best.is_none_or(|(_, best_m)| clearance_m > best_m) {
            best = Some((contact, clearance_m));
        }
    }
    match best {
        Some((contact, clearance_m)) if clearance_m >= -PERCEPTION_ERROR_M => Ok(contact),
        other => {
            let overlap_m = other.map_or(f64::NAN, |(_, clearance_m)| -clearance_m);
            Err(StartError::Blocked { what: "press it", overlap_m })
        }
    }
}
