//! `grasp-from-above` with a suction cup: take a part by its top face and lift it.
//!
//! Arguments: `height`, the part's height over its base, metres. The top face is taken to be level.

use super::{argument, require_empty_hand, within_ceiling};
use crate::{
    clearance::{
        GUARD_M, PERCEPTION_ERROR_M, SAFETY_M, approach_clearance, obstacles, safe_height, within_guarded_reach,
        within_reach,
    },
    controller::StartError,
    geometry::{downward, nearest_heading},
    hand::{Hand, holds_something},
    motion::{Pace, Path},
    primitives::{Carry, Failure, GripWatch, Outcome, Reach, Suck},
    run::{Function, Next, Notes, WayOut},
};
use acm_concept::{
    embodiment::Feedback,
    ids::ObjectId,
    pose::Pose,
    skill::{FailureCause, SkillInvocation},
};
use glam::DVec3;

/// The test tug is a gentle lift by this much, metres.
const TUG_M: f64 = 0.025;
/// A retry takes another spot, this far from the middle of the face, metres.
const ASIDE_M: f64 = 0.006;
/// How sure a cup that keeps its vacuum is of holding the part.
const CONFIDENCE: f64 = 0.97;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Begin,
    Reaching,
    Sucking { empty_n: f64 },
    Tugging { empty_n: f64, base_in_tcp: Pose },
    Lifting { empty_n: f64, base_in_tcp: Pose },
}

/// The running function.
pub(crate) struct SuckFromAbove {
    object: ObjectId,
    /// The part's base, upright, on its support.
    base: Pose,
    support_m: f64,
    /// TCP pose at which the cup should touch.
    contact: Pose,
    clearance_m: f64,
    travel_height_m: f64,
    carry_height_m: f64,
    stage: Stage,
}

impl SuckFromAbove {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, feedback: &Feedback) -> Result<SuckFromAbove, StartError> {
        require_empty_hand(invocation, feedback)?;
        let (height_m, support_m) = (argument(invocation, "height")?, invocation.support_height_m);
        let (base, frame) = (invocation.target.pose.pose, invocation.frame);
        let top_m = (base.translation.z + height_m).max(frame.translation.z);
        let turn = 2.4 * f64::from(invocation.attempt);
        let aside =
            if invocation.attempt == 0 { DVec3::ZERO } else { ASIDE_M * DVec3::new(turn.cos(), turn.sin(), 0.0) };
        let at = frame.translation.with_z(top_m) + aside;
        within_guarded_reach(&hand.robot, "the face", at)?;
        within_reach(&hand.robot, "the pose above the face", at + GUARD_M * DVec3::Z)?;
        let contact = downward(at, nearest_heading(frame.yaw(), hand.command.tcp.yaw()));
        let obstacles = obstacles(invocation, support_m);
        let clearance_m = approach_clearance(&hand.robot, &contact, 0.0, &obstacles);
        if clearance_m < -PERCEPTION_ERROR_M {
            return Err(StartError::Blocked { what: "put the cup on it", overlap_m: -clearance_m });
        }
        let start = hand.command.tcp.translation;
        let travel_height_m = safe_height(hand, start, at, &obstacles, top_m, 0.0)?;
        let lift_height_m = safe_height(hand, at, at, &obstacles, support_m, height_m + GUARD_M)?;
        let carry_height_m = lift_height_m.max(top_m + SAFETY_M).max(top_m + 2.0 * TUG_M);
        Ok(SuckFromAbove {
            object: invocation.part.object,
            base: Pose::from_yaw(base.translation.with_z(support_m), base.yaw()),
            support_m,
            contact,
            clearance_m,
            travel_height_m,
            carry_height_m: within_ceiling(hand, carry_height_m),
            stage: Stage::Begin,
        })
    }

    /// How the part's base sits in the hand: where it was perceived, its base on the support.
    fn base_in_tcp(&self, tcp: &Pose) -> Pose {
        let mut base = Pose::new(tcp.translation, self.contact.rotation).inverse() * self.base;
        base.translation.z = tcp.translation.z - self.support_m;
        base
    }

    fn lift(hand: &Hand, height_m: f64, pace: Pace) -> Next {
        let path = Path::vertical(hand.command.tcp, height_m, pace, hand.robot.tick_s);
        Next::Begin(Box::new(Carry::new(path, GripWatch::new(0.0))))
    }
}

impl Function for SuckFromAbove {
    fn next(&mut self, hand: &Hand, feedback: &Feedback, last: Option<Outcome>, notes: &mut Notes) -> Next {
        match self.stage {
            Stage::Begin => {
                notes.measure("hand_clearance_m", self.clearance_m);
                self.stage = Stage::Reaching;
                let above = Pose::new(self.contact.translation + GUARD_M * DVec3::Z, self.contact.rotation);
                let pace = Pace::free(&hand.robot);
                let path = Path::over(hand.command.tcp, above, self.travel_height_m, pace, hand.robot.tick_s);
                Next::Begin(Box::new(Reach::new(path, 0.0)))
            }
            Stage::Reaching => {
                self.stage = Stage::Sucking { empty_n: hand.baseline_n().z };
                // Perceived heights may be off by as much again below.
                Next::Begin(Box::new(Suck::new(2.0 * GUARD_M)))
            }
            Stage::Sucking { empty_n } => {
                let Some(Outcome::Grasped { tcp, .. }) = last else {
                    return Next::Failed(Failure::new(FailureCause::Grasp, "the cup ended without a seal".into()));
                };
                notes.measure("grip_height_m", tcp.translation.z);
                notes.measure("vacuum_share", feedback.vacuum);
                self.stage = Stage::Tugging { empty_n, base_in_tcp: self.base_in_tcp(&tcp) };
                let height_m = within_ceiling(hand, hand.command.tcp.translation.z + TUG_M);
                SuckFromAbove::lift(hand, height_m, Pace::gentle(&hand.robot))
            }
            Stage::Tugging { empty_n, base_in_tcp } => {
                self.stage = Stage::Lifting { empty_n, base_in_tcp };
                let height_m = self.carry_height_m.max(hand.command.tcp.translation.z);
                SuckFromAbove::lift(hand, height_m, Pace::carrying(&hand.robot))
            }
            Stage::Lifting { empty_n, base_in_tcp } => {
                if !holds_something(feedback) {
                    let reason = "the cup lost its vacuum at the end of the lift".into();
                    return Next::Failed(Failure::empty_handed(FailureCause::Grasp, reason));
                }
                notes.measure("held_weight_n", empty_n - hand.baseline_n().z);
                notes.feel_held(self.object, base_in_tcp, CONFIDENCE);
                Next::Done
            }
        }
    }
    fn way_out(&self) -> WayOut {
        WayOut::Up(self.carry_height_m)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}
