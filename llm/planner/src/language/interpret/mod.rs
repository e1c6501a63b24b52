//! From phrases to goals: references are joined, pronouns find what they stand for, clauses get their order.

mod condition;
mod exchange;
mod goal;
mod place;
mod reference;

use super::{
    ParseError,
    role::Role,
    syntax::{Clause, Guard, Modifier, NounPhrase, Order, Sentence},
};
use crate::{
    lexicon::{FrameForm, FrameGoal, Lexicon, ModifierKind},
    task::{
        Condition, Destination, Direction, Goal, Manner, MannerKind, ObjectReference, Ordering, Rank, ReferenceIndex,
        Span, Subtask, Task, Times,
    },
};
use acm_concept::template::{Template, TemplateLibrary};

/// Joins sentences to a task.
pub(super) fn interpret(
    lexicon: &Lexicon,
    library: &TemplateLibrary,
    text: &str,
    sentences: &[Sentence],
) -> Result<Task, ParseError> {
    let mut reading =
        Interpretation { lexicon, library, text, references: Vec::new(), drafts: Vec::new(), manners: Vec::new() };
    let mut untouched = Vec::new();
    for sentence in sentences {
        match sentence {
            Sentence::Do { clause, order, background, guard } => {
                reading.add(clause, *order, *background, guard.as_deref())?;
            }
            Sentence::Leave { object } => untouched.push(reading.reference(object, &Role::Mentioned)?),
            Sentence::There { things } => {
                for thing in things {
                    reading.reference(thing, &Role::Mentioned)?;
                }
            }
            Sentence::Once { condition, trails } => reading.once(condition, *trails)?,
            Sentence::Manner { modifier } => reading.manner(modifier)?,
        }
    }
    reading.check_signs()?;
    if reading.drafts.is_empty() {
        return Err(ParseError::Empty);
    }
    reading.drop_parts_of_moves();
    let Interpretation { drafts, mut references, manners, .. } = reading;
    let subtasks = judged_together(drafts);
    settle_subtasks(&subtasks, &mut references);
    let nouns = nouns_of(&references, library);
    Ok(Task { instruction: text.into(), subtasks, references, untouched, nouns, manners, corrections: Vec::new() })
}

/// A subtask with the number of the "if" on which it hangs.
struct Draft {
    subtask: Subtask,
    guard: Option<usize>,
    /// Whether something must say when what is tried is right.
    needs_sign: bool,
    /// Whether the clause speaks of each member by itself ("each cube"): "it" is the one whose turn it is.
    each: bool,
}

struct Interpretation<'a> {
    lexicon: &'a Lexicon,
    library: &'a TemplateLibrary,
    text: &'a str,
    references: Vec<ObjectReference>,
    drafts: Vec<Draft>,
    manners: Vec<Manner>,
}

impl Interpretation<'_> {
    fn add(
        &mut self,
        clause: &Clause,
        order: Order,
        background: bool,
        guard: Option<&Guard>,
    ) -> Result<(), ParseError> {
        if clause.goal == FrameGoal::Nothing {
            return self.mention(clause);
        }
        let when = match guard {
            Some(guard) => {
                let condition = self.condition(&guard.condition)?;
                Some(Condition { negated: condition.negated ^ guard.otherwise, ..condition })
            }
            None => self.own_condition(clause)?,
        };
        if clause.modifier(ModifierKind::EachTry).is_some() || self.tries(clause) {
            return self.probe(clause);
        }
        if self.belongs_together(clause)? || self.goes_on_with_each(clause)? {
            return Ok(());
        }
        let goals = self.goals(clause)?;
        self.check_repeated(clause, &goals)?;
        if let (
            [Goal::Find { members, vary, .. }],
            Some(Goal::Find { members: before, vary: known, probe: None, sign: None, .. }),
        ) = (goals.as_slice(), self.drafts.last().map(|draft| &draft.subtask.goal))
            && (members, vary) == (before, known)
        {
            // "Find the secret order of the cubes: put them into one order after another".
            self.drafts.pop();
        }
        if background
            && goals.iter().all(|goal| self.drafts.iter().any(|d| same_but_times(&d.subtask.goal, goal, clause)))
        {
            return Ok(());
        }
        let at = self.place_in_order(order);
        let guard = guard.map(|guard| guard.number);
        let needs_sign = self.form_of(clause).is_some_and(|form| form.needs_sign);
        let each = clause.object.as_ref().is_some_and(|object| object.each || object.several());
        let drafts = goals.into_iter().map(|goal| {
            let subtask = Subtask { when: when.clone(), ..self.subtask(clause.span, goal) };
            Draft { subtask, guard, needs_sign, each }
        });
        let drafts: Vec<Draft> = drafts.collect();
        self.drafts.splice(at..at, drafts);
        self.name_order();
        for modifier in &clause.modifiers {
            self.manner_of(modifier)?;
        }
        Ok(())
    }

    /// Refuses "until", "as often as" and "either way round" of what is not done again and again: nothing said is passed over.
    fn check_repeated(&self, clause: &Clause, goals: &[Goal]) -> Result<(), ParseError> {
        let repeats = [ModifierKind::Until, ModifierKind::Shown, ModifierKind::MayTurn, ModifierKind::EachTry];
        match clause.modifiers.iter().find(|modifier| repeats.contains(&modifier.kind)) {
            Some(modifier) if !goals.iter().any(repeated) => {
                Err(self.unsupported(modifier.span, "what it is said of is done once and not again and again"))
            }
            _ => Ok(()),
        }
    }

    /// The form of its frame in which a clause was read.
    fn form_of(&self, clause: &Clause) -> Option<&FrameForm> {
        self.lexicon.frames.get(clause.frame)?.forms.get(clause.form)
    }

    fn subtask(&self, span: Span, goal: Goal) -> Subtask {
        Subtask { text: span.of(self.text).into(), span, goal, when: None }
    }

    /// Where the next subtask belongs. The two halves of an exchange are never parted.
    fn place_in_order(&self, order: Order) -> usize {
        let second_half = |draft: &Draft| {
            matches!(draft.subtask.goal, Goal::At { destination: Destination::Exchanged { first: false, .. }, .. })
        };
        let of_last = if self.drafts.last().is_some_and(second_half) { 2 } else { 1 };
        match order {
            Order::Last => self.drafts.len(),
            Order::BeforeLast => self.drafts.len().saturating_sub(of_last),
        }
    }

    /// Keeps the things of a clause without a goal for later pronouns.
    fn mention(&mut self, clause: &Clause) -> Result<(), ParseError> {
        for phrase in clause.object.iter().chain(&clause.also) {
            self.reference(phrase, &Role::Mentioned)?;
        }
        Ok(())
    }

    /// A manner in a clause of its own.
    fn manner(&mut self, modifier: &Modifier) -> Result<(), ParseError> {
        let last = self.drafts.last_mut().map(|draft| &mut draft.subtask.goal);
        match (modifier.kind, last) {
            (ModifierKind::TakesPlace, Some(_)) if modifier.heading => self.take_heading(modifier.span),
            (ModifierKind::Order, Some(Goal::Each { order: order @ Ordering::Any, .. })) if modifier.side.is_some() => {
                *order = modifier.side.map_or(Ordering::Any, Ordering::From);
                Ok(())
            }
            (ModifierKind::MayTurn, Some(Goal::Find { vary: crate::task::Variation::Heading, .. })) => Ok(()),
            (ModifierKind::Until, Some(Goal::Find { sign: None, .. })) => self.sign(modifier),
            (
                ModifierKind::OneAtATime | ModifierKind::OneToAPlace | ModifierKind::Aside | ModifierKind::TakesPlace,
                _,
            ) => self.manner_of(modifier),
            _ => {
                Err(self
                    .unsupported(modifier.span, "it says how to do something, and nothing before it can be done so"))
            }
        }
    }

    /// What a modifier says of the way of doing it.
    fn manner_of(&mut self, modifier: &Modifier) -> Result<(), ParseError> {
        let kind = match modifier.kind {
            ModifierKind::OneAtATime => MannerKind::OneAtATime,
            ModifierKind::OneToAPlace => MannerKind::OneToAPlace,
            ModifierKind::Aside => match &modifier.thing {
                Some(thing) => {
                    let thing = self.third_of(thing);
                    MannerKind::Aside(self.reference(&thing, &Role::Mentioned)?)
                }
                None => return Ok(()),
            },
            ModifierKind::TakesPlace if modifier.heading => return self.take_heading(modifier.span),
            _ => return Ok(()),
        };
        self.manners.push(Manner { span: modifier.span, kind });
        Ok(())
    }

    /// Whether the last thing asked for is that two things change places.
    fn exchanged_last(&self) -> bool {
        let last = self.drafts.last().map(|draft| &draft.subtask.goal);
        matches!(last, Some(Goal::At { destination: Destination::Exchanged { .. }, .. }))
    }

    /// "By way of the third tray", after "the two trays": the one that is left, wherever it stands in the row.
    fn third_of(&self, thing: &NounPhrase) -> NounPhrase {
        let named = |known: &ObjectReference| several(known) && known.noun == thing.noun;
        match thing.rank {
            Some(Rank::FromSide(number, Direction::Left))
                if number > 1 && (self.references.iter().any(named) || self.exchanged_last()) =>
            {
                NounPhrase { rank: None, free: true, ..thing.clone() }
            }
            _ => thing.clone(),
        }
    }

    /// An exchange of headings too.
    fn take_heading(&mut self, span: Span) -> Result<(), ParseError> {
        let mut taken = false;
        for draft in self.drafts.iter_mut().rev().take(2) {
            if let Goal::At { destination: Destination::Exchanged { heading, .. }, .. } = &mut draft.subtask.goal {
                (*heading, taken) = (true, true);
            }
        }
        if taken { Ok(()) } else { Err(self.unsupported(span, "only things that change places take over a heading")) }
    }

    /// "Uncover the cubes, first the red one, then the green one": members named one after the other are the order in
    /// which the group before is taken.
    fn name_order(&mut self) {
        let mut kept: Vec<Draft> = Vec::with_capacity(self.drafts.len());
        for draft in std::mem::take(&mut self.drafts) {
            if let Some(last) = kept.last_mut()
                && last.guard == draft.guard
                && let Some(named) = self.named_member(&last.subtask.goal, &draft.subtask.goal)
                && let Goal::Each { order, .. } = &mut last.subtask.goal
            {
                match order {
                    Ordering::Named(members) => members.push(named),
                    _ => *order = Ordering::Named(vec![named]),
                }
                last.subtask.span = last.subtask.span.join(draft.subtask.span);
                last.subtask.text = last.subtask.span.of(self.text).into();
                continue;
            }
            kept.push(draft);
        }
        self.drafts = kept;
    }

    /// The member of a group that a goal singles out for what was just said of all of them.
    fn named_member(&self, group: &Goal, goal: &Goal) -> Option<ReferenceIndex> {
        let Goal::Each { members, order: Ordering::Any | Ordering::Named(_), body } = group else { return None };
        let (Some(Goal::State { predicate, holds, .. }), Goal::State { predicate: same, object, holds: also, .. }) =
            (body.first(), goal)
        else {
            return None;
        };
        let noun = |index: ReferenceIndex| self.references.get(index).and_then(|known| known.noun.as_deref());
        (predicate == same && holds == also && !self.quantity_several(*object) && noun(*members) == noun(*object))
            .then_some(*object)
    }

    /// Refuses what would be tried without end in sight.
    fn check_signs(&self) -> Result<(), ParseError> {
        let endless = |draft: &&Draft| {
            draft.needs_sign && matches!(draft.subtask.goal, Goal::Find { probe: None, sign: None, .. })
        };
        match self.drafts.iter().find(endless) {
            Some(draft) => Err(self.unsupported(draft.subtask.span, "it does not say what shows that it is right")),
            None => Ok(()),
        }
    }

    fn unsupported(&self, span: Span, reason: &str) -> ParseError {
        ParseError::Unsupported { text: span.of(self.text).into(), span, reason: reason.into() }
    }

    fn quantity_several(&self, index: ReferenceIndex) -> bool {
        self.references.get(index).is_some_and(several)
    }

    /// "Take the cube and put it on the mat and let go": picking up and letting go are part of the move, not goals
    /// beside it.
    fn drop_parts_of_moves(&mut self) {
        let mut kept: Vec<Draft> = Vec::with_capacity(self.drafts.len());
        for mut draft in std::mem::take(&mut self.drafts) {
            if let Some(last) = kept.last()
                && let Goal::Each { order: order @ Ordering::From(_), .. } = &last.subtask.goal
                && begins(&last.subtask.goal, &draft.subtask.goal)
                && let Goal::Each { order: own @ Ordering::Any, .. } = &mut draft.subtask.goal
            {
                *own = order.clone();
            }
            if let (
                Some(Goal::Each { body, .. }),
                Goal::Find { vary: crate::task::Variation::Heading, within: within @ None, .. },
            ) = (kept.last().map(|last| &last.subtask.goal), &mut draft.subtask.goal)
                && let [Goal::At { destination, .. }] = body.as_slice()
            {
                *within = Some(destination.clone());
            }
            if let Some(last) = kept.last()
                && begins(&last.subtask.goal, &draft.subtask.goal)
                && last.guard == draft.guard
            {
                draft.subtask.span = draft.subtask.span.join(last.subtask.span);
                draft.subtask.text = draft.subtask.span.of(self.text).into();
                kept.pop();
            }
            if let (Some(Goal::At { object, .. }), Goal::Holding { object: put_down, held: false }) =
                (kept.last().map(|last| &last.subtask.goal), &draft.subtask.goal)
                && object == put_down
            {
                continue;
            }
            kept.push(draft);
        }
        let part = |at: usize| moved_next(kept.get(at..).unwrap_or_default());
        let parts: Vec<bool> = (0..kept.len()).map(part).collect();
        self.drafts = kept.into_iter().zip(parts).filter(|(_, part)| !part).map(|(draft, _)| draft).collect();
    }
}

/// "Pick up the fork and the knife and put them in the sink": whether the first of these takes what is moved after all
/// that is taken.
fn moved_next(drafts: &[Draft]) -> bool {
    let Some((Draft { subtask: Subtask { goal: Goal::Holding { object: taken, held: true }, .. }, guard, .. }, next)) =
        drafts.split_first()
    else {
        return false;
    };
    let takes = |draft: &&Draft| matches!(draft.subtask.goal, Goal::Holding { held: true, .. });
    let moves = |draft: &&Draft| draft.guard == *guard && matches!(draft.subtask.goal, Goal::At { .. });
    next.iter().skip_while(takes).take_while(moves).any(|draft| draft.subtask.goal.object() == Some(*taken))
}

/// Whether a goal is one that is tried, or done a number of times.
fn repeated(goal: &Goal) -> bool {
    match goal {
        Goal::Performed { .. } | Goal::Find { .. } => true,
        Goal::Each { body, .. } => body.iter().any(repeated),
        _ => false,
    }
}

/// Whether a goal is only the beginning of the next: taking what is then moved.
fn begins(goal: &Goal, next: &Goal) -> bool {
    match (goal, next) {
        (Goal::Holding { object: taken, held: true }, Goal::At { object, .. }) => taken == object,
        (Goal::Holding { object: taken, held: true }, Goal::Holding { object, held: true }) => taken == object,
        (Goal::Each { members: taken, body: first, .. }, Goal::Each { members, body: then, .. }) => {
            taken == members && matches!((first.as_slice(), then.first()), ([only], Some(next)) if begins(only, next))
        }
        // What is put somewhere is where it is then tried which way round it belongs.
        (
            Goal::Each { members: put, body, .. },
            Goal::Find { members, vary: crate::task::Variation::Heading, within, .. },
        ) => {
            let [Goal::At { destination, .. }] = body.as_slice() else { return false };
            put == members && within.as_ref().is_none_or(|within| within == destination)
        }
        _ => false,
    }
}

/// Whether a goal is another one, whose number of times a clause may have left unsaid.
fn same_but_times(known: &Goal, goal: &Goal, clause: &Clause) -> bool {
    match (known, goal) {
        (Goal::Performed { function: a, object: x, .. }, Goal::Performed { function: b, object: y, times }) => {
            a == b && x == y && clause.times.is_none() && matches!(times, Times::Count(_))
        }
        (known, goal) => known == goal,
    }
}

/// What hangs on one "if" is judged when the first of it is due.
fn judged_together(drafts: Vec<Draft>) -> Vec<Subtask> {
    let guards: Vec<Option<usize>> = drafts.iter().map(|draft| draft.guard).collect();
    let mut subtasks = Vec::with_capacity(drafts.len());
    for (index, draft) in drafts.into_iter().enumerate() {
        let mut subtask = draft.subtask;
        let head = draft.guard.and_then(|guard| guards.iter().position(|known| *known == Some(guard)));
        if let (Some(condition), Some(head)) = (&mut subtask.when, head.filter(|head| *head != index)) {
            condition.judged_at = Some(head as u32);
        }
        subtasks.push(subtask);
    }
    subtasks
}

fn several(reference: &ObjectReference) -> bool {
    use crate::task::Quantity::{Count, Group};
    matches!(reference.quantity, Group | Count(_))
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

/// A function that more than this share of the templates offers says little of what a thing is.
const COMMON: f64 = 0.25;

/// The library's nouns that references use, each once: of a thing that is only said to be good for something ("press"),
/// those of the templates that offer it.
pub(crate) fn nouns_of(references: &[ObjectReference], library: &TemplateLibrary) -> Vec<String> {
    let mut nouns: Vec<String> = Vec::new();
    let mut add = |noun: &String| {
        if !nouns.contains(noun) {
            nouns.push(noun.clone());
        }
    };
    for reference in references {
        if let Some(noun) = &reference.noun {
            add(noun);
        } else if let Some(function) = &reference.function {
            let offers = |template: &&Template| template.functions.iter().any(|offered| &offered.name == function);
            let offering: Vec<&Template> = library.iter().filter(offers).collect();
            if (offering.len() as f64) < COMMON * library.iter().count() as f64 {
                offering.iter().flat_map(|template| &template.synopsis.nouns).for_each(|noun| add(&noun.noun));
            }
        }
    }
    nouns
}
