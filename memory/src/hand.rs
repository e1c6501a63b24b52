//! What the fingers say about whether the hand holds something.

use acm_concept::embodiment::Feedback;
use serde::{Deserialize, Serialize};

/// What the last feedback says of the hand.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HandFeeling {
    /// No feedback yet, or one that does not decide.
    #[default]
    Unknown,
    /// The fingers touch nothing, or each other.
    Empty,
    /// Both pads are pressed by something between them.
    Something,
}

/// Pads that feel less are not touched, newtons.
const TOUCH_N: f64 = 0.3;
/// Both pads feel at least this when something is gripped, newtons.
const GRIP_N: f64 = 0.5;
/// A cup with this share of the pump's best vacuum is closed by something.
const SEALED: f64 = 0.5;
/// Fingers nearer than this touch each other, metres.
const SHUT_M: f64 = 0.002;
/// Fingers that nothing stops come this near to the commanded opening, metres.
const FOLLOW_M: f64 = 0.003;

impl HandFeeling {
    /// Reads one feedback. Shut fingers press on each other, so they count as empty whatever the pads feel.
    pub fn from_feedback(feedback: &Feedback) -> HandFeeling {
        let [left, right] = feedback.pad_force_n;
        if feedback.vacuum >= SEALED {
            return HandFeeling::Something;
        }
        if feedback.opening_m < SHUT_M {
            return HandFeeling::Empty;
        }
        if left.y.abs() >= GRIP_N && right.y.abs() >= GRIP_N {
            return HandFeeling::Something;
        }
        let untouched = left.length() < TOUCH_N && right.length() < TOUCH_N;
        let follows = (feedback.opening_m - feedback.commanded_opening_m).abs() < FOLLOW_M;
        if untouched && follows { HandFeeling::Empty } else { HandFeeling::Unknown }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::staging::{gripping_hand, open_hand};

    #[test]
    fn a_stopped_finger_pair_with_force_holds_something() {
        assert_eq!(HandFeeling::from_feedback(&open_hand(0.0)), HandFeeling::Empty);
        assert_eq!(HandFeeling::from_feedback(&gripping_hand(0.0)), HandFeeling::Something);
        let sealed = Feedback { opening_m: 0.0, vacuum: 0.9, ..open_hand(0.0) };
        assert_eq!(HandFeeling::from_feedback(&sealed), HandFeeling::Something);
        assert_eq!(HandFeeling::from_feedback(&Feedback { vacuum: 0.1, ..sealed }), HandFeeling::Empty);
        let mut shut = gripping_hand(0.0);
        shut.opening_m = 0.001;
        assert_eq!(HandFeeling::from_feedback(&shut), HandFeeling::Empty);
        let mut stopped = gripping_hand(0.0);
        stopped.pad_force_n = Default::default();
        assert_eq!(HandFeeling::from_feedback(&stopped), HandFeeling::Unknown);
    }
}
