//! The schema: an event and the operations that it makes, and how they are written in bytes.

use crate::{Id, Nanos, symbols::Symbol};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Most parts of an object.
pub const MAX_PARTS: usize = 200;
/// Most operations of one event.
pub const MAX_OPS: usize = 60_000;
/// Most pieces of evidence of one event.
pub const MAX_EVIDENCE: usize = 250;
/// Most geometric parameters of a part.
pub const MAX_THETA: usize = 8;

/// One change of memory, with where it comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Since when it is so.
    pub valid: Nanos,
    /// Who or what says so.
    pub source: Symbol,
    /// Probability that it is so, 0-1; kept in steps of 1/255.
    pub confidence: f32,
    /// What it rests on.
    pub evidence: Vec<Evidence>,
    /// What it changes, in order.
    pub ops: Vec<Op>,
    /// The objects that the document speaks of, beside those of the operations.
    pub about: Vec<Id>,
    /// The caller's own record of it; the engine keeps it and does not read it.
    #[serde(skip)]
    pub document: Vec<u8>,
}

impl Event {
    /// An event without evidence or document.
    pub fn new(valid: Nanos, source: Symbol, confidence: f32, ops: Vec<Op>) -> Event {
        Event { valid, source, confidence, evidence: Vec::new(), ops, about: Vec::new(), document: Vec::new() }
    }
    /// All objects that it speaks of.
    pub fn subjects(&self) -> impl Iterator<Item = Id> {
        self.ops.iter().flat_map(Op::subjects).flatten().chain(self.about.iter().copied())
    }
}

/// A piece of evidence: a number in a series of the caller's, such as the frame 41 or the transition 7.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Evidence {
    /// Which series.
    pub series: u8,
    /// The number in it.
    pub number: u64,
}

/// What is known of a yes-or-no matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u8)]
pub enum Sure {
    /// Nothing.
    Unknown = 0,
    /// It is not so.
    No = 1,
    /// It is so.
    Yes = 2,
}

impl Sure {
    fn of(number: u8) -> Option<Sure> {
        [Sure::Unknown, Sure::No, Sure::Yes].into_iter().find(|sure| *sure as u8 == number)
    }
}

/// A part: (tau, Theta, T, A).
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[repr(C)]
pub struct Part {
    /// Template type tau.
    pub template: Symbol,
    /// The part's name in it.
    pub name: Symbol,
    /// Parameters Theta, in the template's order and units; the rest 0.
    pub theta: [f32; MAX_THETA],
    /// Position, metres, world frame.
    pub position: [f32; 3],
    /// The vector part of the unit quaternion whose scalar part is not negative.
    pub rotation: [f32; 3],
    /// Up to two affordances A, 0 for none; further ones are the object's.
    pub affordances: [Symbol; 2],
}

/// An object whole: (id, c, {P_i}, T, s).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Object {
    /// Its id.
    pub id: Id,
    /// Category c.
    pub category: Symbol,
    /// Where it is, coarsely; 0 where that is not known.
    pub region: Symbol,
    /// Position, metres, world frame.
    pub position: [f32; 3],
    /// The vector part of the unit quaternion whose scalar part is not negative.
    pub rotation: [f32; 3],
    /// Probability that it exists as described, 0-1.
    pub confidence: f32,
    /// Parts P_i.
    pub parts: Vec<Part>,
    /// Affordances of the object beside its parts'.
    pub affordances: Vec<Symbol>,
    /// States that hold.
    pub states: Vec<Symbol>,
}

/// One operation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Op {
    /// A word gets the next number.
    Define(crate::symbols::Kind, String),
    /// The first category is a kind of the second.
    IsA(Symbol, Symbol),
    /// An object that was not there, or another description of one that was; states that it does not name stay.
    Put(Box<Object>),
    /// An object is elsewhere.
    Move(Id, [f32; 3], [f32; 3]),
    /// An object is in another region.
    Region(Id, Symbol),
    /// A state of an object.
    State(Id, Symbol, Sure),
    /// A number of an object.
    Fluent(Id, Symbol, f64),
    /// A relation from the first object to the second.
    Relate(Id, Symbol, Id, Sure),
    /// How sure it is that an object exists as described.
    Confidence(Id, f32),
    /// An object is dropped. Its past stays.
    Remove(Id),
    /// A share 0-1 of a region was searched for a category (0: for anything).
    Searched(Symbol, Symbol, f32),
    /// Everything is dropped but the words.
    Clear,
}

impl Op {
    /// The objects that it speaks of.
    pub fn subjects(&self) -> [Option<Id>; 2] {
        match self {
            Op::Put(object) => [Some(object.id), None],
            Op::Move(id, ..)
            | Op::Region(id, _)
            | Op::State(id, ..)
            | Op::Fluent(id, ..)
            | Op::Confidence(id, _)
            | Op::Remove(id) => [Some(*id), None],
            Op::Relate(a, _, b, _) => [Some(*a), Some(*b)],
            Op::Define(..) | Op::IsA(..) | Op::Searched(..) | Op::Clear => [None, None],
        }
    }
}

/// Confidence in steps of 1/255.
pub fn coarse(confidence: f32) -> u8 {
    (confidence.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Writes an event's body.
pub fn write(event: &Event, out: &mut Vec<u8>) {
    out.extend_from_slice(&event.valid.to_le_bytes());
    out.extend_from_slice(&event.source.to_le_bytes());
    out.push(coarse(event.confidence));
    out.push(event.evidence.len().min(MAX_EVIDENCE) as u8);
    out.extend((event.ops.len().min(MAX_OPS) as u16).to_le_bytes());
    out.extend((event.about.len().min(MAX_OPS) as u16).to_le_bytes());
    for evidence in event.evidence.iter().take(MAX_EVIDENCE) {
        out.push(evidence.series);
        out.extend_from_slice(&evidence.number.to_le_bytes());
    }
    for op in event.ops.iter().take(MAX_OPS) {
        write_op(op, out);
    }
    for id in event.about.iter().take(MAX_OPS) {
        out.extend_from_slice(&id.to_le_bytes());
    }
    out.extend_from_slice(&event.document);
}

fn write_op(op: &Op, out: &mut Vec<u8>) {
    let floats = |values: &[f32], out: &mut Vec<u8>| out.extend_from_slice(bytemuck::cast_slice(values));
    match op {
        Op::Define(kind, word) => {
            out.extend([1, *kind as u8, word.len().min(255) as u8]);
            out.extend_from_slice(word.as_bytes().get(..255).unwrap_or(word.as_bytes()));
        }
        Op::IsA(child, parent) => {
            out.push(2);
            out.extend_from_slice(&child.to_le_bytes());
            out.extend_from_slice(&parent.to_le_bytes());
        }
        Op::Put(object) => {
            out.push(3);
            out.extend_from_slice(&object.id.to_le_bytes());
            out.extend_from_slice(&object.category.to_le_bytes());
            out.extend_from_slice(&object.region.to_le_bytes());
            floats(&object.position, out);
            floats(&object.rotation, out);
            floats(&[object.confidence], out);
            out.extend([object.parts.len(), object.affordances.len(), object.states.len()].map(|n| n.min(255) as u8));
            out.extend_from_slice(bytemuck::cast_slice(&object.parts));
            out.extend_from_slice(bytemuck::cast_slice(&object.affordances));
            out.extend_from_slice(bytemuck::cast_slice(&object.states));
        }
        Op::Move(id, position, rotation) => {
            out.push(4);
            out.extend_from_slice(&id.to_le_bytes());
            floats(position, out);
            floats(rotation, out);
        }
        Op::Region(id, region) => {
            out.push(5);
            out.extend_from_slice(&id.to_le_bytes());
            out.extend_from_slice(&region.to_le_bytes());
        }
        Op::State(id, state, sure) => {
            out.push(6);
            out.extend_from_slice(&id.to_le_bytes());
            out.extend_from_slice(&state.to_le_bytes());
            out.push(*sure as u8);
        }
        Op::Fluent(id, fluent, value) => {
            out.push(7);
            out.extend_from_slice(&id.to_le_bytes());
            out.extend_from_slice(&fluent.to_le_bytes());
            out.extend_from_slice(&value.to_le_bytes());
        }
        Op::Relate(id, relation, other, sure) => {
            out.push(8);
            out.extend_from_slice(&id.to_le_bytes());
            out.extend_from_slice(&relation.to_le_bytes());
            out.extend_from_slice(&other.to_le_bytes());
            out.push(*sure as u8);
        }
        Op::Confidence(id, confidence) => {
            out.push(9);
            out.extend_from_slice(&id.to_le_bytes());
            floats(&[*confidence], out);
        }
        Op::Remove(id) => {
            out.push(10);
            out.extend_from_slice(&id.to_le_bytes());
        }
        Op::Searched(region, category, share) => {
            out.push(11);
            out.extend_from_slice(&region.to_le_bytes());
            out.extend_from_slice(&category.to_le_bytes());
            floats(&[*share], out);
        }
        Op::Clear => out.push(12),
    }
}

/// Reads an event's body; `None` for bytes that are none.
pub fn read(bytes: &[u8]) -> Option<Event> {
    let mut input = Input(bytes);
    let valid = u64::from_le_bytes(input.take()?);
    let source = input.word()?;
    let [confidence, evidence] = input.take()?;
    let (ops, about) = (input.word()?, input.word()?);
    let evidence = list(evidence.into(), &mut input, |input| {
        let [series] = input.take()?;
        Some(Evidence { series, number: u64::from_le_bytes(input.take()?) })
    })?;
    let ops = list(ops, &mut input, read_op)?;
    let about = list(about, &mut input, |input| input.id())?;
    Some(Event {
        valid,
        source,
        confidence: f32::from(confidence) / 255.0,
        evidence,
        ops,
        about,
        document: input.0.to_vec(),
    })
}

/// So many values. Room is made for what the bytes that are left can hold, not for what they say.
fn list<T>(count: u16, input: &mut Input<'_>, mut read: impl FnMut(&mut Input<'_>) -> Option<T>) -> Option<Vec<T>> {
    let mut all = Vec::with_capacity(usize::from(count).min(input.0.len()));
    for _ in 0..count {
        all.push(read(input)?);
    }
    Some(all)
}

struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*head)
    }
    fn slice(&mut self, length: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(head)
    }
    fn word(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }
    fn id(&mut self) -> Option<Id> {
        self.take().map(u32::from_le_bytes)
    }
    fn float(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }
    fn vector(&mut self) -> Option<[f32; 3]> {
        Some([self.float()?, self.float()?, self.float()?])
    }
    fn list<T: Pod>(&mut self, count: u8) -> Option<Vec<T>> {
        let bytes = self.slice(usize::from(count) * size_of::<T>())?;
        let mut values = vec![T::zeroed(); usize::from(count)];
        bytemuck::cast_slice_mut(&mut values).copy_from_slice(bytes);
        Some(values)
    }
    fn sure(&mut self) -> Option<Sure> {
        let [sure] = self.take()?;
        Sure::of(sure)
    }
}

#[inline]
fn read_op(input: &mut Input<'_>) -> Option<Op> {
    let [tag] = input.take()?;
    Some(match tag {
        1 => {
            let [kind, length] = input.take()?;
            let word = std::str::from_utf8(input.slice(length.into())?).ok()?;
            Op::Define(crate::symbols::Kind::of(kind)?, word.into())
        }
        2 => Op::IsA(input.word()?, input.word()?),
        3 => {
            let (id, category, region) = (input.id()?, input.word()?, input.word()?);
            let (position, rotation, confidence) = (input.vector()?, input.vector()?, input.float()?);
            let [parts, affordances, states] = input.take()?;
            Op::Put(Box::new(Object {
                id,
                category,
                region,
                position,
                rotation,
                confidence,
                parts: input.list(parts)?,
                affordances: input.list(affordances)?,
                states: input.list(states)?,
            }))
        }
        4 => Op::Move(input.id()?, input.vector()?, input.vector()?),
        5 => Op::Region(input.id()?, input.word()?),
        6 => Op::State(input.id()?, input.word()?, input.sure()?),
        7 => Op::Fluent(input.id()?, input.word()?, f64::from_le_bytes(input.take()?)),
        8 => Op::Relate(input.id()?, input.word()?, input.id()?, input.sure()?),
        9 => Op::Confidence(input.id()?, input.float()?),
        10 => Op::Remove(input.id()?),
        11 => Op::Searched(input.word()?, input.word()?, input.float()?),
        12 => Op::Clear,
        _ => return None,
    })
}
