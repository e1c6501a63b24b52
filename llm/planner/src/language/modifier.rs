//! What follows a noun and tells its thing from others.

use super::{
    phrase::Phrases,
    reader::Reader,
    role::{CONTAINS, Role},
    syntax::{NounPhrase, PlaceKind, PlacePhrase, Pronoun, Relation},
};
use crate::task::{Direction, Quantity, Rank};
use acm_memory::query::PlaceReference;

type Places = Vec<(PlacePhrase, usize)>;

impl Reader<'_> {
    pub(super) fn modifiers(&self, phrase: &NounPhrase, at: usize, depth: u32) -> Phrases {
        let words = &self.lexicon.words;
        let mut readings = Vec::new();
        let mut starts = self.class(at, &words.relative_links);
        for &start in &starts {
            if let Some((term, end)) = self.color(start).filter(|_| phrase.color.is_none()) {
                readings.push((NounPhrase { color: Some(term), ..phrase.clone() }, end));
            }
        }
        starts.push(at);
        for start in starts {
            for end in self.class(start, &words.standing).into_iter().chain(self.class(start, &words.sources)) {
                let article = self.longest(end, &words.definite).or_else(|| self.longest(end, &words.indefinite));
                let article = article.unwrap_or(end);
                // A table that the library knows is a thing like others.
                if let Some(whole) = self.longest(article, &words.whole).filter(|_| self.noun(article).is_none()) {
                    readings.push((NounPhrase { somewhere: true, ..phrase.clone() }, whole));
                }
            }
            readings.extend(self.side(phrase, start));
            if phrase.located.is_none() {
                readings.extend(self.located(phrase, start, depth));
                readings.extend(self.set_off(phrase, start, depth));
            }
        }
        readings.extend(self.part_of(phrase, at, depth));
        readings.extend(self.twin_of(phrase, at, depth));
        readings.extend(self.containing(phrase, at, depth));
        readings.extend(self.handled(phrase, at));
        let own = self.class(at, &words.own_links).into_iter();
        readings.extend(own.map(|end| (NounPhrase { its: true, ..phrase.clone() }, end)));
        for (phrase, end) in &mut readings {
            phrase.span = phrase.span.join(self.span(at, *end));
        }
        readings
    }

    /// "on the left", "from the right".
    fn side(&self, phrase: &NounPhrase, at: usize) -> Option<(NounPhrase, usize)> {
        let from = self.is_word(at, "from");
        if !from && !["on", "to", "at", "in"].iter().any(|word| self.is_word(at, word)) {
            return None;
        }
        let article = self.longest(at + 1, &self.lexicon.words.definite)?;
        let (direction, end) = self.meaning(article, &self.lexicon.directions)?;
        let end = if self.is_word(end, "side") || self.is_word(end, "end") { end + 1 } else { end };
        // "on the left mat" is a place, not a side.
        if self.noun(end).is_some() || self.is_word(end, "of") || self.is_word(end, "one") {
            return None;
        }
        let number = match phrase.rank {
            None if !from => 0,
            Some(Rank::FromSide(number, Direction::Left)) => number,
            _ => return None,
        };
        Some((NounPhrase { rank: Some(Rank::FromSide(number, direction)), ..phrase.clone() }, end))
    }

    /// "on the left mat", "between the blocks", "from the middle".
    fn located(&self, phrase: &NounPhrase, at: usize, depth: u32) -> Phrases {
        let words = &self.lexicon.words;
        let mut places: Places = self.between(at, depth + 1);
        places.extend(self.beside(at, depth + 1));
        // "the cabinet above the sink": near it, as far as it tells things apart.
        for end in self.class(at, &words.above) {
            let things = self.noun_phrases(end, depth + 1).into_iter();
            let near = |(thing, end): (NounPhrase, usize)| {
                (PlacePhrase { span: self.span(at, end), kind: PlaceKind::Beside(thing, None) }, end)
            };
            places.extend(things.map(near));
        }
        let mut own = Vec::new();
        let ends = self.relations(at).into_iter().filter(|(relation, _)| *relation != Relation::To);
        let sources = self.class(at, &words.sources).into_iter().map(|end| (Relation::To, end));
        // "from under the desk", "from beside the can".
        let from: Vec<(Relation, usize)> = sources.collect();
        for (_, end) in &from {
            places.extend(self.beside(*end, depth + 1));
            places.extend(self.between(*end, depth + 1));
        }
        let behind =
            from.iter().flat_map(|(_, end)| self.relations(*end)).filter(|(relation, _)| *relation != Relation::To);
        for (relation, end) in ends.chain(behind).chain(from.iter().copied()) {
            let found = self.bare_places(end, relation, depth + 1);
            // "the cube from its mat", "from the mat it is on": wherever it stands, so it tells nothing apart.
            let its = self.is_word(end, "its");
            for (place, end) in found {
                match &place.kind {
                    PlaceKind::At(..) if its => own.push((phrase.clone(), end)),
                    PlaceKind::History(None, PlaceReference::Now) => own.push((phrase.clone(), end)),
                    _ => places.push((place, end)),
                }
            }
        }
        let here = places.into_iter().filter(|(place, _)| !matches!(place.kind, PlaceKind::History(..)));
        let placed = here.map(|(place, end)| (NounPhrase { located: Some(Box::new(place)), ..phrase.clone() }, end));
        own.into_iter().chain(placed).collect()
    }

    /// "the counter, left of the sink": where on a thing that stays where it is.
    fn set_off(&self, phrase: &NounPhrase, at: usize, depth: u32) -> Phrases {
        let fixed = phrase.noun.is_some() && !Role::Effect("at".into()).fits(self.library, phrase.noun.as_deref());
        if !fixed || !self.is_comma(at) {
            return Vec::new();
        }
        let places = self.beside(at + 1, depth + 1).into_iter();
        places.map(|(place, end)| (NounPhrase { located: Some(Box::new(place)), ..phrase.clone() }, end)).collect()
    }

    /// "of the cabinet".
    fn part_of(&self, phrase: &NounPhrase, at: usize, depth: u32) -> Phrases {
        if !self.is_word(at, "of") || phrase.part_of.is_some() || phrase.noun.is_none() || self.measures(phrase) {
            return Vec::new();
        }
        let wholes = self.noun_phrases(at + 1, depth + 1).into_iter();
        let named = wholes.filter(|(whole, _)| whole.pronoun.is_none());
        let described = named.map(|(whole, end)| {
            let several = whole.several();
            let phrase = match several {
                // "the blocks of the trays" are on them.
                true => {
                    let place = PlacePhrase { span: whole.span, kind: PlaceKind::At(whole, Relation::On) };
                    NounPhrase { located: Some(Box::new(place)), ..phrase.clone() }
                }
                false => NounPhrase { part_of: Some(Box::new(whole)), ..phrase.clone() },
            };
            (phrase, end)
        });
        described.collect()
    }

    /// "the twin of the cube" is a phrase of its own; here "a cube like that one", "the same cube as before it".
    fn twin_of(&self, phrase: &NounPhrase, at: usize, depth: u32) -> Phrases {
        if phrase.twin_of.is_some() {
            return Vec::new();
        }
        let mut readings = Vec::new();
        for end in self.class(at, &self.lexicon.words.twin_alone) {
            let it = NounPhrase { pronoun: Some(Pronoun::One), ..self.blank(end, end) };
            readings.push((NounPhrase { twin_of: Some(Box::new(it)), ..phrase.clone() }, end));
        }
        for end in self.class(at, &self.lexicon.words.twin_links) {
            for (model, end) in self.noun_phrases(end, depth + 1) {
                readings.push((NounPhrase { twin_of: Some(Box::new(model)), ..phrase.clone() }, end));
            }
        }
        readings
    }

    /// "with a spoon in it", "containing a spoon".
    fn containing(&self, phrase: &NounPhrase, at: usize, depth: u32) -> Phrases {
        if !phrase.contains.is_empty() {
            return Vec::new();
        }
        let words = &self.lexicon.words;
        let mut readings = Vec::new();
        let mut starts = self.class(at, &words.containing);
        // "a pot of apples": where pots are things, what one holds is in it.
        starts.extend((self.is_word(at, "of") && self.measures(phrase)).then_some(at + 1));
        for start in starts {
            // "a holder with a gauge": what shows something is part of it.
            readings.extend(self.signs(start).into_iter().map(|end| (phrase.clone(), end)));
            for ((first, also), end) in self.noun_phrase_lists(start, depth + 1) {
                let contains = Role::Affordance(CONTAINS).fits(self.library, phrase.noun.as_deref());
                let inside = self.longest(end, &words.prepositions_in).is_some();
                let mut ends = if inside && !contains { Vec::new() } else { self.class(end, &words.within_it) };
                ends.push(end);
                for end in ends {
                    let contains = [std::slice::from_ref(&first), &also].concat();
                    readings.push((NounPhrase { contains, ..phrase.clone() }, end));
                }
            }
        }
        readings
    }

    /// "you took first", "that you pressed last".
    fn handled(&self, phrase: &NounPhrase, at: usize) -> Phrases {
        let words = &self.lexicon.words;
        let start = self.longest(at, &words.that_you).filter(|_| phrase.handled.is_none());
        let Some((start, frame)) = start.and_then(|start| {
            let frames = self.lexicon.verbs.get(self.word(start)?)?;
            Some((start + 1, *frames.first()?))
        }) else {
            return Vec::new();
        };
        let after = if self.is_word(start, "up") { start + 1 } else { start };
        let ranked = self.number(after, &self.lexicon.ordinals).map(|(rank, end)| (rank as i32, end));
        let last = self.longest(after, &words.last).map(|end| (-1, end));
        // "the first one you took" has its rank before the noun.
        let before = match phrase.rank {
            Some(Rank::FromSide(rank, Direction::Left)) => Some((rank as i32, after)),
            _ => None,
        };
        let rank = ranked.or(last).or(before).unwrap_or((-1, after));
        let phrase =
            NounPhrase { rank: None, quantity: Quantity::TheOne, handled: Some((frame, rank.0)), ..phrase.clone() };
        vec![(phrase, rank.1)]
    }
}
