//! The agent's events in the engine's log. One public call on memory is one batch: its events, each with the operations
//! that the engine's columns follow and the event itself as a document, on disk before the call returns. What is believed
//! and what the columns hold are folded from that one log.

use crate::{
    entry::Moment,
    event::Event,
    project::{Projector, mentioned, moment_ns},
    redact::{self, Dropped},
    traits::MemoryError,
};
use acm_concept::ids::ObjectId;
use acm_store::{Store, StoreError, compact::Compacted, manifest};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Arc,
};

/// The format that this program reads and writes.
pub const FORMAT: u32 = manifest::FORMAT;

/// An open log with the columns that follow from it.
#[derive(Debug)]
pub(crate) struct Ledger {
    path: PathBuf,
    store: Store,
    projector: Projector,
    view: Arc<acm_store::State>,
    /// Whether events are kept as documents: only where they shall be read again.
    documents: bool,
}

impl Ledger {
    /// Columns that end with the process.
    pub(crate) fn in_memory() -> Ledger {
        let path = PathBuf::from("(in memory)");
        Ledger { path, store: Store::in_memory(), projector: Projector, view: Arc::default(), documents: false }
    }
    /// Opens or makes a folder and gives its events.
    pub(crate) fn open(dir: &Path) -> Result<(Ledger, Vec<Event>), MemoryError> {
        let path = dir.to_path_buf();
        let mut events = Vec::new();
        let opened = Store::open_with(dir, |number, _, event| {
            events.extend(parse(number, event)?);
            Ok(())
        });
        let (mut store, snapshot) = opened.map_err(|error| translate(&path, error))?;
        if snapshot.is_some() {
            // The columns came from a snapshot; what is believed comes from the log.
            events = all_events(&path, &mut store)?;
        }
        let view = store.view();
        Ok((Ledger { path, store, projector: Projector, view, documents: true }, events))
    }
    /// Where the log is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
    /// The columns as of the last batch.
    pub(crate) fn columns(&self) -> &Arc<acm_store::State> {
        &self.view
    }
    /// Writes a batch and returns once it is on disk. A batch that is refused leaves nothing behind.
    pub(crate) fn append(&mut self, events: &[Event]) -> Result<(), MemoryError> {
        let mut scratch = self.store.state().clone();
        let (batch, time) = self.projector.batch(&mut scratch, events, self.documents).map_err(|r| self.record(r))?;
        drop(scratch);
        self.store.commit(&batch, time).map_err(|error| translate(&self.path, error))?;
        self.view = self.store.view();
        Ok(())
    }
    /// Puts a new log with one batch in the old one's place, so that nothing of the old one is left.
    pub(crate) fn replace(&mut self, events: &[Event]) -> Result<(), MemoryError> {
        self.rewrite(&[events.to_vec()])
    }
    /// Puts a new log with these batches in the old one's place.
    fn rewrite(&mut self, batches: &[Vec<Event>]) -> Result<(), MemoryError> {
        let mut scratch = acm_store::State::default();
        let mut written = Vec::with_capacity(batches.len());
        for events in batches {
            let (batch, time) =
                self.projector.batch(&mut scratch, events, self.documents).map_err(|r| self.record(r))?;
            scratch.commit(time);
            written.push((time, batch));
        }
        self.store.rewrite(&written).map_err(|error| translate(&self.path, error))?;
        self.view = self.store.view();
        Ok(())
    }
    /// Writes the log anew without some objects and what was done to them; gives what is left, with what `last` makes of
    /// it behind it. What is left is known since when it was; where no events are kept, since now, as `present` tells it.
    pub(crate) fn forget<T>(
        &mut self,
        gone: &BTreeSet<ObjectId>,
        present: impl FnOnce() -> Vec<Event>,
        last: impl FnOnce(&[Event]) -> Result<(T, Event), String>,
    ) -> Result<T, MemoryError> {
        let mut dropped = Dropped::new(gone);
        let (mut batches, mut known): (Vec<Vec<Event>>, _) = (Vec::new(), None);
        let told = match self.documents {
            true => told_events(&self.path, &mut self.store)?,
            false => present().into_iter().map(|event| (0, event)).collect(),
        };
        for (time, event) in told {
            let Some(event) = redact::event(event, &mut dropped) else { continue };
            match batches.last_mut() {
                Some(batch) if known == Some(time) => batch.push(event),
                _ => batches.push(vec![event]),
            }
            known = Some(time);
        }
        let kept: Vec<Event> = batches.iter().flatten().cloned().collect();
        let (result, last) = last(&kept).map_err(|reason| self.record(reason))?;
        match batches.last_mut() {
            Some(batch) => batch.push(last),
            None => batches.push(vec![last]),
        }
        self.rewrite(&batches)?;
        Ok(result)
    }
    /// Writes the log anew; of what was before a moment it holds what `digest` makes of the events until then.
    pub(crate) fn compact(
        &mut self,
        horizon: Moment,
        digest: impl FnOnce(&[Event]) -> Result<Vec<Event>, String>,
    ) -> Result<Compacted, MemoryError> {
        let horizon = moment_ns(horizon).map_err(|reason| self.record(reason))?;
        let base = |before: &[(u64, acm_store::Event)]| {
            let parsed = (0u64..).zip(before).filter_map(|(number, (_, event))| parse(number, event).transpose());
            let events = digest(&parsed.collect::<Result<Vec<Event>, String>>()?)?;
            events.iter().map(document).collect()
        };
        let done = self.store.compact(horizon, base).map_err(|error| translate(&self.path, error))?;
        self.view = self.store.view();
        Ok(done)
    }
    /// Writes the columns beside the log, so that whoever asks them alone opens them at once.
    pub(crate) fn snapshot(&mut self) -> Result<(), MemoryError> {
        self.store.snapshot(&[]).map_err(|error| translate(&self.path, error))?;
        self.view = self.store.view();
        Ok(())
    }
    fn record(&self, reason: String) -> MemoryError {
        MemoryError::Record { path: self.path.clone(), record: self.store.state().next, reason }
    }
}

fn parse(number: u64, event: &acm_store::Event) -> Result<Option<Event>, String> {
    if event.document.is_empty() {
        return Ok(None);
    }
    let parsed = serde_json::from_slice(&event.document);
    parsed.map(Some).map_err(|error| format!("record {number} is no event of memory: {error}"))
}

/// An event that the columns do not follow.
fn document(event: &Event) -> Result<acm_store::Event, String> {
    let document = serde_json::to_vec(event).map_err(|error| format!("an event has no JSON: {error}"))?;
    let mut stored = acm_store::Event::new(moment_ns(event.moment)?, 0, 1.0, Vec::new());
    stored.about = mentioned(&document).into_iter().take(acm_store::event::MAX_OPS).collect();
    stored.document = document;
    Ok(stored)
}

fn all_events(path: &Path, store: &mut Store) -> Result<Vec<Event>, MemoryError> {
    Ok(told_events(path, store)?.into_iter().map(|(_, event)| event).collect())
}

/// All events, each with the time at which it came to be known.
fn told_events(path: &Path, store: &mut Store) -> Result<Vec<(u64, Event)>, MemoryError> {
    let stored = store.events().map_err(|error| translate(path, error))?;
    let parsed = (0u64..).zip(&stored).map(|(number, (known, event))| Ok(parse(number, event)?.map(|e| (*known, e))));
    let parsed: Result<Vec<Option<(u64, Event)>>, String> = parsed.collect();
    let error = |reason| MemoryError::Record { path: path.into(), record: 0, reason };
    Ok(parsed.map_err(error)?.into_iter().flatten().collect())
}

/// The events of a memory folder, which is left as it is.
///
/// # Errors
/// There is no memory in the folder, another process writes it, or it is damaged.
pub fn read_events(dir: &Path) -> Result<Vec<Event>, MemoryError> {
    if !dir.join(manifest::NAME).is_file() {
        return Err(MemoryError::Missing { path: dir.into() });
    }
    Ledger::open(dir).map(|(_, events)| events)
}

/// The columns of a memory folder, for questions to them alone.
///
/// # Errors
/// There is no memory in the folder, another process writes it, or it is damaged.
pub fn open_store(dir: &Path) -> Result<Store, MemoryError> {
    if !dir.join(manifest::NAME).is_file() {
        return Err(MemoryError::Missing { path: dir.into() });
    }
    Store::open(dir).map_err(|error| translate(dir, error))
}

fn translate(path: &Path, error: StoreError) -> MemoryError {
    match error {
        StoreError::Io { what, source } => {
            let source = std::io::Error::new(source.kind(), format!("{what}: {source}"));
            MemoryError::Io { path: path.into(), source }
        }
        StoreError::Locked(path) => MemoryError::Locked { path },
        StoreError::Format { found, known } => MemoryError::Format { path: path.join(manifest::NAME), found, known },
        StoreError::Damaged { file, reason } => MemoryError::Record { path: path.join(file), record: 0, reason },
        StoreError::Refused(reason) => MemoryError::Record { path: path.into(), record: 0, reason },
        StoreError::Broken(reason) => MemoryError::Record {
            path: path.into(),
            record: 0,
            reason: format!("an earlier write failed ({reason}): open the folder again"),
        },
    }
}

/// The time axis of the engine: episodes follow each other, each with room for 78 hours.
pub fn store_time(moment: Moment) -> Result<u64, String> {
    moment_ns(moment)
}
