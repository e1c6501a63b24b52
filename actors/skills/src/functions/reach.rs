//! `reach`: bring the empty hand before a part, ready to act on it, without touching anything.
//!
//! The hand comes to look against the frame's z axis. Arguments: `distance`, how far the finger tips stay from the frame,
//! metres; `opening`, how wide the fingers then are, metres (as they are if absent).

use super::{
    argument,
    articulated::{all_around, surroundings},
    number,
};
use crate::{
    approach::{Surroundings, TILTS, choose, facing, tilted, turned_about, way},
    controller::StartError,
    hand::Hand,
    motion::Pace,
    primitives::Reach as ReachPrimitive,
    run::{Next, WayOut},
    sequence::{Moment, Step, Steps},
};
use acm_concept::{ids::ObjectId, pose::Pose, skill::SkillInvocation};
use glam::DVec3;

/// The running function.
pub(crate) struct Reach {
    object: ObjectId,
    to: Pose,
    opening_m: f64,
    around: Surroundings,
}

impl Reach {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand) -> Result<Reach, StartError> {
        let distance_m = argument(invocation, "distance")?;
        let opening_m = number(invocation, "opening", hand.command.opening_m).clamp(0.0, hand.robot.max_opening_m);
        let facing = facing(&invocation.frame);
        let first = if hand.command.tcp.angle_to(&turned_about(&facing)) < hand.command.tcp.angle_to(&facing) {
            turned_about(&facing)
        } else {
            facing
        };
        let before = Pose::from_translation(-(distance_m + hand.tip_reach_m) * DVec3::Z);
        let candidates = TILTS.map(|angle| tilted(&first, angle) * before);
        let (to, _) = choose(hand, "reach it", &candidates, &[opening_m], 0.0, &surroundings(invocation))?;
        Ok(Reach { object: invocation.part.object, to, opening_m, around: all_around(invocation) })
    }
}

impl Steps for Reach {
    const STEPS: &'static [Step<Reach>] = &[|reach, moment: &mut Moment<'_>| {
        let path = way(moment.hand, reach.to, &reach.around, Pace::free(&moment.hand.robot));
        Some(Next::begin(ReachPrimitive::new(path, reach.opening_m)))
    }];
    fn way_out(&self) -> WayOut {
        WayOut::Back(0.05)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}
