//! Noun phrases: determiners, adjectives, and the noun.

use super::{
    noun::SLICED,
    reader::{Expected, MAX_READINGS, Reader},
    syntax::{NounPhrase, Pronoun},
};
use crate::task::{ColorTerm, Direction, Quantity, Rank};

/// Phrases within phrases that are read: "the cube on the mat between the blocks".
pub(super) const MAX_DEPTH: u32 = 3;
/// Modifiers that may follow a noun.
const MAX_MODIFIERS: usize = 3;

pub(super) type Phrases = Vec<(NounPhrase, usize)>;

/// What stands before the adjectives.
#[derive(Clone)]
struct Determiner {
    end: usize,
    quantity: Quantity,
    each: bool,
    its: bool,
    owner: Option<NounPhrase>,
}

impl Reader<'_> {
    /// All readings of a noun phrase, the longest first.
    pub fn noun_phrases(&self, at: usize, depth: u32) -> Phrases {
        if depth > MAX_DEPTH || !self.spend() {
            return Vec::new();
        }
        if let Some(known) = self.phrases_known(at, depth) {
            return known;
        }
        let mut readings: Phrases = Vec::new();
        for determiner in self.determiners(at, depth) {
            for (phrase, end) in self.head(at, &determiner) {
                readings.extend(self.modified(phrase, end, depth));
            }
        }
        for (pronoun, forms) in
            [(Pronoun::One, &self.lexicon.words.pronouns), (Pronoun::Several, &self.lexicon.words.plural_pronouns)]
        {
            for end in self.class(at, forms) {
                readings.push((NounPhrase { pronoun: Some(pronoun), ..self.blank(at, end) }, end));
            }
        }
        // "what stands on the bench" is named by its place alone.
        for end in self.class(at, &self.lexicon.words.what) {
            let named = self.modified(self.blank(at, end), end, depth).into_iter();
            readings.extend(named.filter(|(phrase, _)| phrase.located.is_some()));
        }
        // "the edge of the tub" is the tub.
        let article = self.longest(at, &self.lexicon.words.definite).unwrap_or(at);
        // "the far corner of the desk"; in "the back of the toilet" the side itself is the place, "in front of it" is another.
        let described = self.meaning(article, &self.lexicon.directions).map(|(_, end)| end);
        let starts = Some(article).filter(|start| *start > at || described.is_none()).into_iter().chain(described);
        for end in starts.flat_map(|start| self.class(start, &self.lexicon.words.whereabouts)) {
            readings.extend(self.noun_phrases(end, depth + 1).into_iter().filter(|(phrase, _)| phrase.noun.is_some()));
        }
        keep_longest_first(&mut readings);
        self.know_phrases(at, depth, &readings);
        readings
    }

    pub(super) fn blank(&self, at: usize, end: usize) -> NounPhrase {
        NounPhrase {
            span: self.span(at, end),
            pronoun: None,
            quantity: Quantity::TheOne,
            each: false,
            its: false,
            noun: None,
            elided: false,
            color: None,
            size: None,
            rank: None,
            free: false,
            other: false,
            same: false,
            somewhere: false,
            states: Vec::new(),
            located: None,
            part_of: None,
            twin_of: None,
            contains: Vec::new(),
            handled: None,
        }
    }

    fn determiners(&self, at: usize, depth: u32) -> Vec<Determiner> {
        let words = &self.lexicon.words;
        let plain = |end: usize, quantity: Quantity| Determiner { end, quantity, each: false, its: false, owner: None };
        let mut options: Vec<Determiner> = Vec::new();
        for end in self.class(at, &words.definite) {
            let its = self.is_word(at, "its");
            // "the two cubes" are all that there are; how many is no description.
            let counted = self.number(end, &self.lexicon.counts).filter(|(count, _)| *count > 1);
            if let Some((_, after)) = counted {
                options.push(plain(after, Quantity::Group));
            }
            options.push(Determiner { its, ..plain(end, Quantity::TheOne) });
        }
        options.extend(self.class(at, &words.indefinite).into_iter().map(|end| plain(end, Quantity::AnyOne)));
        for end in self.class(at, &words.quantifiers) {
            let article = self.longest(end, &words.definite).unwrap_or(end);
            let counted = self.number(article, &self.lexicon.counts).map_or(article, |(_, after)| after);
            options.push(Determiner { each: true, ..plain(counted, Quantity::Group) });
        }
        if let Some((count, end)) = self.number(at, &self.lexicon.counts).filter(|(count, _)| *count > 1) {
            let of = self.longest(end, &words.partitive).unwrap_or(end);
            options.push(plain(of, Quantity::Count(count)));
        }
        // "the cabinet's top drawer".
        if depth == 0 && self.genitive_ahead(at) {
            for (owner, end) in self.noun_phrases(at, depth + 1) {
                if self.is_word(end, "'s") && owner.located.is_none() && owner.pronoun.is_none() {
                    let owner = Some(owner);
                    options.push(Determiner { owner, ..plain(end + 1, Quantity::TheOne) });
                }
            }
        }
        options.push(plain(at, Quantity::TheOne));
        options
    }

    fn genitive_ahead(&self, at: usize) -> bool {
        (at..self.tokens.len()).take_while(|place| self.word(*place).is_some()).any(|place| self.is_word(place, "'s"))
    }

    /// Adjectives and noun after a determiner.
    fn head(&self, at: usize, determiner: &Determiner) -> Phrases {
        let start = determiner.end;
        let mut phrase = NounPhrase {
            quantity: determiner.quantity,
            each: determiner.each,
            its: determiner.its,
            part_of: determiner.owner.clone().map(Box::new),
            ..self.blank(at, start)
        };
        let mut end = start;
        let mut adjectives = 0;
        let mut heads = Vec::new();
        let mut elided: Phrases = Vec::new();
        // "each behind its cube": a side may also begin a place.
        if determiner.each && self.meaning(start, &self.lexicon.beside).is_some() {
            elided.push((NounPhrase { elided: true, ..phrase.clone() }, start));
        }
        // Adjectives parted by a comma or "and" need their noun.
        let mut parted = false;
        loop {
            // A noun may begin with a word that is also an adjective: "cold drink", "orange".
            heads.extend(self.named(&phrase, end));
            // "red, green and blue": each may be a phrase of its own.
            if !parted && phrase.color.is_some() && (self.is_stop(end) || self.is_word(end, "and")) {
                elided.push((NounPhrase { elided: true, ..phrase.clone() }, end));
            }
            let parts = self.is_stop(end) || self.is_word(end, "and");
            let Some(next) = self.adjective(&mut phrase, end) else { break };
            parted |= parts;
            end = next;
            adjectives += 1;
        }
        let words = &self.lexicon.words;
        heads.extend(self.twin(&phrase, determiner, end));
        // "cook a slice": of what was spoken of.
        if let Some(next) = self.longest(end, &words.slices).filter(|_| heads.is_empty() && end > at) {
            let mut states = phrase.states.clone();
            states.push((SLICED.into(), true));
            heads.push((NounPhrase { elided: true, states, ..phrase.clone() }, next));
        }
        if heads.is_empty() {
            if let Some(next) = self.longest(end, &words.things).filter(|_| end > at) {
                let elided = self.longest(end, &words.ones).is_some();
                let several = self.longest(end, &words.several_ones).is_some();
                let quantity =
                    if several && phrase.quantity == Quantity::TheOne { Quantity::Group } else { phrase.quantity };
                heads.push((NounPhrase { elided, quantity, ..phrase }, next));
            } else {
                let unknown = self.word(end).is_some_and(|word| !self.lexicon.known_words.contains(word));
                if start > at || adjectives > 0 || unknown {
                    self.fail(end, if unknown { Expected::Noun } else { Expected::Other("a noun that I know") });
                }
                // "the red" after "the blue cube": a noun may be left out after a colour or a side, not after nothing.
                let rest =
                    phrase.color.is_some() || (start > at && (phrase.rank.is_some() || phrase.other)) || phrase.each;
                if !unknown && rest && !parted && start + adjectives > at && end > at {
                    heads.push((NounPhrase { elided: true, ..phrase }, end));
                }
            }
        }
        heads.extend(elided);
        for (phrase, end) in &mut heads {
            phrase.span = self.span(at, *end);
        }
        heads
    }

    /// The phrase with the noun at `end`.
    fn named(&self, phrase: &NounPhrase, end: usize) -> Phrases {
        let mut named = Vec::new();
        if let Some(reading) = self.noun(end) {
            let mut phrase = NounPhrase { noun: Some(reading.noun), ..phrase.clone() };
            for state in reading.states {
                if !phrase.states.contains(&state) {
                    phrase.states.push(state);
                }
            }
            // "one of the cubes" is one cube.
            if reading.plural && phrase.quantity == Quantity::TheOne {
                phrase.quantity = Quantity::Group;
            }
            // "the desk drawer" is the drawer of the desk.
            if let Some(part) = self.noun(reading.end).filter(|_| !reading.plural && phrase.part_of.is_none()) {
                let whole = NounPhrase { noun: phrase.noun.clone(), ..self.blank(end, reading.end) };
                let quantity = match (part.plural, phrase.quantity) {
                    (true, Quantity::TheOne) => Quantity::Group,
                    (_, quantity) => quantity,
                };
                let part_of = Some(Box::new(whole));
                let compound = NounPhrase { noun: Some(part.noun), part_of, quantity, ..phrase.clone() };
                named.push((compound, part.end));
            }
            // "two remote's": an apostrophe too many.
            let counted = matches!(phrase.quantity, Quantity::Count(_)) && self.is_word(reading.end, "'s");
            named.push((phrase, reading.end + usize::from(counted)));
        }
        named
    }

    /// Reads one adjective at `at` into the phrase and gives its end.
    fn adjective(&self, phrase: &mut NounPhrase, at: usize) -> Option<usize> {
        let words = &self.lexicon.words;
        let described = phrase.color.is_some() || phrase.size.is_some() || !phrase.states.is_empty();
        let at = if (self.is_stop(at) || self.is_word(at, "and")) && described { at + 1 } else { at };
        if let Some(end) = self.longest(at, &words.same) {
            phrase.same = true;
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
        if let Some((state, holds, end)) = self.state_adjective(at) {
            phrase.states.push((state, holds));
            return Some(end);
        }
        // "the slice apple".
        if let Some(end) = self.longest(at, &words.slices).filter(|end| self.noun(*end).is_some()) {
            phrase.states.push((SLICED.into(), true));
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
            // Of "yellow and white" the first is the one that is looked for.
            phrase.color.get_or_insert(term);
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
        if let Some(end) = self.longest(at, &words.middle).filter(|&end| self.noun_ahead(end)) {
            phrase.rank = Some(Rank::Middle);
            return Some(end);
        }
        self.longest(at, &words.idle_adjectives)
    }

    /// "its twin", "the cube's twin", "the twin of the cube".
    fn twin(&self, phrase: &NounPhrase, determiner: &Determiner, end: usize) -> Phrases {
        let Some(after) = self.longest(end, &self.lexicon.words.twins) else { return Vec::new() };
        let twin = |model: NounPhrase| NounPhrase {
            twin_of: Some(Box::new(model)),
            part_of: None,
            its: false,
            ..phrase.clone()
        };
        if let Some(owner) = &determiner.owner {
            return vec![(twin(owner.clone()), after)];
        }
        if determiner.its {
            let it = NounPhrase { pronoun: Some(Pronoun::One), ..self.blank(end, end) };
            return vec![(twin(it), after)];
        }
        if !self.is_word(after, "of") {
            return Vec::new();
        }
        self.noun_phrases(after + 1, 1).into_iter().map(|(model, end)| (twin(model), end)).collect()
    }

    /// Whether a noun stands at `at`, or behind adjectives.
    fn noun_ahead(&self, at: usize) -> bool {
        self.noun(self.skip_adjectives(at)).is_some() || self.longest(at, &self.lexicon.words.ones).is_some()
    }

    pub(super) fn state_adjective(&self, at: usize) -> Option<(String, bool, usize)> {
        let readings =
            self.lexicon.states.iter().filter_map(|state| Some((state, self.longest(at, &state.adjectives)?)));
        let (state, end) = readings.max_by_key(|(_, end)| *end)?;
        Some((state.predicate.clone(), state.holds, end))
    }

    /// The end of the colours and sizes at `at`.
    pub fn skip_adjectives(&self, mut at: usize) -> usize {
        let size = |at| self.meaning(at, &self.lexicon.sizes).map(|(_, end)| end);
        while let Some(end) = self.color(at).map(|(_, end)| end).or_else(|| size(at)) {
            at = end;
        }
        at
    }

    pub(super) fn color(&self, at: usize) -> Option<(ColorTerm, usize)> {
        let (lightness, at) = self.meaning(at, &self.lexicon.shades).unwrap_or((0.0, at));
        let readings = self.lexicon.colors.iter().filter_map(|(term, forms)| Some((term, self.longest(at, forms)?)));
        let (term, end) = readings.max_by_key(|(_, end)| *end)?;
        let mut term = term.clone();
        term.lab.l = (term.lab.l + lightness).clamp(0.0, 100.0);
        // "blue-coloured" and the like.
        let suffix = ["colored", "coloured"].iter().any(|word| self.is_word(end, word));
        Some((term, if suffix { end + 1 } else { end }))
    }

    /// The phrase with nothing or some modifiers after it.
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
}

pub(super) fn keep_longest_first<T>(readings: &mut Vec<(T, usize)>) {
    readings.sort_by_key(|(_, end)| std::cmp::Reverse(*end));
    readings.truncate(MAX_READINGS);
}
