//! From an answer to a task: everything that it names must be there, and able to do what is asked of it.

mod place;
mod step;
mod thing;

use super::form::{QuantityForm, TaskForm, ThingForm, places};
use crate::{
    language::{MAX_CLAUSES, Role, nouns_of, settle_subtasks},
    lexicon::Lexicon,
    task::{Manner, ObjectReference, Span, Subtask, Task},
};
use acm_concept::template::TemplateLibrary;

/// Most things that an answer may name.
const MAX_THINGS: usize = 64;
/// Highest rank, and how often a function may be performed.
const MAX_COUNT: u32 = 100;
/// Longest name of a predicate, bytes.
const MAX_PREDICATE: usize = 40;

/// Collects what does not fit, so that a model is told of all of it at once.
pub(super) struct Grounding<'a> {
    lexicon: &'a Lexicon,
    library: &'a TemplateLibrary,
    text: &'a str,
    things: Vec<ThingForm>,
    faults: Vec<String>,
}

impl<'a> Grounding<'a> {
    pub(super) fn new(lexicon: &'a Lexicon, library: &'a TemplateLibrary, text: &'a str) -> Grounding<'a> {
        Grounding { lexicon, library, text, things: Vec::new(), faults: Vec::new() }
    }

    pub(super) fn task(mut self, form: TaskForm) -> Result<Task, Vec<String>> {
        if let Some(unclear) = form.unclear {
            return Err(vec![format!("the model holds the instruction to be unclear: {unclear}")]);
        }
        // A clause may be several steps: an exchange, what is done with each of a group.
        let counts = [
            ("things", form.things.len(), 0, MAX_THINGS),
            ("steps", form.steps.len(), 1, 3 * MAX_CLAUSES),
            ("untouched", form.untouched.len(), 0, MAX_THINGS),
            ("manners", form.manners.len(), 0, MAX_CLAUSES),
        ];
        if let Some((what, count, least, most)) = counts.iter().find(|(_, n, least, most)| n < least || n > most) {
            return Err(vec![format!("`{what}` has {count} entries; {least} to {most} are read")]);
        }
        self.things = form.things.clone();
        let mut references: Vec<Option<ObjectReference>> = Vec::new();
        for (index, thing) in form.things.into_iter().enumerate() {
            references.push(self.reference(index, thing));
        }
        let subtasks: Vec<Option<Subtask>> = self.subtasks(&form.steps);
        let manners: Vec<Option<Manner>> =
            form.manners.iter().enumerate().map(|(index, manner)| self.manner(index, manner)).collect();
        for &index in &form.untouched {
            self.thing("untouched", index, &Role::Mentioned);
        }
        let complete = (
            references.into_iter().collect::<Option<Vec<_>>>(),
            subtasks.into_iter().collect::<Option<Vec<_>>>(),
            manners.into_iter().collect::<Option<Vec<_>>>(),
        );
        let (true, (Some(mut references), Some(subtasks), Some(manners))) = (self.faults.is_empty(), complete) else {
            return Err(self.faults);
        };
        settle_subtasks(&subtasks, &mut references);
        let nouns = nouns_of(&references, self.library);
        Ok(Task {
            instruction: self.text.into(),
            subtasks,
            references,
            untouched: form.untouched,
            nouns,
            manners,
            corrections: Vec::new(),
        })
    }

    fn fault(&mut self, place: &str, reason: impl Into<String>) {
        self.faults.push(format!("{place}: {}", reason.into()));
    }

    /// Where words of the instruction stand.
    fn span(&mut self, place: &str, words: &str, occurrence: Option<usize>) -> Option<Span> {
        let number = occurrence.unwrap_or(1);
        let found = if words.trim().is_empty() { None } else { places(self.text, words).nth(number.wrapping_sub(1)) };
        if found.is_none() {
            let times = if number > 1 { format!(" {number} times") } else { String::new() };
            self.fault(place, format!("the instruction does not say \"{words}\"{times}; copy its words"));
        }
        found
    }

    /// A thing that is to play a role.
    fn thing(&mut self, place: &str, index: usize, role: &Role) -> Option<usize> {
        let Some(thing) = self.things.get(index) else {
            let reason = format!("{index} is no index of `things`, which has {} entries", self.things.len());
            self.fault(place, reason);
            return None;
        };
        let misfit = role.misfit(self.library, thing.noun.as_deref());
        if let Some(reason) = misfit {
            self.fault(place, reason);
            return None;
        }
        Some(index)
    }

    /// A name of a state or an effect as memory writes it.
    fn predicate(&mut self, place: &str, predicate: &str) -> Option<String> {
        let word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let fits = (1..=MAX_PREDICATE).contains(&predicate.len()) && predicate.chars().all(word);
        if !fits {
            self.fault(place, format!("`{predicate}` is no predicate: lower-case words joined by dashes"));
        }
        fits.then(|| predicate.to_owned())
    }

    /// A thing that is to play a role and is one, not a group.
    fn one(&mut self, place: &str, index: usize, role: &Role) -> Option<usize> {
        let index = self.thing(place, index, role)?;
        if self
            .things
            .get(index)
            .is_some_and(|thing| matches!(thing.quantity, QuantityForm::Group | QuantityForm::Count))
        {
            self.fault(place, "a group stands where one thing must be named");
            return None;
        }
        Some(index)
    }
}
