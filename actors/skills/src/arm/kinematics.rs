//! Inverse kinematics by damped least squares: joint limits, the redundancy spent on staying off them, restarts.

use acm_concept::{
    arm::{ArmDescription, Joints, MAX_JOINTS},
    pose::Pose,
};
use glam::DVec3;
use nalgebra::{SMatrix, SVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A solution puts the TCP this near to its goal: metres, radians.
pub(crate) const EXACT: (f64, f64) = (1e-4, 1e-3);
/// Steps of one descent from one start.
const STEPS: usize = 100;
/// Steps of following a goal that has moved by a tick.
const TRACKING_STEPS: usize = 8;
/// Largest step of a joint, radians.
const LARGEST_STEP: f64 = 0.4;
/// Damping: a floor, and what is added with the squared error.
const DAMPING: [f64; 2] = [1e-3, 0.02];
/// The share of the way to mid-range that the free motion of the joints takes in a step, and in how many steps it does:
/// damping lets a little of it through to the hand, so the last steps go without.
const CENTRING: f64 = 0.05;
const CENTRED_STEPS: usize = 30;

type Jacobian = SMatrix<f64, 6, MAX_JOINTS>;

/// The motion of the TCP, shift above turn, for a unit speed of each joint; columns of joints that are missing are 0.
fn jacobian(arm: &ArmDescription, joints: &Joints) -> (Pose, Jacobian) {
    let frames = arm.frames(joints);
    let [.., last] = frames;
    let tcp = last * arm.tool;
    let mut columns = Jacobian::zeros();
    for (index, (joint, frame)) in arm.joints.iter().zip(frames.iter().skip(1)).enumerate() {
        let axis = frame.transform_vector(joint.axis);
        let shift = axis.cross(tcp.translation - frame.translation);
        columns.set_column(index, &twist(shift, axis));
    }
    (tcp, columns)
}

fn twist(shift: DVec3, turn: DVec3) -> SVector<f64, 6> {
    SVector::from([shift.x, shift.y, shift.z, turn.x, turn.y, turn.z])
}

/// What is left to a goal: shift and turn.
fn error(tcp: &Pose, goal: &Pose) -> (DVec3, DVec3) {
    (goal.translation - tcp.translation, (goal.rotation * tcp.rotation.inverse()).to_scaled_axis())
}

/// How near `joints` put the TCP to a goal, as a share of what counts as exact: at most 1 is exact.
pub(crate) fn miss(arm: &ArmDescription, joints: &Joints, goal: &Pose) -> f64 {
    let tcp = arm.tcp(joints);
    (tcp.translation.distance(goal.translation) / EXACT.0).max(tcp.angle_to(goal) / EXACT.1)
}

/// One descent from one start; the joints where it ended and whether that is at the goal.
fn descend(arm: &ArmDescription, goal: &Pose, seed: &Joints, steps: usize, centring: f64) -> (Joints, bool) {
    let mut joints = *seed;
    for step in 0..steps {
        let (tcp, jacobian) = jacobian(arm, &joints);
        let (shift, turn) = error(&tcp, goal);
        // Twice as near as needed, so that rounding on the way does not matter.
        if shift.length() < 0.5 * EXACT.0 && turn.length() < 0.5 * EXACT.1 {
            return (joints, true);
        }
        let left = twist(shift, turn);
        let damping = DAMPING[0] + DAMPING[1] * left.norm_squared().min(1.0);
        let squared = jacobian * jacobian.transpose() + SMatrix::<f64, 6, 6>::identity() * damping;
        let Some(factor) = squared.cholesky() else { break };
        let mut change: SVector<f64, MAX_JOINTS> = jacobian.transpose() * factor.solve(&left);
        if centring > 0.0 && step < CENTRED_STEPS {
            let mut wish = SVector::<f64, MAX_JOINTS>::zeros();
            for (index, (joint, at)) in arm.joints.iter().zip(joints.iter()).enumerate() {
                wish[index] = centring * (0.5 * (joint.min_rad + joint.max_rad) - at);
            }
            change += wish - jacobian.transpose() * factor.solve(&(jacobian * wish));
        }
        let scale = (LARGEST_STEP / change.amax().max(1e-12)).min(1.0);
        joints = joints.map(|i| {
            let joint = &arm.joints[i];
            (joints[i] + scale * change[i]).clamp(joint.min_rad, joint.max_rad)
        });
    }
    (joints, miss(arm, &joints, goal) <= 1.0)
}

/// The joints that take the TCP on from where `last` puts it to a goal near by, without a jump; where they can not, as
/// near as they come, and `false`.
pub(crate) fn track(arm: &ArmDescription, goal: &Pose, last: &Joints) -> (Joints, bool) {
    descend(arm, goal, last, TRACKING_STEPS, 0.0)
}

/// Solutions for a goal: from the seed, from the arm's home, and from random starts until `wanted` are found or `tries`
/// are used up. The same one is not given twice. At most `wanted`, in the order found.
pub(crate) fn solutions(arm: &ArmDescription, goal: &Pose, seed: &Joints, wanted: usize, tries: usize) -> Vec<Joints> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut found: Vec<Joints> = Vec::new();
    if !arm.may_reach(goal.translation) {
        return found;
    }
    for trial in 0..tries {
        let start = match trial {
            0 => *seed,
            1 => arm.home,
            _ => random(arm, &mut rng),
        };
        // Goals near the joints' limits are found by those that are not drawn to the middle.
        let centring = if trial % 2 == 0 { CENTRING } else { 0.0 };
        let (joints, there) = descend(arm, goal, &start, STEPS, centring);
        if there && found.iter().all(|known| known.farthest(&joints) > 0.2) {
            found.push(joints);
            if found.len() >= wanted {
                break;
            }
        }
    }
    found
}

/// A configuration anywhere within the limits.
pub(crate) fn random(arm: &ArmDescription, rng: &mut ChaCha8Rng) -> Joints {
    arm.home.map(|i| arm.joints.get(i).map_or(0.0, |joint| rng.random_range(joint.min_rad..joint.max_rad)))
}

/// The smallest distance of a joint to one of its limits, radians.
pub(crate) fn margin_rad(arm: &ArmDescription, joints: &Joints) -> f64 {
    let margin =
        |(joint, at): (&acm_concept::arm::JointDescription, &f64)| (at - joint.min_rad).min(joint.max_rad - at);
    arm.joints.iter().zip(joints.iter()).map(margin).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::scene::tests::panda;

    #[test]
    fn the_jacobian_is_the_derivative_of_the_forward_kinematics() {
        let arm = panda();
        let (tcp, columns) = jacobian(&arm, &arm.home);
        for joint in 0..7 {
            let nudged = arm.tcp(&arm.home.map(|i| arm.home[i] + if i == joint { 1e-6 } else { 0.0 }));
            let (shift, turn) = error(&tcp, &nudged);
            let difference = (twist(shift, turn) / 1e-6 - columns.column(joint)).amax();
            assert!(difference < 1e-5, "joint {joint}: {difference}");
        }
    }

    #[test]
    fn nearly_every_reachable_goal_is_solved_within_the_limits() {
        let arm = panda();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (goals, mut solved, mut at_once) = (1000, 0, 0);
        for _ in 0..goals {
            let goal = arm.tcp(&random(&arm, &mut rng));
            at_once += usize::from(!solutions(&arm, &goal, &arm.home, 1, 1).is_empty());
            let Some(joints) = solutions(&arm, &goal, &arm.home, 1, 32).pop() else { continue };
            assert!(miss(&arm, &joints, &goal) <= 1.0 && arm.limit_broken(&joints, 0.0).is_none());
            solved += 1;
        }
        println!("{solved} of {goals} goals solved, {at_once} without a restart");
        assert!(solved >= goals * 995 / 1000, "{solved} of {goals}");
    }

    #[test]
    fn what_is_out_of_reach_has_no_solution() {
        let arm = panda();
        let far = Pose::from_translation(arm.base.translation + DVec3::new(0.0, 0.0, 1.3));
        assert!(solutions(&arm, &far, &arm.home, 1, 24).is_empty());
        let (_, there) = track(&arm, &far, &arm.home);
        assert!(!there);
    }

    #[test]
    fn a_moving_goal_is_followed_without_a_jump() {
        let arm = panda();
        let (mut joints, start) = (arm.home, arm.tcp(&arm.home));
        for tick in 1..=100 {
            let goal = Pose { translation: start.translation - 0.002 * f64::from(tick) * DVec3::Z, ..start };
            let (next, there) = track(&arm, &goal, &joints);
            assert!(there && next.farthest(&joints) < 0.02, "tick {tick}");
            joints = next;
        }
    }
}
