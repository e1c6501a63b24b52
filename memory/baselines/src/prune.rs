//! Drops from what is believed what a method does not keep.

use crate::{
    keeping::{Deeds, Keeping},
    sights::Sight,
    words,
};
use acm_concept::{
    ids::{FrameId, ObjectId, TransitionId},
    template::TemplateLibrary,
    time::Time,
};
use acm_memory::{
    entry::{HistoryEntry, Moment, PlaceCause, Presence, Transition},
    event::{Believed, Change, Event, Rest, Source},
};
use std::collections::BTreeSet;

/// An object with its history.
#[derive(Debug, Clone)]
pub(crate) struct Remembered {
    /// What is believed of it now.
    pub believed: Believed,
    /// Where it was, oldest first.
    pub history: Vec<HistoryEntry>,
}

/// What is believed, taken apart. Skills are left out: what was learned over many deeds is a past too.
#[derive(Debug, Clone)]
pub(crate) struct Content {
    /// Objects in the order of their ids.
    pub objects: Vec<Remembered>,
    /// Own deeds, oldest first.
    pub transitions: Vec<Transition>,
    /// The rest; `None` of an empty digest.
    pub rest: Option<Box<Rest>>,
}

impl Content {
    /// Takes a digest apart.
    pub fn of(digest: Vec<Event>) -> Content {
        let mut content = Content { objects: Vec::new(), transitions: Vec::new(), rest: None };
        for event in digest {
            match event.change {
                Change::Object(believed) => {
                    content.objects.push(Remembered { believed: *believed, history: Vec::new() });
                }
                Change::History { entry, .. } => {
                    if let Some(object) = content.objects.last_mut() {
                        object.history.push(entry);
                    }
                }
                Change::Transition(transition) => content.transitions.push(*transition),
                Change::Compacted(rest) => content.rest = Some(rest),
                _ => {}
            }
        }
        content
    }
    /// Puts it together again.
    pub fn into_events(self) -> Vec<Event> {
        let moment = self.rest_moment();
        let mut changes = Vec::new();
        for Remembered { believed, history } in self.objects {
            let id = believed.entry.id;
            changes.push(Change::Object(Box::new(believed)));
            changes.extend(history.into_iter().map(|entry| Change::History { object: id, entry }));
        }
        changes.extend(self.transitions.into_iter().map(|transition| Change::Transition(Box::new(transition))));
        changes.extend(self.rest.map(Change::Compacted));
        let event = |change| Event { moment, source: Source::Agent, evidence: Vec::new(), change };
        changes.into_iter().map(event).collect()
    }
    /// The present moment.
    pub fn rest_moment(&self) -> Moment {
        self.rest.as_ref().map_or_else(Moment::default, |rest| Moment { episode: rest.next.episode, time: rest.now })
    }
    /// What a frame has shown to be no longer in its place.
    pub fn missing_now(&self, frame: FrameId) -> BTreeSet<ObjectId> {
        let gone =
            |object: &&Remembered| object.history.last().is_some_and(|last| last.cause == PlaceCause::Gone(frame));
        self.objects.iter().filter(gone).map(|object| object.believed.entry.id).collect()
    }
}

/// How far a memory reaches.
pub(crate) struct Reach<'a> {
    /// The method.
    pub keeping: &'a Keeping,
    /// The frames that it goes by, oldest first.
    pub kept: &'a [&'a Sight],
    /// From when on deeds belong to its window.
    pub window: Option<Moment>,
    /// What the last frame showed, and what is in the hand.
    pub present: &'a [ObjectId],
    /// Whether the last thing that happened was a frame: only that tells what is out of sight; what a deed left somewhere is
    /// still before its eyes.
    pub looked: bool,
}

/// What is left as events.
pub(crate) fn prune(mut content: Content, reach: &Reach<'_>, library: &TemplateLibrary) -> Vec<Event> {
    let current = content.rest.as_ref().map_or(0, |rest| rest.progress.current());
    content.transitions = deeds_left(content.transitions, reach, current);
    let deeds: BTreeSet<TransitionId> = content.transitions.iter().map(|transition| transition.id).collect();
    let transitions = &content.transitions;
    content.objects =
        content.objects.into_iter().filter_map(|object| object_left(object, reach, &deeds, transitions)).collect();
    let from_start = reach.kept.iter().any(|sight| sight.number == 0) || reach.keeping.deeds == Deeds::All;
    if let Some(rest) = &mut content.rest {
        rest.from_start &= from_start;
        (rest.regrouped, rest.regroupings) = (Vec::new(), 0);
    }
    if reach.keeping.in_words {
        words::put(&mut content, |id| !reach.looked || reach.present.contains(&id), library);
    }
    content.into_events()
}

/// The deeds that are left.
fn deeds_left(deeds: Vec<Transition>, reach: &Reach<'_>, current: u32) -> Vec<Transition> {
    let last = deeds.last().map(|deed| deed.id);
    let mut seen: BTreeSet<(String, ObjectId)> = BTreeSet::new();
    let mut left: Vec<Transition> = Vec::new();
    for mut deed in deeds.into_iter().rev() {
        let newest = seen.insert((deed.skill().to_owned(), deed.object()));
        let kept = match reach.keeping.deeds {
            _ if Some(deed.id) == last => true,
            Deeds::Last => false,
            Deeds::Progress => newest && deed.subtask == Some(current),
            Deeds::Window => reach.window.is_some_and(|began| deed.moment >= began),
            Deeds::All => true,
        };
        if kept && Some(deed.id) != last && !reach.keeping.deeds.tell_places() {
            (deed.report.left_at, deed.report.invocation.destination) = (None, None);
        }
        left.extend(kept.then_some(deed));
    }
    left.reverse();
    left
}

/// What is left of an object.
fn object_left(
    object: Remembered,
    reach: &Reach<'_>,
    deeds: &BTreeSet<TransitionId>,
    transitions: &[Transition],
) -> Option<Remembered> {
    let Remembered { mut believed, history } = object;
    let id = believed.entry.id;
    if reach.keeping.last_places {
        return Some(Remembered { believed, history: history_left(id, history, reach, deeds, transitions) });
    }
    let told_by = reach.kept.iter().rev().find(|sight| sight.tells_of(id));
    let left_there = |cause: &PlaceCause| matches!(cause, PlaceCause::Own(deed) if deeds.contains(deed));
    let handled = reach.keeping.deeds.tell_places() && history.last().is_some_and(|last| left_there(&last.cause));
    let mut history = history_left(id, history, reach, deeds, transitions);
    if reach.looked && !reach.present.contains(&id) && !handled {
        let sight = told_by?;
        // That it is no longer there can be seen again at any time.
        if believed.entry.presence != Presence::Missing {
            believed = sight.shown.get(&id)?.clone();
            history.retain(|entry| entry.moment <= sight.moment);
        }
    }
    Some(Remembered { believed, history })
}

/// The entries of a history for which a kept frame or deed stands; the last one is what is believed now.
fn history_left(
    id: ObjectId,
    history: Vec<HistoryEntry>,
    reach: &Reach<'_>,
    deeds: &BTreeSet<TransitionId>,
    transitions: &[Transition],
) -> Vec<HistoryEntry> {
    let ends: Vec<Option<Moment>> = history.iter().skip(1).map(|next| Some(next.moment)).chain([None]).collect();
    let taken_by: Vec<Option<TransitionId>> = history.iter().skip(1).map(grasped_by).chain([None]).collect();
    let logs = reach.keeping.deeds.tell_places();
    let mut left: Vec<HistoryEntry> = Vec::new();
    for ((entry, end), taken_by) in history.into_iter().zip(ends).zip(taken_by) {
        let own = matches!(entry.cause, PlaceCause::Own(deed) | PlaceCause::Grasped(deed) if deeds.contains(&deed));
        let deed = taken_by.filter(|deed| logs && deeds.contains(deed));
        let deed = deed.and_then(|deed| transitions.iter().find(|transition| transition.id == deed));
        // Since when is known from a kept frame alone. What is not known to have changed is taken to have been so.
        let since = left.last().map_or(Moment { time: Time::ZERO, ..entry.moment }, |before| just_after(before.moment));
        let since = since.min(entry.moment);
        match shown_in(&entry, end, id, reach) {
            _ if own && logs => left.push(entry),
            Some(sight) if frame_of(&entry) == Some(sight.frame) => left.push(entry),
            Some(sight) => {
                let cause = if entry.place.is_some() { PlaceCause::Seen } else { PlaceCause::Gone };
                left.push(HistoryEntry { moment: since, cause: cause(sight.frame), ..entry });
            }
            // A deed tells whence it took the thing.
            None if deed.is_some() => {
                let cause = deed.map_or(entry.cause, |deed| PlaceCause::Grasped(deed.id));
                left.push(HistoryEntry { moment: since, cause, ..entry });
            }
            None if end.is_none() => left.push(HistoryEntry { moment: since, ..entry }),
            None => {}
        }
    }
    left
}

fn just_after(moment: Moment) -> Moment {
    Moment { time: Time(moment.time.0 + 1), ..moment }
}

fn frame_of(entry: &HistoryEntry) -> Option<FrameId> {
    match entry.cause {
        PlaceCause::Seen(frame) | PlaceCause::Gone(frame) => Some(frame),
        PlaceCause::Own(_) | PlaceCause::Grasped(_) => None,
    }
}

fn grasped_by(entry: &HistoryEntry) -> Option<TransitionId> {
    match entry.cause {
        PlaceCause::Grasped(deed) => Some(deed),
        _ => None,
    }
}

/// The first kept frame that shows an entry to be so.
fn shown_in<'a>(entry: &HistoryEntry, end: Option<Moment>, id: ObjectId, reach: &Reach<'a>) -> Option<&'a Sight> {
    let frame = frame_of(entry);
    let shows = |sight: &Sight| match entry.place {
        Some(_) => sight.shown.contains_key(&id),
        None => sight.gone.contains(&id),
    };
    let during = |sight: &Sight| sight.moment >= entry.moment && end.is_none_or(|end| sight.moment < end);
    reach.kept.iter().copied().find(|sight| shows(sight) && (Some(sight.frame) == frame || during(sight)))
}
