//! Operators bound to objects: every action that can ever be done and that can matter, over numbered facts.

use super::{
    instance::{Atom, Condition, Instance, Origin, Slot, atom, for_each_binding},
    node::{Lit, Node, State},
    problem::{Call, ProblemError},
};
use std::collections::{BTreeMap, BTreeSet, btree_map::Entry};

/// Most ways to bind one operator.
const MAX_BINDINGS: usize = 400_000;
/// Most cases that the condition of one action falls into.
const MAX_CASES: usize = 256;
/// Most ways in which one derived fact can follow.
const MAX_INFERENCES: usize = 10_000;

/// An operator bound to objects, in one case of its condition.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Action {
    pub operator: usize,
    pub arguments: Vec<u16>,
    pub precondition: Vec<Lit>,
    pub add: Vec<u32>,
    pub delete: Vec<u32>,
    pub cost: f64,
}

/// A derived fact follows from these.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Inference {
    pub head: u32,
    pub body: Vec<Lit>,
}

/// A ground problem. Facts that never change are worked in.
#[derive(Debug)]
pub(super) struct Task {
    pub facts: Vec<Atom>,
    pub derived: Vec<bool>,
    pub inferences: Vec<Inference>,
    pub actions: Vec<Action>,
    pub goal: Node,
    /// Without the derived facts.
    pub init: State,
    /// Inferences by a fact of their body that is not derived and must hold; and those without one.
    triggered: Vec<Vec<u32>>,
    untriggered: Vec<u32>,
}

impl Task {
    /// Binds a problem.
    pub fn new(instance: &Instance<'_>) -> Result<Task, ProblemError> {
        let mut grounder = Grounder::new(instance);
        let mut actions = Vec::new();
        for operator in 0..instance.schemata.len() {
            grounder.bind(operator, &mut Vec::new(), &mut actions)?;
        }
        let goal = grounder.node(&instance.goal, &mut Vec::new(), false);
        let inferences = grounder.inferences()?;
        Ok(prune(grounder.facts, inferences, actions, goal, instance))
    }
    /// The state with what follows from it.
    pub fn with_derived(&self, state: &State) -> State {
        let mut state = state.clone();
        if self.inferences.is_empty() {
            return state;
        }
        let triggered = |fact: &usize| state.contains(*fact);
        let mut open: Vec<u32> =
            (0..self.facts.len()).filter(triggered).flat_map(|fact| &self.triggered[fact]).copied().collect();
        open.extend(&self.untriggered);
        loop {
            let before = open.len();
            open.retain(|number| {
                let inference = &self.inferences[*number as usize];
                let follows = inference.body.iter().all(|lit| state.holds(*lit));
                if follows {
                    state.set(inference.head as usize, true);
                }
                !follows
            });
            if open.len() == before {
                return state;
            }
        }
    }
    /// The state after an action.
    pub fn after(&self, state: &State, action: &Action) -> State {
        let mut next = state.clone();
        action.delete.iter().for_each(|fact| next.set(*fact as usize, false));
        action.add.iter().for_each(|fact| next.set(*fact as usize, true));
        next
    }
}

/// The action as a step.
pub(super) fn call(action: &Action, instance: &Instance<'_>) -> Call {
    let arguments = action.arguments.iter().map(|object| instance.objects[usize::from(*object)].to_string());
    Call { operator: instance.domain.operators[action.operator].name.clone(), arguments: arguments.collect() }
}

struct Grounder<'i> {
    instance: &'i Instance<'i>,
    facts: Vec<Atom>,
    numbers: BTreeMap<Atom, u32>,
    /// By predicate: the argument lists that effects can bring about, each argument for itself.
    reach: Vec<Vec<Vec<BTreeSet<u16>>>>,
}

impl<'i> Grounder<'i> {
    fn new(instance: &'i Instance<'i>) -> Grounder<'i> {
        let mut reach = vec![Vec::new(); instance.origins.len()];
        for schema in &instance.schemata {
            for effect in schema.effects.iter().filter(|effect| !effect.negated) {
                let members = |slot: &Slot| match slot {
                    Slot::Object(object) => BTreeSet::from([*object]),
                    Slot::Variable(depth) => {
                        let parameter = schema.parameters.iter().chain(&effect.variables).nth(*depth);
                        parameter.into_iter().flatten().copied().collect()
                    }
                };
                reach[usize::from(effect.predicate)].push(effect.slots.iter().map(members).collect());
            }
        }
        Grounder { instance, facts: Vec::new(), numbers: BTreeMap::new(), reach }
    }

    /// Binds the parameters from the one that comes next.
    fn bind(&mut self, operator: usize, bound: &mut Vec<u16>, actions: &mut Vec<Action>) -> Result<(), ProblemError> {
        let instance = self.instance;
        let schema = &instance.schemata[operator];
        let Some(members) = schema.parameters.get(bound.len()) else {
            return self.bound(operator, bound, actions);
        };
        for member in members {
            if !bound.contains(member) {
                bound.push(*member);
                self.bind(operator, bound, actions)?;
                bound.pop();
            }
        }
        Ok(())
    }

    /// The actions of an operator whose parameters are bound: one for each case of its condition.
    fn bound(&mut self, operator: usize, bound: &mut Vec<u16>, actions: &mut Vec<Action>) -> Result<(), ProblemError> {
        let instance = self.instance;
        let schema = &instance.schemata[operator];
        let name = || instance.domain.operators[operator].name.clone();
        let node = self.node(&schema.precondition, bound, false);
        let Some(cases) = node.alternatives(MAX_CASES) else {
            return Err(ProblemError::TooManyCases { name: name(), limit: MAX_CASES });
        };
        if cases.is_empty() {
            return Ok(());
        }
        let (mut add, mut delete) = (BTreeSet::new(), BTreeSet::new());
        for effect in &schema.effects {
            for_each_binding(&effect.variables, bound, &mut |environment| {
                let changed = atom(effect.predicate, &effect.slots, environment);
                if !effect.negated {
                    add.insert(self.number(changed));
                } else if self.possible(&changed) {
                    delete.insert(self.number(changed));
                }
            });
        }
        let delete: Vec<u32> = delete.difference(&add).copied().collect();
        for precondition in cases {
            let mut action = Action {
                operator,
                arguments: bound.clone(),
                precondition,
                add: add.iter().copied().collect(),
                delete: delete.clone(),
                cost: 0.0,
            };
            action.cost = instance.problem.cost(&call(&action, instance));
            actions.push(action);
        }
        match actions.len() > MAX_BINDINGS {
            true => Err(ProblemError::TooManyActions { operator: name(), limit: MAX_BINDINGS }),
            false => Ok(()),
        }
    }

    fn number(&mut self, wanted: Atom) -> u32 {
        match self.numbers.entry(wanted) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(new) => {
                self.facts.push(wanted);
                *new.insert((self.facts.len() - 1) as u32)
            }
        }
    }

    /// Whether an atom can ever hold, as far as its predicate and its arguments tell.
    fn possible(&self, wanted: &Atom) -> bool {
        let fits = |lists: &Vec<BTreeSet<u16>>| {
            lists.iter().zip(wanted.arguments).all(|(list, object)| list.contains(&object))
        };
        match self.instance.origin(wanted.predicate) {
            Origin::Static => self.instance.init.contains(wanted),
            Origin::Fluent => {
                self.instance.init.contains(wanted) || self.reach[usize::from(wanted.predicate)].iter().any(fits)
            }
            Origin::Derived(rule) => {
                let parameters = &self.instance.rules[rule].parameters;
                parameters.iter().zip(wanted.arguments).all(|(members, object)| members.contains(&object))
            }
        }
    }

    fn node(&mut self, condition: &Condition, environment: &mut Vec<u16>, negated: bool) -> Node {
        let join = |negated: bool, list: Vec<Node>| if negated { Node::any(list) } else { Node::all(list) };
        match condition {
            Condition::Atom { predicate, slots, negated: also } => {
                let wanted = atom(*predicate, slots, environment);
                let negated = negated != *also;
                match (self.possible(&wanted), self.instance.origin(*predicate)) {
                    (true, Origin::Static) if negated => Node::FALSE,
                    (true, Origin::Static) => Node::TRUE,
                    (false, _) if negated => Node::TRUE,
                    (false, _) => Node::FALSE,
                    (true, _) => Node::Literal(Lit::new(self.number(wanted) as usize, negated)),
                }
            }
            Condition::All(list) => {
                let list = list.iter().map(|item| self.node(item, environment, negated)).collect();
                join(negated, list)
            }
            Condition::Any(list) => {
                let list = list.iter().map(|item| self.node(item, environment, negated)).collect();
                join(!negated, list)
            }
            Condition::Not(body) => self.node(body, environment, !negated),
            Condition::ForAll(members, body) => join(negated, self.each(members, body, environment, negated)),
            Condition::Exists(members, body) => join(!negated, self.each(members, body, environment, negated)),
            Condition::Exactly(n, members, body) => {
                let others = members.len().saturating_sub(*n);
                let for_n = self.each(members, body, environment, false);
                let not_for_others = self.each(members, body, environment, true);
                match negated {
                    false => Node::all([Node::at_least(*n, for_n), Node::at_least(others, not_for_others)]),
                    true => Node::any([Node::at_least(n + 1, for_n), Node::at_least(others + 1, not_for_others)]),
                }
            }
            Condition::Pairs(n, rows, columns, body) => {
                let mut table = |firsts: &[u16], seconds: &[u16], turned: bool| -> Vec<Node> {
                    let mut row = |first: u16| {
                        let with = |second: &&u16| **second != first;
                        let pairs = seconds.iter().filter(with).map(|second| match turned {
                            false => [first, *second],
                            true => [*second, first],
                        });
                        let pairs: Vec<Node> = pairs
                            .map(|pair| {
                                environment.extend(pair);
                                let node = self.node(body, environment, negated);
                                environment.truncate(environment.len() - 2);
                                node
                            })
                            .collect();
                        join(!negated, pairs)
                    };
                    firsts.iter().map(|first| row(*first)).collect()
                };
                let (by_row, by_column) = (table(rows, columns, false), table(columns, rows, true));
                let needed = |all: &[Node]| if negated { (all.len() + 1).saturating_sub(*n) } else { *n };
                let (first, second) = (needed(&by_row), needed(&by_column));
                join(negated, vec![Node::at_least(first, by_row), Node::at_least(second, by_column)])
            }
        }
    }

    fn each(&mut self, members: &[u16], body: &Condition, environment: &mut Vec<u16>, negated: bool) -> Vec<Node> {
        let mut nodes = Vec::new();
        for member in members {
            environment.push(*member);
            nodes.push(self.node(body, environment, negated));
            environment.pop();
        }
        nodes
    }

    /// What the derived facts follow from that are asked for, and those that they ask for in turn.
    fn inferences(&mut self) -> Result<Vec<Inference>, ProblemError> {
        let mut inferences = Vec::new();
        let mut fact = 0;
        while let Some(head) = self.facts.get(fact).copied() {
            if let Origin::Derived(rule) = self.instance.origin(head.predicate) {
                let rule = &self.instance.rules[rule];
                let mut environment = head.arguments.into_iter().take(rule.parameters.len()).collect();
                let node = self.node(&rule.when, &mut environment, false);
                let Some(cases) = node.alternatives(MAX_INFERENCES) else {
                    let name = self.instance.predicate(&head).to_string();
                    return Err(ProblemError::TooManyCases { name, limit: MAX_INFERENCES });
                };
                inferences.extend(cases.into_iter().map(|body| Inference { head: fact as u32, body }));
            }
            fact += 1;
        }
        Ok(inferences)
    }
}

/// Leaves out what can never happen, what never changes and what nobody asks for.
fn prune(
    facts: Vec<Atom>,
    mut inferences: Vec<Inference>,
    mut actions: Vec<Action>,
    goal: Node,
    instance: &Instance<'_>,
) -> Task {
    let derived: Vec<bool> =
        facts.iter().map(|fact| matches!(instance.origin(fact.predicate), Origin::Derived(_))).collect();
    let reached = reachable(&facts, &derived, &inferences, &actions, instance);
    let can = |lit: &Lit| reached[lit.index()];
    actions.retain(|action| action.precondition.iter().all(can));
    inferences.retain(|inference| inference.body.iter().all(can));
    // What can never be otherwise needs not be asked.
    let open = |lit: &Lit| can(&lit.negate());
    actions.iter_mut().for_each(|action| action.precondition.retain(open));
    inferences.iter_mut().for_each(|inference| inference.body.retain(open));
    let goal = goal.map(&|lit| match (can(&lit), open(&lit)) {
        (false, _) => Node::FALSE,
        (true, false) => Node::TRUE,
        (true, true) => Node::Literal(lit),
    });

    let mut asked = vec![false; facts.len()];
    goal.for_each(&mut |lit| asked[lit.fact()] = true);
    actions.iter().flat_map(|action| &action.precondition).for_each(|lit| asked[lit.fact()] = true);
    loop {
        let more: Vec<usize> = inferences
            .iter()
            .filter(|inference| asked[inference.head as usize])
            .flat_map(|inference| inference.body.iter().map(|lit| lit.fact()))
            .filter(|fact| !asked[*fact])
            .collect();
        if more.is_empty() {
            break;
        }
        more.into_iter().for_each(|fact| asked[fact] = true);
    }
    inferences.retain(|inference| asked[inference.head as usize]);
    for action in &mut actions {
        action.add.retain(|fact| asked[*fact as usize]);
        action.delete.retain(|fact| asked[*fact as usize]);
    }
    renumber(&facts, &derived, &asked, inferences, without_dominated(actions), goal, instance)
}

/// Literals that can come about if nothing ever undoes anything.
fn reachable(
    facts: &[Atom],
    derived: &[bool],
    inferences: &[Inference],
    actions: &[Action],
    instance: &Instance<'_>,
) -> Vec<bool> {
    let mut reached = vec![false; facts.len() * 2];
    for (number, fact) in facts.iter().enumerate() {
        let at_first = instance.init.contains(fact);
        reached[Lit::new(number, false).index()] = at_first;
        // Of derived facts only that they can hold is followed up.
        reached[Lit::new(number, true).index()] = !at_first || derived[number];
    }
    let (mut waiting, mut unmet): (Vec<&Action>, Vec<&Inference>) =
        (actions.iter().collect(), inferences.iter().collect());
    loop {
        let before = waiting.len() + unmet.len();
        waiting.retain(|action| {
            let ready = action.precondition.iter().all(|lit| reached[lit.index()]);
            if ready {
                action.add.iter().for_each(|fact| reached[Lit::new(*fact as usize, false).index()] = true);
                action.delete.iter().for_each(|fact| reached[Lit::new(*fact as usize, true).index()] = true);
            }
            !ready
        });
        unmet.retain(|inference| {
            let follows = inference.body.iter().all(|lit| reached[lit.index()]);
            reached[Lit::new(inference.head as usize, false).index()] |= follows;
            !follows
        });
        if waiting.len() + unmet.len() == before {
            return reached;
        }
    }
}

/// Without actions that do nothing, and without those that another does as well, needing no more and costing no more.
fn without_dominated(actions: Vec<Action>) -> Vec<Action> {
    let mut kept: Vec<Option<Action>> = Vec::new();
    let mut alike: BTreeMap<(Vec<u32>, Vec<u32>), Vec<usize>> = BTreeMap::new();
    for action in actions {
        if action.add.is_empty() && action.delete.is_empty() {
            continue;
        }
        let others = alike.entry((action.add.clone(), action.delete.clone())).or_default();
        let does_as_well = |one: &Action, other: &Action| {
            one.cost <= other.cost && one.precondition.iter().all(|lit| other.precondition.contains(lit))
        };
        if others.iter().any(|other| kept[*other].as_ref().is_some_and(|other| does_as_well(other, &action))) {
            continue;
        }
        others.retain(|other| {
            let worse = kept[*other].as_ref().is_some_and(|other| does_as_well(&action, other));
            if worse {
                kept[*other] = None;
            }
            !worse
        });
        others.push(kept.len());
        kept.push(Some(action));
    }
    kept.into_iter().flatten().collect()
}

fn renumber(
    facts: &[Atom],
    derived: &[bool],
    asked: &[bool],
    mut inferences: Vec<Inference>,
    mut actions: Vec<Action>,
    goal: Node,
    instance: &Instance<'_>,
) -> Task {
    let kept: Vec<usize> = (0..facts.len()).filter(|fact| asked[*fact]).collect();
    let mut numbers = vec![0_u32; facts.len()];
    kept.iter().zip(0..).for_each(|(old, new)| numbers[*old] = new);
    let fact = |old: &mut u32| *old = numbers[*old as usize];
    let lit = |old: Lit| Lit::new(numbers[old.fact()] as usize, old.negated());
    for action in &mut actions {
        action.add.iter_mut().chain(&mut action.delete).for_each(fact);
        action.precondition.iter_mut().for_each(|old| *old = lit(*old));
    }
    for inference in &mut inferences {
        fact(&mut inference.head);
        inference.body.iter_mut().for_each(|old| *old = lit(*old));
    }
    inferences.sort();
    inferences.dedup();
    let facts: Vec<Atom> = kept.iter().map(|old| facts[*old]).collect();
    let derived: Vec<bool> = kept.iter().map(|old| derived[*old]).collect();
    let mut init = State::empty(facts.len());
    for (number, fact) in facts.iter().enumerate() {
        init.set(number, instance.init.contains(fact));
    }
    let (mut triggered, mut untriggered) = (vec![Vec::new(); facts.len()], Vec::new());
    for (number, inference) in (0..).zip(&inferences) {
        match inference.body.iter().find(|lit| !lit.negated() && !derived[lit.fact()]) {
            Some(trigger) => triggered[trigger.fact()].push(number),
            None => untriggered.push(number),
        }
    }
    Task {
        facts,
        derived,
        inferences,
        actions,
        goal: goal.map(&|old| Node::Literal(lit(old))),
        init,
        triggered,
        untriggered,
    }
}
