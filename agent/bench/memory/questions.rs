//! Questions to a settled world.

use super::{BenchResult, Row, cpu_us, row};
use crate::statistics::median_and;
use acm_store::{
    Condition, Event, Id, Op, Query, State, Symbol,
    condition::{Compare, truth},
    event::Sure,
    execute,
    fork::{Effect, Fork},
    query::Filter,
    testing::worlds::World,
};
use std::hint::black_box;

/// Questions of each kind.
const QUESTIONS: usize = 4000;

/// Measures all questions at one size; `figures`: they are the ones that the targets speak of.
pub fn measure(size: u32, world: &mut World, state: &State, figures: bool, result: &mut BenchResult) {
    let scoped: Vec<Query> = (0..QUESTIONS).map(|_| world.scoped()).collect();
    let unscoped: Vec<Query> = (0..QUESTIONS).map(|_| world.unscoped()).collect();
    let times = |questions: &[Query]| each(questions, |query| drop(black_box(execute::answer(state, query))));
    let (scoped_us, unscoped_us) = (times(&scoped), times(&unscoped));
    let places: Vec<[f32; 3]> = (0..QUESTIONS)
        .map(|_| {
            let room = world.draw.below(super::ROOMS);
            world.place(room)
        })
        .collect();
    let nearest_us = each(&places, |at| drop(black_box(state.nearest(*at, 10, f32::INFINITY, None))));
    let (of_ten, of_twenty) = (preconditions(size, world, state), rollouts(size, world, state));
    for (name, us) in [("scoped query", &scoped_us), ("unscoped query", &unscoped_us), ("nearest 10", &nearest_us)] {
        result.rows.push(row(name, size, us));
    }
    result.rows.push(row("brute force, scoped", size, &brute(state, &scoped)));
    let (past_us, bytes_per_event) = past(size, world, state);
    result.rows.push(row("object as of a moment", size, &past_us));
    let bytes = state.bytes();
    let per_object = |bytes: usize| bytes as f64 / f64::from(size);
    let values = [
        ("hot_bytes_per_object", per_object(bytes.hot)),
        ("full_bytes_per_object", per_object(bytes.hot + bytes.parts)),
        ("history_bytes_per_event", bytes_per_event),
        ("precondition10_ns", of_ten),
        ("fork_rollout20_us", of_twenty),
        ("objects", f64::from(size)),
    ];
    result.rows.push(Row { group: Some(format!("{size}")), ..Row::new("size and logic", values) });
    if figures {
        for (name, us) in [("scoped_query", &scoped_us), ("unscoped_query", &unscoped_us)] {
            let (p50, p99) = median_and(0.99, us);
            result.figure(&format!("{name}_p50_us"), p50);
            result.figure(&format!("{name}_p99_us"), p99);
        }
        result.figure("nearest10_p50_us", median_and(0.99, &nearest_us).0);
        result.figure("as_of_object_us", median_and(0.99, &past_us).0);
        result.figure("precondition10_ns", of_ten);
        result.figure("fork_rollout20_us", of_twenty);
        result.figure("bytes_per_object_hot", per_object(bytes.hot));
        result.figure("bytes_per_object_full", per_object(bytes.hot + bytes.parts));
        result.figure("bytes_per_event_history", bytes_per_event);
    }
}

/// Processor time of each question, after one round that warms up.
fn each<T>(questions: &[T], ask: impl Fn(&T)) -> Vec<f64> {
    questions.iter().for_each(&ask);
    let one = |question: &T| {
        let began = cpu_us();
        ask(question);
        cpu_us() - began
    };
    questions.iter().map(one).collect()
}

/// The same answers by trying every filter on every object.
fn brute(state: &State, queries: &[Query]) -> Vec<f64> {
    let few: Vec<&Query> = queries.iter().take(20).collect();
    each(&few, |query| {
        let filters = Filter::of(query, state);
        let mut found: Vec<(f32, Id)> = Vec::new();
        for block in state.table.blocks.iter() {
            let hot = block.hot.get();
            for row in acm_store::block::rows(hot.live) {
                if filters.iter().all(|filter| filter.passes(state, block, row)) {
                    let near = query.near.map_or(0.0, |near| {
                        let [x, y, z] = block.position(row);
                        let [dx, dy, dz] = [x - near.at[0], y - near.at[1], z - near.at[2]];
                        (dx * dx + dy * dy + dz * dz).sqrt() / near.scale_m
                    });
                    found.push((hot.weight[row] - near, hot.id[row]));
                }
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        black_box(found.first());
    })
}

/// Ten literals over three objects: states, a relation, numbers, a category and a part. Nanoseconds for all ten.
fn preconditions(size: u32, world: &mut World, state: &State) -> f64 {
    let conditions: Vec<Condition> = (0..2000).map(|_| ten(size, world, state)).collect();
    let round = || {
        let began = cpu_us();
        for condition in &conditions {
            black_box(truth(state, condition));
        }
        (cpu_us() - began) * 1e3 / conditions.len() as f64
    };
    let rounds: Vec<f64> = (0..7).map(|_| round()).collect();
    median_and(0.5, &rounds).0
}

/// Ten literals that all have to be looked up: none of them is false.
fn ten(size: u32, world: &mut World, state: &State) -> Condition {
    let mut id = || world.draw.below(size as usize) as Id;
    let (a, b, c) = (id(), id(), id());
    let words = &world.words;
    let object = state.object(a);
    let category = object.as_ref().map_or(0, |object| object.category);
    let template = object.as_ref().and_then(|object| object.parts.first()).map_or(0, |part| part.template);
    let held = |id: Id| state.object(id).and_then(|object| object.states.first().copied()).unwrap_or_default();
    let first = |all: &[Symbol]| all.first().copied().unwrap_or_default();
    let not_known = |id: Id, word: Symbol| Condition::Not(Box::new(Condition::State(id, word)));
    let other = |id: Id| {
        let known = state.object(id).map(|object| object.states).unwrap_or_default();
        words.states.iter().copied().find(|word| !known.contains(word)).unwrap_or_default()
    };
    Condition::All(vec![
        Condition::State(a, held(a)),
        Condition::State(b, held(b)),
        Condition::State(c, held(c)),
        not_known(a, other(a)),
        not_known(b, other(b)),
        Condition::Related(a, first(&words.relations), b),
        Condition::Number(a, first(&words.fluents), Compare::AtLeast, 0.1),
        Condition::IsA(a, category),
        Condition::HasPart(a, template),
        Condition::In(c, state.object(c).map_or(0, |object| object.region)),
    ])
}

/// A fork and twenty steps of five conditions and three effects each, microseconds.
fn rollouts(size: u32, world: &mut World, state: &State) -> f64 {
    let mut times = Vec::new();
    for _ in 0..2000 {
        let steps: Vec<(Vec<Condition>, Vec<Effect>)> = (0..20)
            .map(|_| {
                let id = world.draw.below(size as usize) as Id;
                let object = state.object(id);
                let held = object.as_ref().and_then(|object| object.states.first().copied()).unwrap_or_default();
                let category = object.as_ref().map_or(0, |object| object.category);
                let region = object.as_ref().map_or(0, |object| object.region);
                let conditions = vec![
                    Condition::State(id, held),
                    Condition::IsA(id, category),
                    Condition::In(id, region),
                    Condition::Any(vec![Condition::State(id, held), Condition::In(id, region)]),
                    Condition::Not(Box::new(Condition::Not(Box::new(Condition::State(id, held))))),
                ];
                let states = &world.words.states;
                let effects = vec![
                    Effect::State(id, states.first().copied().unwrap_or_default(), Sure::Yes),
                    Effect::State(id, states.get(1).copied().unwrap_or_default(), Sure::No),
                    Effect::Region(id, region),
                ];
                (conditions, effects)
            })
            .collect();
        let began = cpu_us();
        let mut fork = Fork::new(state);
        for (conditions, effects) in &steps {
            black_box(fork.step(conditions, effects));
        }
        black_box(&fork);
        times.push(cpu_us() - began);
    }
    median_and(0.5, &times).0
}

/// Ten changes each of a tenth of the objects: reading an object as of a moment between them, and bytes per change.
fn past(size: u32, world: &mut World, state: &State) -> (Vec<f64>, f64) {
    let objects = (size as usize / 10).max(1);
    let mut state = state.clone();
    let begin = 2_000_000u64;
    for batch in 0..u64::from(size / 1000) {
        let time = begin + batch * 1000;
        let events: Vec<Event> = (0..1000).map(|_| slide(world, objects, time)).collect();
        events.iter().for_each(|event| state.apply(event, time));
        state.commit(time);
    }
    state.settle(true);
    let bytes = state.bytes().history as f64 / f64::from(size / 1000 * 1000).max(1.0);
    let questions: Vec<(Id, u64)> = (0..20_000)
        .map(|_| (world.draw.below(objects) as Id, begin + world.draw.below(size as usize) as u64))
        .collect();
    (
        each(&questions, |(id, moment)| {
            black_box(state.as_of(*id, *moment, u64::MAX));
        }),
        bytes,
    )
}

/// A thing is slid along upright, or a state of it changes.
fn slide(world: &mut World, objects: usize, time: u64) -> Event {
    let mut event = world.change(objects, time);
    for op in &mut event.ops {
        if let Op::Move(_, _, rotation) = op {
            *rotation = [0.0; 3];
        }
    }
    event
}
