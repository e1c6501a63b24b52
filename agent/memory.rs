//! `acm memory`: asks, checks, exports and forgets what a memory folder holds.
//!
//! | module | holds |
//! |---|---|
//! | [`ask`] | words of the command line as a query; hits and explanations as text |
//! | [`skills`] | what skills rest on |
//! | [`past`] | histories, and everything as of a moment |
//! | [`export`] | JSON lines, SQL, PDDL, spark_dsg |
//! | [`picture`] | the scene graph as SVG |

pub mod ask;
pub mod export;
pub mod past;
pub mod picture;
pub mod skills;

use crate::cli::{
    Exit,
    memory::{ForgetArgs, MemoryCommand},
};
use acm_concept::ids::ObjectId;
use acm_memory::{AcmMemory, MemoryError, Policy, narrow, open_store, whole_library};
use acm_store::{Id, Kind, Op, State, event::Sure};
use anyhow::Context;
use serde_json::json;
use std::{collections::BTreeSet, path::Path, sync::Arc};

/// Runs `acm memory`.
pub fn run(command: &MemoryCommand) -> anyhow::Result<Exit> {
    match command {
        MemoryCommand::Stats { dir, json } => stats(dir, *json)?,
        MemoryCommand::Query(args) => ask::query(args)?,
        MemoryCommand::Explain(args) => ask::explain(args)?,
        MemoryCommand::History { dir, object, json } => past::history(dir, object, *json)?,
        MemoryCommand::Skills { dir, skill, json } => skills::print(dir, skill.as_deref(), *json)?,
        MemoryCommand::At(args) => past::at(args)?,
        MemoryCommand::Forget(args) => forget(args)?,
        MemoryCommand::Merge { dir, kept, gone } => {
            let (kept, gone): (ObjectId, ObjectId) = (kept.parse()?, gone.parse()?);
            let number = opened(dir)?.merge(kept, gone)?;
            println!("{gone} is {kept}: merge {number}, which `acm memory undo` undoes");
        }
        MemoryCommand::Split { dir, object, since } => {
            let from: ObjectId = object.parse()?;
            let (number, new) = opened(dir)?.split(from, acm_memory::moment(past::parse(since)?))?;
            println!("{from} was {new} since then: split {number}, which `acm memory undo` undoes");
        }
        MemoryCommand::Undo { dir, number } => {
            opened(dir)?.undo_regrouping(*number)?;
            println!("{number} is undone");
        }
        MemoryCommand::Compact { dir, keep_runs } => compact(dir, *keep_runs)?,
        MemoryCommand::Verify { dir } => verify(dir)?,
        MemoryCommand::Export { dir, format, out } => export::run(dir, *format, out)?,
    }
    Ok(Exit::Success)
}

/// An object's id from its readable form.
fn object(text: &str) -> anyhow::Result<Id> {
    let id: ObjectId = text.parse()?;
    narrow(id).with_context(|| format!("{id} is larger than any id that is given"))
}

fn stats(dir: &Path, as_json: bool) -> anyhow::Result<()> {
    let mut store = open_store(dir)?;
    let disk = store.disk_bytes()?;
    let state = store.view();
    let bytes = state.bytes();
    let words: serde_json::Map<String, serde_json::Value> =
        Kind::ALL.into_iter().map(|kind| (kind.word().into(), state.symbols.of_kind(kind).count().into())).collect();
    let told = json!({
        "schema": "acm.memory-stats/2", "objects": state.table.live, "events": state.next,
        "changes": state.history.len(), "relations": state.relations.forth.iter().count(),
        "words": words, "bytes": {"disk": disk, "hot": bytes.hot, "parts": bytes.parts, "history": bytes.history},
    });
    if as_json {
        println!("{told}");
        return Ok(());
    }
    println!(
        "{} objects from {} events; {} changes, {} relations",
        told["objects"], told["events"], told["changes"], told["relations"]
    );
    println!(
        "{disk} bytes on disk; in memory {} hot, {} of parts, {} of history",
        bytes.hot, bytes.parts, bytes.history
    );
    for id in state.ids() {
        println!("  {}", line(&state, id));
    }
    Ok(())
}

/// One object in a line.
pub(crate) fn line(state: &State, id: Id) -> String {
    let Some(object) = state.object(id) else { return format!("O{id} is not there") };
    let [x, y, z] = object.position;
    let word = |symbol| state.symbols.word(symbol);
    let states: Vec<&str> = object.states.iter().map(|state| word(*state)).collect();
    let related = state.relations.of(id).filter(acm_store::relation::Edge::holds);
    let related: Vec<String> = related.map(|edge| format!("{} O{}", word(edge.relation), edge.object)).collect();
    let place = if object.region == 0 { String::new() } else { format!(" in {}", word(object.region)) };
    let states = [states.join(" "), related.join(" ")].join(" ");
    format!(
        "O{id:<5} {:<16} ({x:.3}, {y:.3}, {z:.3}){place} {:.2} {}",
        word(object.category),
        object.confidence,
        states.trim()
    )
}

fn forget(args: &ForgetArgs) -> anyhow::Result<()> {
    let mut store = open_store(&args.dir)?;
    let find = |state: &State, kind: Kind, words: &[String]| -> anyhow::Result<Vec<u16>> {
        words.iter().map(|word| ask::word(state, kind, word)).collect()
    };
    let (regions, sources) =
        (find(store.state(), Kind::Region, &args.region)?, find(store.state(), Kind::Source, &args.source)?);
    let mut gone: BTreeSet<Id> = args.object.iter().map(|text| object(text)).collect::<anyhow::Result<_>>()?;
    let policy = Policy { older_than_runs: args.older_than, keep_most: args.keep, below_confidence: args.below };
    if gone.is_empty() && regions.is_empty() && sources.is_empty() && policy == Policy::default() {
        anyhow::bail!(
            "nothing is named that should be forgotten: use --object, --region, --source, --older-than, --keep or --below"
        );
    }
    // A memory's beliefs are whole objects: one of which a source spoke goes with all that is known of it.
    for (_, event) in store.events()? {
        let named = event.source > 0 && sources.contains(&event.source);
        let placed = event.ops.iter().any(|op| match op {
            Op::Put(object) => regions.contains(&object.region),
            Op::Region(_, region) => regions.contains(region),
            _ => false,
        });
        if named || placed {
            gone.extend(event.ops.iter().flat_map(Op::subjects).flatten());
        }
    }
    drop(store);
    let mut memory = AcmMemory::open(&args.dir, Arc::new(whole_library()?))?;
    let mut objects: BTreeSet<ObjectId> = gone.iter().map(|id| ObjectId(u64::from(*id))).collect();
    objects.extend(memory.due(&policy));
    let objects: Vec<ObjectId> = objects.into_iter().collect();
    if !args.dry_run {
        memory.erase(&objects)?;
    }
    let names: Vec<String> = objects.iter().map(ToString::to_string).collect();
    let done = if args.dry_run { "would be forgotten" } else { "forgotten" };
    println!("{done}: {}", if names.is_empty() { "nothing was there".into() } else { names.join(" ") });
    Ok(())
}

/// The memory of a folder that is there already.
fn opened(dir: &Path) -> anyhow::Result<AcmMemory> {
    if !dir.join(acm_store::manifest::NAME).is_file() {
        return Err(MemoryError::Missing { path: dir.into() }.into());
    }
    Ok(AcmMemory::open(dir, Arc::new(whole_library()?))?)
}

fn compact(dir: &Path, keep_runs: u32) -> anyhow::Result<()> {
    let mut memory = opened(dir)?;
    let done = memory.compact(keep_runs)?;
    println!("{} events in {} bytes, before {} in {}", done.events.1, done.bytes.1, done.events.0, done.bytes.0);
    Ok(())
}

fn verify(dir: &Path) -> anyhow::Result<()> {
    let mut store = open_store(dir)?;
    let events = store.events()?;
    let mut twin = State::default();
    let mut batch = Vec::new();
    let mut known = None;
    let take = |twin: &mut State, batch: &mut Vec<acm_store::Event>, time: u64| -> anyhow::Result<()> {
        twin.check(batch, time).map_err(anyhow::Error::msg)?;
        batch.drain(..).for_each(|event| twin.apply(&event, time));
        twin.commit(time);
        Ok(())
    };
    for (time, event) in events {
        if let Some(known) = known.filter(|known| *known != time) {
            take(&mut twin, &mut batch, known)?;
        }
        known = Some(time);
        batch.push(event);
    }
    if let Some(known) = known {
        take(&mut twin, &mut batch, known)?;
    }
    let state = store.state();
    let same = state.ids().eq(twin.ids()) && state.ids().all(|id| same_object(state, &twin, id));
    if !same || state.next != twin.next {
        anyhow::bail!(
            "{}: the columns are not what the log adds up to; remove the snapshot and its line in FORMAT",
            dir.display()
        );
    }
    println!(
        "{} events, {} objects: every checksum is right and the columns are what the log adds up to",
        state.next, state.table.live
    );
    Ok(())
}

fn same_object(a: &State, b: &State, id: Id) -> bool {
    let sures = |state: &State| -> Vec<Sure> {
        state.symbols.of_kind(Kind::State).map(|(symbol, _)| state.sure(id, symbol)).collect()
    };
    a.object(id) == b.object(id) && sures(a) == sures(b)
}
