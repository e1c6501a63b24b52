//! Relations and numbers: sorted lists, with what changed since they were sorted in a small tree over them.

use crate::{Id, cow::Run, event::Sure, symbols::Symbol};
use bytemuck::{Pod, Zeroable};
use std::{collections::BTreeMap, sync::Arc};

/// Changes after which a list is sorted anew.
const LOOSE: usize = 8192;

/// An entry with the key that it is sorted by.
pub trait Entry: Pod {
    /// The key.
    type Key: Ord + Copy;
    /// The entry's key.
    fn key(&self) -> Self::Key;
}

/// A sorted list.
#[derive(Debug, Clone)]
pub struct Sorted<E: Entry> {
    base: Arc<Run<E>>,
    loose: Arc<BTreeMap<E::Key, Option<E>>>,
}

impl<E: Entry> Default for Sorted<E> {
    fn default() -> Self {
        Sorted { base: Arc::default(), loose: Arc::default() }
    }
}

impl<E: Entry> Sorted<E> {
    /// A list that lies sorted in a file.
    pub fn of(base: Run<E>) -> Sorted<E> {
        Sorted { base: Arc::new(base), loose: Arc::default() }
    }
    /// One entry.
    pub fn get(&self, key: E::Key) -> Option<&E> {
        if !self.loose.is_empty()
            && let Some(change) = self.loose.get(&key)
        {
            return change.as_ref();
        }
        let base = self.base.get();
        base.binary_search_by_key(&key, Entry::key).ok().and_then(|at| base.get(at))
    }
    /// The entries from one key to another, both with them, in order.
    pub fn range(&self, from: E::Key, to: E::Key) -> impl Iterator<Item = E> {
        let base = self.base.get();
        let first = base.partition_point(|entry| entry.key() < from);
        let mut kept = base.iter().skip(first).take_while(move |entry| entry.key() <= to).peekable();
        let mut loose = self.loose.range(from..=to).peekable();
        std::iter::from_fn(move || {
            loop {
                let take_loose = match (kept.peek(), loose.peek()) {
                    (None, None) => return None,
                    (Some(_), None) => false,
                    (None, Some(_)) => true,
                    (Some(entry), Some((key, _))) => {
                        if entry.key() == **key {
                            kept.next();
                            true
                        } else {
                            entry.key() > **key
                        }
                    }
                };
                if !take_loose {
                    return kept.next().copied();
                }
                if let Some((_, Some(entry))) = loose.next() {
                    return Some(*entry);
                }
            }
        })
    }
    /// All entries.
    pub fn iter(&self) -> impl Iterator<Item = E> {
        let all = self.base.get().iter().filter(|entry| !self.loose.contains_key(&entry.key())).copied();
        all.chain(self.loose.values().flatten().copied())
    }
    /// Puts an entry in place of the one with its key.
    pub fn put(&mut self, entry: E) {
        Arc::make_mut(&mut self.loose).insert(entry.key(), Some(entry));
        self.settle(LOOSE.max(self.base.get().len() / 16));
    }
    /// Drops an entry.
    pub fn remove(&mut self, key: E::Key) {
        Arc::make_mut(&mut self.loose).insert(key, None);
        self.settle(LOOSE.max(self.base.get().len() / 16));
    }
    /// Sorts the list if more than so many changes lie over it.
    pub fn settle(&mut self, most: usize) {
        if self.loose.len() > most {
            let mut all: Vec<E> = self.iter().collect();
            all.sort_unstable_by_key(Entry::key);
            *self = Sorted { base: Arc::new(Run::Owned(all)), loose: Arc::default() };
        }
    }
    /// The sorted entries; right after `settle(0)` only.
    pub fn sorted(&self) -> &[E] {
        self.base.get()
    }
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.base.get()) + self.loose.len() * (size_of::<E::Key>() + size_of::<E>() + 8)
    }
}

/// A relation between two objects.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Edge {
    /// The one of which it is said.
    pub subject: Id,
    /// The other.
    pub object: Id,
    /// Which relation.
    pub relation: Symbol,
    /// A [`Sure`].
    pub sure: u8,
    /// Confidence in steps of 1/255.
    pub confidence: u8,
}

impl Edge {
    /// Whether it is said to hold.
    pub fn holds(&self) -> bool {
        self.sure == Sure::Yes as u8
    }
}

impl Entry for Edge {
    type Key = (Id, Symbol, Id);
    fn key(&self) -> Self::Key {
        (self.subject, self.relation, self.object)
    }
}

/// A relation, found by its other object.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Back(pub Edge);

impl Entry for Back {
    type Key = (Id, Symbol, Id);
    fn key(&self) -> Self::Key {
        (self.0.object, self.0.relation, self.0.subject)
    }
}

/// A number that belongs to an object.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Number {
    /// The object.
    pub id: Id,
    /// Which number.
    pub fluent: Symbol,
    /// Zeros.
    pub padding: u16,
    /// Its value, in the fluent's unit.
    pub value: f64,
}

impl Entry for Number {
    type Key = (Id, Symbol);
    fn key(&self) -> Self::Key {
        (self.id, self.fluent)
    }
}

/// All relations, from both sides.
#[derive(Debug, Clone, Default)]
pub struct Relations {
    /// By the object of which they are said.
    pub forth: Sorted<Edge>,
    /// By the other.
    pub back: Sorted<Back>,
}

impl Relations {
    /// What is known of a relation.
    pub fn get(&self, subject: Id, relation: Symbol, object: Id) -> Option<&Edge> {
        self.forth.get((subject, relation, object))
    }
    /// What an object is related to.
    pub fn of(&self, subject: Id) -> impl Iterator<Item = Edge> {
        self.forth.range((subject, 0, 0), (subject, Symbol::MAX, Id::MAX))
    }
    /// What an object is in one relation to.
    pub fn objects(&self, subject: Id, relation: Symbol) -> impl Iterator<Item = Id> {
        self.forth
            .range((subject, relation, 0), (subject, relation, Id::MAX))
            .filter(Edge::holds)
            .map(|edge| edge.object)
    }
    /// What is in one relation to an object.
    pub fn subjects(&self, relation: Symbol, object: Id) -> impl Iterator<Item = Id> {
        let range = self.back.range((object, relation, 0), (object, relation, Id::MAX));
        range.filter(|back| back.0.holds()).map(|back| back.0.subject)
    }
    /// All relations that end at an object.
    pub fn into_object(&self, object: Id) -> impl Iterator<Item = Edge> {
        self.back.range((object, 0, 0), (object, Symbol::MAX, Id::MAX)).map(|back| back.0)
    }
    /// Everything that is in one of the relations to an object, over any number of steps: what is in a box on a shelf is on
    /// that shelf. Each once, nearest first; at most `limit`.
    pub fn closure(&self, relations: &[Symbol], object: Id, limit: usize) -> Vec<Id> {
        let mut found = vec![object];
        let mut at = 0;
        while let Some(next) = found.get(at).copied() {
            for relation in relations {
                for subject in self.subjects(*relation, next) {
                    if found.len() > limit {
                        break;
                    }
                    if !found.contains(&subject) {
                        found.push(subject);
                    }
                }
            }
            at += 1;
        }
        found.remove(0);
        found
    }
    /// Whether the first is, over any number of steps, in one of the relations to the second.
    pub fn reaches(&self, relations: &[Symbol], from: Id, to: Id) -> bool {
        let mut found = vec![from];
        let mut at = 0;
        while let Some(next) = found.get(at).copied() {
            for relation in relations {
                for object in self.objects(next, *relation) {
                    if object == to {
                        return true;
                    }
                    if !found.contains(&object) {
                        found.push(object);
                    }
                }
            }
            at += 1;
        }
        false
    }
    pub(crate) fn put(&mut self, edge: Edge) {
        if edge.sure == Sure::Unknown as u8 {
            self.forth.remove(edge.key());
            self.back.remove(Back(edge).key());
        } else {
            self.forth.put(edge);
            self.back.put(Back(edge));
        }
    }
}
