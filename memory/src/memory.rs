//! The memory itself: decides what each call changes, commits it as one batch, and hands out snapshots.

use crate::{
    consolidate,
    draft::Draft,
    entry::Moment,
    event::{Change, Counters, Event, Forget, Source},
    execute, expect,
    forgetting::{self, Policy},
    identity::IdentityRule,
    ledger::Ledger,
    observation::{Executed, Grounding, Note, Observation, Verdict},
    observe,
    recent::{Recent, RecentEvents},
    regroup,
    state::State,
    traits::{Memory, MemoryError, MemoryView},
    view::Snapshot,
};
use acm_concept::{
    expectation::Expectation,
    ids::{ObjectId, SkillId, TransitionId},
    template::TemplateLibrary,
    time::Time,
};
use acm_store::compact::Compacted;
use std::{path::Path, sync::Arc};

/// Analytic concept-centric memory: object, scene, transition and skill memory over a library of templates.
///
/// ```
/// use acm_memory::{AcmMemory, Memory, observation::Note};
/// let library = std::sync::Arc::new(acm_memory::default_library().unwrap());
/// let mut memory = AcmMemory::in_memory(library);
/// memory.note(&Note::EpisodeBegan).unwrap();
/// assert!(memory.view().objects().is_empty());
/// ```
#[derive(Debug)]
pub struct AcmMemory {
    library: Arc<TemplateLibrary>,
    rule: IdentityRule,
    state: State,
    ledger: Ledger,
    recent: RecentEvents,
}

impl AcmMemory {
    /// A memory that ends with the process.
    pub fn in_memory(library: Arc<TemplateLibrary>) -> AcmMemory {
        let (rule, recent) = (IdentityRule::Global, RecentEvents::default());
        AcmMemory { library, rule, state: State::default(), ledger: Ledger::in_memory(), recent }
    }
    /// Creates a memory folder or continues the one that is there. What a crash left unacknowledged is cut off.
    pub fn open(dir: &Path, library: Arc<TemplateLibrary>) -> Result<AcmMemory, MemoryError> {
        let (ledger, events) = Ledger::open(dir)?;
        let state = fold(&events).map_err(|(record, reason)| MemoryError::Record {
            path: ledger.path().into(),
            record,
            reason,
        })?;
        let (rule, recent) = (IdentityRule::Global, RecentEvents::default());
        Ok(AcmMemory { library, rule, state, ledger, recent })
    }
    /// The same memory with another identity rule.
    pub fn with_identity(self, rule: IdentityRule) -> AcmMemory {
        AcmMemory { rule, ..self }
    }
    /// Drops a part of memory. The log keeps the events that told of it; see [`Memory::wipe`] for removing all.
    pub fn forget(&mut self, forget: &Forget) -> Result<(), MemoryError> {
        let mut draft = self.draft(Source::Agent);
        draft.emit(Vec::new(), Change::Forgotten(forget.clone()));
        let (state, events, fault) = (draft.state, draft.events, draft.fault);
        self.commit(state, events, fault)
    }
    /// Takes transitions back out of skill memory, or, `restored`, in again: every skill is then what it would be without
    /// them. What was executed stays in transition memory.
    ///
    /// # Errors
    /// One of them is not remembered; then nothing changes.
    pub fn take_back(&mut self, transitions: &[TransitionId], restored: bool) -> Result<(), MemoryError> {
        if let Some(unknown) = transitions.iter().find(|id| self.state.transition(**id).is_none()) {
            return Err(MemoryError::UnknownTransition(*unknown));
        }
        let mut draft = self.draft(Source::Agent);
        consolidate::take_back(&mut draft, transitions, restored);
        let (state, events, fault) = (draft.state, draft.events, draft.fault);
        self.commit(state, events, fault)
    }
    /// Undoes a skill's latest consolidation: takes back what its latest subtask brought, and says which transitions
    /// those were. A skill that came with them goes with them.
    ///
    /// # Errors
    /// There is no such skill.
    pub fn undo_consolidation(&mut self, skill: SkillId) -> Result<Vec<TransitionId>, MemoryError> {
        if !self.state.skills.iter().any(|entry| entry.id == skill) {
            return Err(MemoryError::UnknownSkill(skill));
        }
        let latest = consolidate::latest(&self.state, skill);
        self.take_back(&latest, false)?;
        Ok(latest)
    }
    /// Forgets objects and what was done to them so that no byte of them stays in the folder. What skills learned from
    /// them stays, as numbers without a link; so do words of the instruction.
    pub fn erase(&mut self, objects: &[ObjectId]) -> Result<(), MemoryError> {
        let next = self.state.next;
        let last = |kept: &[Event]| {
            let mut state = fold(kept).map_err(|(_, reason)| reason)?;
            // An id is never given twice.
            state.next = Counters { episode: state.next.episode, ..next };
            let rest = forgetting::rest(&state);
            Ok((state, rest))
        };
        let present = || forgetting::digest(&self.state);
        self.state = self.ledger.forget(&objects.iter().copied().collect(), present, last)?;
        self.recent = RecentEvents::default();
        Ok(())
    }
    /// Takes two identities for one thing: `gone` goes, its history and what was done to it are `kept`'s from now on, and
    /// what was seen last is believed. Gives the number by which it can be undone.
    ///
    /// # Errors
    /// One of them is not remembered; then nothing changes.
    pub fn merge(&mut self, kept: ObjectId, gone: ObjectId) -> Result<u32, MemoryError> {
        self.regroup(|draft| regroup::merge(draft, kept, gone))
    }
    /// Takes an identity for two things: since a moment it was another one, which gets an id of its own, the history since
    /// and what was done to it since. Where the old one is since then is unknown. Gives the number by which it can be
    /// undone, and the new id.
    ///
    /// # Errors
    /// It is not remembered, or not on both sides of the moment; then nothing changes.
    pub fn split(&mut self, from: ObjectId, since: Moment) -> Result<(u32, ObjectId), MemoryError> {
        self.regroup(|draft| regroup::split(draft, from, since))
    }
    /// Undoes a merge or a split. What was seen since stays with the identity under which it was seen; of a split it comes
    /// back to the one that is left.
    ///
    /// # Errors
    /// There is none with this number, or it was undone.
    pub fn undo_regrouping(&mut self, number: u32) -> Result<(), MemoryError> {
        self.regroup(|draft| regroup::undo(draft, number)).map(drop)
    }
    fn regroup<T>(&mut self, change: impl FnOnce(&mut Draft<'_>) -> Result<T, String>) -> Result<T, MemoryError> {
        let mut draft = self.draft(Source::Agent);
        let done = change(&mut draft).map_err(MemoryError::Regrouping)?;
        let (state, events, fault) = (draft.state, draft.events, draft.fault);
        self.commit(state, events, fault)?;
        Ok(done)
    }
    /// The objects that a policy forgets, in the order of their ids; see [`AcmMemory::erase`].
    pub fn due(&self, policy: &Policy) -> Vec<ObjectId> {
        forgetting::due(&self.state, policy)
    }
    /// Writes the log anew: of the runs before the last `keep_runs` ones it then holds what is believed of them now, with
    /// histories, transitions and skills, and no longer how that came about. What was so since then can still be asked
    /// for as it was known then; nothing that is believed changes.
    ///
    /// # Errors
    /// The folder cannot be written, or an entry is larger than an event may be: then the old log stays.
    pub fn compact(&mut self, keep_runs: u32) -> Result<Compacted, MemoryError> {
        let first = (self.state.next.episode + 1).saturating_sub(keep_runs);
        let digest = |before: &[Event]| match before {
            [] => Ok(Vec::new()),
            before => fold(before).map(|state| forgetting::digest(&state)).map_err(|(_, reason)| reason),
        };
        self.ledger.compact(Moment { episode: first, time: Time::ZERO }, digest)
    }
    /// Writes the engine's columns beside the log, for whoever asks them alone.
    pub fn write_snapshot(&mut self) -> Result<(), MemoryError> {
        self.ledger.snapshot()
    }
    /// The engine's columns as of the last call: folded from the same log as what is believed.
    pub fn columns(&self) -> &Arc<acm_store::State> {
        self.ledger.columns()
    }
    /// Events that add up to what is believed now, as a compacted log begins with them: for a memory that shall believe a
    /// part of it, see [`Memory::transplant`].
    pub fn digest(&self) -> Vec<Event> {
        forgetting::digest(&self.state)
    }
    /// The present view, with what only this memory can be asked.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot::new(self.state.clone(), self.library.clone(), self.ledger.columns().clone())
    }
    /// Objects that the last frame showed, and those in the hand.
    pub fn present_in_last_frame(&self) -> Vec<acm_concept::ids::ObjectId> {
        let last = self.state.glance.as_ref().filter(|glance| glance.showed).map(|glance| glance.frame);
        let shown = |entry: &&crate::entry::ObjectEntry| {
            let seen = last.is_some() && entry.last_frame == last && entry.last_seen.episode == self.state.next.episode;
            seen || entry.presence == crate::entry::Presence::Held
        };
        self.state.objects.iter().filter(shown).map(|entry| entry.id).collect()
    }

    #[cfg(test)]
    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    fn draft(&self, source: Source) -> Draft<'_> {
        Draft::new(&self.state, &self.library, source)
    }

    /// Writes a batch to the log, then takes over the state that it leads to.
    fn commit(&mut self, state: State, events: Vec<Event>, fault: Option<String>) -> Result<(), MemoryError> {
        self.check(&events, fault)?;
        self.ledger.append(&events)?;
        self.state = state;
        self.recent.add(events);
        Ok(())
    }

    /// Believes what the events come to and nothing else; the log then holds them alone.
    fn replace(&mut self, events: Vec<Event>) -> Result<(), MemoryError> {
        let mut state = State::default();
        let fault = events.iter().try_for_each(|event| state.apply(event)).err();
        self.check(&events, fault)?;
        self.ledger.replace(&events)?;
        self.state = state;
        self.recent.add(events);
        Ok(())
    }

    /// Refuses a batch that could not be read back: it would make the whole log unreadable.
    fn check(&self, events: &[Event], fault: Option<String>) -> Result<(), MemoryError> {
        let refuse = |reason| Err(MemoryError::Record { path: self.ledger.path().into(), record: 0, reason });
        if let Some(reason) = fault {
            return refuse(reason);
        }
        // Reports come from outside whole; frames were checked number by number when they were read.
        for event in
            events.iter().filter(|event| matches!(event.change, Change::Transition(_) | Change::Settled { .. }))
        {
            let same = serde_json::to_vec(event).and_then(|bytes| serde_json::from_slice::<Event>(&bytes));
            match same {
                Ok(same) if same == *event => {}
                Ok(_) => {
                    return refuse(
                        "a report does not survive being written: it has a number that is not finite".into(),
                    );
                }
                Err(source) => return refuse(format!("a report has a number that is not finite: {source}")),
            }
        }
        Ok(())
    }
}

/// The state that events add up to, or the number of the one that has no meaning, and why.
fn fold(events: &[Event]) -> Result<State, (u64, String)> {
    let mut state = State::default();
    for (number, event) in (0u64..).zip(events) {
        state.apply(event).map_err(|reason| (number, reason))?;
    }
    Ok(state)
}

impl Memory for AcmMemory {
    fn name(&self) -> &str {
        match self.rule {
            IdentityRule::Global => "acm",
            IdentityRule::Paper => "paper-identity",
        }
    }
    fn expect(&self, now: Time) -> Expectation {
        expect::expect(&self.state, now)
    }
    fn observe(&mut self, observation: &Observation<'_>) -> Result<Grounding, MemoryError> {
        let mut draft = self.draft(Source::Camera(observation.percepts.frame.camera.clone()));
        let grounding = observe::observe(&mut draft, observation, self.rule);
        let (state, events, fault) = (draft.state, draft.events, draft.fault);
        self.commit(state, events, fault)?;
        Ok(grounding)
    }
    fn record(&mut self, executed: &Executed) -> Result<TransitionId, MemoryError> {
        let mut draft = self.draft(Source::Robot);
        let id = execute::record(&mut draft, executed);
        let (state, events, fault) = (draft.state, draft.events, draft.fault);
        self.commit(state, events, fault)?;
        Ok(id)
    }
    fn settle(&mut self, transition: TransitionId, verdict: &Verdict) -> Result<(), MemoryError> {
        let known = self.state.transition(transition).cloned().ok_or(MemoryError::UnknownTransition(transition))?;
        let mut draft = self.draft(Source::Agent);
        execute::settle(&mut draft, &known, verdict);
        let (state, events, fault) = (draft.state, draft.events, draft.fault);
        self.commit(state, events, fault)
    }
    fn note(&mut self, note: &Note) -> Result<(), MemoryError> {
        let mut draft = self.draft(Source::Agent);
        match note {
            // The first note may have begun the first run already.
            Note::EpisodeBegan if !draft.events.is_empty() => {}
            Note::EpisodeBegan => draft.begin_episode(),
            Note::Instructed { time, text } => {
                draft.at(*time);
                draft.emit(Vec::new(), Change::Instructed { text: text.clone() });
            }
            Note::SubtaskDone { time, index } => {
                draft.at(*time);
                draft.emit(Vec::new(), Change::SubtaskDone { index: *index });
                consolidate::after_subtask(&mut draft, *index);
            }
        }
        let (state, events, fault) = (draft.state, draft.events, draft.fault);
        self.commit(state, events, fault)
    }
    /// The log is replaced by one that holds the wipe alone, so that nothing of what was forgotten is left in it.
    fn wipe(&mut self) -> Result<(), MemoryError> {
        let counters: Counters = self.state.next;
        let event = Event {
            moment: self.state.moment(),
            source: Source::Agent,
            evidence: Vec::new(),
            change: Change::Wiped(counters),
        };
        self.replace(vec![event])
    }
    fn transplant(&mut self, donated: &[Event]) -> Result<(), MemoryError> {
        let (moment, source) = (self.state.moment(), Source::Agent);
        let wiped = Event { moment, source, evidence: Vec::new(), change: Change::Wiped(Counters::default()) };
        self.replace(std::iter::once(wiped).chain(donated.iter().cloned()).collect())
    }
    fn view(&self) -> Arc<dyn MemoryView> {
        Arc::new(self.snapshot())
    }
    fn events_since(&self, known: u64) -> Recent {
        self.recent.since(known)
    }
}
