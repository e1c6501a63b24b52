//! pyperplan beside us on the same problems, written out in STRIPS; its plans are followed as ours are.

use super::{
    goals::{follow, household, tabletop},
    published::Task,
};
use crate::{
    bench::{
        BenchResult, Row, progress,
        world::{clock::cpu_s, peer::python},
    },
    cli::BenchArgs,
    statistics::median_and,
};
use acm_planner::classical::{Call, Domain, Effort, pddl::export, plan};
use anyhow::{Context, bail};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader},
    process::{Command, Stdio},
};

/// The peer's program; `scripts/peers.sh` installs what it needs.
const PROGRAM: &str = include_str!("../../../scripts/peers/pyperplan_plans.py");
/// Most seconds that the peer has for one problem.
const LIMIT_S: u32 = 30;

/// What the peer says of a problem.
#[derive(Debug, Deserialize)]
struct Answer {
    name: String,
    cpu_s: f64,
    actions: Option<Vec<String>>,
}

/// A problem that was handed over, and what we made of it ourselves.
struct Handed<'t> {
    task: &'t Task,
    calls: BTreeMap<String, Call>,
    cpu_s: f64,
    steps: usize,
}

/// Measures. Without the outside data or the peer its row says that it was skipped.
///
/// # Errors
/// The outside data cannot be read, or the peer's answer is not understood.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let (tabletop, household) = match (tabletop()?, household()?) {
        (Ok(tabletop), Ok(household)) => (tabletop, household),
        (Err(reason), _) | (_, Err(reason)) => {
            result.rows.push(Row::skipped("pyperplan", reason));
            return Ok(());
        }
    };
    let most = args.episodes.unwrap_or(if args.quick { 10 } else { usize::MAX });
    let tasks: Vec<&Task> = tabletop.iter().take(most).chain(household.iter().take(most)).collect();
    let domain = Domain::manipulation()?;
    let folder = tempfile::tempdir()?;
    let mut handed: BTreeMap<String, Handed<'_>> = BTreeMap::new();
    let mut too_derived = 0;
    for (number, task) in tasks.iter().enumerate() {
        let Ok(export) = export(&domain, &task.problem) else {
            too_derived += 1;
            continue;
        };
        let (plan, seconds) =
            cpu_s(|| plan(&domain, &task.problem, &Effort::default())).with_context(|| task.name.clone())?;
        let name = format!("{number:04}");
        std::fs::write(folder.path().join(format!("{name}.domain.pddl")), &export.domain)?;
        std::fs::write(folder.path().join(format!("{name}.problem.pddl")), &export.problem)?;
        handed.insert(name, Handed { task, calls: export.calls, cpu_s: seconds, steps: plan.steps.len() });
    }
    let (version, answers) = match ask(folder.path(), handed.len()) {
        Ok(answered) => answered,
        Err(reason) => {
            result.rows.push(Row::skipped("pyperplan", format!("{reason:#}")));
            return Ok(());
        }
    };
    let (mut ratios, mut steps, mut peer_steps, mut unsolved, mut refused) = (Vec::new(), 0, 0, 0, 0);
    for answer in &answers {
        let Some(ours) = handed.get(&answer.name) else {
            bail!("the peer answers for `{}`, which nobody asked", answer.name)
        };
        let Some(actions) = &answer.actions else {
            unsolved += 1;
            continue;
        };
        let calls: Vec<Call> = actions.iter().filter_map(|action| ours.calls.get(action).cloned()).collect();
        if let Err(refusal) = follow(ours.task, &calls) {
            refused += 1;
            result.notes.push(format!("pyperplan's plan for {} is refused: {refusal}", ours.task.name));
            continue;
        }
        ratios.push(answer.cpu_s / ours.cpu_s);
        steps += ours.steps;
        peer_steps += calls.len();
    }
    let (ratio_p50, ratio_p10) = median_and(0.1, &ratios);
    let values = [
        ("tasks", tasks.len() as f64),
        ("not_in_strips", f64::from(too_derived)),
        ("peer_without_plan", f64::from(unsolved)),
        ("peer_plans_refused", f64::from(refused)),
        ("both_solved", ratios.len() as f64),
        ("times_faster_p50", ratio_p50),
        ("times_faster_p10", ratio_p10),
        ("steps", steps as f64),
        ("peer_steps", peer_steps as f64),
    ];
    result.rows.push(Row::new(format!("pyperplan {version}"), values));
    result.figure("planning_times_faster_than_pyperplan", ratio_p50);
    result.figure("steps_over_pyperplan", steps as f64 / f64::from(peer_steps.max(1) as u32));
    Ok(())
}

/// The peer's version, and its answers for the problems of a folder.
fn ask(folder: &std::path::Path, problems: usize) -> anyhow::Result<(String, Vec<Answer>)> {
    let python = python();
    let mut child = Command::new(&python)
        .args(["-c", PROGRAM])
        .arg(folder)
        .arg(LIMIT_S.to_string())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("{} cannot be started", python.display()))?;
    let bar = progress("pyperplan", problems as u64);
    let mut lines = BufReader::new(child.stdout.take().context("the peer has no standard output")?).lines();
    let Some(first) = lines.next() else {
        let words = child.stderr.take().map(std::io::read_to_string).and_then(Result::ok).unwrap_or_default();
        let last = words.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it ended without a word");
        bail!("no peer by {}: {last} (scripts/peers.sh installs it)", python.display());
    };
    let first: BTreeMap<String, String> =
        serde_json::from_str(&first?).context("the peer's first line is not understood")?;
    let mut answers = Vec::new();
    for line in lines {
        answers.push(serde_json::from_str(&line?).context("the peer's answer is not understood")?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    child.wait()?;
    Ok((first.get("version").cloned().unwrap_or_default(), answers))
}
