//! How far it is to the goal if nothing ever undoes anything: the cost of a relaxed plan, and the actions that begin it.
//!
//! Each literal's cost is the sum of what its cheapest supporter needs (h-add); the relaxed plan takes those supporters,
//! each once (h-FF). A derived fact is supported by an inference that costs nothing. That a derived fact does not hold is
//! supported by breaking every inference that makes it hold now.
//!
//! A part of the goal that holds now, but that the relaxed plan undoes on its way, must be brought about again: the cheapest
//! action that does so is added. Without it a lid would be closed too early as gladly as in time.

use super::{
    ground::Task,
    node::{Lit, Node, State},
};
use std::{cmp::Reverse, collections::BinaryHeap};

/// No supporter is known, or none is needed.
const NOBODY: u32 = u32::MAX;

/// What a relaxed plan says of a state.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Estimate {
    /// Cost of the relaxed plan.
    pub cost: f64,
    /// Its actions that can be done now, in order of their numbers.
    pub helpful: Vec<u32>,
}

/// Something that supports a proposition once all that it needs is supported.
struct Supporter {
    needs: Vec<u32>,
    gives: Vec<u32>,
    cost: f64,
    action: Option<u32>,
}

/// Propositions are the literals, then for every inference that it is broken.
pub(super) struct Heuristic<'t> {
    task: &'t Task,
    supporters: Vec<Supporter>,
    needing: Vec<Vec<u32>>,
    /// The supporter of "this derived fact does not hold", by fact.
    denials: Vec<u32>,
    /// The first of the supporters of "this inference is broken", one for each part of its body.
    breakers: Vec<u32>,
    inferences_of: Vec<Vec<u32>>,
    /// The cost of the cheapest action that makes a literal hold.
    cheapest_action: Vec<f64>,
    unmet: Vec<u32>,
    costs: Vec<f64>,
    chosen: Vec<u32>,
    /// In this state: breakers that wait for a literal.
    watching: Vec<Vec<u32>>,
}

impl<'t> Heuristic<'t> {
    pub fn new(task: &'t Task) -> Heuristic<'t> {
        let literals = task.facts.len() * 2;
        let broken = |inference: usize| (literals + inference) as u32;
        let mut supporters = Vec::new();
        for (number, action) in (0..).zip(&task.actions) {
            let added = action.add.iter().map(|fact| Lit::new(*fact as usize, false).0);
            let deleted = action.delete.iter().map(|fact| Lit::new(*fact as usize, true).0);
            supporters.push(Supporter {
                needs: action.precondition.iter().map(|lit| lit.0).collect(),
                gives: added.chain(deleted).collect(),
                cost: action.cost,
                action: Some(number),
            });
        }
        let mut inferences_of = vec![Vec::new(); task.facts.len()];
        let mut breakers = Vec::new();
        for (number, inference) in task.inferences.iter().enumerate() {
            let head = Lit::new(inference.head as usize, false).0;
            let needs = inference.body.iter().map(|lit| lit.0).collect();
            supporters.push(Supporter { needs, gives: vec![head], cost: 0.0, action: None });
            breakers.push(supporters.len() as u32);
            for lit in &inference.body {
                let needs = vec![lit.negate().0];
                supporters.push(Supporter { needs, gives: vec![broken(number)], cost: 0.0, action: None });
            }
            inferences_of[inference.head as usize].push(number as u32);
        }
        let mut denials = vec![NOBODY; task.facts.len()];
        for (fact, inferences) in inferences_of.iter().enumerate().filter(|(_, inferences)| !inferences.is_empty()) {
            denials[fact] = supporters.len() as u32;
            let needs = inferences.iter().map(|inference| broken(*inference as usize)).collect();
            supporters.push(Supporter { needs, gives: vec![Lit::new(fact, true).0], cost: 0.0, action: None });
        }
        let propositions = literals + task.inferences.len();
        let mut needing = vec![Vec::new(); propositions];
        let mut cheapest_action = vec![f64::INFINITY; propositions];
        for (number, supporter) in (0..).zip(&supporters) {
            // Breakers are asked only where the inference holds.
            let breaker = supporter.gives.iter().all(|given| *given as usize >= literals);
            if !breaker {
                supporter.needs.iter().for_each(|need| needing[*need as usize].push(number));
            }
            if supporter.action.is_some() {
                let give = |given: &u32| {
                    cheapest_action[*given as usize] = cheapest_action[*given as usize].min(supporter.cost)
                };
                supporter.gives.iter().for_each(give);
            }
        }
        Heuristic {
            task,
            unmet: vec![0; supporters.len()],
            costs: vec![f64::INFINITY; propositions],
            chosen: vec![NOBODY; propositions],
            watching: vec![Vec::new(); literals],
            supporters,
            needing,
            denials,
            breakers,
            inferences_of,
            cheapest_action,
        }
    }

    /// Estimates a state, given with what follows from it; `None` if the goal cannot be reached from it.
    pub fn estimate(&mut self, state: &State) -> Option<Estimate> {
        self.spread(state);
        if !self.cost_of(&self.task.goal).is_finite() {
            return None;
        }
        Some(self.relaxed_plan(state))
    }

    /// The cost of every proposition.
    fn spread(&mut self, state: &State) {
        self.costs.fill(f64::INFINITY);
        self.chosen.fill(NOBODY);
        self.watching.iter_mut().for_each(Vec::clear);
        for (unmet, supporter) in self.unmet.iter_mut().zip(&self.supporters) {
            *unmet = supporter.needs.len() as u32;
        }
        let mut supported = vec![0.0; self.supporters.len()];
        let mut open = BinaryHeap::new();
        let literals = self.task.facts.len() * 2;
        let mut at_once: Vec<u32> = Vec::new();
        for fact in 0..self.task.facts.len() {
            at_once.push(Lit::new(fact, !state.contains(fact)).0);
            // Only the inferences that make it hold now stand in the way of its denial.
            if self.denials[fact] != NOBODY && state.contains(fact) {
                for inference in &self.inferences_of[fact] {
                    let body = &self.task.inferences[*inference as usize].body;
                    if body.iter().all(|lit| state.holds(*lit)) {
                        for (breaker, lit) in (self.breakers[*inference as usize]..).zip(body) {
                            self.watching[lit.negate().index()].push(breaker);
                        }
                    } else {
                        at_once.push(literals as u32 + inference);
                    }
                }
            }
        }
        at_once.iter().for_each(|proposition| self.costs[*proposition as usize] = 0.0);
        for number in 0..self.supporters.len() {
            if self.unmet[number] == 0 {
                self.support(number as u32, 0.0, &mut open);
            }
        }
        for proposition in at_once {
            self.pass_on(proposition, 0.0, &mut supported, &mut open);
        }
        while let Some(Reverse((cost, proposition))) = open.pop() {
            let cost = f64::from_bits(cost);
            if cost <= self.costs[proposition as usize] {
                self.pass_on(proposition, cost, &mut supported, &mut open);
            }
        }
    }

    /// Tells those who need a proposition what it costs.
    fn pass_on(
        &mut self,
        proposition: u32,
        cost: f64,
        supported: &mut [f64],
        open: &mut BinaryHeap<Reverse<(u64, u32)>>,
    ) {
        for at in 0..self.needing[proposition as usize].len() {
            let number = self.needing[proposition as usize][at];
            supported[number as usize] += cost;
            self.unmet[number as usize] -= 1;
            if self.unmet[number as usize] == 0 {
                self.support(number, supported[number as usize], open);
            }
        }
        if let Some(watching) = self.watching.get_mut(proposition as usize) {
            for breaker in std::mem::take(watching) {
                self.support(breaker, cost, open);
            }
        }
    }

    fn support(&mut self, number: u32, needs: f64, open: &mut BinaryHeap<Reverse<(u64, u32)>>) {
        let supporter = &self.supporters[number as usize];
        let cost = needs + supporter.cost;
        for given in &supporter.gives {
            if cost < self.costs[*given as usize] {
                self.costs[*given as usize] = cost;
                self.chosen[*given as usize] = number;
                // Costs are not negative, so their bits are in their order.
                open.push(Reverse((cost.to_bits(), *given)));
            }
        }
    }

    fn cost_of(&self, node: &Node) -> f64 {
        match node {
            Node::Literal(lit) => self.costs[lit.index()],
            Node::All(list) => list.iter().map(|node| self.cost_of(node)).sum(),
            Node::Any(list) => list.iter().map(|node| self.cost_of(node)).fold(f64::INFINITY, f64::min),
            Node::AtLeast(n, list) => self.cheapest(list).into_iter().take(*n).map(|(cost, _)| cost).sum(),
        }
    }

    /// The nodes with their costs, the cheapest first.
    fn cheapest<'n>(&self, list: &'n [Node]) -> Vec<(f64, &'n Node)> {
        let mut costs: Vec<(f64, &Node)> = list.iter().map(|node| (self.cost_of(node), node)).collect();
        costs.sort_by(|a, b| a.0.total_cmp(&b.0));
        costs
    }

    /// The literals that the goal is cheapest reached by.
    fn choose(&self, node: &Node, chosen: &mut Vec<u32>) {
        match node {
            Node::Literal(lit) => chosen.push(lit.0),
            Node::All(list) => list.iter().for_each(|node| self.choose(node, chosen)),
            Node::Any(list) => {
                if let Some((_, node)) = self.cheapest(list).first() {
                    self.choose(node, chosen);
                }
            }
            Node::AtLeast(n, list) => {
                self.cheapest(list).into_iter().take(*n).for_each(|(_, node)| self.choose(node, chosen));
            }
        }
    }

    fn relaxed_plan(&self, state: &State) -> Estimate {
        let mut goal = Vec::new();
        self.choose(&self.task.goal, &mut goal);
        let mut open = goal.clone();
        let mut seen = vec![false; self.costs.len()];
        let mut used = vec![false; self.supporters.len()];
        let mut undone = vec![false; self.task.facts.len() * 2];
        let (mut cost, mut helpful) = (0.0, Vec::new());
        while let Some(proposition) = open.pop() {
            let number = self.chosen[proposition as usize];
            if std::mem::replace(&mut seen[proposition as usize], true) || number == NOBODY {
                continue;
            }
            let supporter = &self.supporters[number as usize];
            if !std::mem::replace(&mut used[number as usize], true) {
                cost += supporter.cost;
                if let Some(action) = supporter.action {
                    supporter.gives.iter().for_each(|given| undone[Lit(*given).negate().index()] = true);
                    if self.task.actions[action as usize].precondition.iter().all(|lit| state.holds(*lit)) {
                        helpful.push(action);
                    }
                }
            }
            open.extend(&supporter.needs);
        }
        let mut standing = Vec::new();
        goal.into_iter().for_each(|lit| self.ground_of(Lit(lit), state, &mut standing));
        standing.sort_unstable();
        standing.dedup();
        let again = standing.into_iter().filter(|lit| undone[lit.index()]).map(|lit| self.cheapest_action[lit.index()]);
        cost += again.filter(|cost| cost.is_finite()).sum::<f64>();
        helpful.sort_unstable();
        Estimate { cost, helpful }
    }

    /// The literal if it holds, or what it is derived from.
    fn ground_of(&self, lit: Lit, state: &State, found: &mut Vec<Lit>) {
        if !state.holds(lit) {
            return;
        }
        if !self.task.derived[lit.fact()] {
            found.push(lit);
            return;
        }
        let inferences = self.inferences_of[lit.fact()].iter().map(|number| &self.task.inferences[*number as usize]);
        let holding = inferences.into_iter().find(|inference| inference.body.iter().all(|need| state.holds(*need)));
        // What follows round about from itself is not looked into: only what it follows from directly.
        for need in holding.filter(|_| !lit.negated()).into_iter().flat_map(|inference| &inference.body) {
            if !self.task.derived[need.fact()] {
                found.push(*need);
            }
        }
    }
}
