//! From phrases to goals: references are joined, pronouns find what they stand for, clauses get their order.

use super::{
    ParseError,
    clause::{Clause, Order, Statement},
    phrase::{NounPhrase, PlaceKind, PlacePhrase},
    role::{Role, SUPPORTIVE},
};
use crate::{
    lexicon::FrameGoal,
    task::{
        Destination, Goal, ObjectReference, Quantity, ReferenceIndex, Span, Subtask, Task, Times, functions_with_effect,
    },
};
use acm_concept::template::TemplateLibrary;
use acm_memory::query::PlaceReference;

/// Joins statements to a task.
pub(super) fn interpret(library: &TemplateLibrary, text: &str, statements: &[Statement]) -> Result<Task, ParseError> {
    let mut reading = Interpretation { library, text, references: Vec::new(), subtasks: Vec::new() };
    let mut untouched = Vec::new();
    for statement in statements {
        match statement {
            Statement::Do { clause, order, background } => reading.add(clause, *order, *background)?,
            Statement::Leave { object } => untouched.push(reading.reference(object, &Role::Mentioned)?),
        }
    }
    if reading.subtasks.is_empty() {
        return Err(ParseError::Empty);
    }
    reading.drop_parts_of_moves();
    let (subtasks, mut references) = (reading.subtasks, reading.references);
    settle_subtasks(&subtasks, &mut references);
    let nouns = nouns_of(&references);
    Ok(Task { instruction: text.into(), subtasks, references, untouched, nouns, manners: Vec::new() })
}

struct Interpretation<'a> {
    library: &'a TemplateLibrary,
    text: &'a str,
    references: Vec<ObjectReference>,
    subtasks: Vec<Subtask>,
}

impl Interpretation<'_> {
    fn add(&mut self, clause: &Clause, order: Order, background: bool) -> Result<(), ParseError> {
        if clause.goal == FrameGoal::Nothing {
            return self.mention(clause);
        }
        if clause.goal == FrameGoal::Exchange {
            return self.exchange(clause, order);
        }
        let goal = self.goal(clause)?;
        let same_but_times = |known: &Goal| match (known, &goal) {
            (Goal::Performed { function: a, object: x, .. }, Goal::Performed { function: b, object: y, .. }) => {
                a == b && x == y && clause.times.is_none()
            }
            (known, goal) => known == goal,
        };
        if background && self.subtasks.iter().any(|subtask| same_but_times(&subtask.goal)) {
            return Ok(());
        }
        let at = self.place_in_order(order);
        self.subtasks.insert(at, self.subtask(clause, goal));
        Ok(())
    }

    fn subtask(&self, clause: &Clause, goal: Goal) -> Subtask {
        Subtask { text: clause.span.of(self.text).into(), span: clause.span, goal, when: None }
    }

    /// Where the next subtask belongs. The two halves of an exchange are never parted.
    fn place_in_order(&self, order: Order) -> usize {
        let second_half = |subtask: &Subtask| {
            matches!(subtask.goal, Goal::At { destination: Destination::Exchanged { first: false, .. }, .. })
        };
        let of_last = if self.subtasks.last().is_some_and(second_half) { 2 } else { 1 };
        match order {
            Order::Last => self.subtasks.len(),
            Order::BeforeLast => self.subtasks.len().saturating_sub(of_last),
        }
    }

    /// "Swap the cube and the can": each goes to where the other stood.
    fn exchange(&mut self, clause: &Clause, order: Order) -> Result<(), ParseError> {
        let Some(PlacePhrase { kind: PlaceKind::On(other), .. }) = &clause.place else {
            return Err(self.unsupported(clause.span, "it does not say with what"));
        };
        let role = Role::Effect("at".into());
        let one = match &clause.object {
            Some(phrase) => self.reference(phrase, &role)?,
            None => self.antecedent(clause.span, &role)?,
        };
        let other = self.reference(other, &role)?;
        let group = |index: ReferenceIndex| self.references.get(index).is_some_and(|r| r.quantity == Quantity::Group);
        if one == other || group(one) || group(other) {
            return Err(self.unsupported(clause.span, "two things that can be told apart change places, no more"));
        }
        let at = self.place_in_order(order);
        let goal = |object, with, first| Goal::At {
            object,
            destination: Destination::Exchanged { with, first, heading: false },
        };
        let halves = [self.subtask(clause, goal(one, other, true)), self.subtask(clause, goal(other, one, false))];
        self.subtasks.splice(at..at, halves);
        Ok(())
    }

    /// Keeps the thing of a clause without a goal for later pronouns.
    fn mention(&mut self, clause: &Clause) -> Result<(), ParseError> {
        if let Some(phrase) = &clause.object {
            self.reference(phrase, &Role::Mentioned)?;
        }
        match clause.place.as_ref().map(|place| &place.kind) {
            Some(PlaceKind::On(phrase) | PlaceKind::History(Some(phrase), _)) => {
                self.reference(phrase, &Role::Mentioned).map(|_| ())
            }
            _ => Ok(()),
        }
    }

    fn goal(&mut self, clause: &Clause) -> Result<Goal, ParseError> {
        let role = match &clause.goal {
            FrameGoal::At | FrameGoal::Exchange | FrameGoal::Nothing => Role::Effect("at".into()),
            FrameGoal::Holding(_) => Role::Effect("holding".into()),
            FrameGoal::Performed(function) => Role::Function(function.clone()),
        };
        let object = match &clause.object {
            Some(phrase) => self.reference(phrase, &role)?,
            None => self.antecedent(clause.span, &role)?,
        };
        if self.references.get(object).is_some_and(|r| r.quantity == Quantity::Group) {
            return Err(self.unsupported(clause.span, "one thing at a time: say which one, or \"one of the ...\""));
        }
        Ok(match &clause.goal {
            FrameGoal::Holding(held) => Goal::Holding { object, held: *held },
            FrameGoal::Performed(function) => {
                Goal::Performed { function: function.clone(), object, times: Times::Count(clause.times.unwrap_or(1)) }
            }
            FrameGoal::At | FrameGoal::Exchange | FrameGoal::Nothing => {
                let destination = match (&clause.place, clause.history) {
                    (Some(place), _) => self.destination(place, Some(object))?,
                    (None, Some(reference)) => Destination::History { object, reference },
                    (None, None) => return Err(self.unsupported(clause.span, "it does not say where to")),
                };
                Goal::At { object, destination }
            }
        })
    }

    /// The meaning of a place; `moved` is what goes there, whose past "where it came from" means.
    fn destination(&mut self, place: &PlacePhrase, moved: Option<ReferenceIndex>) -> Result<Destination, ParseError> {
        Ok(match &place.kind {
            PlaceKind::On(phrase) => {
                let reference = self.reference(phrase, &Role::Affordance(SUPPORTIVE))?;
                match self.references.get(reference).map(|r| r.quantity) {
                    Some(Quantity::Group) => {
                        return Err(self.unsupported(place.span, "I cannot choose among several: say which one"));
                    }
                    _ => Destination::On { reference },
                }
            }
            PlaceKind::Middle(None) => Destination::Middle { of: None },
            PlaceKind::Middle(Some(group)) => {
                Destination::Middle { of: Some(self.reference(group, &Role::Mentioned)?) }
            }
            PlaceKind::MiddleOfWhole => {
                return Err(self.unsupported(place.span, "I do not know how far it reaches; name the things around"));
            }
            PlaceKind::Between(first, second) => Destination::Between {
                first: self.reference(first, &Role::Mentioned)?,
                second: self.reference(second, &Role::Mentioned)?,
            },
            PlaceKind::Beside(phrase, side) => {
                Destination::Beside { reference: self.reference(phrase, &Role::Mentioned)?, side: *side }
            }
            PlaceKind::History(_, PlaceReference::Now) => {
                return Err(
                    self.unsupported(place.span, "the place of a thing as it is now is no place to bring things")
                );
            }
            PlaceKind::History(owner, reference) => {
                let object = match (owner, moved) {
                    (Some(phrase), _) => self.reference(phrase, &Role::Effect("at".into()))?,
                    (None, Some(moved)) => moved,
                    (None, None) => self.antecedent(place.span, &Role::Effect("at".into()))?,
                };
                Destination::History { object, reference: *reference }
            }
        })
    }

    /// The reference that a phrase means: one named before, or a new one.
    fn reference(&mut self, phrase: &NounPhrase, role: &Role) -> Result<ReferenceIndex, ParseError> {
        if phrase.pronoun {
            return self.antecedent(phrase.span, role);
        }
        if phrase.quantified {
            return Err(
                self.unsupported(phrase.span, "goals over several things are not understood; name them one by one")
            );
        }
        self.check_role(phrase, role)?;
        if let Some(known) = self.named_before(phrase, role)? {
            if let Some(reference) = self.references.get_mut(known) {
                require(reference, role, self.library);
            }
            return Ok(known);
        }
        let other_than = self.others(phrase)?;
        let located = match &phrase.located {
            Some(place) => Some(Box::new(self.destination(place, None)?)),
            None => None,
        };
        let mut reference = ObjectReference {
            phrase: phrase.span.of(self.text).into(),
            span: phrase.span,
            subtask: 0,
            quantity: phrase.quantity,
            noun: phrase.noun.clone(),
            function: None,
            affordance: None,
            color: phrase.color.clone(),
            size: phrase.size,
            rank: phrase.rank,
            free: phrase.free,
            located,
            other_than,
            part_of: None,
            twin_of: None,
            contains: Vec::new(),
            states: Vec::new(),
            handled: None,
        };
        require(&mut reference, role, self.library);
        self.references.push(reference);
        Ok(self.references.len() - 1)
    }

    /// "the cube" means the cube named last, unless it says more than that one's description did.
    fn named_before(&mut self, phrase: &NounPhrase, role: &Role) -> Result<Option<ReferenceIndex>, ParseError> {
        if phrase.quantity == Quantity::AnyOne || phrase.other {
            return Ok(None);
        }
        let located = match &phrase.located {
            Some(place) => Some(Box::new(self.destination(place, None)?)),
            None => None,
        };
        let group = |quantity: Quantity| quantity == Quantity::Group;
        let fits = |known: &ObjectReference| {
            let noun = match &phrase.noun {
                Some(noun) => known.noun.as_ref() == Some(noun),
                None => role.fits(self.library, known.noun.as_deref()),
            };
            noun && group(phrase.quantity) == group(known.quantity)
                && (phrase.color.is_none() || phrase.color == known.color)
                && (phrase.size.is_none() || phrase.size == known.size)
                && (phrase.rank.is_none() || phrase.rank == known.rank)
                && (!phrase.free || known.free)
                && (located.is_none() || located == known.located)
        };
        Ok(self.references.iter().rposition(fits))
    }

    /// What "other" excludes: everything of the kind named before.
    fn others(&self, phrase: &NounPhrase) -> Result<Vec<ReferenceIndex>, ParseError> {
        if !phrase.other {
            return Ok(Vec::new());
        }
        let same_kind = |known: &ObjectReference| match (&phrase.noun, &known.noun) {
            (Some(a), Some(b)) => {
                a == b || self.library.with_noun(a).any(|t| self.library.with_noun(b).any(|other| other.name == t.name))
            }
            _ => true,
        };
        let others: Vec<ReferenceIndex> =
            self.references.iter().enumerate().filter(|(_, r)| same_kind(r)).map(|(index, _)| index).collect();
        if others.is_empty() {
            return Err(ParseError::NoAntecedent { text: phrase.span.of(self.text).into(), span: phrase.span });
        }
        Ok(others)
    }

    /// What a pronoun stands for: the thing acted on last that can play the role.
    fn antecedent(&self, span: Span, role: &Role) -> Result<ReferenceIndex, ParseError> {
        let single = |index: ReferenceIndex| self.references.get(index).filter(|r| r.quantity != Quantity::Group);
        let fits =
            |index: &ReferenceIndex| single(*index).is_some_and(|known| role.fits(self.library, known.noun.as_deref()));
        let acted_on = self.subtasks.iter().rev().filter_map(|subtask| subtask.goal.object());
        let mentioned = (0..self.references.len()).rev();
        acted_on
            .chain(mentioned)
            .find(fits)
            .ok_or_else(|| ParseError::NoAntecedent { text: span.of(self.text).into(), span })
    }

    fn check_role(&self, phrase: &NounPhrase, role: &Role) -> Result<(), ParseError> {
        match role.misfit(self.library, phrase.noun.as_deref()) {
            None => Ok(()),
            Some(reason) => Err(self.unsupported(phrase.span, &reason)),
        }
    }

    fn unsupported(&self, span: Span, reason: &str) -> ParseError {
        ParseError::Unsupported { text: span.of(self.text).into(), span, reason: reason.into() }
    }

    /// "Take the cube and put it on the mat and let go": picking up and letting go are part of the move, not goals
    /// beside it.
    fn drop_parts_of_moves(&mut self) {
        let mut kept: Vec<Subtask> = Vec::with_capacity(self.subtasks.len());
        for mut subtask in self.subtasks.drain(..) {
            if let (Some(last), Goal::At { object, .. }) = (kept.last(), &subtask.goal)
                && last.goal == (Goal::Holding { object: *object, held: true })
            {
                subtask.span = subtask.span.join(last.span);
                subtask.text = subtask.span.of(self.text).into();
                kept.pop();
            }
            if let (Some(Goal::At { object, .. }), Goal::Holding { object: put_down, held: false }) =
                (kept.last().map(|last| &last.goal), &subtask.goal)
                && object == put_down
            {
                continue;
            }
            kept.push(subtask);
        }
        self.subtasks = kept;
    }
}

/// Tells each reference the first subtask that uses it.
pub(crate) fn settle_subtasks(subtasks: &[Subtask], references: &mut [ObjectReference]) {
    for reference in references.iter_mut() {
        reference.subtask = u32::MAX;
    }
    for (subtask, index) in subtasks.iter().zip(0..) {
        let mut used = subtask.goal.references();
        used.extend(subtask.when.iter().flat_map(|condition| &condition.arguments));
        while let Some(next) = used.pop() {
            let Some(reference) = references.get_mut(next).filter(|r| r.subtask == u32::MAX) else { continue };
            reference.subtask = index;
            used.extend(reference.references());
        }
    }
    for reference in references.iter_mut().filter(|r| r.subtask == u32::MAX) {
        reference.subtask = 0;
    }
}

/// The library's nouns that references use, each once.
pub(crate) fn nouns_of(references: &[ObjectReference]) -> Vec<String> {
    let mut nouns: Vec<String> = Vec::new();
    for noun in references.iter().filter_map(|reference| reference.noun.as_ref()) {
        if !nouns.contains(noun) {
            nouns.push(noun.clone());
        }
    }
    nouns
}

/// Writes down what the role asks of the thing, where that is more than was asked so far.
fn require(reference: &mut ObjectReference, role: &Role, library: &TemplateLibrary) {
    match role {
        Role::Effect(predicate) => {
            // Only where one function does it: otherwise any of them will do and the query must not choose.
            if let [name] = functions_with_effect(library, predicate)[..] {
                reference.function.get_or_insert_with(|| name.to_owned());
            }
        }
        Role::Function(name) => {
            reference.function.get_or_insert_with(|| name.clone());
        }
        Role::Affordance(affordance) => {
            reference.affordance.get_or_insert_with(|| (*affordance).to_owned());
        }
        Role::Mentioned => {}
    }
}
