//! The append-only log of a memory folder: the truth from which everything else is folded.
//!
//! One public call on memory is one batch: its events, then a commit record, written and synchronised to disk
//! before the call returns. What follows the last commit was never acknowledged and is cut off when the log is
//! opened. The format is described in docs/memory-format.md.

mod record;

use crate::{event::Event, traits::MemoryError};
use record::{COMMIT_BYTES, MAX_RECORD_BYTES, Record};
use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{self, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// The format that this program reads and writes.
pub const FORMAT: u32 = 1;
/// Largest log that is read, bytes.
pub const MAX_LOG_BYTES: u64 = 1 << 30;
/// Size of the blocks that a disk writes whole, bytes.
const SECTOR_BYTES: usize = 512;

/// An open log. Holds the folder's lock until it is dropped.
#[derive(Debug)]
pub struct Log {
    path: PathBuf,
    file: File,
    /// Bytes up to the end of the last commit.
    good: u64,
    /// Whether bytes of a failed write may follow.
    torn: bool,
    batches: u64,
    // Held for its lock only.
    _lock: File,
}

impl Log {
    /// Opens or creates the log in a folder, cuts off what was never committed, and returns the events.
    pub fn open(dir: &Path) -> Result<(Log, Vec<Event>), MemoryError> {
        fs::create_dir_all(dir).map_err(|source| io_error(dir, source))?;
        let lock = lock(dir)?;
        check_format(dir)?;
        let path = dir.join("events.log");
        let mut options = OpenOptions::new();
        let mut file = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(|source| io_error(&path, source))?;
        let bytes = read_log(&path)?;
        let Scan { events, good, batches } = scan(&path, &bytes)?;
        if good < bytes.len() as u64 {
            file.set_len(good).and_then(|()| file.sync_data()).map_err(|source| io_error(&path, source))?;
        }
        file.seek(SeekFrom::Start(good)).map_err(|source| io_error(&path, source))?;
        sync_folder(dir)?;
        Ok((Log { path, file, good, torn: false, batches, _lock: lock }, events))
    }

    /// Writes a batch and returns once it is on disk. After an error nothing of the batch is in the log.
    pub fn append(&mut self, events: &[Event]) -> Result<(), MemoryError> {
        let bytes = self.encode(events)?;
        if self.good + bytes.len() as u64 > MAX_LOG_BYTES {
            let reason = format!("the log would grow beyond {MAX_LOG_BYTES} bytes: use a new memory folder");
            return Err(record_error(&self.path, self.batches, reason));
        }
        self.write(&bytes).map_err(|source| io_error(&self.path, source))?;
        self.good += bytes.len() as u64;
        self.batches += 1;
        Ok(())
    }

    /// Puts a new log with one batch in the old one's place, so that nothing of the old one is left.
    pub fn replace(&mut self, events: &[Event]) -> Result<(), MemoryError> {
        self.batches = 0;
        let bytes = self.encode(events)?;
        let fresh = self.path.with_extension("new");
        let mut file = File::create(&fresh).map_err(|source| io_error(&fresh, source))?;
        file.write_all(&bytes).and_then(|()| file.sync_all()).map_err(|source| io_error(&fresh, source))?;
        fs::rename(&fresh, &self.path).map_err(|source| io_error(&self.path, source))?;
        (self.file, self.good, self.torn, self.batches) = (file, bytes.len() as u64, false, 1);
        sync_folder(self.path.parent().unwrap_or(Path::new(".")))
    }

    /// Where the log is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn encode(&self, events: &[Event]) -> Result<Vec<u8>, MemoryError> {
        let mut bytes = Vec::with_capacity(1024 * events.len());
        let mut refuse = None;
        for event in events {
            let body = serde_json::to_vec(event)
                .map_err(|source| record_error(&self.path, self.batches, format!("an event has no JSON: {source}")))?;
            if !record::write(Record::Event(&body), &mut bytes) {
                refuse = Some(format!("an event of {} bytes, at most {MAX_RECORD_BYTES} are kept", body.len()));
            }
        }
        if let Some(reason) = refuse {
            return Err(record_error(&self.path, self.batches, reason));
        }
        let fits = record::write(Record::Commit(self.batches), &mut bytes);
        assert!(fits, "a commit record has a fixed size below the limit");
        Ok(bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.torn {
            self.file.set_len(self.good)?;
            self.file.seek(SeekFrom::Start(self.good))?;
        }
        self.torn = true;
        self.file.write_all(bytes)?;
        self.file.sync_data()?;
        self.torn = false;
        Ok(())
    }
}

/// The events of a memory folder, which is left as it is.
///
/// # Errors
/// There is no memory in the folder, another process writes it, or it is damaged.
pub fn read_events(dir: &Path) -> Result<Vec<Event>, MemoryError> {
    let path = dir.join("events.log");
    if !path.is_file() {
        return Err(MemoryError::Missing { path: dir.into() });
    }
    check_format(dir)?;
    let _lock = lock(dir)?;
    Ok(scan(&path, &read_log(&path)?)?.events)
}

fn read_log(path: &Path) -> Result<Vec<u8>, MemoryError> {
    let size = fs::metadata(path).map_err(|source| io_error(path, source))?.len();
    if size > MAX_LOG_BYTES {
        return Err(record_error(path, 0, format!("{size} bytes, at most {MAX_LOG_BYTES} are read")));
    }
    fs::read(path).map_err(|source| io_error(path, source))
}

struct Scan {
    events: Vec<Event>,
    good: u64,
    batches: u64,
}

/// Reads all committed batches. Bytes after the last commit are a torn tail and are left out; bytes that are
/// damaged although a later batch was committed are an error.
fn scan(path: &Path, bytes: &[u8]) -> Result<Scan, MemoryError> {
    let mut scan = Scan { events: Vec::new(), good: 0, batches: 0 };
    let (mut at, mut batch, mut records) = (0usize, Vec::new(), 0u64);
    while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty()) {
        let Some((record, size)) = record::read(rest) else {
            if damage_is_acknowledged(bytes, scan.good as usize, at) {
                let reason =
                    format!("the checksum at byte {at} is wrong and committed records follow: the file is damaged");
                return Err(record_error(path, records, reason));
            }
            break;
        };
        match record {
            Record::Event(body) => batch.push(
                serde_json::from_slice::<Event>(body)
                    .map_err(|source| record_error(path, records, format!("not an event: {source}")))?,
            ),
            Record::Commit(number) if number == scan.batches => {
                scan.events.append(&mut batch);
                scan.batches += 1;
                scan.good = (at + size) as u64;
            }
            Record::Commit(number) => {
                let reason = format!("batch {number} where batch {} should be", scan.batches);
                return Err(record_error(path, records, reason));
            }
        }
        at += size;
        records += 1;
    }
    Ok(scan)
}

/// Whether damage at `at` hit what was acknowledged. A commit that follows it says so, unless it ends the file
/// and its batch has a whole disk block of zeros: then the power failed while that batch was being written and
/// its blocks reached the disk out of order (JSON has no zero bytes of its own).
fn damage_is_acknowledged(bytes: &[u8], good: usize, at: usize) -> bool {
    let is_commit = |start: &usize| {
        bytes.get(*start..).is_some_and(|rest| matches!(record::read(rest), Some((Record::Commit(_), COMMIT_BYTES))))
    };
    let Some(commit) = (at..bytes.len().saturating_sub(COMMIT_BYTES - 1)).find(is_commit) else { return false };
    let ends_file = commit + COMMIT_BYTES == bytes.len();
    let first_block = good.next_multiple_of(SECTOR_BYTES);
    let blocks = bytes.get(first_block..commit).unwrap_or_default().chunks_exact(SECTOR_BYTES);
    let lost_block = blocks.into_iter().any(|block| block.iter().all(|&byte| byte == 0));
    !(ends_file && lost_block)
}

fn lock(dir: &Path) -> Result<File, MemoryError> {
    let path = dir.join("lock");
    let mut options = OpenOptions::new();
    let file =
        options.write(true).create(true).truncate(false).open(&path).map_err(|source| io_error(&path, source))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(MemoryError::Locked { path: dir.into() }),
        Err(TryLockError::Error(source)) => Err(io_error(&path, source)),
    }
}

fn check_format(dir: &Path) -> Result<(), MemoryError> {
    let path = dir.join("FORMAT");
    match fs::read(&path) {
        Ok(bytes) => {
            let text = String::from_utf8_lossy(bytes.get(..64).unwrap_or(&bytes)).into_owned();
            let found = text.strip_prefix("acm-memory ").and_then(|number| number.trim().parse::<u32>().ok());
            match found {
                Some(FORMAT) => Ok(()),
                Some(found) => Err(MemoryError::Format { path, found, known: FORMAT }),
                None => {
                    Err(record_error(&path, 0, format!("should read `acm-memory {FORMAT}`, reads `{}`", text.trim())))
                }
            }
        }
        Err(source) if source.kind() == io::ErrorKind::NotFound => {
            if dir.join("events.log").exists() {
                return Err(record_error(&path, 0, "the file is missing beside a log: its format is not known".into()));
            }
            let text = format!("acm-memory {FORMAT}\n");
            let write = File::create(&path).and_then(|mut file| file.write_all(text.as_bytes()).and(file.sync_all()));
            write.map_err(|source| io_error(&path, source))
        }
        Err(source) => Err(io_error(&path, source)),
    }
}

fn sync_folder(dir: &Path) -> Result<(), MemoryError> {
    // A new or renamed file survives a power failure only when its folder is on disk too.
    File::open(dir).and_then(|folder| folder.sync_all()).map_err(|source| io_error(dir, source))
}

fn io_error(path: &Path, source: io::Error) -> MemoryError {
    MemoryError::Io { path: path.into(), source }
}

fn record_error(path: &Path, record: u64, reason: String) -> MemoryError {
    MemoryError::Record { path: path.into(), record, reason }
}
