//! The files of one folder, behind a trait, so that tests can stand a failing disk in their place.

use crate::map::Map;
use std::{
    collections::BTreeMap,
    fs::{self, File, OpenOptions, TryLockError},
    io::{self, Write},
    path::{Path, PathBuf},
};

/// What the engine needs of a folder. Nothing is durable before `sync`, or `sync_folder` for names.
pub trait Disk: Send {
    /// Names of all files, in order.
    fn list(&self) -> io::Result<Vec<String>>;
    /// All bytes of a file.
    fn map(&self, name: &str) -> io::Result<Map>;
    /// Makes an empty file, or empties it.
    fn create(&mut self, name: &str) -> io::Result<()>;
    /// Adds bytes at a file's end.
    fn append(&mut self, name: &str, bytes: &[u8]) -> io::Result<()>;
    /// Shortens a file.
    fn truncate(&mut self, name: &str, length: u64) -> io::Result<()>;
    /// Brings a file's bytes and length to the disk.
    fn sync(&mut self, name: &str) -> io::Result<()>;
    /// Gives a file another name, in place of what had it.
    fn rename(&mut self, from: &str, to: &str) -> io::Result<()>;
    /// Removes a file.
    fn remove(&mut self, name: &str) -> io::Result<()>;
    /// Brings names to the disk.
    fn sync_folder(&mut self) -> io::Result<()>;
}

/// A real folder with its lock. One process writes.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    open: BTreeMap<String, File>,
    // Held for its lock only.
    _lock: Option<File>,
}

/// Name of the file that a writer locks. It stays behind.
pub const LOCK: &str = "lock";

impl Folder {
    /// Makes the folder if need be and takes its lock; `WouldBlock` if another process has it.
    pub fn lock(path: &Path) -> io::Result<Folder> {
        fs::create_dir_all(path)?;
        let lock = OpenOptions::new().write(true).create(true).truncate(false).open(path.join(LOCK))?;
        match lock.try_lock() {
            Ok(()) => Ok(Folder { path: path.into(), open: BTreeMap::new(), _lock: Some(lock) }),
            Err(TryLockError::WouldBlock) => Err(io::ErrorKind::WouldBlock.into()),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }
    fn file(&mut self, name: &str) -> io::Result<&mut File> {
        if !self.open.contains_key(name) {
            let file = OpenOptions::new().read(true).append(true).open(self.path.join(name))?;
            self.open.insert(name.into(), file);
        }
        self.open.get_mut(name).ok_or_else(|| io::ErrorKind::NotFound.into())
    }
}

impl Disk for Folder {
    fn list(&self) -> io::Result<Vec<String>> {
        let mut names = Vec::new();
        for entry in fs::read_dir(&self.path)? {
            names.extend(entry?.file_name().into_string().ok());
        }
        names.sort();
        Ok(names)
    }
    fn map(&self, name: &str) -> io::Result<Map> {
        let mut file = File::open(self.path.join(name))?;
        if name.ends_with(".snapshot") {
            return Map::of_file(&file);
        }
        // What is written on is copied, never mapped.
        let length = usize::try_from(file.metadata()?.len()).map_err(|_too_large| io::ErrorKind::FileTooLarge)?;
        Map::of_reader(&mut file, length)
    }
    fn create(&mut self, name: &str) -> io::Result<()> {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(true).open(self.path.join(name))?;
        drop(file);
        self.open.remove(name);
        Ok(())
    }
    fn append(&mut self, name: &str, bytes: &[u8]) -> io::Result<()> {
        self.file(name)?.write_all(bytes)
    }
    fn truncate(&mut self, name: &str, length: u64) -> io::Result<()> {
        self.file(name)?.set_len(length)
    }
    fn sync(&mut self, name: &str) -> io::Result<()> {
        self.file(name)?.sync_data()
    }
    fn rename(&mut self, from: &str, to: &str) -> io::Result<()> {
        self.open.remove(to);
        if let Some(file) = self.open.remove(from) {
            self.open.insert(to.into(), file);
        }
        fs::rename(self.path.join(from), self.path.join(to))
    }
    fn remove(&mut self, name: &str) -> io::Result<()> {
        self.open.remove(name);
        fs::remove_file(self.path.join(name))
    }
    fn sync_folder(&mut self) -> io::Result<()> {
        File::open(&self.path)?.sync_all()
    }
}

/// A folder in memory that never fails: for a memory that ends with its process.
#[derive(Debug, Default)]
pub struct Volatile(BTreeMap<String, Vec<u8>>);

impl Volatile {
    /// Puts a file there whole.
    pub(crate) fn put(&mut self, name: String, bytes: Vec<u8>) {
        self.0.insert(name, bytes);
    }
    fn file(&mut self, name: &str) -> io::Result<&mut Vec<u8>> {
        self.0.get_mut(name).ok_or_else(|| io::ErrorKind::NotFound.into())
    }
}

impl Disk for Volatile {
    fn list(&self) -> io::Result<Vec<String>> {
        Ok(self.0.keys().cloned().collect())
    }
    fn map(&self, name: &str) -> io::Result<Map> {
        self.0.get(name).map(|bytes| Map::of_bytes(bytes)).ok_or_else(|| io::ErrorKind::NotFound.into())
    }
    fn create(&mut self, name: &str) -> io::Result<()> {
        self.0.insert(name.into(), Vec::new());
        Ok(())
    }
    fn append(&mut self, name: &str, bytes: &[u8]) -> io::Result<()> {
        self.file(name)?.extend_from_slice(bytes);
        Ok(())
    }
    fn truncate(&mut self, name: &str, length: u64) -> io::Result<()> {
        self.file(name)?.truncate(usize::try_from(length).unwrap_or(usize::MAX));
        Ok(())
    }
    fn sync(&mut self, _name: &str) -> io::Result<()> {
        Ok(())
    }
    fn rename(&mut self, from: &str, to: &str) -> io::Result<()> {
        let bytes = self.0.remove(from).ok_or(io::ErrorKind::NotFound)?;
        self.0.insert(to.into(), bytes);
        Ok(())
    }
    fn remove(&mut self, name: &str) -> io::Result<()> {
        self.0.remove(name).map(drop).ok_or_else(|| io::ErrorKind::NotFound.into())
    }
    fn sync_folder(&mut self) -> io::Result<()> {
        Ok(())
    }
}
