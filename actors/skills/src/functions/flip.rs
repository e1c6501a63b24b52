//! `flip`: turn a thing upside down where it stands.
//!
//! The hand takes it from the side, lifts it, rolls by half a turn about its approach direction, and puts it down on
//! what was its top. The frame lies in the side, at about half of the thing's height, z level and out of it, y level.
//! Arguments: `grip_width`, the thing's width along y, and `height`, of the thing over its base, metres; `sides` as for
//! `grasp-along`. A thing so low that the hand would meet the support is refused.

use super::{argument, ending, grasp_along::GraspAlong};
use crate::{
    controller::StartError,
    hand::Hand,
    motion::{Pace, Path},
    primitives::{Carry, GripWatch, Lower, Outcome},
    run::{Next, WayOut},
    sequence::{Moment, Step, Steps},
};
use acm_concept::{
    embodiment::Feedback,
    ids::ObjectId,
    pose::Pose,
    primitive::Primitive as Kind,
    skill::{FailureCause, SkillInvocation},
};
use glam::{DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// How far below the expected contact it is still looked for, metres.
const SEARCH_M: f64 = 0.018;
/// Height over the contact from which the thing is lowered by touch, metres.
const GUARD_M: f64 = 0.015;
/// The turn may be off by this, radians.
const OFF_RAD: f64 = 0.26;

/// The running function.
pub(crate) struct Flip {
    grasp: GraspAlong,
    support_m: f64,
    height_m: f64,
    before: Pose,
}

impl Flip {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, feedback: &Feedback) -> Result<Flip, StartError> {
        let height_m = argument(invocation, "height")?;
        let out = invocation.frame.transform_vector(DVec3::Z);
        if out.z.abs() > 0.1 {
            return Err(StartError::Tilted { tilt_rad: out.angle_between(DVec3::Z) });
        }
        // Upside down the hand is as far over the support as it now is below the thing's top.
        let grip_m = invocation.frame.translation.z - invocation.support_height_m;
        let under_m = (height_m - grip_m).min(grip_m);
        let needed_m = half_thickness(hand);
        if under_m < needed_m {
            return Err(StartError::Blocked { what: "turn it over", overlap_m: needed_m - under_m });
        }
        let grasp = GraspAlong::plan(invocation, hand, feedback)?;
        Ok(Flip { grasp, support_m: invocation.support_height_m, height_m, before: Pose::IDENTITY })
    }

    fn turn(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let hand = moment.hand;
        self.before = hand.command.tcp;
        let roll = |angle: f64| self.before * Pose::new(DVec3::ZERO, DQuat::from_rotation_z(angle));
        let pace = Pace::carrying(&hand.robot);
        let path = Path::through(hand.command.tcp, &[roll(FRAC_PI_2), roll(PI)], pace, hand.robot.tick_s);
        Some(Next::begin(Carry::turning(Kind::Flip, path, GripWatch::new(moment.feedback.opening_m))))
    }

    fn descend(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let turned_rad = moment.feedback.tcp.angle_to(&self.before);
        moment.notes.measure("turned_rad", turned_rad);
        if (turned_rad - PI).abs() > OFF_RAD {
            let reason = format!("turned by {:.0} degrees only", turned_rad.to_degrees());
            return Some(Next::fail(FailureCause::Motion, reason));
        }
        let hand = moment.hand;
        let height_m = (self.contact_m(hand) + GUARD_M).min(hand.command.tcp.translation.z);
        let path = Path::vertical(hand.command.tcp, height_m, Pace::carrying(&hand.robot), hand.robot.tick_s);
        Some(Next::begin(Carry::new(path, GripWatch::new(moment.feedback.opening_m))))
    }

    /// TCP height at which what was the top should touch.
    fn contact_m(&self, hand: &Hand) -> f64 {
        let base = hand.command.tcp * self.grasp.base_in_tcp();
        let top = base.transform_point(self.height_m * DVec3::Z);
        self.support_m + hand.command.tcp.translation.z - top.z
    }

    fn lower(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let floor_m = self.contact_m(moment.hand) - SEARCH_M;
        Some(Next::begin(Lower::new(moment.hand, floor_m, GripWatch::new(moment.feedback.opening_m))))
    }

    fn open(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let Some(Outcome::Lowered { touch_n: Some(touch_n), .. }) = moment.last else {
            return Some(Next::fail(FailureCause::Place, "turned over, but it touched nothing when it was lowered"));
        };
        moment.notes.measure("standing_force_n", touch_n);
        moment.notes.left_at = Some(moment.feedback.tcp * self.grasp.base_in_tcp());
        ending::open(moment, moment.feedback.opening_m)
    }
}

impl Steps for Flip {
    const STEPS: &'static [Step<Flip>] = &[
        |flip, moment| flip.grasp.reach(moment),
        |flip, moment| flip.grasp.grasp(moment),
        |flip, moment| flip.grasp.tug(moment),
        |flip, moment| flip.grasp.lift(moment),
        |flip, moment| flip.grasp.feel(moment),
        Flip::turn,
        Flip::descend,
        Flip::lower,
        Flip::open,
        |_, moment| ending::back_off(moment),
        |flip, moment| ending::felt_free(moment, flip.grasp.object()),
    ];
    fn way_out(&self) -> WayOut {
        WayOut::Up(self.before.translation.z.max(0.0))
    }
    fn object(&self) -> ObjectId {
        self.grasp.object()
    }
}

/// Half of the hand's thickness across approach and closing direction, metres.
fn half_thickness(hand: &Hand) -> f64 {
    let solids = hand.robot.solids(&Pose::IDENTITY, hand.robot.max_opening_m);
    solids.iter().map(|part| part.pose.translation.x.abs() + part.half_extents().x).fold(0.0, f64::max)
}
