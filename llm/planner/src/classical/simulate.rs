//! Plans are followed step by step on the operators themselves, apart from what the search makes of them: the first
//! condition that is violated is said in words. Plans of whatever origin are checked with it.

use super::{
    domain::Domain,
    instance::{Atom, Condition, Instance, Origin, atom, for_each_binding},
    problem::{Call, Problem, ProblemError},
};
use acm_concept::literal::Literal;
use std::collections::BTreeSet;
use thiserror::Error;

/// Why a plan cannot be followed, or does not reach its goal.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Violation {
    /// The problem itself is broken.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// There is no such operator, or no such object, or the object is of another kind.
    #[error("step {step}, {call}: {reason}")]
    Impossible {
        /// Number of the step, from 1.
        step: usize,
        /// The step.
        call: Call,
        /// What is wrong with it.
        reason: String,
    },
    /// A condition of a step does not hold when it is its turn.
    #[error("step {step}, {call}, needs {condition}")]
    Precondition {
        /// Number of the step, from 1.
        step: usize,
        /// The step.
        call: Call,
        /// The first condition that does not hold.
        condition: String,
    },
    /// All steps can be done, but something that is wanted does not hold then.
    #[error("after all {steps} steps the goal still lacks {condition}")]
    Goal {
        /// Steps of the plan.
        steps: usize,
        /// The first condition of the goal that does not hold.
        condition: String,
    },
}

/// Follows a plan from what holds at first, and gives what holds in the end.
///
/// # Errors
/// The first step that cannot be done, or what the goal lacks in the end.
pub fn simulate(domain: &Domain, problem: &Problem, plan: &[Call]) -> Result<Vec<Literal>, Violation> {
    let instance = Instance::new(domain, problem)?;
    let mut world = World { instance: &instance, facts: instance.init.clone() };
    for (step, call) in (1..).zip(plan) {
        world.step(call).map_err(|refusal| match refusal {
            Refusal::Impossible(reason) => Violation::Impossible { step, call: call.clone(), reason },
            Refusal::Precondition(condition) => Violation::Precondition { step, call: call.clone(), condition },
        })?;
    }
    if !world.satisfies(&instance.goal, &mut Vec::new()) {
        let condition = world.lacking(&instance.goal, &mut Vec::new());
        return Err(Violation::Goal { steps: plan.len(), condition });
    }
    let changing = world.facts.iter().filter(|atom| instance.origin(atom.predicate) == Origin::Fluent);
    Ok(changing.map(|atom| instance.literal(atom, false)).collect())
}

/// Whether a problem's goal holds at first.
///
/// # Errors
/// The problem is broken.
pub fn holds_at_first(domain: &Domain, problem: &Problem) -> Result<bool, ProblemError> {
    let instance = Instance::new(domain, problem)?;
    let world = World { instance: &instance, facts: instance.init.clone() };
    Ok(world.satisfies(&instance.goal, &mut Vec::new()))
}

enum Refusal {
    Impossible(String),
    Precondition(String),
}

/// What holds at a moment.
struct World<'i> {
    instance: &'i Instance<'i>,
    facts: BTreeSet<Atom>,
}

impl World<'_> {
    fn step(&mut self, call: &Call) -> Result<(), Refusal> {
        let (schema, mut bound) = self.bind(call).map_err(Refusal::Impossible)?;
        let schema = &self.instance.schemata[schema];
        if !self.satisfies(&schema.precondition, &mut bound) {
            return Err(Refusal::Precondition(self.lacking(&schema.precondition, &mut bound)));
        }
        for negated in [true, false] {
            for effect in schema.effects.iter().filter(|effect| effect.negated == negated) {
                for_each_binding(&effect.variables, &mut bound, &mut |environment| {
                    let changed = atom(effect.predicate, &effect.slots, environment);
                    match negated {
                        true => self.facts.remove(&changed),
                        false => self.facts.insert(changed),
                    };
                });
            }
        }
        Ok(())
    }

    /// The operator and the objects of a step.
    fn bind(&self, call: &Call) -> Result<(usize, Vec<u16>), String> {
        let operators = &self.instance.domain.operators;
        let Some(number) = operators.iter().position(|operator| operator.name == call.operator) else {
            let names: Vec<&str> = operators.iter().map(|operator| operator.name.as_str()).collect();
            return Err(format!("there is no operator `{}`, only {}", call.operator, names.join(", ")));
        };
        let operator = &operators[number];
        let (expected, found) = (operator.parameters.len(), call.arguments.len());
        if expected != found {
            return Err(format!("it has {found} arguments, `{}` takes {expected}", call.operator));
        }
        let mut bound = Vec::new();
        for (name, parameter) in call.arguments.iter().zip(&operator.parameters) {
            let object = self.instance.object(name).ok_or_else(|| format!("there is no object `{name}`"))?;
            if !self.instance.problem.is(name, &parameter.kind) {
                return Err(format!("{name} is not {}", parameter.kind));
            }
            if bound.contains(&object) {
                return Err(format!("{name} stands there twice"));
            }
            bound.push(object);
        }
        Ok((number, bound))
    }

    fn satisfies(&self, condition: &Condition, environment: &mut Vec<u16>) -> bool {
        self.evaluate(condition, environment, &mut Vec::new())
    }

    fn evaluate(&self, condition: &Condition, environment: &mut Vec<u16>, above: &mut Vec<Atom>) -> bool {
        let mut with = |objects: &[u16], body: &Condition| {
            environment.extend(objects);
            let holds = self.evaluate(body, environment, above);
            environment.truncate(environment.len() - objects.len());
            holds
        };
        match condition {
            Condition::Atom { predicate, slots, negated } => {
                self.holds(atom(*predicate, slots, environment), above) != *negated
            }
            Condition::All(list) => list.iter().all(|item| with(&[], item)),
            Condition::Any(list) => list.iter().any(|item| with(&[], item)),
            Condition::Not(body) => !with(&[], body),
            Condition::ForAll(members, body) => members.iter().all(|member| with(&[*member], body)),
            Condition::Exists(members, body) => members.iter().any(|member| with(&[*member], body)),
            Condition::Exactly(n, members, body) => {
                members.iter().filter(|member| with(&[**member], body)).count() == *n
            }
            Condition::Pairs(n, rows, columns, body) => {
                let mut pair = |row: u16, column: u16| row != column && with(&[row, column], body);
                let paired_rows = rows.iter().filter(|row| columns.iter().any(|column| pair(**row, *column))).count();
                let paired = columns.iter().filter(|column| rows.iter().any(|row| pair(*row, **column))).count();
                paired_rows >= *n && paired >= *n
            }
        }
    }

    /// Whether an atom holds; `above` are the derived ones that it is asked for, which cannot support themselves.
    fn holds(&self, wanted: Atom, above: &mut Vec<Atom>) -> bool {
        let Origin::Derived(rule) = self.instance.origin(wanted.predicate) else { return self.facts.contains(&wanted) };
        let rule = &self.instance.rules[rule];
        let fits = rule.parameters.iter().zip(wanted.arguments).all(|(members, object)| members.contains(&object));
        if !fits || above.contains(&wanted) {
            return false;
        }
        above.push(wanted);
        let mut environment = wanted.arguments.into_iter().take(rule.parameters.len()).collect();
        let holds = self.evaluate(&rule.when, &mut environment, above);
        above.pop();
        holds
    }

    /// The first part of a condition that does not hold, in words.
    fn lacking(&self, condition: &Condition, environment: &mut Vec<u16>) -> String {
        let instance = self.instance;
        match condition {
            Condition::Atom { predicate, slots, negated } => {
                instance.literal(&atom(*predicate, slots, environment), *negated).to_string()
            }
            Condition::All(list) => {
                let first = list.iter().find(|item| !self.satisfies(item, environment));
                first.map_or_else(String::new, |item| self.lacking(item, environment))
            }
            Condition::Any(list) => {
                let each: Vec<String> = list.iter().map(|item| self.lacking(item, environment)).collect();
                each.join(" or ")
            }
            Condition::Not(body) => match body.as_ref() {
                Condition::Atom { predicate, slots, negated } => {
                    instance.literal(&atom(*predicate, slots, environment), !*negated).to_string()
                }
                other => format!("that not: {}", self.wording(other, environment)),
            },
            Condition::ForAll(members, body) => {
                for member in members {
                    environment.push(*member);
                    let lacking = (!self.satisfies(body, environment)).then(|| self.lacking(body, environment));
                    environment.pop();
                    if let Some(lacking) = lacking {
                        return lacking;
                    }
                }
                String::new()
            }
            other => self.wording(other, environment),
        }
    }

    /// A condition in words, the first example of what is quantified.
    fn wording(&self, condition: &Condition, environment: &mut Vec<u16>) -> String {
        let mut example = |what: String, objects: Option<Vec<u16>>, body: &Condition| match objects {
            None => format!("{what}, of which there is none"),
            Some(objects) => {
                environment.extend(&objects);
                let words = self.wording(body, environment);
                environment.truncate(environment.len() - objects.len());
                format!("{what}, such as {words}")
            }
        };
        let first = |members: &[u16]| members.first().map(|member| vec![*member]);
        match condition {
            Condition::Atom { .. } => self.lacking(condition, environment),
            Condition::All(list) => {
                let each: Vec<String> = list.iter().map(|item| self.wording(item, environment)).collect();
                each.join(" and ")
            }
            Condition::Any(list) => {
                let each: Vec<String> = list.iter().map(|item| self.wording(item, environment)).collect();
                each.join(" or ")
            }
            Condition::Not(body) => format!("that not: {}", self.wording(body, environment)),
            Condition::ForAll(members, body) => example("all".into(), first(members), body),
            Condition::Exists(members, body) => example("one".into(), first(members), body),
            Condition::Exactly(n, members, body) => example(format!("exactly {n}"), first(members), body),
            Condition::Pairs(n, rows, columns, body) => {
                let pair =
                    rows.first().and_then(|row| Some(vec![*row, *columns.iter().find(|column| *column != row)?]));
                example(format!("{n} pairs"), pair, body)
            }
        }
    }
}
