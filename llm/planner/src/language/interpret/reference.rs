//! References: what a phrase means among the things named before, or as a new one.

use super::{Interpretation, several};
use crate::{
    language::{
        CONTAINS, ParseError, SUPPORTIVE,
        role::Role,
        syntax::{NounPhrase, PlaceKind, PlacePhrase, Pronoun, Relation},
    },
    lexicon::FrameGoal,
    task::{Destination, Goal, Handled, ObjectReference, Quantity, ReferenceIndex, Span, functions_with_effect},
};
use acm_concept::template::TemplateLibrary;

impl Interpretation<'_> {
    /// The reference that a phrase means: one named before, or a new one.
    pub(super) fn reference(&mut self, phrase: &NounPhrase, role: &Role) -> Result<ReferenceIndex, ParseError> {
        match phrase.pronoun {
            Some(Pronoun::One) => return self.antecedent(phrase.span, role),
            Some(Pronoun::Several) => {
                let found = self.antecedents(phrase.span, role)?;
                return match found.as_slice() {
                    [one] => Ok(*one),
                    _ => Err(self.unsupported(phrase.span, "it means several things where one must be named")),
                };
            }
            None => {}
        }
        let mut phrase = phrase.clone();
        if phrase.elided && phrase.noun.is_none() && phrase.twin_of.is_none() {
            phrase.noun = self.noun_before(role, phrase.several());
        }
        // "the same thing from the table": not the one that was named at its own place, but one that looks like it.
        if phrase.same && phrase.somewhere && phrase.twin_of.is_none() {
            let model = NounPhrase { same: false, somewhere: false, ..phrase.clone() };
            let known = self.named_before(&model, role)?;
            if known.and_then(|index| self.references.get(index)).is_some_and(|known| known.located.is_some()) {
                phrase.twin_of = Some(Box::new(model));
            }
        }
        self.check_role(&phrase, role)?;
        if let Some(known) = self.named_before(&phrase, role)? {
            if let Some(reference) = self.references.get_mut(known) {
                require(reference, role, self.library);
            }
            return Ok(known);
        }
        let others = self.others(&phrase)?;
        self.fresh(&phrase, role, others)
    }

    /// A new reference.
    pub(super) fn fresh(
        &mut self,
        phrase: &NounPhrase,
        role: &Role,
        other_than: Vec<ReferenceIndex>,
    ) -> Result<ReferenceIndex, ParseError> {
        let located = self.described_place(phrase)?;
        let part_of = match &phrase.part_of {
            Some(whole) => Some(self.reference(whole, &Role::Mentioned)?),
            None => self.whole_before(phrase),
        };
        let twin_of = match &phrase.twin_of {
            Some(model) => Some(self.reference(model, &Role::Mentioned)?),
            None => None,
        };
        let holds = |affordance| Role::Affordance(affordance).fits(self.library, phrase.noun.as_deref());
        if !phrase.contains.is_empty() && !holds(CONTAINS) && !holds(SUPPORTIVE) {
            return Err(self.unsupported(phrase.span, "nothing can be in it or on it"));
        }
        let mut contains = Vec::new();
        for content in &phrase.contains {
            // What is moved takes along what is in it: nothing that stays where it is.
            if Role::Effect("at".into()).fits(self.library, phrase.noun.as_deref()) {
                self.check_role(content, &Role::Effect("at".into()))?;
            }
            contains.push(self.reference(content, &Role::Mentioned)?);
        }
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
            part_of,
            twin_of,
            contains,
            states: phrase.states.clone(),
            handled: self.handled(phrase)?,
        };
        require(&mut reference, role, self.library);
        self.references.push(reference);
        Ok(self.references.len() - 1)
    }

    fn described_place(&mut self, phrase: &NounPhrase) -> Result<Option<Box<Destination>>, ParseError> {
        Ok(match phrase.located.as_deref() {
            // What stands on one of several stands on them; as a destination that would say too little.
            Some(PlacePhrase { kind: PlaceKind::At(phrase, Relation::On | Relation::In), .. }) if phrase.several() => {
                Some(Box::new(Destination::On { reference: self.reference(phrase, &Role::Mentioned)? }))
            }
            Some(place) => Some(Box::new(self.destination(place, None)?)),
            None => None,
        })
    }

    /// What "you took first" rests on.
    fn handled(&self, phrase: &NounPhrase) -> Result<Option<Handled>, ParseError> {
        let Some((frame, rank)) = phrase.handled else { return Ok(None) };
        let effect = match self.lexicon.frames.get(frame).map(|frame| &frame.goal) {
            Some(FrameGoal::Holding(true)) => "holding",
            Some(FrameGoal::At) => "at",
            Some(FrameGoal::Performed(function)) if function == "press" => "pressed",
            Some(FrameGoal::State(predicate, true)) => predicate,
            _ => return Err(self.unsupported(phrase.span, "I keep no record of that")),
        };
        Ok(Some(Handled { effect: effect.to_owned(), rank }))
    }

    /// The whole whose part of this name was spoken of last: "the top drawer of the cabinet ... the bottom drawer".
    fn whole_before(&self, phrase: &NounPhrase) -> Option<ReferenceIndex> {
        let same = |known: &&ObjectReference| phrase.noun.is_some() && known.noun == phrase.noun;
        self.references.iter().rev().find(same).and_then(|known| known.part_of)
    }

    /// The noun of the thing named last that can play the role.
    pub(super) fn noun_before(&self, role: &Role, group: bool) -> Option<String> {
        let fits = |known: &&ObjectReference| {
            known.noun.is_some() && role.fits(self.library, known.noun.as_deref()) && (!group || several(known))
        };
        self.references.iter().rev().find(fits).and_then(|known| known.noun.clone())
    }

    /// "the cube" means the cube named last, unless it says more than that one's description did.
    fn named_before(&mut self, phrase: &NounPhrase, role: &Role) -> Result<Option<ReferenceIndex>, ParseError> {
        let new = matches!(phrase.quantity, Quantity::AnyOne | Quantity::Count(_));
        if new || phrase.other || phrase.twin_of.is_some() || phrase.handled.is_some() || !phrase.contains.is_empty() {
            return Ok(None);
        }
        let located = self.described_place(phrase)?;
        let part_of = match &phrase.part_of {
            Some(whole) => Some(self.reference(whole, &Role::Mentioned)?),
            None => None,
        };
        let group = |quantity: Quantity| matches!(quantity, Quantity::Group | Quantity::Count(_));
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
                && phrase.states.iter().all(|state| known.states.contains(state))
                && (located.is_none() || located == known.located)
                && (part_of.is_none() || part_of == known.part_of)
        };
        Ok(self.references.iter().rposition(fits))
    }

    /// What "other" excludes: everything of the kind named before.
    fn others(&self, phrase: &NounPhrase) -> Result<Vec<ReferenceIndex>, ParseError> {
        if !phrase.other {
            return Ok(Vec::new());
        }
        let same_kind = |known: &ObjectReference| match (&phrase.noun, &known.noun) {
            (Some(a), Some(b)) => self.same_kind(a, b),
            _ => true,
        };
        let single = |reference: &&ObjectReference| !several(reference) && same_kind(reference);
        let named = self.references.iter().enumerate().filter(|(_, reference)| single(reference));
        let others: Vec<ReferenceIndex> = named.map(|(index, _)| index).collect();
        if others.is_empty() { Err(self.no_antecedent(phrase.span)) } else { Ok(others) }
    }

    /// Whether two nouns may name one thing.
    pub(super) fn same_kind(&self, a: &str, b: &str) -> bool {
        a == b || self.library.with_noun(a).any(|t| self.library.with_noun(b).any(|other| other.name == t.name))
    }

    /// What a pronoun stands for: the thing acted on last that can play the role.
    pub(super) fn antecedent(&self, span: Span, role: &Role) -> Result<ReferenceIndex, ParseError> {
        let single = |index: ReferenceIndex| self.references.get(index).filter(|reference| !several(reference));
        let fits =
            |index: &ReferenceIndex| single(*index).is_some_and(|known| role.fits(self.library, known.noun.as_deref()));
        let acted_on = self.drafts.iter().rev().filter_map(|draft| draft.subtask.goal.object());
        let mentioned = (0..self.references.len()).rev();
        acted_on.chain(mentioned).find(fits).ok_or_else(|| self.no_antecedent(span))
    }

    /// What "them" stands for: the group named last, or what was acted on in a row; of things that were stacked the
    /// lowest, which takes the others with it.
    pub(super) fn antecedents(&self, span: Span, role: &Role) -> Result<Vec<ReferenceIndex>, ParseError> {
        if let Some(Goal::At { object, destination: Destination::On { reference } | Destination::In { reference } }) =
            self.drafts.last().map(|draft| &draft.subtask.goal)
            && !self.quantity_several(*object)
            && self.can_be_moved(*reference)
            && self.references.get(*reference).is_some_and(|carrier| role.fits(self.library, carrier.noun.as_deref()))
        {
            return Ok(vec![*reference]);
        }
        let together = self.acted_on_together();
        if together.len() > 1 {
            return Ok(together);
        }
        let can = |known: &ObjectReference| role.fits(self.library, known.noun.as_deref());
        let several_named = self.references.iter().rposition(|known| several(known) && can(known));
        let plural_named = || self.references.iter().rposition(|known| self.plural_of_one(known) && can(known));
        several_named.or_else(plural_named).map(|index| vec![index]).ok_or_else(|| self.no_antecedent(span))
    }

    /// What the last clause was about, in the order of the text.
    pub(super) fn acted_on_together(&self) -> Vec<ReferenceIndex> {
        let clause = self.drafts.last().map(|draft| draft.subtask.span);
        let same = self.drafts.iter().rev().take_while(|draft| Some(draft.subtask.span) == clause);
        let mut together: Vec<ReferenceIndex> = same.filter_map(|draft| draft.subtask.goal.object()).collect();
        together.reverse();
        together.dedup();
        together
    }

    fn can_be_moved(&self, index: ReferenceIndex) -> bool {
        let noun = self.references.get(index).and_then(|known| known.noun.as_deref());
        Role::Effect("at".into()).fits(self.library, noun)
    }

    /// Whether one thing was named by a plural: "the keys".
    fn plural_of_one(&self, known: &ObjectReference) -> bool {
        let Some(noun) = known.noun.as_deref() else { return false };
        let words: Vec<String> = known.phrase.split_whitespace().map(str::to_lowercase).collect();
        let means = |name: &str| name == noun || self.lexicon.meanings(name).any(|meant| meant == noun);
        (1..=2)
            .flat_map(|length| words.windows(length))
            .map(|name| name.join(" "))
            .any(|name| name.ends_with('s') && means(&name))
    }

    pub(super) fn no_antecedent(&self, span: Span) -> ParseError {
        ParseError::NoAntecedent { text: span.of(self.text).into(), span }
    }

    fn check_role(&self, phrase: &NounPhrase, role: &Role) -> Result<(), ParseError> {
        match role.misfit(self.library, phrase.noun.as_deref()) {
            None => Ok(()),
            Some(reason) => Err(self.unsupported(phrase.span, &reason)),
        }
    }
}

/// Writes down what the role asks of the thing, where that is more than was asked so far.
pub(super) fn require(reference: &mut ObjectReference, role: &Role, library: &TemplateLibrary) {
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
