//! Chains of changes: what was so at one moment, as it was known at another.

use crate::{
    Id, Nanos,
    cow::{Grown, Run},
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

/// One change: 20 bytes, and 12 more where its value is wide.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Delta {
    /// The object's change before it, 1 + index; 0 for none.
    pub before: u32,
    /// Sequence number of the event.
    pub sequence: u32,
    /// How many microseconds before its commit it was so.
    earlier_us: u32,
    /// What changed.
    pub key: Key,
    /// Number of the source among [`crate::Kind::Source`] words, and confidence in steps of 1/255.
    pub origin: [u8; 2],
    /// The new value, by key; of a wide one its place.
    value: u32,
}

/// Whether values of a key have three words: positions, rotations, numbers and relations.
fn is_wide(key: Key, value: [u32; 3]) -> bool {
    matches!(key, POSITION | ROTATION) || key >= FIRST && (value[1] != 0 || value[2] != 0)
}
/// Marks a value whose three words stand elsewhere, where its key alone does not tell.
const WIDE: u32 = 1 << 31;

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
    /// The changes.
    pub deltas: Grown<Delta>,
    /// Wide values.
    pub wide: Grown<[u32; 3]>,
    /// How many of the changes lie object by object.
    pub sorted: usize,
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
    /// Since when a change is so.
    pub fn valid(&self, index: u32, delta: &Delta) -> Nanos {
        self.valid_or(index, delta, 0)
    }
    /// The same, where the present batch comes to be known at `present`.
    pub fn valid_or(&self, index: u32, delta: &Delta, present: Nanos) -> Nanos {
        match delta.earlier_us {
            ASIDE => self.aside.get(&index).copied().unwrap_or(0),
            earlier => {
                let known = self.known_or(u64::from(delta.sequence), present);
                known.saturating_sub(u64::from(earlier) * 1000)
            }
        }
    }
    /// Whether a change was so at `valid`, where all events before `until` were known by then.
    #[inline]
    fn was(&self, index: u32, delta: &Delta, valid: Nanos, until: u64) -> bool {
        match delta.earlier_us {
            ASIDE => self.aside.get(&index).is_some_and(|moment| *moment <= valid),
            _ if u64::from(delta.sequence) < until => true,
            0 => false,
            earlier => self.known(u64::from(delta.sequence)).saturating_sub(u64::from(earlier) * 1000) <= valid,
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
        let index = self.deltas.len() as u32;
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
        self.deltas.push(Delta { before, sequence, earlier_us, key, origin, value });
        index + 1
    }
    /// The value of a change.
    #[inline]
    pub fn value(&self, delta: &Delta) -> [u32; 3] {
        // Weights are negative numbers, whose first bit is set as well.
        if delta.value & WIDE == 0 || delta.key == CONFIDENCE {
            return [delta.value, 0, 0];
        }
        self.wide.get((delta.value & !WIDE) as usize).copied().unwrap_or_default()
    }
    /// Whether so much came since the changes were sorted that they should be sorted again.
    pub fn is_loose(&self) -> bool {
        self.deltas.len() - self.sorted > 65_536.max(self.sorted / 2)
    }
    /// Lays the changes of each object side by side, so that reading a chain touches a few cache lines. `last` are the ends
    /// of all chains; they are set to where they are then. A chain only leads to earlier changes, so that two passes in
    /// the order of the changes do, and none waits for the change before it.
    pub fn sort<'a>(&mut self, last: impl Iterator<Item = &'a mut u32>) {
        const NOBODY: u32 = u32::MAX;
        let ends: Vec<&mut u32> = last.filter(|end| **end > 0).collect();
        let deltas: Vec<Delta> = self.deltas.iter().copied().collect();
        // Whose each change is, and from where on its chain and its wide values lie.
        let mut owner = vec![NOBODY; deltas.len()];
        let mut chains = vec![(0u32, 0u32); ends.len()];
        for (chain, end) in (0u32..).zip(&ends) {
            if let Some(owner) = owner.get_mut(**end as usize - 1) {
                *owner = chain;
            }
        }
        let points_aside = |delta: &Delta| delta.value & WIDE != 0 && delta.key != CONFIDENCE;
        for (at, delta) in deltas.iter().enumerate().rev() {
            let chain = owner[at];
            let Some((count, wide)) = chains.get_mut(chain as usize) else { continue };
            *count += 1;
            *wide += u32::from(points_aside(delta));
            if let Some(owner) = (delta.before as usize).checked_sub(1).and_then(|before| owner.get_mut(before)) {
                *owner = chain;
            }
        }
        let (mut count, mut wides) = (0, 0);
        for chain in &mut chains {
            let (length, wide) = *chain;
            *chain = (count, wides);
            (count, wides) = (count + length, wides + wide);
        }
        let starts: Vec<u32> = chains.iter().map(|(start, _)| *start).collect();
        let mut sorted: Vec<Delta> = vec![Zeroable::zeroed(); count as usize];
        let mut wide = vec![[0u32; 3]; wides as usize];
        for (at, delta) in deltas.iter().enumerate() {
            let chain = owner[at] as usize;
            let (Some((next, next_wide)), Some(start)) = (chains.get_mut(chain), starts.get(chain)) else { continue };
            let before = if next == start { 0 } else { *next };
            let mut delta = Delta { before, ..*delta };
            if points_aside(&delta)
                && let Some(place) = wide.get_mut(*next_wide as usize)
            {
                *place = self.value(&delta);
                delta.value = WIDE | *next_wide;
                *next_wide += 1;
            }
            if let Some(place) = sorted.get_mut(*next as usize) {
                *place = delta;
            }
            owner[at] = *next;
            *next += 1;
        }
        let moved = |(index, moment): (&u32, &Nanos)| {
            owner.get(*index as usize).filter(|place| **place != NOBODY).map(|place| (*place, *moment))
        };
        self.aside = Arc::new(self.aside.iter().filter_map(moved).collect());
        for (end, (next, _)) in ends.into_iter().zip(&chains) {
            *end = *next;
        }
        self.sorted = sorted.len();
        (self.deltas, self.wide) = (Grown::of(Run::Owned(sorted)), Grown::of(Run::Owned(wide)));
    }
    /// The changes of a chain, latest known first, with their indices.
    pub fn chain(&self, last: u32) -> impl Iterator<Item = (u32, &Delta)> {
        let mut next = last;
        std::iter::from_fn(move || {
            let index = next.checked_sub(1)?;
            let delta = self.deltas.get(index as usize)?;
            next = delta.before;
            Some((index, delta))
        })
    }
    /// The value of each asked key at `valid` as it was known at `known`. `ordered`: no change of the chain is of an
    /// earlier moment than the one before it. A key that did not change by then keeps `None`; so do those of which `never`
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
        for (index, delta) in self.chain(last) {
            if u64::from(delta.sequence) >= until_known || !self.was(index, delta, valid, until_valid) {
                continue;
            }
            let Some(slot) = keys.iter().position(|key| *key == delta.key).and_then(|at| found.get_mut(at)) else {
                continue;
            };
            if ordered {
                if slot.is_none() {
                    *slot = Some((0, self.value(delta)));
                    missing -= 1;
                    if missing == 0 {
                        break;
                    }
                }
            } else {
                let moment = self.valid(index, delta);
                // Later known first: of equal moments the one that was known last counts.
                if slot.is_none_or(|(best, _)| moment > best) {
                    *slot = Some((moment, self.value(delta)));
                }
            }
        }
        found.map(|value| value.map(|(_, value)| value))
    }
    /// A chain in plain terms, in the order in which it came to be known.
    pub fn changes(&self, last: u32) -> Vec<Change> {
        let mut all: Vec<Change> = self
            .chain(last)
            .map(|(index, delta)| Change {
                valid: self.valid(index, delta),
                known: self.known(u64::from(delta.sequence)),
                sequence: u64::from(delta.sequence),
                key: delta.key,
                origin: (delta.origin[0], f32::from(delta.origin[1]) / 255.0),
                value: self.value(delta),
            })
            .collect();
        all.reverse();
        all
    }
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.deltas.len() * size_of::<Delta>()
            + self.wide.len() * 12
            + self.aside.len() * 24
            + self.commits.len() * size_of::<Known>()
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
