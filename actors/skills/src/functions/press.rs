//! `press`: press a part with closed fingers from the side its frame faces, and let it spring back.
//!
//! The frame lies on the surface that is pressed, z out of it. Arguments: `stroke`, how far the part may have to
//! travel, metres; `force`, at which it is taken to be at its end, newtons. A thing that pushes back with less than about
//! a newton is not felt to give way.

use super::{argument, articulated::surroundings, ending, press_down::judge, require_empty_hand};
use crate::{
    approach::{Surroundings, choose, drawn_back, facing, turned_about, way},
    clearance::GUARD_M,
    controller::StartError,
    hand::Hand,
    motion::Pace,
    primitives::{Press as PressPrimitive, PressPlan, Reach},
    run::{Next, WayOut},
    sequence::{Moment, Step, Steps},
};
use acm_concept::{embodiment::Feedback, ids::ObjectId, pose::Pose, skill::SkillInvocation};
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// How far beyond the perceived surface it is looked for, metres.
const SEARCH_M: f64 = 0.025;
/// How far the hand backs off in the end, metres.
const LEAVE_M: f64 = 0.08;

/// The running function.
pub(crate) struct Press {
    object: ObjectId,
    contact: Pose,
    around: Surroundings,
    plan: PressPlan,
}

impl Press {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, feedback: &Feedback) -> Result<Press, StartError> {
        require_empty_hand(invocation, feedback)?;
        let (stroke_m, force_n) = (argument(invocation, "stroke")?, argument(invocation, "force")?);
        let around = surroundings(invocation);
        let tips = facing(&invocation.frame) * Pose::from_translation(-hand.tip_reach_m * DVec3::Z);
        let quarter = tips * Pose::from_yaw(DVec3::ZERO, FRAC_PI_2);
        let mut contacts = [tips, quarter, turned_about(&tips), turned_about(&quarter)];
        contacts.sort_by(|a, b| hand.command.tcp.angle_to(a).total_cmp(&hand.command.tcp.angle_to(b)));
        let (contact, _) = choose(hand, "press it", &contacts, &[0.0], GUARD_M, &around)?;
        let plan = PressPlan { surface_m: GUARD_M, search_m: SEARCH_M, stroke_m, force_n };
        Ok(Press { object: invocation.part.object, contact, around, plan })
    }

    fn reach(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let path = way(moment.hand, drawn_back(&self.contact, GUARD_M), &self.around, Pace::free(&moment.hand.robot));
        Some(Next::begin(Reach::new(path, 0.0)))
    }
}

impl Steps for Press {
    const STEPS: &'static [Step<Press>] = &[
        Press::reach,
        |press, moment| Some(Next::begin(PressPrimitive::new(moment.hand, press.plan))),
        |press, moment| judge(press.object, moment.last, moment.notes).err().map(Next::Failed),
        |_, moment| Some(ending::back_off_by(moment.hand, LEAVE_M)),
    ];
    fn way_out(&self) -> WayOut {
        WayOut::Back(LEAVE_M)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}
