//! Published goals, given with what holds at first: a goal counts as solved if the plan, followed in a world of its own,
//! ends where the goal holds as it was published.

use super::{
    published::{Abilities, Task, regions},
    simulator::World,
};
use crate::{
    bench::{
        BenchResult, Row,
        bddl::{Problem, archive},
        progress,
        world::clock::cpu_s,
    },
    cli::BenchArgs,
};
use acm_planner::classical::{Call, Domain, Effort, Formula, Plan, plan, simulate};
use anyhow::{Context, bail};
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

/// Where the tabletop tasks lie in the folder of outside data.
pub const TABLETOP: &str = "libero_tasks/bddl_files.tar.xz";
/// Where the household activities lie, and what is known of their types.
pub const HOUSEHOLD: [&str; 2] = ["bddl_activities/activities.tar.xz", "bddl_activities/synsets.csv"];
/// Predicates of the activities that are measured: those whose goals use no other.
const MEASURED: [&str; 5] = ["ontop", "inside", "open", "nextto", "under"];
/// Largest table of types, bytes.
const MAX_TABLE: u64 = 4 * 1024 * 1024;

/// Measures. Without the outside data its rows say that they were skipped.
///
/// # Errors
/// The outside data cannot be read.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let domain = Domain::manipulation()?;
    for (figure, tasks) in [("libero_goals_solved", tabletop()), ("bddl_goals_solved", household())] {
        let mut tasks = match tasks? {
            Ok(tasks) => tasks,
            Err(reason) => {
                result.rows.push(Row::skipped(figure, reason));
                continue;
            }
        };
        tasks.truncate(args.episodes.unwrap_or(usize::MAX));
        report(figure, &domain, &tasks, result);
    }
    Ok(())
}

/// The tabletop tasks, or why there are none.
///
/// # Errors
/// A file cannot be read.
pub fn tabletop() -> anyhow::Result<Result<Vec<Task>, String>> {
    let archive = match archive::find(TABLETOP) {
        Ok(archive) => archive,
        Err(reason) => return Ok(Err(reason)),
    };
    let sources = read(&archive)?;
    let mut abilities = Abilities::default();
    for (name, source) in &sources {
        abilities.openable.extend(opened(source).with_context(|| name.clone())?);
    }
    let task = |(name, source): (String, Problem)| Task::tabletop(&name, source, &abilities).with_context(|| name);
    Ok(Ok(sources.into_iter().map(task).collect::<anyhow::Result<_>>()?))
}

/// The household activities whose goals use the measured predicates alone, or why there are none.
///
/// # Errors
/// A file cannot be read.
pub fn household() -> anyhow::Result<Result<Vec<Task>, String>> {
    let (archive, table) = match (archive::find(HOUSEHOLD[0]), archive::find(HOUSEHOLD[1])) {
        (Ok(archive), Ok(table)) => (archive, table),
        (Err(reason), _) | (_, Err(reason)) => return Ok(Err(reason)),
    };
    let abilities = types(&table)?;
    let mut tasks = Vec::new();
    for (name, source) in read(&archive)? {
        let mut predicates = BTreeSet::new();
        for goal in source.section("goal") {
            let goal = Formula::read(goal).with_context(|| name.clone())?;
            predicates.extend(goal.literals().into_iter().map(|literal| literal.predicate.to_ascii_lowercase()));
        }
        if predicates.iter().all(|predicate| MEASURED.contains(&predicate.as_str())) {
            tasks.push(Task::household(&name, source, &abilities).with_context(|| name.clone())?);
        }
    }
    Ok(Ok(tasks))
}

fn read(archive: &Path) -> anyhow::Result<Vec<(String, Problem)>> {
    let short =
        |file: &str| file.trim_end_matches("problem0.bddl").trim_end_matches(".bddl").trim_matches('/').to_string();
    let parse = |(file, text): (String, String)| {
        let problem = Problem::parse(&text).with_context(|| format!("{file} of {}", archive.display()))?;
        Ok((short(&file), problem))
    };
    archive::texts(archive, ".bddl")?.into_iter().map(parse).collect()
}

/// Types, or types and regions, that some task opens or closes: `wooden_cabinet/top_region`.
fn opened(source: &Problem) -> anyhow::Result<Vec<String>> {
    let mut types: BTreeMap<String, String> = BTreeMap::new();
    for section in ["objects", "fixtures"] {
        types.extend(source.typed(section)?.into_iter().map(|(name, of_type)| (name.to_string(), of_type.to_string())));
    }
    for (region, owner) in regions(source)? {
        let of_type = format!("{}/{region}", types.get(&owner).unwrap_or(&owner));
        types.insert(format!("{owner}_{region}"), of_type);
    }
    let mut opened = Vec::new();
    for part in source.section("init").iter().chain(source.section("goal")) {
        for literal in Formula::read(part)?.literals() {
            if ["open", "close"].contains(&literal.predicate.to_ascii_lowercase().as_str()) {
                let named = literal.arguments.first().and_then(|object| types.get(&object.to_string()));
                opened.extend(named.cloned());
            }
        }
    }
    Ok(opened)
}

/// What the table says of types: which are above a type, which open, which can be filled.
fn types(table: &Path) -> anyhow::Result<Abilities> {
    let unread = || format!("the table {} cannot be read", table.display());
    if std::fs::metadata(table).with_context(unread)?.len() > MAX_TABLE {
        bail!("the table {} is larger than {MAX_TABLE} bytes", table.display());
    }
    let text = std::fs::read_to_string(table).with_context(unread)?;
    let mut lines = text.lines().map(cells);
    let head = lines.next().unwrap_or_default();
    let column = |name: &str| {
        head.iter().position(|cell| cell == name).with_context(|| format!("{} has no column {name}", table.display()))
    };
    let (name, above) = (column("synset")?, column("hypernyms")?);
    let (openable, fillable) = (column("openable")?, column("fillable")?);
    let mut abilities = Abilities::default();
    for row in lines {
        let cell = |number: usize| row.get(number).map_or("", String::as_str);
        let of_type = cell(name).to_string();
        if cell(openable) == "1" {
            abilities.openable.insert(of_type.clone());
        }
        if cell(fillable) == "1" {
            abilities.fillable.insert(of_type.clone());
        }
        abilities.above.insert(of_type, cell(above).split(',').map(str::to_string).collect());
    }
    Ok(abilities)
}

/// The cells of a line, of which those in quotation marks hold commas.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            c => cells.last_mut().into_iter().for_each(|cell| cell.push(c)),
        }
    }
    cells
}

fn report(figure: &str, domain: &Domain, tasks: &[Task], result: &mut BenchResult) {
    let bar = progress(figure, tasks.len() as u64);
    let (mut solved, mut steps, mut redundant, mut slowest_ms) = (0.0, 0, 0, 0.0_f64);
    for task in tasks {
        let planned = cpu_s(|| plan(domain, &task.problem, &Effort::default()));
        let judged = planned.map_err(|error| error.to_string()).and_then(|(plan, seconds)| {
            judge(domain, task, &plan.calls())?;
            Ok((plan, seconds * 1e3))
        });
        match judged {
            Ok((plan, ms)) => {
                solved += 1.0;
                slowest_ms = slowest_ms.max(ms);
                steps += plan.steps.len();
                redundant += needless(task, &plan);
            }
            Err(reason) => result.rows.push(Row::skipped(&task.name, format!("not solved: {reason}"))),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let values = [
        ("tasks", tasks.len() as f64),
        ("solved", solved),
        ("steps", steps as f64),
        ("redundant_steps", redundant as f64),
        ("slowest_cpu_ms", slowest_ms),
    ];
    result.rows.push(Row::new(figure, values));
    result.figure(figure, solved / tasks.len().max(1) as f64);
}

/// Follows a plan on the operators, and in the simulator to the published goal.
fn judge(domain: &Domain, task: &Task, calls: &[Call]) -> Result<(), String> {
    simulate(domain, &task.problem, calls).map_err(|violation| format!("its own operators refuse it: {violation}"))?;
    follow(task, calls)
}

/// Follows a plan in the simulator to the published goal.
///
/// # Errors
/// What refused it, in words.
pub fn follow(task: &Task, calls: &[Call]) -> Result<(), String> {
    let of_kind = |kind: &str| {
        let named = task.problem.objects.keys().filter(|name| task.problem.is(name, kind));
        named.cloned().collect::<BTreeSet<String>>()
    };
    let mut world = World::new(&task.source, of_kind("fixed"), of_kind("openable"))?;
    for (number, call) in (1..).zip(calls) {
        let things: Vec<&str> = call.arguments.iter().map(String::as_str).collect();
        world.act(&call.operator, &things).map_err(|refusal| format!("step {number}, {call}: {refusal}"))?;
    }
    if let Some(held) = world.held() {
        return Err(format!("after {} steps the hand still holds {held}", calls.len()));
    }
    for goal in task.source.section("goal") {
        if !world.holds(goal)? {
            return Err(format!("after {} steps this does not hold: {goal}", calls.len()));
        }
    }
    Ok(())
}

/// Steps that could be left out, each alone.
fn needless(task: &Task, plan: &Plan) -> usize {
    let calls = plan.calls();
    let without = |left_out: &usize| {
        let rest: Vec<Call> =
            calls.iter().enumerate().filter(|(at, _)| at != left_out).map(|(_, call)| call.clone()).collect();
        follow(task, &rest).is_ok()
    };
    (0..calls.len()).filter(without).count()
}
