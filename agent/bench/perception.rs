//! `acm bench perception`: what perception makes of real and of rendered frames, against labels and truth.
//!
//! | module | measures |
//! |---|---|
//! | [`reading`] | digits, marks, lamps and needles on rendered things |
//! | [`real_frames`] | segmentation of labelled frames of a real camera |
//! | [`suite`] | the fixed rendered suite: things found, their templates, sizes, places; time of frames with many things |
//! | [`articulation`] | joints of articulated things that are seen in two states |

pub mod articulation;
pub mod reading;
pub mod real_frames;
pub mod suite;

use super::{BenchResult, targets::Targets};
use crate::cli::PerceptionArgs;
use acm_concept::{camera::RgbdFrame, expectation::Expectation, object::Percepts};
use acm_perception::Grounder;
use clap::ValueEnum;
use std::time::Instant;

/// A part of the bench.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PerceptionPart {
    /// Labelled frames of a real camera.
    RealFrames,
    /// The fixed rendered suite: exact, perturbed and foreign things.
    Suite,
    /// Small cubes in small frames.
    SmallCubes,
    /// Time of frames with ten things.
    Crowd,
    /// One bad frame after good ones: what it changes of what memory has verified.
    Overwrites,
    /// Digits, marks, lamps and needles.
    Reading,
    /// Joints of articulated things of the shared data, each seen in two states.
    Articulation,
}

/// Measures the parts that are asked for, or everything.
///
/// # Errors
/// None: a part that ends with an error is told in the result.
pub fn measure(args: &PerceptionArgs, targets: &Targets) -> anyhow::Result<BenchResult> {
    let mut result = BenchResult::new("perception", "d435; kinect (real frames)");
    let parts = if args.only.is_empty() { PerceptionPart::value_variants() } else { &args.only };
    for part in parts {
        let measured = match part {
            PerceptionPart::RealFrames => real_frames::measure(&args.common, &mut result),
            PerceptionPart::Suite => suite::measure(args, targets, &mut result),
            PerceptionPart::SmallCubes => suite::measure_small_cubes(args, &mut result),
            PerceptionPart::Crowd => suite::crowd::measure(args, &mut result),
            PerceptionPart::Overwrites => suite::overwrites::measure(args, &mut result),
            PerceptionPart::Reading => reading::measure(args, &mut result),
            PerceptionPart::Articulation => articulation::measure(args, &mut result),
        };
        // What the other parts have measured is not lost with it.
        if let Err(error) = measured {
            let name = part.to_possible_value().map(|value| value.get_name().to_string()).unwrap_or_default();
            result.errors.push(format!("{name}: {error:#}"));
        }
    }
    Ok(result)
}

/// Grounds a frame, and says how long it took, milliseconds.
#[allow(clippy::disallowed_methods)] // The time is what is measured.
fn timed(grounder: &Grounder, frame: &RgbdFrame, expectation: &Expectation) -> (Percepts, f64) {
    let started = Instant::now();
    let percepts = grounder.ground(frame, expectation);
    (percepts, started.elapsed().as_secs_f64() * 1e3)
}
