//! What a robot refuses before anything moves.

use super::{Aim, Limb};
use acm_concept::embodiment::{Command, RobotDescription};

/// Commands may exceed the speed limits by this factor, which absorbs rounding.
const TOLERANCE: f64 = 1.0 + 1e-6;
/// Joints may exceed their limits by this, which absorbs rounding, radians.
const JOINT_TOLERANCE: f64 = 1e-9;
/// How far a commanded TCP may be from where the commanded joints put it: metres, radians.
const AGREEMENT: (f64, f64) = (0.001, 0.005);
/// Links of one arm must not come nearer to each other than this, nor those of two arms, metres.
const OWN_MARGIN_M: f64 = 0.0;
const OTHER_MARGIN_M: f64 = 0.01;

/// The aim of a command for a limb, or why it is refused.
pub(super) fn aim(limb: &Limb, others: &[&Limb], command: &Command) -> Result<Aim, String> {
    let robot = &limb.robot;
    if !(command.tcp.is_valid() && command.opening_m.is_finite() && command.grip_force_n.is_finite()) {
        return Err("it holds numbers that are not finite, or a rotation that is not one".into());
    }
    let aim = match (&robot.arm, command.joints) {
        (None, None) => Aim { tcp: command.tcp, joints: None },
        (None, Some(_)) => return Err("it has joint positions, and this robot has no joints".into()),
        (Some(_), None) => return Err("it has no joint positions, and this robot is moved by its joints".into()),
        (Some(arm), Some(joints)) => {
            if let Some(reason) = arm.limit_broken(&joints, JOINT_TOLERANCE) {
                return Err(reason);
            }
            let tcp = arm.tcp(&joints);
            let (shift, turn) = (tcp.translation.distance(command.tcp.translation), tcp.angle_to(&command.tcp));
            if shift > AGREEMENT.0 || turn > AGREEMENT.1 {
                return Err(format!(
                    "its joints put the hand {:.1} mm and {turn:.3} rad from where its TCP pose has it",
                    1e3 * shift
                ));
            }
            Aim { tcp, joints: Some(joints) }
        }
    };
    speed(limb, &aim)?;
    // An arm's own wrist may have been pressed a hair out of the box; what counts is where it is sent.
    if !inside(robot, &aim) {
        let (low, high) = (robot.workspace_min, robot.workspace_max);
        return Err(format!("{} lies outside of the workspace {low} to {high} m", aim.tcp.translation));
    }
    if !(0.0..=robot.max_opening_m * TOLERANCE).contains(&command.opening_m) {
        return Err(format!("an opening of {} m is not in 0 to {} m", command.opening_m, robot.max_opening_m));
    }
    if !(0.0..=robot.max_grip_force_n * TOLERANCE).contains(&command.grip_force_n) {
        return Err(format!("a force of {} N is not in 0 to {} N", command.grip_force_n, robot.max_grip_force_n));
    }
    if command.vacuum && robot.suction.is_none() {
        return Err("it switches a vacuum on, and this hand has no suction cup".into());
    }
    collision(limb, others, &aim).map_or(Ok(aim), Err)
}

fn inside(robot: &RobotDescription, aim: &Aim) -> bool {
    let (at, slack) = (aim.tcp.translation, glam::DVec3::splat(1e-9));
    at.cmpge(robot.workspace_min - slack).all() && at.cmple(robot.workspace_max + slack).all()
}

fn speed(limb: &Limb, aim: &Aim) -> Result<(), String> {
    let (robot, from) = (&limb.robot, &limb.to);
    let shift = aim.tcp.translation.distance(from.tcp.translation) / robot.tick_s;
    if shift > robot.max_speed_m_s * TOLERANCE {
        return Err(format!("it asks for {shift:.3} m/s, the fastest is {} m/s", robot.max_speed_m_s));
    }
    let turn = aim.tcp.angle_to(&from.tcp) / robot.tick_s;
    // The angle between nearly equal rotations is only known to about 1e-7.
    if turn > robot.max_turn_rad_s * TOLERANCE + 1e-4 {
        return Err(format!("it asks for {turn:.3} rad/s, the fastest is {} rad/s", robot.max_turn_rad_s));
    }
    let (Some(arm), Some(to), Some(from)) = (&robot.arm, aim.joints, from.joints) else { return Ok(()) };
    for ((joint, to), from) in arm.joints.iter().zip(to.iter()).zip(from.iter()) {
        let speed = (to - from).abs() / robot.tick_s;
        if speed > joint.max_speed_rad_s * TOLERANCE {
            let (name, most) = (&joint.name, joint.max_speed_rad_s);
            return Err(format!("it asks {name} for {speed:.3} rad/s, its fastest is {most} rad/s"));
        }
    }
    Ok(())
}

/// Parts of the robot that would touch each other, in a sentence.
fn collision(limb: &Limb, others: &[&Limb], aim: &Aim) -> Option<String> {
    let (arm, joints) = (limb.robot.arm.as_ref()?, aim.joints?);
    let frames = arm.frames(&joints);
    arm.self_collision(&frames, OWN_MARGIN_M).or_else(|| {
        others.iter().find_map(|other| {
            let (arm_there, joints_there) = (other.robot.arm.as_ref()?, other.to.joints?);
            arm.collision_with(&frames, arm_there, &arm_there.frames(&joints_there), OTHER_MARGIN_M)
        })
    })
}
