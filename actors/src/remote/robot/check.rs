//! What a host tells of itself is checked before anything is built on it.

use super::super::protocol::{VERSION, Welcome};
use acm_concept::{
    arm::{ArmDescription, MAX_JOINTS},
    camera::MAX_PIXELS,
    embodiment::{Feedback, RobotDescription},
};

/// Most cameras, arms, solids of a hand, parts of an arm, and bytes of an instruction that a host may name.
const MAX_CAMERAS: usize = 16;
const MAX_ARMS: usize = 4;
const MAX_SOLIDS: usize = 256;
const MAX_PARTS: usize = 64;
const MAX_INSTRUCTION_BYTES: usize = 16 * 1024;

/// What a host tells of itself is bounded and possible.
pub fn check(welcome: &Welcome) -> Result<(), String> {
    if welcome.protocol != VERSION {
        return Err(format!("it speaks version {}, this agent version {VERSION}", welcome.protocol));
    }
    let (task, robot) = (&welcome.task, &welcome.robot);
    if task.cameras.is_empty() || task.cameras.len() > MAX_CAMERAS {
        return Err(format!("it has {} cameras, 1 to {MAX_CAMERAS} are possible", task.cameras.len()));
    }
    for camera in &task.cameras {
        let seen = &camera.intrinsics;
        let possible = (1..=MAX_PIXELS).contains(&seen.pixels()) && seen.fx > 0.0 && seen.fy > 0.0;
        if !possible || ![seen.fx, seen.fy, seen.cx, seen.cy].iter().all(|value| value.is_finite()) {
            return Err(format!("the intrinsics of its camera `{}` are not possible: {seen:?}", camera.name));
        }
        if !camera.pose.is_valid() {
            return Err(format!("the pose of its camera `{}` is none: rotations are unit quaternions", camera.name));
        }
    }
    if robot.arms() > MAX_ARMS || robot.others.iter().any(|other| !other.others.is_empty()) {
        return Err(format!("more than {MAX_ARMS} arms, or arms within arms"));
    }
    for arm in 0..robot.arms() {
        robot.of_arm(arm).map_or(Ok(()), hand)?;
        measured(robot, &welcome.feedback, arm)?;
    }
    if task.instruction.len() > MAX_INSTRUCTION_BYTES {
        return Err(format!("more than {MAX_INSTRUCTION_BYTES} bytes of instruction"));
    }
    let seconds = [task.instruction_at_s, task.budgets.seconds];
    if !seconds.iter().all(|value| value.is_finite() && *value >= 0.0) {
        return Err("the moment of the instruction and the budget must be finite and not negative".into());
    }
    Ok(())
}

/// One hand with its arm.
fn hand(robot: &RobotDescription) -> Result<(), String> {
    let speeds = [robot.max_speed_m_s, robot.max_turn_rad_s, robot.tick_s];
    let grip = [robot.max_opening_m, robot.max_grip_force_n];
    let cup = robot.suction.map_or([1.0; 3], |cup| [cup.radius_m, cup.max_force_n, cup.max_tilt_rad]);
    let positive = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite() && *number > 0.0);
    // A cup has no fingers that could open.
    let grips = if robot.suction.is_some() { grip.iter().all(|number| number.is_finite()) } else { positive(&grip) };
    if !(positive(&speeds) && positive(&cup) && grips && robot.home.is_valid()) {
        return Err("the robot's opening, force, speeds, tick and home must be positive and finite".into());
    }
    if robot.hand.len() + robot.finger.len() > MAX_SOLIDS {
        return Err(format!("more than {MAX_SOLIDS} solids of a hand"));
    }
    robot.arm.as_ref().map_or(Ok(()), arm)
}

fn arm(arm: &ArmDescription) -> Result<(), String> {
    let joints = arm.joints.len();
    if joints == 0 || joints > MAX_JOINTS || arm.home.len() != joints {
        let home = arm.home.len();
        return Err(format!("an arm of {joints} joints with {home} home positions; 1 to {MAX_JOINTS} are possible"));
    }
    if arm.capsules.len() + arm.hand.len() > MAX_PARTS {
        return Err(format!("more than {MAX_PARTS} parts of an arm"));
    }
    for joint in &arm.joints {
        let limits = [joint.max_speed_rad_s, joint.max_acceleration_rad_s2, joint.max_torque_nm];
        let possible = limits.iter().all(|limit| limit.is_finite() && *limit > 0.0)
            && joint.min_rad.is_finite()
            && joint.max_rad.is_finite()
            && joint.min_rad < joint.max_rad;
        if !(possible && joint.frame.is_valid() && joint.axis.is_normalized()) {
            return Err(format!("the frame, axis or limits of its joint `{}` are not possible", joint.name));
        }
    }
    let finite = arm
        .parts()
        .all(|part| part.link <= joints && part.from.is_finite() && part.to.is_finite() && part.radius_m.is_finite());
    match arm.limit_broken(&arm.home, 1e-6) {
        Some(reason) => Err(format!("an arm's home is beyond its limits: {reason}")),
        None if finite && arm.base.is_valid() && arm.tool.is_valid() => Ok(()),
        None => Err("the base, tool or parts of an arm are not possible".into()),
    }
}

/// Every arm must be measured, with as many joints as it has.
fn measured(robot: &RobotDescription, feedback: &Feedback, arm: usize) -> Result<(), String> {
    let joints = robot.of_arm(arm).and_then(|robot| robot.arm.as_ref()).map(|arm| arm.joints.len());
    let felt = feedback.of_arm(arm).map(|felt| felt.joints.len());
    match (joints, felt) {
        (_, None) => Err(format!("its feedback says nothing of arm {arm}")),
        (Some(joints), Some(felt)) if joints != felt => {
            Err(format!("its feedback has {felt} joints for the {joints} of arm {arm}"))
        }
        _ => Ok(()),
    }
}
