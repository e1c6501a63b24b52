//! What is or is not so, and what follows a clause and says how it is meant.

use super::{
    phrase::keep_longest_first,
    reader::{Captures, Reader},
    syntax::{Modifier, NounPhrase, PlaceKind, Pronoun, Relation, Statement},
};
use crate::lexicon::ModifierKind;

impl Reader<'_> {
    /// All readings of a statement that may hold or not, the longest first.
    pub fn conditions(&self, at: usize) -> Vec<(Statement, usize)> {
        let mut readings = Vec::new();
        for state in &self.lexicon.states {
            for form in &state.forms {
                for (captures, end) in self.form(at, form, &Captures::default(), 1) {
                    let predicate = match captures.place.as_ref().map(|place| &place.kind) {
                        None => state.predicate.clone(),
                        Some(PlaceKind::At(_, Relation::In)) => "in".to_owned(),
                        Some(PlaceKind::At(_, Relation::On)) => "on".to_owned(),
                        Some(PlaceKind::At(_, Relation::Under)) => "under".to_owned(),
                        // Other places have no predicate that memory judges.
                        Some(_) => continue,
                    };
                    let last = || NounPhrase { pronoun: Some(Pronoun::One), ..self.blank(at, end) };
                    let about = match state.said_of_last {
                        true => Some(last()),
                        false => captures.it.filter(|_| !state.said_of_moment),
                    };
                    let statement = Statement {
                        span: self.span(at, end),
                        predicate,
                        negated: state.holds == captures.negated,
                        about,
                        place: captures.place,
                    };
                    readings.push((statement, end));
                }
            }
        }
        keep_longest_first(&mut readings);
        readings
    }

    /// The longest modifier of a clause at `at`.
    pub fn clause_modifier(&self, at: usize) -> Option<(Modifier, usize)> {
        let mut best: Option<(Modifier, usize)> = None;
        for (index, modifier) in self.lexicon.modifiers.iter().enumerate() {
            for (captures, end) in self.form(at, &modifier.form, &Captures::default(), 1) {
                if end == at || best.as_ref().is_some_and(|(_, longest)| *longest >= end) {
                    continue;
                }
                let thing = captures.it.or(match captures.place.map(|place| place.kind) {
                    Some(PlaceKind::At(thing, _)) => Some(thing),
                    _ => None,
                });
                let read = Modifier {
                    span: self.span(at, end),
                    kind: modifier.kind,
                    thing,
                    condition: captures.condition,
                    side: captures.side,
                    heading: modifier.heading,
                    list: captures.list,
                    form: index,
                };
                best = Some((read, end));
            }
        }
        best
    }

    /// A modifier in a clause of its own.
    pub fn manner(&self, at: usize) -> Option<(Modifier, usize)> {
        self.clause_modifier(at).filter(|(_, end)| self.ends_clause(*end) || self.clause_modifier(*end).is_some())
    }

    /// All modifiers from `at` on, with or without commas between them.
    pub fn clause_modifiers(&self, mut at: usize) -> (Vec<Modifier>, usize) {
        let mut modifiers = Vec::new();
        loop {
            let start = if self.is_comma(at) { at + 1 } else { at };
            let start = if self.is_word(start, "and") { start + 1 } else { start };
            let trailing = |at| self.clause_modifier(at).filter(|(read, _)| read.kind != ModifierKind::ShownFirst);
            match trailing(start).or_else(|| trailing(at)) {
                Some((modifier, end)) if modifiers.len() < MAX_MODIFIERS => {
                    modifiers.push(modifier);
                    at = end;
                }
                _ => return (modifiers, at),
            }
        }
    }
}

/// Modifiers of one clause.
const MAX_MODIFIERS: usize = 4;
