//! Best-first search over states: cost so far and a multiple of the estimated cost to go.

use super::{
    ground::{Action, Task},
    node::State,
    relaxed::Heuristic,
};
use std::{
    cmp::Ordering,
    collections::{BinaryHeap, HashMap, hash_map::Entry},
};

/// What a search may use, and how greedy it is.
#[derive(Clone, Copy)]
pub struct Effort<'c> {
    /// States that may be looked at.
    pub states: usize,
    /// How much the estimated cost to go counts: at 1 plans are short and searches long.
    pub greed: f64,
    /// Says that the time is over; asked once a state. The search itself has no clock.
    pub expired: &'c dyn Fn() -> bool,
}

impl Default for Effort<'_> {
    fn default() -> Self {
        Effort { states: 200_000, greed: 3.0, expired: &|| false }
    }
}

/// How a search ended.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Outcome {
    /// Actions by their numbers.
    Found(Vec<u32>),
    /// Every state that can be reached was looked at.
    Exhausted,
    /// The states or the time are used up.
    Capped,
}

struct Reached {
    state: State,
    /// The state it came from, and the action that led here.
    origin: Option<(u32, u32)>,
    cost: f64,
    helpful: Vec<u32>,
}

/// A state that waits: the least sum first, then the nearest to the goal, then the newest.
#[derive(PartialEq)]
struct Waiting {
    sum: f64,
    to_go: f64,
    number: u32,
}

impl Eq for Waiting {}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        let least = other.sum.total_cmp(&self.sum).then(other.to_go.total_cmp(&self.to_go));
        least.then(self.number.cmp(&other.number))
    }
}

/// Looks for a plan: first with actions that begin a relaxed plan alone, then, if that leads nowhere, with all.
/// Gives also how many states were looked at.
pub(super) fn search(task: &Task, effort: &Effort<'_>) -> (Outcome, usize) {
    let (outcome, looked_at) = pass(task, effort, effort.states / 4, true);
    if matches!(outcome, Outcome::Found(_)) || (effort.expired)() {
        return (outcome, looked_at);
    }
    let (outcome, more) = pass(task, effort, effort.states.saturating_sub(looked_at), false);
    (outcome, looked_at + more)
}

fn pass(task: &Task, effort: &Effort<'_>, states: usize, only_helpful: bool) -> (Outcome, usize) {
    let mut frontier = Frontier::new(task, effort.greed);
    frontier.visit(task.init.clone(), None, 0.0);
    let all: Vec<u32> = (0..task.actions.len() as u32).collect();
    while let Some(next) = frontier.open.pop() {
        let here = &frontier.reached[next.number as usize];
        let (state, cost) = (here.state.clone(), here.cost);
        let full = task.with_derived(&state);
        if task.goal.holds(&full) {
            return (Outcome::Found(way_to(next.number, &frontier.reached)), frontier.looked_at);
        }
        let actions = if only_helpful { here.helpful.clone() } else { all.clone() };
        for number in actions {
            let action = &task.actions[number as usize];
            if applicable(action, &full) {
                frontier.visit(task.after(&state, action), Some((next.number, number)), cost + action.cost);
            }
        }
        if frontier.looked_at >= states || (effort.expired)() {
            return (Outcome::Capped, frontier.looked_at);
        }
    }
    (Outcome::Exhausted, frontier.looked_at)
}

/// The states that were reached and those that wait.
struct Frontier<'t> {
    task: &'t Task,
    greed: f64,
    heuristic: Heuristic<'t>,
    /// The cost of the cheapest known way to a state.
    known: HashMap<State, f64>,
    reached: Vec<Reached>,
    open: BinaryHeap<Waiting>,
    looked_at: usize,
}

impl<'t> Frontier<'t> {
    fn new(task: &'t Task, greed: f64) -> Frontier<'t> {
        let heuristic = Heuristic::new(task);
        let (known, reached, open) = (HashMap::new(), Vec::new(), BinaryHeap::new());
        Frontier { task, greed, heuristic, known, reached, open, looked_at: 0 }
    }
    /// Looks at a state that was reached. One that is known waits again only if the way is cheaper, and one from which
    /// the goal cannot be reached never.
    fn visit(&mut self, state: State, origin: Option<(u32, u32)>, cost: f64) {
        match self.known.entry(state.clone()) {
            Entry::Occupied(best) if cost >= *best.get() => return,
            Entry::Occupied(mut best) => *best.get_mut() = cost,
            Entry::Vacant(new) => {
                new.insert(cost);
            }
        }
        self.looked_at += 1;
        let Some(estimate) = self.heuristic.estimate(&self.task.with_derived(&state)) else {
            self.known.insert(state, f64::NEG_INFINITY);
            return;
        };
        let number = self.reached.len() as u32;
        self.reached.push(Reached { state, origin, cost, helpful: estimate.helpful });
        self.open.push(Waiting { sum: cost + self.greed * estimate.cost, to_go: estimate.cost, number });
    }
}

pub(super) fn applicable(action: &Action, full: &State) -> bool {
    action.precondition.iter().all(|lit| full.holds(*lit))
}

fn way_to(number: u32, reached: &[Reached]) -> Vec<u32> {
    let mut way = Vec::new();
    let mut at = number;
    while let Some((before, action)) = reached[at as usize].origin {
        way.push(action);
        at = before;
    }
    way.reverse();
    way
}
