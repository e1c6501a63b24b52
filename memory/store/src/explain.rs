//! Why each hit ranked where it did, and which filter dropped each near miss. Slow on purpose: it looks at every object.

use crate::{
    Id, Nanos, State,
    block::{self, LEAST},
    event::Sure,
    execute,
    query::{self, Answer, Filter, Hit, Query},
};
use serde::Serialize;

/// The whole story of one answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explanation {
    /// What drove the search.
    pub plan: String,
    /// Objects that are there.
    pub objects: usize,
    /// Each filter with how many objects it dropped that passed those before it, and how many were left.
    pub filters: Vec<FilterCount>,
    /// Hits with the terms of their scores.
    pub hits: Vec<Ranked>,
    /// The best of those that one filter alone dropped.
    pub near_misses: Vec<NearMiss>,
    /// Objects that the fast path scored.
    pub scored: u32,
    /// Blocks that it looked into.
    pub blocks: u32,
}

/// What one filter did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilterCount {
    /// The filter.
    pub filter: String,
    /// Objects that it dropped.
    pub dropped: usize,
    /// Objects that were left.
    pub left: usize,
}

/// A hit with its terms.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranked {
    /// The object.
    pub id: Id,
    /// The product of the terms.
    pub score: f32,
    /// The terms by name.
    pub terms: Vec<(&'static str, f32)>,
}

/// An object that one filter alone dropped.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NearMiss {
    /// The object.
    pub id: Id,
    /// What it would have scored.
    pub score: f32,
    /// The filter.
    pub filter: String,
}

/// Explains the answer to a query about the present.
pub fn explain(state: &State, query: &Query) -> Explanation {
    let query = &Query { when: None, ..query.clone() };
    let filters = Filter::of(query, state);
    let answer = execute::answer(state, query);
    let mut dropped = vec![0usize; filters.len()];
    let mut misses: Vec<(f32, Id, usize)> = Vec::new();
    for block in state.table.blocks.iter() {
        let hot = block.hot.get();
        for row in block::rows(hot.live) {
            let mut failed = filters.iter().enumerate().filter(|(_, filter)| !filter.passes(state, block, row));
            let (first, second) = (failed.next(), failed.next());
            if let Some((number, _)) = first {
                dropped[number] += 1;
                if second.is_none() {
                    let symbols = &state.symbols;
                    let success = query.success_term(|template| block.bits.has(symbols.bit(template, false), row));
                    misses.push((query.score(block.position(row), hot.weight[row]) + success, hot.id[row], number));
                }
            }
        }
    }
    misses.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    misses.truncate(query.wanted());
    let mut left = state.table.live;
    let describe = |filter: &Filter| filter.describe(state);
    let counts = filters.iter().zip(&dropped).map(|(filter, dropped)| {
        left -= dropped;
        FilterCount { filter: describe(filter), dropped: *dropped, left }
    });
    let counts = counts.collect();
    let near_misses = misses.into_iter().filter_map(|(score, id, number)| {
        Some(NearMiss { id, score: score.max(LEAST * 8.0).exp(), filter: describe(filters.get(number)?) })
    });
    Explanation {
        plan: execute::plan(state, query, &filters).describe(),
        objects: state.table.live,
        filters: counts,
        hits: answer.hits.iter().map(|hit| ranked(state, query, hit)).collect(),
        near_misses: near_misses.collect(),
        scored: answer.scored,
        blocks: answer.blocks,
    }
}

fn ranked(state: &State, query: &Query, hit: &Hit) -> Ranked {
    let mut terms = Vec::new();
    if let Some((block, row)) = state.row(hit.id).and_then(|row| state.table.at(row)) {
        terms.push(("confidence", block.hot.get().weight[row].exp()));
        if let Some(near) = &query.near {
            let distance = query::distance(block.position(row), near.at);
            terms.push(("near", (-distance / near.scale_m.max(1e-6)).exp()));
        }
        if !query.success.is_empty() {
            let symbols = &state.symbols;
            let success = query.success_term(|template| block.bits.has(symbols.bit(template, false), row));
            terms.push(("success", success.exp()));
        }
    }
    Ranked { id: hit.id, score: hit.score, terms }
}

/// Answers a query about the past: every object as it was at one moment, from what was known at another. Parts,
/// relations and numbers are those of the present.
pub fn answer_as_of(state: &State, query: &Query) -> Answer {
    let (valid, known) = query.when.unwrap_or((Nanos::MAX, Nanos::MAX));
    let categories = query.all_categories(state);
    let rest: Vec<Filter> = Filter::of(
        &Query { related: query.related.clone(), numbers: query.numbers.clone(), ..Query::default() },
        state,
    );
    let mut answer = Answer::default();
    let mut found: Vec<(f32, Id)> = Vec::new();
    let pages = state.pages.len() as Id * block::ROWS as Id;
    for id in (0..pages).filter(|id| state.head(*id).is_some()) {
        let Some(past) = state.as_of(id, valid, known).filter(|past| past.there) else { continue };
        let parts = state.parts(id);
        let holds = |(word, yes): &(crate::Symbol, bool)| {
            state.sure_as_of(id, *word, valid, known) == if *yes { Sure::Yes } else { Sure::No }
        };
        let passes = (categories.is_empty() || categories.binary_search(&past.category).is_ok())
            && query.region.is_none_or(|region| region == past.region)
            && query.templates.iter().all(|template| parts.iter().any(|part| part.template == *template))
            && query.affordances.iter().all(|word| {
                let row = state.row(id).and_then(|row| state.table.at(row));
                row.is_some_and(|(block, row)| block.bits.has(state.symbols.bit(*word, false), row))
            })
            && query.states.iter().all(holds)
            && query.min_confidence.is_none_or(|least| past.confidence >= least)
            && !query.exclude.contains(&id)
            && query.near.is_none_or(|near| near.within_m.is_none_or(|m| query::distance(past.position, near.at) <= m))
            && rest.iter().all(|filter| {
                let row = state.row(id).and_then(|row| state.table.at(row));
                row.is_some_and(|(block, row)| filter.passes(state, block, row))
            });
        if passes {
            answer.scored += 1;
            let success = query.success_term(|template| parts.iter().any(|part| part.template == template));
            found.push((query.score(past.position, crate::table::weight(past.confidence)) + success, id));
        }
    }
    found.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    found.truncate(query.wanted());
    answer.hits = found.into_iter().map(|(score, id)| Hit { id, score: score.max(LEAST * 8.0).exp() }).collect();
    answer
}
