//! A plan with the reason of each step.

use super::{
    domain::Domain,
    ground::{Action, Task, call},
    instance::Instance,
    node::{Lit, State},
    problem::{Call, Problem, ProblemError},
    search::{Effort, Outcome, applicable, search},
};
use acm_concept::literal::Literal;
use std::fmt;
use thiserror::Error;

/// Steps that reach the goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// In order; none where the goal holds at first.
    pub steps: Vec<Step>,
    /// Sum of the steps' costs.
    pub cost: f64,
    /// States that the search looked at.
    pub looked_at: usize,
}

/// One step of a plan, and what it is there for.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// The operator and its objects.
    pub call: Call,
    /// The step in a sentence.
    pub words: String,
    /// What it costs.
    pub cost: f64,
    /// What forced it.
    pub purpose: Purpose,
}

/// Why a step is in a plan: without it this would not hold.
#[derive(Debug, Clone, PartialEq)]
pub enum Purpose {
    /// A literal of the goal.
    Goal(Literal),
    /// A condition of a later step.
    Enables {
        /// Number of the later step, from 1.
        step: usize,
        /// Its condition.
        condition: Literal,
    },
}

/// Why there is no plan.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NoPlan {
    /// The problem is broken or too large.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// Whatever is done, the goal is not reached.
    #[error("no sequence of steps reaches the goal ({looked_at} states were looked at)")]
    Unreachable {
        /// States that the search looked at.
        looked_at: usize,
    },
    /// The search was ended by its limits.
    #[error("no plan was found within {looked_at} states: allow more states or more time")]
    GivenUp {
        /// States that the search looked at.
        looked_at: usize,
    },
}

/// Plans: grounds the operators, searches, and leaves out steps that are not needed. Equal questions get equal plans.
///
/// # Errors
/// The problem is broken, cannot be solved, or the effort was too small.
///
/// ```
/// # use acm_planner::classical::{Domain, Effort, Problem, formula::Formula, plan};
/// # use acm_concept::literal::{Literal, Term};
/// let kinds = |list: &[&str]| list.iter().map(|kind| kind.to_string()).collect();
/// let objects = [("cup", kinds(&["movable"])), ("box", kinds(&["container", "openable"]))];
/// let problem = Problem::new(
///     objects.map(|(name, kinds)| (name.to_string(), kinds)).into(),
///     vec![Literal::new("hand-empty", vec![])],
///     Formula::parse("(inside cup box)").unwrap(),
/// );
/// let found = plan(&Domain::manipulation().unwrap(), &problem, &Effort::default()).unwrap();
/// let steps: Vec<String> = found.steps.iter().map(|step| step.call.to_string()).collect();
/// assert_eq!(steps, ["open(box)", "pick(cup)", "place-in(cup, box)"]);
/// ```
pub fn plan(domain: &Domain, problem: &Problem, effort: &Effort<'_>) -> Result<Plan, NoPlan> {
    let instance = Instance::new(domain, problem)?;
    let task = Task::new(&instance)?;
    let (outcome, looked_at) = search(&task, effort);
    let found = match outcome {
        Outcome::Found(found) => found,
        Outcome::Exhausted => return Err(NoPlan::Unreachable { looked_at }),
        Outcome::Capped => return Err(NoPlan::GivenUp { looked_at }),
    };
    let actions: Vec<&Action> = found.iter().map(|number| &task.actions[*number as usize]).collect();
    let actions = without_needless(&task, actions);
    let steps = explain(&instance, &task, &actions);
    Ok(Plan { cost: steps.iter().map(|step| step.cost).sum(), steps, looked_at })
}

/// The states before each step and in the end, with what follows from them; `None` if a step cannot be done or the goal
/// does not hold in the end.
fn follow(task: &Task, actions: &[&Action]) -> Option<Vec<State>> {
    let mut state = task.init.clone();
    let mut states = Vec::new();
    for action in actions {
        let full = task.with_derived(&state);
        if !applicable(action, &full) {
            return None;
        }
        state = task.after(&state, action);
        states.push(full);
    }
    let last = task.with_derived(&state);
    let reached = task.goal.holds(&last);
    states.push(last);
    reached.then_some(states)
}

/// Leaves out each step, together with the later ones that cannot be done without it, if the goal is reached all the same.
fn without_needless<'t>(task: &Task, mut actions: Vec<&'t Action>) -> Vec<&'t Action> {
    let mut at = 0;
    while at < actions.len() {
        let mut state = task.init.clone();
        let mut kept = Vec::new();
        for (number, action) in actions.iter().enumerate() {
            if number != at && applicable(action, &task.with_derived(&state)) {
                state = task.after(&state, action);
                kept.push(*action);
            }
        }
        match task.goal.holds(&task.with_derived(&state)) {
            true => actions = kept,
            false => at += 1,
        }
    }
    actions
}

fn explain(instance: &Instance<'_>, task: &Task, actions: &[&Action]) -> Vec<Step> {
    let Some(states) = follow(task, actions) else { return Vec::new() };
    let mut goal = Vec::new();
    if let Some(last) = states.last() {
        task.goal.support(last, &mut goal);
    }
    let literal = |lit: Lit| instance.literal(&task.facts[lit.fact()], lit.negated());
    // The last step before `when` that made the literal hold, if one did.
    let maker = |lit: Lit, when: usize| {
        (0..when).rev().find(|step| !states[*step].holds(lit)).filter(|_| states[when].holds(lit))
    };
    let mut purposes: Vec<Option<Purpose>> = vec![None; actions.len()];
    for lit in goal {
        if let Some(step) = maker(lit, actions.len()) {
            purposes[step].get_or_insert(Purpose::Goal(literal(lit)));
        }
    }
    for (later, action) in actions.iter().enumerate() {
        for lit in &action.precondition {
            if let Some(step) = maker(*lit, later) {
                let enables = || Purpose::Enables { step: later + 1, condition: literal(*lit) };
                purposes[step].get_or_insert_with(enables);
            }
        }
    }
    let step = |(action, purpose): (&&Action, Option<Purpose>)| {
        let call = call(action, instance);
        // A step that nothing needs was left out before, so that each has its purpose.
        let purpose = purpose?;
        Some(Step { words: words(instance, action, &call), cost: action.cost, call, purpose })
    };
    actions.iter().zip(purposes).filter_map(step).collect()
}

fn words(instance: &Instance<'_>, action: &Action, call: &Call) -> String {
    let operator = &instance.domain.operators[action.operator];
    let mut words = operator.words.clone();
    for (parameter, object) in operator.parameters.iter().zip(&call.arguments) {
        words = words.replace(&format!("{{{}}}", parameter.name), object);
    }
    words
}

impl Plan {
    /// The steps alone.
    pub fn calls(&self) -> Vec<Call> {
        self.steps.iter().map(|step| step.call.clone()).collect()
    }
}

impl fmt::Display for Purpose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Purpose::Goal(literal) => write!(f, "the goal asks for {literal}"),
            Purpose::Enables { step, condition } => write!(f, "step {step} needs {condition}"),
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, step) in (1..).zip(&self.steps) {
            writeln!(f, "{number}. {}: {}", step.words, step.purpose)?;
        }
        Ok(())
    }
}
