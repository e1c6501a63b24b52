//! Straight motions of the TCP under limits of speed and acceleration, at rest at every waypoint.

use acm_concept::{embodiment::RobotDescription, pose::Pose};
use glam::DVec3;
use std::collections::VecDeque;

/// Most ticks of one leg: a limit against descriptions with absurdly low speeds.
const MAX_LEG_TICKS: f64 = 3000.0;
/// Legs shorter than this are left out, metres and radians.
const NEGLIGIBLE: f64 = 1e-5;

/// How fast a motion may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pace {
    pub speed_m_s: f64,
    pub acceleration_m_s2: f64,
    pub turn_rad_s: f64,
    pub turn_acceleration_rad_s2: f64,
}

impl Pace {
    /// For an empty hand in free space. A tenth of the robot's speed is kept back for its own lag.
    pub fn free(robot: &RobotDescription) -> Pace {
        Pace {
            speed_m_s: 0.9 * robot.max_speed_m_s,
            acceleration_m_s2: 2.5,
            turn_rad_s: 0.9 * robot.max_turn_rad_s,
            turn_acceleration_rad_s2: 15.0,
        }
    }
    /// With something in the hand: slower, so that the grip need not bear more than a fraction of its weight.
    pub fn carrying(robot: &RobotDescription) -> Pace {
        let free = Pace::free(robot);
        Pace {
            speed_m_s: 0.8 * free.speed_m_s,
            acceleration_m_s2: 1.5,
            turn_rad_s: 0.6 * free.turn_rad_s,
            turn_acceleration_rad_s2: 6.0,
        }
    }
    /// For the first centimetres after closing or opening the fingers.
    pub fn gentle(robot: &RobotDescription) -> Pace {
        let free = Pace::free(robot);
        Pace { speed_m_s: free.speed_m_s.min(0.12), acceleration_m_s2: 0.8, ..free }
    }
}

/// The time law of a leg over its unit length: even acceleration, even speed, even deceleration.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Trapezoid {
    speed: f64,
    ramp_s: f64,
    duration_s: f64,
}

impl Trapezoid {
    /// The fastest that keeps all four limits of a pace.
    fn new(pace: &Pace, distance_m: f64, angle_rad: f64) -> Trapezoid {
        let fastest = |shift: f64, turn: f64| (shift / distance_m.max(1e-12)).min(turn / angle_rad.max(1e-12));
        let acceleration = fastest(pace.acceleration_m_s2, pace.turn_acceleration_rad_s2);
        Trapezoid::fastest(fastest(pace.speed_m_s, pace.turn_rad_s), acceleration)
    }
    /// The fastest within these bounds, in unit lengths per second and per second squared.
    pub fn fastest(speed: f64, acceleration: f64) -> Trapezoid {
        let speed = speed.min(acceleration.sqrt());
        let ramp_s = speed / acceleration;
        Trapezoid { speed, ramp_s, duration_s: 1.0 / speed + ramp_s }
    }
    /// How long the leg takes, seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }
    /// The share of the leg that is behind after a share of its duration.
    pub fn fraction(&self, share: f64) -> f64 {
        let (gone_s, left_s) = (share * self.duration_s, (1.0 - share) * self.duration_s);
        if gone_s < self.ramp_s {
            0.5 * self.speed * gone_s * gone_s / self.ramp_s
        } else if left_s < self.ramp_s {
            1.0 - 0.5 * self.speed * left_s * left_s / self.ramp_s
        } else {
            self.speed * (gone_s - 0.5 * self.ramp_s)
        }
    }
}

#[derive(Debug, Clone)]
struct Leg {
    from: Pose,
    to: Pose,
    law: Trapezoid,
    ticks: u32,
}

/// Straight legs one after the other, at rest at every waypoint.
#[derive(Debug, Clone)]
pub(crate) struct Path {
    legs: VecDeque<Leg>,
    done_ticks: u32,
    end: Pose,
    duration_s: f64,
    pace: Pace,
    tick_s: f64,
    /// Whether any way will do that keeps clear of things; a straight one must be kept.
    travels: bool,
    begun: bool,
}

impl Path {
    /// From a pose through waypoints.
    pub fn through(from: Pose, waypoints: &[Pose], pace: Pace, tick_s: f64) -> Path {
        let (mut at, mut legs, mut ticks_in_all) = (from, VecDeque::new(), 0);
        for &to in waypoints {
            let (distance_m, angle_rad) = (at.translation.distance(to.translation), at.angle_to(&to));
            if distance_m < NEGLIGIBLE && angle_rad < NEGLIGIBLE {
                continue;
            }
            let law = Trapezoid::new(&pace, distance_m, angle_rad);
            // Rounded up to whole ticks; the law is stretched over them.
            let ticks = (law.duration_s / tick_s).ceil().clamp(1.0, MAX_LEG_TICKS) as u32;
            legs.push_back(Leg { from: at, to, law, ticks });
            ticks_in_all += ticks;
            at = to;
        }
        let duration_s = f64::from(ticks_in_all) * tick_s;
        Path { legs, done_ticks: 0, end: at, duration_s, pace, tick_s, travels: false, begun: false }
    }
    /// Up to `height_m`, level to above the goal, and straight down to it. A start above that height is left on a
    /// slant that stays above it.
    pub fn over(from: Pose, goal: Pose, height_m: f64, pace: Pace, tick_s: f64) -> Path {
        let height_m = height_m.max(goal.translation.z);
        let up = from.translation.with_z(from.translation.z.max(height_m));
        let across = goal.translation.with_z(height_m);
        let path =
            Path::through(from, &[Pose::new(up, from.rotation), Pose::new(across, goal.rotation), goal], pace, tick_s);
        Path { travels: true, ..path }
    }
    /// The same where any way to its end will do that keeps clear of things.
    pub fn freely(self) -> Path {
        Path { travels: true, ..self }
    }
    /// Straight up or down to a height.
    pub fn vertical(from: Pose, height_m: f64, pace: Pace, tick_s: f64) -> Path {
        let to = Pose::new(DVec3::new(from.translation.x, from.translation.y, height_m), from.rotation);
        Path::through(from, &[to], pace, tick_s)
    }
    /// The pose at the end of the next tick, or `None` when the path is done.
    pub fn advance(&mut self) -> Option<Pose> {
        self.begun = true;
        let leg = self.legs.front()?;
        self.done_ticks += 1;
        if self.done_ticks >= leg.ticks {
            let to = leg.to;
            self.legs.pop_front();
            self.done_ticks = 0;
            return Some(to);
        }
        let share = f64::from(self.done_ticks) / f64::from(leg.ticks);
        Some(leg.from.interpolate(&leg.to, leg.law.fraction(share)))
    }
    /// Begins anew from a pose at rest, through the waypoints that are left.
    pub fn restart(&mut self, from: Pose) {
        let waypoints: Vec<Pose> = self.legs.iter().map(|leg| leg.to).collect();
        *self = Path { travels: self.travels, ..Path::through(from, &waypoints, self.pace, self.tick_s) };
    }
    /// Marks it as begun; true if it had not been.
    pub fn begin(&mut self) -> bool {
        !std::mem::replace(&mut self.begun, true)
    }
    /// Leaves out all that is left: an arm gets to its end another way.
    pub fn finish(&mut self) {
        self.legs.clear();
    }
    /// Whether any way to its end will do that keeps clear of things.
    pub fn travels(&self) -> bool {
        self.travels
    }
    /// How fast it may be.
    pub fn pace(&self) -> Pace {
        self.pace
    }
    /// Where it ends.
    pub fn end(&self) -> Pose {
        self.end
    }
    /// How long the whole path takes at most, seconds: an arm may find another way to its end, which is longer.
    pub fn longest_s(&self) -> f64 {
        if self.travels { 3.0 * self.duration_s + 4.0 } else { self.duration_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::downward;
    use proptest::prelude::*;

    const PACE: Pace = Pace { speed_m_s: 0.4, acceleration_m_s2: 2.0, turn_rad_s: 2.0, turn_acceleration_rad_s2: 9.0 };
    const TICK_S: f64 = 0.02;

    proptest! {
        #[test]
        fn a_path_keeps_its_limits_and_its_height(
            x in -0.4..0.4f64, y in -0.4..0.4f64, z in 0.0..0.5f64, heading in -3.0..3.0f64,
            from_z in 0.0..0.5f64, height in 0.0..0.5f64,
        ) {
            let from = downward(DVec3::new(0.1, -0.1, from_z), 0.2);
            let goal = downward(DVec3::new(x, y, z), heading);
            let mut path = Path::over(from, goal, height, PACE, TICK_S);
            let end = path.end();
            let (mut at, mut speed) = (from, DVec3::ZERO);
            while let Some(next) = path.advance() {
                let step = next.translation - at.translation;
                prop_assert!(step.length() <= PACE.speed_m_s * TICK_S * 1.0001);
                // At a waypoint two ends of legs meet; each alone keeps the bound.
                prop_assert!((step - speed).length() <= 2.0001 * PACE.acceleration_m_s2 * TICK_S * TICK_S);
                prop_assert!(at.angle_to(&next) <= PACE.turn_rad_s * TICK_S * 1.0001);
                let level = step.truncate().length() > 1e-9;
                prop_assert!(!level || next.translation.z >= height - 1e-9);
                (at, speed) = (next, step);
            }
            prop_assert!(at.translation.distance(end.translation) < 1e-12 && at.angle_to(&end) < 1e-6);
            // A last leg that is negligible is left out.
            prop_assert!(end.translation.distance(goal.translation) < NEGLIGIBLE && end.angle_to(&goal) < NEGLIGIBLE);
        }
    }

    #[test]
    fn a_negligible_last_leg_is_left_out() {
        let (from, goal) = (downward(DVec3::ZERO, 0.0), downward(DVec3::new(0.0, 0.0, 0.33274992), 0.0));
        let mut path = Path::over(from, goal, 0.33275062, PACE, TICK_S);
        let last = std::iter::from_fn(|| path.advance()).last().unwrap();
        assert_eq!(last, path.end());
        assert!((last.translation.z - 0.33275062).abs() < 1e-12);
    }

    #[test]
    fn a_path_to_where_it_stands_is_empty() {
        assert_eq!(Path::vertical(Pose::IDENTITY, 0.0, PACE, TICK_S).advance(), None);
    }
}
