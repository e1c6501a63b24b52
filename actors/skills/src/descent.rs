//! Guarded lowering: straight down at a steady speed until the wrist feels something, or a floor is reached.

use crate::hand::Hand;

/// How fast the speed changes, m/s^2. Low, so that the start of the motion is not taken for a touch.
const ACCELERATION_M_S2: f64 = 0.4;

/// A running descent.
#[derive(Debug, Clone)]
pub(crate) struct Descent {
    speed_m_s: f64,
    floor_m: f64,
    touch_n: f64,
    current_m_s: f64,
}

/// What a tick of a descent found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Progress {
    /// Still going down.
    Down,
    /// The wrist feels an upward force beyond the threshold; the command was left where it is.
    Touched,
    /// The commanded TCP height has reached the floor without a touch.
    Floor,
}

impl Descent {
    /// To a commanded TCP height of `floor_m` at `speed_m_s`, unless the wrist feels `touch_n` before.
    pub fn new(hand: &Hand, floor_m: f64, speed_m_s: f64, touch_n: f64) -> Descent {
        Descent { speed_m_s, floor_m: floor_m.max(hand.robot.workspace_min.z), touch_n, current_m_s: 0.0 }
    }
    /// One tick; the filter of the hand must already hold the newest reading.
    pub fn tick(&mut self, hand: &mut Hand) -> Progress {
        if hand.felt_n().z > self.touch_n {
            return Progress::Touched;
        }
        if self.step(hand) { Progress::Down } else { Progress::Floor }
    }
    /// Goes down by one tick's worth whatever the wrist feels; false at the floor.
    pub fn step(&mut self, hand: &mut Hand) -> bool {
        let tick_s = hand.robot.tick_s;
        let left_m = hand.command.tcp.translation.z - self.floor_m;
        if left_m <= 1e-6 {
            return false;
        }
        let braking = (2.0 * ACCELERATION_M_S2 * left_m).sqrt();
        let fastest = self.speed_m_s.min(braking).max(0.1 * self.speed_m_s);
        self.current_m_s = (self.current_m_s + ACCELERATION_M_S2 * tick_s).min(fastest);
        hand.command_height(hand.command.tcp.translation.z - (self.current_m_s * tick_s).min(left_m));
        true
    }
    /// Longest time it can take from a TCP height, seconds.
    pub fn duration_s(&self, from_m: f64) -> f64 {
        let distance_m = (from_m - self.floor_m).max(0.0);
        distance_m / self.speed_m_s + 4.0 * self.speed_m_s / ACCELERATION_M_S2 + 0.5
    }
}
