//! Answers queries: the shortest list that must hold all hits drives, bitsets and columns drop, and a block whose bound
//! is below what was found already is passed over.

use crate::{
    Id, NONE, State,
    block::{self, Block, Bounds, LEAST, Mask, ROWS},
    query::{Answer, Filter, Hit, Query},
    table::{GROUP, Span},
};

/// What leads to the candidates. The counts are exact.
#[derive(Debug, Clone, PartialEq)]
pub enum Plan {
    /// The runs of some regions and categories.
    Spans(Vec<Span>),
    /// A list of objects.
    List(Vec<Id>),
    /// Groups of blocks, nearest first.
    Nearest,
    /// Blocks, largest weight first.
    Heaviest,
    /// A word that nothing ever had: no object can be a hit.
    Nothing,
}

impl Plan {
    /// For people.
    pub fn describe(&self) -> String {
        match self {
            Plan::Spans(spans) => {
                let rows: u32 = spans.iter().map(|span| span.end - span.first).sum();
                format!("{} runs of region and category, {rows} rows", spans.len())
            }
            Plan::List(ids) => format!("a list of {} related objects", ids.len()),
            Plan::Nearest => "all blocks, nearest first".into(),
            Plan::Heaviest => "all blocks, most confident first".into(),
            Plan::Nothing => "nothing has one of the words".into(),
        }
    }
}

/// The plan for a query.
pub fn plan(state: &State, query: &Query, filters: &[Filter]) -> Plan {
    if filters.iter().any(|filter| matches!(filter, Filter::Set(_, _, 0))) {
        return Plan::Nothing;
    }
    let table = &state.table;
    let categories = filters.iter().find_map(|filter| match filter {
        Filter::Category(all) => Some(all),
        _ => None,
    });
    let spans: Option<Vec<Span>> = match (categories, query.region) {
        (Some(all), Some(region)) => {
            Some(all.iter().filter_map(|category| table.span(region, *category)).copied().collect())
        }
        (Some(all), None) => Some(all.iter().flat_map(|category| table.of_category(*category)).copied().collect()),
        (None, Some(region)) => Some(table.of_region(region).to_vec()),
        (None, None) => None,
    };
    let rows =
        spans.as_ref().map_or(table.live, |spans| spans.iter().map(|span| (span.end - span.first) as usize).sum());
    let lists = filters.iter().filter_map(|filter| match filter {
        Filter::OneOf(_, ids) => Some(ids),
        _ => None,
    });
    let shortest = lists.min_by_key(|ids| ids.len()).filter(|ids| ids.len() <= rows);
    match (shortest, spans) {
        (Some(ids), _) => Plan::List(ids.clone()),
        (None, Some(spans)) => Plan::Spans(spans),
        (None, None) if query.near.is_some() => Plan::Nearest,
        (None, None) => Plan::Heaviest,
    }
}

/// Answers a query.
pub fn answer(state: &State, query: &Query) -> Answer {
    let filters = Filter::of(query, state);
    if query.when.is_some() {
        return crate::explain::answer_as_of(state, query);
    }
    let plan = plan(state, query, &filters);
    let mut search = Search::new(state, query, &filters, &plan);
    match &plan {
        Plan::Nothing => {}
        Plan::List(ids) => {
            for id in ids {
                if let Some(row) = state.row(*id)
                    && let Some((block, at)) = state.table.at(row)
                {
                    search.block(block, block::span(at, at + 1), true);
                }
            }
        }
        Plan::Spans(spans) => {
            search.spans(spans);
            search.fresh();
        }
        Plan::Nearest => {
            search.fresh();
            search.nearest();
        }
        Plan::Heaviest => {
            search.fresh();
            search.heaviest();
        }
    }
    search.finish()
}

struct Search<'s> {
    state: &'s State,
    query: &'s Query,
    /// Sets that all hits are in.
    sets: Vec<u16>,
    /// Filters that the plan does not settle, tried row by row.
    rest: Vec<&'s Filter>,
    /// Those that the plan settles for rows of the base, tried on fresh rows.
    settled: Vec<&'s Filter>,
    /// Blocks of the base that may hold a hit, where the whole base is looked at.
    candidates: Vec<u64>,
    found: Vec<(f32, Id)>,
    most: usize,
    /// Below this nothing is taken any more.
    least: f32,
    success: f32,
    scored: u32,
    blocks: u32,
}

impl<'s> Search<'s> {
    fn new(state: &'s State, query: &'s Query, filters: &'s [Filter], plan: &Plan) -> Search<'s> {
        let by_plan = |filter: &&Filter| {
            matches!(filter, Filter::Category(_) | Filter::Region(_)) && matches!(plan, Plan::Spans(_))
        };
        let is_set = |filter: &&Filter| matches!(filter, Filter::Set(..));
        let sets = filters.iter().filter_map(|filter| match filter {
            Filter::Set(_, _, set) => Some(*set),
            _ => None,
        });
        let most = query.wanted();
        let best = query.success.iter().map(|(_, chance)| *chance).fold(1e-6f32, f32::max).ln();
        let sets: Vec<u16> = sets.collect();
        let whole = matches!(plan, Plan::Nearest | Plan::Heaviest);
        Search {
            state,
            query,
            candidates: if whole { state.table.candidates(&sets) } else { Vec::new() },
            sets,
            rest: filters.iter().filter(|filter| !by_plan(filter) && !is_set(filter)).collect(),
            settled: filters.iter().filter(by_plan).collect(),
            found: Vec::with_capacity(most.min(64) + 1),
            most,
            least: f32::NEG_INFINITY,
            success: if query.success.is_empty() { 0.0 } else { best },
            scored: 0,
            blocks: 0,
        }
    }
    /// What the best of a block could score.
    #[inline]
    fn bound(&self, bounds: &Bounds) -> f32 {
        let near = match &self.query.near {
            Some(near) => {
                let distance = bounds.distance(near.at);
                if near.within_m.is_some_and(|within| distance > within) {
                    return f32::NEG_INFINITY;
                }
                bounds.weight - distance / near.scale_m.max(1e-6)
            }
            None => bounds.weight,
        };
        near + self.success
    }
    #[inline]
    fn block(&mut self, block: &Block, mut mask: Mask, fresh: bool) {
        let hot = block.hot.get();
        self.blocks += 1;
        mask = block::and(mask, hot.live);
        for set in &self.sets {
            mask = block::and(mask, block.bits.get(*set));
        }
        for row in block::rows(mask) {
            let settled = !fresh || self.settled.iter().all(|filter| filter.passes(self.state, block, row));
            if !settled || !self.rest.iter().all(|filter| filter.passes(self.state, block, row)) {
                continue;
            }
            let row = row % ROWS;
            self.scored += 1;
            let mut score = self.query.score([hot.x[row], hot.y[row], hot.z[row]], hot.weight[row]);
            if !self.query.success.is_empty() {
                let symbols = &self.state.symbols;
                score += self.query.success_term(|template| block.bits.has(symbols.bit(template, false), row));
            }
            if score >= self.least {
                self.offer(score, hot.id[row]);
            }
        }
    }
    fn offer(&mut self, score: f32, id: Id) {
        if id == NONE {
            return;
        }
        let place = self.found.partition_point(|other| other.0 > score || other.0 == score && other.1 < id);
        if place >= self.most {
            return;
        }
        self.found.insert(place, (score, id));
        self.found.truncate(self.most);
        if self.found.len() == self.most
            && let Some(last) = self.found.last()
        {
            self.least = last.0;
        }
    }
    fn spans(&mut self, spans: &[Span]) {
        let state = self.state;
        let rows: usize = spans.iter().map(|span| (span.end - span.first) as usize).sum();
        let parts = spans.iter().flat_map(|span| {
            let (first, end) = (span.first as usize, span.end as usize);
            (first / ROWS..end.div_ceil(ROWS)).map(move |number| {
                let begin = number * ROWS;
                (number, block::span(first.saturating_sub(begin), end - begin))
            })
        });
        if rows > 8 * ROWS {
            // Worth an order: the best bounds first, so that most blocks are passed over.
            let with_bound = |(number, mask): (usize, Mask)| {
                let block = state.table.blocks.get(number)?;
                Some((self.bound(&block.hot.get().bounds), number, mask))
            };
            let mut ordered: Vec<(f32, usize, Mask)> = parts.filter_map(with_bound).collect();
            ordered.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            for (bound, number, mask) in ordered {
                if bound < self.least || bound == f32::NEG_INFINITY {
                    break;
                }
                if let Some(block) = state.table.blocks.get(number) {
                    self.block(block, mask, false);
                }
            }
            return;
        }
        for (number, mask) in parts {
            if let Some(block) = state.table.blocks.get(number)
                && self.is_worth(block)
            {
                self.block(block, mask, false);
            }
        }
    }
    #[inline]
    fn is_worth(&self, block: &Block) -> bool {
        let bound = self.bound(&block.hot.get().bounds);
        bound >= self.least && bound > f32::NEG_INFINITY
    }
    fn whole(&mut self, number: usize, fresh: bool) {
        if !fresh && self.candidates.get(number / 64).is_some_and(|word| word >> (number % 64) & 1 == 0) {
            return;
        }
        if let Some(block) = self.state.table.blocks.get(number)
            && self.is_worth(block)
        {
            self.block(block, [u64::MAX; 4], fresh);
        }
    }
    fn fresh(&mut self) {
        for number in self.state.table.base..self.state.table.blocks.len() {
            self.whole(number, true);
        }
    }
    fn nearest(&mut self) {
        let state = self.state;
        let mut groups: Vec<(f32, usize)> =
            state.table.groups.iter().enumerate().map(|(number, bounds)| (self.bound(bounds), number)).collect();
        groups.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        let mut blocks: Vec<(f32, usize)> = Vec::with_capacity(GROUP);
        for (bound, group) in groups {
            if bound < self.least || bound == f32::NEG_INFINITY {
                break;
            }
            blocks.clear();
            // A group has as many blocks as a word has bits.
            let mut word = self.candidates.get(group).copied().unwrap_or(0);
            while word != 0 {
                let number = group * GROUP + word.trailing_zeros() as usize;
                word &= word - 1;
                if let Some(block) = state.table.blocks.get(number) {
                    blocks.push((self.bound(&block.hot.get().bounds), number));
                }
            }
            blocks.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
            for (_, number) in &blocks {
                self.whole(*number, false);
            }
        }
    }
    fn heaviest(&mut self) {
        let state = self.state;
        for number in state.table.risen.iter() {
            self.whole(*number as usize, false);
        }
        for number in state.table.order.iter().map(|number| *number as usize) {
            let there = self.candidates.get(number / 64).is_some_and(|word| word >> (number % 64) & 1 == 1);
            if !there || state.table.risen.contains(&(number as u32)) {
                continue;
            }
            let Some(block) = state.table.blocks.get(number) else { continue };
            let bound = block.hot.get().bounds.weight + self.success;
            if bound < self.least {
                break;
            }
            self.block(block, [u64::MAX; 4], false);
        }
    }
    fn finish(self) -> Answer {
        let hits = self
            .found
            .iter()
            .map(|(score, id)| Hit { id: *id, score: score.max(LEAST * 8.0).exp().max(f32::MIN_POSITIVE) });
        Answer { hits: hits.collect(), scored: self.scored, blocks: self.blocks }
    }
}
