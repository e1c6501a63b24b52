//! 256 ids: where each object's row is, what is seldom asked, and its parts.

use crate::{
    NONE, Nanos,
    block::ROWS,
    cow::{Run, Stored},
    event::Part,
};
use bytemuck::{Pod, Zeroable};

/// The object was put at least once.
pub const KNOWN: u8 = 1;
/// Some of its changes came later than changes of later moments. A property's value from the beginning, which is written down
/// when it first changes, is not meant: no change of that property comes before it.
pub const DISORDERED: u8 = 2;

/// What is kept by id, side by side: whoever asks for one of an object's numbers mostly asks for others too.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Head {
    /// Since when the object is there.
    pub born: Nanos,
    /// The latest moment of which something is known of it.
    pub latest: Nanos,
    /// Its row; [`NONE`] while it is not there.
    pub row: u32,
    /// Sequence number of the event that first put it.
    pub first: u32,
    /// The last of its changes, 1 + index; 0 for none.
    pub last: u32,
    /// Rotation: the vector part of its unit quaternion.
    pub rotation: [f32; 3],
    /// Which properties have changed since it was put, as far as 16 bits tell.
    pub touched: u16,
    /// Source and confidence of the event that first put it.
    pub origin: [u8; 2],
    /// [`KNOWN`], [`DISORDERED`].
    pub flags: u8,
    /// Zeros, so that no byte is left out.
    pub padding: [u8; 3],
}

/// 256 ids.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Heads {
    /// One an id.
    pub of: [Head; ROWS],
    /// Numbers of parts, which are summed up to find an object's.
    pub parts: [u8; ROWS],
}

/// Columns and parts.
#[derive(Debug, Clone)]
pub struct Page {
    /// The columns.
    pub heads: Stored<Heads>,
    /// Parts of all objects, in the order of their ids.
    pub parts: Run<Part>,
}

impl Page {
    /// A page of ids that were never given.
    pub fn empty() -> Page {
        let mut heads: Box<Heads> = Box::new(Zeroable::zeroed());
        heads.of.iter_mut().for_each(|head| head.row = NONE);
        Page { heads: Stored::Owned(heads), parts: Run::default() }
    }
    fn span(&self, at: usize) -> (usize, usize) {
        let counts = &self.heads.get().parts;
        let start = counts.iter().take(at).map(|n| usize::from(*n)).sum();
        (start, start + usize::from(counts[at % ROWS]))
    }
    /// The parts of one object.
    pub fn parts_of(&self, at: usize) -> &[Part] {
        let (start, end) = self.span(at);
        self.parts.get().get(start..end).unwrap_or_default()
    }
    /// Gives an object other parts.
    pub fn set_parts(&mut self, at: usize, parts: &[Part]) {
        let (start, end) = self.span(at);
        let all = self.parts.get_mut();
        if start == all.len() {
            all.extend_from_slice(parts);
        } else {
            all.splice(start..end, parts.iter().copied());
        }
        self.heads.get_mut().parts[at % ROWS] = parts.len() as u8;
    }
}
