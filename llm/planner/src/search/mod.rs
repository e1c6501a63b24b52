//! Means-ends search over the skills that memory offers.
//!
//! A goal literal that does not hold is brought about by a skill that declares it as an effect; what that skill
//! needs and is not so becomes a goal before it. Partial plans are tried in the order of their cost: expected
//! failures and length. Nothing here knows a task: the skills, their conditions and effects come from memory.

mod derived;
mod state;

use crate::explanation::{Rejected, step_words};
use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Literal, Place, Term, Truth},
};
use acm_memory::{MemoryView, query::SkillCandidate};
use state::State;

pub(crate) use derived::{brings_about, is_cover, place_over, shuts};
pub(crate) use state::same_atom;
use std::{
    cmp::Ordering,
    collections::{BTreeMap, BinaryHeap},
};

/// Partial plans that one search may look at.
const MAX_EXPANSIONS: u32 = 3000;
/// Longest plan.
const MAX_STEPS: usize = 16;
/// Most open points of a partial plan.
const MAX_AGENDA: usize = 48;
/// How often the conditions of one step are brought about again after another step undid them.
const MAX_REPAIRS: u32 = 1;
/// Rejected candidates that are kept for the explanation.
const MAX_REJECTED: usize = 12;
/// What assuming an undecided condition costs, in steps.
const ASSUMPTION_COST: f64 = 1.5;
/// What each failed try of a skill on an object costs, in steps.
const FAILURE_COST: f64 = 0.5;

/// What shall be reached.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Want {
    /// The literal holds.
    Holds(Literal),
    /// The function is performed on the object, whatever holds already.
    Perform { function: String, object: ObjectId },
    /// The object stands on some free spot, elsewhere than now.
    Away(ObjectId),
}

/// What a search has to know besides memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct Limits {
    /// Failed tries by skill and object: they make a repetition dearer.
    pub failures: BTreeMap<(String, ObjectId), u32>,
    /// Skills on objects that must not be tried again, with the reason.
    pub spent: BTreeMap<(String, ObjectId), String>,
    /// Objects that must not be acted on.
    pub untouched: Vec<ObjectId>,
    /// What the instruction names as a place for what has to be put aside.
    pub aside: Vec<ObjectId>,
}

/// A plan, and what was considered on the way.
#[derive(Debug, Clone, Default)]
pub(crate) struct Found {
    /// The steps; empty if there is no plan.
    pub steps: Vec<SkillCandidate>,
    /// Conditions of the first step that are not decided.
    pub assumed: Vec<(Literal, Belief)>,
    /// Candidates that cannot be run now or were not preferred.
    pub rejected: Vec<Rejected>,
    /// Candidates inspected.
    pub inspected: u32,
}

/// A condition of a step.
#[derive(Debug, Clone, PartialEq)]
enum Condition {
    Literal(Literal),
    /// Nothing stands where the object shall stand.
    Free {
        place: Place,
        object: ObjectId,
    },
}

#[derive(Clone)]
enum Item {
    Achieve(Condition),
    /// The object shall stand on some free spot, chosen when it is its turn.
    PutAside(ObjectId),
    Perform {
        function: String,
        object: ObjectId,
    },
    Apply {
        candidate: Box<SkillCandidate>,
        purpose: Option<Condition>,
        repairs: u32,
    },
}

/// A partial plan: what is done so far, and what is open, the next on top.
#[derive(Clone)]
struct Node<'v> {
    cost: f64,
    order: u32,
    state: State<'v>,
    agenda: Vec<Item>,
    steps: Vec<SkillCandidate>,
    assumed: Vec<Literal>,
}

/// What is believed of a literal: by memory, or concluded from what memory believes of where things stand.
pub(crate) fn believed(view: &dyn MemoryView, literal: &Literal) -> Belief {
    State::now(view).belief(literal)
}

/// What a cover is believed to stand over.
pub(crate) fn covered_by(view: &dyn MemoryView, cover: ObjectId) -> Vec<ObjectId> {
    let state = State::now(view);
    let others = view.objects().iter().filter(|entry| entry.id != cover && !is_cover(entry));
    others.map(|entry| entry.id).filter(|id| state.covering(*id).contains(&cover)).collect()
}

/// Looks for the cheapest plan that reaches all wants.
pub(crate) fn search(view: &dyn MemoryView, wants: &[Want], limits: &Limits) -> Found {
    let reserved = wants.iter().filter_map(|want| match want {
        Want::Holds(literal) if !literal.negated => match (literal.subject(), literal.arguments.get(1)) {
            (Some(object), Some(Term::Place(place))) => Some((object, *place)),
            _ => None,
        },
        _ => None,
    });
    let mut search = Search {
        view,
        limits,
        reserved: reserved.collect(),
        open: BinaryHeap::new(),
        found: Found::default(),
        order: 0,
    };
    let agenda = wants.iter().rev().map(|want| match want {
        Want::Holds(literal) => Item::Achieve(Condition::Literal(literal.clone())),
        Want::Perform { function, object } => Item::Perform { function: function.clone(), object: *object },
        Want::Away(object) => Item::PutAside(*object),
    });
    search.push(Node {
        cost: 0.0,
        order: 0,
        state: State::now(view),
        agenda: agenda.collect(),
        steps: Vec::new(),
        assumed: Vec::new(),
    });
    for _ in 0..MAX_EXPANSIONS {
        let Some(node) = search.open.pop() else { break };
        if let Some(solved) = search.expand(node) {
            let holds = |want: &Want| match want {
                Want::Holds(literal) => solved.state.belief(literal).truth == Truth::Yes,
                Want::Perform { .. } | Want::Away(_) => true,
            };
            if wants.iter().all(holds) && !solved.steps.is_empty() {
                search.found.assumed = search.undecided(&solved);
                search.found.steps = solved.steps;
                break;
            }
        }
    }
    search.found
}

struct Search<'v, 'l> {
    view: &'v dyn MemoryView,
    limits: &'l Limits,
    reserved: Vec<(ObjectId, Place)>,
    open: BinaryHeap<Node<'v>>,
    found: Found,
    order: u32,
}

impl<'v> Search<'v, '_> {
    fn push(&mut self, mut node: Node<'v>) {
        if node.agenda.len() > MAX_AGENDA || node.steps.len() > MAX_STEPS {
            return;
        }
        self.order += 1;
        node.order = self.order;
        self.open.push(node);
    }

    /// Works off the top of the agenda; gives the node back once nothing is open.
    fn expand(&mut self, mut node: Node<'v>) -> Option<Node<'v>> {
        while let Some(item) = node.agenda.pop() {
            match item {
                Item::Achieve(condition) => {
                    match self.truth(&node, &condition) {
                        Truth::Yes => continue,
                        Truth::Unknown => self.assume(&node, &condition),
                        Truth::No => {}
                    }
                    self.achieve(&node, &condition);
                    return None;
                }
                Item::PutAside(object) => {
                    let Some(spot) = self.spot_aside(&node, object) else {
                        self.reject(format!("moving {object} away"), None, "I see no free spot for it".into());
                        return None;
                    };
                    let aside = Literal::new("at", vec![Term::Object(object), Term::Place(spot)]);
                    node.agenda.push(Item::Achieve(Condition::Literal(aside)));
                }
                Item::Perform { function, object } => {
                    for candidate in self.view.skill_candidates(object, None) {
                        if candidate.skill == function {
                            self.consider(&node, candidate, None);
                        }
                    }
                    return None;
                }
                Item::Apply { candidate, purpose, repairs } => {
                    let missing = self.conditions(&node, &candidate).into_iter();
                    let missing: Vec<Condition> = missing.filter(|c| self.truth(&node, c) != Truth::Yes).collect();
                    if missing.is_empty() {
                        self.apply(&mut node, *candidate);
                        continue;
                    }
                    if repairs >= MAX_REPAIRS {
                        return None;
                    }
                    node.agenda.push(Item::Apply { candidate, purpose, repairs: repairs + 1 });
                    node.agenda.extend(missing.into_iter().rev().map(Item::Achieve));
                    self.push(node);
                    return None;
                }
            }
        }
        Some(node)
    }

    /// Places where something shall come to stand: for the goals, and for the steps that are planned already.
    fn spoken_for(&self, agenda: &[Item]) -> Vec<(ObjectId, Place)> {
        let planned = agenda.iter().filter_map(|item| match item {
            Item::Apply { candidate, .. } => Some((candidate.part.object, candidate.destination?)),
            _ => None,
        });
        self.reserved.iter().copied().chain(planned).collect()
    }

    /// Where a thing is put that has to be somewhere else: where the instruction says, if that is free, else on a free spot.
    fn spot_aside(&self, node: &Node<'v>, object: ObjectId) -> Option<Place> {
        let spoken_for = self.spoken_for(&node.agenda);
        let named = self.limits.aside.iter().find_map(|on| node.state.spot_on(*on, object, &spoken_for));
        named.or_else(|| node.state.free_spot(object, &spoken_for))
    }

    fn truth(&self, node: &Node<'v>, condition: &Condition) -> Truth {
        match condition {
            Condition::Literal(literal) if node.assumed.contains(literal) => Truth::Yes,
            Condition::Literal(literal) => node.state.belief(literal).truth,
            Condition::Free { place, object } => match node.state.in_the_way(place, *object).is_empty() {
                true => Truth::Yes,
                false => Truth::No,
            },
        }
    }

    fn assume(&mut self, node: &Node<'v>, condition: &Condition) {
        if let Condition::Literal(literal) = condition {
            let mut assuming = node.clone();
            assuming.assumed.push(literal.clone());
            assuming.cost += ASSUMPTION_COST;
            self.push(assuming);
        }
    }

    /// What must be so for a step; the place is made free while the hand still is, and what the step acts on is laid bare
    /// before that.
    fn conditions(&self, node: &Node<'v>, candidate: &SkillCandidate) -> Vec<Condition> {
        let object = candidate.part.object;
        let bare = derived::hidden_by(&node.state, object).into_iter().map(Condition::Literal);
        let free = candidate.destination.map(|place| Condition::Free { place, object });
        bare.chain(free).chain(candidate.preconditions.iter().cloned().map(Condition::Literal)).collect()
    }

    fn apply(&self, node: &mut Node<'v>, candidate: SkillCandidate) {
        let tried = (candidate.skill.clone(), candidate.part.object);
        let failures = self.limits.failures.get(&tried).copied().unwrap_or(0);
        node.cost += 1.0 - self.view.predict(&candidate).success.clamp(0.02, 1.0).ln();
        node.cost += FAILURE_COST * f64::from(failures);
        node.state = node.state.after(&candidate.effects);
        node.steps.push(candidate);
    }

    /// Opens a partial plan for every skill that would bring the condition about.
    fn achieve(&mut self, node: &Node<'v>, condition: &Condition) {
        let sought_already = node.agenda.iter().any(
            |item| matches!(item, Item::Apply { purpose: Some(purpose), .. } if same_condition(purpose, condition)),
        );
        if sought_already {
            return;
        }
        match condition {
            Condition::Free { place, object } => self.move_away(node, node.state.in_the_way(place, *object)),
            Condition::Literal(literal) if literal.predicate == "clear" && !literal.negated => {
                let carried = literal.subject().map(|under| node.state.carried_by(under)).unwrap_or_default();
                self.move_away(node, carried);
            }
            Condition::Literal(literal) if literal.predicate == "covered" && literal.negated => {
                let covering = literal.subject().map(|object| node.state.covering(object)).unwrap_or_default();
                self.move_away(node, covering);
            }
            Condition::Literal(literal) => {
                for ways in derived::ways(&node.state, literal) {
                    let mut next = node.clone();
                    next.agenda.extend(ways.into_iter().rev().map(|way| Item::Achieve(Condition::Literal(way))));
                    self.push(next);
                }
                for candidate in self.achievers(node, literal) {
                    self.consider(node, candidate, Some(condition.clone()));
                }
            }
        }
    }

    /// Everything in the list shall stand on a free spot, and before that what stands on it.
    fn move_away(&mut self, node: &Node<'v>, hindering: Vec<ObjectId>) {
        let mut aside = hindering;
        let mut at = 0;
        while let Some(&object) = aside.get(at) {
            let carried = node.state.carried_by(object);
            aside.extend(carried.into_iter().filter(|id| !aside.contains(id)).collect::<Vec<_>>());
            at += 1;
        }
        if !aside.is_empty() {
            let mut next = node.clone();
            next.agenda.extend(aside.into_iter().map(Item::PutAside));
            self.push(next);
        }
    }

    /// Skills that declare the literal as an effect.
    fn achievers(&self, node: &Node<'v>, literal: &Literal) -> Vec<SkillCandidate> {
        let destination = literal.arguments.iter().find_map(|term| match term {
            Term::Place(place) => Some(*place),
            _ => None,
        });
        // A literal about no object ("hand-empty") concerns what is held.
        let Some(object) = literal.subject().or_else(|| node.state.held()) else { return Vec::new() };
        let mut candidates = self.view.skill_candidates(object, destination);
        if destination.is_none() && node.state.held() == Some(object) {
            let spot = self.spot_aside(node, object);
            candidates = self.view.skill_candidates(object, spot);
        }
        let declares = |candidate: &SkillCandidate| {
            candidate.effects.iter().any(|effect| effect.negated == literal.negated && same_atom(effect, literal))
        };
        candidates.into_iter().filter(declares).collect()
    }

    fn consider(&mut self, node: &Node<'v>, candidate: SkillCandidate, purpose: Option<Condition>) {
        self.found.inspected += 1;
        let tried = (candidate.skill.clone(), candidate.part.object);
        if self.limits.untouched.contains(&candidate.part.object) {
            self.reject(step_words(&candidate), None, format!("{} must not be touched", candidate.part.object));
            return;
        }
        if let Some(reason) = self.limits.spent.get(&tried) {
            self.reject(step_words(&candidate), None, reason.clone());
            return;
        }
        if node.steps.is_empty() {
            self.note_what_is_missing(&candidate);
        }
        let mut next = node.clone();
        let conditions = self.conditions(node, &candidate);
        next.agenda.push(Item::Apply { candidate: Box::new(candidate), purpose, repairs: 0 });
        next.agenda.extend(conditions.into_iter().rev().map(Item::Achieve));
        self.push(next);
    }

    /// Keeps, for the explanation, why a candidate cannot be the first step.
    fn note_what_is_missing(&mut self, candidate: &SkillCandidate) {
        let failed = self.view.applicable(&candidate.preconditions).failed().next().cloned();
        if let Some((literal, belief)) = failed {
            let reason = format!("it needs {literal}: {}", belief.reason);
            self.reject(step_words(candidate), Some((literal, belief)), reason);
        } else if let Some(place) = &candidate.destination {
            let hindering = State::now(self.view).in_the_way(place, candidate.part.object);
            if let Some(first) = hindering.first() {
                self.reject(step_words(candidate), None, format!("{first} stands where it shall go"));
            }
        }
    }

    fn reject(&mut self, candidate: String, failed: Option<(Literal, Belief)>, reason: String) {
        let rejected = Rejected { candidate, failed, reason };
        if self.found.rejected.len() < MAX_REJECTED && !self.found.rejected.contains(&rejected) {
            self.found.rejected.push(rejected);
        }
    }

    /// Conditions of the first step that the plan only assumes.
    fn undecided(&self, node: &Node<'v>) -> Vec<(Literal, Belief)> {
        let first = node.steps.first().map(|step| step.preconditions.as_slice()).unwrap_or_default();
        let beliefs = first.iter().map(|literal| (literal.clone(), self.view.belief(literal)));
        beliefs.filter(|(_, belief)| belief.truth == Truth::Unknown).collect()
    }
}

fn same_condition(a: &Condition, b: &Condition) -> bool {
    match (a, b) {
        (Condition::Literal(a), Condition::Literal(b)) => a.negated == b.negated && same_atom(a, b),
        (a, b) => a == b,
    }
}

impl PartialEq for Node<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Node<'_> {}
impl PartialOrd for Node<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Node<'_> {
    /// The cheapest is the greatest, for the heap; on equal cost the oldest.
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then_with(|| other.order.cmp(&self.order))
    }
}
