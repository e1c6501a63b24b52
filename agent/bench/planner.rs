//! `acm bench planner`: what the planner makes of published tasks.
//!
//! | module | measures |
//! |---|---|
//! | [`drawn`] | how long plans for thirty objects and forty steps take |
//! | [`verdicts`] | what the verifier says of finished skills, beside what came of them in truth |
//! | [`alfred`], [`libero`] | instructions of the outside data, with their goals; [`inventory`] and [`scene`] are what they are read in |
//! | [`instructions`] | how many of them are read right, and which rules of language fire for one family only |
//! | [`goals`] | goals of tabletop tasks and household activities that are reached, each plan simulated |
//! | [`peer`] | pyperplan on the same problems |
//!
//! [`published`] makes problems of published tasks; [`simulator`] follows plans.

pub mod alfred;
pub mod drawn;
pub mod goals;
pub mod instructions;
pub mod inventory;
pub mod libero;
pub mod peer;
pub mod published;
pub mod scene;
pub mod simulator;
pub mod verdicts;

use super::BenchResult;
use crate::cli::PlannerArgs;
use clap::ValueEnum;

/// A part of the bench.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PlannerPart {
    /// Goals of tabletop tasks and of household activities, given with what holds at first.
    Goals,
    /// Households of thirty objects that need forty steps, drawn at random.
    Drawn,
    /// What the verifier says of the skills of whole episodes, with and without things that slip.
    Verdicts,
    /// pyperplan on the same goals (scripts/peers.sh installs it).
    Peer,
    /// Instructions of tabletop tasks, against their goals.
    Libero,
    /// What people wrote of household episodes, against the episodes' goals.
    Alfred,
    /// Rules of language that fire for one family of instructions only.
    Rules,
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
            PlannerPart::Drawn => drawn::measure(&args.common, &mut result),
            PlannerPart::Verdicts => verdicts::measure(&args.common, &mut result),
            PlannerPart::Peer => peer::measure(&args.common, &mut result),
            PlannerPart::Libero => instructions::measure_tabletop(&args.common, &mut result),
            PlannerPart::Alfred => instructions::measure_episodes(&args.common, &mut result),
            PlannerPart::Rules => instructions::measure_rules(&args.common, &mut result),
        };
        // What the other parts have measured is not lost with it.
        if let Err(error) = measured {
            let name = part.to_possible_value().map(|value| value.get_name().to_string()).unwrap_or_default();
            result.errors.push(format!("{name}: {error:#}"));
        }
    }
    Ok(result)
}
