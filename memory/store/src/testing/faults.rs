//! A disk in memory that loses power: what was not synchronised is there, is not there, or is there in part.

use crate::{disk::Disk, map::Map, testing::Draw};
use std::{
    collections::BTreeMap,
    io,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

const SECTOR: usize = 512;

#[derive(Debug, Clone, Default)]
struct FileState {
    /// As the program sees it.
    seen: Vec<u8>,
    /// As it is on disk for sure.
    durable: Vec<u8>,
}

#[derive(Debug, Default)]
struct Inner {
    files: BTreeMap<u64, FileState>,
    /// Names as the program sees them, and as they are on disk for sure.
    seen: BTreeMap<String, u64>,
    durable: BTreeMap<String, u64>,
    next: u64,
    operations: u64,
    /// The operation at which the power fails.
    fails_at: Option<u64>,
    dead: bool,
}

/// The disk. Clones are the same disk.
#[derive(Debug, Clone, Default)]
pub struct FaultDisk(Arc<Mutex<Inner>>);

impl FaultDisk {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
    /// Operations so far that change something.
    pub fn operations(&self) -> u64 {
        self.inner().operations
    }
    /// The power fails at the operation with this number: it is done in part, and nothing after it.
    pub fn fail_at(&self, operation: u64) {
        self.inner().fails_at = Some(operation);
    }
    /// Power comes back. Each block of 512 bytes that was written and not synchronised is on disk or not, as `draw` has it;
    /// so is each name, in the order in which names changed.
    pub fn restart(&self, draw: &mut Draw) -> FaultDisk {
        let mut inner = self.inner();
        let mut fresh = Inner { next: inner.next, ..Inner::default() };
        // Names reach the disk in order or not at all.
        fresh.seen = if draw.chance(0.5) { inner.seen.clone() } else { inner.durable.clone() };
        for number in fresh.seen.values() {
            let file = inner.files.entry(*number).or_default();
            fresh.files.insert(*number, survivor(file, draw));
        }
        for file in fresh.files.values_mut() {
            file.durable = file.seen.clone();
        }
        fresh.durable = fresh.seen.clone();
        FaultDisk(Arc::new(Mutex::new(fresh)))
    }
    /// Spoils one bit of what is on disk.
    pub fn flip(&self, name: &str, byte: usize, bit: u8) {
        let mut inner = self.inner();
        if let Some(number) = inner.seen.get(name).copied()
            && let Some(place) = inner.files.get_mut(&number).and_then(|file| file.seen.get_mut(byte))
        {
            *place ^= 1 << (bit % 8);
        }
    }
    /// All bytes of all files.
    pub fn bytes(&self) -> Vec<u8> {
        let inner = self.inner();
        inner.seen.values().filter_map(|number| inner.files.get(number)).flat_map(|file| file.seen.clone()).collect()
    }
    /// Puts bytes into a file, past all rules.
    pub fn overwrite(&self, name: &str, edit: impl FnOnce(&mut Vec<u8>)) {
        let mut inner = self.inner();
        if let Some(number) = inner.seen.get(name).copied()
            && let Some(file) = inner.files.get_mut(&number)
        {
            edit(&mut file.seen);
            file.durable = file.seen.clone();
        }
    }
}

/// A file after the power failed: its length lies between the two, and each block that differs is the old or the new.
fn survivor(file: &FileState, draw: &mut Draw) -> FileState {
    let (old, new) = (&file.durable, &file.seen);
    let (short, long) = (old.len().min(new.len()), old.len().max(new.len()));
    let length = match draw.below(4) {
        0 => old.len(),
        1 => new.len(),
        _ => short + draw.below(long - short + 1),
    };
    let mut bytes = vec![0u8; length];
    for (number, block) in bytes.chunks_mut(SECTOR).enumerate() {
        let at = number * SECTOR;
        let same = old.get(at..at + block.len()) == new.get(at..at + block.len());
        let from = if same || draw.chance(0.5) { new } else { old };
        let part = from.get(at..).unwrap_or_default();
        let count = part.len().min(block.len());
        block[..count].copy_from_slice(&part[..count]);
    }
    FileState { durable: bytes.clone(), seen: bytes }
}

fn dead() -> io::Error {
    io::Error::other("the power failed")
}

impl Inner {
    /// Counts an operation; `Ok(false)`: it is the one at which the power fails.
    fn operation(&mut self) -> io::Result<bool> {
        if self.dead {
            return Err(dead());
        }
        self.operations += 1;
        self.dead = self.fails_at.is_some_and(|at| self.operations > at);
        Ok(!self.dead)
    }
    fn file(&mut self, name: &str) -> io::Result<&mut FileState> {
        let number = self.seen.get(name).ok_or(io::ErrorKind::NotFound)?;
        self.files.get_mut(number).ok_or_else(|| io::ErrorKind::NotFound.into())
    }
}

impl Disk for FaultDisk {
    fn list(&self) -> io::Result<Vec<String>> {
        Ok(self.inner().seen.keys().cloned().collect())
    }
    fn map(&self, name: &str) -> io::Result<Map> {
        let mut inner = self.inner();
        if inner.dead {
            return Err(dead());
        }
        inner.file(name).map(|file| Map::of_bytes(&file.seen))
    }
    fn create(&mut self, name: &str) -> io::Result<()> {
        let mut inner = self.inner();
        let alive = inner.operation()?;
        inner.next += 1;
        let number = inner.next;
        inner.files.insert(number, FileState::default());
        inner.seen.insert(name.into(), number);
        if alive { Ok(()) } else { Err(dead()) }
    }
    fn append(&mut self, name: &str, bytes: &[u8]) -> io::Result<()> {
        let mut inner = self.inner();
        let alive = inner.operation()?;
        // A write that the power failure cuts may have come to any byte.
        inner.file(name)?.seen.extend_from_slice(bytes);
        if alive { Ok(()) } else { Err(dead()) }
    }
    fn truncate(&mut self, name: &str, length: u64) -> io::Result<()> {
        let mut inner = self.inner();
        let alive = inner.operation()?;
        inner.file(name)?.seen.truncate(length as usize);
        if alive { Ok(()) } else { Err(dead()) }
    }
    fn sync(&mut self, name: &str) -> io::Result<()> {
        let mut inner = self.inner();
        if !inner.operation()? {
            return Err(dead());
        }
        let file = inner.file(name)?;
        file.durable = file.seen.clone();
        Ok(())
    }
    fn rename(&mut self, from: &str, to: &str) -> io::Result<()> {
        let mut inner = self.inner();
        let alive = inner.operation()?;
        let number = inner.seen.remove(from).ok_or(io::ErrorKind::NotFound)?;
        inner.seen.insert(to.into(), number);
        if alive { Ok(()) } else { Err(dead()) }
    }
    fn remove(&mut self, name: &str) -> io::Result<()> {
        let mut inner = self.inner();
        let alive = inner.operation()?;
        inner.seen.remove(name).ok_or(io::ErrorKind::NotFound)?;
        if alive { Ok(()) } else { Err(dead()) }
    }
    fn sync_folder(&mut self) -> io::Result<()> {
        let mut inner = self.inner();
        if !inner.operation()? {
            return Err(dead());
        }
        inner.durable = inner.seen.clone();
        Ok(())
    }
}
