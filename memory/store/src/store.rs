//! One writer over a folder, and readers that never wait.

use crate::{
    Event, Nanos, State,
    disk::{Disk, Folder, Volatile},
    event,
    log::{self, Batch, Log, LogError, Place},
    manifest::{self, Found, Manifest},
    snapshot,
};
use std::{
    io,
    path::{Path, PathBuf},
    sync::{Arc, PoisonError, RwLock},
};
use thiserror::Error;

/// A group of batches is written once it has so many bytes.
pub const GROUP_BYTES: usize = 256 << 10;
/// A group of batches should be flushed when its first batch has waited so long.
pub const GROUP_NANOS: u64 = 2_000_000;

/// Why the store could not do something.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The folder cannot be read or written.
    #[error("{what}: {source}")]
    Io {
        /// What was tried.
        what: String,
        /// The operating system's complaint.
        source: io::Error,
    },
    /// Another process writes this folder.
    #[error("{0} is in use by another process")]
    Locked(PathBuf),
    /// The folder was written by a program with another format number.
    #[error(
        "the folder has format {found}, this program reads format {known}: use another folder, or the program that wrote it"
    )]
    Format {
        /// The number found.
        found: u32,
        /// The number that is read.
        known: u32,
    },
    /// What was acknowledged is damaged, or a file is not what it should be.
    #[error("{file}: {reason}")]
    Damaged {
        /// The file, with the place in it.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// A batch that has no meaning here; nothing of it was kept.
    #[error("the batch was refused: {0}")]
    Refused(String),
    /// A write failed before: what is on disk is no longer known. Opening the folder again tells.
    #[error("an earlier write failed ({0}): open the folder again")]
    Broken(String),
}

fn io_error(what: &str) -> impl FnOnce(io::Error) -> StoreError + '_ {
    move |source| StoreError::Io { what: what.into(), source }
}

fn log_error(error: LogError) -> StoreError {
    match error {
        LogError::Io(source) => StoreError::Io { what: "the log cannot be read".into(), source },
        LogError::Damaged { file, byte, reason } => {
            StoreError::Damaged { file: format!("{file}, byte {byte}"), reason }
        }
    }
}

/// What readers see: the state as of the last commit that was published.
#[derive(Debug, Clone)]
pub struct Reader(Arc<RwLock<Arc<State>>>);

impl Reader {
    /// The newest published state. It does not change; the lock is held for as long as it takes to copy a pointer.
    pub fn view(&self) -> Arc<State> {
        self.0.read().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// The writer.
pub struct Store {
    disk: Box<dyn Disk>,
    state: State,
    log: Log,
    manifest: Manifest,
    group: Batch,
    /// What was enqueued and is not on disk: the number of the next event and the time of the last part.
    pending: Option<(u64, Nanos)>,
    broken: Option<String>,
    published: Reader,
}

impl std::fmt::Debug for Store {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Store")
            .field("next", &self.state.next)
            .field("manifest", &self.manifest)
            .finish_non_exhaustive()
    }
}

impl Store {
    /// A store that ends with the process.
    pub fn in_memory() -> Store {
        let mut disk = Volatile::default();
        let log = Log::empty(&mut disk);
        let published = Reader(Arc::new(RwLock::new(Arc::new(State::default()))));
        let (manifest, group) = (Manifest::default(), Batch::default());
        Store {
            disk: Box::new(disk),
            state: State::default(),
            log,
            manifest,
            group,
            pending: None,
            broken: None,
            published,
        }
    }
    /// Opens or makes a folder.
    pub fn open(path: &Path) -> Result<Store, StoreError> {
        Store::open_with(path, |_, _, _| Ok(())).map(|(store, _)| store)
    }
    /// Opens or makes a folder, gives every event behind the newest snapshot to `take`, with its number and the time at
    /// which it came to be known, and gives that snapshot's document.
    pub fn open_with(
        path: &Path,
        take: impl FnMut(u64, Nanos, &Event) -> Result<(), String>,
    ) -> Result<(Store, Option<Vec<u8>>), StoreError> {
        let folder = Folder::lock(path).map_err(|error| match error.kind() {
            io::ErrorKind::WouldBlock => StoreError::Locked(path.into()),
            _ => StoreError::Io { what: format!("{} cannot be opened", path.display()), source: error },
        })?;
        Store::open_on(Box::new(folder), take)
    }
    /// The same over any disk.
    pub fn open_on(
        mut disk: Box<dyn Disk>,
        mut take: impl FnMut(u64, Nanos, &Event) -> Result<(), String>,
    ) -> Result<(Store, Option<Vec<u8>>), StoreError> {
        let manifest = match Manifest::read(&*disk).map_err(io_error("the folder cannot be read"))? {
            Found::Known(manifest) => manifest,
            Found::Other(found) => return Err(StoreError::Format { found, known: manifest::FORMAT }),
            Found::Damaged(reason) => return Err(StoreError::Damaged { file: manifest::NAME.into(), reason }),
            Found::Nothing => {
                let manifest = Manifest::default();
                let begin = |disk: &mut dyn Disk| {
                    Log::begin(disk, 0, Place { batch: 0, next: 0 })?;
                    manifest.write(disk)
                };
                begin(&mut *disk).map_err(io_error("the folder cannot be written"))?;
                manifest
            }
        };
        sweep(&mut *disk, manifest).map_err(io_error("what is left over cannot be removed"))?;
        let (mut state, mut document, mut batch) = (State::default(), None, 0);
        let mut first = manifest.first;
        if let Some(number) = manifest.snapshot {
            let file = snapshot::name(number);
            let map = disk.map(&file).map_err(io_error("the snapshot cannot be read"))?;
            if !snapshot::is_of_another_layout(&map) {
                let found = snapshot::read(Arc::new(map)).map_err(|reason| StoreError::Damaged { file, reason })?;
                (state, document, batch, first) = (found.state, Some(found.document), found.batch, number);
            }
        }
        let skip = Place { batch, next: state.next };
        let log = Log::open(&mut *disk, (manifest.first, first), skip, |first, time, bodies| {
            let mut events = Vec::with_capacity(bodies.len());
            for (number, body) in (first..).zip(bodies) {
                events.push(event::read(body).ok_or_else(|| format!("record {number} is no event"))?);
            }
            state.check(&events, time)?;
            for (number, event) in (first..).zip(&events) {
                state.apply(event, time);
                take(number, time, event)?;
            }
            state.commit(time);
            Ok(())
        });
        let log = log.map_err(log_error)?;
        state.settle(false);
        let published = Reader(Arc::new(RwLock::new(Arc::new(State::default()))));
        let store =
            Store { disk, state, log, manifest, group: Batch::default(), pending: None, broken: None, published };
        Ok((store, document))
    }

    /// The present state, with everything that was enqueued or committed.
    pub fn state(&self) -> &State {
        &self.state
    }
    /// A copy of the present state that stays as it is, sorted for reading.
    pub fn view(&mut self) -> Arc<State> {
        self.state.settle(false);
        Arc::new(self.state.clone())
    }
    /// A handle for readers in other threads. From now on every commit is published to it.
    pub fn reader(&mut self) -> Reader {
        self.publish();
        self.published.clone()
    }
    /// Which files count.
    pub fn manifest(&self) -> Manifest {
        self.manifest
    }
    fn publish(&mut self) {
        self.state.settle(false);
        let state = Arc::new(self.state.clone());
        *self.published.0.write().unwrap_or_else(PoisonError::into_inner) = state;
    }
    fn usable(&self) -> Result<(), StoreError> {
        self.broken.as_ref().map_or(Ok(()), |reason| Err(StoreError::Broken(reason.clone())))
    }

    /// Takes in a batch and returns once it is on disk. After [`StoreError::Refused`] nothing of it was kept; after any
    /// other error opening the folder again tells whether it was.
    pub fn commit(&mut self, events: &[Event], time: Nanos) -> Result<(), StoreError> {
        self.enqueue(events, time)?;
        self.flush()
    }
    /// Takes in a batch, which can be read at once and is on disk after [`Store::flush`] or when [`GROUP_BYTES`] have come
    /// together; all batches of a group are there after a crash, or none.
    pub fn enqueue(&mut self, events: &[Event], time: Nanos) -> Result<(), StoreError> {
        self.usable()?;
        self.state.check(events, time).map_err(StoreError::Refused)?;
        let before = self.group.bytes().len();
        if let Some((next, time)) = self.pending {
            self.group.mark(next, time);
        }
        for (sequence, event) in (self.state.next..).zip(events) {
            if !self.group.event(sequence, |out| event::write(event, out)) {
                self.group.cut(before);
                return Err(StoreError::Refused(format!("an event is larger than {} bytes", log::MAX_RECORD_BYTES)));
            }
        }
        for event in events {
            self.state.apply(event, time);
        }
        self.state.commit(time);
        self.pending = Some((self.state.next, time));
        if self.group.bytes().len() >= GROUP_BYTES { self.flush() } else { Ok(()) }
    }
    /// Brings all that was enqueued to disk.
    pub fn flush(&mut self) -> Result<(), StoreError> {
        self.usable()?;
        let Some((next, time)) = self.pending.take() else { return Ok(()) };
        let place = self.log.place();
        self.group.commit(place.batch, next, time);
        let place = Place { batch: place.batch + 1, next };
        let written = self.log.write(&mut *self.disk, self.group.bytes(), place);
        let written = written.and_then(|()| self.log.sync(&mut *self.disk));
        self.group.clear();
        if let Err(source) = written {
            self.broken = Some(source.to_string());
            return Err(StoreError::Io { what: "the log cannot be written".into(), source });
        }
        if Arc::strong_count(&self.published.0) > 1 {
            self.publish();
        }
        Ok(())
    }

    /// Writes the present state as a snapshot, with a document of the caller's, so that opening reads it and the log behind
    /// it alone. The log before it stays: it is the truth.
    pub fn snapshot(&mut self, document: &[u8]) -> Result<(), StoreError> {
        self.flush()?;
        self.state.settle(true);
        let number = self.log.segment() + 1;
        let bytes = snapshot::write(&self.state, self.log.place().batch, document);
        let result = self.put_snapshot(number, &bytes);
        result
            .inspect_err(|error| self.broken = Some(error.to_string()))
            .map_err(io_error("the snapshot cannot be written"))
    }
    fn put_snapshot(&mut self, number: u64, bytes: &[u8]) -> io::Result<()> {
        let (file, fresh) = (snapshot::name(number), "snapshot.new");
        self.disk.create(fresh)?;
        self.disk.append(fresh, bytes)?;
        self.disk.sync(fresh)?;
        self.disk.rename(fresh, &file)?;
        self.log.turn(&mut *self.disk)?;
        let old = self.manifest.snapshot.replace(number);
        self.manifest.write(&mut *self.disk)?;
        if let Some(old) = old {
            self.disk.remove(&snapshot::name(old))?;
            self.disk.sync_folder()?;
        }
        Ok(())
    }

    /// All events from the first, each with the time at which it came to be known.
    pub fn events(&mut self) -> Result<Vec<(Nanos, Event)>, StoreError> {
        self.flush()?;
        let mut all = Vec::new();
        let start = Place { batch: 0, next: 0 };
        let read = Log::open(&mut *self.disk, (self.manifest.first, self.manifest.first), start, |_, time, bodies| {
            for body in bodies {
                all.push((time, event::read(body).ok_or("a record is no event")?));
            }
            Ok(())
        });
        read.map_err(log_error)?;
        Ok(all)
    }
    /// Replaces all that there is by other batches, in one step; nothing of the old files stays in the folder.
    pub fn rewrite(&mut self, batches: &[(Nanos, Vec<Event>)]) -> Result<(), StoreError> {
        self.flush()?;
        let mut state = State::default();
        for (time, events) in batches {
            state.check(events, *time).map_err(StoreError::Refused)?;
            events.iter().for_each(|event| state.apply(event, *time));
            state.commit(*time);
        }
        let result = self.put_log(batches);
        result
            .inspect_err(|error| self.broken = Some(error.to_string()))
            .map_err(io_error("the log cannot be rewritten"))?;
        self.state = state;
        if Arc::strong_count(&self.published.0) > 1 {
            self.publish();
        }
        Ok(())
    }
    fn put_log(&mut self, batches: &[(Nanos, Vec<Event>)]) -> io::Result<()> {
        let first = self.log.segment() + 1;
        let mut log = Log::begin(&mut *self.disk, first, Place { batch: 0, next: 0 })?;
        // Many batches are written as one group: each alone would begin on a block of its own.
        let (mut bytes, mut open) = (Batch::default(), None);
        let mut next = 0;
        for (time, events) in batches {
            if let Some(before) = open {
                bytes.mark(next, before);
            }
            for event in events {
                if !bytes.event(next, |out| event::write(event, out)) {
                    return Err(io::Error::other("an event is larger than a record may be"));
                }
                next += 1;
            }
            open = Some(*time);
            if bytes.bytes().len() >= GROUP_BYTES {
                put_group(&mut log, &mut *self.disk, &mut bytes, next, *time)?;
                open = None;
            }
        }
        if let Some(time) = open {
            put_group(&mut log, &mut *self.disk, &mut bytes, next, time)?;
        }
        log.sync(&mut *self.disk)?;
        self.manifest = Manifest { first, snapshot: None };
        self.manifest.write(&mut *self.disk)?;
        self.log = log;
        sweep(&mut *self.disk, self.manifest)
    }
    /// Bytes of all files that count.
    pub fn disk_bytes(&self) -> Result<u64, StoreError> {
        let names = self.disk.list().map_err(io_error("the folder cannot be read"))?;
        let mut sum = 0;
        for name in names.iter().filter(|name| log::number(name).is_some() || name.ends_with(".snapshot")) {
            sum += self.disk.map(name).map_err(io_error("a file cannot be read"))?.bytes().len() as u64;
        }
        Ok(sum)
    }
}

fn put_group(log: &mut Log, disk: &mut dyn Disk, bytes: &mut Batch, next: u64, time: Nanos) -> io::Result<()> {
    let batch = log.place().batch;
    bytes.commit(batch, next, time);
    log.write(disk, bytes.bytes(), Place { batch: batch + 1, next })?;
    bytes.clear();
    Ok(())
}

/// Removes what a crash or a rewrite left behind: it is in no manifest.
fn sweep(disk: &mut dyn Disk, manifest: Manifest) -> io::Result<()> {
    let mut removed = false;
    for name in disk.list()? {
        let old_log = log::number(&name).is_some_and(|number| number < manifest.first);
        let of_snapshot = name.strip_suffix(".snapshot").and_then(|number| number.parse::<u64>().ok());
        let old_snapshot = of_snapshot.is_some_and(|number| Some(number) != manifest.snapshot);
        if old_log || old_snapshot || name == "snapshot.new" || name == "FORMAT.new" {
            disk.remove(&name)?;
            removed = true;
        }
    }
    if removed { disk.sync_folder() } else { Ok(()) }
}
