//! What a host tells of itself is checked before anything is built on it.

use super::super::protocol::{VERSION, Welcome};
use acm_concept::camera::MAX_PIXELS;

/// Most cameras, solids of the hand, and bytes of an instruction that a host may name.
const MAX_CAMERAS: usize = 16;
const MAX_SOLIDS: usize = 256;
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
    let numbers =
        [robot.max_opening_m, robot.max_grip_force_n, robot.max_speed_m_s, robot.max_turn_rad_s, robot.tick_s];
    if !numbers.iter().all(|number| number.is_finite() && *number > 0.0) || !robot.home.is_valid() {
        return Err("the robot's opening, force, speeds, tick and home must be positive and finite".into());
    }
    let solids = robot.hand.len() + robot.finger.len();
    if solids > MAX_SOLIDS || task.instruction.len() > MAX_INSTRUCTION_BYTES {
        return Err(format!("more than {MAX_SOLIDS} solids or {MAX_INSTRUCTION_BYTES} bytes of instruction"));
    }
    let seconds = [task.instruction_at_s, task.budgets.seconds];
    if !seconds.iter().all(|value| value.is_finite() && *value >= 0.0) {
        return Err("the moment of the instruction and the budget must be finite and not negative".into());
    }
    Ok(())
}
