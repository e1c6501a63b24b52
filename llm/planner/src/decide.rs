//! The order of questions before each step: do I see, do I know what I will need, is it done, what next.

use crate::{
    counsel::Avoided,
    decision::{Decision, GiveUpCause, PlanOptions, Situation, Step, Unknown},
    explanation::{Explanation, Grounds, step_words},
    ground::{Grounder, Stuck, missing},
    lexicon::Lexicon,
    search::{Found, Limits, Want, search},
    task::{Destination, Goal, Subtask, Task},
};
use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Evidence, Literal, Term, Truth},
    task::OnUnknown,
};
use acm_memory::{
    MemoryView,
    entry::{Presence, Transition, TransitionResult},
    query::{Applicability, PlaceReference, Recall},
};
use std::{cell::RefCell, collections::BTreeMap};

/// Looks in a row before the agent acts on what it has, or gives up.
pub(crate) const MAX_LOOKS: u32 = 3;
/// Failures in a row of one skill on one object in one subtask.
pub(crate) const MAX_FAILURES: u32 = 3;
/// Tries of one skill on one object in one subtask, verified ones included, beyond those that the goal asks for.
const MAX_TRIES: u32 = 8;
/// Confidence from which a felt literal stands in for a verdict that could not be given.
const FELT_ENOUGH: f64 = 0.5;

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
    let mind = Mind { ground, weighed: RefCell::default(), view, situation, options, avoided, current };
    mind.decide(task, subtask).unwrap_or_else(|stuck| mind.look_or_give_up(stuck))
}

struct Mind<'a> {
    ground: Grounder<'a>,
    /// Literals on which the decision hangs, with what is believed of them.
    weighed: RefCell<Vec<(Literal, Belief)>>,
    view: &'a dyn MemoryView,
    situation: &'a Situation,
    options: &'a PlanOptions,
    /// Skills on objects that this decision leaves out.
    avoided: &'a [Avoided],
    current: u32,
}

/// The current goal with its references resolved.
struct Grounded {
    want: Want,
    /// The goal as a literal with what is believed of it.
    literal: (Literal, Belief),
    /// How often the goal asks for the skill.
    times: u32,
    guessed: bool,
}

impl Mind<'_> {
    fn decide(&self, task: &Task, subtask: &Subtask) -> Result<Decision, Stuck> {
        self.see()?;
        self.look_ahead(task)?;
        let goal = self.ground_goal(task, &subtask.goal)?;
        self.weigh(&goal.literal);
        let (literal, belief) = &goal.literal;
        match belief.truth {
            Truth::Yes => {
                let reason = format!("{literal}: {}", belief.reason);
                return Ok(Decision::SubtaskDone { index: self.current, reason, grounds: self.grounds() });
            }
            Truth::Unknown if self.situation.looks < MAX_LOOKS => {
                return Ok(self.look(format!("I cannot tell whether {literal}: {}", belief.reason)));
            }
            Truth::Unknown | Truth::No => {}
        }
        self.within_budget(task, subtask)?;
        self.act(task, subtask, &goal)
    }

    fn look_or_give_up(&self, stuck: Stuck) -> Decision {
        if stuck.look && self.situation.looks < MAX_LOOKS {
            return self.look(stuck.unknown.text);
        }
        Decision::GiveUp { unknown: stuck.unknown, grounds: self.grounds() }
    }

    fn look(&self, reason: String) -> Decision {
        Decision::Look { reason, grounds: self.grounds() }
    }

    fn weigh(&self, literal: &(Literal, Belief)) {
        self.weighed.borrow_mut().push(literal.clone());
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
    fn look_ahead(&self, task: &Task) -> Result<(), Stuck> {
        if self.options.on_unknown == OnUnknown::Guess {
            return Ok(());
        }
        let mut will_be_moved: Vec<ObjectId> = Vec::new();
        for (index, subtask) in task.subtasks.iter().enumerate().skip(self.current as usize) {
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
            if subtask.goal.moves()
                && let Ok(moved) = self.ground.object(subtask.goal.object())
            {
                will_be_moved.push(moved.value);
            }
        }
        Ok(())
    }

    fn ground_goal(&self, task: &Task, goal: &Goal) -> Result<Grounded, Stuck> {
        let meant = self.ground.object(goal.object())?;
        let object = meant.value;
        let phrase = task.references.get(goal.object()).map_or("it", |reference| reference.phrase.as_str());
        if self.view.object(object).is_none_or(|entry| entry.presence == Presence::Missing) {
            return Err(missing(object, phrase));
        }
        let mut guessed = meant.guessed;
        let (want, literal, times) = match goal {
            Goal::At { destination, .. } => {
                let place = self.ground.destination(destination, object, self.current)?;
                guessed |= place.guessed;
                let at = Literal::new("at", vec![Term::Object(object), Term::Place(place.value)]);
                (Want::Holds(at.clone()), at, 1)
            }
            Goal::Holding { held, .. } => {
                let holding = Literal::new("holding", vec![Term::Object(object)]);
                let wanted = if *held { holding } else { holding.negate() };
                (Want::Holds(wanted.clone()), wanted, 1)
            }
            Goal::Performed { function, times, .. } => {
                let want = Want::Perform { function: function.clone(), object };
                (want, Literal::new(function, vec![Term::Object(object)]), *times)
            }
        };
        let belief = match &want {
            Want::Holds(literal) => self.view.belief(literal),
            Want::Perform { function, object } => self.performed(function, *object, times),
        };
        Ok(Grounded { want, literal: (literal, belief), times, guessed })
    }

    /// Own transitions that serve the current subtask.
    fn tries(&self) -> impl Iterator<Item = &Transition> {
        let since = self.view.progress().current_since();
        let serves = move |t: &&Transition| t.subtask == Some(self.current) && t.moment >= since;
        self.view.transitions().iter().filter(serves)
    }

    /// Whether a function was performed on an object often enough since the subtask began.
    fn performed(&self, function: &str, object: ObjectId, times: u32) -> Belief {
        let counts = |t: &&Transition| t.skill() == function && t.object() == object && took_effect(t);
        let counted: Vec<&Transition> = self.tries().filter(counts).collect();
        let done = counted.len() as u32;
        Belief {
            truth: if done >= times { Truth::Yes } else { Truth::No },
            confidence: 1.0,
            evidence: counted.iter().map(|t| Evidence::Transition(t.id)).collect(),
            reason: format!("{done} of {times} verified since the subtask began"),
        }
    }

    fn within_budget(&self, task: &Task, subtask: &Subtask) -> Result<(), Stuck> {
        let open = || {
            let open = task.subtasks.len() as u32 - self.current;
            format!("{open} of {} subtasks are open, the next is \"{}\"", task.subtasks.len(), subtask.text)
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

    fn act(&self, task: &Task, subtask: &Subtask, goal: &Grounded) -> Result<Decision, Stuck> {
        let (limits, last_failure) = self.limits(goal.times);
        let found = search(self.view, std::slice::from_ref(&goal.want), &limits);
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
        let explanation = self.explain(task, subtask, goal, found, &step);
        Ok(Decision::Act { step, explanation })
    }

    /// What may be tried again, from the tries of this subtask; with the last failure.
    fn limits(&self, times: u32) -> (Limits, Option<Unknown>) {
        let mut tries: BTreeMap<(String, ObjectId), u32> = BTreeMap::new();
        let mut limits = Limits { untouched: self.ground.untouched(), ..Limits::default() };
        let mut last_failure = None;
        for transition in self.tries() {
            let tried = (transition.skill().to_owned(), transition.object());
            *tries.entry(tried.clone()).or_default() += 1;
            let failures = limits.failures.entry(tried.clone()).or_default();
            if took_effect(transition) {
                *failures = 0;
                continue;
            }
            *failures += 1;
            let (cause, reason) = match &transition.result {
                TransitionResult::Failed { cause, reason } => ((*cause).into(), reason.clone()),
                _ => (GiveUpCause::Perception, "what it brought about could not be told".to_owned()),
            };
            let text = format!("{} of {} did not work in {failures} tries: {reason}", tried.0, tried.1);
            if *failures >= MAX_FAILURES {
                limits.spent.insert(tried, text.clone());
            }
            last_failure = Some(Unknown { cause, text });
        }
        for (tried, count) in tries {
            if count >= MAX_TRIES + times {
                let text = format!("{} of {} was done {count} times without getting there", tried.0, tried.1);
                last_failure.get_or_insert(Unknown { cause: GiveUpCause::Plan, text: text.clone() });
                limits.spent.entry(tried).or_insert(text);
            }
        }
        let left_out = self.avoided.iter().map(|a| ((a.skill.clone(), a.object), a.reason.clone()));
        limits.spent.extend(left_out);
        (limits, last_failure)
    }

    fn explain(&self, task: &Task, subtask: &Subtask, goal: &Grounded, found: Found, step: &Step) -> Explanation {
        let mut notes = Vec::new();
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
            goal: task.describe(&subtask.goal),
            subtask: subtask.text.clone(),
            references: self.ground.found(),
            literals: vec![goal.literal.clone()],
            applicability,
            rejected: found.rejected,
            plan: found.steps.iter().map(step_words).collect(),
            candidates_inspected: found.inspected,
            notes,
        }
    }
}

/// Whether a transition brought about what it should: verified, or not decidable by sight but felt.
fn took_effect(transition: &Transition) -> bool {
    match &transition.result {
        TransitionResult::Verified => true,
        TransitionResult::CannotTell | TransitionResult::Pending => {
            let report = &transition.report;
            let felt = |wanted: &Literal| report.felt.iter().any(|(l, c)| l == wanted && *c >= FELT_ENOUGH);
            report.failure.is_none() && !transition.predicted.is_empty() && transition.predicted.iter().all(felt)
        }
        TransitionResult::Failed { .. } => false,
    }
}

fn no_plan(goal: &Grounded, found: &Found, last_failure: Option<Unknown>) -> Stuck {
    if let Some(unknown) = last_failure {
        return Stuck { look: false, unknown };
    }
    let (literal, _) = &goal.literal;
    // A condition that is not met yet is the search's daily bread; what it could do nothing about comes first.
    let hard = found.rejected.iter().find(|rejected| rejected.failed.is_none());
    let why = match hard.or(found.rejected.first()) {
        Some(rejected) => format!("{}: {}", rejected.candidate, rejected.reason),
        None => "no skill that I have brings it about".to_owned(),
    };
    Stuck::give_up(GiveUpCause::Plan, format!("I know no way to {literal}: {why}"))
}
