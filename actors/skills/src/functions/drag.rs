//! Opening what has no handle: closed finger tips press on the narrow face at its free edge and take it along by friction.
//!
//! The tips press towards the hinge, or across the slide, so that the pressing itself moves nothing. A door that its weight
//! takes from under the tips is felt to do so; then the tips go in behind its edge and see to it that it is open so far.

use super::{
    articulated::{DrawKind, Felt, LEAVE_M, note_travel, surroundings},
    ending,
};
use crate::{
    approach::{Surroundings, choose, drawn_back, facing, turned_about, way},
    controller::StartError,
    hand::Hand,
    motion::Pace,
    primitives::{Follow, FollowPlan, Hold, Press, PressPlan, Pressing, Reach},
    run::{Next, WayOut},
    sequence::{Moment, Step, Steps},
};
use acm_concept::{ids::ObjectId, pose::Pose, skill::SkillInvocation};
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// Distance from the face at which the hand comes to rest, and how far beyond it the face is looked for, metres.
const STANDOFF_M: f64 = 0.03;
const SEARCH_M: f64 = 0.015;
/// The force that the face is met with, and that is kept on the way, newtons. Rubber on paint holds about as much along the
/// face as presses on it.
const MEETING_N: f64 = 12.0;
const PRESSING_N: f64 = 30.0;
/// Speed along the way, m/s.
const DRAG_M_S: f64 = 0.12;

/// The running function.
pub(crate) struct Drag {
    object: ObjectId,
    felt: Felt,
    contact: Pose,
    around: Surroundings,
    follow: FollowPlan,
}

impl Drag {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, kind: DrawKind) -> Result<Drag, StartError> {
        let around = surroundings(invocation);
        let tips = drawn_back(&facing(&invocation.frame), hand.tip_reach_m);
        let quarter = tips * Pose::from_yaw(DVec3::ZERO, FRAC_PI_2);
        let mut contacts = [tips, quarter, turned_about(&tips), turned_about(&quarter)];
        contacts.sort_by(|a, b| hand.command.tcp.angle_to(a).total_cmp(&hand.command.tcp.angle_to(b)));
        let (contact, _) = choose(hand, kind.what, &contacts, &[0.0], STANDOFF_M, &around)?;
        Ok(Drag {
            object: invocation.part.object,
            felt: kind.felt,
            contact,
            around,
            follow: FollowPlan {
                kind: kind.primitive,
                joint: kind.joint,
                travel: kind.travel,
                least: kind.least(),
                lead_on: 0.0,
                speed_m_s: DRAG_M_S,
                hold: Hold::Pressed(Pressing::with(PRESSING_N)),
            },
        })
    }

    fn reach(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let before = drawn_back(&self.contact, STANDOFF_M);
        let path = way(moment.hand, before, &self.around, Pace::free(&moment.hand.robot));
        Some(Next::begin(Reach::new(path, 0.0)))
    }
}

impl Steps for Drag {
    const STEPS: &'static [Step<Drag>] = &[
        Drag::reach,
        |_, moment| {
            let plan = PressPlan { surface_m: STANDOFF_M, search_m: SEARCH_M, stroke_m: 0.0, force_n: MEETING_N };
            Some(Next::begin(Press::new(moment.hand, plan)))
        },
        |drag, moment| Some(Next::begin(Follow::new(moment.hand, drag.follow.clone()))),
        |drag, moment| note_travel(moment, drag.object, drag.felt),
        |_, moment| Some(ending::back_off_by(moment.hand, LEAVE_M)),
    ];
    fn way_out(&self) -> WayOut {
        WayOut::Back(LEAVE_M)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}
