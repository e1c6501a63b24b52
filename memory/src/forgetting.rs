//! What need not be kept: objects that a policy forgets, and how a compacted log says what is believed.

use crate::{
    entry::{ObjectEntry, Presence},
    event::{Believed, Change, Event, Rest, Source},
    state::State,
};
use acm_concept::ids::ObjectId;
use std::cmp::Reverse;

/// Which objects are forgotten. What is in the hand is kept.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Policy {
    /// Those that were last seen so many runs ago, or longer.
    pub older_than_runs: Option<u32>,
    /// All but so many: those that were seen last stay, and of equals those that were seen more often.
    pub keep_most: Option<usize>,
    /// Those that are less likely to exist as described.
    pub below_confidence: Option<f64>,
}

pub(crate) fn due(state: &State, policy: &Policy) -> Vec<ObjectId> {
    let run = state.next.episode;
    let is_old = |entry: &ObjectEntry| {
        policy.older_than_runs.is_some_and(|runs| run.saturating_sub(entry.last_seen.episode) >= runs)
    };
    let is_unsure = |entry: &ObjectEntry| policy.below_confidence.is_some_and(|least| entry.confidence < least);
    let free = state.objects.iter().filter(|entry| entry.presence != Presence::Held);
    let (mut due, mut kept): (Vec<&ObjectEntry>, Vec<&ObjectEntry>) =
        free.partition(|entry| is_old(entry) || is_unsure(entry));
    if let Some(most) = policy.keep_most {
        kept.sort_by_key(|entry| Reverse((entry.last_seen, entry.views, entry.id)));
        let held = state.objects.len() - due.len() - kept.len();
        due.extend(kept.into_iter().skip(most.saturating_sub(held)));
    }
    let mut ids: Vec<ObjectId> = due.into_iter().map(|entry| entry.id).collect();
    ids.sort();
    ids
}

/// Events that add up to a state.
pub(crate) fn digest(state: &State) -> Vec<Event> {
    let mut changes = Vec::new();
    for entry in state.objects.iter() {
        let whole = ObjectEntry { history: Vec::new(), ..entry.clone() };
        changes.push(Change::Object(Box::new(Believed { entry: whole, track: state.track(entry.id) })));
        let history = entry.history.iter().cloned();
        changes.extend(history.map(|history| Change::History { object: entry.id, entry: history }));
    }
    changes.extend(state.transitions.iter().cloned().map(|transition| Change::Transition(Box::new(transition))));
    if !state.taken_back.is_empty() {
        let transitions = state.taken_back.iter().copied().collect();
        changes.push(Change::TakenBack { transitions, restored: false });
    }
    changes.extend(state.skills.iter().cloned().map(|skill| Change::Skill(Box::new(skill))));
    let mut events: Vec<Event> = changes.into_iter().map(|change| event(state, change)).collect();
    events.push(rest(state));
    events
}

/// What is believed beside objects, transitions and skills.
pub(crate) fn rest(state: &State) -> Event {
    let rest = Rest {
        progress: state.progress.clone(),
        support: state.support,
        frames_seen: state.frames_seen,
        glance: state.glance.clone(),
        hand: state.hand,
        next: state.next,
        now: state.now,
        from_start: state.from_start,
        regrouped: state.regrouped.to_vec(),
        regroupings: state.regroupings,
    };
    event(state, Change::Compacted(Box::new(rest)))
}

fn event(state: &State, change: Change) -> Event {
    Event { moment: state.moment(), source: Source::Agent, evidence: Vec::new(), change }
}
