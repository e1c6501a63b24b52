//! How far from its old place the thing is in truth: the simulator's, which no agent sees.

use crate::episode::EpisodeResult;
use acm_sim::TrueObject;
use std::f64::consts::{PI, TAU};

/// The thing that someone else moved, in truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// How far it stands from where it stood at first, millimetres.
    pub off_mm: f64,
    /// By how much its heading differs, degrees.
    pub turned_deg: f64,
}

impl Truth {
    /// Compares three moments: at first, when the instruction was given, and now. The thing in question is the one that
    /// moved farthest between the first two.
    pub fn new(before: &[TrueObject], moved: &[TrueObject], now: &[TrueObject]) -> Truth {
        let far = |(a, b): &(&TrueObject, &TrueObject)| a.pose.translation.distance(b.pose.translation);
        let thing = before.iter().zip(moved).max_by(|a, b| far(a).total_cmp(&far(b))).map(|(thing, _)| thing);
        let ends = thing.and_then(|thing| now.iter().find(|object| object.name == thing.name));
        let (Some(thing), Some(ends)) = (thing, ends) else { return Truth { off_mm: 0.0, turned_deg: 0.0 } };
        let turned = (ends.pose.yaw() - thing.pose.yaw()).rem_euclid(TAU);
        Truth {
            off_mm: 1e3 * thing.pose.translation.distance(ends.pose.translation),
            turned_deg: if turned > PI { TAU - turned } else { turned }.to_degrees(),
        }
    }

    /// The verdict in a line.
    pub fn words(&self, result: &EpisodeResult) -> String {
        let Truth { off_mm, turned_deg } = self;
        let word = if result.verdict.strict { "success" } else { "NO SUCCESS" };
        let why = if result.verdict.strict { String::new() } else { format!("; {}", result.verdict.explanation) };
        format!("{word}, {off_mm:.0} mm and {turned_deg:.0} degrees off{why}")
    }
}
