//! One public call's changes before they are committed: events and the state that they lead to.

use crate::{
    entry::{HistoryEntry, Moment, ObjectEntry, PlaceCause},
    event::{Believed, Change, Event, Source, Track},
    geometry::Body,
    state::State,
};
use acm_concept::{ids::ObjectId, literal::Evidence, template::TemplateLibrary};
use std::collections::{BTreeMap, btree_map::Entry};

/// Events in the making. The state runs ahead of the log by them; if the log cannot take them, both are dropped.
#[derive(Debug)]
pub(crate) struct Draft<'a> {
    pub(crate) state: State,
    pub(crate) events: Vec<Event>,
    pub(crate) library: &'a TemplateLibrary,
    moment: Moment,
    source: Source,
    /// The first event that had no meaning: a defect of ours that must not reach the log.
    pub(crate) fault: Option<String>,
}

impl<'a> Draft<'a> {
    /// Begins a batch. Whatever is told before any run was begun begins the first.
    pub(crate) fn new(state: &State, library: &'a TemplateLibrary, source: Source) -> Draft<'a> {
        let moment = state.moment();
        let mut draft = Draft { state: state.clone(), events: Vec::new(), library, moment, source, fault: None };
        if state.next.episode == 0 {
            draft.begin_episode();
        }
        draft
    }
    /// Begins the next episode, at its time 0.
    pub(crate) fn begin_episode(&mut self) {
        self.moment = Moment { episode: self.state.next.episode + 1, time: Default::default() };
        self.emit(Vec::new(), Change::EpisodeBegan);
    }
    /// Sets the time of the events that follow.
    pub(crate) fn at(&mut self, time: acm_concept::time::Time) {
        self.moment.time = time;
    }
    /// The moment of the events that follow.
    pub(crate) fn moment(&self) -> Moment {
        self.moment
    }
    /// Adds an event and takes it into the state.
    pub(crate) fn emit(&mut self, evidence: Vec<Evidence>, change: Change) {
        let event = Event { moment: self.moment, source: self.source.clone(), evidence, change };
        if let Err(reason) = self.state.apply(&event) {
            self.fault.get_or_insert(reason);
        }
        self.events.push(event);
    }
    /// Adds the staged objects, with what was added to their histories.
    pub(crate) fn emit_stage(&mut self, stage: Stage, evidence: &[Evidence]) {
        for (id, staged) in stage.objects {
            let Staged { entry, mut track, new, left, placed } = staged;
            let place = entry.place();
            let believed = |entry: ObjectEntry, track| Change::Object(Box::new(Believed { entry, track }));
            let history = |place, cause, verified, moment| HistoryEntry { moment, place, cause, verified };
            let verified = entry.verified;
            if new {
                // A history needs the object to be there.
                self.emit(evidence.to_vec(), believed(entry.clone(), track.clone()));
            }
            if placed.is_none() && left.is_some() {
                track.anchor = None;
            }
            if let Some(cause) = left {
                let entry = history(None, cause, matches!(cause, PlaceCause::Grasped(_)), self.moment);
                self.emit(evidence.to_vec(), Change::History { object: id, entry });
            }
            if let Some(cause) = placed {
                let entry = history(place, cause, verified, self.moment);
                self.emit(evidence.to_vec(), Change::History { object: id, entry });
            }
            if !new {
                self.emit(evidence.to_vec(), believed(entry, track));
            }
        }
    }
}

/// An object on its way to a new belief.
#[derive(Debug, Clone)]
pub(crate) struct Staged {
    pub(crate) entry: ObjectEntry,
    pub(crate) track: Track,
    pub(crate) new: bool,
    /// It left its place, for this cause.
    pub(crate) left: Option<PlaceCause>,
    /// It came to its present place, for this cause.
    pub(crate) placed: Option<PlaceCause>,
}

/// The objects that a batch changes, so that relations can be computed over their new places before anything
/// is written.
#[derive(Debug, Default)]
pub(crate) struct Stage {
    objects: BTreeMap<ObjectId, Staged>,
}

impl Stage {
    /// The staged object, taken from the state when it is touched first.
    pub(crate) fn touch(&mut self, state: &State, id: ObjectId) -> Option<&mut Staged> {
        match self.objects.entry(id) {
            Entry::Occupied(staged) => Some(staged.into_mut()),
            Entry::Vacant(free) => {
                // The history is not copied: it does not change but by events of its own.
                let entry = without_history(state.object(id)?);
                Some(free.insert(Staged { entry, track: state.track(id), new: false, left: None, placed: None }))
            }
        }
    }
    /// Stages a new object.
    pub(crate) fn add(&mut self, entry: ObjectEntry, cause: PlaceCause) {
        let staged = Staged { entry, track: Track::default(), new: true, left: None, placed: Some(cause) };
        self.objects.insert(staged.entry.id, staged);
    }
    /// How many new objects are staged.
    pub(crate) fn added(&self) -> usize {
        self.objects.values().filter(|staged| staged.new).count()
    }
    /// The entry as it will be.
    pub(crate) fn entry<'s>(&'s self, state: &'s State, id: ObjectId) -> Option<&'s ObjectEntry> {
        self.objects.get(&id).map(|staged| &staged.entry).or_else(|| state.object(id))
    }
    /// All entries as they will be, in the order of their ids. Staged entries have no history.
    pub(crate) fn entries<'s>(&'s self, state: &'s State) -> Vec<&'s ObjectEntry> {
        let known = state.objects.iter().map(|entry| self.objects.get(&entry.id).map_or(entry, |staged| &staged.entry));
        let mut all: Vec<_> = known.chain(self.objects.values().filter(|s| s.new).map(|s| &s.entry)).collect();
        all.sort_by_key(|entry| entry.id);
        all
    }
    /// The shapes of all objects as they will be.
    pub(crate) fn bodies(&self, state: &State, library: &TemplateLibrary) -> BTreeMap<ObjectId, Body> {
        let of = |entry: &&ObjectEntry| Body::of(&entry.parts, library).map(|body| (entry.id, body));
        self.entries(state).iter().filter_map(of).collect()
    }
}

fn without_history(entry: &ObjectEntry) -> ObjectEntry {
    ObjectEntry {
        id: entry.id,
        category: entry.category.clone(),
        categories: entry.categories.clone(),
        parts: entry.parts.clone(),
        appearance: entry.appearance,
        presence: entry.presence,
        support: entry.support,
        state: entry.state.clone(),
        confidence: entry.confidence,
        verified: entry.verified,
        last_seen: entry.last_seen,
        last_frame: entry.last_frame,
        views: entry.views,
        ambiguous_with: entry.ambiguous_with.clone(),
        history: Vec::new(),
    }
}
