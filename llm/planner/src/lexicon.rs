//! Word classes, verb frames and phrase forms, read from the data files in `lexicon/`.
//!
//! The rules of language that name words are data; the code knows only how phrases nest. Nouns are not here:
//! they come from the template library's synopses, and `nouns.toml` adds everyday words for them.

mod raw;

use crate::task::{ColorTerm, Direction, Size, Variation};
use acm_concept::{color::Lab, template::TemplateLibrary};
use acm_memory::query::PlaceReference;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;

/// Why a lexicon file was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LexiconError {
    /// A file that must be there is not.
    #[error("the lexicon has no file {file}")]
    Missing {
        /// Its name.
        file: String,
    },
    /// Not TOML, an unknown field, or a value of the wrong type.
    #[error("lexicon file {file}: {reason}")]
    Format {
        /// Its name.
        file: String,
        /// The parser's message, with a suggestion where a field's name is near a known one.
        reason: String,
    },
    /// A phrase or form with a slot or word that makes no sense there.
    #[error("lexicon file {file}: the form `{form}` {reason}")]
    Form {
        /// Its name.
        file: String,
        /// The form.
        form: String,
        /// What is wrong.
        reason: String,
    },
}

/// A gap in a form that a phrase fills.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Slot {
    /// The thing acted on.
    Object,
    /// A destination with its preposition.
    Place,
    /// A destination whose preposition says that something goes there.
    Towards,
    /// A destination without preposition.
    Thing,
    /// How often.
    Times,
    /// The thing acted on, one only.
    Single,
    /// What it is done with.
    Tool,
    /// What is or is not so.
    Condition,
    /// A side.
    Side,
    /// A noun that says nothing more.
    Kind,
    /// A word for what shows something.
    Sign,
    /// Several things, parted by commas, "and" or "then".
    List,
    /// "not", for a condition that must not hold.
    Not,
    /// The thing whose past is meant.
    It,
    /// "its", "the", or a genitive.
    Its,
    /// A word for a place, or a noun.
    Spot,
}

/// One step of a form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Element {
    /// One of these words.
    Words { any: Vec<String>, optional: bool },
    /// A phrase.
    Slot { slot: Slot, optional: bool },
}

/// A sequence of words and slots.
pub(crate) type Form = Vec<Element>;

/// What a verb frame asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum FrameGoal {
    /// The object stands at the destination.
    At,
    /// The object and the thing named in place of a destination change places.
    Exchange,
    /// The object is held, or is not.
    Holding(bool),
    /// A function is performed on the object.
    Performed(String),
    /// A predicate holds of the object, or does not.
    State(String, bool),
    /// Something about the object, a group, is varied until a sign shows; the form says what.
    Find,
    /// Nothing is done before the condition holds.
    Await,
    /// Nothing has to be done.
    Nothing,
}

/// One form of a verb frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FrameForm {
    pub form: Form,
    pub history: Option<PlaceReference>,
    pub times: Option<u32>,
    /// What is tried, for the goal `find`.
    pub vary: Option<Variation>,
    /// Only together with what says when it is right.
    pub needs_sign: bool,
}

/// Verbs that are used alike, in one of their senses.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Frame {
    pub name: String,
    pub goal: FrameGoal,
    pub said_of_object: bool,
    /// The state in which the tool must be: "read the card under the lamp".
    pub tool_state: Option<String>,
    /// What the object goes into, for verbs that say it themselves: "discard".
    pub into: Option<String>,
    /// What the object goes into is whatever contains: "insert".
    pub into_any: bool,
    pub forms: Vec<FrameForm>,
}

/// What a modifier of a clause says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ModifierKind {
    /// As often as a thing shows.
    Shown,
    /// The same in front of the clause: "the card says how often to press the key".
    ShownFirst,
    /// Until a condition holds.
    Until,
    /// Only if a condition holds.
    If,
    /// Only if it does not.
    Unless,
    /// In which order: beginning at a side, or as the things are named.
    Order,
    /// To try what stands there.
    EachTry,
    /// One thing after the other.
    OneAtATime,
    /// Never two in one place.
    OneToAPlace,
    /// A place for what is put aside.
    Aside,
    /// Each takes the other's place, perhaps with its heading.
    TakesPlace,
    /// What is tried may lie the other way round.
    MayTurn,
}

/// A form of a modifier.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ModifierForm {
    pub kind: ModifierKind,
    /// Whether what takes another one's place takes over its heading.
    pub heading: bool,
    pub form: Form,
}

/// A state with the words that say it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StateWords {
    pub predicate: String,
    pub holds: bool,
    /// The subject of a statement is no argument.
    pub said_of_moment: bool,
    /// It is said of what was spoken of last.
    pub said_of_last: bool,
    pub adjectives: Vec<Form>,
    pub forms: Vec<Form>,
}

/// A phrase for a place in an object's past.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HistoryForm {
    pub reference: PlaceReference,
    pub form: Form,
}

/// Closed word classes as phrases without slots.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Words {
    pub ignored: Vec<Form>,
    pub connectors: Vec<Form>,
    pub lead_ins: Vec<Form>,
    pub auxiliaries: Vec<Form>,
    pub after_markers: Vec<Form>,
    pub before_markers: Vec<Form>,
    pub earlier_markers: Vec<Form>,
    pub negations: Vec<Form>,
    pub disturbing: Vec<Form>,
    pub definite: Vec<Form>,
    pub indefinite: Vec<Form>,
    pub quantifiers: Vec<Form>,
    pub pronouns: Vec<Form>,
    pub things: Vec<Form>,
    pub places: Vec<Form>,
    pub other: Vec<Form>,
    pub free: Vec<Form>,
    pub same: Vec<Form>,
    pub prepositions: Vec<Form>,
    pub standing: Vec<Form>,
    pub back: Vec<Form>,
    pub relative_links: Vec<Form>,
    pub sources: Vec<Form>,
    pub middle: Vec<Form>,
    pub middle_of: Vec<Form>,
    pub between: Vec<Form>,
    pub whole: Vec<Form>,
    pub collectives: Vec<Form>,
    pub plural_pronouns: Vec<Form>,
    pub ones: Vec<Form>,
    pub several_ones: Vec<Form>,
    pub idle_adjectives: Vec<Form>,
    pub partitive: Vec<Form>,
    pub directed: Vec<Form>,
    pub packages: Vec<Form>,
    pub slices: Vec<Form>,
    pub several_slices: Vec<Form>,
    pub measures: Vec<Form>,
    pub twins: Vec<Form>,
    pub twin_alone: Vec<Form>,
    pub conjunctions: Vec<Form>,
    pub own_links: Vec<Form>,
    pub signs: Vec<Form>,
    pub what: Vec<Form>,
    pub twin_links: Vec<Form>,
    pub containing: Vec<Form>,
    pub within_it: Vec<Form>,
    pub inside_it: Vec<Form>,
    pub that_you: Vec<Form>,
    pub last: Vec<Form>,
    pub not: Vec<Form>,
    pub prepositions_in: Vec<Form>,
    pub prepositions_on: Vec<Form>,
    pub prepositions_under: Vec<Form>,
    pub if_markers: Vec<Form>,
    pub unless_markers: Vec<Form>,
    pub otherwise: Vec<Form>,
    pub once_markers: Vec<Form>,
    pub there: Vec<Form>,
    pub whereabouts: Vec<Form>,
    pub above: Vec<Form>,
}

/// Everything the front end knows of language.
#[derive(Debug, Clone, PartialEq)]
pub struct Lexicon {
    pub(crate) words: Words,
    pub(crate) directions: Vec<(Direction, Vec<Form>)>,
    pub(crate) beside: Vec<(Option<Direction>, Vec<Form>)>,
    pub(crate) sizes: Vec<(Size, Vec<Form>)>,
    pub(crate) ordinals: Vec<(u32, Form)>,
    pub(crate) times: Vec<(u32, Form)>,
    pub(crate) colors: Vec<(ColorTerm, Vec<Form>)>,
    /// Changes of lightness by "dark" and its like.
    pub(crate) shades: Vec<(f64, Vec<Form>)>,
    /// How many: "two", "a couple of".
    pub(crate) counts: Vec<(u32, Form)>,
    pub(crate) states: Vec<StateWords>,
    pub(crate) modifiers: Vec<ModifierForm>,
    /// The nouns that an everyday word may stand for.
    pub(crate) aliases: BTreeMap<String, Vec<String>>,
    pub(crate) plurals: BTreeMap<String, String>,
    pub(crate) frames: Vec<Frame>,
    /// Frames by inflected verb.
    pub(crate) verbs: BTreeMap<String, Vec<usize>>,
    pub(crate) history: Vec<HistoryForm>,
    /// Every single word that some class holds, to tell an unknown noun from a misplaced word.
    pub(crate) known_words: BTreeSet<String>,
    /// Every single word of a noun, or of an everyday word for one.
    pub(crate) noun_words: BTreeSet<String>,
}

impl Lexicon {
    /// Reads a lexicon from named texts: `words.toml`, `nouns.toml`, `household.toml`, `colors.toml`, `verbs.toml`,
    /// `states.toml`, `modifiers.toml`, `history.toml`.
    /// [`embedded_lexicon`](crate::embedded_lexicon) gives those that ship inside the binary, to begin with.
    pub fn parse(files: &BTreeMap<String, String>) -> Result<Lexicon, LexiconError> {
        raw::parse(files)
    }
    /// The nouns that an everyday word may stand for.
    pub(crate) fn meanings(&self, word: &str) -> impl Iterator<Item = &str> {
        self.aliases.get(word).into_iter().flatten().map(String::as_str)
    }
    /// The same lexicon without some everyday words for nouns.
    pub fn without_words(mut self, words: &BTreeSet<String>) -> Lexicon {
        self.aliases.retain(|word, _| !words.contains(word));
        self
    }
    /// All everyday words for nouns.
    pub fn everyday_words(&self) -> impl Iterator<Item = &str> {
        self.aliases.keys().map(String::as_str)
    }
    /// The everyday words for the nouns of a library.
    pub(crate) fn everyday_words_of(&self, library: &TemplateLibrary) -> impl Iterator<Item = &str> {
        let there = |noun: &String| library.with_noun(noun).next().is_some();
        self.aliases.iter().filter(move |(_, nouns)| nouns.iter().any(there)).map(|(word, _)| word.as_str())
    }
    /// All words of the classes, forms and verbs.
    pub(crate) fn every_word(&self) -> impl Iterator<Item = &str> {
        self.known_words.iter().map(String::as_str)
    }
    /// Whether a word is one: of a class, a form or a verb, or part of a noun or of an everyday word for one.
    pub(crate) fn knows(&self, word: &str) -> bool {
        self.known_words.contains(word) || self.noun_words.contains(word)
    }
    /// The everyday words for a noun.
    pub fn words_for(&self, noun: &str) -> Vec<&str> {
        let means = |nouns: &Vec<String>| nouns.iter().any(|one| one == noun);
        self.aliases.iter().filter(|(_, nouns)| means(nouns)).map(|(word, _)| word.as_str()).collect()
    }
    /// The colour terms with their prototypes.
    pub fn colors(&self) -> impl Iterator<Item = &ColorTerm> {
        self.colors.iter().map(|(term, _)| term)
    }
    /// Words that make a colour darker or lighter, each with the change of lightness (CIELAB L).
    pub(crate) fn shade_words(&self) -> impl Iterator<Item = (&str, f64)> {
        self.shades.iter().filter(|(lightness, _)| *lightness != 0.0).filter_map(|(lightness, forms)| {
            let Element::Words { any, .. } = forms.first()?.first()? else { return None };
            Some((any.first()?.as_str(), *lightness))
        })
    }
    /// The colour of this name, made darker or lighter.
    pub(crate) fn shaded(&self, name: &str, lightness: f64) -> Option<ColorTerm> {
        let mut term = self.colors().find(|term| term.name == name)?.clone();
        term.lab.l = (term.lab.l + lightness).clamp(0.0, 100.0);
        Some(term)
    }
    /// The colour word whose prototype is nearest to a surface colour. Lightness counts half: shading changes it
    /// most.
    pub(crate) fn nearest_color(&self, lab: &Lab) -> Option<&ColorTerm> {
        let distance = |term: &ColorTerm| {
            (0.25 * (term.lab.l - lab.l).powi(2) + (term.lab.a - lab.a).powi(2) + (term.lab.b - lab.b).powi(2)).sqrt()
        };
        self.colors().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

/// The inflected forms of a regular verb.
pub(crate) fn inflections(verb: &str) -> Vec<String> {
    let mut forms =
        vec![verb.to_owned(), format!("{verb}s"), format!("{verb}es"), format!("{verb}ing"), format!("{verb}ed")];
    if let Some(stem) = verb.strip_suffix('e') {
        forms.extend([format!("{stem}ing"), format!("{stem}ed")]);
    }
    if let Some(stem) = verb.strip_suffix('y') {
        forms.extend([format!("{stem}ies"), format!("{stem}ied")]);
    }
    let mut letters = verb.chars().rev();
    if let (Some(last), Some(before)) = (letters.next(), letters.next()) {
        let vowel = |c: char| "aeiou".contains(c);
        if !vowel(last) && vowel(before) && !"wxy".contains(last) {
            forms.extend([format!("{verb}{last}ing"), format!("{verb}{last}ed")]);
        }
    }
    forms
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics fails, which is what it shall do")]
    use super::*;

    fn files() -> BTreeMap<String, String> {
        crate::planner::embedded_lexicon()
    }

    #[test]
    fn verbs_are_found_in_every_inflection() {
        let lexicon = Lexicon::parse(&files()).unwrap();
        for word in
            ["put", "putting", "brought", "carries", "moving", "moved", "pressing", "grabbed", "taken", "hitting"]
        {
            assert!(lexicon.verbs.contains_key(word), "{word}");
        }
    }

    #[test]
    fn an_unknown_field_is_refused_with_a_suggestion() {
        let mut files = files();
        files.get_mut("nouns.toml").unwrap().push_str("\n[[alias]]\nnoun = \"mat\"\nword = [\"rug\"]\n");
        let error = Lexicon::parse(&files).unwrap_err().to_string();
        assert!(error.contains("nouns.toml") && error.contains("did you mean `words`"), "{error}");
    }

    #[test]
    fn an_unknown_slot_and_a_missing_file_are_refused() {
        let mut broken = files();
        let text = broken["verbs.toml"].replace("{object} up|down|over|away? {place}", "{objekt} {place}");
        broken.insert("verbs.toml".into(), text);
        assert!(matches!(Lexicon::parse(&broken), Err(LexiconError::Form { form, .. }) if form.contains("objekt")));
        let mut fewer = files();
        fewer.remove("history.toml");
        assert_eq!(Lexicon::parse(&fewer), Err(LexiconError::Missing { file: "history.toml".into() }));
    }

    #[test]
    fn the_nearest_colour_word_of_a_shaded_surface_is_still_its_own() {
        let lexicon = Lexicon::parse(&files()).unwrap();
        for (rgb, word) in
            [([255, 0, 0], "red"), ([120, 15, 15], "red"), ([0, 128, 254], "blue"), ([11, 153, 101], "green")]
        {
            assert_eq!(lexicon.nearest_color(&Lab::from_srgb(rgb)).unwrap().name, word, "{rgb:?}");
        }
    }
}
