//! Steps of an answer.

use super::{Grounding, MAX_COUNT};
use crate::{
    hybrid::form::{ConditionForm, GoalForm, MannerForm, MannerWord, PlaceForm, PlaceKind, StepForm},
    language::Role,
    task::{Condition, Goal, Manner, MannerKind, Ordering, Subtask, Times},
};

impl Grounding<'_> {
    /// The steps that are no part of another, each with its parts.
    pub(super) fn subtasks(&mut self, steps: &[StepForm]) -> Vec<Option<Subtask>> {
        let wholes = steps.iter().filter(|step| step.part_of.is_none()).count() as u32;
        let second = second_halves(steps);
        let mut subtasks = Vec::new();
        for (index, step) in steps.iter().enumerate() {
            let place = format!("steps/{index}");
            if let Some(whole) = step.part_of {
                self.part(&place, steps, index, whole);
                continue;
            }
            let span = self.span(&format!("{place}/words"), &step.words, step.occurrence);
            let goal = self.goal(index, steps, &second);
            let when = match &step.only_if {
                Some(condition) => self.condition(&format!("{place}/only_if"), condition).map(Some),
                None => Some(None),
            };
            let asked = subtasks.len() as u32;
            let judged_at = when.as_ref().and_then(|when| when.as_ref()?.judged_at);
            if judged_at.is_some_and(|at| at >= asked.min(wholes)) {
                self.fault(&format!("{place}/only_if/judged_at"), "it is the number of a step before this one");
            }
            subtasks.push(match (span, goal, when) {
                (Some(span), Some(goal), Some(when)) => {
                    Some(Subtask { text: span.of(self.text).into(), span, goal, when })
                }
                _ => None,
            });
        }
        subtasks
    }

    /// Only what is done with each of a group, or to try, stands within another step; and only one deep.
    fn part(&mut self, place: &str, steps: &[StepForm], index: usize, whole: usize) {
        let of = steps.get(whole).filter(|_| whole < index);
        if !of.is_some_and(|of| of.part_of.is_none() && matches!(of.goal, GoalForm::Each | GoalForm::Find)) {
            let reason = format!("{whole} is no step before it with the goal `each` or `find`");
            self.fault(&format!("{place}/part_of"), reason);
        }
        let step = steps.get(index);
        if step.is_some_and(|step| matches!(step.goal, GoalForm::Each | GoalForm::Find | GoalForm::Await)) {
            self.fault(&format!("{place}/goal"), "a step of this goal is no part of another");
        }
        if step.is_some_and(|step| step.only_if.is_some()) {
            self.fault(&format!("{place}/only_if"), "a part has no condition of its own");
        }
    }

    fn parts(&mut self, index: usize, steps: &[StepForm], second: &[Option<bool>]) -> Option<Vec<Goal>> {
        let parts = steps.iter().enumerate().filter(|(_, step)| step.part_of == Some(index));
        let parts: Vec<usize> = parts.map(|(part, _)| part).filter(|part| *part > index).collect();
        parts.into_iter().map(|part| self.goal(part, steps, second)).collect()
    }

    fn goal(&mut self, index: usize, steps: &[StepForm], second: &[Option<bool>]) -> Option<Goal> {
        let form = steps.get(index)?;
        let place = format!("steps/{index}");
        self.unused(&place, form);
        let Some(thing) = form.thing else {
            if form.goal != GoalForm::Await {
                self.fault(&format!("{place}/thing"), "a step of this goal needs a thing");
                return None;
            }
            return Some(Goal::Await { condition: self.until(&place, form)?? });
        };
        let object = format!("{place}/thing");
        Some(match form.goal {
            GoalForm::Holding | GoalForm::PutDown => {
                let object = self.acted_on(&object, form, thing, &Role::Effect("holding".into()))?;
                Goal::Holding { object, held: form.goal == GoalForm::Holding }
            }
            GoalForm::Performed => {
                let Some(function) = form.function.clone() else {
                    self.fault(&format!("{place}/function"), "goal `performed` needs a function");
                    return None;
                };
                self.function(&format!("{place}/function"), None, &function);
                let times = self.times(&place, form)?;
                let object = self.acted_on(&object, form, thing, &Role::Function(function.clone()))?;
                Goal::Performed { function, object, times }
            }
            GoalForm::State => {
                let Some(state) = &form.state else {
                    self.fault(&format!("{place}/state"), "goal `state` needs a state");
                    return None;
                };
                let predicate = self.predicate(&format!("{place}/state"), &state.predicate)?;
                let object = self.acted_on(&object, form, thing, &Role::Effect(predicate.clone()))?;
                let by = match form.by {
                    Some(by) => Some(self.thing(&format!("{place}/by"), by, &Role::Mentioned)?),
                    None => None,
                };
                Goal::State { predicate, object, holds: state.holds, by }
            }
            GoalForm::At => {
                let object = self.acted_on(&object, form, thing, &Role::Effect("at".into()))?;
                let Some(to) = &form.to else {
                    self.fault(&format!("{place}/to"), "goal `at` needs a place");
                    return None;
                };
                // Within a step for each of a group the group stands for the one whose turn it is.
                if let (None, Some(thing), PlaceKind::On | PlaceKind::In | PlaceKind::Under) =
                    (form.part_of, to.thing, to.kind)
                {
                    self.one(&format!("{place}/to/thing"), thing, &Role::Mentioned)?;
                }
                let half = second.get(index).copied().flatten();
                if to.kind == PlaceKind::InPlaceOf && half.is_none() {
                    let reason = "two things that change places are two steps in a row, each in-place-of the other";
                    self.fault(&format!("{place}/to"), reason);
                }
                Goal::At { object, destination: self.destination(&format!("{place}/to"), to, half == Some(false))? }
            }
            GoalForm::Each => {
                let members = self.thing(&object, thing, &Role::Mentioned)?;
                let body = self.parts(index, steps, second)?;
                if body.is_empty() {
                    self.fault(&place, "goal `each` needs a step that is part of it");
                }
                for &named in &form.order_named {
                    self.thing(&format!("{place}/order_named"), named, &Role::Mentioned)?;
                }
                let order = match (form.order_from, form.order_named.as_slice()) {
                    (None, []) => Ordering::Any,
                    (Some(side), []) => Ordering::From(side),
                    (None, named) => Ordering::Named(named.to_vec()),
                    (Some(_), _) => {
                        self.fault(&format!("{place}/order_named"), "an order begins at a side or is named, not both");
                        return None;
                    }
                };
                Goal::Each { members, order, body }
            }
            GoalForm::Find => {
                let members = self.thing(&object, thing, &Role::Mentioned)?;
                let Some(vary) = form.vary else {
                    self.fault(&format!("{place}/vary"), "goal `find` needs what is varied");
                    return None;
                };
                let within = match &form.to {
                    Some(to) => Some(self.destination(&format!("{place}/to"), to, false)?),
                    None => None,
                };
                let mut probe = self.parts(index, steps, second)?;
                if probe.len() > 1 {
                    self.fault(&place, "goal `find` has one part at most: what is done to try");
                }
                Goal::Find { members, vary, within, probe: probe.pop().map(Box::new), sign: self.until(&place, form)? }
            }
            GoalForm::Await => {
                self.fault(&object, "goal `await` has no thing: its condition names what it is about");
                return None;
            }
        })
    }

    /// One thing; within a step for each of a group, the group stands for the one whose turn it is.
    fn acted_on(&mut self, place: &str, form: &StepForm, thing: usize, role: &Role) -> Option<usize> {
        if form.part_of.is_some() { self.thing(place, thing, role) } else { self.one(place, thing, role) }
    }

    /// Fields that say nothing with the goal of a step.
    fn unused(&mut self, place: &str, form: &StepForm) {
        use GoalForm::{At, Await, Each, Find, Performed, State};
        let fields: [(&str, bool, &[GoalForm]); 10] = [
            ("to", form.to.is_some(), &[At, Find]),
            ("function", form.function.is_some(), &[Performed]),
            ("times", form.times.is_some(), &[Performed]),
            ("times_shown_by", form.times_shown_by.is_some(), &[Performed]),
            ("state", form.state.is_some(), &[State]),
            ("by", form.by.is_some(), &[State]),
            ("order_from", form.order_from.is_some(), &[Each]),
            ("order_named", !form.order_named.is_empty(), &[Each]),
            ("vary", form.vary.is_some(), &[Find]),
            ("until", form.until.is_some(), &[Performed, Find, Await]),
        ];
        for (field, _, _) in fields.iter().filter(|(_, given, goals)| *given && !goals.contains(&form.goal)) {
            self.fault(&format!("{place}/{field}"), "it says nothing in a step of this goal");
        }
    }

    fn times(&mut self, place: &str, form: &StepForm) -> Option<Times> {
        Some(match (form.times, form.times_shown_by, &form.until) {
            (Some(times), None, None) if !(1..=MAX_COUNT).contains(&times) => {
                self.fault(&format!("{place}/times"), format!("{times} is not 1 to {MAX_COUNT}"));
                return None;
            }
            (times, None, None) => Times::Count(times.unwrap_or(1)),
            (None, Some(by), None) => {
                Times::Shown(self.thing(&format!("{place}/times_shown_by"), by, &Role::Mentioned)?)
            }
            (None, None, Some(_)) => Times::Until(self.until(place, form)??),
            _ => {
                self.fault(
                    &format!("{place}/times"),
                    "how often is said by `times`, `times_shown_by` or `until` alone",
                );
                return None;
            }
        })
    }

    /// What `until` says; `None` alone where it is faulty.
    fn until(&mut self, place: &str, form: &StepForm) -> Option<Option<Condition>> {
        match &form.until {
            Some(until) if until.judged_at.is_some() => {
                self.fault(&format!("{place}/until/judged_at"), "what ends a step is judged at its end");
                None
            }
            Some(until) => self.condition(&format!("{place}/until"), until).map(Some),
            None if form.goal == GoalForm::Await => {
                self.fault(&format!("{place}/until"), "goal `await` needs what is waited for");
                None
            }
            None => Some(None),
        }
    }

    fn condition(&mut self, place: &str, form: &ConditionForm) -> Option<Condition> {
        let predicate = self.predicate(&format!("{place}/predicate"), &form.predicate)?;
        let mut arguments = Vec::new();
        for &thing in &form.things {
            arguments.push(self.thing(&format!("{place}/things"), thing, &Role::Mentioned)?);
        }
        Some(Condition { predicate, arguments, negated: !form.holds, judged_at: form.judged_at })
    }

    pub(super) fn manner(&mut self, index: usize, form: &MannerForm) -> Option<Manner> {
        let place = format!("manners/{index}");
        let span = self.span(&format!("{place}/words"), &form.words, form.occurrence);
        let kind = match (form.kind, form.thing) {
            (MannerWord::OneAtATime, None) => MannerKind::OneAtATime,
            (MannerWord::OneToAPlace, None) => MannerKind::OneToAPlace,
            (MannerWord::Aside, Some(thing)) => {
                MannerKind::Aside(self.thing(&format!("{place}/thing"), thing, &Role::Mentioned)?)
            }
            _ => {
                self.fault(&format!("{place}/thing"), "kind `aside` names a thing, the others do not");
                return None;
            }
        };
        Some(Manner { span: span?, kind })
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
            other.is_some_and(|other| with(step) == other.thing && with(other) == step.thing && step.thing.is_some())
                && with(step) != step.thing
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
