//! Places of an answer.

use super::Grounding;
use crate::{
    hybrid::form::{Past, PlaceForm, PlaceKind, QuantityForm},
    language::{CONTAINS, Role, SUPPORTIVE},
    task::Destination,
};
use acm_memory::query::PlaceReference;

impl Grounding<'_> {
    /// A place; `first` says of an exchange which half it is.
    pub(super) fn destination(&mut self, place: &str, form: &PlaceForm, first: bool) -> Option<Destination> {
        let kind = form.kind;
        let unused = [
            ("second", form.second.is_some() && kind != PlaceKind::Between),
            ("side", form.side.is_some() && kind != PlaceKind::Beside),
            ("past", form.past.is_some() && kind != PlaceKind::Past),
            ("heading", form.heading && kind != PlaceKind::InPlaceOf),
        ];
        for (field, _) in unused.into_iter().filter(|(_, wrong)| *wrong) {
            self.fault(&format!("{place}/{field}"), "it says nothing in a place of this kind");
        }
        let field = format!("{place}/thing");
        if kind == PlaceKind::Middle {
            let Some(of) = form.thing else { return Some(Destination::Middle { of: None }) };
            let of = self.thing(&field, of, &Role::Mentioned)?;
            if self.things.get(of).is_some_and(|thing| thing.quantity != QuantityForm::Group) {
                self.fault(&field, "the middle of things is that of a group");
            }
            return Some(Destination::Middle { of: Some(of) });
        }
        let Some(thing) = form.thing else {
            self.fault(&field, "a place of this kind needs a thing");
            return None;
        };
        Some(match kind {
            PlaceKind::On => Destination::On { reference: self.thing(&field, thing, &Role::Affordance(SUPPORTIVE))? },
            PlaceKind::In => Destination::In { reference: self.thing(&field, thing, &Role::Affordance(CONTAINS))? },
            PlaceKind::Under => Destination::Under { reference: self.thing(&field, thing, &Role::Mentioned)? },
            PlaceKind::Beside => {
                Destination::Beside { reference: self.thing(&field, thing, &Role::Mentioned)?, side: form.side }
            }
            PlaceKind::Between => {
                let second = format!("{place}/second");
                let Some(other) = form.second else {
                    self.fault(&second, "between needs a second thing");
                    return None;
                };
                Destination::Between {
                    first: self.one(&field, thing, &Role::Mentioned)?,
                    second: self.one(&second, other, &Role::Mentioned)?,
                }
            }
            PlaceKind::InPlaceOf => {
                let with = self.one(&field, thing, &Role::Effect("at".into()))?;
                Destination::Exchanged { with, first, heading: form.heading }
            }
            PlaceKind::Past | PlaceKind::Middle => {
                let reference = match form.past {
                    Some(Past::AtStart) => PlaceReference::AtStart,
                    Some(Past::BeforeMoved) => PlaceReference::BeforeMoved,
                    None => {
                        self.fault(&format!("{place}/past"), "a place in the past needs to say which");
                        return None;
                    }
                };
                Destination::History { object: self.thing(&field, thing, &Role::Effect("at".into()))?, reference }
            }
        })
    }
}
