//! Time along a way through joint space, within the limits of the joints and of the hand.

use crate::motion::{Pace, Trapezoid};
use acm_concept::arm::{ArmDescription, Joints};
use std::collections::VecDeque;

/// A share of the joints' limits is kept back: of speed for the tracking that follows, of acceleration for the corners.
const JOINT_SPEED: f64 = 0.9;
const JOINT_ACCELERATION: f64 = 0.5;
/// Pieces into which a straight part is cut to find how fast the hand moves along it.
const PIECES: u32 = 24;
/// Most ticks of one straight part.
const MAX_TICKS: f64 = 3000.0;

/// Joint positions at the end of each tick, at rest at every corner.
pub(crate) fn timed(arm: &ArmDescription, way: &[Joints], pace: &Pace, tick_s: f64) -> VecDeque<Joints> {
    let mut ticks = VecDeque::new();
    for (from, to) in way.iter().zip(way.iter().skip(1)) {
        let law = law(arm, from, to, pace);
        let count = (law.duration_s() / tick_s).ceil().clamp(1.0, MAX_TICKS);
        ticks.extend((1..=count as u32).map(|tick| from.lerp(to, law.fraction(f64::from(tick) / count))));
    }
    ticks
}

/// The fastest time law over the straight part, taken as of unit length, that keeps every limit.
fn law(arm: &ArmDescription, from: &Joints, to: &Joints, pace: &Pace) -> Trapezoid {
    // What the hand moves over the whole part if all of it were like its fastest piece.
    let (mut shift_m, mut turn_rad) = (1e-9, 1e-9);
    let mut before = arm.tcp(from);
    for piece in 1..=PIECES {
        let tcp = arm.tcp(&from.lerp(to, f64::from(piece) / f64::from(PIECES)));
        shift_m = (tcp.translation.distance(before.translation) * f64::from(PIECES)).max(shift_m);
        turn_rad = (tcp.angle_to(&before) * f64::from(PIECES)).max(turn_rad);
        before = tcp;
    }
    let mut speed = (pace.speed_m_s / shift_m).min(pace.turn_rad_s / turn_rad);
    let mut acceleration = (pace.acceleration_m_s2 / shift_m).min(pace.turn_acceleration_rad_s2 / turn_rad);
    for (joint, (from, to)) in arm.joints.iter().zip(from.iter().zip(to.iter())) {
        let way = (to - from).abs().max(1e-9);
        speed = speed.min(JOINT_SPEED * joint.max_speed_rad_s / way);
        acceleration = acceleration.min(JOINT_ACCELERATION * joint.max_acceleration_rad_s2 / way);
    }
    Trapezoid::fastest(speed, acceleration)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::{kinematics::random, scene::tests::panda};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn no_joint_and_no_hand_goes_beyond_its_limits() {
        let (arm, tick_s) = (panda(), 0.02);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let pace = Pace { speed_m_s: 0.45, acceleration_m_s2: 2.5, turn_rad_s: 2.7, turn_acceleration_rad_s2: 15.0 };
        for _ in 0..20 {
            let way: Vec<Joints> = (0..4).map(|_| random(&arm, &mut rng)).collect();
            let ticks = timed(&arm, &way, &pace, tick_s);
            assert_eq!(ticks.back(), way.last());
            let (mut at, mut steps) = (way[0], [0.0; 7]);
            for next in ticks {
                let (shift, turn) = {
                    let (a, b) = (arm.tcp(&at), arm.tcp(&next));
                    (a.translation.distance(b.translation), a.angle_to(&b))
                };
                assert!(shift <= 1.05 * pace.speed_m_s * tick_s && turn <= 1.05 * pace.turn_rad_s * tick_s);
                for (i, joint) in arm.joints.iter().enumerate() {
                    let step = next[i] - at[i];
                    assert!(step.abs() <= joint.max_speed_rad_s * tick_s, "{} {step}", joint.name);
                    // At a corner one part ends and another begins; each alone keeps half the limit.
                    let change = (step - steps[i]) / (tick_s * tick_s);
                    assert!(change.abs() <= 1.01 * joint.max_acceleration_rad_s2, "{} {change}", joint.name);
                    steps[i] = step;
                }
                at = next;
            }
        }
    }
}
