//! Lists that readers and the writer share: a clone costs a few pointers, a write copies what it touches and only where
//! a reader still has it.

use crate::map::Map;
use bytemuck::Pod;
use std::sync::Arc;

const GROUP: usize = 64;

/// A list of large values.
#[derive(Debug)]
pub struct Shared<T> {
    groups: Vec<Arc<Vec<Arc<T>>>>,
    length: usize,
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Shared { groups: self.groups.clone(), length: self.length }
    }
}

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Shared { groups: Vec::new(), length: 0 }
    }
}

impl<T: Clone> Shared<T> {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.length
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }
    /// One of them.
    #[inline]
    pub fn get(&self, at: usize) -> Option<&T> {
        self.groups.get(at / GROUP)?.get(at % GROUP).map(|value| &**value)
    }
    /// One of them, to be written.
    #[inline]
    pub fn get_mut(&mut self, at: usize) -> Option<&mut T> {
        let group = Arc::make_mut(self.groups.get_mut(at / GROUP)?);
        group.get_mut(at % GROUP).map(Arc::make_mut)
    }
    /// Adds one at the end.
    pub fn push(&mut self, value: T) {
        if self.length.is_multiple_of(GROUP) {
            self.groups.push(Arc::new(Vec::with_capacity(GROUP)));
        }
        if let Some(group) = self.groups.last_mut() {
            Arc::make_mut(group).push(Arc::new(value));
            self.length += 1;
        }
    }
    /// All, to be written.
    pub fn all_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.groups.iter_mut().flat_map(|group| Arc::make_mut(group).iter_mut().map(Arc::make_mut))
    }
    /// All, in order.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.groups.iter().flat_map(|group| group.iter().map(|value| &**value))
    }
}

impl<T: Clone> FromIterator<T> for Shared<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        let mut list = Shared::default();
        values.into_iter().for_each(|value| list.push(value));
        list
    }
}

/// A value that lies in a mapped file until it is written.
#[derive(Debug)]
pub enum Stored<T> {
    /// At this byte of the file.
    Mapped(Arc<Map>, usize),
    /// In memory.
    Owned(Box<T>),
}

impl<T: Pod> Clone for Stored<T> {
    fn clone(&self) -> Self {
        match self {
            Stored::Mapped(map, at) => Stored::Mapped(map.clone(), *at),
            Stored::Owned(value) => Stored::Owned(value.clone()),
        }
    }
}

impl<T: Pod> Stored<T> {
    /// The value at a byte of a file; `None` where it does not fit.
    pub fn mapped(map: &Arc<Map>, at: usize) -> Option<Stored<T>> {
        map.slice::<T>(at, 1).map(|_| Stored::Mapped(map.clone(), at))
    }
    /// Reads it.
    #[inline]
    #[allow(clippy::expect_used, reason = "the bounds were checked when the value was mapped")]
    pub fn get(&self) -> &T {
        match self {
            Stored::Owned(value) => value,
            Stored::Mapped(map, at) => map.slice::<T>(*at, 1).and_then(<[T]>::first).expect("checked when mapped"),
        }
    }
    /// Writes it.
    #[inline]
    pub fn get_mut(&mut self) -> &mut T {
        if let Stored::Mapped(..) = self {
            *self = Stored::Owned(Box::new(*self.get()));
        }
        match self {
            Stored::Owned(value) => value,
            Stored::Mapped(..) => unreachable!("made its own above"),
        }
    }
}

/// A run of values that lies in a mapped file until it is written.
#[derive(Debug, Clone)]
pub enum Run<T> {
    /// So many from this byte of the file.
    Mapped(Arc<Map>, usize, usize),
    /// In memory.
    Owned(Vec<T>),
}

impl<T> Default for Run<T> {
    fn default() -> Self {
        Run::Owned(Vec::new())
    }
}

impl<T: Pod> Run<T> {
    /// `count` values at a byte of a file; `None` where they do not fit.
    pub fn mapped(map: &Arc<Map>, at: usize, count: usize) -> Option<Run<T>> {
        map.slice::<T>(at, count).map(|_| Run::Mapped(map.clone(), at, count))
    }
    /// Reads it.
    #[inline]
    pub fn get(&self) -> &[T] {
        match self {
            Run::Owned(values) => values,
            Run::Mapped(map, at, count) => map.slice(*at, *count).unwrap_or_default(),
        }
    }
    /// Writes it.
    pub fn get_mut(&mut self) -> &mut Vec<T> {
        if let Run::Mapped(..) = self {
            *self = Run::Owned(self.get().to_vec());
        }
        match self {
            Run::Owned(values) => values,
            Run::Mapped(..) => unreachable!("made its own above"),
        }
    }
}

const CHUNK: usize = 4096;

/// A list of small values that only grows at its end.
#[derive(Debug, Clone)]
pub struct Grown<T> {
    mapped: Arc<Run<T>>,
    chunks: Vec<Arc<Vec<T>>>,
    length: usize,
}

impl<T> Default for Grown<T> {
    fn default() -> Self {
        Grown { mapped: Arc::default(), chunks: Vec::new(), length: 0 }
    }
}

impl<T: Pod> Grown<T> {
    /// A list that begins with what is there, in a file or in memory.
    pub fn of(mapped: Run<T>) -> Grown<T> {
        let length = mapped.get().len();
        Grown { mapped: Arc::new(mapped), chunks: Vec::new(), length }
    }
    /// How many there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.length
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }
    /// One of them.
    #[inline]
    pub fn get(&self, at: usize) -> Option<&T> {
        let mapped = self.mapped.get();
        match at.checked_sub(mapped.len()) {
            None => mapped.get(at),
            Some(at) => self.chunks.get(at / CHUNK)?.get(at % CHUNK),
        }
    }
    /// Adds one at the end.
    #[inline]
    pub fn push(&mut self, value: T) {
        if (self.length - self.mapped.get().len()).is_multiple_of(CHUNK) {
            self.chunks.push(Arc::new(Vec::with_capacity(CHUNK)));
        }
        if let Some(chunk) = self.chunks.last_mut() {
            Arc::make_mut(chunk).push(value);
            self.length += 1;
        }
    }
    /// All, in order.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.mapped.get().iter().chain(self.chunks.iter().flat_map(|chunk| chunk.iter()))
    }
    /// How many of the first satisfy a test that no later one does once one did not.
    pub fn partition_point(&self, test: impl Fn(&T) -> bool) -> usize {
        let (mut low, mut high) = (0, self.length);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.get(middle).is_some_and(&test) {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        low
    }
}
