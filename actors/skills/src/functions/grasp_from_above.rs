//! `grasp-from-above`: take a part between the fingers from above and lift it.
//!
//! Arguments: `grip_width`, the distance between the faces across the frame's y axis; optionally `cross_width`,
//! the same across its x axis; `height`, the part's height over its base. Metres.

use super::{argument, require_empty_hand, within_ceiling};
use crate::{
    clearance::{
        GUARD_M, PERCEPTION_ERROR_M, ROOMY_M, SAFETY_M, approach_clearance, obstacles, safe_height,
        within_guarded_reach, within_reach,
    },
    controller::StartError,
    geometry::{downward, nearest_heading},
    hand::Hand,
    motion::{Pace, Path},
    primitives::{Carry, Failure, Grasp, GraspPlan, GripWatch, Outcome, Reach},
    run::{Function, Next, Notes, WayOut},
};
use acm_concept::{
    embodiment::Feedback,
    ids::ObjectId,
    pose::Pose,
    skill::{FailureCause, SkillInvocation},
    solid::PlacedSolid,
};
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// How much wider than the part the fingers are on the way down, the most absorbing first; metres.
const SPREADS_M: [f64; 4] = [0.04, 0.03, 0.02, 0.014];
/// The least spread a part must leave, metres.
const LEAST_SPREAD_M: f64 = 0.008;
/// Height at which the finger tips stay above the perceived support, metres.
const TIP_CLEARANCE_M: f64 = 0.004;
/// How much deeper a retry reaches, metres, and how many retries go on deepening.
const DEEPER_M: f64 = 0.007;
const DEEPENING_ATTEMPTS: u32 = 2;
/// Fingers that land at more than this share of the part's height stand on it, or beside it on something too high to hold
/// the part well from there.
const LANDING: f64 = 0.62;
/// The test tug is a gentle lift by this much, metres.
const TUG_M: f64 = 0.025;
/// What was taken is raised by this much at least, metres: for anybody to see that it is.
const LIFT_M: f64 = 0.08;
/// A gap that has changed by more than this since closing means that the part moved in the grip, metres; then the
/// hold is no surer than the confidence below.
const SLIP_M: f64 = 0.002;
const SLIPPED_CONFIDENCE: f64 = 0.7;

/// The chosen way to take the part.
#[derive(Debug, Clone, Copy)]
struct Approach {
    heading_rad: f64,
    width_m: f64,
    opening_m: f64,
    clearance_m: f64,
}

#[derive(Debug, Clone, Copy)]
enum Stage {
    Begin,
    Reaching,
    Grasping { empty_n: f64 },
    Tugging { empty_n: f64, grip: HeldGrip },
    Lifting { empty_n: f64, grip: HeldGrip },
}

/// What the grasp left in the hand.
#[derive(Debug, Clone, Copy)]
struct HeldGrip {
    width_m: f64,
    gap_m: f64,
    base_in_tcp: Pose,
}

/// The running function.
pub(crate) struct GraspFromAbove {
    object: ObjectId,
    /// The part's base and the grasp frame, upright, in the world.
    base: Pose,
    frame: Pose,
    support_m: f64,
    approach: Approach,
    plan: GraspPlan,
    pre_height_m: f64,
    travel_height_m: f64,
    carry_height_m: f64,
    stage: Stage,
}

impl GraspFromAbove {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, feedback: &Feedback) -> Result<GraspFromAbove, StartError> {
        require_empty_hand(invocation, feedback)?;
        let height_m = argument(invocation, "height")?;
        let support_m = invocation.support_height_m;
        let (base, frame) = (invocation.target.pose.pose, invocation.frame);
        let top_m = (base.translation.z + height_m).max(frame.translation.z);
        let grip_height_m = grip_height(hand, frame.translation.z, support_m, invocation.attempt);
        let at = frame.translation.with_z(grip_height_m);
        within_guarded_reach(&hand.robot, "the grasp", at)?;
        let obstacles = obstacles(invocation, support_m);
        let approach = choose_approach(invocation, hand, at, &obstacles)?;
        let pre_height_m = (top_m + hand.tip_reach_m + GUARD_M).max(grip_height_m + GUARD_M);
        within_reach(&hand.robot, "the pose above the grasp", at.with_z(pre_height_m))?;
        let start = hand.command.tcp.translation;
        let travel_height_m = safe_height(hand, start, at, &obstacles, top_m, 0.0)?;
        let below_m = grip_height_m - support_m + GUARD_M;
        let lift_height_m = safe_height(hand, at, at, &obstacles, support_m, below_m)?;
        // A failed grasp leaves the part standing: the empty fingers must clear its top as well.
        let above_top_m = top_m + hand.tip_reach_m + SAFETY_M;
        let carry_height_m = lift_height_m.max(above_top_m).max(grip_height_m + LIFT_M);
        Ok(GraspFromAbove {
            object: invocation.part.object,
            base: Pose::from_yaw(base.translation.with_z(support_m), base.yaw()),
            frame,
            support_m,
            approach,
            plan: GraspPlan {
                travel_m: pre_height_m - grip_height_m,
                width_m: approach.width_m,
                landed_before_m: pre_height_m - hand.tip_reach_m - (support_m + LANDING * (top_m - support_m)),
                attached: false,
            },
            pre_height_m,
            travel_height_m,
            carry_height_m: within_ceiling(hand, carry_height_m),
            stage: Stage::Begin,
        })
    }

    /// How the part's base sits in the hand. Closing has put the middle between the pads and has turned the faces
    /// to them; along the pads the part stays where it was perceived; its base was on the support.
    fn base_in_tcp(&self, tcp: &Pose) -> Pose {
        let hand = downward(tcp.translation, self.approach.heading_rad).inverse();
        let mut base = hand * self.base;
        base.translation.y -= hand.transform_point(self.frame.translation).y;
        base.translation.z = tcp.translation.z - self.support_m;
        base
    }

    fn reach(&mut self, hand: &Hand, notes: &mut Notes) -> Next {
        notes.measure("finger_clearance_m", self.approach.clearance_m);
        let above = downward(self.frame.translation.with_z(self.pre_height_m), self.approach.heading_rad);
        let pace = Pace::free(&hand.robot);
        let path = Path::over(hand.command.tcp, above, self.travel_height_m, pace, hand.robot.tick_s);
        self.stage = Stage::Reaching;
        Next::Begin(Box::new(Reach::new(path, self.approach.opening_m)))
    }

    fn tug(&mut self, hand: &Hand, empty_n: f64, outcome: Outcome, notes: &mut Notes) -> Option<Next> {
        let Outcome::Grasped { width_m, gap_m, tcp, touched } = outcome else { return None };
        notes.measure("grip_width_m", width_m);
        notes.measure("grip_height_m", tcp.translation.z);
        notes.measure("fingers_touched", f64::from(u8::from(touched)));
        self.stage = Stage::Tugging { empty_n, grip: HeldGrip { width_m, gap_m, base_in_tcp: self.base_in_tcp(&tcp) } };
        let height_m = within_ceiling(hand, hand.command.tcp.translation.z + TUG_M);
        let path = Path::vertical(hand.command.tcp, height_m, Pace::gentle(&hand.robot), hand.robot.tick_s);
        Some(Next::Begin(Box::new(Carry::new(path, GripWatch::new(gap_m)))))
    }
}

impl Function for GraspFromAbove {
    fn next(&mut self, hand: &Hand, feedback: &Feedback, last: Option<Outcome>, notes: &mut Notes) -> Next {
        match (self.stage, last) {
            (Stage::Begin, _) => self.reach(hand, notes),
            (Stage::Reaching, _) => {
                self.stage = Stage::Grasping { empty_n: hand.baseline_n().z };
                Next::Begin(Box::new(Grasp::new(hand, self.plan)))
            }
            (Stage::Grasping { empty_n }, Some(outcome)) => {
                self.tug(hand, empty_n, outcome, notes).unwrap_or_else(unexpected)
            }
            (Stage::Tugging { empty_n, grip }, _) => {
                notes.measure("tug_gap_change_m", (feedback.opening_m - grip.gap_m).abs());
                self.stage = Stage::Lifting { empty_n, grip };
                let height_m = self.carry_height_m.max(hand.command.tcp.translation.z);
                let path = Path::vertical(hand.command.tcp, height_m, Pace::carrying(&hand.robot), hand.robot.tick_s);
                Next::Begin(Box::new(Carry::new(path, GripWatch::new(grip.gap_m))))
            }
            (Stage::Lifting { empty_n, grip }, _) => {
                notes.measure("held_weight_n", empty_n - hand.baseline_n().z);
                let slipped = (feedback.opening_m - grip.gap_m).abs() > SLIP_M;
                let fit = holding_confidence(grip.width_m, self.approach.width_m);
                let confidence = if slipped { fit.min(SLIPPED_CONFIDENCE) } else { fit };
                notes.feel_held(self.object, grip.base_in_tcp, confidence);
                Next::Done
            }
            (Stage::Grasping { .. }, None) => unexpected(),
        }
    }
    fn way_out(&self) -> WayOut {
        WayOut::Up(self.carry_height_m)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}

fn unexpected() -> Next {
    Next::Failed(Failure::new(FailureCause::Grasp, "the grasp ended without a grip".into()))
}

/// TCP height at which the fingers close: the frame's, kept off the support by the finger tips; deeper on retries,
/// where the guarded descent finds the support instead.
fn grip_height(hand: &Hand, frame_m: f64, support_m: f64, attempt: u32) -> f64 {
    let deeper_m = DEEPER_M * f64::from(attempt.min(DEEPENING_ATTEMPTS));
    let tips_clear_m = support_m + hand.tip_reach_m + TIP_CLEARANCE_M;
    let wanted_m = frame_m.max(tips_clear_m);
    (wanted_m - deeper_m).max(tips_clear_m - deeper_m).max(hand.robot.workspace_min.z.min(wanted_m))
}

/// The freest way among the part's sides and some openings. Odd attempts prefer the other side.
fn choose_approach(
    invocation: &SkillInvocation,
    hand: &Hand,
    at: DVec3,
    obstacles: &[PlacedSolid],
) -> Result<Approach, StartError> {
    let largest_m = hand.robot.max_opening_m;
    let frame_yaw = invocation.frame.yaw();
    let mut sides = vec![(frame_yaw, argument(invocation, "grip_width")?)];
    if invocation.arguments.contains_key("cross_width") {
        sides.push((frame_yaw + FRAC_PI_2, argument(invocation, "cross_width")?));
    }
    let narrowest_m = sides.iter().map(|side| side.1).fold(f64::INFINITY, f64::min);
    sides.retain(|side| side.1 + LEAST_SPREAD_M <= largest_m);
    if invocation.attempt % 2 == 1 {
        sides.reverse();
    }
    let mut best: Option<Approach> = None;
    for (heading_rad, width_m) in sides {
        let heading_rad = nearest_heading(heading_rad, hand.command.tcp.yaw());
        for spread_m in SPREADS_M {
            let opening_m = (width_m + spread_m).min(largest_m);
            let clearance_m = approach_clearance(&hand.robot, &downward(at, heading_rad), opening_m, obstacles);
            let approach = Approach { heading_rad, width_m, opening_m, clearance_m };
            if clearance_m >= ROOMY_M {
                return Ok(approach);
            }
            if best.is_none_or(|best| clearance_m > best.clearance_m) {
                best = Some(approach);
            }
        }
    }
    match best {
        None => Err(StartError::TooWide { width_m: narrowest_m, opening_m: largest_m }),
        Some(best) if best.clearance_m < -PERCEPTION_ERROR_M => {
            Err(StartError::Blocked { what: "grasp it", overlap_m: -best.clearance_m })
        }
        Some(best) => Ok(best),
    }
}

/// How sure the fingers are of holding the part: the better the felt width fits the perceived one, the surer.
fn holding_confidence(felt_m: f64, width_m: f64) -> f64 {
    let off_m = (felt_m - width_m).abs();
    if off_m <= 0.004 {
        0.97
    } else if off_m <= 0.008 {
        0.9
    } else {
        0.75
    }
}
