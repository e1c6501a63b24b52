//! Two things that change places.

use super::{Interpretation, several};
use crate::{
    language::{
        ParseError,
        role::Role,
        syntax::{Clause, NounPhrase, PlaceKind, PlacePhrase},
    },
    lexicon::FrameGoal,
    task::{Destination, Goal, Quantity, ReferenceIndex},
};

impl Interpretation<'_> {
    /// "Swap the cube and the can": each goes to where the other stood. "Swap the two cubes": one and the other.
    pub(super) fn exchange(&mut self, clause: &Clause) -> Result<Vec<Goal>, ParseError> {
        let role = Role::Effect("at".into());
        let heading = clause.modifiers.iter().any(|modifier| modifier.heading);
        let (one, other) = match (&clause.object, &clause.place) {
            (Some(object), Some(PlacePhrase { kind: PlaceKind::At(other, _), .. })) => {
                (self.reference(object, &role)?, self.reference(other, &role)?)
            }
            (None, Some(PlacePhrase { kind: PlaceKind::At(other, _), .. })) => {
                (self.antecedent(clause.span, &role)?, self.reference(other, &role)?)
            }
            (Some(object), None) => match clause.also.as_slice() {
                [] => self.two_of_a_group(object, &role)?,
                [other] => (self.reference(object, &role)?, self.reference(other, &role)?),
                _ => return Err(self.unsupported(clause.span, "two things change places, no more")),
            },
            _ => return Err(self.unsupported(clause.span, "it does not say with what")),
        };
        let group = |index: ReferenceIndex| self.references.get(index).is_some_and(several);
        if one == other || group(one) || group(other) {
            return Err(self.unsupported(clause.span, "two things that can be told apart change places, no more"));
        }
        let goal =
            |object, with, first| Goal::At { object, destination: Destination::Exchanged { with, first, heading } };
        Ok(vec![goal(one, other, true), goal(other, one, false)])
    }

    /// "Put each piece where the other one was": the two change places.
    pub(super) fn each_others_place(&mut self, clause: &Clause) -> Result<Option<Vec<Goal>>, ParseError> {
        let (FrameGoal::At, Some(object), Some(PlacePhrase { kind: PlaceKind::History(Some(owner), _), .. })) =
            (&clause.goal, &clause.object, &clause.place)
        else {
            return Ok(None);
        };
        if !(object.several() && owner.other && (owner.noun.is_none() || owner.noun == object.noun)) {
            return Ok(None);
        }
        let both = Clause { goal: FrameGoal::Exchange, place: None, ..clause.clone() };
        self.exchange(&both).map(Some)
    }

    /// Any one of a group of two, and the other.
    fn two_of_a_group(
        &mut self,
        phrase: &NounPhrase,
        role: &Role,
    ) -> Result<(ReferenceIndex, ReferenceIndex), ParseError> {
        if !phrase.several() || phrase.pronoun.is_some() {
            return Err(self.unsupported(phrase.span, "it does not say with what"));
        }
        let one = NounPhrase { quantity: Quantity::AnyOne, each: false, ..phrase.clone() };
        let one = self.reference(&one, role)?;
        let other = NounPhrase { quantity: Quantity::TheOne, each: false, other: true, ..phrase.clone() };
        let other = self.fresh(&other, role, vec![one])?;
        Ok((one, other))
    }
}
