//! The present state of memory: the fold of all its events.

use crate::{
    entry::{HistoryEntry, Moment, ObjectEntry, Presence, SkillEntry, TaskProgress, Transition},
    event::{Believed, Change, Counters, Event, Forget, Glance, Regrouped, Regrouping, Rest, Track},
    hand::HandFeeling,
};
use acm_concept::{
    ids::{ObjectId, TransitionId},
    object::SupportPlane,
    time::Time,
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

/// Most objects that are kept; later newcomers are not registered.
pub const MAX_OBJECTS: usize = 100_000;
/// Most entries of one object's history; the oldest goes first.
pub const MAX_HISTORY: usize = 4_096;
/// Most transitions that are kept; the oldest goes first.
pub const MAX_TRANSITIONS: usize = 100_000;
/// Most merges and splits that can be undone; the oldest goes first.
pub const MAX_REGROUPED: usize = 1_000;
/// Most skill entries.
pub const MAX_SKILLS: usize = 10_000;

/// Everything that memory believes. Cloning shares the big lists; the first write after that copies the list
/// it touches, so a view costs next to nothing and never changes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    pub(crate) objects: Arc<Vec<ObjectEntry>>,
    pub(crate) tracks: Arc<BTreeMap<ObjectId, Track>>,
    pub(crate) transitions: Arc<Vec<Transition>>,
    pub(crate) skills: Arc<Vec<SkillEntry>>,
    /// Transitions on which no skill may rest.
    pub(crate) taken_back: Arc<BTreeSet<TransitionId>>,
    /// Merges and splits that can be undone, oldest first.
    pub(crate) regrouped: Arc<Vec<Regrouping>>,
    /// How many there were.
    pub(crate) regroupings: u32,
    pub(crate) progress: TaskProgress,
    pub(crate) support: Option<SupportPlane>,
    pub(crate) frames_seen: u32,
    pub(crate) glance: Option<Glance>,
    pub(crate) hand: HandFeeling,
    pub(crate) next: Counters,
    pub(crate) now: Time,
    /// Whether memory goes back to the beginning of the present episode.
    pub(crate) from_start: bool,
}

impl State {
    /// One object.
    pub(crate) fn object(&self, id: ObjectId) -> Option<&ObjectEntry> {
        self.objects.binary_search_by_key(&id, |entry| entry.id).ok().and_then(|at| self.objects.get(at))
    }
    /// What is tracked of an object beside its entry.
    pub(crate) fn track(&self, id: ObjectId) -> Track {
        self.tracks.get(&id).cloned().unwrap_or_default()
    }
    /// One transition.
    pub(crate) fn transition(&self, id: TransitionId) -> Option<&Transition> {
        self.transitions.binary_search_by_key(&id, |entry| entry.id).ok().and_then(|at| self.transitions.get(at))
    }
    /// The object in the hand.
    pub(crate) fn held(&self) -> Option<&ObjectEntry> {
        self.objects.iter().find(|entry| entry.presence == Presence::Held)
    }
    /// The present moment.
    pub(crate) fn moment(&self) -> Moment {
        Moment { episode: self.next.episode, time: self.now }
    }

    /// Takes one event. An event that refers to what is not there has no meaning; then the reason is returned.
    pub(crate) fn apply(&mut self, event: &Event) -> Result<(), String> {
        self.now = event.moment.time;
        match &event.change {
            Change::EpisodeBegan => self.begin_episode(),
            Change::Instructed { .. } => {
                self.progress = TaskProgress { done: Vec::new(), instructed: event.moment };
            }
            Change::SubtaskDone { index } => self.progress.done.push((*index, event.moment)),
            Change::Frame(glance) => {
                self.frames_seen += u32::from(glance.showed);
                self.hand = glance.hand;
                self.glance = Some(glance.clone());
            }
            Change::Support(plane) => self.support = Some(*plane),
            Change::Object(believed) => self.put_object(believed),
            Change::History { object, entry } => return self.add_history(*object, entry),
            Change::Transition(transition) => return self.add_transition(transition),
            Change::Settled { transition, result, after } => {
                let at = self.transitions.binary_search_by_key(transition, |entry| entry.id);
                let entry = at.ok().and_then(|at| Arc::make_mut(&mut self.transitions).get_mut(at));
                let entry = entry.ok_or_else(|| format!("there is no transition {transition} to settle"))?;
                (entry.result, entry.after) = (result.clone(), after.clone());
            }
            Change::Skill(skill) => self.put_skill(skill),
            Change::TakenBack { transitions, restored } => {
                let all = Arc::make_mut(&mut self.taken_back);
                for transition in transitions {
                    if *restored {
                        all.remove(transition)
                    } else {
                        all.insert(*transition)
                    };
                }
            }
            Change::Regrouped(regrouping) => self.regroup(regrouping),
            Change::Forgotten(forget) => self.forget(forget),
            Change::Compacted(rest) => self.take_rest(rest),
            Change::Wiped(counters) => {
                *self = State { next: *counters, now: event.moment.time, ..State::default() };
            }
        }
        Ok(())
    }

    /// Objects of earlier runs stay as beliefs that have to be seen again; nothing is taken to be in the hand.
    fn begin_episode(&mut self) {
        self.next.episode += 1;
        self.progress = TaskProgress::default();
        (self.frames_seen, self.glance, self.hand, self.from_start) = (0, None, HandFeeling::Unknown, true);
        for entry in Arc::make_mut(&mut self.objects) {
            entry.verified = false;
            entry.confidence *= 0.8;
            if entry.presence == Presence::Held {
                entry.presence = Presence::Missing;
            }
        }
        // Which of several alike a thing is stays as doubtful as it was.
        let tracks = std::mem::take(Arc::make_mut(&mut self.tracks));
        let doubtful = tracks.into_iter().filter(|(_, track)| track.doubt.is_some());
        let kept = doubtful.map(|(id, track)| (id, Track { doubt: track.doubt, ..Track::default() }));
        self.tracks = Arc::new(kept.collect());
    }

    fn regroup(&mut self, regrouping: &Regrouping) {
        regrouping.after.apply(self);
        self.regroupings = regrouping.number;
        let regrouped = Arc::make_mut(&mut self.regrouped);
        match &regrouping.what {
            Regrouped::Undone { number } => regrouped.retain(|known| known.number != *number),
            Regrouped::Merged { .. } | Regrouped::Split { .. } => {
                if regrouped.len() >= MAX_REGROUPED {
                    regrouped.remove(0);
                }
                regrouped.push(regrouping.clone());
            }
        }
    }
    pub(crate) fn set_history(&mut self, object: ObjectId, history: Vec<HistoryEntry>) {
        let at = self.objects.binary_search_by_key(&object, |entry| entry.id);
        if let Some(entry) = at.ok().and_then(|at| Arc::make_mut(&mut self.objects).get_mut(at)) {
            entry.history = history;
        }
    }
    pub(crate) fn drop_objects(&mut self, gone: &[ObjectId]) {
        if gone.is_empty() {
            return;
        }
        Arc::make_mut(&mut self.objects).retain(|entry| !gone.contains(&entry.id));
        Arc::make_mut(&mut self.tracks).retain(|id, _| !gone.contains(id));
    }
    pub(crate) fn set_transitions(&mut self, transitions: &[Transition]) {
        for transition in transitions {
            let at = self.transitions.binary_search_by_key(&transition.id, |known| known.id);
            if let Some(known) = at.ok().and_then(|at| Arc::make_mut(&mut self.transitions).get_mut(at)) {
                *known = transition.clone();
            }
        }
    }

    fn take_rest(&mut self, rest: &Rest) {
        self.progress.clone_from(&rest.progress);
        (self.support, self.frames_seen, self.hand) = (rest.support, rest.frames_seen, rest.hand);
        self.glance.clone_from(&rest.glance);
        (self.next, self.now, self.from_start) = (rest.next, rest.now, rest.from_start);
        self.regrouped = Arc::new(rest.regrouped.clone());
        self.regroupings = rest.regroupings;
    }

    pub(crate) fn put_object(&mut self, believed: &Believed) {
        let id = believed.entry.id;
        let objects = Arc::make_mut(&mut self.objects);
        let at = match objects.binary_search_by_key(&id, |entry| entry.id) {
            Ok(at) => at,
            Err(at) => {
                objects.insert(at, ObjectEntry { history: Vec::new(), ..believed.entry.clone() });
                at
            }
        };
        if let Some(entry) = objects.get_mut(at) {
            let history = std::mem::take(&mut entry.history);
            *entry = ObjectEntry { history, ..believed.entry.clone() };
            let mut place = entry.place();
            if let (Some(place), Some(anchor)) = (&mut place, believed.track.anchor) {
                place.pose.translation = anchor.position;
            }
            if let (Some(last), Some(place)) = (entry.history.last_mut(), place)
                && last.place.is_some()
            {
                last.place = Some(place);
                last.verified |= entry.verified;
            }
        }
        let tracks = Arc::make_mut(&mut self.tracks);
        // An object of which nothing is tracked has no track, however that came about.
        if believed.track == Track::default() {
            tracks.remove(&id);
        } else {
            tracks.insert(id, believed.track.clone());
        }
        self.next.object = self.next.object.max(id.0 + 1);
    }

    fn add_history(&mut self, object: ObjectId, entry: &HistoryEntry) -> Result<(), String> {
        let at = self.objects.binary_search_by_key(&object, |entry| entry.id);
        let known = at.ok().and_then(|at| Arc::make_mut(&mut self.objects).get_mut(at));
        let known = known.ok_or_else(|| format!("there is no object {object} to which a history could belong"))?;
        if known.history.len() >= MAX_HISTORY {
            known.history.remove(0);
        }
        known.history.push(entry.clone());
        Ok(())
    }

    fn add_transition(&mut self, transition: &Transition) -> Result<(), String> {
        if self.transitions.last().is_some_and(|last| last.id >= transition.id) {
            return Err(format!("transition {} does not come after the one before it", transition.id));
        }
        let transitions = Arc::make_mut(&mut self.transitions);
        if transitions.len() >= MAX_TRANSITIONS {
            transitions.remove(0);
        }
        transitions.push(transition.clone());
        self.hand = hand_after(transition, self.hand);
        self.next.transition = transition.id.0 + 1;
        Ok(())
    }

    fn put_skill(&mut self, skill: &SkillEntry) {
        let skills = Arc::make_mut(&mut self.skills);
        let full = skills.len() >= MAX_SKILLS;
        if skill.tries == 0 {
            skills.retain(|entry| entry.id != skill.id);
            self.next.skill = self.next.skill.max(skill.id.0 + 1);
            return;
        }
        match skills.iter_mut().find(|entry| entry.id == skill.id) {
            Some(entry) => *entry = skill.clone(),
            None if full => {}
            None => skills.push(skill.clone()),
        }
        self.next.skill = self.next.skill.max(skill.id.0 + 1);
    }

    fn forget(&mut self, forget: &Forget) {
        if !forget.objects.is_empty() {
            Arc::make_mut(&mut self.objects).retain(|entry| !forget.objects.contains(&entry.id));
            Arc::make_mut(&mut self.tracks).retain(|id, _| !forget.objects.contains(id));
            for entry in Arc::make_mut(&mut self.objects) {
                entry.ambiguous_with.retain(|(id, _)| !forget.objects.contains(id));
                entry.support = entry.support.filter(|id| !forget.objects.contains(id));
            }
        }
        if forget.histories {
            for entry in Arc::make_mut(&mut self.objects) {
                let last = entry.history.pop();
                entry.history.clear();
                entry.history.extend(last);
            }
        }
        if let Some(first) = forget.transitions_before {
            Arc::make_mut(&mut self.transitions).retain(|transition| transition.id >= first);
        }
        if forget.skills {
            Arc::make_mut(&mut self.skills).clear();
        }
    }
}

/// What the fingers felt last, after a skill: what its report says, or unknown where it let go without saying.
fn hand_after(transition: &Transition, before: HandFeeling) -> HandFeeling {
    let report = &transition.report;
    let said = report.felt.iter().rev().find_map(|(literal, _)| match (literal.predicate.as_str(), literal.negated) {
        ("hand-empty", false) | ("holding", true) => Some(HandFeeling::Empty),
        ("hand-empty", true) | ("holding", false) => Some(HandFeeling::Something),
        _ => None,
    });
    match (said, report.held.is_some(), report.left_at.is_some()) {
        (Some(said), _, _) => said,
        (None, true, _) => HandFeeling::Something,
        (None, false, true) => HandFeeling::Unknown,
        (None, false, false) => before,
    }
}
