//! Chains of changes: what was so at one moment, as it was known at another.

use crate::{
    Id, Nanos,
    chain::{Builder, Chains, Packed, WIDE},
    cow::Grown,
    event::Sure,
    symbols::Symbol,
};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, sync::Arc};

/// What of an object changed: a built-in property, or [`FIRST`] + a symbol.
pub type Key = u16;
/// Its position.
pub const POSITION: Key = 0;
/// Its rotation.
pub const ROTATION: Key = 1;
/// Its region.
pub const REGION: Key = 2;
/// Its category.
pub const CATEGORY: Key = 3;
/// Its confidence.
pub const CONFIDENCE: Key = 4;
/// Whether it is there.
pub const THERE: Key = 5;
/// Keys from here on are symbols.
pub const FIRST: Key = 16;
/// The moment is not the commit's less a number of microseconds; it is kept aside.
const ASIDE: u32 = u32::MAX;

/// A change that came since the chains were sorted: 20 bytes, and 12 more where its value is wide.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Delta {
    /// The object's change before it, 1 + index; 0 for none.
    before: u32,
    /// How many microseconds before its commit it was so.
    earlier_us: u32,
    packed: Packed,
}

/// A change as it is read from a chain.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Its place among all changes.
    index: u32,
    /// The object's change before it, 1 + index; 0 for none.
    before: u32,
    packed: Packed,
}

impl Step {
    /// What changed.
    #[inline]
    pub fn key(&self) -> Key {
        self.packed.key
    }
    /// Sequence number of the event.
    #[inline]
    pub fn sequence(&self) -> u64 {
        u64::from(self.packed.sequence)
    }
}

/// Whether values of a key have three words: positions, rotations, numbers and relations.
fn is_wide(key: Key, value: [u32; 3]) -> bool {
    matches!(key, POSITION | ROTATION) || key >= FIRST && (value[1] != 0 || value[2] != 0)
}
/// Whether a key has values of three words. Weights are negative numbers, whose first bit is set as that of a wide value is.
#[inline]
fn may_be_wide(key: Key) -> bool {
    key != CONFIDENCE
}

/// When the events up to one came to be known.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Known {
    /// Sequence number of the first event after them.
    pub next: u64,
    /// When.
    pub time: Nanos,
}

/// All changes of all objects.
#[derive(Debug, Clone, Default)]
pub struct History {
    /// The changes up to when they were sorted.
    pub(crate) sorted: Chains,
    /// Those since.
    fresh: Grown<Delta>,
    /// Wide values of those since.
    wide: Grown<[u32; 3]>,
    /// Moments that do not fit into the changes themselves.
    pub aside: Arc<BTreeMap<u32, Nanos>>,
    /// The commits.
    pub commits: Grown<Known>,
}

/// A change in plain terms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// Since when it was so.
    pub valid: Nanos,
    /// When it came to be known.
    pub known: Nanos,
    /// Sequence number of the event.
    pub sequence: u64,
    /// What changed.
    pub key: Key,
    /// Source and confidence.
    pub origin: (u8, f32),
    /// The value.
    pub value: [u32; 3],
}

/// What is known of an object at some moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Past {
    /// Position, metres.
    pub position: [f32; 3],
    /// Rotation: the vector part of its unit quaternion.
    pub rotation: [f32; 3],
    /// Region.
    pub region: Symbol,
    /// Category.
    pub category: Symbol,
    /// Probability that it exists as described.
    pub confidence: f32,
    /// Whether it is there.
    pub there: bool,
}

impl History {
    /// When an event came to be known.
    pub fn known(&self, sequence: u64) -> Nanos {
        let at = self.commits.partition_point(|commit| commit.next <= sequence);
        self.commits.get(at).map_or(0, |commit| commit.time)
    }
    /// The same, or `present` where the event belongs to the batch that is being taken in.
    pub fn known_or(&self, sequence: u64, present: Nanos) -> Nanos {
        let committed = self.commits.get(self.commits.len().wrapping_sub(1)).map_or(0, |last| last.next);
        if sequence < committed { self.known(sequence) } else { present }
    }
    /// Sequence number of the first event that was not known at `time` yet.
    pub fn until(&self, time: Nanos) -> u64 {
        if self.commits.get(self.commits.len().wrapping_sub(1)).is_none_or(|last| last.time <= time) {
            return u64::MAX;
        }
        let at = self.commits.partition_point(|commit| commit.time <= time);
        at.checked_sub(1).and_then(|at| self.commits.get(at)).map_or(0, |commit| commit.next)
    }
    /// How many changes there are.
    pub fn len(&self) -> usize {
        self.sorted.len() + self.fresh.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Whether all changes lie object by object.
    pub fn is_sorted(&self) -> bool {
        self.fresh.is_empty()
    }
    #[inline]
    fn step(&self, index: u32) -> Option<Step> {
        let at = index as usize;
        if let Some(packed) = self.sorted.get(at) {
            let before = if self.sorted.starts(at) { 0 } else { index };
            return Some(Step { index, before, packed: *packed });
        }
        let delta = self.fresh.get(at - self.sorted.len())?;
        Some(Step { index, before: delta.before, packed: delta.packed })
    }
    #[inline]
    fn earlier_us(&self, step: &Step) -> u32 {
        let at = step.index as usize;
        match at.checked_sub(self.sorted.len()) {
            None => self.sorted.earlier_us(at, &step.packed),
            Some(at) => self.fresh.get(at).map_or(0, |delta| delta.earlier_us),
        }
    }
    /// Since when a change is so.
    pub fn valid(&self, step: &Step) -> Nanos {
        self.valid_or(step, 0)
    }
    /// The same, where the present batch comes to be known at `present`.
    pub fn valid_or(&self, step: &Step, present: Nanos) -> Nanos {
        match self.earlier_us(step) {
            ASIDE => self.aside.get(&step.index).copied().unwrap_or(0),
            earlier => self.known_or(step.sequence(), present).saturating_sub(u64::from(earlier) * 1000),
        }
    }
    /// Whether a change was so at `valid`, where all events before `until` were known by then.
    #[inline]
    fn was(&self, step: &Step, valid: Nanos, until: u64) -> bool {
        match self.earlier_us(step) {
            ASIDE => self.aside.get(&step.index).is_some_and(|moment| *moment <= valid),
            _ if step.sequence() < until => true,
            0 => false,
            earlier => self.known(step.sequence()).saturating_sub(u64::from(earlier) * 1000) <= valid,
        }
    }
    /// Adds a change and gives its place, 1 + index.
    pub(crate) fn add(
        &mut self,
        change: (Nanos, Nanos),
        sequence: u32,
        key: Key,
        origin: [u8; 2],
        value: [u32; 3],
        before: u32,
    ) -> u32 {
        let (valid, known) = change;
        let index = self.len() as u32;
        let earlier = known.checked_sub(valid).filter(|ns| ns % 1000 == 0).map(|ns| ns / 1000);
        let earlier_us = match earlier.and_then(|us| u32::try_from(us).ok()) {
            Some(us) if us < ASIDE => us,
            _ => {
                Arc::make_mut(&mut self.aside).insert(index, valid);
                ASIDE
            }
        };
        let value = if is_wide(key, value) {
            self.wide.push(value);
            WIDE | (self.wide.len() - 1) as u32
        } else {
            value[0]
        };
        self.fresh.push(Delta { before, earlier_us, packed: Packed { sequence, value, key, origin } });
        index + 1
    }
    /// The value of a change.
    #[inline]
    pub fn value(&self, step: &Step) -> [u32; 3] {
        let (at, packed) = (step.index as usize, &step.packed);
        if at < self.sorted.len() {
            return self.sorted.value(at, packed, may_be_wide(packed.key));
        }
        if packed.value & WIDE == 0 || !may_be_wide(packed.key) {
            return [packed.value, 0, 0];
        }
        self.wide.get((packed.value & !WIDE) as usize).copied().unwrap_or_default()
    }
    /// Whether so much came since the changes were sorted that they should be sorted again.
    pub fn is_loose(&self) -> bool {
        self.fresh.len() > 65_536.max(self.sorted.len() / 2)
    }
    /// Lays the changes of each object side by side, so that reading a chain touches a few cache lines. `last` are the ends
    /// of all chains; they are set to where they are then. A chain only leads to earlier changes, so that two passes in
    /// the order of the changes find all places, and none waits for the change before it.
    pub fn sort<'a>(&mut self, last: impl Iterator<Item = &'a mut u32>) {
        const NOBODY: u32 = u32::MAX;
        let ends: Vec<&mut u32> = last.filter(|end| **end > 0).collect();
        // Whose each change is, and where its chain begins and goes on.
        let mut owner = vec![NOBODY; self.len()];
        let mut lengths = vec![0u32; ends.len()];
        for (chain, end) in (0u32..).zip(&ends) {
            if let Some(owner) = owner.get_mut(**end as usize - 1) {
                *owner = chain;
            }
        }
        for index in (0..self.len() as u32).rev() {
            let chain = owner[index as usize];
            let Some(length) = lengths.get_mut(chain as usize) else { continue };
            *length += 1;
            let before = self.step(index).map_or(0, |step| step.before);
            if let Some(owner) = (before as usize).checked_sub(1).and_then(|before| owner.get_mut(before)) {
                *owner = chain;
            }
        }
        let mut count = 0;
        let mut next: Vec<u32> = Vec::with_capacity(lengths.len());
        for length in lengths {
            next.push(count);
            count += length;
        }
        let starts = next.clone();
        // Which change comes to each place, and the other way round.
        let mut source = vec![NOBODY; count as usize];
        for (index, owner) in (0u32..).zip(&mut owner) {
            let Some(next) = next.get_mut(*owner as usize) else { continue };
            if let Some(source) = source.get_mut(*next as usize) {
                *source = index;
            }
            *owner = *next;
            *next += 1;
        }
        let mut sorted = Builder::new(count as usize, self.sorted.pool.get().len() + 3 * self.wide.len());
        let mut starts = starts.into_iter().peekable();
        for (place, index) in (0u32..).zip(source) {
            let first = starts.next_if_eq(&place).is_some();
            let Some(step) = self.step(index) else { continue };
            let value = self.value(&step);
            let wide = is_wide(step.key(), value);
            sorted.put(place as usize, step.packed, self.earlier_us(&step), value, wide, first);
        }
        let moved = |(index, moment): (&u32, &Nanos)| {
            owner.get(*index as usize).filter(|place| **place != NOBODY).map(|place| (*place, *moment))
        };
        self.aside = Arc::new(self.aside.iter().filter_map(moved).collect());
        for (end, next) in ends.into_iter().zip(next) {
            *end = next;
        }
        (self.sorted, self.fresh, self.wide) = (sorted.finish(), Grown::default(), Grown::default());
    }
    /// The changes of a chain, latest known first.
    pub fn chain(&self, last: u32) -> impl Iterator<Item = Step> {
        let mut next = last;
        std::iter::from_fn(move || {
            let step = self.step(next.checked_sub(1)?)?;
            next = step.before;
            Some(step)
        })
    }
    /// The value of each asked key at `valid` as it was known at `known`. `ordered`: no change of a property is of
    /// an earlier moment than the one before it. A key that did not change by then keeps `None`; so do those of which `never`
    /// says that they did not change at all.
    pub fn at<const N: usize>(
        &self,
        last: u32,
        ordered: bool,
        keys: [Key; N],
        never: impl Fn(Key) -> bool,
        (valid, known): (Nanos, Nanos),
    ) -> [Option<[u32; 3]>; N] {
        let (until_valid, until_known) = (self.until(valid), self.until(known));
        let mut found: [Option<(Nanos, [u32; 3])>; N] = [None; N];
        let mut missing = keys.iter().filter(|key| !never(**key)).count();
        if missing == 0 {
            return [None; N];
        }
        let mut implied = Implied::default();
        for step in self.chain(last) {
            if step.sequence() >= until_known || !self.was(&step, valid, until_valid) {
                continue;
            }
            let moment = if ordered { 0 } else { implied.read(self, &step) };
            let Some(slot) = keys.iter().position(|key| *key == step.key()).and_then(|at| found.get_mut(at)) else {
                continue;
            };
            if ordered {
                if slot.is_none() {
                    *slot = Some((0, self.value(&step)));
                    missing -= 1;
                    if missing == 0 {
                        break;
                    }
                }
            } else if slot.is_none_or(|(best, _)| moment > best) {
                // Later known first: of equal moments the one that was known last counts.
                *slot = Some((moment, self.value(&step)));
            }
        }
        if let Some(slot) = keys.iter().position(|key| *key == ROTATION).and_then(|at| found.get_mut(at))
            && let Some(first) = implied.first(slot.map_or(0, |(best, _)| best))
        {
            *slot = Some(first);
        }
        found.map(|value| value.map(|(_, value)| value))
    }
    /// A chain in plain terms, in the order in which it came to be known.
    pub fn changes(&self, last: u32) -> Vec<Change> {
        let mut all: Vec<Change> = self
            .chain(last)
            .map(|step| Change {
                valid: self.valid(&step),
                known: self.known(step.sequence()),
                sequence: step.sequence(),
                key: step.key(),
                origin: (step.packed.origin[0], f32::from(step.packed.origin[1]) / 255.0),
                value: self.value(&step),
            })
            .collect();
        all.reverse();
        all
    }
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.sorted.bytes()
            + self.fresh.len() * size_of::<Delta>()
            + self.wide.len() * 12
            + self.aside.len() * 24
            + self.commits.len() * size_of::<Known>()
    }
}

/// Rotations that were left out. Whoever says where a thing is says how it is turned; where that was as before, and nothing
/// of the chain was out of order yet, only the position was written down. In a chain that came out of order later, such a
/// position stands for the rotation before it, at its own moment.
#[derive(Default)]
struct Implied {
    /// The latest moment of a position since the rotation that was read last.
    open: Option<Nanos>,
    /// The rotation of the earliest moment: what it was from the beginning.
    first: Option<(Nanos, [u32; 3])>,
}

impl Implied {
    /// Takes the next step of a chain, latest known first, and gives the moment for which it counts.
    fn read(&mut self, history: &History, step: &Step) -> Nanos {
        let moment = history.valid(step);
        match step.key() {
            // A rotation of the same event has the same moment and is read before it: it counts.
            POSITION => self.open = self.open.max(Some(moment)),
            ROTATION => {
                if self.first.is_none_or(|(first, _)| moment <= first) {
                    self.first = Some((moment, history.value(step)));
                }
                return self.open.take().map_or(moment, |open| open.max(moment));
            }
            _ => {}
        }
        moment
    }
    /// The first rotation, if positions before all written ones stand for it at a later moment than `best`.
    fn first(self, best: Nanos) -> Option<(Nanos, [u32; 3])> {
        let (open, (_, value)) = self.open.zip(self.first)?;
        (open > best).then_some((open, value))
    }
}

/// A position as a value.
pub fn of_position(position: [f32; 3]) -> [u32; 3] {
    position.map(f32::to_bits)
}
/// A value as a position.
pub fn position(value: [u32; 3]) -> [f32; 3] {
    value.map(f32::from_bits)
}
/// A yes-or-no value.
pub fn of_sure(sure: Sure, object: Id) -> [u32; 3] {
    [sure as u32, object, 0]
}
/// A value as yes, no or unknown.
pub fn sure(value: [u32; 3]) -> Sure {
    match value[0] {
        1 => Sure::No,
        2 => Sure::Yes,
        _ => Sure::Unknown,
    }
}

/// How two intervals of time lie to each other (Allen 1983), each from its begin up to but not with its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Allen {
    /// The first ends before the second begins.
    Before,
    /// The first ends where the second begins.
    Meets,
    /// The first begins first and ends within the second.
    Overlaps,
    /// Both begin together, the first ends first.
    Starts,
    /// The first lies within the second.
    During,
    /// Both end together, the second begins first.
    Finishes,
    /// They are equal.
    Equal,
    /// `Finishes` the other way round.
    FinishedBy,
    /// `During` the other way round.
    Contains,
    /// `Starts` the other way round.
    StartedBy,
    /// `Overlaps` the other way round.
    OverlappedBy,
    /// `Meets` the other way round.
    MetBy,
    /// `Before` the other way round.
    After,
}

/// The relation of two intervals that are not empty.
pub fn allen(a: (Nanos, Nanos), b: (Nanos, Nanos)) -> Allen {
    use std::cmp::Ordering::{Equal, Greater, Less};
    match (a.0.cmp(&b.0), a.1.cmp(&b.1)) {
        (Equal, Equal) => Allen::Equal,
        (Equal, Less) => Allen::Starts,
        (Equal, Greater) => Allen::StartedBy,
        (Greater, Equal) => Allen::Finishes,
        (Less, Equal) => Allen::FinishedBy,
        (Greater, Less) => Allen::During,
        (Less, Greater) => Allen::Contains,
        (Less, Less) => match a.1.cmp(&b.0) {
            Less => Allen::Before,
            Equal => Allen::Meets,
            Greater => Allen::Overlaps,
        },
        (Greater, Greater) => match b.1.cmp(&a.0) {
            Less => Allen::After,
            Equal => Allen::MetBy,
            Greater => Allen::OverlappedBy,
        },
    }
}

/// The intervals in which a yes-or-no matter was so, from its changes in the order in which they became so. The last may
/// have no end: [`Nanos::MAX`].
pub fn intervals(changes: &[Change], key: Key) -> Vec<(Nanos, Nanos)> {
    let mut moments: Vec<(Nanos, u64, bool)> = changes
        .iter()
        .filter(|change| change.key == key)
        .map(|change| (change.valid, change.sequence, sure(change.value) == Sure::Yes))
        .collect();
    moments.sort_unstable();
    let mut found: Vec<(Nanos, Nanos)> = Vec::new();
    let mut since = None;
    for (valid, _, holds) in moments {
        match (since, holds) {
            (None, true) => since = Some(valid),
            (Some(begin), false) => {
                if begin < valid {
                    found.push((begin, valid));
                }
                since = None;
            }
            _ => {}
        }
    }
    found.extend(since.map(|begin| (begin, Nanos::MAX)));
    found
}
