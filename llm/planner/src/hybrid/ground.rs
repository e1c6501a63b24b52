//! From an answer to a task: everything that it names must be there, and able to do what is asked of it.

use super::form::{GoalForm, Past, PlaceForm, PlaceKind, RankFrom, StepForm, TaskForm, ThingForm, places};
use crate::{
    language::{MAX_CLAUSES, Role, SUPPORTIVE, nouns_of, settle_subtasks},
    lexicon::Lexicon,
    task::{ColorTerm, Destination, Direction, Goal, ObjectReference, Quantity, Rank, Span, Subtask, Task},
};
use acm_concept::template::TemplateLibrary;
use acm_memory::query::PlaceReference;

/// Most things that an answer may name.
const MAX_THINGS: usize = 64;
/// Highest rank, and how often a function may be performed.
const MAX_COUNT: u32 = 100;

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
        // An exchange is two steps of one clause.
        for (what, count, most) in
            [("things", form.things.len(), MAX_THINGS), ("steps", form.steps.len(), 2 * MAX_CLAUSES)]
        {
            if count == 0 || count > most {
                return Err(vec![format!("`{what}` has {count} entries; 1 to {most} are read")]);
            }
        }
        self.things = form.things.clone();
        let mut references: Vec<Option<ObjectReference>> = Vec::new();
        for (index, thing) in form.things.into_iter().enumerate() {
            references.push(self.reference(index, thing));
        }
        let second = second_halves(&form.steps);
        let mut subtasks: Vec<Option<Subtask>> = Vec::new();
        for (index, step) in form.steps.into_iter().enumerate() {
            subtasks.push(self.subtask(index, step, &second));
        }
        for &index in &form.untouched {
            self.thing("untouched", index, &Role::Mentioned);
        }
        let complete =
            (references.into_iter().collect::<Option<Vec<_>>>(), subtasks.into_iter().collect::<Option<Vec<_>>>());
        let (true, (Some(mut references), Some(subtasks))) = (self.faults.is_empty(), complete) else {
            return Err(self.faults);
        };
        settle_subtasks(&subtasks, &mut references);
        let nouns = nouns_of(&references);
        Ok(Task { instruction: self.text.into(), subtasks, references, untouched: form.untouched, nouns })
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

    /// A thing that is to play a role and is one, not a group.
    fn one(&mut self, place: &str, index: usize, role: &Role) -> Option<usize> {
        let index = self.thing(place, index, role)?;
        if self.things.get(index).is_some_and(|thing| thing.quantity == Quantity::Group) {
            self.fault(place, "a group stands where one thing must be named");
            return None;
        }
        Some(index)
    }

    fn reference(&mut self, index: usize, form: ThingForm) -> Option<ObjectReference> {
        let place = format!("things/{index}");
        let span = self.span(&format!("{place}/phrase"), &form.phrase, form.occurrence);
        let noun = form.noun.as_deref();
        if let Some(noun) = noun.filter(|noun| self.library.with_noun(noun).next().is_none()) {
            self.fault(&format!("{place}/noun"), format!("there is no noun `{noun}`"));
        }
        if let Some(function) = &form.function {
            self.function(&format!("{place}/function"), noun, function);
        }
        if let Some(affordance) = &form.affordance {
            let affords = |noun: &str| self.library.with_noun(noun).any(|t| t.affordances().any(|a| a == affordance));
            let known =
                noun.map_or_else(|| self.library.iter().any(|t| t.affordances().any(|a| a == affordance)), affords);
            if !known {
                self.fault(&format!("{place}/affordance"), format!("nothing of that noun affords `{affordance}`"));
            }
        }
        let color = self.color(&place, form.color.as_deref(), form.shade.as_deref());
        let rank = self.rank(&place, form.rank, form.rank_from);
        // What describes a thing was named before it: descriptions never go in a circle.
        let earlier = |other: &usize| *other >= index;
        if let Some(other) = form.other_than.iter().find(|other| earlier(other)) {
            self.fault(&format!("{place}/other_than"), format!("{other} does not stand before it in `things`"));
        }
        let located = form.located.as_ref().map(|located| {
            let field = format!("{place}/located");
            if let Some(other) = [located.thing, located.second].into_iter().flatten().find(earlier) {
                self.fault(&field, format!("{other} does not stand before it in `things`"));
            }
            if located.kind == PlaceKind::InPlaceOf {
                self.fault(&field, "`in-place-of` says where things go, not where they stand");
            }
            self.destination(&field, located, false)
        });
        let located = match located {
            Some(destination) => Some(Box::new(destination?)),
            None => None,
        };
        Some(ObjectReference {
            phrase: form.phrase,
            span: span?,
            subtask: 0,
            quantity: form.quantity,
            noun: form.noun,
            function: form.function,
            affordance: form.affordance,
            color,
            size: form.size,
            rank,
            free: form.free,
            located,
            other_than: form.other_than,
        })
    }

    fn function(&mut self, place: &str, noun: Option<&str>, function: &str) {
        let role = Role::Function(function.to_owned());
        if let Some(reason) = role.misfit(self.library, noun) {
            self.fault(place, reason);
        } else if self.library.iter().all(|template| template.function(function).is_none()) {
            self.fault(place, format!("there is no function `{function}`"));
        }
    }

    fn color(&mut self, place: &str, name: Option<&str>, shade: Option<&str>) -> Option<ColorTerm> {
        let lightness = shade.map(|shade| self.lexicon.shade_words().find(|(word, _)| *word == shade));
        if let (Some(shade), Some(None)) = (shade, lightness) {
            self.fault(&format!("{place}/shade"), format!("there is no shade `{shade}`"));
        }
        if shade.is_some() && name.is_none() {
            self.fault(&format!("{place}/shade"), "a shade needs a colour");
        }
        let term = self.lexicon.shaded(name?, lightness.flatten().map_or(0.0, |(_, lightness)| lightness));
        if term.is_none() {
            self.fault(&format!("{place}/color"), format!("there is no colour `{}`", name.unwrap_or_default()));
        }
        term
    }

    fn rank(&mut self, place: &str, rank: Option<u32>, from: Option<RankFrom>) -> Option<Rank> {
        match (rank, from.map(RankFrom::side)) {
            (None, None) => None,
            (None, Some(None)) => Some(Rank::Middle),
            (Some(number @ 1..=MAX_COUNT), side @ (None | Some(Some(_)))) => {
                Some(Rank::FromSide(number - 1, side.flatten().unwrap_or(Direction::Left)))
            }
            (None, Some(Some(side))) => Some(Rank::FromSide(0, side)),
            (Some(number), _) => {
                self.fault(
                    &format!("{place}/rank"),
                    format!("{number} is no rank: 1 to {MAX_COUNT}, or none in the middle"),
                );
                None
            }
        }
    }

    fn subtask(&mut self, index: usize, form: StepForm, second: &[Option<bool>]) -> Option<Subtask> {
        let place = format!("steps/{index}");
        let span = self.span(&format!("{place}/words"), &form.words, form.occurrence);
        let object = format!("{place}/thing");
        let only = |field: &str, goal: &str| format!("`{field}` belongs to goal `{goal}` alone");
        if form.goal != GoalForm::At && form.to.is_some() {
            self.fault(&format!("{place}/to"), only("to", "at"));
        }
        if form.goal != GoalForm::Performed && (form.function.is_some() || form.times.is_some()) {
            self.fault(&place, only("function", "performed"));
        }
        let goal = match form.goal {
            GoalForm::Holding | GoalForm::PutDown => {
                let object = self.one(&object, form.thing, &Role::Effect("holding"))?;
                Goal::Holding { object, held: form.goal == GoalForm::Holding }
            }
            GoalForm::Performed => {
                let times = form.times.unwrap_or(1);
                if !(1..=MAX_COUNT).contains(&times) {
                    self.fault(&format!("{place}/times"), format!("{times} is not 1 to {MAX_COUNT}"));
                }
                let Some(function) = form.function else {
                    self.fault(&format!("{place}/function"), "goal `performed` needs a function");
                    return None;
                };
                self.function(&format!("{place}/function"), None, &function);
                let object = self.one(&object, form.thing, &Role::Function(function.clone()))?;
                Goal::Performed { function, object, times: Times::Count(times) }
            }
            GoalForm::At => {
                let object = self.one(&object, form.thing, &Role::Effect("at"))?;
                let Some(to) = &form.to else {
                    self.fault(&format!("{place}/to"), "goal `at` needs a place");
                    return None;
                };
                let half = second.get(index).copied().flatten();
                if to.kind == PlaceKind::InPlaceOf && half.is_none() {
                    let reason = "two things that change places are two steps in a row, each in-place-of the other";
                    self.fault(&format!("{place}/to"), reason);
                }
                Goal::At { object, destination: self.destination(&format!("{place}/to"), to, half == Some(false))? }
            }
        };
        let span = span?;
        Some(Subtask { text: span.of(self.text).into(), span, goal })
    }

    /// A place; `first` says of an exchange which half it is.
    fn destination(&mut self, place: &str, form: &PlaceForm, first: bool) -> Option<Destination> {
        let kind = form.kind;
        let unused = [
            ("second", form.second.is_some() && kind != PlaceKind::Between),
            ("side", form.side.is_some() && kind != PlaceKind::Beside),
            ("past", form.past.is_some() && kind != PlaceKind::Past),
        ];
        for (field, _) in unused.into_iter().filter(|(_, wrong)| *wrong) {
            self.fault(&format!("{place}/{field}"), "it says nothing in a place of this kind");
        }
        let field = format!("{place}/thing");
        if kind == PlaceKind::Middle {
            let Some(of) = form.thing else { return Some(Destination::Middle { of: None }) };
            let of = self.thing(&field, of, &Role::Mentioned)?;
            if self.things.get(of).is_some_and(|thing| thing.quantity != Quantity::Group) {
                self.fault(&field, "the middle of things is that of a group");
            }
            return Some(Destination::Middle { of: Some(of) });
        }
        let Some(thing) = form.thing else {
            self.fault(&field, "a place of this kind needs a thing");
            return None;
        };
        Some(match kind {
            PlaceKind::On => Destination::On { reference: self.one(&field, thing, &Role::Affordance(SUPPORTIVE))? },
            PlaceKind::Beside => {
                Destination::Beside { reference: self.thing(&field, thing, &Role::Mentioned)?, side: form.side }
            }
            PlaceKind::Between => {
                let second = format!("{place}/second");
                let Some(other) = form.second else {
                    self.fault(&second, "between needs a second thing");
                    return None;
                };
                Destination::Between {
                    first: self.one(&field, thing, &Role::Mentioned)?,
                    second: self.one(&second, other, &Role::Mentioned)?,
                }
            }
            PlaceKind::InPlaceOf => {
                Destination::Exchanged { with: self.one(&field, thing, &Role::Effect("at"))?, first }
            }
            PlaceKind::Past | PlaceKind::Middle => {
                let reference = match form.past {
                    Some(Past::AtStart) => PlaceReference::AtStart,
                    Some(Past::BeforeMoved) => PlaceReference::BeforeMoved,
                    None => {
                        self.fault(&format!("{place}/past"), "a place in the past needs to say which");
                        return None;
                    }
                };
                Destination::History { object: self.thing(&field, thing, &Role::Effect("at"))?, reference }
            }
        })
    }
}

/// For each step whether it is the second half of an exchange; `None` where it is no half.
fn second_halves(steps: &[StepForm]) -> Vec<Option<bool>> {
    let with = |step: &StepForm| match &step.to {
        Some(PlaceForm { kind: PlaceKind::InPlaceOf, thing, .. }) => *thing,
        _ => None,
    };
    let mut halves: Vec<Option<bool>> = Vec::with_capacity(steps.len());
    for (index, step) in steps.iter().enumerate() {
        let mirrors = |other: Option<&StepForm>| {
            other.is_some_and(|other| with(step) == Some(other.thing) && with(other) == Some(step.thing))
                && with(step) != Some(step.thing)
        };
        let before = index.checked_sub(1).and_then(|before| steps.get(before));
        halves.push(match halves.last() {
            Some(Some(false)) if mirrors(before) => Some(true),
            _ if mirrors(steps.get(index + 1)) => Some(false),
            _ => None,
        });
    }
    halves
}
