//! What can be asked: hard filters and how what passes them is ranked.

use crate::{Id, Nanos, State, block::Block, symbols::Symbol};
use serde::{Deserialize, Serialize};

/// A description of the objects that are looked for. Empty fields do not filter.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Query {
    /// Any of these categories or their kinds.
    pub categories: Vec<Symbol>,
    /// Templates of which it has a part.
    pub templates: Vec<Symbol>,
    /// Affordances that it or a part of it has.
    pub affordances: Vec<Symbol>,
    /// States that are known to hold (`true`) or known not to hold.
    pub states: Vec<(Symbol, bool)>,
    /// The region in which it is.
    pub region: Option<Symbol>,
    /// Where it should be near.
    pub near: Option<Near>,
    /// Relations in which it is, over one step or any number.
    pub related: Vec<Related>,
    /// Bounds of its numbers.
    pub numbers: Vec<(Symbol, f64, f64)>,
    /// Bounds of geometric parameters: template, index of the parameter, smallest, largest.
    pub geometry: Vec<(Symbol, u8, f32, f32)>,
    /// Smallest confidence.
    pub min_confidence: Option<f32>,
    /// Objects that are not meant.
    pub exclude: Vec<Id>,
    /// Chance of success with a part of a template, as skill memory has it: a factor of the rank.
    pub success: Vec<(Symbol, f32)>,
    /// As it was at one moment, from what was known at another.
    pub when: Option<(Nanos, Nanos)>,
    /// How many hits are wanted; 0: ten.
    pub most: usize,
}

/// A place that hits should be near to: the rank falls to 1/e over `scale_m`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Near {
    /// Metres, world frame.
    pub at: [f32; 3],
    /// Metres.
    pub scale_m: f32,
    /// Nothing farther away is a hit, metres.
    pub within_m: Option<f32>,
}

/// A relation to another object.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Related {
    /// The relation.
    pub relation: Symbol,
    /// The other object.
    pub object: Id,
    /// Over any number of steps.
    pub closure: bool,
}

/// One answer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Hit {
    /// The object.
    pub id: Id,
    /// Product of all terms, in (0, 1].
    pub score: f32,
}

/// Ranked hits, equal ones in the order of their ids, and what they cost.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Best first.
    pub hits: Vec<Hit>,
    /// Objects that were scored after the hard filters.
    pub scored: u32,
    /// Blocks of 256 objects that were looked into.
    pub blocks: u32,
}

/// The limit on closures and lists.
pub const MAX_RELATED: usize = 1 << 20;
/// Most hits.
pub const MAX_HITS: usize = 10_000;

impl Query {
    /// How many hits are wanted.
    pub fn wanted(&self) -> usize {
        if self.most == 0 { 10 } else { self.most.min(MAX_HITS) }
    }
    /// The categories that fit, with all their kinds, sorted.
    pub(crate) fn all_categories(&self, state: &State) -> Vec<Symbol> {
        let mut all: Vec<Symbol> = match self.categories.as_slice() {
            [] => Vec::new(),
            some => some.iter().flat_map(|category| state.symbols.descendants(*category)).collect(),
        };
        all.sort_unstable();
        all.dedup();
        all
    }
    /// Logarithm of an object's score.
    #[inline]
    pub(crate) fn score(&self, position: [f32; 3], weight: f32) -> f32 {
        match &self.near {
            Some(near) => weight - distance(position, near.at) / near.scale_m.max(1e-6),
            None => weight,
        }
    }
    /// Logarithm of the chance of success: the best of its parts' templates.
    pub(crate) fn success_term(&self, has: impl Fn(Symbol) -> bool) -> f32 {
        if self.success.is_empty() {
            return 0.0;
        }
        let fitting = self.success.iter().filter(|(template, _)| has(*template)).map(|(_, chance)| *chance);
        fitting.fold(1e-6f32, f32::max).ln()
    }
}

/// Metres.
#[inline]
pub(crate) fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (x * x + y * y + z * z).sqrt()
}

/// One hard filter, as it is tried on an object.
#[derive(Debug, Clone, PartialEq)]
pub enum Filter {
    /// Its category is one of these, sorted.
    Category(Vec<Symbol>),
    /// Its region.
    Region(Symbol),
    /// It is in a set: templates, affordances, states. The word, whether the state must not hold, the set's number.
    Set(Symbol, bool, u16),
    /// It is one of these, sorted: a relation.
    OneOf(Symbol, Vec<Id>),
    /// It is near enough.
    Within([f32; 3], f32),
    /// A number lies between bounds.
    Number(Symbol, f64, f64),
    /// A parameter of a part lies between bounds.
    Geometry(Symbol, u8, f32, f32),
    /// Its weight is large enough.
    Weight(f32),
    /// It is none of these.
    Exclude(Vec<Id>),
}

impl Filter {
    /// The filters of a query, cheap ones first.
    pub fn of(query: &Query, state: &State) -> Vec<Filter> {
        let mut filters = Vec::new();
        if !query.categories.is_empty() {
            filters.push(Filter::Category(query.all_categories(state)));
        }
        filters.extend(query.region.map(Filter::Region));
        let words = query.templates.iter().chain(&query.affordances).map(|symbol| (*symbol, false));
        for (symbol, negated) in words.chain(query.states.iter().map(|(symbol, holds)| (*symbol, !holds))) {
            filters.push(Filter::Set(symbol, negated, state.symbols.bit(symbol, negated)));
        }
        for related in &query.related {
            let mut ids = if related.closure {
                state.relations.closure(&[related.relation], related.object, MAX_RELATED)
            } else {
                state.relations.subjects(related.relation, related.object).take(MAX_RELATED).collect()
            };
            ids.sort_unstable();
            filters.push(Filter::OneOf(related.relation, ids));
        }
        if let Some(near) = query.near
            && let Some(within) = near.within_m
        {
            filters.push(Filter::Within(near.at, within));
        }
        filters.extend(query.min_confidence.map(|least| Filter::Weight(crate::table::weight(least))));
        if !query.exclude.is_empty() {
            let mut exclude = query.exclude.clone();
            exclude.sort_unstable();
            filters.push(Filter::Exclude(exclude));
        }
        filters.extend(query.numbers.iter().map(|(fluent, low, high)| Filter::Number(*fluent, *low, *high)));
        let geometry = query.geometry.iter();
        filters.extend(geometry.map(|(template, index, low, high)| Filter::Geometry(*template, *index, *low, *high)));
        filters
    }
    /// Whether an object in a row passes.
    #[inline]
    pub fn passes(&self, state: &State, block: &Block, row: usize) -> bool {
        let hot = block.hot.get();
        let row = row % crate::block::ROWS;
        match self {
            Filter::Category(all) => all.binary_search(&hot.category[row]).is_ok(),
            Filter::Region(region) => hot.region[row] == *region,
            Filter::Set(_, _, set) => *set > 0 && block.bits.has(*set, row),
            Filter::OneOf(_, ids) => ids.binary_search(&hot.id[row]).is_ok(),
            Filter::Within(at, radius) => distance(block.position(row), *at) <= *radius,
            Filter::Number(fluent, low, high) => {
                state.number(hot.id[row], *fluent).is_some_and(|value| (*low..=*high).contains(&value))
            }
            Filter::Geometry(template, index, low, high) => state.parts(hot.id[row]).iter().any(|part| {
                let value = part.theta.get(usize::from(*index)).copied();
                part.template == *template && value.is_some_and(|value| (*low..=*high).contains(&value))
            }),
            Filter::Weight(least) => hot.weight[row] >= *least,
            Filter::Exclude(ids) => ids.binary_search(&hot.id[row]).is_err(),
        }
    }
    /// For people.
    pub fn describe(&self, state: &State) -> String {
        let word = |symbol: &Symbol| state.symbols.word(*symbol);
        match self {
            Filter::Category(all) => {
                format!("category {}", all.iter().map(word).collect::<Vec<_>>().join("|"))
            }
            Filter::Region(region) => format!("region {}", word(region)),
            Filter::Set(symbol, negated, _) => {
                let kind = state.symbols.kind(*symbol).map_or("word", crate::Kind::word);
                format!("{kind} {}{}", if *negated { "not " } else { "" }, word(symbol))
            }
            Filter::OneOf(relation, ids) => format!("relation {} ({} objects)", word(relation), ids.len()),
            Filter::Within(_, radius) => format!("within {radius} m"),
            Filter::Number(fluent, low, high) => format!("{low} <= {} <= {high}", word(fluent)),
            Filter::Geometry(template, index, low, high) => {
                format!("{low} <= {} parameter {index} <= {high}", word(template))
            }
            Filter::Weight(least) => format!("confidence >= {:.3}", least.exp()),
            Filter::Exclude(_) => "exclude".into(),
        }
    }
}
