//! `slice`: press the lower edge of what is held once onto a part from above, and lift it off again.
//!
//! The frame lies where the edge shall meet the part, z up out of it; its heading is that of the base frame of what is
//! held. Argument: `force`, with which the edge must be pressed, newtons. Slicing is one event: nothing is parted by
//! degrees, and whether the part is sliced is seen afterwards and not felt.

use super::{
    argument,
    held::{held, require_held},
};
use crate::{
    approach::{Surroundings, drawn_back, way},
    clearance::{GUARD_M, obstacles, within_reach},
    controller::StartError,
    hand::Hand,
    motion::{Pace, Path},
    primitives::{Carry, Failure, GripWatch, Outcome, Press, PressPlan},
    run::{Next, WayOut},
    sequence::{Moment, Step, Steps},
};
use acm_concept::{
    ids::ObjectId,
    pose::Pose,
    skill::{FailureCause, SkillInvocation},
};
use glam::DVec3;

/// How far beyond the perceived surface the part is looked for, metres.
const SEARCH_M: f64 = 0.015;
/// How far the part may give under the edge, metres.
const GIVES_M: f64 = 0.01;
/// The hand must come from above within this, radians: it feels the force along its approach.
const TILT_RAD: f64 = 0.2;

/// The running function.
pub(crate) struct Slice {
    object: ObjectId,
    held: ObjectId,
    base_in_tcp: Pose,
    above: Pose,
    around: Surroundings,
    plan: PressPlan,
}

impl Slice {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<Slice, StartError> {
        let (held, base_in_tcp) = held(invocation)?;
        let force_n = argument(invocation, "force")?;
        let met = Pose::from_yaw(invocation.frame.translation, invocation.frame.yaw()) * base_in_tcp.inverse();
        let tilt_rad = met.transform_vector(DVec3::Z).angle_between(-DVec3::Z);
        if tilt_rad > TILT_RAD {
            return Err(StartError::Tilted { tilt_rad });
        }
        let above = drawn_back(&met, GUARD_M);
        within_reach(&hand.robot, "the slice", met.translation)?;
        within_reach(&hand.robot, "the pose above the slice", above.translation)?;
        let obstacles = obstacles(invocation, invocation.support_height_m);
        Ok(Slice {
            object: invocation.part.object,
            held,
            base_in_tcp,
            above,
            around: Surroundings { obstacles, floor_m: invocation.support_height_m },
            plan: PressPlan { surface_m: GUARD_M, search_m: SEARCH_M, stroke_m: GIVES_M, force_n },
        })
    }

    fn carry(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        if let Some(next) = require_held(moment) {
            return Some(next);
        }
        let path = way(moment.hand, self.above, &self.around, Pace::carrying(&moment.hand.robot));
        Some(Next::begin(Carry::new(path, GripWatch::new(moment.feedback.opening_m))))
    }

    fn judge(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let Some(Outcome::Pushed { force_n, .. }) = moment.last else {
            return Some(Next::fail(FailureCause::Press, "the push ended without a result"));
        };
        moment.notes.measure("slice_force_n", force_n);
        if let Some(next) = require_held(moment) {
            return Some(next);
        }
        let least_n = self.plan.force_n;
        (force_n < least_n).then(|| {
            let reason = format!("the edge was pressed with {force_n:.0} N, {least_n:.0} N are needed");
            Next::Failed(Failure::new(FailureCause::Press, reason))
        })
    }

    fn lift(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let (hand, pace) = (moment.hand, Pace::carrying(&moment.hand.robot));
        let path = Path::through(hand.command.tcp, &[self.above], pace, hand.robot.tick_s);
        Some(Next::begin(Carry::new(path, GripWatch::new(moment.feedback.opening_m))))
    }
}

impl Steps for Slice {
    const STEPS: &'static [Step<Slice>] = &[
        Slice::carry,
        |slice, moment| Some(Next::begin(Press::new(moment.hand, slice.plan))),
        Slice::judge,
        Slice::lift,
        |slice, moment| {
            moment.notes.feel_held(slice.held, slice.base_in_tcp, 0.95);
            None
        },
    ];
    fn way_out(&self) -> WayOut {
        WayOut::Up(self.above.translation.z)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}
