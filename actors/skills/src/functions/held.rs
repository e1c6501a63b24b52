//! What functions share that move what is held through free air.

use super::{articulated::surroundings, number};
use crate::{
    approach::{Surroundings, way},
    clearance::within_reach,
    controller::StartError,
    hand::{Hand, holds_something},
    motion::{Pace, Path},
    primitives::{Carry, Failure, GripWatch},
    run::{Next, WayOut},
    sequence::{Moment, Step, Steps},
};
use acm_concept::{
    ids::ObjectId,
    pose::Pose,
    primitive::Primitive as Kind,
    skill::{FailureCause, SkillInvocation},
};
use glam::{DQuat, DVec3};

/// Moves or turns what is held, and keeps it.
pub(crate) struct CarryHeld {
    object: ObjectId,
    base_in_tcp: Pose,
    kind: Kind,
    to: Pose,
    /// Turned on the spot, or carried to another.
    in_place: bool,
    around: Surroundings,
    before: Pose,
    turn_rad: f64,
}

impl CarryHeld {
    /// To where its base comes to the destination.
    pub fn to_destination(invocation: &SkillInvocation, hand: &Hand) -> Result<CarryHeld, StartError> {
        let (object, base_in_tcp) = held(invocation)?;
        let place =
            invocation.destination.ok_or_else(|| StartError::NoDestination { kind: invocation.kind.clone() })?;
        let to = place.pose * base_in_tcp.inverse();
        within_reach(&hand.robot, "the place", to.translation)?;
        Ok(CarryHeld::new(invocation, hand, object, base_in_tcp, Kind::Move, to, 0.0))
    }

    /// Turned by an angle about the axis that the arguments give in the TCP frame, where the hand is.
    pub fn turned(invocation: &SkillInvocation, hand: &Hand, kind: Kind, angle: f64) -> Result<CarryHeld, StartError> {
        let (object, base_in_tcp) = held(invocation)?;
        let axis = ["axis_x", "axis_y", "axis_z"].map(|name| number(invocation, name, 0.0));
        let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::Z);
        let to = hand.command.tcp * Pose::new(DVec3::ZERO, DQuat::from_axis_angle(axis, angle));
        Ok(CarryHeld::new(invocation, hand, object, base_in_tcp, kind, to, angle.abs()))
    }

    fn new(
        invocation: &SkillInvocation,
        hand: &Hand,
        object: ObjectId,
        base_in_tcp: Pose,
        kind: Kind,
        to: Pose,
        turn_rad: f64,
    ) -> CarryHeld {
        let before = hand.command.tcp;
        let in_place = before.translation.distance(to.translation) < 1e-6;
        CarryHeld { object, base_in_tcp, kind, to, in_place, around: surroundings(invocation), before, turn_rad }
    }

    fn carry(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        if let Some(next) = require_held(moment) {
            return Some(next);
        }
        let (hand, pace) = (moment.hand, Pace::carrying(&moment.hand.robot));
        let path = if self.in_place {
            // In halves, since the shortest way between two poses that are half a turn apart is anybody's guess.
            let turn = self.before.rotation.inverse() * self.to.rotation;
            let (axis, angle) = turn.to_axis_angle();
            let half = self.before * Pose::new(DVec3::ZERO, DQuat::from_axis_angle(axis, 0.5 * angle));
            Path::through(hand.command.tcp, &[half, self.to], pace, hand.robot.tick_s)
        } else {
            way(hand, self.to, &self.around, pace)
        };
        Some(Next::begin(Carry::turning(self.kind, path, GripWatch::new(moment.feedback.opening_m))))
    }

    fn measure(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        if self.turn_rad > 0.0 {
            moment.notes.measure("turned_rad", moment.feedback.tcp.angle_to(&self.before));
        }
        moment.notes.feel_held(self.object, self.base_in_tcp, 0.95);
        None
    }
}

impl Steps for CarryHeld {
    const STEPS: &'static [Step<CarryHeld>] = &[CarryHeld::carry, CarryHeld::measure];
    fn way_out(&self) -> WayOut {
        WayOut::Up(self.to.translation.z.max(self.before.translation.z))
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}

/// What is held and how, or a refusal.
pub(crate) fn held(invocation: &SkillInvocation) -> Result<(ObjectId, Pose), StartError> {
    let held = invocation.held.as_ref().map(|(object, base_in_tcp, _)| (*object, *base_in_tcp));
    held.ok_or_else(|| StartError::NothingHeld { kind: invocation.kind.clone() })
}

/// Ends the function where the fingers hold nothing.
pub(crate) fn require_held(moment: &Moment<'_>) -> Option<Next> {
    if holds_something(moment.feedback) {
        return None;
    }
    let reason = format!("the hand is empty: its gap is {:.1} mm before the motion", 1e3 * moment.feedback.opening_m);
    Some(Next::Failed(Failure::empty_handed(FailureCause::Grasp, reason)))
}
