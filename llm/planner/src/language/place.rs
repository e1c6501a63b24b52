//! Phrases for places.

use super::{
    phrase::{MAX_DEPTH, keep_longest_first},
    reader::{Captures, Expected, Reader},
    syntax::{NounPhrase, PlaceKind, PlacePhrase, Pronoun, Relation},
};
use crate::task::Quantity;

type Places = Vec<(PlacePhrase, usize)>;

impl Reader<'_> {
    /// All readings of a destination with its preposition, the longest first.
    pub fn places(&self, at: usize, depth: u32) -> Places {
        if depth > MAX_DEPTH || !self.spend() {
            return Vec::new();
        }
        let words = &self.lexicon.words;
        let mut starts = self.class(at, &words.back);
        starts.push(at);
        let mut readings = Vec::new();
        for start in starts {
            readings.extend(self.history(start, depth));
            readings.extend(self.between(start, depth));
            readings.extend(self.beside(start, depth));
            for (relation, end) in self.relations(start) {
                readings.extend(self.bare_places(end, relation, depth));
                readings.extend(self.between(end, depth));
                readings.extend(self.beside(end, depth));
            }
            // "inside" alone: in what was named last.
            if let Some(end) = self.longest(start, &words.inside_it).filter(|end| self.ends_phrase(*end)) {
                let it = NounPhrase { pronoun: Some(Pronoun::One), ..self.blank(start, end) };
                readings.push(self.place(start, end, PlaceKind::At(it, Relation::In)));
            }
        }
        if readings.is_empty() {
            self.fail(at, Expected::Other("a place such as \"to the middle\" or \"onto the mat\""));
        }
        for (place, end) in &mut readings {
            place.span = self.span(at, *end);
        }
        keep_longest_first(&mut readings);
        readings
    }

    /// Prepositions of a place at `at`, the longest first.
    pub fn relations(&self, at: usize) -> Vec<(Relation, usize)> {
        let words = &self.lexicon.words;
        let classes = [
            (Relation::In, &words.prepositions_in),
            (Relation::On, &words.prepositions_on),
            (Relation::Under, &words.prepositions_under),
            (Relation::To, &words.prepositions),
        ];
        let mut readings: Vec<(Relation, usize)> = Vec::new();
        for (relation, forms) in classes {
            readings.extend(self.class(at, forms).into_iter().map(|end| (relation, end)));
        }
        keep_longest_first(&mut readings);
        readings
    }

    fn ends_phrase(&self, at: usize) -> bool {
        at >= self.tokens.len() || self.is_stop(at) || self.longest(at, &self.lexicon.words.connectors).is_some()
    }

    /// All readings of a place without its preposition.
    pub fn bare_places(&self, at: usize, relation: Relation, depth: u32) -> Places {
        let mut readings = self.history(at, depth);
        readings.extend(self.middle(at, depth));
        readings.extend(self.spot_in_the_middle(at, depth));
        let things = self.noun_phrases(at, depth).into_iter();
        readings.extend(things.map(|(phrase, end)| self.place(at, end, PlaceKind::At(phrase, relation))));
        keep_longest_first(&mut readings);
        readings
    }

    fn place(&self, at: usize, end: usize, kind: PlaceKind) -> (PlacePhrase, usize) {
        (PlacePhrase { span: self.span(at, end), kind }, end)
    }

    fn history(&self, at: usize, depth: u32) -> Places {
        let mut readings = Vec::new();
        for history in &self.lexicon.history {
            for (captures, end) in self.form(at, &history.form, &Captures::default(), depth + 1) {
                let owner = captures.it.filter(|phrase| phrase.pronoun.is_none());
                readings.push(self.place(at, end, PlaceKind::History(owner, history.reference)));
            }
        }
        readings
    }

    fn middle(&self, at: usize, depth: u32) -> Places {
        let words = &self.lexicon.words;
        let start = self.longest(at, &words.definite).unwrap_or(at);
        let mut readings = Vec::new();
        for end in self.class(start, &words.middle) {
            readings.push(self.place(at, end, PlaceKind::Middle(None)));
            for of in self.class(end, &words.middle_of) {
                let article = self.longest(of, &words.definite).unwrap_or(of);
                if let Some(whole) = self.longest(article, &words.whole) {
                    readings.push(self.place(at, whole, PlaceKind::MiddleOfWhole));
                }
                if ["them", "these", "those", "all"].iter().any(|word| self.is_word(of, word)) {
                    readings.push(self.place(at, of + 1, PlaceKind::Middle(None)));
                }
                readings.extend(self.middle_of(at, of, depth));
            }
        }
        readings
    }

    /// "the spot in the middle", "the empty space between the mats".
    fn spot_in_the_middle(&self, at: usize, depth: u32) -> Places {
        let words = &self.lexicon.words;
        let start = self.longest(at, &words.definite).unwrap_or(at);
        let start = self.longest(start, &words.free).unwrap_or(start);
        let Some(spot) = self.longest(start, &words.places) else { return Vec::new() };
        let mut readings = self.between(spot, depth);
        for end in self.class(spot, &words.standing) {
            readings.extend(self.middle(end, depth));
        }
        readings.into_iter().map(|(place, end)| self.place(at, end, place.kind)).collect()
    }

    /// What follows "the middle of".
    fn middle_of(&self, at: usize, of: usize, depth: u32) -> Places {
        let words = &self.lexicon.words;
        let article = self.longest(of, &words.definite).unwrap_or(of);
        if let Some(collective) = self.longest(article, &words.collectives) {
            if self.is_word(collective, "of") {
                return self.middle_of(at, collective + 1, depth);
            }
            return vec![self.place(at, collective, PlaceKind::Middle(None))];
        }
        let mut readings = self.pair(at, of, depth);
        for (phrase, end) in self.noun_phrases(of, depth + 1) {
            readings.push(match phrase.quantity {
                Quantity::Group => self.place(at, end, PlaceKind::Middle(Some(ungrouped(phrase)))),
                _ if phrase.pronoun.is_some() => continue,
                _ => self.place(at, end, PlaceKind::At(phrase, Relation::On)),
            });
        }
        readings
    }

    pub fn between(&self, at: usize, depth: u32) -> Places {
        let mut readings = Vec::new();
        for start in self.class(at, &self.lexicon.words.between) {
            readings.extend(self.pair(at, start, depth));
            for (phrase, end) in self.noun_phrases(start, depth + 1) {
                if phrase.quantity == Quantity::Group {
                    readings.push(self.place(at, end, PlaceKind::Middle(Some(ungrouped(phrase)))));
                }
            }
        }
        readings
    }

    /// "the red cube and the blue one".
    fn pair(&self, at: usize, start: usize, depth: u32) -> Places {
        let mut readings = Vec::new();
        for (first, end) in self.noun_phrases(start, depth + 1) {
            if !self.is_word(end, "and") || first.quantity == Quantity::Group {
                continue;
            }
            for (second, end) in self.noun_phrases(end + 1, depth + 1) {
                if second.quantity != Quantity::Group {
                    readings.push(self.place(at, end, PlaceKind::Between(first.clone(), second)));
                }
            }
        }
        readings
    }

    pub fn beside(&self, at: usize, depth: u32) -> Places {
        let mut readings = Vec::new();
        for (side, forms) in &self.lexicon.beside {
            for start in self.class(at, forms) {
                for (phrase, end) in self.noun_phrases(start, depth + 1) {
                    readings.push(self.place(at, end, PlaceKind::Beside(phrase, *side)));
                }
            }
        }
        readings
    }
}

/// "the middle of all the mats" means the same group as "the middle of the mats".
fn ungrouped(phrase: NounPhrase) -> NounPhrase {
    NounPhrase { each: false, ..phrase }
}
