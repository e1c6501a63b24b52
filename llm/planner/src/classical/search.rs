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

/// States that a way of searching looks at before it is the other's turn.
const TURN: usize = 1000;

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

/// Looks for a plan in two ways by turns: with actions that begin a relaxed plan alone, which is fast but may lead
/// nowhere, and with all. Gives also how many states were looked at.
pub(super) fn search(task: &Task, effort: &Effort<'_>) -> (Outcome, usize) {
    let mut ways = [Frontier::new(task, effort.greed, true), Frontier::new(task, effort.greed, false)];
    loop {
        for way in 0..ways.len() {
            let looked_at = |ways: &[Frontier<'_>]| ways.iter().map(|way| way.looked_at).sum::<usize>();
            let left = effort.states.saturating_sub(looked_at(&ways));
            let outcome = ways[way].go_on(left.min(TURN), effort.expired);
            let capped = outcome == Outcome::Capped && ((effort.expired)() || looked_at(&ways) >= effort.states);
            let ended = match outcome {
                Outcome::Found(_) => true,
                // That a part of the actions leads nowhere says nothing.
                Outcome::Exhausted => !ways[way].only_helpful,
                Outcome::Capped => capped,
            };
            if ended {
                return (outcome, looked_at(&ways));
            }
        }
    }
}

/// The states that were reached and those that wait.
struct Frontier<'t> {
    task: &'t Task,
    greed: f64,
    only_helpful: bool,
    heuristic: Heuristic<'t>,
    /// The cost of the cheapest known way to a state.
    known: HashMap<State, f64>,
    reached: Vec<Reached>,
    open: BinaryHeap<Waiting>,
    looked_at: usize,
}

impl<'t> Frontier<'t> {
    fn new(task: &'t Task, greed: f64, only_helpful: bool) -> Frontier<'t> {
        let heuristic = Heuristic::new(task);
        let (known, reached, open) = (HashMap::new(), Vec::new(), BinaryHeap::new());
        let mut frontier = Frontier { task, greed, only_helpful, heuristic, known, reached, open, looked_at: 0 };
        frontier.visit(task.init.clone(), None, 0.0);
        frontier
    }
    /// Goes on until so many more states were looked at.
    fn go_on(&mut self, states: usize, expired: &dyn Fn() -> bool) -> Outcome {
        let until = self.looked_at + states;
        while self.looked_at < until && !expired() {
            let Some(next) = self.open.pop() else { return Outcome::Exhausted };
            let here = &self.reached[next.number as usize];
            let (state, cost) = (here.state.clone(), here.cost);
            let full = self.task.with_derived(&state);
            if self.task.goal.holds(&full) {
                return Outcome::Found(way_to(next.number, &self.reached));
            }
            let actions = match self.only_helpful {
                true => here.helpful.clone(),
                false => (0..self.task.actions.len() as u32).collect(),
            };
            for number in actions {
                let action = &self.task.actions[number as usize];
                if applicable(action, &full) {
                    self.visit(self.task.after(&state, action), Some((next.number, number)), cost + action.cost);
                }
            }
        }
        Outcome::Capped
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
