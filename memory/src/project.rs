//! What an event of memory means to the engine: words, objects with parts, places, states, relations. Only what differs
//! from what the columns hold is told.

use crate::{
    entry::{Moment, ObjectEntry, Presence},
    event::{Change, Event, Regrouping, Source},
};
use acm_concept::{
    ids::ObjectId,
    literal::{Evidence, Literal, Term},
    object::GroundedPart,
};
use acm_store::{
    Id, Kind, Op, State, Symbol,
    event::{self as stored, MAX_PARTS, MAX_THETA, Sure},
};
use glam::DQuat;

/// Series of evidence: frames.
pub const FRAMES: u8 = 1;
/// Series of evidence: transitions.
pub const TRANSITIONS: u8 = 2;
/// Series of evidence: conclusions; the document says them.
pub const CONCLUSIONS: u8 = 3;

/// Bits of the engine's time that count nanoseconds of one episode; the others count episodes.
const EPISODE_BITS: u32 = 48;

/// A moment on the engine's time axis.
pub(crate) fn moment_ns(moment: Moment) -> Result<u64, String> {
    if moment.time.0 >> EPISODE_BITS != 0 || u64::from(moment.episode) >> (64 - EPISODE_BITS) != 0 {
        return Err(format!(
            "the moment {} of run {} lies beyond 78 hours or 65,535 runs",
            moment.time, moment.episode
        ));
    }
    Ok(u64::from(moment.episode) << EPISODE_BITS | moment.time.0)
}

/// A moment from the engine's time axis.
pub fn moment(ns: u64) -> Moment {
    let time = acm_concept::time::Time(ns & ((1 << EPISODE_BITS) - 1));
    Moment { episode: (ns >> EPISODE_BITS) as u32, time }
}

/// Turns events of memory into the engine's.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Projector;

impl Projector {
    /// A batch and the time at which it comes to be known. `state` is where the batch begins; it is carried along.
    pub(crate) fn batch(
        self,
        state: &mut State,
        events: &[Event],
        documents: bool,
    ) -> Result<(Vec<acm_store::Event>, u64), String> {
        let mut time = state.now;
        for event in events {
            time = time.max(moment_ns(event.moment)?);
        }
        let mut batch = Vec::with_capacity(events.len() + 1);
        for event in events {
            let mut words = Words { state, ops: Vec::new() };
            let source = words.find(Kind::Source, &source_word(&event.source));
            let ops = ops(&mut words, event);
            let (confidence, new) = (confidence(event), words.ops);
            // Words come first, in an event of their own: the operations use their numbers.
            if !new.is_empty() {
                let define = acm_store::Event::new(moment_ns(event.moment)?, 0, 1.0, new);
                state.check(std::slice::from_ref(&define), time)?;
                state.apply(&define, time);
                batch.push(define);
            }
            if let Change::Regrouped(regrouping) = &event.change {
                for past in reattributed(state, event.moment, regrouping)? {
                    state.check(std::slice::from_ref(&past), time)?;
                    state.apply(&past, time);
                    batch.push(past);
                }
            }
            let document = serde_json::to_vec(event).map_err(|error| format!("an event has no JSON: {error}"))?;
            let mut stored = acm_store::Event::new(moment_ns(event.moment)?, source, confidence, ops);
            stored.evidence = event.evidence.iter().take(stored::MAX_EVIDENCE).map(evidence).collect();
            stored.about = mentioned(&document).into_iter().take(stored::MAX_OPS).collect();
            if documents {
                stored.document = document;
            }
            state.check(std::slice::from_ref(&stored), time)?;
            state.apply(&stored, time);
            batch.push(stored);
        }
        Ok((batch, time))
    }
}

/// Words that an event uses; new ones are collected.
struct Words<'s> {
    state: &'s State,
    ops: Vec<Op>,
}

impl Words<'_> {
    fn find(&mut self, kind: Kind, word: &str) -> Symbol {
        if word.is_empty() {
            return 0;
        }
        if let Some(known) = self.state.symbols.find(kind, word) {
            return known;
        }
        let is_word = |op: &Op| matches!(op, Op::Define(k, w) if *k == kind && w == word);
        let at = self.ops.iter().position(is_word).unwrap_or_else(|| {
            self.ops.push(Op::Define(kind, word.into()));
            self.ops.len() - 1
        });
        self.state.symbols.next() + at as Symbol
    }
}

fn source_word(source: &Source) -> String {
    match source {
        Source::Camera(name) => format!("camera {name}"),
        Source::Robot => "robot".into(),
        Source::Agent => "agent".into(),
    }
}

fn confidence(event: &Event) -> f32 {
    match &event.change {
        Change::Object(believed) => believed.entry.confidence as f32,
        _ => 1.0,
    }
}

fn evidence(evidence: &Evidence) -> stored::Evidence {
    match evidence {
        Evidence::Frame(id) => stored::Evidence { series: FRAMES, number: id.0 },
        Evidence::Transition(id) => stored::Evidence { series: TRANSITIONS, number: id.0 },
        Evidence::Inferred(_) => stored::Evidence { series: CONCLUSIONS, number: 0 },
    }
}

fn ops(words: &mut Words<'_>, event: &Event) -> Vec<Op> {
    let state = words.state;
    match &event.change {
        Change::EpisodeBegan => {
            let (verified, held) = (words.find(Kind::State, "verified"), words.find(Kind::State, "held"));
            let missing = words.find(Kind::State, "missing");
            let mut ops = Vec::new();
            for id in state.ids() {
                ops.push(Op::State(id, verified, Sure::No));
                if let Some(object) = state.object(id) {
                    ops.push(Op::Confidence(id, 0.8 * object.confidence));
                }
                if state.sure(id, held) == Sure::Yes {
                    ops.extend([Op::State(id, held, Sure::No), Op::State(id, missing, Sure::Yes)]);
                }
            }
            ops.truncate(stored::MAX_OPS);
            ops
        }
        Change::Object(believed) => object(words, &believed.entry),
        // Identities that are there already; others were put with their past.
        Change::Regrouped(regrouping) => {
            let objects = regrouping.after.objects.iter();
            objects.flat_map(|whole| object(words, &whole.entry)).take(stored::MAX_OPS).collect()
        }
        Change::Forgotten(forget) => {
            let ids = forget.objects.iter().filter_map(|id| narrow(*id));
            ids.filter(|id| state.row(*id).is_some()).map(Op::Remove).collect()
        }
        Change::Wiped(_) => vec![Op::Clear],
        _ => Vec::new(),
    }
}

/// The past of regrouped identities, as it is known from now on: reports of earlier moments.
fn reattributed(state: &State, now: Moment, regrouping: &Regrouping) -> Result<Vec<acm_store::Event>, String> {
    let mut events = Vec::new();
    let mut say = |moment: Moment, op: Op| -> Result<(), String> {
        // What is said of a time beyond this one is said of now.
        events.push(acm_store::Event::new(moment_ns(moment.min(now))?, 0, 1.0, vec![op]));
        Ok(())
    };
    for id in regrouping.after.gone.iter().filter_map(|id| narrow(*id)).filter(|id| state.row(*id).is_some()) {
        let of = regrouping.before.objects.iter().find(|whole| narrow(whole.entry.id) == Some(id));
        let born = of.and_then(|whole| whole.entry.history.first()).map_or(now, |first| first.moment);
        say(born, Op::Remove(id))?;
    }
    for whole in &regrouping.after.objects {
        let Some(id) = narrow(whole.entry.id) else { continue };
        let old = regrouping.before.objects.iter().find(|old| old.entry.id == whole.entry.id);
        let old = old.map_or(&[][..], |old| &old.entry.history);
        let history = &whole.entry.history;
        if old == history.as_slice() {
            continue;
        }
        let rotation = |pose: &acm_concept::pose::Pose| vector_part(pose.rotation);
        let at = |moment: Moment| {
            let known = history.iter().rev().filter(|entry| entry.moment <= moment);
            known.filter_map(|entry| entry.place).map(|place| place.pose).next()
        };
        if state.row(id).is_none() {
            let begin = history.first().map_or(now, |first| first.moment);
            let pose = at(begin).or(whole.entry.pose()).unwrap_or_default();
            let object = stored::Object {
                id,
                category: 0,
                region: 0,
                position: pose.translation.as_vec3().to_array(),
                rotation: rotation(&pose),
                confidence: whole.entry.confidence as f32,
                parts: Vec::new(),
                affordances: Vec::new(),
                states: Vec::new(),
            };
            say(begin, Op::Put(Box::new(object)))?;
        }
        let mut moments: Vec<Moment> = old.iter().chain(history).map(|entry| entry.moment).collect();
        moments.sort();
        moments.dedup();
        for (moment, pose) in moments.into_iter().filter_map(|moment| Some((moment, at(moment)?))) {
            say(moment, Op::Move(id, pose.translation.as_vec3().to_array(), rotation(&pose)))?;
        }
    }
    Ok(events)
}

/// An id as the engine has it.
pub fn narrow(id: ObjectId) -> Option<Id> {
    Id::try_from(id.0).ok().filter(|id| *id <= acm_store::MAX_ID)
}

fn object(words: &mut Words<'_>, entry: &ObjectEntry) -> Vec<Op> {
    let state = words.state;
    // One that is too large is refused by the engine, in words.
    let id = narrow(entry.id).unwrap_or(Id::MAX);
    let pose = entry.pose().unwrap_or_default();
    let (position, rotation) = (pose.translation.as_vec3().to_array(), vector_part(pose.rotation));
    let category = words.find(Kind::Category, &entry.category);
    let parts: Vec<stored::Part> = entry.parts.iter().take(MAX_PARTS).map(|p| part(words, p)).collect();
    let mut affordances: Vec<Symbol> = Vec::new();
    for word in entry.parts.iter().flat_map(|part| part.affordances.iter().skip(2)) {
        let symbol = words.find(Kind::Affordance, word);
        if !affordances.contains(&symbol) && affordances.len() < 255 {
            affordances.push(symbol);
        }
    }
    let confidence = entry.confidence as f32;
    let known = state.object(id);
    let is_described = known.as_ref().is_some_and(|known| {
        known.category == category && known.parts == parts && affordances.iter().all(|a| known.affordances.contains(a))
    });
    let mut ops = Vec::new();
    if is_described {
        let known = known.as_ref();
        if known.is_some_and(|known| known.position != position || known.rotation != rotation) {
            ops.push(Op::Move(id, position, rotation));
        }
        if known.is_some_and(|known| (known.confidence - confidence).abs() > 1e-4) {
            ops.push(Op::Confidence(id, confidence));
        }
    } else {
        let states = Vec::new();
        let object =
            stored::Object { id, category, region: 0, position, rotation, confidence, parts, affordances, states };
        ops.push(Op::Put(Box::new(object)));
    }
    let flags = [
        ("present", entry.presence == Presence::Present),
        ("held", entry.presence == Presence::Held),
        ("missing", entry.presence == Presence::Missing),
        ("verified", entry.verified),
        ("ambiguous", !entry.ambiguous_with.is_empty()),
    ];
    for (word, holds) in flags {
        let symbol = words.find(Kind::State, word);
        let sure = if holds { Sure::Yes } else { Sure::No };
        if state.sure(id, symbol) != sure {
            ops.push(Op::State(id, symbol, sure));
        }
    }
    relate(words, id, entry, &mut ops);
    literals(words, id, &entry.state, &mut ops);
    ops
}

/// What it rests on. An object that is not known to the engine cannot be spoken of.
fn relate(words: &mut Words<'_>, id: Id, entry: &ObjectEntry, ops: &mut Vec<Op>) {
    let state = words.state;
    let on = words.find(Kind::Relation, "on");
    let support = entry.support.and_then(narrow).filter(|support| state.row(*support).is_some());
    let before: Vec<Id> = state.relations.objects(id, on).collect();
    let there = |other: &Id| state.row(*other).is_some();
    ops.extend(before.iter().filter(|o| Some(**o) != support && there(o)).map(|o| Op::Relate(id, on, *o, Sure::No)));
    ops.extend(support.filter(|support| !before.contains(support)).map(|s| Op::Relate(id, on, s, Sure::Yes)));
}

/// Symbolic state: `p(o)` is a state, `p(o, number)` a number, `p(o, other)` a relation.
fn literals(words: &mut Words<'_>, id: Id, literals: &[Literal], ops: &mut Vec<Op>) {
    let state = words.state;
    for literal in literals.iter().take(200) {
        let sure = if literal.negated { Sure::No } else { Sure::Yes };
        match literal.arguments.as_slice() {
            [_] => {
                let symbol = words.find(Kind::State, &literal.predicate);
                if state.sure(id, symbol) != sure {
                    ops.push(Op::State(id, symbol, sure));
                }
            }
            [_, Term::Number(value)] => {
                let symbol = words.find(Kind::Fluent, &literal.predicate);
                if state.number(id, symbol) != Some(*value) {
                    ops.push(Op::Fluent(id, symbol, *value));
                }
            }
            [_, Term::Object(other)] => {
                let symbol = words.find(Kind::Relation, &literal.predicate);
                if let Some(other) = narrow(*other).filter(|other| state.row(*other).is_some()) {
                    ops.push(Op::Relate(id, symbol, other, sure));
                }
            }
            _ => {}
        }
    }
}

fn part(words: &mut Words<'_>, part: &GroundedPart) -> stored::Part {
    let mut theta = [0.0; MAX_THETA];
    for (slot, parameter) in theta.iter_mut().zip(&part.parameters) {
        *slot = parameter.value as f32;
    }
    let mut affordances = [0; 2];
    for (slot, word) in affordances.iter_mut().zip(&part.affordances) {
        *slot = words.find(Kind::Affordance, word);
    }
    stored::Part {
        template: words.find(Kind::Template, &part.template),
        name: words.find(Kind::Name, &part.name),
        theta,
        position: part.pose.pose.translation.as_vec3().to_array(),
        rotation: vector_part(part.pose.pose.rotation),
        affordances,
    }
}

fn vector_part(rotation: DQuat) -> [f32; 3] {
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    [rotation.x as f32, rotation.y as f32, rotation.z as f32]
}

/// The objects that a document speaks of: every `O12` or `P12.3` in it.
pub(crate) fn mentioned(document: &[u8]) -> Vec<Id> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(rest) = document.get(at..).filter(|rest| !rest.is_empty()) {
        let skip = rest.iter().position(|byte| matches!(byte, b'O' | b'P')).unwrap_or(rest.len());
        let start = at + skip;
        let is_word = start > 0 && document.get(start - 1).is_some_and(u8::is_ascii_alphanumeric);
        let digits = document.get(start + 1..).unwrap_or_default();
        let length = digits.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let number = std::str::from_utf8(digits.get(..length).unwrap_or_default()).ok().and_then(|d| d.parse().ok());
        if let Some(id) = number.filter(|_| !is_word)
            && !found.contains(&id)
        {
            found.push(id);
        }
        at = start + 1 + length;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_in_a_document_are_found_wherever_they_stand() {
        let document = br#"{"a":["O1","P12.3"],"text":"O7, on which it was, and xO9 or PO","n":"O1"}"#;
        assert_eq!(mentioned(document), [1, 12, 7]);
    }
}
