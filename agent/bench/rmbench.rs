//! `acm bench rmbench`: memories side by side on the tasks of RMBench, with the same perception, planner, skills and robot.
//!
//! | module | holds |
//! |---|---|
//! | [`plan`] | which episodes are asked for |
//! | [`record`] | what is kept of one episode, and what counts as a right decision |
//! | [`ledger`] | the file of records: gone on with, never mixed |
//! | [`work`] | runs what is missing, several episodes at a time |
//! | [`follow`] | listens to an episode: identities beside the truth, what memory holds, pictures |
//! | [`tally`] | rates with intervals, means over tasks |
//! | [`page`] | one HTML page |

pub mod follow;
pub mod ledger;
pub mod page;
pub mod plan;
pub mod record;
pub mod tally;
pub mod work;

use crate::{
    bench::{BenchResult, Row},
    cli::RmbenchArgs,
};
use anyhow::Context;
use ledger::Ledger;
pub use plan::Block;
use plan::{Contender, Plan};
use tally::{Averages, Tally};

/// Measures.
///
/// # Errors
/// A task or a memory does not exist, the folder holds results of another program, or it cannot be written.
pub fn measure(args: &RmbenchArgs) -> anyhow::Result<BenchResult> {
    let plan = Plan::new(args)?;
    std::fs::create_dir_all(&args.out).with_context(|| format!("the folder {} cannot be made", args.out.display()))?;
    let mut ledger = Ledger::open(&args.out, &plan)?;
    let stopped = work::run(&plan, &mut ledger, args)?;
    let tallies = tally::tallies(&plan, ledger.records());
    let mut result = summary(&plan, &ledger, &tallies);
    result.interrupted = stopped;
    if stopped {
        result.errors.push("interrupted: what was run is kept, the same command goes on with it".into());
    }
    let html = args.html.clone().unwrap_or_else(|| args.out.join("page.html"));
    let text = page::html(&plan, &tallies, &result, &page::films(&args.out, &plan))?;
    std::fs::write(&html, text).with_context(|| format!("the page {} cannot be written", html.display()))?;
    result.notes.push(format!("the page is {}", html.display()));
    Ok(result)
}

fn summary(plan: &Plan, ledger: &Ledger, tallies: &[Tally]) -> BenchResult {
    let mut result = BenchResult::new("rmbench", &plan.sensor);
    let seeds = plan.blocks.iter().flat_map(|(_, first)| [*first, first + plan.seeds - 1]);
    result.seeds = seeds.collect();
    result.rows = tallies.iter().map(row).collect();
    for contender in &plan.contenders {
        for (block, _) in &plan.blocks {
            for jittered in plan.layouts() {
                let averages = Averages::of(tallies, contender, *block, *jittered);
                let layout = if *jittered { "jittered" } else { "as published" };
                let mut row = Row::new(format!("{contender}, {}, {layout}", block.word()), averages.values());
                row.group = Some("all tasks".into());
                result.rows.push(row);
            }
        }
    }
    figures(plan, tallies, &mut result);
    let missing = plan.asked().len() - ledger.run_of(plan);
    if missing > 0 {
        let sentence = format!("{missing} of {} episodes were not run and count as failures", plan.asked().len());
        result.errors.push(format!("{sentence}: the same command goes on with them"));
    }
    result.notes.push(format!(
        "robot {}, {} episodes at a time, program {}",
        plan.robot_name(),
        plan.workers,
        plan.program
    ));
    result.notes.push("how the memories were set, and when, is told in docs/rmbench.md".into());
    result
}

fn row(tally: &Tally) -> Row {
    let group = format!("{}, {}", tally.scenario, tally.block.word());
    Row { group: Some(group), ..Row::new(tally.name(), tally.values()) }
}

/// The figures that have targets: of the whole memory, which abstains. Those over nine tasks need all nine.
fn figures(plan: &Plan, tallies: &[Tally], result: &mut BenchResult) {
    let whole = Contender::whole();
    let Some((block, _)) = plan.blocks.iter().find(|(block, _)| *block == Block::Published).or(plan.blocks.first())
    else {
        return;
    };
    if plan.contenders.contains(&whole) {
        let plain = Averages::of(tallies, &whole, *block, false);
        if plain.tasks == 9 {
            result.figure("faithful_mean9", plain.faithful);
            result.figure("strict_mean9", plain.strict);
            result.figure("worst_task_wilson_lower", plain.worst_low);
            result.figure("false_success_rate", plain.false_success);
            result.figure("frames_perceived_mean", plain.frames);
            // Episodes run beside each other on the workers.
            result.figure("wall_minutes_900_episodes", 900.0 * plain.wall_s / 60.0 / plan.workers as f64);
        }
        let jittered = Averages::of(tallies, &whole, *block, true);
        if jittered.tasks == 9 {
            result.figure("strict_jittered_mean9", jittered.strict);
        }
    }
    if let Some(black) = tally::black_frames(tallies) {
        result.figure("black_frames_success", black);
    }
}
