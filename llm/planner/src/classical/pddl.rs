//! A problem for other planners, in the part of PDDL that all of them read: STRIPS, without types and negation.
//!
//! Operators are written bound to their objects. What must not hold becomes a proposition of its own; what is derived is
//! unfolded into what it follows from; a goal that can be reached in several ways is marked reached by actions of its own
//! once the plan is finished. Propositions are named `is-N-...` and `not-N-...`, actions `do-N-...`, so that no name is both.

use super::{
    domain::Domain,
    ground::{Task, call},
    instance::Instance,
    node::{Lit, Node},
    problem::{Call, Problem, ProblemError},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write,
};
use thiserror::Error;

/// Most cases that one action or one part of the goal is written in.
const MAX_CASES: usize = 256;
/// Most literals that one derived condition is unfolded into on the way.
const MAX_UNFOLDED: usize = 20_000;

/// The two files that planners read.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// The domain.
    pub domain: String,
    /// The problem.
    pub problem: String,
    /// The step that an action of the domain stands for; those that only mark the goal are not among them.
    pub calls: BTreeMap<String, Call>,
}

/// Why a problem cannot be written in STRIPS.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ExportError {
    /// The problem itself is broken.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// What is derived in it, or its goal, falls into too many cases.
    #[error("{what} falls into more than {MAX_CASES} cases: a planner that reads derived predicates is needed")]
    TooManyCases {
        /// A step, or the goal.
        what: String,
    },
}

/// An action in STRIPS.
struct Written {
    name: String,
    needs: Vec<String>,
    adds: Vec<String>,
    deletes: Vec<String>,
}

/// Writes a problem.
///
/// # Errors
/// The problem is broken, or too much of it is derived.
pub fn export(domain: &Domain, problem: &Problem) -> Result<Export, ExportError> {
    let instance = Instance::new(domain, problem)?;
    let task = Task::new(&instance)?;
    let names = Names { task: &task, instance: &instance };
    let mut actions = Vec::new();
    let mut calls = BTreeMap::new();
    let mut denied = BTreeSet::new();
    let mut cases_of = |node: &Node, what: &dyn Fn() -> String| -> Result<Vec<Vec<Lit>>, ExportError> {
        let too_many = || ExportError::TooManyCases { what: what() };
        let unfolded = unfold(&task, node).ok_or_else(too_many)?;
        let cases = unfolded.alternatives(MAX_CASES).ok_or_else(too_many)?;
        denied.extend(cases.iter().flatten().filter(|lit| lit.negated()).map(|lit| lit.fact()));
        Ok(cases)
    };
    let mut drafts = Vec::new();
    for action in &task.actions {
        let step = call(action, &instance);
        let needs = Node::all(action.precondition.iter().map(|lit| Node::Literal(*lit)));
        drafts.push((action, cases_of(&needs, &|| step.to_string())?, step));
    }
    let parts = match &task.goal {
        Node::All(list) => list.clone(),
        other => vec![other.clone()],
    };
    let mut parts_cases = Vec::new();
    for part in &parts {
        parts_cases.push(cases_of(part, &|| "the goal".to_string())?);
    }

    for (action, cases, step) in drafts {
        for case in cases {
            let name = format!("do-{}-{}", actions.len(), plain(&step.to_string()));
            let mut needs: Vec<String> = case.iter().map(|lit| names.of(*lit)).collect();
            needs.push("is-going-on".into());
            let of = |facts: &[u32], negated| {
                facts.iter().map(|fact| Lit::new(*fact as usize, negated)).collect::<Vec<Lit>>()
            };
            let made = [of(&action.add, false), of(&action.delete, true)].concat();
            let written = |lit: &&Lit| !lit.negated() || denied.contains(&lit.fact());
            let adds = made.iter().filter(written).map(|lit| names.of(*lit)).collect();
            let undone: Vec<Lit> = made.iter().map(|lit| lit.negate()).collect();
            let deletes = undone.iter().filter(written).map(|lit| names.of(*lit)).collect();
            calls.insert(name.clone(), step.clone());
            actions.push(Written { name, needs, adds, deletes });
        }
    }
    let going_on = vec!["is-going-on".to_string()];
    actions.push(Written {
        name: "finish".into(),
        needs: going_on.clone(),
        adds: vec!["is-finished".into()],
        deletes: going_on,
    });
    for (part, cases) in parts_cases.iter().enumerate() {
        for (number, case) in cases.iter().enumerate() {
            let needs = case.iter().map(|lit| names.of(*lit)).chain(["is-finished".to_string()]).collect();
            let adds = vec![format!("is-reached-{part}")];
            actions.push(Written { name: format!("reach-{part}-{number}"), needs, adds, deletes: Vec::new() });
        }
    }
    let facts = (0..task.facts.len()).filter(|fact| !task.derived[*fact]);
    let at_first: Vec<Lit> = facts.map(|fact| Lit::new(fact, !task.init.contains(fact))).collect();
    let at_first = at_first.into_iter().filter(|lit| !lit.negated() || denied.contains(&lit.fact()));
    let init: Vec<String> = at_first.map(|lit| names.of(lit)).chain(["is-going-on".to_string()]).collect();
    let goal: Vec<String> =
        (0..parts.len()).map(|part| format!("is-reached-{part}")).chain(["is-finished".into()]).collect();
    Ok(Export { domain: write_domain(&actions, &init, &goal), problem: write_problem(&init, &goal), calls })
}

struct Names<'t> {
    task: &'t Task,
    instance: &'t Instance<'t>,
}

impl Names<'_> {
    fn of(&self, lit: Lit) -> String {
        let literal = self.instance.literal(&self.task.facts[lit.fact()], false);
        format!("{}-{}-{}", if lit.negated() { "not" } else { "is" }, lit.fact(), plain(&literal.to_string()))
    }
}

/// The text as a name of PDDL.
fn plain(text: &str) -> String {
    let words: Vec<&str> =
        text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').filter(|w| !w.is_empty()).collect();
    words.join("-").to_ascii_lowercase()
}

/// The condition without derived facts; `None` where that is too long.
fn unfold(task: &Task, node: &Node) -> Option<Node> {
    let mut left = MAX_UNFOLDED;
    unfold_within(task, node, &mut Vec::new(), &mut left)
}

fn unfold_within(task: &Task, node: &Node, above: &mut Vec<usize>, left: &mut usize) -> Option<Node> {
    let mut each =
        |list: &[Node]| list.iter().map(|node| unfold_within(task, node, above, left)).collect::<Option<Vec<_>>>();
    match node {
        Node::All(list) => Some(Node::all(each(list)?)),
        Node::Any(list) => Some(Node::any(each(list)?)),
        Node::AtLeast(n, list) => Some(Node::at_least(*n, each(list)?)),
        Node::Literal(lit) if !task.derived[lit.fact()] => {
            *left = left.checked_sub(1)?;
            Some(Node::Literal(*lit))
        }
        // What is derived cannot support itself.
        Node::Literal(lit) if above.contains(&lit.fact()) => Some(if lit.negated() { Node::TRUE } else { Node::FALSE }),
        Node::Literal(lit) => {
            above.push(lit.fact());
            let ways = task.inferences.iter().filter(|inference| inference.head as usize == lit.fact());
            let unfolded: Option<Vec<Node>> = ways
                .map(|inference| {
                    let body = inference.body.iter().map(|need| if lit.negated() { need.negate() } else { *need });
                    let body: Vec<Node> = body.map(Node::Literal).collect();
                    let body = if lit.negated() { Node::any(body) } else { Node::all(body) };
                    unfold_within(task, &body, above, left)
                })
                .collect();
            above.pop();
            let unfolded = unfolded?;
            Some(if lit.negated() { Node::all(unfolded) } else { Node::any(unfolded) })
        }
    }
}

fn write_domain(actions: &[Written], init: &[String], goal: &[String]) -> String {
    let mut propositions: BTreeSet<&String> = init.iter().chain(goal).collect();
    for action in actions {
        propositions.extend(action.needs.iter().chain(&action.adds).chain(&action.deletes));
    }
    let mut text = String::from("(define (domain exported)\n(:requirements :strips)\n(:predicates");
    let mut put = |part: std::fmt::Arguments<'_>| text.write_fmt(part).is_ok();
    for proposition in propositions {
        put(format_args!(" ({proposition})"));
    }
    put(format_args!(")\n"));
    for Written { name, needs, adds, deletes } in actions {
        put(format_args!("(:action {name}\n :parameters ()\n :precondition (and{})\n", bracketed(needs)));
        let deleted: String = deletes.iter().map(|proposition| format!(" (not ({proposition}))")).collect();
        put(format_args!(" :effect (and{}{deleted}))\n", bracketed(adds)));
    }
    put(format_args!(")\n"));
    text
}

fn write_problem(init: &[String], goal: &[String]) -> String {
    let (init, goal) = (bracketed(init), bracketed(goal));
    format!("(define (problem exported)\n(:domain exported)\n(:objects)\n(:init{init})\n(:goal (and{goal})))\n")
}

fn bracketed(propositions: &[String]) -> String {
    propositions.iter().map(|proposition| format!(" ({proposition})")).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use crate::classical::{formula::Formula, sexpr::Expression};
    use acm_concept::literal::{Literal, Term};

    fn problem(goal: &str) -> Problem {
        let kinds = |list: &str| list.split_whitespace().map(str::to_string).collect();
        let objects = [("Cup.1", "movable"), ("box", "container openable"), ("table", "supportive")];
        let inside = Literal::new("inside", vec![Term::Symbol("Cup.1".into()), Term::Symbol("box".into())]);
        let objects = objects.map(|(name, list)| (name.to_string(), kinds(list)));
        Problem::new(objects.into(), vec![Literal::new("hand-empty", vec![]), inside], Formula::parse(goal).unwrap())
    }

    #[test]
    fn what_is_written_can_be_read_and_names_are_apart() {
        let domain = Domain::manipulation().unwrap();
        let export = export(&domain, &problem("(or (on Cup.1 table) (not (within Cup.1 box)))")).unwrap();
        assert_eq!(Expression::parse(&export.domain).unwrap().len(), 1);
        assert_eq!(Expression::parse(&export.problem).unwrap().len(), 1);
        assert!(export.calls.keys().all(|name| name.starts_with("do-")));
        assert!(export.calls.values().any(|call| call.to_string() == "pick(Cup.1)"));
        // In the closed box it can be taken in one case: that the box is open, or that it is elsewhere.
        assert_eq!(export.calls.values().filter(|call| call.operator == "pick").count(), 2);
        assert!(export.domain.contains("(:action reach-0-1"));
        assert!(!export.domain.contains("shut-in") && !export.domain.contains("within"));
    }
}
