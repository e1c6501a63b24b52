//! `release`: let go of what is held where it is, and back off.
//!
//! No arguments. What stands nowhere falls.

use super::{
    ending,
    held::{held, require_held},
};
use crate::{
    controller::StartError,
    run::WayOut,
    sequence::{Step, Steps},
};
use acm_concept::{ids::ObjectId, pose::Pose, skill::SkillInvocation};

/// The running function.
pub(crate) struct Release {
    object: ObjectId,
    base_in_tcp: Pose,
}

impl Release {
    pub fn plan(invocation: &SkillInvocation) -> Result<Release, StartError> {
        let (object, base_in_tcp) = held(invocation)?;
        Ok(Release { object, base_in_tcp })
    }
}

impl Steps for Release {
    const STEPS: &'static [Step<Release>] = &[
        |_, moment| require_held(moment),
        |_, moment| ending::open(moment, moment.feedback.opening_m),
        |release, moment| {
            moment.notes.left_at = Some(moment.feedback.tcp * release.base_in_tcp);
            ending::back_off(moment)
        },
        |release, moment| ending::felt_free(moment, release.object),
    ];
    fn way_out(&self) -> WayOut {
        WayOut::Back(0.07)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}
