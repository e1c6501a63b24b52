//! `grasp-along`: take a thing between the fingers from any free side and lift it.
//!
//! The frame lies where the fingers close, z out of the thing, y across it. Arguments: `grip_width`, the thing's width
//! along y, and `height`, of the thing over its base, metres; `sides`, how many sides look alike when it is turned about
//! the upright axis through its base (1 if absent; 0 for round things): their approaches are tried as well.

use super::{
    argument,
    articulated::{all_around, surroundings},
    number, require_empty_hand,
};
use crate::{
    approach::{Surroundings, TILTS, choose, drawn_back, facing, openings, tilted, turned_about, way},
    clearance::SAFETY_M,
    controller::StartError,
    hand::Hand,
    motion::{Pace, Path},
    primitives::{Carry, Grasp, GraspPlan, GripWatch, Outcome, Reach},
    run::{Next, WayOut},
    sequence::{Moment, Step, Steps},
};
use acm_concept::{
    embodiment::Feedback,
    ids::ObjectId,
    pose::Pose,
    skill::{FailureCause, SkillInvocation},
};
use glam::DVec3;
use std::f64::consts::TAU;

/// How much wider than the thing the fingers must be on the way to it, metres.
const LEAST_SPREAD_M: f64 = 0.008;
/// Sides of a round thing that are tried.
const ROUND_SIDES: u32 = 8;
/// Distance at which the hand comes to rest before it goes to the thing, metres.
const STANDOFF_M: f64 = 0.07;
/// The test tug is a gentle lift by this much, metres; then it goes this much higher.
const TUG_M: f64 = 0.02;
const LIFT_M: f64 = 0.08;
/// A gap that has changed by more than this since closing means that the thing moved in the grip, metres.
const SLIP_M: f64 = 0.002;

/// The running function.
pub(crate) struct GraspAlong {
    object: ObjectId,
    base: Pose,
    at: Pose,
    /// What the hand keeps clear of on its way.
    around: Surroundings,
    opening_m: f64,
    plan: GraspPlan,
    lift_m: f64,
    empty_n: f64,
    gap_m: f64,
    base_in_tcp: Pose,
}

impl GraspAlong {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, feedback: &Feedback) -> Result<GraspAlong, StartError> {
        require_empty_hand(invocation, feedback)?;
        let (width_m, height_m) = (argument(invocation, "grip_width")?, argument(invocation, "height")?);
        let openings_m = openings(hand, width_m, LEAST_SPREAD_M)?;
        let (candidates, around) = (candidates(invocation, hand), surroundings(invocation));
        let (at, opening_m) = choose(hand, "grasp it", &candidates, &openings_m, STANDOFF_M, &around)?;
        Ok(GraspAlong {
            object: invocation.part.object,
            base: invocation.target.pose.pose,
            at,
            around: all_around(invocation),
            opening_m,
            plan: GraspPlan {
                travel_m: STANDOFF_M,
                width_m,
                // Palm or tips that touch in the last centimetre have met the thing's far side or what is behind.
                landed_before_m: STANDOFF_M - hand.tip_reach_m,
                attached: false,
            },
            lift_m: LIFT_M.max(0.3 * height_m) + SAFETY_M,
            empty_n: 0.0,
            gap_m: 0.0,
            base_in_tcp: Pose::IDENTITY,
        })
    }

    pub fn reach(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let path = way(moment.hand, drawn_back(&self.at, STANDOFF_M), &self.around, Pace::free(&moment.hand.robot));
        Some(Next::begin(Reach::new(path, self.opening_m)))
    }

    pub fn grasp(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        self.empty_n = moment.hand.baseline_n().z;
        Some(Next::begin(Grasp::new(moment.hand, self.plan)))
    }

    pub fn tug(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let Some(Outcome::Grasped { width_m, gap_m, tcp, .. }) = moment.last else {
            return Some(Next::fail(FailureCause::Grasp, "the grasp ended without a grip"));
        };
        moment.notes.measure("grip_width_m", width_m);
        self.gap_m = gap_m;
        // Closing has put the frame's middle between the pads; along them it stays where it was perceived.
        let ideal = Pose::new(tcp.translation, self.at.rotation);
        let mut base = ideal.inverse() * self.base;
        base.translation.y -= (ideal.inverse() * self.at).translation.y;
        self.base_in_tcp = base;
        Some(self.rise(moment, TUG_M, Pace::gentle(&moment.hand.robot)))
    }

    pub fn lift(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        moment.notes.measure("tug_gap_change_m", (moment.feedback.opening_m - self.gap_m).abs());
        Some(self.rise(moment, self.lift_m, Pace::carrying(&moment.hand.robot)))
    }

    /// How the thing's base sits in the hand once it is grasped.
    pub fn base_in_tcp(&self) -> Pose {
        self.base_in_tcp
    }

    fn rise(&self, moment: &Moment<'_>, by_m: f64, pace: Pace) -> Next {
        let hand = moment.hand;
        let height_m = (hand.command.tcp.translation.z + by_m).min(hand.robot.workspace_max.z);
        let path = Path::vertical(hand.command.tcp, height_m, pace, hand.robot.tick_s);
        Next::begin(Carry::new(path, GripWatch::new(self.gap_m)))
    }

    pub fn feel(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        moment.notes.measure("held_weight_n", self.empty_n - moment.hand.baseline_n().z);
        let slipped = (moment.feedback.opening_m - self.gap_m).abs() > SLIP_M;
        moment.notes.feel_held(self.object, self.base_in_tcp, if slipped { 0.7 } else { 0.95 });
        None
    }
}

impl Steps for GraspAlong {
    const STEPS: &'static [Step<GraspAlong>] =
        &[GraspAlong::reach, GraspAlong::grasp, GraspAlong::tug, GraspAlong::lift, GraspAlong::feel];
    fn way_out(&self) -> WayOut {
        WayOut::Back(STANDOFF_M)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}

/// The ways to take it: those that need a small turn of the hand first, straight before tilted.
fn candidates(invocation: &SkillInvocation, hand: &Hand) -> Vec<Pose> {
    let sides = match number(invocation, "sides", 1.0).round() {
        0.0 => ROUND_SIDES,
        sides => sides.clamp(1.0, 8.0) as u32,
    };
    let base = invocation.target.pose.pose;
    let in_base = base.inverse() * invocation.frame;
    let mut poses = Vec::new();
    for side in 0..sides {
        let turn = Pose::from_yaw(DVec3::ZERO, TAU * f64::from(side) / f64::from(sides));
        let facing = facing(&(base * turn * in_base));
        for straight in [facing, turned_about(&facing)] {
            poses.extend(TILTS.map(|tilt| (tilt.abs(), tilted(&straight, tilt))));
        }
    }
    let now = hand.command.tcp;
    let cost = |(tilt, pose): &(f64, Pose)| 2.0 * tilt + now.angle_to(pose);
    poses.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    poses.into_iter().map(|(_, pose)| pose).collect()
}
