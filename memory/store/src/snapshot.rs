//! A state as one checksummed file whose columns are read where they lie.

use crate::{
    State,
    block::{Bits, Hot, Mask},
    chain::{Chains, Packed},
    cow::{Grown, Run, Stored},
    event::Part,
    history::Known,
    map::Map,
    page::{Heads, Page},
    region::{Regions, Search},
    relation::{Back, Edge, Number, Sorted},
    space::{Plane, Point, Space, Tree},
    symbols::Symbols,
    table::{Span, Table, mapped},
};
use bytemuck::{Pod, Zeroable};
use std::{collections::BTreeMap, sync::Arc};

const MAGIC: [u8; 8] = *b"ACM-SNP4";
/// Room for more sections than there are.
const SECTIONS: usize = 32;
const ALIGN: usize = 64;

/// Name of a snapshot.
pub fn name(number: u64) -> String {
    format!("{number:08}.snapshot")
}

#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Section {
    at: u64,
    length: u64,
    check: u64,
}

#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Head {
    magic: [u8; 8],
    next: u64,
    batch: u64,
    now: u64,
    base: u64,
    live: u64,
    sections: [Section; SECTIONS],
    check: u64,
}

/// Where the log goes on behind a snapshot: number of the next batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Behind {
    /// Number of the next batch.
    pub batch: u64,
}

/// The file's bytes. The state must be settled whole.
pub fn write(state: &State, batch: u64, document: &[u8]) -> Vec<u8> {
    let table = &state.table;
    let hot: Vec<&Hot> = table.blocks.iter().map(|block| block.hot.get()).collect();
    let (mut slots, mut masks, mut mask_ends): (Vec<u16>, Vec<Mask>, Vec<u32>) = Default::default();
    let sets = usize::from(state.symbols.sets()) + 1;
    for block in table.blocks.iter() {
        let mut row = block.bits.slots.get().to_vec();
        row.resize(sets, 0);
        slots.extend(row);
        masks.extend_from_slice(block.bits.words.get());
        mask_ends.push(masks.len() as u32);
    }
    let mut part_ends: Vec<u32> = Vec::new();
    let mut parts = 0;
    for page in state.pages.iter() {
        parts += page.parts.get().len();
        part_ends.push(parts as u32);
    }
    let searches: Vec<(u16, u16, &Search)> = state.regions.iter().collect();
    let aside: Vec<[u64; 2]> = state.history.aside.iter().map(|(index, moment)| [u64::from(*index), *moment]).collect();
    let mut out = Writer { bytes: vec![0; size_of::<Head>().next_multiple_of(ALIGN)], sections: Vec::new() };
    out.bytes.reserve(hot.len() * size_of::<Hot>() + parts * size_of::<Part>() + (64 << 20));
    out.section(|bytes| bytes.extend(serde_json::to_vec(&*state.symbols).unwrap_or_default()));
    out.section(|bytes| hot.iter().for_each(|hot| bytes.extend_from_slice(bytemuck::bytes_of(*hot))));
    out.slice(&slots);
    out.slice(&masks);
    out.slice(&mask_ends);
    out.section(|bytes| {
        state.pages.iter().for_each(|page| bytes.extend_from_slice(bytemuck::bytes_of(page.heads.get())));
    });
    out.section(|bytes| {
        state.pages.iter().for_each(|page| bytes.extend_from_slice(bytemuck::cast_slice(page.parts.get())));
    });
    out.slice(&part_ends);
    out.slice(table.spans.as_slice());
    out.slice(state.relations.forth.sorted());
    out.slice(state.relations.back.sorted());
    out.slice(state.numbers.sorted());
    let chains = &state.history.sorted;
    out.slice(chains.packed.get());
    out.slice(chains.pool.get());
    out.slice(chains.starts.get());
    out.slice(chains.timed.get());
    out.slice(&aside);
    out.section(|bytes| {
        state.history.commits.iter().for_each(|known| bytes.extend_from_slice(bytemuck::bytes_of(known)))
    });
    out.slice(state.space.large().points.get());
    out.slice(state.space.large().planes.get());
    out.section(|bytes| {
        bytes.extend(serde_json::to_vec(&searches).unwrap_or_default());
        bytes.push(b'\n');
        bytes.extend_from_slice(document);
    });
    let mut head: Head = Zeroable::zeroed();
    (head.magic, head.next, head.batch, head.now) = (MAGIC, state.next, batch, state.now);
    (head.base, head.live) = (table.base as u64, table.live as u64);
    for (slot, section) in head.sections.iter_mut().zip(out.sections) {
        *slot = section;
    }
    head.check = u64::from(head_check(&head));
    let bytes = bytemuck::bytes_of(&head);
    if let Some(place) = out.bytes.get_mut(..bytes.len()) {
        place.copy_from_slice(bytes);
    }
    out.bytes
}

fn head_check(head: &Head) -> u32 {
    crc32c::crc32c(bytemuck::bytes_of(&Head { check: 0, ..*head }))
}

struct Writer {
    bytes: Vec<u8>,
    sections: Vec<Section>,
}

impl Writer {
    fn section(&mut self, write: impl FnOnce(&mut Vec<u8>)) {
        self.bytes.resize(self.bytes.len().next_multiple_of(ALIGN), 0);
        let at = self.bytes.len();
        write(&mut self.bytes);
        let length = self.bytes.len() - at;
        let check = u64::from(crc32c::crc32c(self.bytes.get(at..).unwrap_or_default()));
        self.sections.push(Section { at: at as u64, length: length as u64, check });
    }
    fn slice<T: Pod>(&mut self, values: &[T]) {
        self.section(|bytes| bytes.extend_from_slice(bytemuck::cast_slice(values)));
    }
}

/// What a snapshot holds.
pub struct Found {
    /// The state.
    pub state: State,
    /// Number of the next batch.
    pub batch: u64,
    /// The caller's own part.
    pub document: Vec<u8>,
}

/// Reads a file's bytes where they lie; every byte is checked first.
///
/// # Errors
/// Whether a file is a snapshot of another layout than this program's: the log has all that is in it.
pub fn is_of_another_layout(map: &Map) -> bool {
    map.bytes().starts_with(&MAGIC[..7]) && !map.bytes().starts_with(&MAGIC)
}

/// Says in words what is damaged.
pub fn read(map: Arc<Map>) -> Result<Found, String> {
    let head = *map.slice::<Head>(0, 1).and_then(<[Head]>::first).ok_or("it is too short")?;
    if head.magic != MAGIC {
        return Err("it does not begin as a snapshot does".into());
    }
    if u64::from(head_check(&head)) != head.check {
        return Err("its head has a wrong checksum".into());
    }
    for (number, section) in head.sections.iter().enumerate().filter(|(_, section)| section.length > 0) {
        let bytes = map.slice::<u8>(section.at as usize, section.length as usize);
        let bytes = bytes.ok_or_else(|| format!("section {number} does not fit into the file"))?;
        if u64::from(crc32c::crc32c(bytes)) != section.check {
            return Err(format!("section {number} has a wrong checksum"));
        }
    }
    unpack(&map, &head).ok_or_else(|| "its sections do not fit each other".into())
}

fn unpack(map: &Arc<Map>, head: &Head) -> Option<Found> {
    let [
        words,
        hot,
        slots,
        masks,
        mask_ends,
        heads,
        parts,
        part_ends,
        spans,
        forth,
        back,
        numbers,
        packed,
        pool,
        starts,
        timed,
        aside,
        commits,
        points,
        planes,
        rest,
    ] = *head.sections.first_chunk::<21>()?;
    let bytes = |section: Section| map.slice::<u8>(section.at as usize, section.length as usize);
    let mut symbols: Symbols = serde_json::from_slice(bytes(words)?).ok()?;
    symbols.reindex();
    let sets = usize::from(symbols.sets()) + 1;
    let blocks = hot.length as usize / size_of::<Hot>();
    let mask_ends = map.slice::<u32>(mask_ends.at as usize, blocks)?;
    let mut table = Table { base: head.base as usize, live: head.live as usize, ..Table::default() };
    let mut first = 0usize;
    for (number, end) in mask_ends.iter().enumerate() {
        let end = *end as usize;
        let bits = Bits {
            slots: Run::mapped(map, slots.at as usize + 2 * sets * number, sets)?,
            words: Run::mapped(map, masks.at as usize + size_of::<Mask>() * first, end.checked_sub(first)?)?,
        };
        table.blocks.push(mapped(Stored::mapped(map, hot.at as usize + number * size_of::<Hot>())?, bits));
        first = end;
    }
    table.index(run::<Span>(map, spans)?.get().to_vec());
    let pages = heads.length as usize / size_of::<Heads>();
    let part_ends = map.slice::<u32>(part_ends.at as usize, pages)?;
    let (mut all, mut first) = (Vec::with_capacity(pages), 0usize);
    for (number, end) in part_ends.iter().enumerate() {
        let end = *end as usize;
        all.push(Page {
            heads: Stored::mapped(map, heads.at as usize + number * size_of::<Heads>())?,
            parts: Run::mapped(map, parts.at as usize + size_of::<Part>() * first, end.checked_sub(first)?)?,
        });
        first = end;
    }
    let mut state = State { symbols: Arc::new(symbols), table, pages: all.into_iter().collect(), ..State::default() };
    state.relations.forth = Sorted::of(run::<Edge>(map, forth)?);
    state.relations.back = Sorted::of(run::<Back>(map, back)?);
    state.numbers = Sorted::of(run::<Number>(map, numbers)?);
    state.history.sorted = Chains {
        packed: Arc::new(run::<Packed>(map, packed)?),
        pool: Arc::new(run::<u32>(map, pool)?),
        starts: Arc::new(run::<u64>(map, starts)?),
        timed: Arc::new(run::<u64>(map, timed)?),
    };
    let aside = run::<[u64; 2]>(map, aside)?;
    let aside: BTreeMap<u32, u64> = aside.get().iter().map(|[index, moment]| (*index as u32, *moment)).collect();
    state.history.aside = Arc::new(aside);
    state.history.commits = Grown::of(run::<Known>(map, commits)?);
    let tree = Tree { points: run::<Point>(map, points)?, planes: run::<Plane>(map, planes)? };
    state.set_space(Space::of(tree));
    let rest = bytes(rest)?;
    let end = rest.iter().position(|byte| *byte == b'\n')?;
    let (searches, document) = rest.split_at_checked(end)?;
    let searches: Vec<(u16, u16, Search)> = serde_json::from_slice(searches).ok()?;
    let mut regions = Regions::default();
    searches.into_iter().for_each(|(region, category, search)| regions.add(region, category, search));
    state.regions = Arc::new(regions);
    (state.next, state.now) = (head.next, head.now);
    Some(Found { state, batch: head.batch, document: document.get(1..)?.to_vec() })
}

fn run<T: Pod>(map: &Arc<Map>, section: Section) -> Option<Run<T>> {
    let count = section.length as usize / size_of::<T>();
    (count * size_of::<T>() == section.length as usize).then(|| Run::mapped(map, section.at as usize, count))?
}
