//! `insert-along`: bring what is held into an opening, in part or in full, searching by touch; then let go.
//!
//! The destination is where the base of what is held shall be when it is in. Arguments: `depth`, how deep its tip goes
//! beyond the rim, and `clearance`, width of the opening less that of what goes in, metres; `axis_x`, `axis_y`,
//! `axis_z`, the direction into the opening in the base frame of what is held there (straight down if absent);
//! `partial`, above 0 where no ground is met at that depth; `keep`, above 0 if the fingers shall keep hold.

use super::{argument, ending, number};
use crate::{
    approach::{Surroundings, way},
    clearance::{obstacles, within_reach},
    controller::StartError,
    hand::{Hand, holds_something},
    motion::{Pace, Path},
    primitives::{Carry, Failure, GripWatch, Insert, InsertPlan, Outcome},
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

/// Distance of the tip from the perceived rim from which it goes on by touch, metres.
const HOVER_M: f64 = 0.008;

/// The running function.
pub(crate) struct InsertAlong {
    object: ObjectId,
    base_in_tcp: Pose,
    hover: Pose,
    around: Surroundings,
    plan: InsertPlan,
    keep: bool,
    gap_m: f64,
    withdraw_m: f64,
}

impl InsertAlong {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, feedback: &Feedback) -> Result<InsertAlong, StartError> {
        let kind = || invocation.kind.clone();
        let (object, base_in_tcp, _) =
            invocation.held.as_ref().ok_or_else(|| StartError::NothingHeld { kind: kind() })?;
        let place = invocation.destination.ok_or_else(|| StartError::NoDestination { kind: kind() })?;
        let (depth_m, clearance_m) = (argument(invocation, "depth")?, argument(invocation, "clearance")?);
        let axis = ["axis_x", "axis_y", "axis_z"].map(|name| number(invocation, name, 0.0));
        let axis = DVec3::from_array(axis).try_normalize().unwrap_or(-DVec3::Z);
        let direction = place.pose.transform_vector(axis);
        let inserted = place.pose * base_in_tcp.inverse();
        let hover = Pose::new(inserted.translation - (depth_m + HOVER_M) * direction, inserted.rotation);
        // Its base goes in first, unless an axis says otherwise: then its middle line is taken for the tip's way.
        let tip_m = (place.pose.translation - inserted.translation).dot(direction).max(0.0);
        within_reach(&hand.robot, "the pose before the opening", hover.translation)?;
        within_reach(&hand.robot, "the pose in the opening", inserted.translation)?;
        let obstacles = obstacles(invocation, invocation.support_height_m);
        Ok(InsertAlong {
            object: *object,
            base_in_tcp: *base_in_tcp,
            hover,
            around: Surroundings { obstacles, floor_m: invocation.support_height_m },
            plan: InsertPlan {
                direction,
                rim_m: HOVER_M,
                depth_m,
                clearance_m,
                grounded: number(invocation, "partial", 0.0) <= 0.0,
                tip_m,
            },
            keep: number(invocation, "keep", 0.0) > 0.0,
            gap_m: feedback.opening_m,
            withdraw_m: hover.translation.z + 0.05,
        })
    }

    fn carry(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        if !holds_something(moment.feedback) {
            let reason =
                format!("the hand is empty: its gap is {:.1} mm before the carry", 1e3 * moment.feedback.opening_m);
            return Some(Next::Failed(Failure::empty_handed(FailureCause::Grasp, reason)));
        }
        self.gap_m = moment.feedback.opening_m;
        let pace = Pace::carrying(&moment.hand.robot);
        let path: Path = way(moment.hand, self.hover, &self.around, pace);
        Some(Next::begin(Carry::new(path, GripWatch::new(self.gap_m))))
    }

    fn insert(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        Some(Next::begin(Insert::new(moment.hand, self.plan, GripWatch::new(self.gap_m))))
    }

    fn measure(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let Some(Outcome::Inserted { depth_m, searched_m, force_n }) = moment.last else {
            return Some(Next::fail(FailureCause::Place, "the insertion ended without a result"));
        };
        moment.notes.measure("insert_depth_m", depth_m);
        moment.notes.measure("insert_search_m", searched_m);
        moment.notes.measure("insert_force_n", force_n);
        moment.notes.left_at = Some(moment.feedback.tcp * self.base_in_tcp);
        if self.keep {
            return Some(Next::Done);
        }
        None
    }
}

impl Steps for InsertAlong {
    const STEPS: &'static [Step<InsertAlong>] = &[
        InsertAlong::carry,
        InsertAlong::insert,
        InsertAlong::measure,
        |function, moment| ending::open(moment, function.gap_m),
        |_, moment| ending::back_off(moment),
        |function, moment| ending::felt_free(moment, function.object),
    ];
    fn way_out(&self) -> WayOut {
        WayOut::Up(self.withdraw_m)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}
