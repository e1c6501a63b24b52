//! Places as destinations.

use super::{Interpretation, several};
use crate::{
    language::{
        CONTAINS, ParseError, SUPPORTIVE,
        role::Role,
        syntax::{NounPhrase, PlaceKind, PlacePhrase, Relation},
    },
    task::{Destination, ReferenceIndex},
};
use acm_memory::query::PlaceReference;

impl Interpretation<'_> {
    /// The meaning of a place; `moved` is what goes there, whose past "where it came from" means.
    pub(super) fn destination(
        &mut self,
        place: &PlacePhrase,
        moved: Option<ReferenceIndex>,
    ) -> Result<Destination, ParseError> {
        Ok(match &place.kind {
            PlaceKind::At(phrase, relation) => self.at(place, phrase, *relation)?,
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

    /// On it, in it or under it, as the preposition says and the thing is made.
    fn at(&mut self, place: &PlacePhrase, phrase: &NounPhrase, relation: Relation) -> Result<Destination, ParseError> {
        let noun = phrase.noun.as_deref();
        let can = |affordance: &'static str| Role::Affordance(affordance).fits(self.library, noun);
        let (carries, contains) = (can(SUPPORTIVE), can(CONTAINS));
        let known = noun.is_some();
        let inside = match relation {
            Relation::Under => {
                return Ok(Destination::Under { reference: self.reference(phrase, &Role::Mentioned)? });
            }
            Relation::To if !carries && !contains => {
                return Ok(Destination::Beside { reference: self.reference(phrase, &Role::Mentioned)?, side: None });
            }
            Relation::In => contains || !carries,
            Relation::On => known && !carries && contains,
            Relation::To => known && !carries,
        };
        let role = Role::Affordance(if inside { CONTAINS } else { SUPPORTIVE });
        let reference = self.reference(phrase, &role)?;
        if self.references.get(reference).is_some_and(several) {
            return Err(self.unsupported(place.span, "I cannot choose among several: say which one"));
        }
        Ok(if inside { Destination::In { reference } } else { Destination::On { reference } })
    }

    /// What the members of a group belong in, as named before: the last thing that contains.
    pub(super) fn holder_named(&self, members: ReferenceIndex) -> Option<Destination> {
        let contains = Role::Affordance(CONTAINS);
        let fits = |reference: &crate::task::ObjectReference| {
            reference.noun.is_some() && !several(reference) && contains.fits(self.library, reference.noun.as_deref())
        };
        let reference = self.references.iter().rposition(fits).filter(|index| *index != members)?;
        Some(Destination::In { reference })
    }
}
