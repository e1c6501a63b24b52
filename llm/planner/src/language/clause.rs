//! Clauses: verb frames with their slots filled.

use super::{
    reader::{Captures, Expected, Reader},
    syntax::{Clause, NounPhrase},
};
use crate::lexicon::{FrameForm, FrameGoal};
use std::cmp::Reverse;

/// Auxiliaries in a row: "should have been".
const MAX_AUXILIARIES: usize = 4;

impl Reader<'_> {
    /// The longest reading of a clause; on equal length the one that needs fewer places to tell things apart, then
    /// the first in the lexicon's order.
    pub fn clause(&self, at: usize, last_frame: Option<usize>, subordinate: bool) -> Option<(Clause, usize)> {
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
        for (mut clause, end) in readings {
            let (modifiers, end) = self.clause_modifiers(end);
            clause.modifiers = modifiers;
            clause.span = clause.span.join(self.span(at, end));
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

    pub fn ends_clause(&self, at: usize) -> bool {
        let words = &self.lexicon.words;
        // "... in the microwave to heat it".
        let purpose = self.is_word(at, "to") && self.word(at + 1).is_some_and(|word| self.lexicon.verbs.contains_key(word));
        let markers = [&words.if_markers, &words.unless_markers, &words.otherwise];
        if purpose || markers.iter().any(|forms| self.longest(at, forms).is_some()) {
            return true;
        }
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
                let captures = Captures { object: Some(subject.clone()), place: Some(place), ..Captures::default() };
                readings.push((self.filled(begin, end, frame, 0, captures), end));
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
        for (number, FrameForm { form, history, times }) in frame.forms.iter().enumerate() {
            for (captures, end) in self.form(at, form, &given, 0) {
                // The form with nothing in it must not swallow a clause that left its verb out.
                if end == begin {
                    continue;
                }
                let mut clause = self.filled(begin, end, index, number, captures);
                clause.history = history.filter(|_| clause.place.is_none());
                clause.times = clause.times.or(*times);
                readings.push((clause, end));
            }
        }
        readings
    }

    fn filled(&self, begin: usize, end: usize, frame: usize, form: usize, captures: Captures) -> Clause {
        Clause {
            span: self.span(begin, end),
            goal: self.lexicon.frames.get(frame).map_or(FrameGoal::Nothing, |frame| frame.goal.clone()),
            object: captures.object,
            also: captures.also,
            place: captures.place,
            tool: captures.tool,
            condition: captures.condition,
            history: None,
            times: captures.times,
            modifiers: Vec::new(),
            frame,
            form,
        }
    }
}
