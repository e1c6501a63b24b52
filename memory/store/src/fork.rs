//! What would hold: changes over a state that is left as it is.

use crate::{
    Id, State,
    condition::{self, Condition, Facts, Truth},
    event::Sure,
    symbols::Symbol,
};
use std::collections::BTreeMap;

/// An effect of an action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// A state comes to hold or not.
    State(Id, Symbol, Sure),
    /// A relation comes to hold or not.
    Relate(Id, Symbol, Id, Sure),
    /// A number is set.
    Set(Id, Symbol, f64),
    /// A number grows; one that is not known stays so.
    Add(Id, Symbol, f64),
    /// An object comes into a region.
    Region(Id, Symbol),
}

/// A branch. Making one costs nothing; what it changes is dropped with it.
#[derive(Debug, Clone)]
pub struct Fork<'s> {
    state: &'s State,
    sures: BTreeMap<(Id, Symbol, Id), Sure>,
    numbers: BTreeMap<(Id, Symbol), f64>,
    regions: BTreeMap<Id, Symbol>,
}

impl<'s> Fork<'s> {
    /// A branch in which nothing is changed.
    pub fn new(state: &'s State) -> Fork<'s> {
        Fork { state, sures: BTreeMap::new(), numbers: BTreeMap::new(), regions: BTreeMap::new() }
    }
    /// Takes in an effect.
    #[inline]
    pub fn apply(&mut self, effect: Effect) {
        match effect {
            Effect::State(id, state, sure) => {
                self.sures.insert((id, state, crate::NONE), sure);
            }
            Effect::Relate(subject, relation, object, sure) => {
                self.sures.insert((subject, relation, object), sure);
            }
            Effect::Set(id, fluent, value) => {
                self.numbers.insert((id, fluent), value);
            }
            Effect::Add(id, fluent, value) => {
                if let Some(before) = self.number(id, fluent) {
                    self.numbers.insert((id, fluent), before + value);
                }
            }
            Effect::Region(id, region) => {
                self.regions.insert(id, region);
            }
        }
    }
    /// The truth of a condition in this branch. Closures and queries see the state beneath.
    pub fn truth(&self, condition: &Condition) -> Truth {
        condition::truth(self, condition)
    }
    /// Takes in an action's effects if its conditions hold; says whether they did.
    pub fn step(&mut self, conditions: &[Condition], effects: &[Effect]) -> Truth {
        let mut result = Sure::Yes;
        for condition in conditions {
            match self.truth(condition) {
                Sure::Yes => {}
                Sure::No => return Sure::No,
                Sure::Unknown => result = Sure::Unknown,
            }
        }
        if result == Sure::Yes {
            effects.iter().for_each(|effect| self.apply(*effect));
        }
        result
    }
}

impl Facts for Fork<'_> {
    fn state(&self) -> &State {
        self.state
    }
    #[inline]
    fn sure(&self, id: Id, state: Symbol) -> Sure {
        self.sures.get(&(id, state, crate::NONE)).copied().unwrap_or_else(|| self.state.sure(id, state))
    }
    #[inline]
    fn related(&self, subject: Id, relation: Symbol, object: Id) -> Sure {
        let changed = self.sures.get(&(subject, relation, object)).copied();
        changed.unwrap_or_else(|| Facts::related(self.state, subject, relation, object))
    }
    fn number(&self, id: Id, fluent: Symbol) -> Option<f64> {
        self.numbers.get(&(id, fluent)).copied().or_else(|| self.state.number(id, fluent))
    }
    fn region(&self, id: Id) -> Symbol {
        self.regions.get(&id).copied().unwrap_or_else(|| Facts::region(self.state, id))
    }
}
