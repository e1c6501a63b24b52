//! Which of several arms takes a skill.

use super::kinematics::solutions;
use crate::{clearance::GUARD_M, geometry::downward, hand::holds_something};
use acm_concept::{
    arm::Joints,
    embodiment::{Feedback, RobotDescription},
    skill::SkillInvocation,
};
use glam::DVec3;

/// Starts from which an arm's reach is tried.
const TRIES: usize = 6;

/// The arm that holds something where something is to be in the hand; else the one that reaches the part, and of those
/// the one that stands nearest to it.
pub(crate) fn choose(invocation: &SkillInvocation, robot: &RobotDescription, feedback: &Feedback) -> usize {
    let arms = 0..robot.arms();
    if arms.len() < 2 {
        return 0;
    }
    if invocation.held.is_some() {
        let holds = |arm: &usize| feedback.of_arm(*arm).is_some_and(holds_something);
        return arms.clone().find(holds).unwrap_or(feedback.arm);
    }
    let spot = invocation.frame.translation;
    let cost = |arm: &usize| -> f64 {
        let one = robot.only(*arm);
        let Some(links) = &one.arm else { return if one.reaches(spot) { 0.0 } else { f64::INFINITY } };
        let above = downward(spot + (GUARD_M + 0.02) * DVec3::Z, invocation.frame.yaw());
        let joints = feedback.of_arm(*arm).and_then(|felt| Joints::new(&felt.joints)).unwrap_or(links.home);
        let reached = !solutions(links, &above, &joints, 1, TRIES).is_empty();
        links.base.translation.distance(spot) + if reached { 0.0 } else { 10.0 }
    };
    arms.min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(0)
}
