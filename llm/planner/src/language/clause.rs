//! Clauses: verb frames with their slots filled.

use super::{
    reader::{Captures, Expected, Reader},
    role::{CONTAINS, Role},
    syntax::{Clause, NounPhrase, PlaceKind, PlacePhrase, Pronoun, Relation},
};
use crate::{
    lexicon::{FrameForm, FrameGoal},
    task::functions_with_effect,
};
use std::cmp::Reverse;

/// Auxiliaries in a row: "should have been".
const MAX_AUXILIARIES: usize = 4;

/// What a clause is said of: a thing, and those listed with it.
type Subject = (NounPhrase, Vec<NounPhrase>);

/// The captures of a clause whose object stands before its verb.
fn said_of(subject: Option<&Subject>) -> Captures {
    let (object, also) = subject.cloned().map_or((None, Vec::new()), |(first, also)| (Some(first), also));
    Captures { object, also, object_given: subject.is_some(), ..Captures::default() }
}

impl Reader<'_> {
    /// The longest reading of a clause; on equal length the one that needs fewer places to tell things apart, then
    /// the first in the lexicon's order.
    pub fn clause(&self, at: usize, last_frame: Option<usize>, subordinate: bool) -> Option<(Clause, usize)> {
        let mut readings = self.verb_readings(at, at, None);
        for (subject, end) in self.noun_phrase_lists(at, 0) {
            readings.extend(self.subject_readings(at, end, &subject));
        }
        // "Swap the two cubes, the red one and the green one" is no second exchange.
        let exchange =
            |frame: usize| self.lexicon.frames.get(frame).is_some_and(|known| known.goal == FrameGoal::Exchange);
        if let Some(frame) = last_frame.filter(|frame| !exchange(*frame)) {
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
            // What asks for something goes before what only mentions it.
            let asks = |clause: &Clause| clause.goal != FrameGoal::Nothing;
            // "A plate with a fork and a knife" is one thing with two on it.
            let rank = |clause: &Clause, end: usize| {
                let told_apart = Reverse((clause.places_named(), clause.also.len()));
                (end, asks(clause), told_apart, self.described_last(clause))
            };
            if best.as_ref().is_none_or(|(best, longest)| rank(&clause, end) > rank(best, *longest)) {
                best = Some((clause, end));
            }
        }
        if best.is_none() {
            self.insist(at, Expected::Verb);
        }
        best
    }

    /// "Heat and slice the bread": two clauses, the first of which leaves its object to the second.
    pub fn sharing(&self, at: usize) -> Option<(Clause, Clause, usize)> {
        let next = self.longest(at + 1, &self.lexicon.words.connectors)?;
        let (mut second, end) = self.clause(next, None, false)?;
        let object = second.object.clone().filter(|object| object.pronoun.is_none() && second.also.is_empty())?;
        let pronoun = if object.several() { Pronoun::Several } else { Pronoun::One };
        let subject = (object, Vec::new());
        let readings = self.verb_readings(at, at, Some(&subject)).into_iter();
        let (first, _) = readings.filter(|(_, ends)| *ends == at + 1).min_by_key(|(first, _)| first.frame)?;
        second.object = Some(NounPhrase { pronoun: Some(pronoun), ..self.blank(next, next + 1) });
        Some((first, second, end))
    }

    /// Whether what stands last describes the place and not the thing: "the fork in the mug on the table" goes into the
    /// mug that is on the table, "in the drawer next to the stove" is one place. What carries things and cannot be
    /// moved stands on nothing: "the cube on the left mat" goes on the right mat.
    fn described_last(&self, clause: &Clause) -> u8 {
        let Some(PlacePhrase { kind: PlaceKind::At(phrase, _), .. }) = &clause.place else { return 0 };
        match phrase.located.as_deref().map(|place| &place.kind) {
            None => 0,
            Some(PlaceKind::At(_, Relation::On | Relation::In)) => {
                let moved =
                    phrase.noun.is_some() && Role::Effect("at".into()).fits(self.library, phrase.noun.as_deref());
                if moved { 2 } else { 0 }
            }
            Some(_) => 1,
        }
    }

    pub fn ends_clause(&self, at: usize) -> bool {
        let words = &self.lexicon.words;
        // "... in the microwave to heat it".
        let purpose =
            self.is_word(at, "to") && self.word(at + 1).is_some_and(|word| self.lexicon.verbs.contains_key(word));
        let markers = [&words.if_markers, &words.unless_markers, &words.otherwise];
        if purpose || markers.iter().any(|forms| self.longest(at, forms).is_some()) {
            return true;
        }
        let links =
            [&words.connectors, &words.after_markers, &words.before_markers, &words.earlier_markers, &words.negations];
        at >= self.tokens.len() || self.is_stop(at) || links.iter().any(|forms| self.longest(at, forms).is_some())
    }

    /// Readings that begin with the verb at `at`.
    fn verb_readings(&self, begin: usize, at: usize, subject: Option<&Subject>) -> Vec<(Clause, usize)> {
        let frames = self.word(at).and_then(|word| self.lexicon.verbs.get(word));
        let Some(frames) = frames else {
            return Vec::new();
        };
        frames.iter().flat_map(|&frame| self.frame_readings(begin, at + 1, frame, subject)).collect()
    }

    /// "the cube should be brought to the middle", "the cube goes to the middle", "the cube is in the middle".
    fn subject_readings(&self, begin: usize, at: usize, subject: &Subject) -> Vec<(Clause, usize)> {
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
                let captures = Captures { place: Some(place), ..said_of(Some(subject)) };
                readings.push((self.filled(begin, end, frame, 0, captures), end));
            }
        }
        readings
    }

    fn frame_readings(&self, begin: usize, at: usize, index: usize, subject: Option<&Subject>) -> Vec<(Clause, usize)> {
        let Some(frame) = self.lexicon.frames.get(index) else { return Vec::new() };
        if frame.said_of_object && subject.is_none() {
            return Vec::new();
        }
        let given = said_of(subject);
        let mut readings = Vec::new();
        for (number, FrameForm { form, history, times, .. }) in frame.forms.iter().enumerate() {
            for (captures, end) in self.form(at, form, &given, 0) {
                // The form with nothing in it must not swallow a clause that left its verb out.
                if end == begin {
                    continue;
                }
                let mut clause = self.filled(begin, end, index, number, captures);
                if !self.tool_serves(&clause) {
                    continue;
                }
                clause.history = history.filter(|_| clause.place.is_none());
                clause.times = clause.times.or(*times);
                readings.extend(self.filled_after(&clause, end));
                readings.push((clause, end));
            }
        }
        readings
    }

    /// "Put the pan on the table with a fork in it": what the moved thing holds, said after the place, which holds nothing.
    fn filled_after(&self, clause: &Clause, at: usize) -> Vec<(Clause, usize)> {
        let words = &self.lexicon.words;
        let holds = |phrase: &NounPhrase| Role::Affordance(CONTAINS).fits(self.library, phrase.noun.as_deref());
        let (Some(object), Some(PlacePhrase { kind: PlaceKind::At(place, _), .. })) = (&clause.object, &clause.place)
        else {
            return Vec::new();
        };
        let meant = object.noun.is_some() && object.contains.is_empty() && clause.also.is_empty();
        if !meant || !holds(object) || holds(place) {
            return Vec::new();
        }
        let mut readings = Vec::new();
        for start in self.class(at, &words.containing) {
            for ((first, also), end) in self.noun_phrase_lists(start, 1) {
                let inside = self.longest(end, &words.prepositions_in).is_some();
                let contains = [std::slice::from_ref(&first), &also].concat();
                let object = NounPhrase { contains, ..object.clone() };
                for end in self.class(end, &words.within_it).into_iter().filter(|_| inside) {
                    readings.push((Clause { object: Some(object.clone()), ..clause.clone() }, end));
                }
            }
        }
        readings
    }

    /// Whether the tool, where it must be in some state, is of a kind that can be brought into it.
    fn tool_serves(&self, clause: &Clause) -> bool {
        let state = self.lexicon.frames.get(clause.frame).and_then(|frame| frame.tool_state.as_deref());
        let (Some(state), Some(tool)) = (state, &clause.tool) else { return true };
        !functions_with_effect(self.library, state).is_empty()
            && Role::Effect(state.to_owned()).fits(self.library, tool.noun.as_deref())
    }

    fn filled(&self, begin: usize, end: usize, frame: usize, form: usize, captures: Captures) -> Clause {
        let goal = self.lexicon.frames.get(frame).map_or(FrameGoal::Nothing, |frame| match &captures.tool {
            // "Look at the card" needs nothing done, "look at it under the lamp" needs both together.
            Some(_) if frame.tool_state.is_some() => FrameGoal::Holding(true),
            _ => frame.goal.clone(),
        });
        Clause {
            span: self.span(begin, end),
            goal,
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
