//! What a goal asks for next: whether it is reached, and if not, what shall hold.

use super::{Grounded, MAX_LOOKS, Mind};
use crate::{
    decision::GiveUpCause,
    ground::{Stuck, missing},
    search::{Want, believed, place_over, same_atom},
    task::{Condition, Goal, Ordering, Quantity, ReferenceIndex, Subtask, Times},
};
use acm_concept::ids::ObjectId;
use acm_concept::literal::{Belief, Evidence, Literal, Term, Truth};
use acm_memory::entry::{Moment, Presence};

/// The most that is done for one number that a thing shows.
const MAX_SHOWN: f64 = 99.0;
/// The most that one thing is done until something holds.
const MAX_UNTIL: u32 = 12;

/// What a goal asks for next.
pub(super) enum Next {
    /// Nothing: it is reached, and why that is believed.
    Reached(String),
    /// Another look, and what for.
    Look(String),
    /// That something holds.
    Pursue(Box<Grounded>),
}

impl Mind<'_> {
    /// For a subtask with a condition: how it ends where the condition does not hold.
    pub(super) fn not_asked_for(&self, subtask: &Subtask) -> Result<Option<Next>, Stuck> {
        let Some(when) = &subtask.when else { return Ok(None) };
        let (literal, now) = self.condition(when)?;
        let belief = self.judged(&literal, when.judged_at.unwrap_or(self.current)).unwrap_or(now);
        self.weigh(&(literal.clone(), belief.clone()));
        match belief.truth {
            Truth::Yes => Ok(None),
            Truth::No => Ok(Some(Next::Reached(format!("not asked for: not {literal}: {}", belief.reason)))),
            Truth::Unknown => {
                let text = format!("\"{}\" depends on whether {literal}: {}", subtask.text, belief.reason);
                Err(Stuck::look(GiveUpCause::Memory, text))
            }
        }
    }

    /// What was believed of a literal before own actions since the beginning of a subtask could have changed it; `None`
    /// where none could.
    fn judged(&self, literal: &Literal, subtask: u32) -> Option<Belief> {
        let since = self.ground.began(subtask)?;
        let own = self.view.transitions().iter().filter(|t| t.moment >= since && t.subtask.is_some());
        own.into_iter().find_map(|transition| {
            let before = transition.before.iter().find(|before| same_atom(before, literal))?;
            let truth = if before.negated == literal.negated { Truth::Yes } else { Truth::No };
            let reason = format!("{before} before {}", transition.id);
            Some(Belief { truth, confidence: 0.9, evidence: vec![Evidence::Transition(transition.id)], reason })
        })
    }

    /// A condition as a ground literal with what is believed of it.
    pub(super) fn condition(&self, condition: &Condition) -> Result<(Literal, Belief), Stuck> {
        let mut arguments = Vec::with_capacity(condition.arguments.len());
        for index in &condition.arguments {
            arguments.push(Term::Object(self.ground.object(*index)?.value));
        }
        let literal = Literal::new(&condition.predicate, arguments);
        let literal = if condition.negated { literal.negate() } else { literal };
        let belief = believed(self.view, &literal);
        Ok((literal, belief))
    }

    /// What the goal of the current subtask asks for next.
    pub(super) fn next(&self, goal: &Goal) -> Result<Next, Stuck> {
        match goal {
            Goal::Each { members, order, body } => self.each(*members, order, body),
            Goal::Find { members, vary, within, probe, sign } => {
                self.find(*members, *vary, within.as_ref(), probe.as_deref(), sign.as_ref())
            }
            Goal::Await { condition } => self.wait(condition),
            Goal::At { .. } | Goal::Holding { .. } | Goal::Performed { .. } | Goal::State { .. } => {
                self.reach(goal, self.since())
            }
        }
    }

    /// A goal about one thing, of which what was done after `since` counts.
    pub(super) fn reach(&self, goal: &Goal, since: Moment) -> Result<Next, Stuck> {
        let goal = self.ground_goal(goal, since)?;
        goal.literals.iter().for_each(|literal| self.weigh(literal));
        let with = |truth| goal.literals.iter().find(move |(_, belief)| belief.truth == truth);
        let open = with(Truth::No).is_some();
        match with(Truth::Unknown) {
            Some((literal, belief)) if !open && self.situation.looks < MAX_LOOKS => {
                Ok(Next::Look(format!("I cannot tell whether {literal}: {}", belief.reason)))
            }
            None if !open => {
                let said = goal.literals.iter().map(|(literal, belief)| format!("{literal}: {}", belief.reason));
                Ok(Next::Reached(said.collect::<Vec<_>>().join("; ")))
            }
            _ => Ok(Next::Pursue(Box::new(goal))),
        }
    }

    fn ground_goal(&self, goal: &Goal, since: Moment) -> Result<Grounded, Stuck> {
        let index = goal.object().filter(|_| !matches!(goal, Goal::Each { .. } | Goal::Find { .. }));
        let index = index.ok_or_else(|| {
            Stuck::give_up(
                GiveUpCause::Plan,
                format!("\"{}\" lies within another one of its kind", self.task.describe(goal)),
            )
        })?;
        let meant = self.ground.object(index)?;
        let object = meant.value;
        if self.view.object(object).is_none_or(|entry| entry.presence == Presence::Missing) {
            return Err(missing(object, self.ground.phrase(index)));
        }
        let mut guessed = meant.guessed;
        let mut often = 1;
        let holds = |literal: Literal, wanted: bool| if wanted { literal } else { literal.negate() };
        let about = || vec![Term::Object(object)];
        let literal = match goal {
            Goal::At { destination, .. } => {
                let place = self.ground.destination(destination, object, self.current)?;
                guessed |= place.guessed;
                Literal::new("at", vec![Term::Object(object), Term::Place(place.value)])
            }
            Goal::Holding { held, .. } => holds(Literal::new("holding", about()), *held),
            Goal::State { predicate, holds: true, by: Some(by), .. } if !self.any_will_do(*by) => {
                self.brought_about_with(predicate, object, *by)?
            }
            Goal::State { predicate, holds: wanted, .. } => holds(Literal::new(predicate, about()), *wanted),
            Goal::Performed { function, times, .. } => {
                often = self.number(times, function, object, since)?;
                Literal::new(function, about())
            }
            Goal::Each { .. } | Goal::Find { .. } | Goal::Await { .. } => return Err(missing(object, "it")),
        };
        if let Goal::Performed { function, .. } = goal {
            let belief = self.performed(function, object, often, since);
            let wants = vec![Want::Perform { function: function.clone(), object }];
            return Ok(Grounded { wants, literals: vec![(literal, belief)], times: often, guessed });
        }
        let belief = believed(self.view, &literal);
        let wants = vec![Want::Holds(literal.clone())];
        Ok(Grounded { wants, literals: vec![(literal, belief)], times: often, guessed })
    }

    /// Whether it does not matter which thing of a kind is meant: then the search takes the one that costs least.
    fn any_will_do(&self, index: ReferenceIndex) -> bool {
        self.task.references.get(index).is_some_and(|reference| reference.quantity == Quantity::AnyOne)
    }

    /// A state that is brought about with a certain thing ("cover the cube with the lid"): covers are known, no tools yet.
    fn brought_about_with(&self, predicate: &str, object: ObjectId, by: ReferenceIndex) -> Result<Literal, Stuck> {
        let tool = self.ground.object(by)?.value;
        let place = (predicate == "covered").then(|| place_over(self.view, tool, object)).flatten();
        let place = place.ok_or_else(|| {
            let text = format!("I know no way to make {object} {predicate} with {} ({tool})", self.ground.phrase(by));
            Stuck::give_up(GiveUpCause::Plan, text)
        })?;
        Ok(Literal::new("at", vec![Term::Object(tool), Term::Place(place)]))
    }

    /// What had to be taken in the hand for a state of other things is put down again before the subtask counts as done.
    pub(super) fn hands_free(&self, goal: &Goal) -> Option<Grounded> {
        let changes = |goal: &Goal| matches!(goal, Goal::State { .. });
        let asks = match goal {
            Goal::Each { body, .. } => body.last().is_some_and(changes),
            goal => changes(goal),
        };
        if !asks || !self.holds_unasked() {
            return None;
        }
        let literal = Literal::new("hand-empty", Vec::new());
        let belief = believed(self.view, &literal);
        let wants = vec![Want::Holds(literal.clone())];
        Some(Grounded { wants, literals: vec![(literal, belief)], times: 1, guessed: false })
    }

    /// Whether something is in the hand that no subtask done so far has asked to hold.
    fn holds_unasked(&self) -> bool {
        let asked = |held: ObjectId| {
            let done = self.task.subtasks.iter().take(self.current as usize);
            done.into_iter().any(|subtask| match &subtask.goal {
                Goal::Holding { object, held: true } => self.ground.object(*object).is_ok_and(|of| of.value == held),
                _ => false,
            })
        };
        self.view.held().is_some_and(|entry| !asked(entry.id))
    }

    /// How often a function is asked for on an object.
    fn number(&self, times: &Times, function: &str, object: ObjectId, since: Moment) -> Result<u32, Stuck> {
        let index = match times {
            Times::Count(number) => return Ok(*number),
            Times::Shown(index) => *index,
            Times::Until(until) => {
                let (literal, belief) = self.condition(until)?;
                self.weigh(&(literal.clone(), belief.clone()));
                let done =
                    self.successes(since).filter(|t| t.skill() == function && t.object() == object).count() as u32;
                return match belief.truth {
                    Truth::Yes => Ok(done),
                    _ if done >= MAX_UNTIL => {
                        let text = format!("{function} of {object} was done {done} times and still not {literal}");
                        Err(Stuck::give_up(GiveUpCause::Plan, text))
                    }
                    Truth::No => Ok(done + 1),
                    Truth::Unknown => {
                        let text = format!("I cannot tell whether {literal}: {}", belief.reason);
                        Err(Stuck::look(GiveUpCause::Perception, text))
                    }
                };
            }
        };
        let (id, phrase) = (self.ground.object(index)?.value, self.ground.phrase(index));
        let state = self.view.object(id).map(|entry| entry.state.as_slice()).unwrap_or_default();
        let shown = state.iter().filter(|literal| literal.predicate == "shows" && !literal.negated);
        let mut number = shown.filter_map(|literal| match literal.arguments.get(1) {
            Some(Term::Number(number)) if (0.0..=MAX_SHOWN).contains(number) => Some(number.round() as u32),
            _ => None,
        });
        number.next_back().ok_or_else(|| {
            Stuck::look(GiveUpCause::Perception, format!("I cannot read the number that {phrase} ({id}) shows"))
        })
    }

    /// Nothing is done before a condition holds; looking takes time, which the instruction's budget bounds.
    fn wait(&self, condition: &Condition) -> Result<Next, Stuck> {
        let (literal, belief) = self.condition(condition)?;
        self.weigh(&(literal.clone(), belief.clone()));
        match belief.truth {
            Truth::Yes => Ok(Next::Reached(format!("{literal}: {}", belief.reason))),
            _ if self.situation.time >= self.situation.deadline => {
                let text = format!("the time is over and not {literal}: {}", belief.reason);
                Err(Stuck::give_up(GiveUpCause::Budget, text))
            }
            _ => Ok(Next::Look(format!("I wait until {literal}: {}", belief.reason))),
        }
    }

    /// The body's goals for one member after the other.
    fn each(&self, group: ReferenceIndex, order: &Ordering, body: &[Goal]) -> Result<Next, Stuck> {
        let members = self.ground.members(group, order)?;
        for (member, number) in members.iter().zip(1..) {
            match self.ground.bound(group, *member, || self.in_turn(body))? {
                Next::Reached(_) => {}
                Next::Pursue(mut goal) => {
                    self.note(format!("{member} is number {number} of {}", members.len()));
                    goal.times += (members.len() * body.len()) as u32;
                    return Ok(Next::Pursue(goal));
                }
                look @ Next::Look(_) => return Ok(look),
            }
        }
        let names: Vec<String> = members.iter().map(ToString::to_string).collect();
        Ok(Next::Reached(format!("done with each of {}: {}", names.len(), names.join(", "))))
    }

    /// The goals of one member's turn. What the turn once brought about need not last until its end, but for the last.
    fn in_turn(&self, body: &[Goal]) -> Result<Next, Stuck> {
        let mut since = self.since();
        let mut reached = Next::Reached("nothing is asked of it".into());
        for (number, goal) in body.iter().enumerate() {
            self.ground.moved_before.set(body.iter().take(number).any(Goal::moves));
            let literal = self.ground_goal(goal, since)?.literals.into_iter().next();
            let when = literal.and_then(|(literal, _)| self.brought_about(&literal, since));
            if let (Some(moment), true) = (when, number + 1 < body.len()) {
                since = moment;
                continue;
            }
            reached = self.reach(goal, since)?;
            if !matches!(reached, Next::Reached(_)) {
                return Ok(reached);
            }
        }
        Ok(reached)
    }
}
