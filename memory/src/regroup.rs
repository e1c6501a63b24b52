//! Two identities that were one thing are merged; one that was two things is split. History and transitions go with
//! what they belong to, and either can be undone.

use crate::{
    draft::Draft,
    entry::{HistoryEntry, Moment, ObjectEntry, Presence, Transition},
    event::{Believed, Change, Regrouped, Regrouping, Slice, Track, Whole},
    state::State,
};
use acm_concept::{
    ids::{ObjectId, PartId},
    literal::{Literal, Term},
};

/// Takes `gone` for `kept`: what was seen last is what is believed.
pub(crate) fn merge(draft: &mut Draft<'_>, kept: ObjectId, gone: ObjectId) -> Result<u32, String> {
    if kept == gone {
        return Err(format!("{kept} is itself"));
    }
    let (own, other) = (whole(&draft.state, kept)?, whole(&draft.state, gone)?);
    let mut merged = joined(&own, &other);
    merged.entry.id = kept;
    merged.entry.ambiguous_with.retain(|(id, _)| *id != kept && *id != gone);
    merged.entry.support = merged.entry.support.filter(|id| *id != kept && *id != gone);
    let mut after = Slice { objects: vec![merged], gone: vec![gone], transitions: Vec::new() };
    let mut before = Slice { objects: vec![own, other], gone: Vec::new(), transitions: Vec::new() };
    for entry in draft.state.objects.iter().filter(|entry| entry.id != kept && entry.id != gone) {
        if entry.support == Some(gone) || entry.ambiguous_with.iter().any(|(id, _)| *id == gone) {
            let old = whole(&draft.state, entry.id)?;
            let mut new = old.clone();
            new.entry.support = new.entry.support.map(|id| if id == gone { kept } else { id });
            new.entry.ambiguous_with.retain(|(id, _)| *id != gone);
            before.objects.push(old);
            after.objects.push(new);
        }
    }
    reattribute(&draft.state, |_| true, (gone, kept), &mut before, &mut after);
    Ok(write(draft, Regrouped::Merged { kept, gone }, before, after))
}

/// Takes what was known as `from` to be another thing since a moment: a new one, which is where it is believed to be.
/// Where the old one is since then is not known.
pub(crate) fn split(draft: &mut Draft<'_>, from: ObjectId, since: Moment) -> Result<(u32, ObjectId), String> {
    let own = whole(&draft.state, from)?;
    let at = own.entry.history.partition_point(|entry| entry.moment < since);
    if at == 0 || at == own.entry.history.len() {
        return Err(format!("nothing is remembered of {from} on one side of that moment: there is nothing to split"));
    }
    let id = ObjectId(draft.state.next.object);
    let (mut old, mut new) = (own.clone(), own.clone());
    new.entry.id = id;
    new.entry.history = old.entry.history.split_off(at);
    new.entry.ambiguous_with.clear();
    old.entry.presence = Presence::Missing;
    old.entry.support = None;
    old.entry.verified = false;
    old.entry.ambiguous_with.clear();
    old.entry.last_seen = old.entry.history.last().map_or(old.entry.last_seen, |last| last.moment);
    old.track = Track::default();
    let mut before = Slice { objects: vec![own], gone: vec![id], transitions: Vec::new() };
    let mut after = Slice { objects: vec![old, new], gone: Vec::new(), transitions: Vec::new() };
    reattribute(&draft.state, |transition| transition.moment >= since, (from, id), &mut before, &mut after);
    Ok((write(draft, Regrouped::Split { from, new: id, since }, before, after), id))
}

/// Undoes a merge or a split. What was seen since stays with the identity under which it was seen; of a split it comes
/// back to the one identity.
pub(crate) fn undo(draft: &mut Draft<'_>, number: u32) -> Result<u32, String> {
    let state = &draft.state;
    let known = state.regrouped.iter().find(|known| known.number == number);
    let known = known.ok_or_else(|| format!("there is no merge or split number {number}, or it was undone"))?.clone();
    let mut back = known.before.clone();
    for old in &mut back.objects {
        let (Ok(now), Some(then)) = (whole(state, old.entry.id), find(&known.after, old.entry.id)) else { continue };
        if now != *then {
            let later = now.entry.history.get(then.entry.history.len()..).unwrap_or_default().to_vec();
            let mut history = std::mem::take(&mut old.entry.history);
            history.extend(later);
            *old = Whole { entry: ObjectEntry { history, ..now.entry }, track: now.track };
        }
    }
    if let (Regrouped::Split { new, .. }, Some(old)) = (&known.what, back.objects.first_mut())
        && let (Ok(now), Some(then)) = (whole(state, *new), find(&known.after, *new))
        && now != *then
    {
        let later = now.entry.history.get(then.entry.history.len()..).unwrap_or_default().to_vec();
        let mut history = std::mem::take(&mut old.entry.history);
        history.extend(later);
        history.sort_by_key(|entry| entry.moment);
        *old = Whole { entry: ObjectEntry { id: old.entry.id, history, ..now.entry }, track: now.track };
    }
    // A verdict that came since is kept.
    for transition in &mut back.transitions {
        let then = known.after.transitions.iter().find(|then| then.id == transition.id);
        if let (Some(now), Some(then)) = (state.transition(transition.id), then)
            && (&now.result, &now.after) != (&then.result, &then.after)
        {
            (transition.result, transition.after) = (now.result.clone(), now.after.clone());
        }
    }
    let now = Slice {
        objects: back.objects.iter().filter_map(|old| whole(state, old.entry.id).ok()).collect(),
        gone: Vec::new(),
        transitions: Vec::new(),
    };
    Ok(write(draft, Regrouped::Undone { number }, now, back))
}

fn write(draft: &mut Draft<'_>, what: Regrouped, before: Slice, after: Slice) -> u32 {
    let number = draft.state.regroupings + 1;
    draft.emit(Vec::new(), Change::Regrouped(Box::new(Regrouping { number, what, before, after })));
    number
}

fn find(slice: &Slice, id: ObjectId) -> Option<&Whole> {
    slice.objects.iter().find(|whole| whole.entry.id == id)
}

fn whole(state: &State, id: ObjectId) -> Result<Whole, String> {
    let entry = state.object(id).ok_or_else(|| format!("there is no object {id}"))?.clone();
    Ok(Whole { entry, track: state.track(id) })
}

fn joined(own: &Whole, other: &Whole) -> Whole {
    let (newer, older) = match own.entry.last_seen >= other.entry.last_seen {
        true => (own, other),
        false => (other, own),
    };
    let mut merged = newer.clone();
    merged.entry.views = own.entry.views.saturating_add(other.entry.views);
    merged.entry.confidence = 1.0 - (1.0 - own.entry.confidence) * (1.0 - other.entry.confidence);
    merged.entry.history.extend(older.entry.history.iter().cloned());
    merged.entry.history.sort_by_key(|entry| entry.moment);
    // The last entry is where it is believed to be now: it came back to where it was seen last.
    if let Some(last) = newer.entry.history.last()
        && merged.entry.history.last() != Some(last)
    {
        merged.entry.history.push(HistoryEntry { moment: newer.entry.last_seen, ..last.clone() });
    }
    merged
}

/// Transitions that speak of one object speak of another.
fn reattribute(
    state: &State,
    takes: impl Fn(&Transition) -> bool,
    (old, new): (ObjectId, ObjectId),
    before: &mut Slice,
    after: &mut Slice,
) {
    for transition in state.transitions.iter().filter(|transition| takes(transition)) {
        let renamed = rename(transition, old, new);
        if renamed != *transition {
            before.transitions.push(transition.clone());
            after.transitions.push(renamed);
        }
    }
}

fn rename(transition: &Transition, old: ObjectId, new: ObjectId) -> Transition {
    let mut renamed = transition.clone();
    let id = |id: &mut ObjectId| {
        if *id == old {
            *id = new;
        }
    };
    let literal = |literal: &mut Literal| {
        for term in &mut literal.arguments {
            match term {
                Term::Object(object) | Term::Part(PartId { object, .. }) => id(object),
                Term::Place(place) => place.support.iter_mut().for_each(id),
                Term::Number(_) | Term::Symbol(_) | Term::Variable(_) => {}
            }
        }
    };
    for literals in [&mut renamed.before, &mut renamed.predicted, &mut renamed.after] {
        literals.iter_mut().for_each(literal);
    }
    let report = &mut renamed.report;
    report.felt.iter_mut().for_each(|(felt, _)| literal(felt));
    report.held.iter_mut().for_each(|(held, _)| id(held));
    let invocation = &mut report.invocation;
    id(&mut invocation.part.object);
    invocation.held.iter_mut().for_each(|(held, ..)| id(held));
    invocation.obstacles.iter_mut().for_each(|(obstacle, _)| id(obstacle));
    invocation.destination.iter_mut().flat_map(|place| &mut place.support).for_each(id);
    renamed
}

/// The identities that a regrouping touched, as they are believed to be from now on.
impl Slice {
    pub(crate) fn apply(&self, state: &mut State) {
        for whole in &self.objects {
            state.put_object(&Believed {
                entry: ObjectEntry { history: Vec::new(), ..whole.entry.clone() },
                track: whole.track.clone(),
            });
            state.set_history(whole.entry.id, whole.entry.history.clone());
        }
        state.drop_objects(&self.gone);
        state.set_transitions(&self.transitions);
    }
}
