//! Nouns: what the library calls things, and everyday words for it.

use super::{
    reader::Reader,
    role::{CONTAINS, Role},
    syntax::NounPhrase,
};
use crate::lexicon::{Element, Form};

/// The state of what is spoken of as a slice.
pub(super) const SLICED: &str = "sliced";
/// Words of the longest noun.
const MAX_WORDS: usize = 4;

/// A noun as read.
pub(super) struct NounReading {
    pub noun: String,
    pub plural: bool,
    /// What the measure says: "a slice of cold bread" is sliced and cold.
    pub states: Vec<(String, bool)>,
    pub end: usize,
}

impl Reader<'_> {
    /// The noun at `at`, the longest first, as the library calls it.
    pub fn noun(&self, at: usize) -> Option<NounReading> {
        let plain = self.plain_noun(at);
        let longest = plain.as_ref().map_or(at, |reading| reading.end);
        // "slice of bread", "bar of soap"; and "bread slice".
        let measured = self.measured_noun(at).filter(|reading| reading.end > longest);
        let mut reading = measured.or(plain)?;
        // "the cookies box": what it comes in.
        if let Some(end) = self.longest(reading.end, &self.lexicon.words.packages).filter(|_| !reading.plural) {
            reading.end = end;
        }
        if let Some(end) = self.longest(reading.end, &self.lexicon.words.slices) {
            reading.plural = self.longest(reading.end, &self.lexicon.words.several_slices).is_some();
            reading.states.push((SLICED.into(), true));
            reading.end = end;
        }
        Some(reading)
    }

    fn plain_noun(&self, at: usize) -> Option<NounReading> {
        for length in (1..=MAX_WORDS).rev() {
            let words: Vec<&str> = (at..at + length).map_while(|place| self.word(place)).collect();
            if words.len() < length {
                continue;
            }
            if let Some((noun, plural)) = self.noun_of(&words.join(" ")) {
                return Some(NounReading { noun, plural, states: Vec::new(), end: at + length });
            }
        }
        None
    }

    /// A measure word, "of", and a noun: a slice of it is sliced; else "bar of soap" is the soap bar, or just soap.
    fn measured_noun(&self, at: usize) -> Option<NounReading> {
        let words = &self.lexicon.words;
        let (measure, sliced) = match self.longest(at, &words.slices) {
            Some(end) => (end, true),
            None => (self.longest(at, &words.measures)?, false),
        };
        if !self.is_word(measure, "of") {
            return None;
        }
        let article =
            [&words.definite, &words.indefinite].into_iter().find_map(|forms| self.longest(measure + 1, forms));
        let mut start = self.skip_adjectives(article.unwrap_or(measure + 1));
        let mut states = Vec::new();
        while let Some((state, holds, end)) = self.state_adjective(start) {
            states.push((state, holds));
            start = end;
        }
        let mut reading = self.plain_noun(start)?;
        let measured = self.word(at).unwrap_or_default();
        reading.plural = self.singulars(measured).into_iter().any(|(_, plural)| plural) && measured.ends_with('s');
        if sliced {
            states.push((SLICED.into(), true));
        }
        reading.states = states;
        if !sliced {
            let compound = self
                .singulars(measured)
                .into_iter()
                .find_map(|(one, _)| self.noun_of(&format!("{} {one}", reading.noun)));
            match compound {
                Some((noun, _)) => reading.noun = noun,
                // "a pot of apples" is a pot where there are pots, and apples else.
                None if self.plain_noun(at).is_some_and(|container| self.holds(&container.noun)) => return None,
                None => {}
            }
        }
        Some(reading)
    }

    /// Whether a phrase is a measure that is a thing of its own here: a pot, a box.
    pub(super) fn measures(&self, phrase: &NounPhrase) -> bool {
        let Some(noun) = phrase.noun.as_deref().filter(|noun| self.holds(noun)) else { return false };
        let one_of =
            |form: &Form| matches!(&form[..], [Element::Words { any, .. }] if any.iter().any(|word| word == noun));
        self.lexicon.words.measures.iter().any(one_of)
    }

    fn holds(&self, noun: &str) -> bool {
        Role::Affordance(CONTAINS).fits(self.library, Some(noun))
    }

    /// The singulars that a word may be of, with whether it is a plural.
    fn singulars(&self, text: &str) -> Vec<(String, bool)> {
        let mut singulars = vec![(text.to_owned(), false)];
        singulars.extend(self.lexicon.plurals.get(text).map(|one| (one.clone(), true)));
        singulars.extend(text.strip_suffix('s').map(|one| (one.to_owned(), true)));
        singulars.extend(text.strip_suffix("es").map(|one| (one.to_owned(), true)));
        singulars.extend(text.strip_suffix("ies").map(|one| (format!("{one}y"), true)));
        singulars.extend(text.strip_suffix("ves").map(|one| (format!("{one}fe"), true)));
        singulars.extend(text.strip_suffix("ves").map(|one| (format!("{one}f"), true)));
        singulars
    }

    fn noun_of(&self, text: &str) -> Option<(String, bool)> {
        for (singular, plural) in self.singulars(text) {
            // The library's own noun stands before an everyday word for another.
            if self.nouns.contains(singular.as_str()) {
                return Some((singular, plural));
            }
            // An everyday word for several of the library's nouns does not say which.
            let mut meant = self.lexicon.meanings(&singular).filter(|noun| self.nouns.contains(*noun));
            if let (Some(noun), None) = (meant.next(), meant.next()) {
                return Some((noun.to_owned(), plural));
            }
        }
        None
    }
}
