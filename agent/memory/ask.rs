//! Questions on the command line.

use super::{line, object};
use crate::cli::memory::QueryArgs;
use acm_memory::open_store;
use acm_store::{
    Kind, Query, State, Symbol, execute,
    explain::explain as explained,
    query::{Near, Related},
};
use anyhow::{Context, bail};
use serde_json::json;

/// Prints the hits.
pub fn query(args: &QueryArgs) -> anyhow::Result<()> {
    let mut store = open_store(&args.dir)?;
    let state = store.view();
    let answer = execute::answer(&state, &parse(&state, args)?);
    if args.json {
        println!("{}", json!({"schema": "acm.memory-query/1", "answer": answer}));
        return Ok(());
    }
    for hit in &answer.hits {
        println!("{:.4}  {}", hit.score, line(&state, hit.id));
    }
    println!("{} hits; {} objects were scored, {} blocks looked into", answer.hits.len(), answer.scored, answer.blocks);
    Ok(())
}

/// Prints why.
pub fn explain(args: &QueryArgs) -> anyhow::Result<()> {
    let mut store = open_store(&args.dir)?;
    let state = store.view();
    let told = explained(&state, &parse(&state, args)?);
    if args.json {
        println!("{}", json!({"schema": "acm.memory-explain/1", "explanation": told}));
        return Ok(());
    }
    println!("led by {}", told.plan);
    println!("{} objects", told.objects);
    for filter in &told.filters {
        println!("  {:<32} drops {:>7}, leaves {:>7}", filter.filter, filter.dropped, filter.left);
    }
    for (rank, hit) in told.hits.iter().enumerate() {
        let terms: Vec<String> = hit.terms.iter().map(|(name, value)| format!("{name} {value:.3}")).collect();
        println!("{:>3}. {:.4} = {:<40} {}", rank + 1, hit.score, terms.join(" x "), line(&state, hit.id));
    }
    for miss in &told.near_misses {
        println!(
            "near miss: {} alone drops {}, which would score {:.4}",
            miss.filter,
            line(&state, miss.id),
            miss.score
        );
    }
    Ok(())
}

/// The number of a word.
pub fn word(state: &State, kind: Kind, word: &str) -> anyhow::Result<Symbol> {
    if let Some(symbol) = state.symbols.find(kind, word) {
        return Ok(symbol);
    }
    let known: Vec<&str> = state.symbols.of_kind(kind).map(|(_, word)| word).collect();
    bail!(
        "this memory knows no {} `{word}`; it knows: {}",
        kind.word(),
        if known.is_empty() { "none".into() } else { known.join(", ") }
    )
}

fn parse(state: &State, args: &QueryArgs) -> anyhow::Result<Query> {
    let words = |kind: Kind, words: &[String]| -> anyhow::Result<Vec<Symbol>> {
        words.iter().map(|text| word(state, kind, text)).collect()
    };
    let near = args.near.as_deref().map(|text| -> anyhow::Result<Near> {
        let numbers: Vec<f32> = text
            .split(',')
            .map(|n| n.trim().parse())
            .collect::<Result<_, _>>()
            .with_context(|| format!("`{text}` is no place: write three numbers in metres, as in 0.1,-0.2,0"))?;
        let at: [f32; 3] = numbers.try_into().map_err(|_count: Vec<f32>| {
            anyhow::anyhow!("`{text}` is no place: write three numbers in metres, as in 0.1,-0.2,0")
        })?;
        Ok(Near { at, scale_m: 0.3, within_m: args.within })
    });
    let states = args.state.iter().map(|text| match text.strip_prefix("not:") {
        Some(rest) => Ok((word(state, Kind::State, rest)?, false)),
        None => Ok((word(state, Kind::State, text)?, true)),
    });
    let related = args.related.iter().map(|text| -> anyhow::Result<Related> {
        let (name, other) = text.split_once(':').with_context(|| format!("`{text}` is no relation: write on:O3"))?;
        let (name, closure) = name.strip_suffix('*').map_or((name, false), |name| (name, true));
        Ok(Related { relation: word(state, Kind::Relation, name)?, object: object(other)?, closure })
    });
    let numbers = args.number.iter().map(|text| -> anyhow::Result<(Symbol, f64, f64)> {
        let wrong = || format!("`{text}` is no bound: write opening:0.1..0.5");
        let (name, range) = text.split_once(':').with_context(wrong)?;
        let (low, high) = range.split_once("..").with_context(wrong)?;
        Ok((word(state, Kind::Fluent, name)?, low.parse().with_context(wrong)?, high.parse().with_context(wrong)?))
    });
    Ok(Query {
        categories: words(Kind::Category, &args.category)?,
        templates: words(Kind::Template, &args.template)?,
        affordances: words(Kind::Affordance, &args.affordance)?,
        states: states.collect::<anyhow::Result<_>>()?,
        region: args.region.as_deref().map(|text| word(state, Kind::Region, text)).transpose()?,
        near: near.transpose()?,
        related: related.collect::<anyhow::Result<_>>()?,
        numbers: numbers.collect::<anyhow::Result<_>>()?,
        min_confidence: args.min_confidence,
        most: args.most,
        ..Query::default()
    })
}
