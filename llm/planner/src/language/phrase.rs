//! Noun phrases.

use super::reader::{Expected, MAX_READINGS, Reader};
use crate::task::{ColorTerm, Direction, Quantity, Rank, Size, Span};
use acm_memory::query::PlaceReference;

/// Phrases within phrases that are read: "the cube on the mat between the blocks".
pub(super) const MAX_DEPTH: u32 = 3;
/// Modifiers that may follow a noun.
const MAX_MODIFIERS: usize = 2;

/// A phrase for a thing, as read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NounPhrase {
    pub span: Span,
    pub pronoun: bool,
    pub quantity: Quantity,
    /// "all", "every": read, but not understood as a goal.
    pub quantified: bool,
    pub noun: Option<String>,
    pub color: Option<ColorTerm>,
    pub size: Option<Size>,
    pub rank: Option<Rank>,
    pub free: bool,
    pub other: bool,
    pub located: Option<Box<PlacePhrase>>,
}

/// A phrase for a place, as read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlacePhrase {
    pub span: Span,
    pub kind: PlaceKind,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum PlaceKind {
    On(NounPhrase),
    Middle(Option<NounPhrase>),
    /// "the middle of the table": nothing that memory knows the extent of.
    MiddleOfWhole,
    Between(NounPhrase, NounPhrase),
    Beside(NounPhrase, Option<Direction>),
    History(Option<NounPhrase>, PlaceReference),
}

/// A noun as read.
pub(super) struct NounReading {
    pub noun: String,
    pub plural: bool,
    pub end: usize,
}

type Phrases = Vec<(NounPhrase, usize)>;
type Places = Vec<(PlacePhrase, usize)>;

impl NounPhrase {
    /// How many places the phrase and those within it name to tell things apart.
    pub fn places_named(&self) -> usize {
        self.located.as_ref().map_or(0, |place| 1 + place.places_named())
    }
}

impl PlacePhrase {
    /// See [`NounPhrase::places_named`].
    pub fn places_named(&self) -> usize {
        match &self.kind {
            PlaceKind::On(phrase) | PlaceKind::Beside(phrase, _) => phrase.places_named(),
            PlaceKind::Between(first, second) => first.places_named() + second.places_named(),
            PlaceKind::Middle(group) => group.as_ref().map_or(0, NounPhrase::places_named),
            PlaceKind::History(owner, _) => owner.as_ref().map_or(0, NounPhrase::places_named),
            PlaceKind::MiddleOfWhole => 0,
        }
    }
}

impl Reader<'_> {
    /// All readings of a noun phrase, the longest first.
    pub fn noun_phrases(&self, at: usize, depth: u32) -> Phrases {
        if depth > MAX_DEPTH || !self.spend() {
            return Vec::new();
        }
        let mut readings: Phrases = Vec::new();
        for (start, quantity, quantified) in self.determiners(at) {
            if let Some((phrase, end)) = self.head(at, start, quantity, quantified) {
                readings.extend(self.modified(phrase, end, depth));
            }
        }
        for end in self.class(at, &self.lexicon.words.pronouns) {
            let pronoun = NounPhrase { pronoun: true, ..self.blank(at, end) };
            readings.push((pronoun, end));
        }
        keep_longest_first(&mut readings);
        readings
    }

    fn blank(&self, at: usize, end: usize) -> NounPhrase {
        NounPhrase {
            span: self.span(at, end),
            pronoun: false,
            quantity: Quantity::TheOne,
            quantified: false,
            noun: None,
            color: None,
            size: None,
            rank: None,
            free: false,
            other: false,
            located: None,
        }
    }

    fn determiners(&self, at: usize) -> Vec<(usize, Quantity, bool)> {
        let words = &self.lexicon.words;
        let of = |forms, quantity, quantified| {
            self.class(at, forms).into_iter().map(move |end| (end, quantity, quantified)).collect::<Vec<_>>()
        };
        let mut options = of(&words.definite, Quantity::TheOne, false);
        options.extend(of(&words.indefinite, Quantity::AnyOne, false));
        for (end, quantity, _) in of(&words.quantifiers, Quantity::Group, true) {
            let after_article = self.longest(end, &words.definite).unwrap_or(end);
            options.push((after_article, quantity, true));
        }
        options.push((at, Quantity::TheOne, false));
        options
    }

    /// Adjectives and noun after a determiner that ended at `start`.
    fn head(&self, at: usize, start: usize, quantity: Quantity, quantified: bool) -> Option<(NounPhrase, usize)> {
        let mut phrase = NounPhrase { quantity, quantified, ..self.blank(at, start) };
        let mut end = start;
        let mut adjectives = 0;
        while let Some(next) = self.adjective(&mut phrase, end) {
            end = next;
            adjectives += 1;
        }
        let words = &self.lexicon.words;
        if let Some(noun) = self.noun(end) {
            phrase.noun = Some(noun.noun);
            // "one of the cubes" is one cube.
            if noun.plural && phrase.quantity == Quantity::TheOne {
                phrase.quantity = Quantity::Group;
            }
            end = noun.end;
        } else if let Some(next) = self.longest(end, &words.things).filter(|_| end > at) {
            end = next;
        } else {
            let unknown = self.word(end).is_some_and(|word| !self.lexicon.known_words.contains(word));
            if start > at || adjectives > 0 || unknown {
                self.fail(end, if unknown { Expected::Noun } else { Expected::Other("a noun that I know") });
            }
            // "the red" after "the blue cube": a noun may be left out after a colour, not after nothing.
            if unknown || start == at || phrase.color.is_none() {
                return None;
            }
        }
        phrase.span = self.span(at, end);
        Some((phrase, end))
    }

    /// Reads one adjective at `at` into the phrase and gives its end.
    fn adjective(&self, phrase: &mut NounPhrase, at: usize) -> Option<usize> {
        let words = &self.lexicon.words;
        let at = if self.is_stop(at) && (phrase.color.is_some() || phrase.size.is_some()) { at + 1 } else { at };
        if let Some(end) = self.longest(at, &words.same) {
            return Some(end);
        }
        if let Some(end) = self.longest(at, &words.other) {
            // "another" is any other one.
            if self.is_word(at, "another") {
                phrase.quantity = Quantity::AnyOne;
            }
            phrase.other = true;
            return Some(end);
        }
        if let Some(end) = self.longest(at, &words.free) {
            phrase.free = true;
            return Some(end);
        }
        if let Some((number, end)) = self.number(at, &self.lexicon.ordinals) {
            let side = match phrase.rank {
                Some(Rank::FromSide(_, side)) => side,
                _ => Direction::Left,
            };
            phrase.rank = Some(Rank::FromSide(number, side));
            return Some(end);
        }
        if let Some((term, end)) = self.color(at) {
            phrase.color = Some(term);
            return Some(end);
        }
        if let Some((size, end)) = self.meaning(at, &self.lexicon.sizes) {
            phrase.size = Some(size);
            return Some(end);
        }
        if let Some((direction, end)) = self.meaning(at, &self.lexicon.directions) {
            let number = match phrase.rank {
                Some(Rank::FromSide(number, _)) => number,
                _ => 0,
            };
            phrase.rank = Some(Rank::FromSide(number, direction));
            return Some(end);
        }
        if let Some(end) = self.longest(at, &words.middle).filter(|&end| self.noun(end).is_some()) {
            phrase.rank = Some(Rank::Middle);
            return Some(end);
        }
        self.longest(at, &words.numerals)
    }

    /// The end of the colours and sizes at `at`.
    pub fn skip_adjectives(&self, mut at: usize) -> usize {
        let size = |at| self.meaning(at, &self.lexicon.sizes).map(|(_, end)| end);
        while let Some(end) = self.color(at).map(|(_, end)| end).or_else(|| size(at)) {
            at = end;
        }
        at
    }

    fn color(&self, at: usize) -> Option<(ColorTerm, usize)> {
        let (lightness, at) = self.meaning(at, &self.lexicon.shades).unwrap_or((0.0, at));
        let readings = self.lexicon.colors.iter().filter_map(|(term, forms)| Some((term, self.longest(at, forms)?)));
        let (term, end) = readings.max_by_key(|(_, end)| *end)?;
        let mut term = term.clone();
        term.lab.l = (term.lab.l + lightness).clamp(0.0, 100.0);
        // "blue-coloured" and the like.
        let suffix = ["colored", "coloured"].iter().any(|word| self.is_word(end, word));
        Some((term, if suffix { end + 1 } else { end }))
    }

    /// The noun at `at`, the longest first, as the library calls it.
    pub fn noun(&self, at: usize) -> Option<NounReading> {
        for length in (1..=3).rev() {
            let words: Vec<&str> = (at..at + length).map_while(|place| self.word(place)).collect();
            if words.len() < length {
                continue;
            }
            let text = words.join(" ");
            let singulars = [
                (Some(text.as_str()), false),
                (self.lexicon.plurals.get(&text).map(String::as_str), true),
                (text.strip_suffix('s'), true),
                (text.strip_suffix("es"), true),
            ];
            for (singular, plural) in singulars {
                let Some(singular) = singular else { continue };
                let noun = self.lexicon.aliases.get(singular).map_or(singular, String::as_str);
                // The library's own noun stands before an everyday word for another.
                let noun = if self.nouns.contains(singular) { singular } else { noun };
                if self.nouns.contains(noun) {
                    return Some(NounReading { noun: noun.to_owned(), plural, end: at + length });
                }
            }
        }
        None
    }

    /// The phrase with nothing, one or two modifiers after it.
    fn modified(&self, phrase: NounPhrase, end: usize, depth: u32) -> Phrases {
        let mut readings: Phrases = vec![(phrase, end)];
        let mut frontier = readings.clone();
        for _ in 0..MAX_MODIFIERS {
            let longer = frontier.iter().flat_map(|(phrase, end)| self.modifiers(phrase, *end, depth));
            frontier = longer.take(MAX_READINGS).collect();
            readings.extend(frontier.iter().cloned());
        }
        readings
    }

    fn modifiers(&self, phrase: &NounPhrase, at: usize, depth: u32) -> Phrases {
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
            for end in self.class(start, &words.standing) {
                let article = self.longest(end, &words.definite).unwrap_or(end);
                if let Some(whole) = self.longest(article, &words.whole) {
                    readings.push((phrase.clone(), whole));
                }
            }
            readings.extend(self.side(phrase, start));
            if phrase.located.is_none() {
                readings.extend(self.located(phrase, start, depth));
            }
        }
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
        let mut own = Vec::new();
        for end in self.class(at, &words.standing).into_iter().chain(self.class(at, &words.sources)) {
            let found = self.bare_places(end, depth + 1);
            // "the cube from its mat", "from the mat it is on": wherever it stands, so it tells nothing apart.
            let its = self.is_word(end, "its");
            for (place, end) in found {
                match &place.kind {
                    PlaceKind::On(_) if its => own.push((phrase.clone(), end)),
                    PlaceKind::History(None, PlaceReference::Now) => own.push((phrase.clone(), end)),
                    _ => places.push((place, end)),
                }
            }
        }
        let here = places.into_iter().filter(|(place, _)| !matches!(place.kind, PlaceKind::History(..)));
        let placed = here.map(|(place, end)| (NounPhrase { located: Some(Box::new(place)), ..phrase.clone() }, end));
        own.into_iter().chain(placed).collect()
    }
}

pub(super) fn keep_longest_first<T>(readings: &mut Vec<(T, usize)>) {
    readings.sort_by_key(|(_, end)| std::cmp::Reverse(*end));
    readings.truncate(MAX_READINGS);
}
