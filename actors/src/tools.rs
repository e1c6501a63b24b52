//! Perception's tools in other processes, and how a user names them.
//!
//! | module | holds |
//! |---|---|
//! | `http` | a tool behind an address |
//! | `wire` | what goes over it (docs/perception-tools.md) |

mod http;
mod wire;

pub use http::{HttpTool, MAX_REPLY_BYTES};

use acm_perception::tools::Stopwatch;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// The `[tools]` table of the settings: where each of perception's tools is. What is left out is geometry's.
///
/// ```
/// # use acm_actors::settings::Settings;
/// let settings: Settings = toml::from_str("[tools]\nsegmenter = 'http://127.0.0.1:8765'\ndeadline_ms = 800").unwrap();
/// assert_eq!(settings.tools.named().count(), 1);
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ToolSettings {
    /// Finds things; its boxes are prompts for the segmenter.
    pub detector: Option<String>,
    /// Cuts things out of the image.
    pub segmenter: Option<String>,
    /// Names templates.
    pub part_recogniser: Option<String>,
    /// Places things.
    pub pose_estimator: Option<String>,
    /// Measures things.
    pub param_estimator: Option<String>,
    /// How long each call may take, milliseconds of wall time.
    pub deadline_ms: u64,
}

impl Default for ToolSettings {
    fn default() -> ToolSettings {
        ToolSettings {
            detector: None,
            segmenter: None,
            part_recogniser: None,
            pose_estimator: None,
            param_estimator: None,
            deadline_ms: 500,
        }
    }
}

/// Longest time of a call, milliseconds.
const LONGEST_MS: u64 = 600_000;

impl ToolSettings {
    /// The fields that name a tool, and what they name.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let fields = [
            ("detector", &self.detector),
            ("segmenter", &self.segmenter),
            ("part_recogniser", &self.part_recogniser),
            ("pose_estimator", &self.pose_estimator),
            ("param_estimator", &self.param_estimator),
        ];
        fields.into_iter().filter_map(|(field, tool)| Some((field, tool.as_deref()?)))
    }
    /// Whether nothing is set.
    pub fn is_default(&self) -> bool {
        *self == ToolSettings::default()
    }
    /// How long each call may take.
    pub fn limit(&self) -> Duration {
        Duration::from_millis(self.deadline_ms)
    }
    /// Checks that the values are in their ranges.
    ///
    /// # Errors
    /// The first field that is not, with its value.
    pub fn check(&self) -> Result<(), String> {
        if !(1..=LONGEST_MS).contains(&self.deadline_ms) {
            return Err(format!("deadline_ms is {}: it must be from 1 to {LONGEST_MS}", self.deadline_ms));
        }
        if self.segmenter.is_none() && self.detector.is_some() {
            return Err("detector is set without a segmenter: its boxes are prompts for one, set both".into());
        }
        Ok(())
    }
}

/// Wall time since it was made.
#[derive(Debug, Clone, Copy)]
pub struct WallStopwatch(Instant);

impl Default for WallStopwatch {
    #[expect(clippy::disallowed_methods, reason = "how long a tool takes is wall time, measured by the shell")]
    fn default() -> WallStopwatch {
        WallStopwatch(Instant::now())
    }
}

impl Stopwatch for WallStopwatch {
    fn elapsed(&self) -> Duration {
        self.0.elapsed()
    }
}

#[cfg(test)]
mod tests;
