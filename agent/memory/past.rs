//! The past of an object, and everything as of a moment.

use super::object;
use crate::cli::memory::AtArgs;
use acm_concept::time::Time;
use acm_memory::{entry::Moment, moment, open_store, store_time};
use acm_store::{
    State,
    event::Sure,
    history::{self, Change, FIRST},
};
use anyhow::Context;
use serde_json::json;
use std::path::Path;

/// Prints what changed of an object, in the order in which it came to be known.
pub fn history(dir: &Path, text: &str, as_json: bool) -> anyhow::Result<()> {
    let mut store = open_store(dir)?;
    let state = store.view();
    let id = object(text)?;
    let (heads, at) = state.head(id).with_context(|| format!("{text} was never in this memory"))?;
    let changes = state.history.changes(heads.of[at].last);
    if as_json {
        println!(
            "{}",
            json!({"schema": "acm.memory-history/1", "object": text, "born_ns": heads.of[at].born, "changes": changes})
        );
        return Ok(());
    }
    println!("{text} is known since {}", when(heads.of[at].born));
    for change in &changes {
        println!("  {:<14} known {:<14} {}", when(change.valid), when(change.known), what(&state, change));
    }
    if changes.is_empty() {
        println!("  nothing of it has changed since");
    }
    Ok(())
}

/// Prints all objects that were there.
pub fn at(args: &AtArgs) -> anyhow::Result<()> {
    let mut store = open_store(&args.dir)?;
    let state = store.view();
    let valid = parse(&args.valid)?;
    let known = args.known.as_deref().map_or(Ok(u64::MAX), parse)?;
    let pages = (state.pages.len() * acm_store::block::ROWS) as u32;
    let there = (0..pages).filter_map(|id| Some((id, state.as_of(id, valid, known).filter(|past| past.there)?)));
    let mut count = 0;
    for (id, past) in there {
        count += 1;
        let [x, y, z] = past.position;
        let category = state.symbols.word(past.category);
        if args.json {
            let told = json!({
                "schema": "acm.memory-at/1", "object": format!("O{id}"), "category": category,
                "position_m": past.position, "confidence": past.confidence,
            });
            println!("{told}");
        } else {
            println!("O{id:<5} {category:<16} ({x:.3}, {y:.3}, {z:.3}) {:.2}", past.confidence);
        }
    }
    if count == 0 && !args.json {
        println!("nothing was known to be there");
    }
    Ok(())
}

pub(super) fn parse(text: &str) -> anyhow::Result<u64> {
    let wrong = || format!("`{text}` is no moment: write the run's number and seconds in it, as in 2:31.5");
    let (episode, seconds) = text.split_once(':').with_context(wrong)?;
    let seconds: f64 = seconds.parse().with_context(wrong)?;
    let moment = Moment { episode: episode.parse().with_context(wrong)?, time: Time::from_seconds(seconds) };
    store_time(moment).map_err(anyhow::Error::msg)
}

fn when(ns: u64) -> String {
    let moment = moment(ns);
    format!("run {} {}", moment.episode, moment.time)
}

fn what(state: &State, change: &Change) -> String {
    let word = |symbol: u32| state.symbols.word(symbol as u16);
    let value = change.value;
    let said = match change.key {
        history::POSITION => {
            let [x, y, z] = history::position(value);
            format!("at ({x:.3}, {y:.3}, {z:.3})")
        }
        history::ROTATION => {
            let [x, y, z] = history::position(value);
            format!("turned to ({x:.3}, {y:.3}, {z:.3}, w)")
        }
        history::REGION => format!("in {}", word(value[0])),
        history::CATEGORY => format!("a {}", word(value[0])),
        history::CONFIDENCE => format!("sure to {:.2}", f32::from_bits(value[0]).exp()),
        history::THERE => if value[0] == 0 { "dropped" } else { "put" }.into(),
        key => {
            let name = word(u32::from(key - FIRST));
            match state.symbols.kind(key - FIRST) {
                Some(acm_store::Kind::Fluent) => {
                    format!("{name} = {}", f64::from_bits(u64::from(value[0]) | u64::from(value[1]) << 32))
                }
                Some(acm_store::Kind::Relation) => format!("{}{name} O{}", sign(value), value[1]),
                _ => format!("{}{name}", sign(value)),
            }
        }
    };
    format!("{said}, says {}", source(state, change))
}

fn sign(value: [u32; 3]) -> &'static str {
    match history::sure(value) {
        Sure::Yes => "",
        Sure::No => "not ",
        Sure::Unknown => "no longer known: ",
    }
}

fn source(state: &State, change: &Change) -> String {
    let (source, confidence) = change.origin;
    format!("{} ({confidence:.2})", state.symbols.word(source.into()))
}
