//! What holds: yes, no or unknown. A thing that was not observed is unknown; only where somebody looked does its absence
//! mean no.

use crate::{
    Id, Nanos, State,
    event::Sure,
    query::Query,
    region::{self},
    symbols::Symbol,
};
use serde::{Deserialize, Serialize};

/// Three-valued truth (Kleene 1952).
pub type Truth = Sure;

/// A probability from which on an answer is given.
pub const DECIDED: f32 = 0.8;
/// How fast what a search found wears out, unless the caller says otherwise: half in an hour.
pub const HALF_LIFE: Nanos = 3_600_000_000_000;

/// How a number is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Compare {
    /// Less.
    Less,
    /// At most.
    AtMost,
    /// Equal.
    Equal,
    /// At least.
    AtLeast,
    /// More.
    More,
}

impl Compare {
    fn holds(self, a: f64, b: f64) -> bool {
        match self {
            Compare::Less => a < b,
            Compare::AtMost => a <= b,
            Compare::Equal => a == b,
            Compare::AtLeast => a >= b,
            Compare::More => a > b,
        }
    }
}

/// A condition over objects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    /// A state of an object.
    State(Id, Symbol),
    /// A relation of two objects.
    Related(Id, Symbol, Id),
    /// A relation over any number of steps.
    Reaches(Id, Symbol, Id),
    /// A number compared with a constant.
    Number(Id, Symbol, Compare, f64),
    /// An object is of a category or one of its kinds.
    IsA(Id, Symbol),
    /// An object has a part of a template.
    HasPart(Id, Symbol),
    /// An object is in a region.
    In(Id, Symbol),
    /// Not so.
    Not(Box<Condition>),
    /// All of them.
    All(Vec<Condition>),
    /// At least one of them.
    Any(Vec<Condition>),
    /// Every object that a query finds has a state.
    ForAll(Box<Query>, Symbol),
    /// Something of a category is in a region: no only where it was searched.
    Exists(Symbol, Symbol),
}

/// Where single facts are read: the state, or a fork of it.
pub trait Facts {
    /// The state beneath.
    fn state(&self) -> &State;
    /// A state of an object.
    fn sure(&self, id: Id, state: Symbol) -> Sure;
    /// A relation of two objects.
    fn related(&self, subject: Id, relation: Symbol, object: Id) -> Sure;
    /// A number of an object.
    fn number(&self, id: Id, fluent: Symbol) -> Option<f64>;
    /// The region of an object.
    fn region(&self, id: Id) -> Symbol;
}

impl Facts for State {
    fn state(&self) -> &State {
        self
    }
    #[inline]
    fn sure(&self, id: Id, state: Symbol) -> Sure {
        State::sure(self, id, state)
    }
    #[inline]
    fn related(&self, subject: Id, relation: Symbol, object: Id) -> Sure {
        match self.relations.get(subject, relation, object) {
            Some(edge) if edge.holds() => Sure::Yes,
            Some(_) => Sure::No,
            None => Sure::Unknown,
        }
    }
    fn number(&self, id: Id, fluent: Symbol) -> Option<f64> {
        State::number(self, id, fluent)
    }
    fn region(&self, id: Id) -> Symbol {
        let row = self.row(id).and_then(|row| self.table.at(row));
        row.map_or(0, |(block, row)| block.hot.get().region[row])
    }
}

/// The truth of a condition.
pub fn truth<F: Facts>(facts: &F, condition: &Condition) -> Truth {
    let known = |holds: bool| if holds { Sure::Yes } else { Sure::No };
    match condition {
        Condition::State(id, state) => facts.sure(*id, *state),
        Condition::Related(subject, relation, object) => facts.related(*subject, *relation, *object),
        Condition::Reaches(subject, relation, object) => {
            if facts.state().relations.reaches(&[*relation], *subject, *object) {
                Sure::Yes
            } else {
                facts.related(*subject, *relation, *object)
            }
        }
        Condition::Number(id, fluent, compare, value) => {
            facts.number(*id, *fluent).map_or(Sure::Unknown, |known_value| known(compare.holds(known_value, *value)))
        }
        Condition::IsA(id, category) => {
            let state = facts.state();
            let row = state.row(*id).and_then(|row| state.table.at(row));
            match row.map(|(block, row)| block.hot.get().category[row]) {
                None | Some(0) => Sure::Unknown,
                Some(own) => known(state.symbols.is_a(own, *category)),
            }
        }
        Condition::HasPart(id, template) => {
            let state = facts.state();
            let row = state.row(*id).and_then(|row| state.table.at(row));
            row.map_or(Sure::Unknown, |(block, row)| known(block.bits.has(state.symbols.bit(*template, false), row)))
        }
        Condition::In(id, region) => match facts.region(*id) {
            0 => Sure::Unknown,
            own => known(own == *region),
        },
        Condition::Not(inner) => match truth(facts, inner) {
            Sure::Yes => Sure::No,
            Sure::No => Sure::Yes,
            Sure::Unknown => Sure::Unknown,
        },
        Condition::All(all) => {
            let mut result = Sure::Yes;
            for condition in all {
                match truth(facts, condition) {
                    Sure::No => return Sure::No,
                    Sure::Unknown => result = Sure::Unknown,
                    Sure::Yes => {}
                }
            }
            result
        }
        Condition::Any(any) => {
            let mut result = Sure::No;
            for condition in any {
                match truth(facts, condition) {
                    Sure::Yes => return Sure::Yes,
                    Sure::Unknown => result = Sure::Unknown,
                    Sure::No => {}
                }
            }
            result
        }
        Condition::ForAll(query, state) => {
            let query = Query { most: crate::query::MAX_HITS, ..(**query).clone() };
            let hits = crate::execute::answer(facts.state(), &query).hits;
            let mut result = if hits.len() < crate::query::MAX_HITS { Sure::Yes } else { Sure::Unknown };
            for hit in hits {
                match facts.sure(hit.id, *state) {
                    Sure::No => return Sure::No,
                    Sure::Unknown => result = Sure::Unknown,
                    Sure::Yes => {}
                }
            }
            result
        }
        Condition::Exists(category, region) => exists(facts.state(), *category, *region, HALF_LIFE).0,
    }
}

/// Whether something of a category is in a region, and with which probability that is right: yes where one is known, no
/// where it was searched lately, else unknown.
pub fn exists(state: &State, category: Symbol, region: Symbol, half_life: Nanos) -> (Truth, f32) {
    let query = Query { categories: vec![category], region: Some(region), most: 1, ..Query::default() };
    let known = crate::execute::answer(state, &query).hits.first().map_or(0.0, |hit| hit.score);
    // A search for anything of a wider category counts for this one too.
    let wider: Vec<Symbol> = state
        .symbols
        .of_kind(crate::Kind::Category)
        .map(|(symbol, _)| symbol)
        .filter(|symbol| state.symbols.is_a(category, *symbol))
        .collect();
    let found = state.regions.found(region, &wider, state.now, half_life);
    region::answer(known, found, DECIDED)
}
