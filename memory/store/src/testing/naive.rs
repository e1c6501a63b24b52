//! The same answers by the plainest means: a list of events, read from its beginning for every question.

use crate::{
    Event, Id, Nanos, Op,
    event::{Object, Sure},
    query::{self, Hit, Query},
    symbols::Symbol,
    table::weight,
};
use std::collections::BTreeMap;

/// All events with the times at which they came to be known.
#[derive(Debug, Clone, Default)]
pub struct Naive {
    /// The events.
    pub events: Vec<(Nanos, Event)>,
}

/// An object as it was.
#[derive(Debug, Clone, PartialEq)]
pub struct Then {
    /// Whole, with the states that were known to hold.
    pub object: Object,
    /// States that were known not to hold.
    pub not: Vec<Symbol>,
    /// Its numbers.
    pub numbers: BTreeMap<Symbol, f64>,
}

impl Naive {
    /// Adds a batch.
    pub fn commit(&mut self, events: &[Event], time: Nanos) {
        self.events.extend(events.iter().map(|event| (time, event.clone())));
    }
    /// All objects that were there at `valid`, from what was known at `known`.
    pub fn at(&self, valid: Nanos, known: Nanos) -> BTreeMap<Id, Then> {
        // Of each property the latest moment counts, and of equal ones what was known last.
        let mut seen: Vec<(Nanos, usize, &Event)> = self
            .events
            .iter()
            .enumerate()
            .filter(|(_, (time, event))| *time <= known && event.valid <= valid)
            .map(|(number, (_, event))| (event.valid, number, event))
            .collect();
        seen.sort_by_key(|(moment, number, _)| (*moment, *number));
        let mut all: BTreeMap<Id, Then> = BTreeMap::new();
        for (_, _, event) in seen {
            for op in &event.ops {
                apply(&mut all, op);
            }
        }
        all
    }
    /// Everything that is there now.
    pub fn now(&self) -> BTreeMap<Id, Then> {
        self.at(Nanos::MAX, Nanos::MAX)
    }
    /// All relations that are said to hold or not.
    pub fn relations(&self) -> BTreeMap<(Id, Symbol, Id), Sure> {
        let mut all = BTreeMap::new();
        for op in self.events.iter().flat_map(|(_, event)| &event.ops) {
            match op {
                Op::Relate(a, relation, b, Sure::Unknown) => drop(all.remove(&(*a, *relation, *b))),
                Op::Relate(a, relation, b, sure) => drop(all.insert((*a, *relation, *b), *sure)),
                Op::Clear => all.clear(),
                _ => {}
            }
        }
        all
    }
}

fn apply(all: &mut BTreeMap<Id, Then>, op: &Op) {
    match op {
        Op::Put(object) => {
            let before = all.remove(&object.id).map(|then| (then.object.states, then.not, then.numbers));
            let (before, not, numbers) = before.unwrap_or_default();
            let not = not.into_iter().filter(|state| !object.states.contains(state)).collect();
            let mut object = (**object).clone();
            object.states.extend(before.into_iter().filter(|state| !object.states.contains(state)).collect::<Vec<_>>());
            all.insert(object.id, Then { object, not, numbers });
        }
        Op::Move(id, position, rotation) => {
            if let Some(then) = all.get_mut(id) {
                (then.object.position, then.object.rotation) = (*position, *rotation);
            }
        }
        Op::Region(id, region) => {
            if let Some(then) = all.get_mut(id) {
                then.object.region = *region;
            }
        }
        Op::State(id, state, sure) => {
            if let Some(then) = all.get_mut(id) {
                then.object.states.retain(|other| other != state);
                then.not.retain(|other| other != state);
                match sure {
                    Sure::Yes => then.object.states.push(*state),
                    Sure::No => then.not.push(*state),
                    Sure::Unknown => {}
                }
            }
        }
        Op::Fluent(id, fluent, value) => {
            if let Some(then) = all.get_mut(id) {
                then.numbers.insert(*fluent, *value);
            }
        }
        Op::Confidence(id, confidence) => {
            if let Some(then) = all.get_mut(id) {
                then.object.confidence = *confidence;
            }
        }
        Op::Remove(id) => drop(all.remove(id)),
        Op::Clear => all.clear(),
        Op::Define(..) | Op::IsA(..) | Op::Relate(..) | Op::Searched(..) => {}
    }
}

/// The ranked answer, by looking at everything. No taxonomy, relations, success or time.
pub fn answer(all: &BTreeMap<Id, Then>, query: &Query) -> Vec<Hit> {
    let mut found: Vec<(f32, Id)> = Vec::new();
    for (id, then) in all {
        let object = &then.object;
        let affords = |word: &Symbol| {
            object.affordances.contains(word) || object.parts.iter().any(|part| part.affordances.contains(word))
        };
        let bounds = query.near.and_then(|near| near.within_m.map(|m| query::distance(object.position, near.at) <= m));
        let passes = (query.categories.is_empty() || query.categories.contains(&object.category))
            && query.region.is_none_or(|region| object.region == region)
            && query.templates.iter().all(|word| object.parts.iter().any(|part| part.template == *word))
            && query.affordances.iter().all(affords)
            && query
                .states
                .iter()
                .all(|(word, yes)| if *yes { object.states.contains(word) } else { then.not.contains(word) })
            && query
                .numbers
                .iter()
                .all(|(word, low, high)| then.numbers.get(word).is_some_and(|v| (low..=high).contains(&v)))
            && query.geometry.iter().all(|(template, index, low, high)| {
                object.parts.iter().any(|part| {
                    part.template == *template
                        && part.theta.get(usize::from(*index)).is_some_and(|v| (low..=high).contains(&v))
                })
            })
            && query.min_confidence.is_none_or(|least| weight(object.confidence) >= weight(least))
            && !query.exclude.contains(id)
            && bounds.is_none_or(|within| within);
        if passes {
            found.push((query.score(object.position, weight(object.confidence)), *id));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    found.truncate(query.wanted());
    found.into_iter().map(|(score, id)| Hit { id, score: score.exp() }).collect()
}
