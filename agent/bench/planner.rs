//! `acm bench planner`: what the planner makes of published tasks.
//!
//! | module | measures |
//! |---|---|
//! | [`goals`] | goals of tabletop tasks and household activities that are reached, each plan simulated |

pub mod goals;

use super::BenchResult;
use crate::cli::PlannerArgs;
use clap::ValueEnum;

/// A part of the bench.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PlannerPart {
    /// Goals of tabletop tasks and of household activities, given with what holds at first.
    Goals,
}

/// Measures the parts that are asked for, or everything.
///
/// # Errors
/// None: a part that ends with an error is told in the result.
pub fn measure(args: &PlannerArgs) -> anyhow::Result<BenchResult> {
    let mut result = BenchResult::new("planner", "none");
    let parts = if args.only.is_empty() { PlannerPart::value_variants() } else { &args.only };
    for part in parts {
        let measured = match part {
            PlannerPart::Goals => goals::measure(&args.common, &mut result),
        };
        // What the other parts have measured is not lost with it.
        if let Err(error) = measured {
            let name = part.to_possible_value().map(|value| value.get_name().to_string()).unwrap_or_default();
            result.errors.push(format!("{name}: {error:#}"));
        }
    }
    Ok(result)
}
