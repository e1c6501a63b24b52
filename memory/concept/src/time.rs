//! Virtual time of an episode: nanoseconds since its start.

use serde::{Deserialize, Serialize};
use std::{fmt, ops};

/// A moment of an episode's virtual clock, in nanoseconds since the episode began. The clock advances only
/// with the robot and never while the agent thinks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Time(pub u64);

impl Time {
    /// The beginning of the episode.
    pub const ZERO: Time = Time(0);

    /// The moment `seconds` after the beginning; negative values become the beginning itself.
    pub fn from_seconds(seconds: f64) -> Time {
        Time((seconds.max(0.0) * 1e9).round() as u64)
    }
    /// Seconds since the beginning.
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }
    /// Seconds from `earlier` to this moment; 0 if `earlier` is later.
    pub fn seconds_since(self, earlier: Time) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }
}

impl ops::Add<f64> for Time {
    type Output = Time;
    fn add(self, seconds: f64) -> Time {
        Time::from_seconds(self.seconds() + seconds)
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} s", self.seconds())
    }
}
