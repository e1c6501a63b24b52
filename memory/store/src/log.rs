//! The log: segments of records. A batch is its events and a commit; it is there as a whole or not at all.
//!
//! A record is `length: u32 | check: u32 | kind: u8 | body`, little endian. `length` counts kind and body; `check` is
//! the CRC-32C of the record's sequence number, the length, the kind and the body, so that a record in another one's
//! place is found as well as a wrong bit. A batch begins on a multiple of 512 bytes: no write touches a disk block that
//! holds what was acknowledged before.

use crate::{Nanos, disk::Disk};
use std::io;

/// Largest kind and body of one record, bytes.
pub const MAX_RECORD_BYTES: usize = 8 << 20;
/// A segment that is larger is followed by the next, bytes.
pub const SEGMENT_BYTES: u64 = 64 << 20;
/// Size of the blocks that a disk writes whole, bytes.
pub const SECTOR: usize = 512;
const HEAD: usize = 9;
const MAGIC: &[u8; 8] = b"ACM-LOG2";
const EVENT: u8 = 1;
const COMMIT: u8 = 2;
/// The end of a part of a batch that was known earlier than the whole of it: number of the next event and time.
const MARK: u8 = 3;
const COMMIT_BODY: usize = 28;

/// Name of a segment.
pub fn name(number: u64) -> String {
    format!("log-{number:08}")
}
/// The number of a segment by its name.
pub fn number(name: &str) -> Option<u64> {
    name.strip_prefix("log-")?.parse().ok()
}

/// The end of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Commit {
    /// Number of the batch, from 0.
    pub batch: u64,
    /// Sequence number of the first event after it.
    pub next: u64,
    /// When it came to be known.
    pub time: Nanos,
    /// How many events it has.
    pub events: u32,
}

/// Adds a batch's records to `out`, which begins at a multiple of [`SECTOR`].
#[derive(Debug, Default)]
pub struct Batch {
    bytes: Vec<u8>,
    events: u32,
    /// Events up to the last mark.
    before: u32,
}

impl Batch {
    /// Adds an event with the given sequence number; `false` if it is larger than a record may be.
    #[must_use]
    pub fn event(&mut self, sequence: u64, write: impl FnOnce(&mut Vec<u8>)) -> bool {
        let fits = record(EVENT, sequence, write, &mut self.bytes);
        self.events += u32::from(fits);
        fits
    }
    /// Ends a part of the batch; another follows that is written with it.
    pub fn mark(&mut self, next: u64, time: Nanos) {
        self.before = self.events;
        let fits = record(MARK, next, |out| out.extend_from_slice(&time.to_le_bytes()), &mut self.bytes);
        debug_assert!(fits, "a mark has a fixed size below the limit");
    }
    /// Ends the batch.
    pub fn commit(&mut self, batch: u64, next: u64, time: Nanos) {
        let events = std::mem::take(&mut self.events);
        self.before = 0;
        let body = |out: &mut Vec<u8>| {
            out.extend_from_slice(&batch.to_le_bytes());
            out.extend_from_slice(&next.to_le_bytes());
            out.extend_from_slice(&time.to_le_bytes());
            out.extend_from_slice(&events.to_le_bytes());
        };
        let fits = record(COMMIT, next, body, &mut self.bytes);
        debug_assert!(fits, "a commit has a fixed size below the limit");
        self.bytes.resize(self.bytes.len().next_multiple_of(SECTOR), 0);
    }
    /// Drops what was added behind the first so many bytes: parts of a batch that was refused.
    pub fn cut(&mut self, length: usize) {
        self.bytes.truncate(length);
        self.events = self.before;
    }
    /// The records so far.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
    /// Drops what was added, so that the memory is used again.
    pub fn clear(&mut self) {
        self.bytes.clear();
        (self.events, self.before) = (0, 0);
    }
}

fn record(kind: u8, sequence: u64, write: impl FnOnce(&mut Vec<u8>), out: &mut Vec<u8>) -> bool {
    let at = out.len();
    out.extend_from_slice(&[0; 8]);
    out.push(kind);
    write(out);
    let size = out.len() - at - 8;
    if size > MAX_RECORD_BYTES {
        out.truncate(at);
        return false;
    }
    if let Some(length) = out.get_mut(at..at + 4) {
        length.copy_from_slice(&(size as u32).to_le_bytes());
    }
    let check = out.get(at..).map_or(0, |record| checksum(sequence, record));
    if let Some(place) = out.get_mut(at + 4..at + 8) {
        place.copy_from_slice(&check.to_le_bytes());
    }
    true
}

fn checksum(sequence: u64, record: &[u8]) -> u32 {
    let (length, rest) = (record.get(..4).unwrap_or_default(), record.get(8..).unwrap_or_default());
    let seed = crc32c::crc32c_append(crc32c::crc32c(&sequence.to_le_bytes()), length);
    crc32c::crc32c_append(seed, rest)
}

enum Record<'a> {
    Event(&'a [u8]),
    Mark(Nanos),
    Commit(Commit),
}

fn read<'a>(bytes: &'a [u8], sequence: Option<u64>) -> Option<(Record<'a>, usize)> {
    let size = u32::from_le_bytes(*bytes.first_chunk::<4>()?) as usize;
    if size == 0 || size > MAX_RECORD_BYTES {
        return None;
    }
    let check = u32::from_le_bytes(*bytes.get(4..)?.first_chunk::<4>()?);
    let whole = bytes.get(..8 + size)?;
    let (kind, body) = (*whole.get(8)?, whole.get(HEAD..)?);
    let record = match kind {
        EVENT => Record::Event(body),
        MARK => Record::Mark(u64::from_le_bytes(body.try_into().ok()?)),
        COMMIT => {
            let body: &[u8; COMMIT_BODY] = body.try_into().ok()?;
            let number = |at: usize| Some(u64::from_le_bytes(*body.get(at..)?.first_chunk::<8>()?));
            let events = u32::from_le_bytes(*body.get(24..)?.first_chunk::<4>()?);
            Record::Commit(Commit { batch: number(0)?, next: number(8)?, time: number(16)?, events })
        }
        _ => return None,
    };
    let sequence = match (&record, sequence) {
        (_, Some(sequence)) => sequence,
        (Record::Commit(commit), None) => commit.next,
        (Record::Event(_) | Record::Mark(_), None) => return None,
    };
    (check == checksum(sequence, whole)).then_some((record, 8 + size))
}

/// What goes before a segment's records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Number of the next batch.
    pub batch: u64,
    /// Sequence number of the next event.
    pub next: u64,
}

/// `first` is the number of the first segment of the log that this one belongs to: one that a rewrite left unfinished is
/// told from one that goes on.
fn head(number: u64, first: u64, place: Place) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(number.to_le_bytes());
    bytes.extend(first.to_le_bytes());
    bytes.extend(place.batch.to_le_bytes());
    bytes.extend(place.next.to_le_bytes());
    bytes.extend(crc32c::crc32c(&bytes).to_le_bytes());
    bytes.resize(SECTOR, 0);
    bytes
}

fn read_head(bytes: &[u8], of: u64) -> Option<(u64, Place)> {
    let (sum, check) = bytes.get(..44)?.split_at_checked(40)?;
    let number = |at: usize| Some(u64::from_le_bytes(*sum.get(at..)?.first_chunk::<8>()?));
    let right = sum.starts_with(MAGIC) && crc32c::crc32c(sum).to_le_bytes() == check && number(8)? == of;
    let place = Place { batch: number(24)?, next: number(32)? };
    right.then_some((number(16)?, place))
}

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The operating system's complaint.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// What was acknowledged is damaged.
    #[error("{file}, byte {byte}: {reason}")]
    Damaged {
        /// The segment.
        file: String,
        /// Where in it.
        byte: u64,
        /// What is wrong.
        reason: String,
    },
}

/// The open end of a log.
#[derive(Debug)]
pub struct Log {
    first: u64,
    number: u64,
    length: u64,
    place: Place,
}

impl Log {
    /// Begins a log with its first segment.
    pub fn begin(disk: &mut dyn Disk, number: u64, place: Place) -> io::Result<Log> {
        let mut log = Log { first: number, number, length: 0, place };
        log.next_segment(disk, number)?;
        Ok(log)
    }
    /// Ends the present segment and begins the next.
    pub fn turn(&mut self, disk: &mut dyn Disk) -> io::Result<()> {
        disk.sync(&name(self.number))?;
        self.next_segment(disk, self.number + 1)
    }
    /// The first segment of a folder in memory, where nothing fails.
    pub(crate) fn empty(disk: &mut crate::disk::Volatile) -> Log {
        let place = Place { batch: 0, next: 0 };
        disk.put(name(0), head(0, 0, place));
        Log { first: 0, number: 0, length: SECTOR as u64, place }
    }
    /// Where the next batch goes.
    pub fn place(&self) -> Place {
        self.place
    }
    /// Number of the present segment.
    pub fn segment(&self) -> u64 {
        self.number
    }
    /// Bytes of the present segment.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Reads the committed batches of all segments from `first` on, gives the events of each part with the number of the
    /// first and the time at which they came to be known, and cuts off what was never acknowledged. Batches before `skip`
    /// are passed over. `log_first` is the first segment of the whole log: others are left over from a rewrite.
    pub fn open(
        disk: &mut dyn Disk,
        (log_first, first): (u64, u64),
        skip: Place,
        mut take: impl FnMut(u64, Nanos, &[&[u8]]) -> Result<(), String>,
    ) -> Result<Log, LogError> {
        let mut numbers: Vec<u64> = disk.list()?.iter().filter_map(|name| number(name)).collect();
        numbers.retain(|number| *number >= first);
        numbers.sort_unstable();
        let ours = |number: &u64, disk: &dyn Disk| -> io::Result<bool> {
            Ok(read_head(disk.map(&name(*number))?.bytes(), *number).is_some_and(|(belongs, _)| belongs == log_first))
        };
        let mut end = numbers.len();
        while end > 1 && !ours(&numbers[end - 1], disk)? {
            end -= 1;
        }
        let mut log = Log { first: log_first, number: first, length: 0, place: skip };
        for (index, number) in numbers.iter().enumerate() {
            let file = name(*number);
            let damaged =
                |byte: usize, reason: String| LogError::Damaged { file: file.clone(), byte: byte as u64, reason };
            let last = index + 1 >= end;
            if *number != first + index as u64 {
                return Err(damaged(0, format!("the segment before it, {}, is missing", name(first + index as u64))));
            }
            let map = disk.map(&file)?;
            let bytes = map.bytes();
            let left_over = match read_head(bytes, *number) {
                Some((belongs, _)) => belongs != log_first && index > 0,
                None => last && index > 0 && !has_commit(bytes, 0),
            };
            if left_over {
                drop(map);
                disk.remove(&file)?;
                disk.sync_folder()?;
                continue;
            }
            let Some((_, begin)) = read_head(bytes, *number) else {
                return Err(damaged(0, "the segment's head is damaged".into()));
            };
            if index > 0 && begin != log.place || index == 0 && begin.next > skip.next {
                return Err(damaged(0, format!("it begins at event {}, not at {}", begin.next, log.place.next)));
            }
            log.place = begin;
            let (mut at, mut good, mut batch, mut marks) = (SECTOR, SECTOR, Vec::new(), Vec::new());
            while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty()) {
                let sequence = log.place.next + batch.len() as u64;
                let Some((record, size)) = read(rest, Some(sequence)) else {
                    if !last || is_acknowledged(bytes, good) {
                        let reason = "a wrong checksum, and committed records follow: the file is damaged";
                        return Err(damaged(at, reason.into()));
                    }
                    break;
                };
                at += size;
                match record {
                    Record::Event(body) => batch.push(body),
                    Record::Mark(time) => marks.push((batch.len(), time)),
                    Record::Commit(end) => {
                        let right = end.batch == log.place.batch && end.events as usize == batch.len();
                        if !right {
                            return Err(damaged(
                                at - size,
                                format!("batch {} is not the one that belongs here", end.batch),
                            ));
                        }
                        if end.next > skip.next {
                            marks.push((batch.len(), end.time));
                            let mut from = 0;
                            for (to, time) in marks.iter().copied() {
                                let part = batch.get(from..to).unwrap_or_default();
                                take(log.place.next + from as u64, time, part).map_err(|reason| damaged(at, reason))?;
                                from = to;
                            }
                        }
                        batch.clear();
                        marks.clear();
                        log.place = Place { batch: end.batch + 1, next: end.next };
                        at = at.next_multiple_of(SECTOR).min(bytes.len());
                        good = at;
                    }
                }
            }
            (log.number, log.length) = (*number, good as u64);
            let whole = bytes.len();
            drop(map);
            if good < whole {
                disk.truncate(&file, good as u64)?;
                disk.sync(&file)?;
            }
        }
        if numbers.is_empty() {
            return Err(LogError::Damaged { file: name(first), byte: 0, reason: "the segment is missing".into() });
        }
        if !log.length.is_multiple_of(SECTOR as u64) {
            // The padding behind the last commit did not reach the disk.
            let missing = log.length.next_multiple_of(SECTOR as u64) - log.length;
            disk.append(&name(log.number), &[0; SECTOR][..missing as usize])?;
            log.length += missing;
        }
        Ok(log)
    }

    /// Writes batches that follow [`Log::place`] without synchronising.
    pub fn write(&mut self, disk: &mut dyn Disk, bytes: &[u8], place: Place) -> io::Result<()> {
        if self.length + bytes.len() as u64 > SEGMENT_BYTES && self.length > SECTOR as u64 {
            // What is in the full segment must be on disk before the next one exists.
            self.turn(disk)?;
        }
        disk.append(&name(self.number), bytes)?;
        self.length += bytes.len() as u64;
        self.place = place;
        Ok(())
    }
    /// Brings to disk what was written.
    pub fn sync(&mut self, disk: &mut dyn Disk) -> io::Result<()> {
        disk.sync(&name(self.number))
    }

    fn next_segment(&mut self, disk: &mut dyn Disk, number: u64) -> io::Result<()> {
        let file = name(number);
        disk.create(&file)?;
        disk.append(&file, &head(number, self.first, self.place))?;
        // A head that did not reach the disk has nothing behind it.
        disk.sync(&file)?;
        disk.sync_folder()?;
        (self.number, self.length) = (number, SECTOR as u64);
        Ok(())
    }
}

/// Whether damage after `good` hit what was acknowledged. A commit that follows says so, unless the power failed while
/// that last batch was being written: then a whole disk block of it is zeros.
fn is_acknowledged(bytes: &[u8], good: usize) -> bool {
    let commits: Vec<usize> = commits(bytes, good).collect();
    let Some(last) = commits.last() else { return false };
    let ends_file = (last + HEAD + COMMIT_BODY).next_multiple_of(SECTOR) >= bytes.len();
    let lost = bytes.get(good..).unwrap_or_default().chunks(SECTOR).any(|block| block.iter().all(|&byte| byte == 0));
    !(commits.len() == 1 && ends_file && lost)
}

fn has_commit(bytes: &[u8], from: usize) -> bool {
    commits(bytes, from).next().is_some()
}

fn commits(bytes: &[u8], from: usize) -> impl Iterator<Item = usize> {
    let size = ((COMMIT_BODY + 1) as u32).to_le_bytes();
    let starts = from..bytes.len().saturating_sub(HEAD + COMMIT_BODY - 1);
    starts.filter(move |&at| {
        bytes
            .get(at..)
            .is_some_and(|rest| rest.starts_with(&size) && matches!(read(rest, None), Some((Record::Commit(_), _))))
    })
}
