//! What the hand's way told of a part's joint: the refined hinge or slide of the newest transition that moved the part,
//! kept in the part's own frame so that it goes with the part.
//!
//! It is read from transition memory, not stored beside it: what is wiped or forgotten there is forgotten here.

use crate::{
    entry::{Transition, TransitionResult},
    traits::MemoryView,
};
use acm_concept::{
    ids::{PartId, TransitionId},
    pose::Pose,
};
use glam::DVec3;
use std::collections::BTreeMap;

/// A joint as a hand felt it, in the frame of its part. An axis is the same before and after a turn about it, and a
/// direction before and after a slide along it, so it does not matter how far the part stands open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeltJoint {
    /// The transition that it rests on.
    pub evidence: TransitionId,
    /// A point of the hinge's axis, metres; `None` for a slide.
    pub point: Option<DVec3>,
    /// Unit direction: opening turns right-handed about it, or slides along it.
    pub axis: DVec3,
}

impl FeltJoint {
    /// The joint in a frame, given the part's pose in the same parent as that frame.
    ///
    /// ```
    /// # use acm_concept::{ids::TransitionId, pose::Pose};
    /// # use acm_memory::FeltJoint;
    /// # use glam::DVec3;
    /// let hinge = FeltJoint { evidence: TransitionId(1), point: Some(DVec3::X), axis: DVec3::Z };
    /// let part = Pose::from_translation(DVec3::Y);
    /// assert_eq!(hinge.seen_from(&part, &Pose::IDENTITY).point, Some(DVec3::new(1.0, 1.0, 0.0)));
    /// ```
    pub fn seen_from(&self, part: &Pose, frame: &Pose) -> FeltJoint {
        let into = frame.inverse() * *part;
        FeltJoint {
            point: self.point.map(|point| into.transform_point(point)),
            axis: into.transform_vector(self.axis),
            ..*self
        }
    }
}

/// The newest joint that was felt of a part. What failed, or was contradicted by what was seen, tells nothing.
pub(crate) fn felt_joint(view: &(impl MemoryView + ?Sized), part: PartId) -> Option<FeltJoint> {
    let of_part = |transition: &&Transition| {
        transition.report.invocation.part == part
            && transition.report.failure.is_none()
            && !matches!(transition.result, TransitionResult::Failed { .. })
    };
    view.transitions().iter().rev().filter(of_part).find_map(told)
}

/// What one transition told.
fn told(transition: &Transition) -> Option<FeltJoint> {
    let measured = &transition.report.measured;
    let into = transition.report.invocation.target.pose.pose.inverse();
    let joint = |point: Option<DVec3>, axis: DVec3| {
        let axis = into.transform_vector(axis).try_normalize()?;
        Some(FeltJoint { evidence: transition.id, point: point.map(|point| into.transform_point(point)), axis })
    };
    match (vector(measured, "hinge_point_m"), vector(measured, "hinge_axis")) {
        (Some(point), Some(axis)) => joint(Some(point), axis),
        _ => joint(None, vector(measured, "slide_direction")?),
    }
}

/// `name_x`, `name_y`, `name_z`, if all are there and finite.
fn vector(measured: &BTreeMap<String, f64>, name: &str) -> Option<DVec3> {
    let component = |axis: &str| measured.get(&format!("{name}_{axis}")).copied().filter(|value| value.is_finite());
    Some(DVec3::new(component("x")?, component("y")?, component("z")?))
}
