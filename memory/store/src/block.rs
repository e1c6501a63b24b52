//! 256 objects: their hot columns, bitsets of what holds of them, and bounds by which a whole block is passed over.

use crate::{
    Id, NONE,
    cow::{Run, Stored},
    symbols::Symbol,
};
use bytemuck::{Pod, Zeroable};

/// Objects of one block.
pub const ROWS: usize = 256;
/// One bit an object.
pub type Mask = [u64; 4];
/// Smallest weight: what is less likely than 1 in a million ranks alike.
pub const LEAST: f32 = -13.8;

/// The columns that queries read.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Hot {
    /// Ids.
    pub id: [Id; ROWS],
    /// Positions, metres.
    pub x: [f32; ROWS],
    /// See `x`.
    pub y: [f32; ROWS],
    /// See `x`.
    pub z: [f32; ROWS],
    /// Logarithm of the confidence, at least [`LEAST`].
    pub weight: [f32; ROWS],
    /// Categories.
    pub category: [Symbol; ROWS],
    /// Regions.
    pub region: [Symbol; ROWS],
    /// Which rows hold an object.
    pub live: Mask,
    /// Bounds of all positions that the block ever had.
    pub bounds: Bounds,
    /// Rows in use, dead ones with them.
    pub length: u32,
    /// Zeros, so that no byte is left out.
    pub padding: [u32; 2],
}

/// A box of positions and the largest weight in it; what a score can reach at most.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// Smallest coordinates, metres.
    pub min: [f32; 3],
    /// Largest coordinates, metres.
    pub max: [f32; 3],
    /// Largest weight.
    pub weight: f32,
}

impl Bounds {
    /// Of nothing.
    pub const EMPTY: Bounds =
        Bounds { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3], weight: f32::NEG_INFINITY };

    /// Takes in a position with a weight.
    #[inline]
    pub fn add(&mut self, position: [f32; 3], weight: f32) {
        for ((min, max), value) in self.min.iter_mut().zip(&mut self.max).zip(position) {
            *min = min.min(value);
            *max = max.max(value);
        }
        self.weight = self.weight.max(weight);
    }
    /// Takes in another box.
    pub fn join(&mut self, other: &Bounds) {
        for ((min, max), (a, b)) in self.min.iter_mut().zip(&mut self.max).zip(other.min.iter().zip(&other.max)) {
            *min = min.min(*a);
            *max = max.max(*b);
        }
        self.weight = self.weight.max(other.weight);
    }
    /// Smallest distance from a point, metres.
    #[inline]
    pub fn distance(&self, point: [f32; 3]) -> f32 {
        let mut sum = 0.0;
        for ((min, max), value) in self.min.iter().zip(&self.max).zip(point) {
            let outside = (min - value).max(value - max).max(0.0);
            sum += outside * outside;
        }
        sum.sqrt()
    }
}

/// Columns and bitsets.
#[derive(Debug, Clone)]
pub struct Block {
    /// The columns.
    pub hot: Stored<Hot>,
    /// The bitsets.
    pub bits: Bits,
}

impl Block {
    /// A block without objects.
    pub fn empty() -> Block {
        let mut hot: Box<Hot> = Box::new(Zeroable::zeroed());
        hot.bounds = Bounds::EMPTY;
        hot.id = [NONE; ROWS];
        Block { hot: Stored::Owned(hot), bits: Bits::default() }
    }
    /// A row's position.
    #[inline]
    pub fn position(&self, row: usize) -> [f32; 3] {
        let hot = self.hot.get();
        let row = row % ROWS;
        [hot.x[row], hot.y[row], hot.z[row]]
    }
}

/// For every set that has a member in the block, one bit a row.
#[derive(Debug, Clone, Default)]
pub struct Bits {
    /// By the set's number: 1 + where its words are; 0 for a set without members.
    pub slots: Run<u16>,
    /// The words.
    pub words: Run<Mask>,
}

impl Bits {
    /// The members of a set.
    #[inline]
    pub fn get(&self, set: u16) -> Mask {
        match self.slots.get().get(usize::from(set)) {
            Some(&slot) if slot > 0 => self.words.get().get(usize::from(slot) - 1).copied().unwrap_or_default(),
            _ => [0; 4],
        }
    }
    /// Whether a row is in a set.
    #[inline]
    pub fn has(&self, set: u16, row: usize) -> bool {
        let mask = self.get(set);
        mask[(row / 64) % 4] >> (row % 64) & 1 == 1
    }
    /// Puts a row into a set or takes it out.
    pub fn put(&mut self, set: u16, row: usize, member: bool) {
        let at = usize::from(set);
        let known = self.slots.get().get(at).copied().unwrap_or(0);
        if known == 0 && !member || set == 0 {
            return;
        }
        let slot = if known > 0 {
            known
        } else {
            let slots = self.slots.get_mut();
            if slots.len() <= at {
                slots.resize(at + 1, 0);
            }
            let words = self.words.get_mut();
            words.push([0; 4]);
            let slot = words.len() as u16;
            slots[at] = slot;
            slot
        };
        if let Some(mask) = self.words.get_mut().get_mut(usize::from(slot) - 1) {
            let bit = 1u64 << (row % 64);
            let word = &mut mask[(row / 64) % 4];
            *word = if member { *word | bit } else { *word & !bit };
        }
    }
    /// Takes a row out of all sets.
    pub fn clear(&mut self, row: usize) {
        let bit = 1u64 << (row % 64);
        for mask in self.words.get_mut() {
            mask[(row / 64) % 4] &= !bit;
        }
    }
    /// The sets that a row is in.
    pub fn of_row(&self, row: usize) -> impl Iterator<Item = u16> {
        (0u16..).zip(self.slots.get()).filter(move |(set, slot)| **slot > 0 && self.has(*set, row)).map(|(set, _)| set)
    }
    /// The sets with members, with their words.
    pub fn sets(&self) -> impl Iterator<Item = (u16, Mask)> {
        let words = self.words.get();
        let present = (0u16..).zip(self.slots.get()).filter(|(_, slot)| **slot > 0);
        present.filter_map(move |(set, slot)| Some((set, *words.get(usize::from(*slot) - 1)?)))
    }
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        2 * self.slots.get().len() + 32 * self.words.get().len()
    }
}

/// The rows whose bit is set.
#[inline]
pub fn rows(mask: Mask) -> impl Iterator<Item = usize> {
    mask.into_iter().enumerate().flat_map(|(word, mut bits)| {
        std::iter::from_fn(move || {
            if bits == 0 {
                return None;
            }
            let row = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            Some(64 * word + row)
        })
    })
}

/// The rows from `first` up to but not with `end`.
pub fn span(first: usize, end: usize) -> Mask {
    let mut mask = [0; 4];
    for (word, bits) in mask.iter_mut().enumerate() {
        let (low, high) =
            (first.clamp(64 * word, 64 * word + 64) - 64 * word, end.clamp(64 * word, 64 * word + 64) - 64 * word);
        if low < high {
            let ones = if high - low == 64 { u64::MAX } else { (1u64 << (high - low)) - 1 };
            *bits = ones << low;
        }
    }
    mask
}

/// Both.
#[inline]
pub fn and(a: Mask, b: Mask) -> Mask {
    [a[0] & b[0], a[1] & b[1], a[2] & b[2], a[3] & b[3]]
}
/// The first without the second.
#[inline]
pub fn without(a: Mask, b: Mask) -> Mask {
    [a[0] & !b[0], a[1] & !b[1], a[2] & !b[2], a[3] & !b[3]]
}
/// How many.
#[inline]
pub fn count(mask: Mask) -> u32 {
    mask.iter().map(|word| word.count_ones()).sum()
}
