//! Matching of word classes and forms against the tokens, with the farthest failure kept for the report.

use super::{
    phrase::Phrases,
    syntax::{NounPhrase, PlaceKind, PlacePhrase, Relation, Statement},
    token::Token,
};
use crate::{
    lexicon::{Element, Form, Lexicon, Slot},
    task::{Direction, Span},
};
use acm_concept::template::TemplateLibrary;
use std::{
    cell::{Cell, RefCell},
    collections::{BTreeMap, BTreeSet},
};

/// Element matches that one instruction may cost: text that is so ambiguous is refused.
const BUDGET: u32 = 400_000;
/// Members of a list beyond the first.
const MAX_LISTED: usize = 5;
/// Words in which a list must come to its "and".
const MAX_LIST_WORDS: usize = 16;
/// Readings of one phrase that are kept.
pub(super) const MAX_READINGS: usize = 24;

/// What was expected where the reading stopped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Expected {
    /// A noun of the library.
    Noun,
    /// A verb.
    Verb,
    /// Something else, in words.
    Other(&'static str),
}

/// A failure at a token.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Failure {
    pub at: usize,
    pub expected: Expected,
}

/// What the slots of a form were filled with.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Captures {
    pub object: Option<NounPhrase>,
    /// The object was named before the verb: its slot takes no words.
    pub object_given: bool,
    /// More objects of the same clause.
    pub also: Vec<NounPhrase>,
    pub place: Option<PlacePhrase>,
    pub tool: Option<NounPhrase>,
    pub condition: Option<Statement>,
    pub side: Option<Direction>,
    pub negated: bool,
    pub times: Option<u32>,
    pub it: Option<NounPhrase>,
    pub list: Vec<NounPhrase>,
}

/// Reads phrases from the tokens of one instruction.
pub(super) struct Reader<'a> {
    pub lexicon: &'a Lexicon,
    pub library: &'a TemplateLibrary,
    pub tokens: &'a [Token],
    pub nouns: BTreeSet<&'a str>,
    spent: Cell<u32>,
    failure: RefCell<Option<Failure>>,
    /// Noun phrases by where they begin and how deep they stand: the same ones are asked for again and again.
    phrases: RefCell<BTreeMap<(usize, u32), Phrases>>,
}

impl<'a> Reader<'a> {
    pub fn new(lexicon: &'a Lexicon, library: &'a TemplateLibrary, tokens: &'a [Token]) -> Reader<'a> {
        let nouns = library.iter().flat_map(|t| t.synopsis.nouns.iter().map(|noun| noun.noun.as_str())).collect();
        Reader {
            lexicon,
            library,
            tokens,
            nouns,
            spent: Cell::new(0),
            failure: RefCell::default(),
            phrases: RefCell::default(),
        }
    }
    pub(super) fn phrases_known(&self, at: usize, depth: u32) -> Option<Phrases> {
        self.phrases.borrow().get(&(at, depth)).cloned()
    }
    pub(super) fn know_phrases(&self, at: usize, depth: u32, phrases: &Phrases) {
        self.phrases.borrow_mut().insert((at, depth), phrases.clone());
    }
    /// Whether the budget is used up.
    pub fn exhausted(&self) -> bool {
        self.spent.get() >= BUDGET
    }
    pub fn spend(&self) -> bool {
        self.spent.set(self.spent.get().saturating_add(1));
        !self.exhausted()
    }
    /// Remembers a failure if it lies farther on than the last; an unknown noun outweighs others at its place.
    pub fn fail(&self, at: usize, expected: Expected) {
        let mut failure = self.failure.borrow_mut();
        let better = match &*failure {
            None => true,
            Some(last) => at > last.at || (at == last.at && expected == Expected::Noun),
        };
        if better {
            *failure = Some(Failure { at, expected });
        }
    }
    /// Remembers a failure unless one lies farther on.
    pub fn insist(&self, at: usize, expected: Expected) {
        let mut failure = self.failure.borrow_mut();
        if failure.as_ref().is_none_or(|last| last.at <= at) {
            *failure = Some(Failure { at, expected });
        }
    }
    pub fn failure(&self) -> Option<Failure> {
        self.failure.borrow().clone()
    }
    /// The word at a place; `None` for a stop or the end.
    pub fn word(&self, at: usize) -> Option<&str> {
        self.tokens.get(at).filter(|token| !token.stop).map(|token| token.text.as_str())
    }
    pub fn is_word(&self, at: usize, word: &str) -> bool {
        self.word(at) == Some(word)
    }
    pub fn is_comma(&self, at: usize) -> bool {
        self.tokens.get(at).is_some_and(|token| token.stop && token.text == ",")
    }
    pub fn is_stop(&self, at: usize) -> bool {
        self.tokens.get(at).is_some_and(|token| token.stop)
    }
    /// The characters that the tokens `start..end` cover.
    pub fn span(&self, start: usize, end: usize) -> Span {
        let last = end.max(start + 1) - 1;
        let fallback = self.tokens.last().map_or(Span { start: 0, end: 0 }, |token| token.span);
        let get = |at: usize| self.tokens.get(at).map_or(fallback, |token| token.span);
        get(start).join(get(last))
    }
    /// Ends of all readings of a word class at `at`, the longest first.
    pub fn class(&self, at: usize, forms: &[Form]) -> Vec<usize> {
        let mut ends: Vec<usize> = forms.iter().flat_map(|form| self.words(at, form)).filter(|&end| end > at).collect();
        ends.sort_unstable_by(|a, b| b.cmp(a));
        ends.dedup();
        ends
    }
    /// End of the longest reading of a word class.
    pub fn longest(&self, at: usize, forms: &[Form]) -> Option<usize> {
        self.class(at, forms).first().copied()
    }
    /// The longest reading of classes with a meaning each.
    pub fn meaning<T: Copy>(&self, at: usize, classes: &[(T, Vec<Form>)]) -> Option<(T, usize)> {
        let readings = classes.iter().filter_map(|(meaning, forms)| Some((*meaning, self.longest(at, forms)?)));
        readings.max_by_key(|(_, end)| *end)
    }
    /// The longest reading of a number word.
    pub fn number(&self, at: usize, numbers: &[(u32, Form)]) -> Option<(u32, usize)> {
        let readings = numbers.iter().flat_map(|(number, form)| self.words(at, form).into_iter().map(|e| (*number, e)));
        readings.filter(|(_, end)| *end > at).max_by_key(|(_, end)| *end)
    }
    fn words(&self, at: usize, form: &[Element]) -> Vec<usize> {
        self.form(at, form, &Captures::default(), 0).into_iter().map(|(_, end)| end).collect()
    }
    /// All readings of a form at `at` with what its slots hold, in the order of preference.
    pub fn form(&self, at: usize, form: &[Element], captures: &Captures, depth: u32) -> Vec<(Captures, usize)> {
        let Some((element, rest)) = form.split_first() else { return vec![(captures.clone(), at)] };
        if !self.spend() {
            return Vec::new();
        }
        let (mut readings, optional) = match element {
            Element::Words { any, optional } => {
                let matches = self.word(at).is_some_and(|word| any.iter().any(|known| known == word));
                (if matches { self.form(at + 1, rest, captures, depth) } else { Vec::new() }, *optional)
            }
            Element::Slot { slot, optional } => {
                let filled = self.fill(at, *slot, captures, depth);
                let followed = filled.into_iter().flat_map(|(captures, end)| self.form(end, rest, &captures, depth));
                (followed.take(MAX_READINGS).collect(), *optional)
            }
        };
        if optional {
            readings.extend(self.form(at, rest, captures, depth));
        }
        readings.truncate(MAX_READINGS);
        readings
    }
    fn fill(&self, at: usize, slot: Slot, captures: &Captures, depth: u32) -> Vec<(Captures, usize)> {
        let with = |change: &dyn Fn(&mut Captures), end: usize| {
            let mut captures = captures.clone();
            change(&mut captures);
            (captures, end)
        };
        match slot {
            Slot::Object if captures.object_given => vec![(captures.clone(), at)],
            Slot::Object => {
                let lists = self.noun_phrase_lists(at, depth).into_iter();
                lists
                    .map(|((first, also), end)| {
                        with(&|c| (c.object, c.also) = (Some(first.clone()), also.clone()), end)
                    })
                    .collect()
            }
            Slot::Single if captures.object_given => vec![(captures.clone(), at)],
            Slot::Single => {
                let phrases = self.noun_phrases(at, depth).into_iter();
                phrases.map(|(phrase, end)| with(&|c| c.object = Some(phrase.clone()), end)).collect()
            }
            Slot::Tool => {
                let phrases = self.noun_phrases(at, depth).into_iter();
                phrases.map(|(phrase, end)| with(&|c| c.tool = Some(phrase.clone()), end)).collect()
            }
            Slot::Condition => {
                let statements = self.conditions(at).into_iter();
                statements.map(|(statement, end)| with(&|c| c.condition = Some(statement.clone()), end)).collect()
            }
            Slot::Side => {
                let sides = self.meaning(at, &self.lexicon.directions).into_iter();
                // "from left to right" begins at the first.
                sides.map(|(side, end)| with(&|c| c.side = c.side.or(Some(side)), end)).collect()
            }
            Slot::Kind => self.kinds(at).into_iter().map(|end| (captures.clone(), end)).collect(),
            Slot::Sign => self.signs(at).into_iter().map(|end| (captures.clone(), end)).collect(),
            Slot::List => {
                let lists = self.enumerations(at, depth).into_iter();
                lists.map(|(list, end)| with(&|c| c.list = list.clone(), end)).collect()
            }
            Slot::Not => match self.longest(at, &self.lexicon.words.not) {
                Some(end) => vec![with(&|c| c.negated = true, end)],
                None => Vec::new(),
            },
            Slot::Place => {
                // "a bowl with a spoon in it, in the sink": what is in a thing may be set off from where the thing goes.
                let filled = captures.object.as_ref().is_some_and(|object| !object.contains.is_empty());
                let start = if filled && self.is_comma(at) { at + 1 } else { at };
                let places = self.places(start, depth).into_iter();
                places.map(|(place, end)| with(&|c| c.place = Some(place.clone()), end)).collect()
            }
            Slot::Towards => {
                // "on the mat" says where a thing is that is taken, "to the mat" where it is taken to.
                let directed = self.longest(at, &self.lexicon.words.directed).is_some();
                let past = |place: &PlacePhrase| matches!(place.kind, PlaceKind::History(..));
                let places = self.places(at, depth).into_iter();
                places
                    .filter(|(place, _)| directed || past(place))
                    .map(|(place, end)| with(&|c| c.place = Some(place.clone()), end))
                    .collect()
            }
            Slot::Thing => {
                let places = self.bare_places(at, Relation::On, depth).into_iter();
                places.map(|(place, end)| with(&|c| c.place = Some(place.clone()), end)).collect()
            }
            Slot::Times if captures.times.is_some() => Vec::new(),
            Slot::Times => {
                let times = self.number(at, &self.lexicon.times).into_iter();
                times.map(|(times, end)| with(&|c| c.times = Some(times), end)).collect()
            }
            Slot::It => {
                let phrases = self.noun_phrases(at, depth + 1).into_iter().filter(|(p, _)| p.located.is_none());
                phrases.map(|(phrase, end)| with(&|c| c.it = Some(phrase.clone()), end)).collect()
            }
            Slot::Its => {
                let owners = self.owners(at, depth).into_iter();
                owners.map(|(owner, end)| with(&|c| c.it = owner.clone(), end)).collect()
            }
            Slot::Spot => self.spots(at).into_iter().map(|end| (captures.clone(), end)).collect(),
        }
    }
    /// "the red cube, the blue one and the can".
    pub(super) fn noun_phrase_lists(&self, at: usize, depth: u32) -> Vec<((NounPhrase, Vec<NounPhrase>), usize)> {
        let mut lists: Vec<((NounPhrase, Vec<NounPhrase>), usize)> = Vec::new();
        let mut open: Vec<((NounPhrase, Vec<NounPhrase>), usize)> =
            self.noun_phrases(at, depth).into_iter().map(|(phrase, end)| ((phrase, Vec::new()), end)).collect();
        for _ in 0..MAX_LISTED {
            let mut longer = Vec::new();
            for (list, end) in &open {
                // Before a list is ended by "and", commas part its members.
                let comma = self.is_stop(*end);
                let start = match self.longest(end + usize::from(comma), &self.lexicon.words.conjunctions) {
                    Some(start) => start,
                    None if comma && self.list_goes_on(end + 1) => end + 1,
                    None => continue,
                };
                for (next, end) in self.noun_phrases(start, depth) {
                    let mut list = list.clone();
                    list.1.push(next);
                    longer.push((list, end));
                }
            }
            longer.truncate(MAX_READINGS);
            lists.append(&mut open);
            if longer.is_empty() {
                break;
            }
            open = longer;
        }
        lists.append(&mut open);
        lists.sort_by_key(|(_, end)| std::cmp::Reverse(*end));
        lists.truncate(MAX_READINGS);
        lists
    }
    /// Whether an "and" comes before the next verb: a comma may then stand between members of a list.
    fn list_goes_on(&self, at: usize) -> bool {
        let verb = |place: &usize| self.word(*place).is_some_and(|word| self.lexicon.verbs.contains_key(word));
        (at.saturating_sub(1)..self.tokens.len().min(at + MAX_LIST_WORDS))
            .take_while(|place| !verb(place))
            .any(|place| self.longest(place, &self.lexicon.words.conjunctions).is_some())
    }
    /// A noun or a word for a thing, with adjectives: it says nothing here.
    fn kinds(&self, at: usize) -> Vec<usize> {
        let at = self.skip_adjectives(at);
        let mut ends = self.class(at, &self.lexicon.words.things);
        ends.extend(self.noun(at).map(|noun| noun.end));
        ends
    }
    /// "the green light", "the needle of the gauge": which thing has it nobody says.
    pub(super) fn signs(&self, at: usize) -> Vec<usize> {
        let words = &self.lexicon.words;
        let article = self.longest(at, &words.definite).or_else(|| self.longest(at, &words.indefinite));
        let Some(end) = self.longest(self.skip_adjectives(article.unwrap_or(at)), &words.signs) else {
            return Vec::new();
        };
        let mut ends = vec![end];
        if self.is_word(end, "of") {
            let article = self.longest(end + 1, &words.definite).unwrap_or(end + 1);
            ends.extend(self.kinds(article));
            ends.extend(self.longest(article, &words.signs));
        }
        ends.sort_unstable_by(|a, b| b.cmp(a));
        ends
    }
    /// "red, green, blue", "the red one, then the blue one".
    fn enumerations(&self, at: usize, depth: u32) -> Vec<(Vec<NounPhrase>, usize)> {
        let mut open: Vec<(Vec<NounPhrase>, usize)> =
            self.noun_phrases(at, depth).into_iter().map(|(phrase, end)| (vec![phrase], end)).collect();
        let mut lists = Vec::new();
        for _ in 0..MAX_LISTED {
            let mut longer = Vec::new();
            for (list, end) in &open {
                let mut next = *end;
                while self.is_comma(next) || self.is_word(next, "and") || self.is_word(next, "then") {
                    next += 1;
                }
                if next == *end {
                    continue;
                }
                let more = self.noun_phrases(next, depth).into_iter();
                longer.extend(more.map(|(phrase, end)| ([list.as_slice(), &[phrase]].concat(), end)));
            }
            longer.truncate(MAX_READINGS);
            lists.append(&mut open);
            open = longer;
        }
        lists.append(&mut open);
        lists.retain(|(list, _)| list.len() > 1);
        lists.sort_by_key(|(_, end)| std::cmp::Reverse(*end));
        lists.truncate(MAX_READINGS);
        lists
    }
    /// "its", "the" or "the cube's".
    fn owners(&self, at: usize, depth: u32) -> Vec<(Option<NounPhrase>, usize)> {
        let mut owners = Vec::new();
        if self.is_word(at, "its") || self.is_word(at, "the") {
            owners.push((None, at + 1));
        }
        for (phrase, end) in self.noun_phrases(at, depth + 1) {
            if self.is_word(end, "'s") && phrase.located.is_none() {
                owners.push((Some(phrase), end + 1));
            }
        }
        owners
    }
    /// Words for a place, with adjectives that say nothing more about it here.
    fn spots(&self, at: usize) -> Vec<usize> {
        let at = self.skip_adjectives(at);
        let mut ends = self.class(at, &self.lexicon.words.places);
        ends.extend(self.noun(at).map(|noun| noun.end));
        ends
    }
}
