//! Guarded motion: straight on at a steady speed until the wrist feels something, or the way is at its end.

use crate::hand::Hand;
use glam::DVec3;

/// How fast the speed changes, m/s^2. Low, so that the start of the motion is not taken for a touch.
const ACCELERATION_M_S2: f64 = 0.4;

/// A running advance of the commanded TCP along a direction; its rotation stays.
#[derive(Debug, Clone)]
pub(crate) struct Advance {
    direction: DVec3,
    travel_m: f64,
    gone_m: f64,
    speed_m_s: f64,
    touch_n: f64,
    current_m_s: f64,
}

/// What a tick of an advance found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Progress {
    /// Still going.
    Onward,
    /// The wrist feels a force against the motion beyond the threshold; the command was left where it is.
    Touched,
    /// The whole way is behind, without a touch.
    End,
}

impl Advance {
    /// From the commanded pose along a unit direction of the world for `travel_m`, or to the end of the workspace if
    /// that is nearer, unless the wrist feels `touch_n` against the motion before.
    pub fn new(hand: &Hand, direction: DVec3, travel_m: f64, speed_m_s: f64, touch_n: f64) -> Advance {
        let room_m = room(hand, direction);
        Advance {
            direction,
            travel_m: travel_m.min(room_m).max(0.0),
            gone_m: 0.0,
            speed_m_s,
            touch_n,
            current_m_s: 0.0,
        }
    }
    /// One tick; the filter of the hand must already hold the newest reading.
    pub fn tick(&mut self, hand: &mut Hand) -> Progress {
        if self.resistance_n(hand) > self.touch_n {
            return Progress::Touched;
        }
        if self.step(hand) { Progress::Onward } else { Progress::End }
    }
    /// Goes on by one tick's worth whatever the wrist feels; false at the end.
    pub fn step(&mut self, hand: &mut Hand) -> bool {
        let tick_s = hand.robot.tick_s;
        let left_m = self.travel_m - self.gone_m;
        if left_m <= 1e-6 {
            return false;
        }
        let braking = (2.0 * ACCELERATION_M_S2 * left_m).sqrt();
        let fastest = self.speed_m_s.min(braking).max(0.1 * self.speed_m_s);
        self.current_m_s = (self.current_m_s + ACCELERATION_M_S2 * tick_s).min(fastest);
        let step_m = (self.current_m_s * tick_s).min(left_m);
        self.gone_m += step_m;
        hand.command.tcp.translation += step_m * self.direction;
        true
    }
    /// How far the command has gone, metres.
    pub fn gone_m(&self) -> f64 {
        self.gone_m
    }
    /// The direction of the motion, world frame.
    pub fn direction(&self) -> DVec3 {
        self.direction
    }
    /// Filtered force against the motion, newtons.
    pub fn resistance_n(&self, hand: &Hand) -> f64 {
        -hand.felt_n().dot(self.direction)
    }
    /// Longest time it can take, seconds.
    pub fn duration_s(&self) -> f64 {
        self.travel_m / self.speed_m_s + 4.0 * self.speed_m_s / ACCELERATION_M_S2 + 0.5
    }
}

/// How far the commanded TCP can go along a direction inside the workspace, metres.
fn room(hand: &Hand, direction: DVec3) -> f64 {
    let (at, robot) = (hand.command.tcp.translation, &hand.robot);
    let axis = |at: f64, direction: f64, low: f64, high: f64| match direction {
        d if d > 1e-9 => (high - at) / d,
        d if d < -1e-9 => (low - at) / d,
        _ => f64::INFINITY,
    };
    let (low, high) = (robot.workspace_min, robot.workspace_max);
    axis(at.x, direction.x, low.x, high.x)
        .min(axis(at.y, direction.y, low.y, high.y))
        .min(axis(at.z, direction.z, low.z, high.z))
        .max(0.0)
}
