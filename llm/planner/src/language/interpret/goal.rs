//! Goals of clauses, for one thing, for several one after the other, and for two that change places.

use super::{Draft, Interpretation, several};
use crate::{
    language::{
        CONTAINS, COVERING, ParseError,
        role::Role,
        syntax::{Clause, Modifier, NounPhrase, PlaceKind, PlacePhrase, Pronoun, Relation},
    },
    lexicon::{FrameGoal, ModifierKind},
    task::{Destination, Goal, ObjectReference, Ordering, Quantity, ReferenceIndex, Span, Times, Variation},
};

impl Interpretation<'_> {
    /// All goals of a clause, in order.
    pub(super) fn goals(&mut self, clause: &Clause) -> Result<Vec<Goal>, ParseError> {
        match &clause.goal {
            FrameGoal::Exchange => return self.exchange(clause),
            FrameGoal::Find => {
                let vary = self.form_of(clause).and_then(|form| form.vary);
                let vary = vary.ok_or_else(|| self.unsupported(clause.span, "it does not say what is to be tried"))?;
                return Ok(vec![self.trial(clause, vary)?]);
            }
            // "Put them in, either way round, until the needle moves".
            FrameGoal::At
                if clause.modifier(ModifierKind::MayTurn).is_some()
                    && clause.modifier(ModifierKind::Until).is_some() =>
            {
                return Ok(vec![self.trial(clause, Variation::Heading)?]);
            }
            FrameGoal::Await => {
                let statement = clause.condition.as_ref();
                let statement = statement.ok_or_else(|| self.unsupported(clause.span, "it does not say for what"))?;
                let condition = self.condition(statement)?;
                return Ok(vec![Goal::Await { condition }]);
            }
            _ => {}
        }
        if let Some(goals) = self.each_others_place(clause)? {
            return Ok(goals);
        }
        if let Some(goal) = self.covered_with(clause)? {
            return Ok(vec![goal]);
        }
        let objects = self.objects(clause)?;
        let named = clause.as_named();
        if let (Some(_), [first, _, ..]) = (named, objects.as_slice())
            && let Some(members) = self.group_like(*first)
        {
            let mut body = self.body(clause, members)?;
            let order = Ordering::Named(objects);
            return Ok(vec![Goal::Each { members, order, body: std::mem::take(&mut body) }]);
        }
        if let (Some(Modifier { list, .. }), [members]) = (named, objects.as_slice())
            && !list.is_empty()
            && self.quantity_several(*members)
        {
            let members = *members;
            let noun = self.references.get(members).and_then(|group| group.noun.clone());
            let mut order = Vec::with_capacity(list.len());
            for phrase in list {
                let noun = if phrase.elided { noun.clone() } else { phrase.noun.clone() };
                order.push(self.reference(&NounPhrase { noun, ..phrase.clone() }, &Self::role_of(clause))?);
            }
            let body = self.body(clause, members)?;
            return Ok(vec![Goal::Each { members, order: Ordering::Named(order), body }]);
        }
        if let Some(modifier) = named.filter(|_| objects.len() < 2) {
            return Err(self.unsupported(modifier.span, "no order of several things was named"));
        }
        let mut goals = Vec::new();
        for object in objects {
            let body = self.body(clause, object)?;
            let side = clause.order_side();
            if self.quantity_several(object) {
                let order = side.map_or(Ordering::Any, |(_, side)| Ordering::From(side));
                goals.push(Goal::Each { members: object, order, body });
            } else if let Some((modifier, _)) = side {
                return Err(self.unsupported(modifier.span, "one thing has no order"));
            } else {
                goals.extend(body);
            }
        }
        Ok(goals)
    }

    /// The goal of a clause about one thing.
    pub(super) fn single_goal(&mut self, clause: &Clause) -> Result<Goal, ParseError> {
        match <[Goal; 1]>::try_from(self.goals(clause)?) {
            Ok([goal]) => Ok(goal),
            Err(_) => Err(self.unsupported(clause.span, "one thing is to be done to try")),
        }
    }

    fn role_of(clause: &Clause) -> Role {
        match &clause.goal {
            FrameGoal::Holding(_) => Role::Effect("holding".into()),
            FrameGoal::Performed(function) => Role::Function(function.clone()),
            FrameGoal::State(predicate, _) => Role::Effect(predicate.clone()),
            _ => Role::Effect("at".into()),
        }
    }

    /// What a clause is about.
    fn objects(&mut self, clause: &Clause) -> Result<Vec<ReferenceIndex>, ParseError> {
        let role = Self::role_of(clause);
        let Some(first) = &clause.object else {
            if let Some(carrier) = self.carrier_filled(clause) {
                return Ok(vec![carrier]);
            }
            if clause.tool.is_some()
                && let Some(covered) = self.covered_before()
            {
                return Ok(vec![covered]);
            }
            // "Pick up the fork and the knife and put in the sink".
            let taken = |draft: &Draft| matches!(draft.subtask.goal, Goal::Holding { held: true, .. });
            let together = self.acted_on_together();
            if together.len() > 1 && self.drafts.last().is_some_and(taken) {
                return Ok(together);
            }
            return match self.antecedent(clause.span, &role) {
                Err(ParseError::NoAntecedent { .. }) if matches!(role, Role::Function(_)) => {
                    Ok(vec![self.unnamed(clause.span, &role)])
                }
                found => found.map(|index| vec![index]),
            };
        };
        let mut objects = Vec::new();
        for phrase in std::iter::once(first).chain(&clause.also) {
            // "Put the fork in the mug, move both": nothing of several has been named.
            let both = phrase.elided && phrase.noun.is_none() && phrase.each && self.noun_before(&role, true).is_none();
            if phrase.pronoun == Some(Pronoun::Several) || both {
                objects.extend(self.antecedents(phrase.span, &role)?);
            } else if let Some(carrier) = self.carrier_meant(phrase, clause) {
                objects.push(carrier);
            } else {
                objects.push(self.reference(phrase, &role)?);
            }
        }
        Ok(objects)
    }

    /// "Put the fork in the mug and put it on the table": what was filled goes on with what is in it.
    fn carrier_meant(&self, phrase: &NounPhrase, clause: &Clause) -> Option<ReferenceIndex> {
        phrase.pronoun?;
        self.carrier_filled(clause)
    }

    /// What the clause before has put something into, where this one moves on what is not named.
    fn carrier_filled(&self, clause: &Clause) -> Option<ReferenceIndex> {
        let history =
            matches!(clause.place, Some(PlacePhrase { kind: PlaceKind::History(..), .. })) || clause.place.is_none();
        if history || clause.goal != FrameGoal::At {
            return None;
        }
        match &self.drafts.last()?.subtask.goal {
            Goal::At { destination: Destination::In { reference }, .. } => {
                let noun = self.references.get(*reference)?.noun.as_deref();
                Role::Effect("at".into()).fits(self.library, noun).then_some(*reference)
            }
            _ => None,
        }
    }

    /// A thing that the verb alone asks for: "press".
    fn unnamed(&mut self, span: Span, role: &Role) -> ReferenceIndex {
        let mut reference = ObjectReference {
            phrase: span.of(self.text).into(),
            span,
            subtask: 0,
            quantity: Quantity::TheOne,
            noun: None,
            function: None,
            affordance: None,
            color: None,
            size: None,
            rank: None,
            free: false,
            located: None,
            other_than: Vec::new(),
            part_of: None,
            twin_of: None,
            contains: Vec::new(),
            states: Vec::new(),
            handled: None,
        };
        super::reference::require(&mut reference, role, self.library);
        self.references.push(reference);
        self.references.len() - 1
    }

    /// What is done with one object.
    fn body(&mut self, clause: &Clause, object: ReferenceIndex) -> Result<Vec<Goal>, ParseError> {
        Ok(match &clause.goal {
            FrameGoal::Holding(held) => {
                let mut goals = vec![Goal::Holding { object, held: *held }];
                goals.extend(self.tool_state(clause)?);
                goals
            }
            FrameGoal::Performed(function) => {
                let times = self.times(clause)?;
                vec![Goal::Performed { function: function.clone(), object, times }]
            }
            FrameGoal::State(predicate, holds) => {
                let by = match &clause.tool {
                    // What is taken off is what stands there.
                    Some(_) if !holds => None,
                    Some(tool) => Some(self.reference(tool, &Role::Mentioned)?),
                    None => None,
                };
                vec![Goal::State { predicate: predicate.clone(), object, holds: *holds, by }]
            }
            _ => {
                let destination = match (&clause.place, clause.history) {
                    (Some(place), _) => self.destination(place, Some(object))?,
                    (None, Some(reference)) => Destination::History { object, reference },
                    (None, None) => self.own_destination(clause)?,
                };
                if destination.references() == [object] && !matches!(destination, Destination::History { .. }) {
                    return Err(self.unsupported(clause.span, "nothing can be put where it is itself the place"));
                }
                vec![Goal::At { object, destination }]
            }
        })
    }

    fn tool_state(&mut self, clause: &Clause) -> Result<Option<Goal>, ParseError> {
        let state = self.lexicon.frames.get(clause.frame).and_then(|frame| frame.tool_state.clone());
        let (Some(predicate), Some(tool)) = (state, &clause.tool) else { return Ok(None) };
        let object = self.reference(tool, &Role::Effect(predicate.clone()))?;
        Ok(Some(Goal::State { predicate, object, holds: true, by: None }))
    }

    /// Where a verb that says it itself has the object go.
    fn own_destination(&mut self, clause: &Clause) -> Result<Destination, ParseError> {
        let frame = self.lexicon.frames.get(clause.frame);
        if frame.is_some_and(|frame| frame.into_any) {
            let contains = Role::Affordance(crate::language::CONTAINS);
            let fits = |known: &ObjectReference| !several(known) && known.affordance.as_deref() == Some(CONTAINS);
            let named = self.references.iter().rposition(fits);
            let reference = named.unwrap_or_else(|| self.unnamed(clause.span, &contains));
            return Ok(Destination::In { reference });
        }
        let into = frame.and_then(|frame| frame.into.clone());
        let Some(noun) = into else { return Err(self.unsupported(clause.span, "it does not say where to")) };
        if self.library.with_noun(&noun).next().is_none() {
            return Err(self.unsupported(clause.span, &format!("I know no {noun} to put it in")));
        }
        let named = self.references.iter().rposition(|known| known.noun.as_deref() == Some(noun.as_str()));
        let reference = named.unwrap_or_else(|| {
            let index = self.unnamed(clause.span, &Role::Affordance(crate::language::CONTAINS));
            if let Some(reference) = self.references.get_mut(index) {
                (reference.noun, reference.quantity) = (Some(noun), Quantity::AnyOne);
            }
            index
        });
        Ok(Destination::In { reference })
    }

    fn times(&mut self, clause: &Clause) -> Result<Times, ParseError> {
        if let Some(modifier) = clause.modifier(ModifierKind::Shown)
            && let Some(thing) = &modifier.thing
        {
            // "the right one says", after "the left card says".
            let mut thing = thing.clone();
            if thing.elided && thing.noun.is_none() {
                thing.noun = self.noun_that_showed();
            }
            let thing = &thing;
            return Ok(Times::Shown(self.reference(thing, &Role::Mentioned)?));
        }
        if let Some(modifier) = clause.modifier(ModifierKind::Until)
            && let Some(statement) = &modifier.condition
        {
            return Ok(Times::Until(self.condition(statement)?));
        }
        Ok(Times::Count(clause.times.unwrap_or(1)))
    }

    /// The noun of what showed last how often something is to be done.
    fn noun_that_showed(&self) -> Option<String> {
        let shown = self.drafts.iter().rev().find_map(|draft| match &draft.subtask.goal {
            Goal::Performed { times: Times::Shown(thing), .. } => Some(*thing),
            _ => None,
        });
        self.references.get(shown?)?.noun.clone()
    }

    /// "parking each lid behind its cube" after something was done with each cube: it is done in the same turn, with
    /// the lid that is on the cube then.
    pub(super) fn belongs_together(&mut self, clause: &Clause) -> Result<bool, ParseError> {
        let (Some(object), Some(PlacePhrase { kind, .. })) = (&clause.object, &clause.place) else { return Ok(false) };
        let object = &self.cover_meant(object);
        let (PlaceKind::Beside(owner, _) | PlaceKind::At(owner, _)) = kind else { return Ok(false) };
        if !(owner.its && object.each) {
            return Ok(false);
        }
        let Some(Goal::Each { members, .. }) = self.drafts.last().map(|draft| draft.subtask.goal.clone()) else {
            return Err(self.unsupported(owner.span, "I do not know which belongs to which"));
        };
        let same = self.references.get(members).is_some_and(|group| match (&group.noun, &owner.noun) {
            (Some(a), Some(b)) => self.same_kind(a, b),
            _ => group.noun == owner.noun,
        });
        if !same {
            return Err(self.unsupported(owner.span, "it is not what the clause before is about"));
        }
        let mine = NounPhrase { quantity: Quantity::TheOne, each: false, ..object.clone() };
        let mine = self.fresh(&mine, &Role::Effect("at".into()), Vec::new())?;
        if let Some(reference) = self.references.get_mut(mine) {
            reference.located = Some(Box::new(Destination::On { reference: members }));
        }
        let destination = match kind {
            PlaceKind::Beside(_, side) => Destination::Beside { reference: members, side: *side },
            _ => Destination::On { reference: members },
        };
        if let Some(draft) = self.drafts.last_mut()
            && let Goal::Each { body, .. } = &mut draft.subtask.goal
        {
            body.push(Goal::At { object: mine, destination });
            draft.subtask.span = draft.subtask.span.join(clause.span);
            draft.subtask.text = draft.subtask.span.of(self.text).into();
        }
        Ok(true)
    }

    /// "each" said of what covers what the clause before is about.
    fn cover_meant(&self, object: &NounPhrase) -> NounPhrase {
        let mut object = object.clone();
        if object.elided
            && object.noun.is_none()
            && matches!(self.drafts.last(), Some(draft) if uncovers(&draft.subtask.goal))
        {
            object.noun = self.noun_before(&Role::Affordance(COVERING), false);
        }
        object
    }

    /// The things over which something was put last.
    fn covered_before(&self) -> Option<ReferenceIndex> {
        self.drafts.iter().rev().find_map(|draft| match &draft.subtask.goal {
            Goal::Each { members, body, .. } => match body.first() {
                Some(Goal::State { predicate, holds: true, .. }) if predicate == "covered" => Some(*members),
                _ => None,
            },
            Goal::State { predicate, object, holds: true, .. } if predicate == "covered" => Some(*object),
            _ => None,
        })
    }

    /// "Put a lid on every cube", "put the lids over the cubes": each of them is covered, with whichever.
    fn covered_with(&mut self, clause: &Clause) -> Result<Option<Goal>, ParseError> {
        let (FrameGoal::At, Some(object), Some(PlacePhrase { kind: PlaceKind::At(under, Relation::On), .. })) =
            (&clause.goal, &clause.object, &clause.place)
        else {
            return Ok(None);
        };
        let covers = |phrase: &NounPhrase| {
            phrase.noun.is_some() && Role::Affordance(COVERING).fits(self.library, phrase.noun.as_deref())
        };
        let plain =
            object.color.is_none() && object.located.is_none() && object.rank.is_none() && clause.also.is_empty();
        if !under.several() || !covers(object) || !plain {
            return Ok(None);
        }
        // Named, so that "them" and "each lid" have something to mean.
        self.reference(object, &Role::Affordance(COVERING))?;
        let members = self.reference(under, &Role::Mentioned)?;
        let order = clause.order_side().map(|(_, side)| side);
        let covered = Goal::State { predicate: "covered".into(), object: members, holds: true, by: None };
        let order = order.map_or(Ordering::Any, Ordering::From);
        Ok(Some(Goal::Each { members, order, body: vec![covered] }))
    }

    /// "Carry each cube to the mat and back": what is said of the one whose turn it is belongs to its turn.
    pub(super) fn goes_on_with_each(&mut self, clause: &Clause) -> Result<bool, ParseError> {
        let of_it = match &clause.object {
            None => matches!(clause.goal, FrameGoal::At),
            Some(object) => object.pronoun == Some(Pronoun::One) && clause.also.is_empty(),
        };
        let Some(Draft { each: true, subtask, .. }) = self.drafts.last() else { return Ok(false) };
        let Goal::Each { members, body, .. } = &subtask.goal else { return Ok(false) };
        let (members, moves) =
            (*members, body.iter().any(|goal| matches!(goal, Goal::At { .. } | Goal::Holding { .. })));
        let carried = clause.object.as_ref().and_then(|object| self.carrier_meant(object, clause));
        let fits = |known: &ObjectReference| Self::role_of(clause).fits(self.library, known.noun.as_deref());
        let same_kind = matches!(clause.goal, FrameGoal::At | FrameGoal::Holding(_) | FrameGoal::State(..));
        if !of_it || !moves || !same_kind || carried.is_some() || !self.references.get(members).is_some_and(fits) {
            return Ok(false);
        }
        let mut goals = self.body(clause, members)?;
        let side = clause.order_side().map(|(_, side)| side);
        if let Some(draft) = self.drafts.last_mut()
            && let Goal::Each { body, order, .. } = &mut draft.subtask.goal
        {
            body.append(&mut goals);
            if let (Ordering::Any, Some(side)) = (&order, side) {
                *order = Ordering::From(side);
            }
            draft.subtask.span = draft.subtask.span.join(clause.span);
            draft.subtask.text = draft.subtask.span.of(self.text).into();
        }
        for modifier in &clause.modifiers {
            self.manner_of(modifier)?;
        }
        Ok(true)
    }

    /// A group named before of which a thing is a member by its noun.
    fn group_like(&self, member: ReferenceIndex) -> Option<ReferenceIndex> {
        let noun = self.references.get(member)?.noun.clone()?;
        self.references.iter().rposition(|known| several(known) && known.noun.as_ref() == Some(&noun))
    }
}

/// Whether a goal takes covers off.
fn uncovers(goal: &Goal) -> bool {
    match goal {
        Goal::Each { body, .. } => body.iter().any(uncovers),
        Goal::State { predicate, holds: false, .. } => predicate == "covered",
        _ => false,
    }
}
