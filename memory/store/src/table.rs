//! Rows: a sorted base in blocks, ordered by region, category and place, and fresh blocks in the order of arrival.

use crate::{
    Id, NONE,
    block::{self, Block, Bounds, Hot, LEAST, ROWS},
    cow::{Shared, Stored},
    symbols::Symbol,
};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Blocks of one group of bounds.
pub const GROUP: usize = 64;
/// Fresh rows that are never too many.
const FRESH: usize = 4096;

/// A run of rows of the base with one region and category.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Span {
    /// The region.
    pub region: Symbol,
    /// The category.
    pub category: Symbol,
    /// First row.
    pub first: u32,
    /// First row behind it.
    pub end: u32,
}

/// All rows.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// The blocks: base first.
    pub blocks: Shared<Block>,
    /// How many of them are base.
    pub base: usize,
    /// Runs of the base, by region and category.
    pub spans: Arc<Vec<Span>>,
    /// The same runs, by category and region.
    pub by_category: Arc<Vec<Span>>,
    /// Blocks of the base, largest weight first.
    pub order: Arc<Vec<u32>>,
    /// Bounds of each [`GROUP`] blocks of the base.
    pub groups: Arc<Vec<Bounds>>,
    /// By set: one bit for each block of the base that has a member, or had one since the base was sorted.
    pub occupied: Arc<Vec<Vec<u64>>>,
    /// Blocks of the base whose weights rose since they were ordered.
    pub risen: Arc<Vec<u32>>,
    /// Rows of the base that moved or died since it was sorted.
    pub loose: usize,
    /// Objects that are there.
    pub live: usize,
}

/// The weight of a confidence.
pub fn weight(confidence: f32) -> f32 {
    if confidence > 0.0 { confidence.ln().max(LEAST) } else { LEAST }
}

/// What a new row holds.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// The object.
    pub id: Id,
    /// Its category.
    pub category: Symbol,
    /// Its region.
    pub region: Symbol,
    /// Its position, metres.
    pub position: [f32; 3],
    /// Logarithm of its confidence.
    pub weight: f32,
}

impl Table {
    /// A row's block and place in it.
    #[inline]
    pub fn at(&self, row: u32) -> Option<(&Block, usize)> {
        self.blocks.get(row as usize / ROWS).map(|block| (block, row as usize % ROWS))
    }
    /// A row's block, to be written, and its place in it.
    #[inline]
    pub fn at_mut(&mut self, row: u32) -> Option<(&mut Block, usize)> {
        self.blocks.get_mut(row as usize / ROWS).map(|block| (block, row as usize % ROWS))
    }
    /// Puts a row into a set or takes it out.
    pub fn put(&mut self, row: u32, set: u16, member: bool) {
        let number = row as usize / ROWS;
        if let Some((block, at)) = self.at_mut(row) {
            block.bits.put(set, at, member);
        }
        if member && number < self.base && !self.is_occupied(set, number) {
            let occupied = Arc::make_mut(&mut self.occupied);
            if occupied.len() <= usize::from(set) {
                occupied.resize(usize::from(set) + 1, Vec::new());
            }
            if let Some(blocks) = occupied.get_mut(usize::from(set)) {
                blocks.resize(self.base.div_ceil(64), 0);
                blocks[number / 64] |= 1 << (number % 64);
            }
        }
    }
    fn is_occupied(&self, set: u16, number: usize) -> bool {
        let word = self.occupied.get(usize::from(set)).and_then(|blocks| blocks.get(number / 64));
        word.is_some_and(|word| word >> (number % 64) & 1 == 1)
    }
    /// The blocks of the base that have a member of each of the sets, one bit a block.
    pub fn candidates(&self, sets: &[u16]) -> Vec<u64> {
        let mut all = vec![u64::MAX; self.base.div_ceil(64)];
        if let Some(last) = all.last_mut().filter(|_| !self.base.is_multiple_of(64)) {
            *last = (1 << (self.base % 64)) - 1;
        }
        for set in sets {
            let blocks = self.occupied.get(usize::from(*set)).map(Vec::as_slice).unwrap_or_default();
            for (at, word) in all.iter_mut().enumerate() {
                *word &= blocks.get(at).copied().unwrap_or(0);
            }
        }
        all
    }
    /// Adds a row and gives its number.
    pub fn add(&mut self, row: Row) -> u32 {
        let full = |block: &Block| block.hot.get().length as usize >= ROWS;
        let blocks = self.blocks.len();
        if blocks == self.base || self.blocks.get(blocks - 1).is_none_or(full) {
            self.blocks.push(Block::empty());
        }
        let last = self.blocks.len() - 1;
        let Some(block) = self.blocks.get_mut(last) else { return NONE };
        let hot = block.hot.get_mut();
        let at = hot.length as usize % ROWS;
        set(hot, at, row);
        hot.length += 1;
        self.live += 1;
        (last * ROWS + at) as u32
    }
    /// Drops a row.
    pub fn kill(&mut self, row: u32) {
        let in_base = (row as usize) < self.base * ROWS;
        if let Some((block, at)) = self.at_mut(row) {
            let hot = block.hot.get_mut();
            hot.live[at / 64] &= !(1 << (at % 64));
            hot.id[at] = NONE;
            block.bits.clear(at);
            self.live -= 1;
            self.loose += usize::from(in_base);
        }
    }
    /// Moves a row where it is.
    pub fn shift(&mut self, row: u32, position: [f32; 3]) {
        let number = row as usize / ROWS;
        let Some((block, at)) = self.at_mut(row) else { return };
        let hot = block.hot.get_mut();
        (hot.x[at], hot.y[at], hot.z[at]) = (position[0], position[1], position[2]);
        let weight = hot.weight[at];
        hot.bounds.add(position, weight);
        if number < self.base {
            self.loose += 1;
            self.widen(number, position, weight);
        }
    }
    /// Gives a row another weight.
    pub fn weigh(&mut self, row: u32, weight: f32) {
        let number = row as usize / ROWS;
        let Some((block, at)) = self.at_mut(row) else { return };
        let position = block.position(at);
        let hot = block.hot.get_mut();
        hot.weight[at] = weight;
        let rose = weight > hot.bounds.weight;
        hot.bounds.add(position, weight);
        if number < self.base && rose {
            self.widen(number, position, weight);
            if !self.risen.contains(&(number as u32)) {
                Arc::make_mut(&mut self.risen).push(number as u32);
            }
        }
    }
    fn widen(&mut self, number: usize, position: [f32; 3], weight: f32) {
        if let Some(bounds) = self.groups.get(number / GROUP) {
            let mut wider = *bounds;
            wider.add(position, weight);
            if wider != *bounds
                && let Some(bounds) = Arc::make_mut(&mut self.groups).get_mut(number / GROUP)
            {
                *bounds = wider;
            }
        }
    }
    /// Whether so much came, moved or went since the base was sorted that it should be sorted anew.
    pub fn is_loose(&self) -> bool {
        let fresh = (self.blocks.len() - self.base) * ROWS;
        let base = self.base * ROWS;
        fresh > FRESH + base / 64 || self.loose > FRESH + base / 4 || self.risen.len() > 64 + self.base / 16
    }
    /// The run of a region and category.
    pub fn span(&self, region: Symbol, category: Symbol) -> Option<&Span> {
        let at = self.spans.binary_search_by_key(&(region, category), |span| (span.region, span.category)).ok()?;
        self.spans.get(at)
    }
    /// The runs of a region.
    pub fn of_region(&self, region: Symbol) -> &[Span] {
        let first = self.spans.partition_point(|span| span.region < region);
        let end = self.spans.partition_point(|span| span.region <= region);
        self.spans.get(first..end).unwrap_or_default()
    }
    /// The runs of a category.
    pub fn of_category(&self, category: Symbol) -> &[Span] {
        let first = self.by_category.partition_point(|span| span.category < category);
        let end = self.by_category.partition_point(|span| span.category <= category);
        self.by_category.get(first..end).unwrap_or_default()
    }

    /// The same rows, sorted; `moved` is told each object's new row.
    pub fn sorted(&self, moved: &mut dyn FnMut(Id, u32)) -> Table {
        let mut keys: Vec<(u64, u32)> = Vec::with_capacity(self.live);
        let whole = self.blocks.iter().fold(Bounds::EMPTY, |mut all, block| {
            all.join(&block.hot.get().bounds);
            all
        });
        let cell = (0..2).map(|axis| whole.max[axis] - whole.min[axis]).fold(1e-3f32, f32::max) / 65536.0;
        // What is in which sets, row by row.
        let mut starts: Vec<u32> = Vec::with_capacity(self.blocks.len() * ROWS + 1);
        let mut members: Vec<u16> = Vec::new();
        for (number, block) in self.blocks.iter().enumerate() {
            let hot = block.hot.get();
            for row in block::rows(hot.live) {
                let part = |value: f32, axis: usize| ((value - whole.min[axis]) / cell).clamp(0.0, 65535.0) as u32;
                let place = morton(part(hot.x[row], 0)) | morton(part(hot.y[row], 1)) << 1;
                let key = u64::from(hot.region[row]) << 48 | u64::from(hot.category[row]) << 32 | u64::from(place);
                keys.push((key, (number * ROWS + row) as u32));
            }
            let sets: Vec<(u16, block::Mask)> = block.bits.sets().collect();
            let mut counts = [0u32; ROWS];
            for (_, mask) in &sets {
                block::rows(*mask).for_each(|row| counts[row % ROWS] += 1);
            }
            let mut at = members.len() as u32;
            let mut next = [0u32; ROWS];
            for (slot, count) in next.iter_mut().zip(counts) {
                starts.push(at);
                *slot = at;
                at += count;
            }
            members.resize(at as usize, 0);
            for (set, mask) in sets {
                for row in block::rows(mask) {
                    if let Some(member) = members.get_mut(next[row % ROWS] as usize) {
                        *member = set;
                    }
                    next[row % ROWS] += 1;
                }
            }
        }
        starts.push(members.len() as u32);
        keys.sort_unstable();
        let mut table = Table { live: keys.len(), ..Table::default() };
        let mut spans: Vec<Span> = Vec::new();
        for rows in keys.chunks(ROWS) {
            let mut fresh = Block::empty();
            let hot = fresh.hot.get_mut();
            let first = (table.blocks.len() * ROWS) as u32;
            for (at, (_, source)) in rows.iter().enumerate() {
                let Some((from, row)) = self.at(*source) else { continue };
                let old = from.hot.get();
                let (region, category) = (old.region[row], old.category[row]);
                let (id, weight) = (old.id[row], old.weight[row]);
                set(hot, at, Row { id, category, region, position: from.position(row), weight });
                let number = first + at as u32;
                moved(id, number);
                match spans.last_mut() {
                    Some(span) if (span.region, span.category) == (region, category) => span.end = number + 1,
                    _ => spans.push(Span { region, category, first: number, end: number + 1 }),
                }
            }
            hot.length = rows.len() as u32;
            for (at, (_, source)) in rows.iter().enumerate() {
                let range = starts.get(*source as usize).zip(starts.get(*source as usize + 1));
                let sets = range.and_then(|(first, end)| members.get(*first as usize..*end as usize));
                sets.unwrap_or_default().iter().for_each(|set| fresh.bits.put(*set, at, true));
            }
            table.blocks.push(fresh);
        }
        table.base = table.blocks.len();
        table.index(spans);
        table
    }

    /// Derives what is derived from the base's runs and bounds.
    pub fn index(&mut self, spans: Vec<Span>) {
        let mut by_category = spans.clone();
        by_category.sort_unstable_by_key(|span| (span.category, span.region));
        let bounds: Vec<Bounds> = self.blocks.iter().take(self.base).map(|block| block.hot.get().bounds).collect();
        let mut order: Vec<u32> = (0..bounds.len() as u32).collect();
        let weight = |number: &u32| bounds.get(*number as usize).map_or(LEAST, |bounds| bounds.weight);
        order.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
        let mut occupied: Vec<Vec<u64>> = Vec::new();
        for (number, block) in self.blocks.iter().take(self.base).enumerate() {
            for (set, mask) in block.bits.sets().filter(|(_, mask)| *mask != [0; 4]) {
                let set = usize::from(set);
                if occupied.len() <= set {
                    occupied.resize(set + 1, Vec::new());
                }
                if occupied[set].is_empty() {
                    occupied[set].resize(self.base.div_ceil(64), 0);
                }
                occupied[set][number / 64] |= u64::from(mask != [0; 4]) << (number % 64);
            }
        }
        self.occupied = Arc::new(occupied);
        let join = |group: &[Bounds]| {
            group.iter().fold(Bounds::EMPTY, |mut all, bounds| {
                all.join(bounds);
                all
            })
        };
        self.groups = Arc::new(bounds.chunks(GROUP).map(join).collect());
        (self.spans, self.by_category, self.order) = (Arc::new(spans), Arc::new(by_category), Arc::new(order));
    }
    /// Bytes of columns, bitsets and what is derived from them.
    pub fn bytes(&self) -> usize {
        let blocks: usize = self.blocks.iter().map(|block| size_of::<Hot>() + block.bits.bytes() + 80).sum();
        blocks + 2 * size_of_val(self.spans.as_slice()) + 4 * self.order.len() + size_of_val(self.groups.as_slice())
    }
}

fn set(hot: &mut Hot, at: usize, row: Row) {
    hot.id[at] = row.id;
    (hot.x[at], hot.y[at], hot.z[at]) = (row.position[0], row.position[1], row.position[2]);
    hot.weight[at] = row.weight;
    (hot.category[at], hot.region[at]) = (row.category, row.region);
    hot.live[at / 64] |= 1 << (at % 64);
    hot.bounds.add(row.position, row.weight);
}

/// Spreads 16 bits so that another number's fit between them.
fn morton(value: u32) -> u32 {
    let mut spread = value & 0xffff;
    spread = (spread | spread << 8) & 0x00ff_00ff;
    spread = (spread | spread << 4) & 0x0f0f_0f0f;
    spread = (spread | spread << 2) & 0x3333_3333;
    (spread | spread << 1) & 0x5555_5555
}

/// A block that lies in a file.
pub fn mapped(hot: Stored<Hot>, bits: block::Bits) -> Block {
    Block { hot, bits }
}
