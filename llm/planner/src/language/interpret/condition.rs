//! Conditions: ifs, waits, and signs that a trial is over.

use super::{Draft, Interpretation, several};
use crate::{
    language::{
        ParseError,
        role::Role,
        syntax::{Clause, Modifier, PlaceKind, Statement},
    },
    lexicon::{FrameGoal, ModifierKind},
    task::{Condition, Goal, Variation},
};

impl Interpretation<'_> {
    /// The meaning of a statement.
    pub(super) fn condition(&mut self, statement: &Statement) -> Result<Condition, ParseError> {
        let mut arguments = Vec::new();
        if let Some(about) = &statement.about {
            arguments.push(self.reference(about, &Role::Mentioned)?);
        }
        if let Some(place) = &statement.place {
            match &place.kind {
                PlaceKind::At(phrase, _) => arguments.push(self.reference(phrase, &Role::Mentioned)?),
                _ => return Err(self.unsupported(place.span, "I cannot tell whether a thing is there")),
            }
        }
        Ok(Condition { predicate: statement.predicate.clone(), arguments, negated: statement.negated, judged_at: None })
    }

    /// "... if it is open", behind the clause itself.
    pub(super) fn own_condition(&mut self, clause: &Clause) -> Result<Option<Condition>, ParseError> {
        for (kind, unless) in [(ModifierKind::If, false), (ModifierKind::Unless, true)] {
            if let Some(Modifier { condition: Some(statement), .. }) = clause.modifier(kind) {
                let condition = self.condition(statement)?;
                return Ok(Some(Condition { negated: condition.negated ^ unless, ..condition }));
            }
        }
        Ok(None)
    }

    /// "once it is hidden": nothing where a subtask before brings it about.
    pub(super) fn once(&mut self, statement: &Statement, trails: bool) -> Result<(), ParseError> {
        let condition = self.condition(statement)?;
        let brings_about = |goal: &Goal| {
            matches!(goal, Goal::State { predicate, object, holds, .. }
                if *predicate == condition.predicate && condition.arguments == [*object] && *holds != condition.negated)
        };
        if self.drafts.iter().any(|draft| brings_about(&draft.subtask.goal)) {
            return Ok(());
        }
        let subtask = self.subtask(statement.span, Goal::Await { condition });
        let at = if trails { self.drafts.len().saturating_sub(1) } else { self.drafts.len() };
        self.drafts.insert(at, Draft { subtask, guard: None, needs_sign: false, each: false });
        Ok(())
    }

    /// Whether a clause is what is done to try: it goes on until something is accepted that the trial before is for.
    pub(super) fn tries(&self, clause: &Clause) -> bool {
        let open = matches!(self.drafts.last(), Some(Draft { subtask, .. })
            if matches!(subtask.goal, Goal::Find { probe: None, sign: None, .. }));
        let of_moment =
            |modifier: &Modifier| modifier.condition.as_ref().is_some_and(|statement| statement.about.is_none());
        open && matches!(clause.goal, FrameGoal::Performed(_))
            && clause.modifier(ModifierKind::Until).is_some_and(of_moment)
    }

    /// "press after each new arrangement until it is accepted".
    pub(super) fn probe(&mut self, clause: &Clause) -> Result<(), ParseError> {
        let mut goal = self.single_goal(clause)?;
        if let Goal::Performed { times: times @ crate::task::Times::Until(_), .. } = &mut goal {
            *times = crate::task::Times::Count(1);
        }
        let until = clause.modifier(ModifierKind::Until);
        let said = match until.and_then(|until| until.condition.as_ref()) {
            Some(statement) => Some(self.condition(statement)?),
            None => None,
        };
        if let Some(Draft { subtask, .. }) = self.drafts.last_mut()
            && let Goal::Find { probe, sign, .. } = &mut subtask.goal
        {
            *probe = Some(Box::new(goal));
            if said.is_some() {
                *sign = said;
            }
            return Ok(());
        }
        Err(self.unsupported(clause.span, "it is done to try something, and nothing before it is to be tried"))
    }

    /// "until it is accepted", in a clause of its own.
    pub(super) fn sign(&mut self, modifier: &Modifier) -> Result<(), ParseError> {
        let Some(statement) = &modifier.condition else { return Ok(()) };
        let condition = self.condition(statement)?;
        if let Some(Draft { subtask, .. }) = self.drafts.last_mut()
            && let Goal::Find { sign, .. } = &mut subtask.goal
        {
            *sign = Some(condition);
        }
        Ok(())
    }

    /// A goal with what is tried: the group named last that can be moved, and what it belongs in.
    pub(super) fn trial(&mut self, clause: &Clause, vary: Variation) -> Result<Goal, ParseError> {
        let moved = Role::Effect("at".into());
        let members = match &clause.object {
            Some(phrase) if phrase.pronoun.is_some() || phrase.elided => self.reference(phrase, &moved)?,
            Some(phrase) => self.reference(phrase, &Role::Mentioned)?,
            None => {
                let fits = |reference: &crate::task::ObjectReference| {
                    several(reference) && moved.fits(self.library, reference.noun.as_deref())
                };
                self.references.iter().rposition(fits).ok_or_else(|| self.no_antecedent(clause.span))?
            }
        };
        let within = match &clause.place {
            Some(place) => Some(self.destination(place, None)?),
            None if vary == Variation::Heading => self.holder_named(members),
            None => None,
        };
        let until = clause.modifier(ModifierKind::Until).and_then(|until| until.condition.as_ref());
        let sign = match clause.condition.as_ref().or(until) {
            Some(statement) => Some(self.condition(statement)?),
            None => None,
        };
        Ok(Goal::Find { members, vary, within, probe: None, sign })
    }
}
