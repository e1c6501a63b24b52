//! A step bound to perceived geometry, ready for a controller.

use crate::{
    decision::Step,
    ground::geometry::{Extent, solids_at},
};
use acm_concept::{
    embodiment::RobotDescription,
    expression::ExpressionError,
    ids::{ObjectId, PartId},
    object::GroundedPart,
    pose::Pose,
    skill::SkillInvocation,
    solid::PlacedSolid,
};
use acm_memory::{FeltJoint, MemoryView, entry::Presence};
use glam::DVec3;
use std::collections::BTreeMap;
use thiserror::Error;

/// Why a step could not be bound.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum BindError {
    /// Memory no longer knows the part.
    #[error("cannot bind {skill}: memory knows no part {part}; decide again")]
    UnknownPart {
        /// The skill.
        skill: String,
        /// The part.
        part: PartId,
    },
    /// The library has no such template or function.
    #[error("cannot bind {skill} on {part}: template `{template}` has no function `{skill}`")]
    UnknownFunction {
        /// The skill.
        skill: String,
        /// The part.
        part: PartId,
        /// The part's template.
        template: String,
    },
    /// The function acts at a frame that the template does not have.
    #[error("cannot bind {skill} on {part}: template `{template}` has no frame `{frame}`")]
    UnknownFrame {
        /// The skill.
        skill: String,
        /// The part.
        part: PartId,
        /// The part's template.
        template: String,
        /// The frame.
        frame: String,
    },
    /// An expression of the template has no value at the part's parameters.
    #[error("cannot bind {skill} on {part}: {source}")]
    Expression {
        /// The skill.
        skill: String,
        /// The part.
        part: PartId,
        /// What is wrong.
        source: ExpressionError,
    },
    /// The skill would have to act outside the robot's workspace.
    #[error("cannot bind {skill} on {part}: ({x_m:.3}, {y_m:.3}) m is outside the workspace of {robot}")]
    OutOfReach {
        /// The skill.
        skill: String,
        /// The part.
        part: PartId,
        /// The robot's name.
        robot: String,
        /// World x of the spot, metres.
        x_m: f64,
        /// World y of the spot, metres.
        y_m: f64,
    },
}

/// Evaluates function frame and arguments at the part's parameters and gathers what the controller must know of
/// the surroundings: everything as perceived.
pub(crate) fn bind(step: &Step, view: &dyn MemoryView, robot: &RobotDescription) -> Result<SkillInvocation, BindError> {
    let candidate = &step.candidate;
    let (skill, part_id) = (candidate.skill.clone(), candidate.part);
    let unknown = || BindError::UnknownPart { skill: skill.clone(), part: part_id };
    let entry = view.object(part_id.object).ok_or_else(unknown)?;
    let part = entry.parts.get(part_id.index as usize).ok_or_else(unknown)?;
    let (frame, mut arguments) = evaluate(&skill, part_id, part, view)?;
    if let Some(felt) = view.felt_joint(part_id) {
        know_joint(&candidate.kind, &felt.seen_from(&part.pose.pose, &frame), &mut arguments);
    }
    check_reach(step, part, &frame, robot)?;
    let support_height_m = match &candidate.destination {
        Some(place) => surface_height(view, place.support, place.pose.translation),
        None => surface_height(view, entry.support, part.pose.pose.translation),
    };
    Ok(SkillInvocation {
        skill,
        entry: candidate.entry,
        kind: candidate.kind.clone(),
        part: part_id,
        target: part.clone(),
        frame,
        arguments,
        destination: candidate.destination,
        obstacles: obstacles(view),
        support_height_m,
        held: held(view),
        held_solids: view.held().map_or_else(Vec::new, |entry| solids_at(view, entry, &Pose::IDENTITY)),
        attempt: step.attempt,
    })
}

fn evaluate(
    skill: &str,
    part_id: PartId,
    part: &GroundedPart,
    view: &dyn MemoryView,
) -> Result<(Pose, BTreeMap<String, f64>), BindError> {
    let expression = |source| BindError::Expression { skill: skill.into(), part: part_id, source };
    let template = view.library().get(&part.template);
    let (template, function) = template.and_then(|t| Some((t, t.function(skill)?))).ok_or_else(|| {
        BindError::UnknownFunction { skill: skill.into(), part: part_id, template: part.template.clone() }
    })?;
    let values = part.values();
    let local =
        template.frame(&function.frame, &values).map_err(expression)?.ok_or_else(|| BindError::UnknownFrame {
            skill: skill.into(),
            part: part_id,
            template: part.template.clone(),
            frame: function.frame.clone(),
        })?;
    let mut arguments = BTreeMap::new();
    for (name, value) in &function.arguments {
        arguments.insert(name.clone(), value.evaluate(&values).map_err(expression)?);
    }
    Ok((part.pose.pose * local, arguments))
}

/// A joint that was felt once is better known than what the template makes of what was seen: it takes the place of the
/// `hinge_*` and `axis_*` of the kinds that follow a joint. `felt` is in the function's frame.
fn know_joint(kind: &str, felt: &FeltJoint, arguments: &mut BTreeMap<String, f64>) {
    let mut vector = |name: &str, value: DVec3| {
        for (axis, value) in ["x", "y", "z"].into_iter().zip(value.to_array()) {
            arguments.insert(format!("{name}_{axis}"), value);
        }
    };
    match felt.point {
        Some(point) if kind.starts_with("hinge-") => {
            vector("hinge", point);
            vector("axis", felt.axis);
        }
        None if kind.starts_with("slide-") => vector("axis", felt.axis),
        _ => {}
    }
}

/// Only the spot seen from above is checked: how high the hand must go is the controller's business.
fn check_reach(step: &Step, part: &GroundedPart, frame: &Pose, robot: &RobotDescription) -> Result<(), BindError> {
    let spot = step.candidate.destination.map_or(frame.translation, |place| place.pose.translation);
    let held_in_hand = step.candidate.destination.is_some();
    let middle_z = 0.5 * (robot.workspace_min.z + robot.workspace_max.z);
    let reach = |point: DVec3| robot.reaches(DVec3::new(point.x, point.y, middle_z));
    if reach(spot) && (held_in_hand || reach(part.pose.pose.translation)) {
        return Ok(());
    }
    Err(BindError::OutOfReach {
        skill: step.candidate.skill.clone(),
        part: step.candidate.part,
        robot: robot.name.clone(),
        x_m: spot.x,
        y_m: spot.y,
    })
}

/// Perceived height of what carries the spot: the top of the carrying object, or the support plane.
fn surface_height(view: &dyn MemoryView, support: Option<ObjectId>, spot: DVec3) -> f64 {
    let carrier = support.and_then(|id| view.object(id)).and_then(|entry| Extent::now(view, entry));
    match (carrier, view.support()) {
        (Some(extent), _) => extent.high,
        (None, Some(plane)) => plane.height_at(spot.x, spot.y),
        (None, None) => spot.z,
    }
}

fn obstacles(view: &dyn MemoryView) -> Vec<(ObjectId, PlacedSolid)> {
    let mut obstacles = Vec::new();
    for entry in view.objects().iter().filter(|e| e.presence == Presence::Present) {
        let Some(pose) = entry.pose() else { continue };
        obstacles.extend(solids_at(view, entry, &pose).into_iter().map(|solid| (entry.id, solid)));
    }
    obstacles
}

/// What is held and how it sits in the hand, from the report of the grasp that took it.
fn held(view: &dyn MemoryView) -> Option<(ObjectId, Pose, GroundedPart)> {
    let entry = view.held()?;
    let part = entry.parts.first()?.clone();
    let reports = view.transitions().iter().rev().filter_map(|transition| transition.report.held);
    let (_, pose) = reports.into_iter().find(|(object, _)| *object == entry.id)?;
    Some((entry.id, pose, part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::ids::TransitionId;

    #[test]
    fn a_felt_joint_takes_the_place_of_the_templates() {
        let felt =
            FeltJoint { evidence: TransitionId(1), point: Some(DVec3::new(0.3, 0.0, -0.04)), axis: DVec3::NEG_Y };
        let template = || BTreeMap::from([("angle".to_string(), 1.2), ("hinge_x".to_string(), 0.25)]);
        let mut arguments = template();
        know_joint("hinge-open", &felt, &mut arguments);
        assert_eq!((arguments["hinge_x"], arguments["hinge_z"], arguments["axis_y"]), (0.3, -0.04, -1.0));
        assert_eq!(arguments["angle"], 1.2);
        // A hinge tells a slide nothing, nor a press.
        for kind in ["slide-open", "press"] {
            let mut arguments = template();
            know_joint(kind, &felt, &mut arguments);
            assert_eq!(arguments, template());
        }
    }
}
