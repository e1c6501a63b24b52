//! Sentences: clauses in the order of the text, with what they hang on.

use super::{
    reader::{Expected, Reader},
    syntax::{Guard, Modifier, NounPhrase, Order, Sentence, Statement},
};
use crate::lexicon::ModifierKind;

/// Most clauses of an instruction.
pub const MAX_CLAUSES: usize = 24;
/// Things that one sentence may say are there.
const MAX_THINGS: usize = 8;

/// What reading has come to.
#[derive(Default)]
struct Course {
    sentences: Vec<Sentence>,
    last_frame: Option<usize>,
    /// A leading "before ..." clause is done after the main clauses that follow it in its sentence.
    main_comes_before: bool,
    guard: Option<Guard>,
    guards: usize,
    /// Whether a sentence begins.
    fresh: bool,
}

impl Reader<'_> {
    /// Reads the whole text; `None` if some of it has no reading (the farthest failure says which).
    pub fn sentences(&self) -> Option<Vec<Sentence>> {
        let mut course = Course { fresh: true, ..Course::default() };
        let mut at = self.skip_links(0);
        while at < self.tokens.len() && course.sentences.len() <= MAX_CLAUSES {
            let end = self.sentence(&mut course, at)?;
            at = self.skip_links(end);
            let full_stop = (end..at).any(|place| self.tokens.get(place).is_some_and(|token| token.text == "."));
            course.main_comes_before &= !full_stop;
            course.fresh = full_stop || (end..at).any(|place| self.tokens.get(place).is_some_and(|t| t.text == ":"));
            // An "if" reaches to the end of its sentence, its "otherwise" to the end of the next.
            if full_stop && course.guard.is_some() && self.longest(at, &self.lexicon.words.otherwise).is_none() {
                course.guard = None;
            }
        }
        Some(course.sentences)
    }

    fn sentence(&self, course: &mut Course, at: usize) -> Option<usize> {
        let words = &self.lexicon.words;
        let begun = !course.sentences.is_empty();
        if let Some(end) = self.longest(at, &words.earlier_markers).filter(|_| begun) {
            course.main_comes_before = true;
            return Some(end);
        }
        if let Some(end) = self.guarded(course, at) {
            return Some(end);
        }
        if let Some((modifiers, start)) = self.leading(at, course.fresh) {
            let (mut clause, end) = self.clause(start, course.last_frame, false)?;
            clause.modifiers.splice(0..0, modifiers);
            course.last_frame = Some(clause.frame);
            let order = if course.main_comes_before { Order::BeforeLast } else { Order::Last };
            let guard = course.guard.clone().map(Box::new);
            course.sentences.push(Sentence::Do { clause: Box::new(clause), order, background: false, guard });
            return Some(end);
        }
        if let Some((modifier, end)) =
            self.manner(at).filter(|(modifier, _)| begun && modifier.kind != ModifierKind::EachTry)
        {
            course.sentences.push(Sentence::Manner { modifier: Box::new(modifier) });
            return Some(end);
        }
        if let Some(end) = self.longest(at, &words.negations) {
            let (sentence, end) = self.leave(end)?;
            course.sentences.push(sentence);
            return Some(end);
        }
        if let Some((condition, end)) = self.once(at) {
            // "raise it once it is hidden": no comma, and no link that was skipped, parts the two.
            let trails = begun && at > 0 && !self.is_stop(at - 1) && self.joins(at - 1);
            course.sentences.push(Sentence::Once { condition: Box::new(condition), trails });
            return Some(end);
        }
        let clause =
            |at, frame, subordinate| self.clause(at, frame, subordinate).map(|(clause, end)| (Box::new(clause), end));
        let guard = course.guard.clone().map(Box::new);
        let (sentence, end) = if let Some(start) = self.longest(at, &words.before_markers) {
            let (clause, end) = clause(start, None, true)?;
            course.main_comes_before = true;
            (Sentence::Do { clause, order: Order::Last, background: true, guard }, end)
        } else if let Some((clause, end)) =
            self.longest(at, &words.after_markers).and_then(|start| clause(start, None, true))
        {
            let trails = self.skip_links(end) >= self.tokens.len();
            let order = if trails && begun { Order::BeforeLast } else { Order::Last };
            (Sentence::Do { clause, order, background: true, guard }, end)
        } else if let Some((things, end)) = self.there(at).filter(|_| !begun) {
            (Sentence::There { things }, end)
        } else {
            let order = if course.main_comes_before { Order::BeforeLast } else { Order::Last };
            let (clause, end) = match clause(at, course.last_frame, false) {
                Some(read) => read,
                None => {
                    let (first, second, end) = self.sharing(at)?;
                    let clause = Box::new(first);
                    course.sentences.push(Sentence::Do { clause, order, background: false, guard: guard.clone() });
                    (Box::new(second), end)
                }
            };
            course.last_frame = Some(clause.frame);
            (Sentence::Do { clause, order, background: false, guard }, end)
        };
        course.sentences.push(sentence);
        let (trailing, end) = self.trailing(end);
        course.sentences.extend(trailing);
        Some(end)
    }

    /// "From left to right, one at a time, put ...": modifiers in front of the clause that they belong to. What begins a
    /// sentence belongs to what follows it; within one only what asks for a clause does.
    fn leading(&self, at: usize, fresh: bool) -> Option<(Vec<Modifier>, usize)> {
        let mut modifiers = Vec::new();
        let mut start = at;
        while let Some((mut modifier, end)) = self.clause_modifier(start) {
            let belongs = match modifier.kind {
                ModifierKind::Order | ModifierKind::OneAtATime | ModifierKind::OneToAPlace | ModifierKind::EachTry => {
                    fresh
                }
                ModifierKind::Aside | ModifierKind::Shown => fresh,
                ModifierKind::ShownFirst => true,
                _ => false,
            };
            if !belongs {
                break;
            }
            if modifier.kind == ModifierKind::ShownFirst {
                modifier.kind = ModifierKind::Shown;
            }
            modifiers.push(modifier);
            let parted = self.is_comma(end) || self.tokens.get(end).is_some_and(|token| token.text == ":");
            start = if parted { end + 1 } else { end };
        }
        let start = self.longest(start, &self.lexicon.words.lead_ins).unwrap_or(start);
        (!modifiers.is_empty() && self.clause(start, None, false).is_some()).then_some((modifiers, start))
    }

    /// Whether the word before belongs to a clause and is no link.
    fn joins(&self, at: usize) -> bool {
        self.longest(at, &self.lexicon.words.connectors).is_none()
    }

    /// "if the drawer is open", "otherwise".
    fn guarded(&self, course: &mut Course, at: usize) -> Option<usize> {
        let words = &self.lexicon.words;
        if let Some(end) = self.longest(at, &words.otherwise)
            && let Some(guard) = &mut course.guard
        {
            guard.otherwise = true;
            return Some(end);
        }
        let unless = self.longest(at, &words.unless_markers);
        let start = self.longest(at, &words.if_markers).or(unless)?;
        let (mut condition, end) = self.conditions(start).into_iter().find(|(_, end)| self.ends_clause(*end))?;
        condition.negated ^= unless.is_some();
        course.guards += 1;
        course.guard = Some(Guard { condition, otherwise: false, number: course.guards });
        Some(end)
    }

    /// "once it is hidden", "wait until the lamp is on".
    fn once(&self, at: usize) -> Option<(Statement, usize)> {
        let start = self.longest(at, &self.lexicon.words.once_markers)?;
        self.conditions(start).into_iter().find(|(_, end)| self.ends_clause(*end))
    }

    /// "Two cells and a holder with a gauge:", "There are three cubes."
    fn there(&self, at: usize) -> Option<(Vec<NounPhrase>, usize)> {
        let said = self.longest(at, &self.lexicon.words.there);
        let mut end = said.unwrap_or(at);
        let mut things = Vec::new();
        while things.len() < MAX_THINGS {
            let (thing, after) = self
                .noun_phrases(end, 0)
                .into_iter()
                .find(|(_, end)| self.is_word(*end, "and") || self.is_stop(*end) || *end >= self.tokens.len())?;
            things.push(thing);
            let colon = self.tokens.get(after).is_some_and(|token| [":", ".", "-", ";"].contains(&token.text.as_str()));
            // "Given two cells, find ...".
            let verb = self.word(after + 1).is_some_and(|word| self.lexicon.verbs.contains_key(word));
            let colon = colon || (said.is_some() && self.is_comma(after) && verb);
            if colon && (said.is_some() || after + 1 < self.tokens.len()) {
                return Some((things, after + 1));
            }
            end = if self.is_comma(after) && self.is_word(after + 1, "and") { after + 2 } else { after + 1 };
        }
        None
    }

    /// "... after pressing the button", "... before you return it", directly behind a clause.
    fn trailing(&self, at: usize) -> (Option<Sentence>, usize) {
        let words = &self.lexicon.words;
        for (markers, order) in [(&words.before_markers, Order::Last), (&words.after_markers, Order::BeforeLast)] {
            let Some(start) = self.longest(at, markers) else { continue };
            if let Some((clause, end)) = self.clause(start, None, true) {
                let clause = Box::new(clause);
                return (Some(Sentence::Do { clause, order, background: true, guard: None }), end);
            }
        }
        (None, at)
    }

    /// Skips stops, connectors and lead-ins.
    fn skip_links(&self, mut at: usize) -> usize {
        let words = &self.lexicon.words;
        loop {
            let next = if self.is_stop(at) {
                Some(at + 1)
            } else if self.longest(at, &words.earlier_markers).is_some() || self.begins_manner(at) {
                None
            } else {
                self.longest(at, &words.connectors).or_else(|| self.longest(at, &words.lead_ins))
            };
            match next {
                Some(next) => at = next,
                None => return at,
            }
        }
    }

    /// Whether a modifier stands here that a connector ("in turn", "first") must not swallow.
    fn begins_manner(&self, at: usize) -> bool {
        self.manner(at).is_some()
    }

    fn leave(&self, at: usize) -> Option<(Sentence, usize)> {
        let words = &self.lexicon.words;
        let verb = self.longest(at, &words.disturbing);
        let verb = verb.or_else(|| self.word(at).filter(|w| self.lexicon.verbs.contains_key(*w)).map(|_| at + 1));
        let Some(start) = verb else {
            self.fail(at, Expected::Verb);
            return None;
        };
        let mut phrases = self.noun_phrases(start, 0).into_iter();
        let found = phrases.find(|(_, end)| self.ends_clause(*end));
        if found.is_none() {
            self.fail(start, Expected::Other("only a thing that shall not be touched"));
        }
        found.map(|(object, end)| (Sentence::Leave { object: Box::new(object) }, end))
    }
}
