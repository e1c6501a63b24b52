//! Changes object by object: what is side by side needs no pointer, and the few moments and values that do not fit stand in
//! a pool of words.

use crate::{cow::Run, history::Key};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Marks a value whose words stand in the pool, where its key alone does not tell.
pub const WIDE: u32 = 1 << 31;

/// One change of a chain: 12 bytes, and 12 more where its value has three words, 4 to 8 where its moment is not that of its
/// commit.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Packed {
    /// Sequence number of the event.
    pub sequence: u32,
    /// The new value, by key; or where it is in the pool.
    pub value: u32,
    /// What changed.
    pub key: Key,
    /// Source and confidence.
    pub origin: [u8; 2],
}

/// All chains, one behind the other, each in the order in which its changes came to be known.
#[derive(Debug, Clone, Default)]
pub struct Chains {
    /// The changes.
    pub packed: Arc<Run<Packed>>,
    /// Words of wide values, and before them how many microseconds earlier than its commit a change was so.
    pub pool: Arc<Run<u32>>,
    /// One bit a change: it is the first of its chain.
    pub starts: Arc<Run<u64>>,
    /// One bit a change: the pool has its moment.
    pub timed: Arc<Run<u64>>,
}

fn bit(bits: &Run<u64>, at: usize) -> bool {
    bits.get().get(at / 64).is_some_and(|word| word >> (at % 64) & 1 == 1)
}

impl Chains {
    /// How many changes there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.packed.get().len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// One of them.
    #[inline]
    pub fn get(&self, at: usize) -> Option<&Packed> {
        self.packed.get().get(at)
    }
    /// Whether a change is the first of its chain.
    #[inline]
    pub fn starts(&self, at: usize) -> bool {
        bit(&self.starts, at)
    }
    /// How many microseconds before its commit a change was so.
    #[inline]
    pub fn earlier_us(&self, at: usize, packed: &Packed) -> u32 {
        if !bit(&self.timed, at) {
            return 0;
        }
        self.pool.get().get((packed.value & !WIDE) as usize).copied().unwrap_or(0)
    }
    /// The value of a change; `may_be_wide` says that its key has values of three words.
    #[inline]
    pub fn value(&self, at: usize, packed: &Packed, may_be_wide: bool) -> [u32; 3] {
        let (timed, wide) = (bit(&self.timed, at), may_be_wide && packed.value & WIDE != 0);
        if !timed && !wide {
            return [packed.value, 0, 0];
        }
        let at = (packed.value & !WIDE) as usize + usize::from(timed);
        let words = self.pool.get().get(at..).unwrap_or_default();
        if wide {
            words.first_chunk().copied().unwrap_or_default()
        } else {
            [words.first().copied().unwrap_or_default(), 0, 0]
        }
    }
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.packed.get())
            + size_of_val(self.pool.get())
            + size_of_val(self.starts.get())
            + size_of_val(self.timed.get())
    }
}

/// Chains in the making.
#[derive(Debug)]
pub struct Builder {
    packed: Vec<Packed>,
    pool: Vec<u32>,
    starts: Vec<u64>,
    timed: Vec<u64>,
}

impl Builder {
    /// Room for so many changes and words of the pool.
    pub fn new(changes: usize, words: usize) -> Builder {
        let bits = vec![0; changes.div_ceil(64)];
        Builder {
            packed: vec![Zeroable::zeroed(); changes],
            pool: Vec::with_capacity(words),
            starts: bits.clone(),
            timed: bits,
        }
    }
    /// Puts a change in its place. Each place is written once.
    pub fn put(&mut self, at: usize, change: Packed, earlier_us: u32, value: [u32; 3], wide: bool, first: bool) {
        let Some(place) = self.packed.get_mut(at) else { return };
        let mut put = Packed { value: value[0], ..change };
        if wide || earlier_us > 0 {
            put.value = self.pool.len() as u32 | if wide { WIDE } else { 0 };
            self.pool.extend((earlier_us > 0).then_some(earlier_us));
            self.pool.extend_from_slice(&value[..if wide { 3 } else { 1 }]);
        }
        *place = put;
        let set = |bits: &mut Vec<u64>, on: bool| {
            if let Some(word) = bits.get_mut(at / 64) {
                *word |= u64::from(on) << (at % 64);
            }
        };
        set(&mut self.starts, first);
        set(&mut self.timed, earlier_us > 0);
    }
    /// The chains.
    pub fn finish(self) -> Chains {
        Chains {
            packed: Arc::new(Run::Owned(self.packed)),
            pool: Arc::new(Run::Owned(self.pool)),
            starts: Arc::new(Run::Owned(self.starts)),
            timed: Arc::new(Run::Owned(self.timed)),
        }
    }
}
