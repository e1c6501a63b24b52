//! Which rules a reading rests on, by name: verb frames, modifiers of clauses, and kinds of phrases.

use super::syntax::{Clause, Modifier, NounPhrase, PlaceKind, PlacePhrase, Relation, Sentence, Statement};
use crate::{lexicon::Lexicon, task::Quantity};
use std::collections::BTreeSet;

/// The names of the rules that a text's reading rests on.
pub(super) fn rules(lexicon: &Lexicon, sentences: &[Sentence]) -> BTreeSet<String> {
    let mut rules = Rules { lexicon, names: BTreeSet::new() };
    for sentence in sentences {
        rules.sentence(sentence);
    }
    rules.names
}

struct Rules<'a> {
    lexicon: &'a Lexicon,
    names: BTreeSet<String>,
}

impl Rules<'_> {
    fn add(&mut self, kind: &str, name: &str) {
        self.names.insert(format!("{kind} {name}"));
    }

    fn sentence(&mut self, sentence: &Sentence) {
        match sentence {
            Sentence::Do { clause, background, guard, .. } => {
                self.clause(clause);
                if *background {
                    self.add("sentence", "background");
                }
                if let Some(guard) = guard {
                    self.add("sentence", if guard.otherwise { "otherwise" } else { "if" });
                    self.statement(&guard.condition);
                }
            }
            Sentence::Leave { object } => {
                self.add("sentence", "leave");
                self.phrase(object);
            }
            Sentence::There { things } => {
                self.add("sentence", "there");
                things.iter().for_each(|thing| self.phrase(thing));
            }
            Sentence::Once { condition, .. } => {
                self.add("sentence", "once");
                self.statement(condition);
            }
            Sentence::Manner { modifier } => self.modifier(modifier),
        }
    }

    fn clause(&mut self, clause: &Clause) {
        if let Some(frame) = self.lexicon.frames.get(clause.frame) {
            self.add("frame", &frame.name.clone());
        }
        if !clause.also.is_empty() {
            self.add("clause", "list");
        }
        clause.object.iter().chain(&clause.also).for_each(|phrase| self.phrase(phrase));
        clause.tool.iter().for_each(|tool| {
            self.add("clause", "tool");
            self.phrase(tool);
        });
        clause.place.iter().for_each(|place| self.place(place));
        clause.condition.iter().for_each(|condition| self.statement(condition));
        clause.modifiers.iter().for_each(|modifier| self.modifier(modifier));
        if clause.times.is_some() {
            self.add("clause", "times");
        }
        if clause.history.is_some() {
            self.add("clause", "back");
        }
    }

    fn modifier(&mut self, modifier: &Modifier) {
        self.add("modifier", &format!("{:?}", modifier.kind));
        modifier.thing.iter().for_each(|thing| self.phrase(thing));
        modifier.condition.iter().for_each(|condition| self.statement(condition));
    }

    fn statement(&mut self, statement: &Statement) {
        // The word for a state is one like a noun.
        self.add("statement", if statement.about.is_some() { "of a thing" } else { "of the moment" });
        statement.about.iter().for_each(|about| self.phrase(about));
        statement.place.iter().for_each(|place| self.place(place));
    }

    fn place(&mut self, place: &PlacePhrase) {
        let (name, phrases): (&str, Vec<&NounPhrase>) = match &place.kind {
            PlaceKind::At(phrase, relation) => {
                let name = match relation {
                    Relation::On => "on",
                    Relation::In => "in",
                    Relation::Under => "under",
                    Relation::To => "to",
                };
                (name, vec![phrase])
            }
            PlaceKind::Middle(group) => ("middle", group.iter().collect()),
            PlaceKind::MiddleOfWhole => ("middle of a whole", Vec::new()),
            PlaceKind::Between(first, second) => ("between", vec![first, second]),
            PlaceKind::Beside(phrase, side) => (if side.is_some() { "side" } else { "beside" }, vec![phrase]),
            PlaceKind::History(owner, _) => ("history", owner.iter().collect()),
        };
        self.add("place", name);
        phrases.into_iter().for_each(|phrase| self.phrase(phrase));
    }

    fn phrase(&mut self, phrase: &NounPhrase) {
        let quantity = match phrase.quantity {
            Quantity::TheOne => "the one",
            Quantity::AnyOne => "any one",
            Quantity::Group => "group",
            Quantity::Count(_) => "count",
        };
        let said = [
            (quantity, phrase.pronoun.is_none()),
            ("pronoun", phrase.pronoun.is_some()),
            ("each", phrase.each),
            ("elided", phrase.elided),
            ("color", phrase.color.is_some()),
            ("size", phrase.size.is_some()),
            ("rank", phrase.rank.is_some()),
            ("free", phrase.free),
            ("other", phrase.other),
            ("state", !phrase.states.is_empty()),
            ("located", phrase.located.is_some()),
            ("part", phrase.part_of.is_some()),
            ("twin", phrase.twin_of.is_some()),
            ("contents", !phrase.contains.is_empty()),
            ("handled", phrase.handled.is_some()),
        ];
        for (name, _) in said.into_iter().filter(|(_, said)| *said) {
            self.add("phrase", name);
        }
        phrase.located.iter().for_each(|place| self.place(place));
        let inner = phrase.part_of.iter().chain(&phrase.twin_of).map(|inner| inner.as_ref());
        inner.chain(&phrase.contains).for_each(|inner| self.phrase(inner));
    }
}
