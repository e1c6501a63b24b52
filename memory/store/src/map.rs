//! Bytes of a file, read where they lie. The one place of this crate with an unsafe call.

use bytemuck::Pod;
use std::{fs::File, io};

/// The bytes of one file, at an address that is a multiple of 16.
#[derive(Debug)]
pub struct Map(Bytes);

#[derive(Debug)]
enum Bytes {
    Mapped(memmap2::Mmap),
    Owned(Vec<u128>, usize),
}

impl Map {
    /// Maps a file that nobody writes any more: snapshots are written beside, synchronised, and renamed into place.
    pub fn of_file(file: &File) -> io::Result<Map> {
        if file.metadata()?.len() == 0 {
            return Ok(Map::of_bytes(&[]));
        }
        #[allow(
            unsafe_code,
            reason = "a mapped file is plain memory as long as nobody shortens it; ours are never written again"
        )]
        // SAFETY: the mapping is private and read-only, and the file is never changed after its rename.
        let map = unsafe { memmap2::Mmap::map(file)? };
        Ok(Map(Bytes::Mapped(map)))
    }
    /// A copy of bytes.
    pub fn of_bytes(bytes: &[u8]) -> Map {
        let mut words = vec![0u128; bytes.len().div_ceil(16)];
        if let Some(place) = bytemuck::cast_slice_mut::<u128, u8>(&mut words).get_mut(..bytes.len()) {
            place.copy_from_slice(bytes);
        }
        Map(Bytes::Owned(words, bytes.len()))
    }
    /// A copy of a file that is written on, or of its first bytes.
    pub fn of_reader(file: &mut impl std::io::Read, length: usize) -> io::Result<Map> {
        let mut words = vec![0u128; length.div_ceil(16)];
        if let Some(place) = bytemuck::cast_slice_mut::<u128, u8>(&mut words).get_mut(..length) {
            file.read_exact(place)?;
        }
        Ok(Map(Bytes::Owned(words, length)))
    }
    /// All bytes.
    pub fn bytes(&self) -> &[u8] {
        match &self.0 {
            Bytes::Mapped(map) => map,
            Bytes::Owned(words, length) => bytemuck::cast_slice::<u128, u8>(words).get(..*length).unwrap_or_default(),
        }
    }
    /// `count` values that begin at a byte; `None` where they do not fit.
    pub fn slice<T: Pod>(&self, at: usize, count: usize) -> Option<&[T]> {
        let length = count.checked_mul(size_of::<T>())?;
        bytemuck::try_cast_slice(self.bytes().get(at..at.checked_add(length)?)?).ok()
    }
}
