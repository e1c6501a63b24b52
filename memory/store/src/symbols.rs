//! Words and their numbers. A word is defined in the log before it is used.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The number of a word, from 1; 0 is no word.
pub type Symbol = u16;
/// Most words.
pub const MAX_SYMBOLS: usize = 60_000;
/// Longest word, bytes.
pub const MAX_WORD_BYTES: usize = 255;

/// What a word names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u8)]
pub enum Kind {
    /// A category c.
    Category = 1,
    /// A template type tau.
    Template = 2,
    /// An affordance.
    Affordance = 3,
    /// A region of space: a room, a shelf.
    Region = 4,
    /// A state of an object that holds or does not.
    State = 5,
    /// A number that belongs to an object.
    Fluent = 6,
    /// A relation between two objects.
    Relation = 7,
    /// Who or what says so.
    Source = 8,
    /// A part's name.
    Name = 9,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 9] = [
        Kind::Category,
        Kind::Template,
        Kind::Affordance,
        Kind::Region,
        Kind::State,
        Kind::Fluent,
        Kind::Relation,
        Kind::Source,
        Kind::Name,
    ];
    /// The kind with a number.
    pub fn of(number: u8) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| *kind as u8 == number)
    }
    /// Its name, for people.
    pub fn word(self) -> &'static str {
        match self {
            Kind::Category => "category",
            Kind::Template => "template",
            Kind::Affordance => "affordance",
            Kind::Region => "region",
            Kind::State => "state",
            Kind::Fluent => "fluent",
            Kind::Relation => "relation",
            Kind::Source => "source",
            Kind::Name => "part name",
        }
    }
}

/// All words, and which categories are kinds of which.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Symbols {
    words: Vec<(Kind, String)>,
    #[serde(skip)]
    numbers: BTreeMap<(Kind, String), Symbol>,
    /// Direct kinds of a category.
    children: BTreeMap<Symbol, Vec<Symbol>>,
    /// Numbers of the bitsets, by 2 x symbol + (1 where it is known not to be so); 0 for none.
    bits: Vec<u16>,
    sets: u16,
}

impl Symbols {
    /// The word with a number.
    pub fn word(&self, symbol: Symbol) -> &str {
        self.words.get(usize::from(symbol).wrapping_sub(1)).map_or("", |(_, word)| word)
    }
    /// What a number names.
    pub fn kind(&self, symbol: Symbol) -> Option<Kind> {
        self.words.get(usize::from(symbol).wrapping_sub(1)).map(|(kind, _)| *kind)
    }
    /// The number of a word.
    pub fn find(&self, kind: Kind, word: &str) -> Option<Symbol> {
        self.numbers.get(&(kind, word.to_owned())).copied()
    }
    /// How many words there are.
    pub fn len(&self) -> usize {
        self.words.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }
    /// All words of a kind with their numbers, in the order of the numbers.
    pub fn of_kind(&self, kind: Kind) -> impl Iterator<Item = (Symbol, &str)> {
        let all = (1..).zip(&self.words);
        all.filter(move |(_, (of, _))| *of == kind).map(|(symbol, (_, word))| (symbol, word.as_str()))
    }
    /// The number that the next word gets.
    pub fn next(&self) -> Symbol {
        (self.words.len() + 1) as Symbol
    }
    /// Adds a word.
    pub(crate) fn define(&mut self, kind: Kind, word: &str) {
        let symbol = self.next();
        self.words.push((kind, word.into()));
        self.numbers.insert((kind, word.into()), symbol);
    }
    /// Finds numbers again after the words were read.
    pub(crate) fn reindex(&mut self) {
        let numbered = (1..).zip(&self.words);
        self.numbers = numbered.map(|(symbol, (kind, word))| ((*kind, word.clone()), symbol)).collect();
    }
    /// Says that a category is a kind of another; `false` if that would close a circle.
    pub(crate) fn is_kind_of(&mut self, child: Symbol, parent: Symbol) -> bool {
        if self.descendants(child).contains(&parent) {
            return false;
        }
        let children = self.children.entry(parent).or_default();
        if !children.contains(&child) {
            children.push(child);
        }
        true
    }
    /// Whether one category is the other or a kind of it.
    pub fn is_a(&self, category: Symbol, parent: Symbol) -> bool {
        category == parent || self.children.contains_key(&parent) && self.descendants(parent).contains(&category)
    }
    /// A category with all its kinds.
    pub fn descendants(&self, category: Symbol) -> Vec<Symbol> {
        let mut found = vec![category];
        let mut at = 0;
        while let Some(next) = found.get(at) {
            let new: Vec<Symbol> =
                self.children.get(next).into_iter().flatten().copied().filter(|c| !found.contains(c)).collect();
            found.extend(new);
            at += 1;
        }
        found
    }
    /// The bitset of those of which a word holds (or is known not to hold); 0 while there is none.
    #[inline]
    pub fn bit(&self, symbol: Symbol, negated: bool) -> u16 {
        self.bits.get(2 * usize::from(symbol) + usize::from(negated)).copied().unwrap_or(0)
    }
    /// The bitset of a word, made if need be.
    pub(crate) fn make_bit(&mut self, symbol: Symbol, negated: bool) -> u16 {
        let at = 2 * usize::from(symbol) + usize::from(negated);
        if self.bits.len() <= at {
            self.bits.resize(at + 1, 0);
        }
        match self.bits.get_mut(at) {
            Some(bit) => {
                if *bit == 0 {
                    self.sets += 1;
                    *bit = self.sets;
                }
                *bit
            }
            None => 0,
        }
    }
    /// How many bitsets there are; they are numbered from 1.
    pub fn sets(&self) -> u16 {
        self.sets
    }
    /// Bytes that the words take.
    pub fn bytes(&self) -> usize {
        self.words.iter().map(|(_, word)| 2 * (word.len() + 32)).sum::<usize>() + 2 * self.bits.len()
    }
}
