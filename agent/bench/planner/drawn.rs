//! Households drawn at random: thirty things, of which twenty must be elsewhere in the end, so that no plan has fewer than
//! forty steps.

use super::{
    goals::follow,
    published::{Abilities, Task},
};
use crate::{
    bench::{BenchResult, Row, bddl::Problem, progress, world::clock::cpu_s},
    cli::BenchArgs,
    statistics::median_and,
};
use acm_planner::classical::{Domain, Effort, plan};
use anyhow::Context;
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;

/// Households, from seed 0 on.
const HOUSEHOLDS: usize = 50;
const TABLES: usize = 4;
const CABINETS: usize = 4;
const BOXES: usize = 2;
const THINGS: usize = 20;

/// Measures.
///
/// # Errors
/// A household is broken.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let number = args.episodes.unwrap_or(if args.quick { HOUSEHOLDS / 10 } else { HOUSEHOLDS });
    let domain = Domain::manipulation()?;
    let bar = progress("households", number as u64);
    let (mut times_s, mut steps, mut unsolved) = (Vec::new(), Vec::new(), 0);
    for seed in 0..number as u64 {
        let task = household(seed)?;
        let (found, seconds) = cpu_s(|| anyhow::Ok(plan(&domain, &task.problem, &Effort::default())))?;
        times_s.push(seconds);
        let judged = found.map_err(|error| error.to_string()).and_then(|plan| {
            follow(&task, &plan.calls())?;
            Ok(plan.steps.len())
        });
        match judged {
            Ok(length) => steps.push(length as f64),
            Err(reason) => {
                unsolved += 1;
                result.rows.push(Row::skipped(&task.name, format!("not solved: {reason}")));
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    result.seeds = vec![0, number.saturating_sub(1) as u64];
    let slowest_s = times_s.iter().copied().fold(0.0, f64::max);
    let fewest = steps.iter().copied().fold(f64::INFINITY, f64::min);
    let most = steps.iter().copied().fold(0.0, f64::max);
    let (p50, _) = median_and(0.9, &times_s);
    let values = [
        ("households", number as f64),
        ("unsolved", f64::from(unsolved)),
        ("cpu_p50_s", p50),
        ("cpu_max_s", slowest_s),
        ("fewest_steps", fewest),
        ("most_steps", most),
    ];
    result.rows.push(Row::new("30 objects", values));
    // Without a plan there is no time that it took.
    result.figure("plan_30_objects_40_steps_s", if unsolved == 0 { slowest_s } else { f64::INFINITY });
    Ok(())
}

/// A household of a seed.
///
/// # Errors
/// None, unless what is written here cannot be read.
pub fn household(seed: u64) -> anyhow::Result<Task> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let named = |kind: &str, number: usize| (1..=number).map(|at| format!("{kind}.n.01_{at}")).collect::<Vec<_>>();
    let (tables, cabinets) = (named("table", TABLES), named("cabinet", CABINETS));
    let (boxes, things) = (named("box", BOXES), named("thing", THINGS));
    let mut facts: Vec<String> = tables.iter().chain(&cabinets).map(|name| format!("(inroom {name} room)")).collect();
    let mut goals = Vec::new();
    for name in &boxes {
        facts.push(format!("(ontop {name} {})", pick(&tables, &mut rng)?));
    }
    for (at, name) in things.iter().enumerate() {
        // On a table, in a cabinet or a box, or on a thing that has its place already.
        let first = place(&tables, &cabinets, &boxes, &things[..at], &mut rng)?;
        let mut last = first.clone();
        while last == first {
            last = place(&tables, &cabinets, &boxes, &things[..at], &mut rng)?;
        }
        facts.push(format!("({} {name} {})", first.0, first.1));
        goals.push(format!("({} ?{name} ?{})", last.0, last.1));
    }
    for name in &cabinets {
        if rng.random_bool(0.5) {
            facts.push(format!("(open {name})"));
        }
        goals.push(format!("(not (open ?{name}))"));
    }
    let objects = |names: &[String], kind: &str| format!("{} - {kind}.n.01", names.join(" "));
    let text = format!(
        "(define (problem household-{seed}) (:objects {} {} {} {}) (:init {}) (:goal (and {})))",
        objects(&tables, "table"),
        objects(&cabinets, "cabinet"),
        objects(&boxes, "box"),
        objects(&things, "thing"),
        facts.join(" "),
        goals.join(" "),
    );
    let opening = ["cabinet.n.01", "box.n.01"].map(str::to_string);
    let abilities = Abilities { openable: opening.into(), ..Abilities::default() };
    let name = format!("household {seed}");
    Task::household(&name, Problem::parse(&text)?, &abilities).context(name)
}

fn place(
    tables: &[String],
    cabinets: &[String],
    boxes: &[String],
    things: &[String],
    rng: &mut ChaCha8Rng,
) -> anyhow::Result<(&'static str, String)> {
    Ok(match rng.random_range(0..10) {
        0..4 => ("ontop", pick(tables, rng)?),
        4..7 => ("inside", pick(cabinets, rng)?),
        7 => ("inside", pick(boxes, rng)?),
        _ if things.is_empty() => ("ontop", pick(tables, rng)?),
        _ => ("ontop", pick(things, rng)?),
    })
}

fn pick(names: &[String], rng: &mut ChaCha8Rng) -> anyhow::Result<String> {
    names.choose(rng).cloned().context("there is nothing to draw from")
}
