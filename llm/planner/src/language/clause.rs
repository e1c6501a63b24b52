//! Clauses: verb frames with their slots filled, in the order in which they are to be done.

use super::{
    phrase::{NounPhrase, PlacePhrase},
    reader::{Captures, Expected, Reader},
};
use crate::{
    lexicon::{FrameForm, FrameGoal},
    task::Span,
};
use acm_memory::query::PlaceReference;
use std::cmp::Reverse;

/// Most clauses of an instruction.
pub const MAX_CLAUSES: usize = 24;
/// Auxiliaries in a row: "should have been".
const MAX_AUXILIARIES: usize = 4;

/// A clause as read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Clause {
    pub span: Span,
    pub goal: FrameGoal,
    pub object: Option<NounPhrase>,
    pub place: Option<PlacePhrase>,
    pub history: Option<PlaceReference>,
    pub times: Option<u32>,
    /// The verb frame, for a clause that leaves its verb out.
    frame: usize,
}

impl Clause {
    fn places_named(&self) -> usize {
        self.object.as_ref().map_or(0, NounPhrase::places_named)
            + self.place.as_ref().map_or(0, PlacePhrase::places_named)
    }
}

/// Where a clause belongs among those read before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// After them.
    Last,
    /// Just before the last one.
    BeforeLast,
}

/// What was read, in the order of the text.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Statement {
    /// To be done. A background clause ("after pressing the button") adds nothing if it was said before.
    Do { clause: Box<Clause>, order: Order, background: bool },
    /// Not to be touched.
    Leave { object: Box<NounPhrase> },
}

impl Reader<'_> {
    /// Reads the whole text; `None` if some of it has no reading (the farthest failure says which).
    pub fn statements(&self) -> Option<Vec<Statement>> {
        let mut statements: Vec<Statement> = Vec::new();
        let mut last_frame = None;
        // A leading "before ..." clause is done after the main clauses that follow it in its sentence.
        let mut main_comes_before = false;
        let mut at = self.skip_links(0);
        while at < self.tokens.len() && statements.len() <= MAX_CLAUSES {
            let words = &self.lexicon.words;
            if let Some(end) = self.longest(at, &words.earlier_markers).filter(|_| !statements.is_empty()) {
                main_comes_before = true;
                at = self.skip_links(end);
                continue;
            }
            let (statement, end) = if let Some(end) = self.longest(at, &words.negations) {
                self.leave(end)?
            } else if let Some(start) = self.longest(at, &words.before_markers) {
                let (clause, end) = self.clause(start, None, true)?;
                main_comes_before = true;
                (Statement::Do { clause: Box::new(clause), order: Order::Last, background: true }, end)
            } else if let Some(start) = self.longest(at, &words.after_markers) {
                let (clause, end) = self.clause(start, None, true)?;
                let trails = self.skip_links(end) >= self.tokens.len();
                let order = if trails && !statements.is_empty() { Order::BeforeLast } else { Order::Last };
                (Statement::Do { clause: Box::new(clause), order, background: true }, end)
            } else {
                let (clause, end) = self.clause(at, last_frame, false)?;
                last_frame = Some(clause.frame);
                let order = if main_comes_before { Order::BeforeLast } else { Order::Last };
                (Statement::Do { clause: Box::new(clause), order, background: false }, end)
            };
            statements.push(statement);
            let (trailing, end) = self.trailing(end);
            statements.extend(trailing);
            at = self.skip_links(end);
            main_comes_before &= !(end..at).any(|place| self.tokens.get(place).is_some_and(|token| token.text == "."));
        }
        Some(statements)
    }

    /// "... after pressing the button", "... before you return it", directly behind a clause.
    fn trailing(&self, at: usize) -> (Option<Statement>, usize) {
        let words = &self.lexicon.words;
        for (markers, order) in [(&words.before_markers, Order::Last), (&words.after_markers, Order::BeforeLast)] {
            let Some(start) = self.longest(at, markers) else { continue };
            if let Some((clause, end)) = self.clause(start, None, true) {
                return (Some(Statement::Do { clause: Box::new(clause), order, background: true }), end);
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
            } else if self.longest(at, &words.earlier_markers).is_some() {
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

    fn leave(&self, at: usize) -> Option<(Statement, usize)> {
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
        found.map(|(object, end)| (Statement::Leave { object: Box::new(object) }, end))
    }

    /// The longest reading of a clause; on equal length the one that needs fewer places to tell things apart, then
    /// the first in the lexicon's order.
    fn clause(&self, at: usize, last_frame: Option<usize>, subordinate: bool) -> Option<(Clause, usize)> {
        let mut readings = self.verb_readings(at, at, None);
        for (subject, end) in self.noun_phrases(at, 0) {
            readings.extend(self.subject_readings(at, end, &subject));
        }
        if let Some(frame) = last_frame {
            readings.extend(self.frame_readings(at, at, frame, None));
        }
        let ends_well = |end: usize| {
            self.ends_clause(end)
                || (subordinate && self.word(end).is_some_and(|word| self.lexicon.verbs.contains_key(word)))
        };
        let mut best: Option<(Clause, usize)> = None;
        for (clause, end) in readings {
            if !ends_well(end) {
                self.fail(end, Expected::Other("the end of the clause"));
                continue;
            }
            let rank = (end, Reverse(clause.places_named()));
            if best.as_ref().is_none_or(|(best, longest)| rank > (*longest, Reverse(best.places_named()))) {
                best = Some((clause, end));
            }
        }
        if best.is_none() {
            self.insist(at, Expected::Verb);
        }
        best
    }

    fn ends_clause(&self, at: usize) -> bool {
        let words = &self.lexicon.words;
        let links =
            [&words.connectors, &words.after_markers, &words.before_markers, &words.earlier_markers, &words.negations];
        at >= self.tokens.len() || self.is_stop(at) || links.iter().any(|forms| self.longest(at, forms).is_some())
    }

    /// Readings that begin with the verb at `at`.
    fn verb_readings(&self, begin: usize, at: usize, subject: Option<&NounPhrase>) -> Vec<(Clause, usize)> {
        let frames = self.word(at).and_then(|word| self.lexicon.verbs.get(word));
        let Some(frames) = frames else {
            return Vec::new();
        };
        frames.iter().flat_map(|&frame| self.frame_readings(begin, at + 1, frame, subject)).collect()
    }

    /// "the cube should be brought to the middle", "the cube goes to the middle", "the cube is in the middle".
    fn subject_readings(&self, begin: usize, at: usize, subject: &NounPhrase) -> Vec<(Clause, usize)> {
        let mut verb = at;
        for _ in 0..MAX_AUXILIARIES {
            match self.longest(verb, &self.lexicon.words.auxiliaries) {
                Some(end) => verb = end,
                None => break,
            }
        }
        let mut readings = self.verb_readings(begin, verb, Some(subject));
        let transfer = self.lexicon.frames.iter().position(|frame| frame.goal == FrameGoal::At);
        if let Some(frame) = transfer {
            for (place, end) in self.places(verb, 0) {
                readings.push((
                    Clause {
                        span: self.span(begin, end),
                        goal: FrameGoal::At,
                        object: Some(subject.clone()),
                        place: Some(place),
                        history: None,
                        times: None,
                        frame,
                    },
                    end,
                ));
            }
        }
        readings
    }

    fn frame_readings(
        &self,
        begin: usize,
        at: usize,
        index: usize,
        subject: Option<&NounPhrase>,
    ) -> Vec<(Clause, usize)> {
        let Some(frame) = self.lexicon.frames.get(index) else { return Vec::new() };
        if frame.said_of_object && subject.is_none() {
            return Vec::new();
        }
        let given = Captures { object: subject.cloned(), object_given: subject.is_some(), ..Captures::default() };
        let mut readings = Vec::new();
        for FrameForm { form, history, times } in &frame.forms {
            for (captures, end) in self.form(at, form, &given, 0) {
                // The form with nothing in it must not swallow a clause that left its verb out.
                if end == begin {
                    continue;
                }
                let clause = Clause {
                    span: self.span(begin, end),
                    goal: frame.goal.clone(),
                    object: captures.object,
                    history: if captures.place.is_some() { None } else { *history },
                    place: captures.place,
                    times: captures.times.or(*times),
                    frame: index,
                };
                readings.push((clause, end));
            }
        }
        readings
    }
}
