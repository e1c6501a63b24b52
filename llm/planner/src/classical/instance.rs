//! A problem in numbers: objects, predicates and conditions that can be evaluated fast.

use super::{
    domain::{Domain, MAX_ARITY},
    formula::{Formula, THING, Variable},
    problem::{MAX_FACTS, MAX_OBJECTS, Problem, ProblemError, name_of},
};
use acm_concept::literal::{Literal, Term};
use std::collections::{BTreeMap, BTreeSet};

/// In the place of an argument that a predicate does not have.
const NONE: u16 = u16::MAX;

/// A predicate over objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Atom {
    pub predicate: u16,
    pub arguments: [u16; MAX_ARITY],
}

/// An argument of a condition: an object, or the variable at this depth of the environment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slot {
    Object(u16),
    Variable(usize),
}

/// A formula whose names are resolved. Quantifiers push on the environment.
#[derive(Debug, Clone)]
pub(super) enum Condition {
    Atom { predicate: u16, slots: Vec<Slot>, negated: bool },
    All(Vec<Condition>),
    Any(Vec<Condition>),
    Not(Box<Condition>),
    ForAll(Vec<u16>, Box<Condition>),
    Exists(Vec<u16>, Box<Condition>),
    Exactly(usize, Vec<u16>, Box<Condition>),
    Pairs(usize, Vec<u16>, Vec<u16>, Box<Condition>),
}

/// How a predicate comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Origin {
    /// It never changes.
    Static,
    /// Operators change it.
    Fluent,
    /// It follows by the rule of this number.
    Derived(usize),
}

pub(super) struct Effect {
    /// What each universally quantified variable runs over.
    pub variables: Vec<Vec<u16>>,
    pub predicate: u16,
    pub slots: Vec<Slot>,
    pub negated: bool,
}

/// An operator: what each parameter runs over, what must hold, what comes of it.
pub(super) struct Schema {
    pub parameters: Vec<Vec<u16>>,
    pub precondition: Condition,
    pub effects: Vec<Effect>,
}

/// A derived predicate.
pub(super) struct Rule {
    pub parameters: Vec<Vec<u16>>,
    pub when: Condition,
}

pub(super) struct Instance<'p> {
    pub domain: &'p Domain,
    pub problem: &'p Problem,
    pub objects: Vec<&'p str>,
    pub origins: Vec<Origin>,
    pub schemata: Vec<Schema>,
    pub rules: Vec<Rule>,
    pub init: BTreeSet<Atom>,
    pub goal: Condition,
    predicates: Vec<String>,
    numbers: BTreeMap<&'p str, u16>,
}

impl<'p> Instance<'p> {
    pub fn new(domain: &'p Domain, problem: &'p Problem) -> Result<Instance<'p>, ProblemError> {
        let limited = |what, number, limit| match number > limit {
            true => Err(ProblemError::TooLarge { what, number, limit }),
            false => Ok(()),
        };
        limited("objects", problem.objects.len(), MAX_OBJECTS)?;
        limited("facts", problem.init.len(), MAX_FACTS)?;
        let objects: Vec<&str> = problem.objects.keys().map(String::as_str).collect();
        let numbers = objects.iter().zip(0..).map(|(name, number)| (*name, number)).collect();
        let mut names = Names { problem, numbers, predicates: Vec::new(), arities: Vec::new() };
        let schemata = domain.operators.iter().map(|operator| {
            let mut scope = operator.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
            let precondition = names.condition(&operator.precondition, &mut scope)?;
            let effects = operator.effects.iter().map(|effect| {
                let outer = scope.len();
                scope.extend(effect.variables.iter().map(|variable| variable.name.as_str()));
                let (predicate, slots) = names.atom(&effect.literal, &scope)?;
                scope.truncate(outer);
                let variables = effect.variables.iter().map(|variable| names.members(variable)).collect();
                Ok(Effect { variables, predicate, slots, negated: effect.literal.negated })
            });
            let effects = effects.collect::<Result<Vec<_>, ProblemError>>()?;
            let parameters = operator.parameters.iter().map(|parameter| names.members(parameter)).collect();
            Ok(Schema { parameters, precondition, effects })
        });
        let schemata = schemata.collect::<Result<Vec<_>, ProblemError>>()?;
        let mut heads = Vec::new();
        let rules = domain.derived.iter().map(|derived| {
            let mut scope = derived.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
            heads.push(names.predicate(&derived.name, derived.parameters.len(), &derived.name)?);
            let when = names.condition(&derived.when, &mut scope)?;
            Ok(Rule { parameters: derived.parameters.iter().map(|parameter| names.members(parameter)).collect(), when })
        });
        let rules = rules.collect::<Result<Vec<_>, ProblemError>>()?;
        let goal = names.condition(&problem.goal, &mut Vec::new())?;
        let mut init = BTreeSet::new();
        for literal in &problem.init {
            let fact = |problem| ProblemError::Fact { literal: literal.to_string(), problem };
            if literal.negated {
                return Err(fact("what is not said does not hold; leave it out"));
            }
            let (predicate, slots) = names.atom(literal, &[])?;
            if heads.contains(&predicate) {
                return Err(fact("the predicate is derived from others"));
            }
            init.insert(atom(predicate, &slots, &[]));
        }
        let mut origins = vec![Origin::Static; names.predicates.len()];
        for effect in schemata.iter().flat_map(|schema| &schema.effects) {
            origins[usize::from(effect.predicate)] = Origin::Fluent;
        }
        for (rule, head) in heads.iter().enumerate() {
            origins[usize::from(*head)] = Origin::Derived(rule);
        }
        for (number, name) in (0..).zip(&names.predicates) {
            // What an object affords is a predicate too.
            if origins[usize::from(number)] == Origin::Static && names.arities[usize::from(number)] == 1 {
                let of_kind = (0..).zip(&objects).filter(|(_, object)| problem.is(object, name));
                init.extend(of_kind.map(|(object, _)| atom(number, &[Slot::Object(object)], &[])));
            }
        }
        let Names { predicates, numbers, .. } = names;
        Ok(Instance { domain, problem, objects, origins, schemata, rules, init, goal, predicates, numbers })
    }
    pub fn origin(&self, predicate: u16) -> Origin {
        self.origins[usize::from(predicate)]
    }
    /// The number of an object.
    pub fn object(&self, name: &str) -> Option<u16> {
        self.numbers.get(name).copied()
    }
    pub fn predicate(&self, atom: &Atom) -> &str {
        &self.predicates[usize::from(atom.predicate)]
    }
    pub fn arguments(&self, atom: &Atom) -> impl Iterator<Item = &'p str> {
        atom.arguments.into_iter().filter(|number| *number != NONE).map(|number| self.objects[usize::from(number)])
    }
    /// The atom as a literal.
    pub fn literal(&self, atom: &Atom, negated: bool) -> Literal {
        let arguments = self.arguments(atom).map(|name| Term::Symbol(name.into())).collect();
        Literal { predicate: self.predicate(atom).into(), arguments, negated }
    }
}

/// The atom that slots stand for in an environment.
pub(super) fn atom(predicate: u16, slots: &[Slot], environment: &[u16]) -> Atom {
    let mut arguments = [NONE; MAX_ARITY];
    for (argument, slot) in arguments.iter_mut().zip(slots) {
        *argument = match slot {
            Slot::Object(object) => *object,
            Slot::Variable(depth) => environment[*depth],
        };
    }
    Atom { predicate, arguments }
}

/// Every way to bind the variables of an effect after the parameters, each handed on in turn.
pub(super) fn for_each_binding(variables: &[Vec<u16>], environment: &mut Vec<u16>, then: &mut dyn FnMut(&[u16])) {
    match variables.split_first() {
        None => then(environment),
        Some((members, rest)) => {
            for member in members {
                environment.push(*member);
                for_each_binding(rest, environment, then);
                environment.pop();
            }
        }
    }
}

struct Names<'p> {
    problem: &'p Problem,
    numbers: BTreeMap<&'p str, u16>,
    predicates: Vec<String>,
    arities: Vec<usize>,
}

impl<'p> Names<'p> {
    fn members(&self, variable: &Variable) -> Vec<u16> {
        let of_kind = |(name, _): &(&&str, &u16)| variable.kind == THING || self.problem.is(name, &variable.kind);
        self.numbers.iter().filter(of_kind).map(|(_, number)| *number).collect()
    }
    fn predicate(&mut self, name: &str, arity: usize, literal: &str) -> Result<u16, ProblemError> {
        let error = |expected| ProblemError::Arity { literal: literal.into(), found: arity, expected };
        if arity > MAX_ARITY {
            return Err(error(MAX_ARITY));
        }
        if let Some(known) = self.predicates.iter().position(|known| known == name) {
            return match self.arities[known] == arity {
                true => Ok(known as u16),
                false => Err(error(self.arities[known])),
            };
        }
        self.predicates.push(name.into());
        self.arities.push(arity);
        Ok((self.predicates.len() - 1) as u16)
    }
    fn atom(&mut self, literal: &Literal, scope: &[&str]) -> Result<(u16, Vec<Slot>), ProblemError> {
        let predicate = self.predicate(&literal.predicate, literal.arguments.len(), &literal.to_string())?;
        let slot =
            |term: &Term| match term {
                Term::Variable(name) => scope
                    .iter()
                    .rposition(|known| known == name)
                    .map(Slot::Variable)
                    .ok_or_else(|| ProblemError::Unbound { literal: literal.to_string(), variable: name.clone() }),
                other => {
                    let name = name_of(other);
                    self.numbers.get(name.as_str()).copied().map(Slot::Object).ok_or_else(|| {
                        ProblemError::UnknownObject { literal: literal.to_string(), object: name.clone() }
                    })
                }
            };
        Ok((predicate, literal.arguments.iter().map(slot).collect::<Result<_, _>>()?))
    }
    fn condition<'f>(&mut self, formula: &'f Formula, scope: &mut Vec<&'f str>) -> Result<Condition, ProblemError> {
        let depth = scope.len();
        let condition = match formula {
            Formula::Literal(literal) => {
                let (predicate, slots) = self.atom(literal, scope)?;
                Condition::Atom { predicate, slots, negated: literal.negated }
            }
            Formula::All(list) => Condition::All(self.each(list, scope)?),
            Formula::Any(list) => Condition::Any(self.each(list, scope)?),
            Formula::Not(body) => Condition::Not(Box::new(self.condition(body, scope)?)),
            Formula::Implies(both) => {
                let first = Condition::Not(Box::new(self.condition(&both.0, scope)?));
                Condition::Any(vec![first, self.condition(&both.1, scope)?])
            }
            Formula::ForAll(variable, body) => {
                Condition::ForAll(self.members(variable), self.within(&[variable], body, scope)?)
            }
            Formula::Exists(variable, body) => {
                Condition::Exists(self.members(variable), self.within(&[variable], body, scope)?)
            }
            Formula::Exactly(n, variable, body) => {
                Condition::Exactly(*n, self.members(variable), self.within(&[variable], body, scope)?)
            }
            Formula::Pairs(n, first, second, body) => {
                let (rows, columns) = (self.members(first), self.members(second));
                let n = n.unwrap_or(rows.len().min(columns.len()));
                Condition::Pairs(n, rows, columns, self.within(&[first, second], body, scope)?)
            }
        };
        scope.truncate(depth);
        Ok(condition)
    }
    fn each<'f>(&mut self, list: &'f [Formula], scope: &mut Vec<&'f str>) -> Result<Vec<Condition>, ProblemError> {
        list.iter().map(|item| self.condition(item, scope)).collect()
    }
    fn within<'f>(
        &mut self,
        variables: &[&'f Variable],
        body: &'f Formula,
        scope: &mut Vec<&'f str>,
    ) -> Result<Box<Condition>, ProblemError> {
        scope.extend(variables.iter().map(|variable| variable.name.as_str()));
        self.condition(body, scope).map(Box::new)
    }
}
