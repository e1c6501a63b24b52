//! Things of an answer.

use super::{Grounding, MAX_COUNT};
use crate::{
    hybrid::form::{PlaceKind, QuantityForm, RankFrom, ThingForm},
    language::Role,
    task::{ColorTerm, Direction, Handled, ObjectReference, Quantity, Rank},
};

impl Grounding<'_> {
    pub(super) fn reference(&mut self, index: usize, form: ThingForm) -> Option<ObjectReference> {
        let place = format!("things/{index}");
        let span = self.span(&format!("{place}/phrase"), &form.phrase, form.occurrence);
        let noun = form.noun.as_deref();
        if let Some(noun) = noun.filter(|noun| self.library.with_noun(noun).next().is_none()) {
            self.fault(&format!("{place}/noun"), format!("there is no noun `{noun}`"));
        }
        if let Some(function) = &form.function {
            self.function(&format!("{place}/function"), noun, function);
        }
        if let Some(affordance) = &form.affordance {
            let affords = |noun: &str| self.library.with_noun(noun).any(|t| t.affordances().any(|a| a == affordance));
            let known =
                noun.map_or_else(|| self.library.iter().any(|t| t.affordances().any(|a| a == affordance)), affords);
            if !known {
                self.fault(&format!("{place}/affordance"), format!("nothing of that noun affords `{affordance}`"));
            }
        }
        let color = self.color(&place, form.color.as_deref(), form.shade.as_deref());
        let rank = self.rank(&place, form.rank, form.rank_from);
        // What describes a thing was named before it: descriptions never go in a circle.
        let earlier = |other: &usize| *other >= index;
        if let Some(other) = form.other_than.iter().find(|other| earlier(other)) {
            self.fault(&format!("{place}/other_than"), format!("{other} does not stand before it in `things`"));
        }
        let located = form.located.as_ref().map(|located| {
            let field = format!("{place}/located");
            if let Some(other) = [located.thing, located.second].into_iter().flatten().find(earlier) {
                self.fault(&field, format!("{other} does not stand before it in `things`"));
            }
            if located.kind == PlaceKind::InPlaceOf {
                self.fault(&field, "`in-place-of` says where things go, not where they stand");
            }
            self.destination(&field, located, false)
        });
        let located = match located {
            Some(destination) => Some(Box::new(destination?)),
            None => None,
        };
        let wholes = [("part_of", form.part_of), ("twin_of", form.twin_of)];
        let contained = form.contains.iter().map(|other| ("contains", Some(*other)));
        for (field, other) in wholes.into_iter().chain(contained) {
            if let Some(other) = other.filter(earlier) {
                self.fault(&format!("{place}/{field}"), format!("{other} does not stand before it in `things`"));
            }
        }
        let quantity = self.quantity(&place, form.quantity, form.count);
        let mut states = Vec::new();
        for state in &form.states {
            states.push((self.predicate(&format!("{place}/states"), &state.predicate)?, state.holds));
        }
        let handled = match &form.handled {
            Some(handled) => Some(Handled {
                effect: self.predicate(&format!("{place}/handled"), &handled.effect)?,
                rank: handled.rank,
            }),
            None => None,
        };
        Some(ObjectReference {
            phrase: form.phrase,
            span: span?,
            subtask: 0,
            quantity: quantity?,
            noun: form.noun,
            function: form.function,
            affordance: form.affordance,
            color,
            size: form.size,
            rank,
            free: form.free,
            located,
            other_than: form.other_than,
            part_of: form.part_of,
            twin_of: form.twin_of,
            contains: form.contains,
            states,
            handled,
        })
    }

    fn quantity(&mut self, place: &str, quantity: QuantityForm, count: Option<u32>) -> Option<Quantity> {
        Some(match (quantity, count) {
            (QuantityForm::TheOne, None) => Quantity::TheOne,
            (QuantityForm::AnyOne, None) => Quantity::AnyOne,
            (QuantityForm::Group, None) => Quantity::Group,
            (QuantityForm::Count, Some(count @ 1..=MAX_COUNT)) => Quantity::Count(count),
            _ => {
                let reason = format!("quantity `count` needs a count of 1 to {MAX_COUNT}, and no other has one");
                self.fault(&format!("{place}/count"), reason);
                return None;
            }
        })
    }

    pub(super) fn function(&mut self, place: &str, noun: Option<&str>, function: &str) {
        let role = Role::Function(function.to_owned());
        if let Some(reason) = role.misfit(self.library, noun) {
            self.fault(place, reason);
        } else if self.library.iter().all(|template| template.function(function).is_none()) {
            self.fault(place, format!("there is no function `{function}`"));
        }
    }

    fn color(&mut self, place: &str, name: Option<&str>, shade: Option<&str>) -> Option<ColorTerm> {
        let lightness = shade.map(|shade| self.lexicon.shade_words().find(|(word, _)| *word == shade));
        if let (Some(shade), Some(None)) = (shade, lightness) {
            self.fault(&format!("{place}/shade"), format!("there is no shade `{shade}`"));
        }
        if shade.is_some() && name.is_none() {
            self.fault(&format!("{place}/shade"), "a shade needs a colour");
        }
        let term = self.lexicon.shaded(name?, lightness.flatten().map_or(0.0, |(_, lightness)| lightness));
        if term.is_none() {
            self.fault(&format!("{place}/color"), format!("there is no colour `{}`", name.unwrap_or_default()));
        }
        term
    }

    fn rank(&mut self, place: &str, rank: Option<u32>, from: Option<RankFrom>) -> Option<Rank> {
        match (rank, from.map(RankFrom::side)) {
            (None, None) => None,
            (None, Some(None)) => Some(Rank::Middle),
            (Some(number @ 1..=MAX_COUNT), side @ (None | Some(Some(_)))) => {
                Some(Rank::FromSide(number - 1, side.flatten().unwrap_or(Direction::Left)))
            }
            (None, Some(Some(side))) => Some(Rank::FromSide(0, side)),
            (Some(number), _) => {
                self.fault(
                    &format!("{place}/rank"),
                    format!("{number} is no rank: 1 to {MAX_COUNT}, or none in the middle"),
                );
                None
            }
        }
    }
}
