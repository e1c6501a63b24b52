//! The order of questions before each step: do I see, do I know what I will need, is it done, what next.
//!
//! Everything that was done is read from memory, so that equal memories give equal decisions: [`tries`] counts own
//! transitions, [`goals`] takes goals and groups one by one, [`trial`] finds by trying what nobody said.

mod goals;
mod search_for;
mod trial;
mod tries;

use crate::{
    counsel::Avoided,
    decision::{Decision, GiveUpCause, PlanOptions, Situation, Step, Unknown},
    explanation::{Explanation, Grounds, step_words},
    ground::{Grounder, Stuck},
    lexicon::Lexicon,
    search::{Found, Want, search},
    task::{Destination, Goal, Subtask, Task},
};
use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Literal, Truth},
    task::OnUnknown,
};
use acm_memory::{
    MemoryView,
    query::{Applicability, PlaceReference, Recall},
};
use goals::Next;
use std::cell::RefCell;

/// Looks in a row before the agent acts on what it has, or gives up.
pub(crate) const MAX_LOOKS: u32 = 3;

/// The next step of a task.
pub(crate) fn decide(
    lexicon: &Lexicon,
    task: &Task,
    view: &dyn MemoryView,
    situation: &Situation,
    options: &PlanOptions,
    avoided: &[Avoided],
) -> Decision {
    let current = view.progress().current();
    let Some(subtask) = task.subtasks.get(current as usize) else {
        return Decision::Done { reason: format!("all {} subtasks are done", task.subtasks.len()) };
    };
    let may_look = situation.looks < MAX_LOOKS;
    let ground = Grounder::new(lexicon, task, view, options, may_look);
    let mind = Mind {
        ground,
        weighed: RefCell::default(),
        notes: RefCell::default(),
        task,
        view,
        situation,
        options,
        avoided,
        current,
    };
    mind.decide(subtask).unwrap_or_else(|stuck| mind.look_or_give_up(subtask, stuck))
}

struct Mind<'a> {
    ground: Grounder<'a>,
    /// Literals on which the decision hangs, with what is believed of them.
    weighed: RefCell<Vec<(Literal, Belief)>>,
    /// What the explanation shall tell besides.
    notes: RefCell<Vec<String>>,
    task: &'a Task,
    view: &'a dyn MemoryView,
    situation: &'a Situation,
    options: &'a PlanOptions,
    /// Skills on objects that this decision leaves out.
    avoided: &'a [Avoided],
    current: u32,
}

/// What shall hold next, with its references resolved.
struct Grounded {
    wants: Vec<Want>,
    /// The same as literals with what is believed of them.
    literals: Vec<(Literal, Belief)>,
    /// How often the goal asks for the skill.
    times: u32,
    guessed: bool,
}

impl Mind<'_> {
    fn decide(&self, subtask: &Subtask) -> Result<Decision, Stuck> {
        self.see()?;
        self.look_ahead()?;
        let mut next = match self.not_asked_for(subtask)? {
            Some(next) => next,
            None => self.next(&subtask.goal)?,
        };
        if let (Next::Reached(_), Some(goal)) = (&next, self.hands_free(&subtask.goal)) {
            next = Next::Pursue(Box::new(goal));
        }
        match next {
            Next::Reached(reason) => Ok(Decision::SubtaskDone { index: self.current, reason, grounds: self.grounds() }),
            Next::Look(reason) => Ok(self.look(reason)),
            Next::Pursue(goal) => {
                self.within_budget(subtask)?;
                self.act(subtask, &goal)
            }
        }
    }

    /// What is not seen is looked for again, then behind what may hide it; what is left is said.
    fn look_or_give_up(&self, subtask: &Subtask, stuck: Stuck) -> Decision {
        if stuck.look && self.situation.looks < MAX_LOOKS {
            return self.look(stuck.unknown.text);
        }
        let stuck = if stuck.absent {
            match self.search_for(subtask, stuck) {
                Ok(decision) => return decision,
                Err(stuck) => stuck,
            }
        } else {
            stuck
        };
        Decision::GiveUp { unknown: stuck.unknown, grounds: self.grounds() }
    }

    fn look(&self, reason: String) -> Decision {
        Decision::Look { reason, grounds: self.grounds() }
    }

    fn weigh(&self, literal: &(Literal, Belief)) {
        self.weighed.borrow_mut().push(literal.clone());
    }

    fn note(&self, note: String) {
        self.notes.borrow_mut().push(note);
    }

    fn grounds(&self) -> Grounds {
        Grounds { references: self.ground.found(), literals: self.weighed.take() }
    }

    fn see(&self) -> Result<(), Stuck> {
        if self.view.frames_seen() > 0 && !self.view.objects().is_empty() {
            return Ok(());
        }
        let what = if self.view.frames_seen() == 0 {
            "no frame has shown anything in this episode"
        } else {
            "there is a surface and nothing on it"
        };
        Err(Stuck::look(GiveUpCause::Perception, format!("I see nothing: {what}")))
    }

    /// Whether a later subtask needs a past that memory does not hold and that nothing done before it will make:
    /// then it is honest to give up before anything is touched.
    fn look_ahead(&self) -> Result<(), Stuck> {
        if self.options.on_unknown == OnUnknown::Guess {
            return Ok(());
        }
        let mut will_be_moved: Vec<ObjectId> = Vec::new();
        for (index, subtask) in self.task.subtasks.iter().enumerate().skip(self.current as usize) {
            if let Goal::At { destination: Destination::History { object, reference }, .. } = &subtask.goal {
                // A reference that cannot be resolved yet is the business of its own subtask.
                let Ok(of) = self.ground.object(*object) else { continue };
                let will_be_known = *reference == PlaceReference::BeforeMoved && will_be_moved.contains(&of.value);
                if will_be_known {
                    continue;
                }
                let recall = self.ground.recall(of.value, *reference, index as u32);
                if let Recall::Unknown { .. } = recall {
                    return Err(self.ground.unknown_past(*object, of.value, *reference, recall));
                }
            }
            if let Goal::At { object, .. } | Goal::Holding { object, .. } = &subtask.goal
                && let Ok(moved) = self.ground.object(*object)
            {
                will_be_moved.push(moved.value);
            }
        }
        Ok(())
    }

    fn within_budget(&self, subtask: &Subtask) -> Result<(), Stuck> {
        let open = || {
            let open = self.task.subtasks.len() as u32 - self.current;
            format!("{open} of {} subtasks are open, the next is \"{}\"", self.task.subtasks.len(), subtask.text)
        };
        if self.situation.time >= self.situation.deadline {
            let text = format!("the time is over at {}: {}", self.situation.time, open());
            return Err(Stuck::give_up(GiveUpCause::Budget, text));
        }
        if self.situation.skills_left == 0 {
            let text = format!("no skill may be executed any more: {}", open());
            return Err(Stuck::give_up(GiveUpCause::Budget, text));
        }
        Ok(())
    }

    fn act(&self, subtask: &Subtask, goal: &Grounded) -> Result<Decision, Stuck> {
        let (limits, last_failure) = self.limits(goal.times);
        let found = search(self.view, &goal.wants, &limits);
        let Some(first) = found.steps.first().cloned() else {
            found.rejected.iter().filter_map(|rejected| rejected.failed.as_ref()).for_each(|failed| self.weigh(failed));
            return Err(no_plan(goal, &found, last_failure));
        };
        if let Some(assumed) = found.assumed.first()
            && self.situation.looks < MAX_LOOKS
        {
            self.weigh(assumed);
            let (literal, belief) = assumed;
            let words = step_words(&first);
            return Ok(self.look(format!("{words} needs {literal}, and I cannot tell: {}", belief.reason)));
        }
        let tried = (first.skill.clone(), first.part.object);
        let step = Step {
            attempt: limits.failures.get(&tried).copied().unwrap_or(0),
            subtask: self.current,
            prediction: self.view.predict(&first),
            guessed: goal.guessed,
            candidate: first,
        };
        let explanation = self.explain(subtask, goal, found, &step);
        Ok(Decision::Act { step, explanation })
    }

    fn explain(&self, subtask: &Subtask, goal: &Grounded, found: Found, step: &Step) -> Explanation {
        let mut notes = self.notes.take();
        for (literal, belief) in &found.assumed {
            notes.push(format!("assumed without being sure: {literal} ({})", belief.reason));
        }
        let target = self.view.object(step.candidate.part.object);
        if let Some(entry) = target.filter(|entry| !entry.verified) {
            notes.push(format!("{} was seen but not yet confirmed by a second view", entry.id));
        }
        if let Some(entry) = target.filter(|entry| !entry.ambiguous_with.is_empty()) {
            let others = entry.ambiguous_with.iter().map(|(id, p)| format!("{id} with {p:.2}")).collect::<Vec<_>>();
            notes.push(format!("{} may also be {}", entry.id, others.join(", ")));
        }
        if step.attempt > 0 {
            notes.push(format!("attempt {}: {} failed before", step.attempt + 1, step.attempt));
        }
        if step.guessed {
            notes.push("rests on a guess".into());
        }
        let conditions = &step.candidate.preconditions;
        let applicability: Applicability = self.view.applicable(conditions);
        Explanation {
            goal: self.task.describe(&subtask.goal),
            subtask: subtask.text.clone(),
            references: self.ground.found(),
            literals: goal.literals.clone(),
            applicability,
            rejected: found.rejected,
            plan: found.steps.iter().map(step_words).collect(),
            candidates_inspected: found.inspected,
            notes,
        }
    }
}

fn no_plan(goal: &Grounded, found: &Found, last_failure: Option<Unknown>) -> Stuck {
    if let Some(unknown) = last_failure {
        return Stuck { look: false, absent: false, unknown };
    }
    let wanted = goal.literals.iter().find(|(_, belief)| belief.truth != Truth::Yes).or(goal.literals.first());
    let literal = wanted.map_or_else(|| "nothing".to_owned(), |(literal, _)| literal.to_string());
    // A condition that is not met yet is the search's daily bread; what it could do nothing about comes first.
    let hard = found.rejected.iter().find(|rejected| rejected.failed.is_none());
    let why = match hard.or(found.rejected.first()) {
        Some(rejected) => format!("{}: {}", rejected.candidate, rejected.reason),
        None => "no skill that I have brings it about".to_owned(),
    };
    Stuck::give_up(GiveUpCause::Plan, format!("I know no way to {literal}: {why}"))
}
