//! Published instructions: those of tabletop tasks, and what people wrote of household episodes; and which rules of
//! language fire for one family of instructions only.

use super::{
    alfred::{self, Episode, Outcome, Rooms},
    inventory::Abilities,
    libero::{self, Made, Published},
};
use crate::{
    bench::{
        BenchResult, Row,
        bddl::{Problem, archive},
    },
    cli::BenchArgs,
};
use acm_planner::{Lexicon, Planner, embedded_lexicon};
use acm_sim::Scenario;
use anyhow::Context;
use lzma_rust2::XzReader;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::{BufRead, BufReader},
};

/// Where the tabletop tasks lie in the folder of outside data.
const TABLETOP: &str = "libero_tasks/bddl_files.tar.xz";
/// Where the household episodes lie.
const EPISODES: &str = "alfred_episodes/episodes.jsonl.xz";
/// Parts into which the tabletop instructions are cut.
const FOLDS: usize = 5;
/// Descriptions of episodes that are read.
const DESCRIPTIONS: usize = 2000;
/// Of the floor plans every third one was not looked at while the lexicon was written.
const HELD_OUT: u32 = 3;
/// Episodes whose words are taken for the report on rules.
const RULE_SAMPLE: usize = 8000;

/// Reads the instructions of the tabletop tasks, each fold without the everyday words that only it has.
///
/// # Errors
/// The data is there and not in its format.
pub fn measure_tabletop(_args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let Some(tasks) = tabletop(result)? else { return Ok(()) };
    let abilities = Abilities::read()?;
    let sentences: Vec<&String> = tasks.keys().collect();
    let mut right = 0;
    for fold in 0..FOLDS {
        let of_fold = |at: usize| at % FOLDS == fold;
        let text = |wanted: bool| {
            let chosen = sentences.iter().enumerate().filter(|(at, _)| of_fold(*at) == wanted);
            format!(" {} ", chosen.map(|(_, text)| text.as_str()).collect::<Vec<_>>().join(" "))
        };
        let planner = Planner::with_lexicon(without_words_of(&text(true), &text(false))?);
        for sentence in sentences.iter().enumerate().filter(|(at, _)| of_fold(*at)).map(|(_, sentence)| *sentence) {
            let mut agrees = true;
            for task in tasks.get(sentence).into_iter().flatten() {
                let goal = libero::expected(task, &abilities)?;
                agrees &= match libero::read(&planner, &abilities, task)? {
                    Made::Read(facts) => libero::agrees(&facts, &goal),
                    Made::Unread(_) => false,
                };
            }
            right += usize::from(agrees);
            let values = [("right", f64::from(u8::from(agrees))), ("fold", fold as f64)];
            result.rows.push(Row { group: Some("libero".into()), ..Row::new(sentence.clone(), values) });
        }
    }
    result.figures.insert("libero_goal_right".into(), right as f64 / sentences.len().max(1) as f64);
    result.notes.push(
        "libero_goal_right: distinct instructions whose goals are the task's in all its scenes; each of five folds is read \
         without the everyday words for nouns that occur in no other fold. The grammar was written with all in view."
            .into(),
    );
    Ok(())
}

/// The lexicon without the everyday words that stand in `fold` and not in the `others`.
fn without_words_of(fold: &str, others: &str) -> anyhow::Result<Lexicon> {
    let lexicon = Lexicon::parse(&embedded_lexicon())?;
    let says = |text: &str, word: &str| text.contains(&format!(" {word} "));
    let only: BTreeSet<String> =
        lexicon.everyday_words().filter(|word| says(fold, word) && !says(others, word)).map(str::to_owned).collect();
    Ok(lexicon.without_words(&only))
}

/// The tasks by their instructions in lower case; none without the data.
fn tabletop(result: &mut BenchResult) -> anyhow::Result<Option<BTreeMap<String, Vec<Published>>>> {
    let path = match archive::find(TABLETOP) {
        Ok(path) => path,
        Err(reason) => {
            result.rows.push(Row::skipped(TABLETOP, reason));
            return Ok(None);
        }
    };
    let mut tasks: BTreeMap<String, Vec<Published>> = BTreeMap::new();
    for (file, text) in archive::texts(&path, ".bddl")? {
        let problem = Problem::parse(&text).with_context(|| file.clone())?;
        let task = Published::read(&|name| problem.section(name).to_vec()).with_context(|| file)?;
        tasks.entry(task.instruction.to_lowercase()).or_default().push(task);
    }
    Ok(Some(tasks))
}

/// Reads what people wrote of episodes in rooms that were not looked at.
///
/// # Errors
/// The data is there and not in its format.
pub fn measure_episodes(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let Some(episodes) = episodes(result)? else { return Ok(()) };
    let (planner, abilities) = (Planner::new()?, Abilities::read()?);
    let rooms = Rooms::collect(&episodes, &abilities, &planner)?;
    let wanted = args.episodes.unwrap_or(DESCRIPTIONS);
    let drawn = sample(&episodes, true, wanted);
    let mut counts: BTreeMap<(&str, Outcome), u32> = BTreeMap::new();
    for (episode, text) in &drawn {
        let (outcome, _) = alfred::score(&planner, &rooms, episode, text);
        *counts.entry((episode.task_type.as_str(), outcome)).or_default() += 1;
    }
    let kinds: BTreeSet<&str> = counts.keys().map(|(kind, _)| *kind).collect();
    let share = |kind: Option<&str>, outcome: Outcome| {
        let of = |(known, _): &(&str, Outcome)| kind.is_none_or(|kind| kind == *known);
        let all: u32 = counts.iter().filter(|(key, _)| of(key)).map(|(_, count)| count).sum();
        let with = counts.iter().filter(|(key, _)| of(key) && key.1 == outcome).map(|(_, count)| count).sum::<u32>();
        f64::from(with) / f64::from(all.max(1))
    };
    for kind in kinds.into_iter().map(Some).chain([None]) {
        let values = Outcome::ALL.map(|outcome| (outcome.name(), share(kind, outcome)));
        let name = kind.unwrap_or("all descriptions");
        result.rows.push(Row { group: Some("alfred".into()), ..Row::new(name, values) });
    }
    result.figures.insert("alfred_goal_right".into(), share(None, Outcome::Right));
    result.figures.insert("alfred_goal_silently_wrong".into(), share(None, Outcome::SilentlyWrong));
    result.figures.insert("alfred_goal_says_less".into(), share(None, Outcome::SaysLess));
    result.notes.push(format!(
        "alfred: {} descriptions, evenly spaced over those of every third floor plan. Silently wrong are those whose reading \
         contradicts the goal, or leaves out what the description names. Descriptions that say only a part of the goal, and \
         were read as they say it, are counted by themselves (alfred_goal_says_less): no reader can know the rest.",
        drawn.len()
    ));
    Ok(())
}

fn episodes(result: &mut BenchResult) -> anyhow::Result<Option<Vec<Episode>>> {
    let path = match archive::find(EPISODES) {
        Ok(path) => path,
        Err(reason) => {
            result.rows.push(Row::skipped(EPISODES, reason));
            return Ok(None);
        }
    };
    let text = BufReader::new(XzReader::new(BufReader::new(File::open(&path)?), false));
    let mut episodes = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let episode =
            serde_json::from_str(&line?).with_context(|| format!("{} line {}", path.display(), number + 1))?;
        episodes.push(episode);
    }
    Ok(Some(episodes))
}

/// Descriptions evenly spaced over the rooms that were held out, or over the others.
fn sample(episodes: &[Episode], held_out: bool, count: usize) -> Vec<(&Episode, &str)> {
    let chosen = episodes.iter().filter(|e| alfred::plan_number(&e.floor_plan).is_multiple_of(HELD_OUT) == held_out);
    let all: Vec<(&Episode, &str)> =
        chosen.flat_map(|e| e.anns.iter().map(move |annotation| (e, annotation.task_desc.trim()))).collect();
    let step = (all.len() / count.max(1)).max(1);
    all.into_iter().step_by(step).take(count).collect()
}

/// Which rules of language fire for one family of instructions only: the scenarios, each suite of them by itself, the
/// tabletop tasks, the episodes.
///
/// # Errors
/// The data is there and not in its format.
pub fn measure_rules(_args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let (Some(tasks), Some(episodes)) = (tabletop(result)?, episodes(result)?) else { return Ok(()) };
    let (planner, abilities) = (Planner::new()?, Abilities::read()?);
    let suites: Vec<(String, Vec<String>)> =
        Scenario::suites().into_iter().map(|suite| (suite.clone(), Scenario::suite(&suite))).collect();
    let alone = ("scenarios".to_owned(), Scenario::names());
    let mut families: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let library = acm_memory::whole_library()?;
    for (family, names) in suites.iter().chain([&alone]) {
        for name in names {
            let scenario = Scenario::open(name)?;
            for text in scenario.paraphrases().iter().map(String::as_str).chain([scenario.instruction()]) {
                let fired = planner.rules(text, &library).with_context(|| format!("scenario {name}: {text}"))?;
                families.entry(family).or_default().extend(fired);
            }
        }
    }
    for task in tasks.values().flatten() {
        let library = libero::library(&planner, &abilities, task)?;
        families.entry("libero").or_default().extend(planner.rules(&task.instruction, &library).unwrap_or_default());
    }
    let rooms = Rooms::collect(&episodes, &abilities, &planner)?;
    for (episode, text) in sample(&episodes, false, RULE_SAMPLE) {
        let fired = rooms.library(episode).map(|library| planner.rules(text, library));
        families.entry("alfred").or_default().extend(fired.and_then(Result::ok).unwrap_or_default());
    }
    let all: BTreeSet<&String> = families.values().flatten().collect();
    let mut single = 0;
    for rule in &all {
        let fires: Vec<&str> =
            families.iter().filter(|(_, rules)| rules.contains(*rule)).map(|(name, _)| *name).collect();
        let alone = fires.len() == 1;
        single += usize::from(alone);
        let row = Row::new(format!("{rule} ({})", fires.join(", ")), [("families", fires.len() as f64)]);
        result.rows.push(Row { group: Some("rules".into()), ..row });
    }
    result.figures.insert("single_family_rules_fraction".into(), single as f64 / all.len().max(1) as f64);
    Ok(())
}
