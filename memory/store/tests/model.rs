//! The engine against the naive reference, over events drawn from seeds: present, past, queries, nearest, relations,
//! after closing and opening, with and without a snapshot.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)] // a failed step is a failed test

use acm_store::{
    Event, Id, Op, Query, State, Store, Symbol,
    event::Sure,
    execute,
    query::Near,
    testing::{
        Draw,
        faults::FaultDisk,
        naive::{self, Naive},
        worlds::World,
    },
};
use proptest::prelude::*;

/// Draws batches in which anything may happen; retroactive events among them.
fn batch(world: &mut World, reference: &Naive, time: u64, next: &mut Id) -> Vec<Event> {
    let mut there: Vec<Id> = reference.now().keys().copied().collect();
    let source = world.words.source;
    let count = 1 + world.draw.below(4);
    let mut events = Vec::new();
    for _ in 0..count {
        // Moments that are no multiples of a microsecond are among them.
        let earlier = [0, 0, 0, 5_000, 12_345, time / 2][world.draw.below(6)];
        let valid = time.saturating_sub(earlier);
        let late = valid < time;
        let pick = (!there.is_empty()).then(|| there[world.draw.below(there.len())]);
        let op = match (world.draw.below(16), pick) {
            (0..5, _) | (_, None) => {
                *next += 1;
                there.push(*next);
                let object = world.object(*next);
                events.push(Event::new(time, source, 0.9, vec![Op::Put(Box::new(object))]));
                continue;
            }
            (5..8, Some(id)) => {
                let room = world.draw.below(world.words.regions.len());
                // Many a thing is moved without being turned.
                let turn = [0.0, 0.25, world.draw.unit() * 0.5][world.draw.below(3)];
                Op::Move(id, world.place(room), [0.0, 0.0, turn])
            }
            (8..11, Some(id)) => {
                let state = world.words.states[world.draw.below(4)];
                Op::State(id, state, [Sure::Yes, Sure::No, Sure::Unknown][world.draw.below(3)])
            }
            (11, Some(id)) => Op::Region(id, world.words.regions[world.draw.below(world.words.regions.len())]),
            (12, Some(id)) => Op::Confidence(id, 0.2 + 0.8 * world.draw.unit()),
            (13, Some(id)) => Op::Fluent(id, world.words.fluents[world.draw.below(2)], f64::from(world.draw.unit())),
            (14, Some(id)) => {
                let other = there[world.draw.below(there.len())];
                let sure = [Sure::Yes, Sure::Yes, Sure::No, Sure::Unknown][world.draw.below(4)];
                Op::Relate(id, world.words.relations[0], other, sure)
            }
            (_, Some(id)) if world.draw.chance(0.3) => {
                there.retain(|other| *other != id);
                events.push(Event::new(time, source, 0.9, vec![Op::Remove(id)]));
                continue;
            }
            (_, Some(id)) => {
                let object = world.object(id);
                events.push(Event::new(time, source, 0.9, vec![Op::Put(Box::new(object))]));
                continue;
            }
        };
        // What the naive reference takes for unborn at that moment is no fair question.
        let born = !late || reference.at(valid, time).contains_key(&op.subjects()[0].unwrap());
        events.push(Event::new(if born { valid } else { time }, source, 0.9, vec![op]));
    }
    events
}

fn random_query(world: &mut World) -> Query {
    let mut query = match world.draw.below(3) {
        0 => world.scoped(),
        1 => world.unscoped(),
        _ => {
            let like = world.object(0);
            Query { near: Some(Near { at: like.position, scale_m: 2.0, within_m: Some(4.0) }), ..Query::default() }
        }
    };
    if world.draw.chance(0.3) {
        query.states = vec![(world.words.states[world.draw.below(4)], world.draw.chance(0.5))];
    }
    if world.draw.chance(0.3) {
        query.affordances.clear();
    }
    if world.draw.chance(0.2) {
        query.numbers = vec![(world.words.fluents[0], 0.2, 0.9)];
    }
    if world.draw.chance(0.2) {
        query.min_confidence = Some(0.6);
    }
    if world.draw.chance(0.2) {
        query.geometry = vec![(world.words.templates[0], 1, 0.1, 0.7)];
    }
    query.most = 1 + world.draw.below(12);
    query
}

/// Every answer of the state is the reference's; after a compaction it knows no relation of what is gone.
pub fn agree(
    state: &State,
    reference: &Naive,
    world: &mut World,
    moments: &[u64],
    compacted: bool,
) -> Result<(), String> {
    let now = reference.now();
    let ids: Vec<Id> = state.ids().collect();
    if ids != now.keys().copied().collect::<Vec<_>>() {
        return Err(format!("objects {ids:?}, should be {:?}", now.keys()));
    }
    for (id, then) in &now {
        let mut found = state.object(*id).unwrap();
        let mut wanted = then.object.clone();
        found.states.sort_unstable();
        wanted.states.sort_unstable();
        (found.confidence, wanted.confidence) = (0.0, 0.0);
        if found != wanted {
            return Err(format!("object {id} is {found:?}, should be {wanted:?}"));
        }
        let number = |fluent: &Symbol| (state.number(*id, *fluent), then.numbers.get(fluent).copied());
        if world.words.fluents.iter().map(number).any(|(a, b)| a != b) {
            return Err(format!("a number of {id} is wrong"));
        }
    }
    for _ in 0..4 {
        let query = random_query(world);
        let (found, wanted) = (execute::answer(state, &query).hits, naive::answer(&now, &query));
        if found.iter().map(|hit| hit.id).ne(wanted.iter().map(|hit| hit.id)) {
            return Err(format!("{query:?} gives {found:?}, should be {wanted:?}"));
        }
        let at = world.place(0);
        let near = state.nearest(at, 5, f32::INFINITY, None);
        let mut wanted: Vec<(f32, Id)> = now
            .iter()
            .map(|(id, then)| {
                let [x, y, z] = [0, 1, 2].map(|axis| then.object.position[axis] - at[axis]);
                ((x * x + y * y + z * z).sqrt(), *id)
            })
            .collect();
        wanted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        wanted.truncate(5);
        if near.iter().map(|(id, _)| *id).ne(wanted.iter().map(|(_, id)| *id)) {
            return Err(format!("nearest to {at:?}: {near:?}, should be {wanted:?}"));
        }
    }
    for _ in 0..6 {
        let (valid, known) = (moments[world.draw.below(moments.len())], moments[world.draw.below(moments.len())]);
        let then = reference.at(valid, known);
        for id in 0..=ids.last().copied().unwrap_or(0) + 2 {
            let found = state.as_of(id, valid, known).filter(|past| past.there);
            let wanted = then.get(&id);
            if found.is_some() != wanted.is_some() {
                return Err(format!("{id} as of ({valid}, {known}): {found:?}, should be {wanted:?}"));
            }
            let (Some(found), Some(wanted)) = (found, wanted) else { continue };
            let object = &wanted.object;
            if (found.position, found.region, found.category, found.rotation)
                != (object.position, object.region, object.category, object.rotation)
            {
                return Err(format!("{id} as of ({valid}, {known}): {found:?}, should be {object:?}"));
            }
            for word in &world.words.states[..4] {
                let wanted = match (object.states.contains(word), wanted.not.contains(word)) {
                    (true, _) => Sure::Yes,
                    (_, true) => Sure::No,
                    _ => Sure::Unknown,
                };
                let found = state.sure_as_of(id, *word, valid, known);
                if found != wanted {
                    return Err(format!(
                        "state {word} of {id} as of ({valid}, {known}): {found:?}, should be {wanted:?}"
                    ));
                }
            }
        }
    }
    let relations = reference.relations();
    for ((a, relation, b), sure) in &relations {
        if compacted && !(now.contains_key(a) && now.contains_key(b)) {
            continue;
        }
        let found = state.relations.get(*a, *relation, *b).map(|edge| edge.sure);
        if found != Some(*sure as u8) {
            return Err(format!("relation {a} {relation} {b}: {found:?}, should be {sure:?}"));
        }
    }
    let count = state.relations.forth.iter().count();
    if !compacted && count != relations.len() || state.relations.back.iter().count() != count {
        return Err(format!("{count} relations, should be {}", relations.len()));
    }
    Ok(())
}

/// Opens a store on a fresh disk, runs `steps` batches, and compares after each few.
fn run(seed: u64, steps: usize, compacts: bool) -> Result<(), String> {
    let (mut world, words) = World::new(seed, 4, 6);
    let disk = FaultDisk::default();
    let (mut store, _) = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).unwrap();
    let mut reference = Naive::default();
    let mut moments = vec![0];
    store.commit(std::slice::from_ref(&words), 0).unwrap();
    reference.commit(&[words], 0);
    let (mut next, mut compacted) = (0, false);
    for step in 1..=steps {
        let time = step as u64 * 1_000_003;
        let events = batch(&mut world, &reference, time, &mut next);
        store.commit(&events, time).map_err(|error| error.to_string())?;
        reference.commit(&events, time);
        moments.extend([time, time - 5_000]);
        if step % 8 == 0 {
            agree(store.state(), &reference, &mut world, &moments, compacted)
                .map_err(|e| format!("step {step}: {e}"))?;
            match world.draw.below(if compacts { 7 } else { 5 }) {
                0 => drop(store.view()),
                1 => store.snapshot(b"mine").unwrap(),
                2 => {
                    drop(store);
                    let opened = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(()));
                    store = opened.map_err(|error| error.to_string())?.0;
                }
                5 | 6 => {
                    let horizon = moments[world.draw.below(moments.len())];
                    let done = store.compact(horizon, |_| Ok(Vec::new())).map_err(|error| error.to_string())?;
                    assert!(done.events.1 <= done.events.0, "{done:?}");
                    // Of what was before nobody asks any more.
                    moments.retain(|moment| *moment >= horizon);
                    compacted = true;
                }
                _ => {}
            }
            agree(store.state(), &reference, &mut world, &moments, compacted)
                .map_err(|e| format!("step {step}, again: {e}"))?;
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn every_answer_is_the_naive_references(seed in any::<u64>()) {
        prop_assert_eq!(run(seed, 64, false), Ok(()));
    }

    #[test]
    fn compaction_changes_no_answer_about_what_came_since(seed in any::<u64>()) {
        prop_assert_eq!(run(seed, 64, true), Ok(()));
    }
}

#[test]
fn no_block_is_passed_over_that_holds_a_hit() {
    // Many blocks, and few of the objects among the first ten: bounds decide.
    let (mut world, words) = World::new(6, 4, 6);
    let (mut store, mut reference) = (Store::in_memory(), Naive::default());
    store.commit(std::slice::from_ref(&words), 0).unwrap();
    reference.commit(&[words], 0);
    let puts: Vec<Event> = (0..8000).map(|id| world.put(id, 1)).collect();
    store.commit(&puts, 1).unwrap();
    reference.commit(&puts, 1);
    let (state, now) = (store.view(), reference.now());
    let mut full = 0;
    for number in 0..400 {
        let mut query = if number % 2 == 0 { world.scoped() } else { world.unscoped() };
        let near = world.scoped().near;
        match number % 8 {
            1 | 3 => query.near = near,
            4 => query.region = None,
            // So wide that confidence decides: the best lie in all blocks.
            5 => query = Query { near: near.map(|near| Near { scale_m: 50.0, ..near }), ..Query::default() },
            6 => query.categories.clear(),
            _ => {}
        }
        let (found, wanted) = (execute::answer(&state, &query).hits, naive::answer(&now, &query));
        full += usize::from(wanted.len() == 10);
        assert!(found.iter().map(|hit| hit.id).eq(wanted.iter().map(|hit| hit.id)), "{query:?} gives {found:?}");
    }
    assert!(full > 100, "{full} questions have more hits than are told");
}

#[test]
fn compaction_drops_what_was_superseded_and_keeps_what_was_said_since() {
    let (mut world, words) = World::new(3, 4, 6);
    let disk = FaultDisk::default();
    let (mut store, _) = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).unwrap();
    store.commit(&[words], 0).unwrap();
    store.commit(&(0..20).map(|id| world.put(id, 1)).collect::<Vec<_>>(), 1).unwrap();
    let source = world.words.source;
    for time in 2..2000u64 {
        let mut event =
            Event::new(time, source, 1.0, vec![Op::Move(time as Id % 20, [time as f32, 0.5, 0.5], [0.0; 3])]);
        event.document = format!("step {time}").into_bytes();
        store.commit(&[event], time).unwrap();
    }
    let asked: Vec<_> = (1900..2000).map(|t| store.state().as_of(7, t, t).unwrap()).collect();
    let mut told = Vec::new();
    let done = store
        .compact(1900, |before| {
            told = before.iter().map(|(_, event)| event.document.clone()).collect();
            let mut event = Event::new(1899, source, 1.0, Vec::new());
            event.document = b"all of it".to_vec();
            Ok(vec![event])
        })
        .unwrap();
    // The words, 20 objects with their last move each, the base, and 100 moves since.
    assert_eq!(done.events, (1 + 20 + 1998, 1 + 20 + 20 + 1 + 100));
    assert!(done.bytes.1 * 20 < done.bytes.0, "{done:?}");
    assert_eq!((told.len(), told.last().unwrap().as_slice()), (1 + 20 + 1898, b"step 1899".as_slice()));
    let reopened = || Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).unwrap().0;
    drop(store);
    let mut store = reopened();
    let again: Vec<_> = (1900..2000).map(|t| store.state().as_of(7, t, t).unwrap()).collect();
    assert_eq!(again, asked);
    let documents: Vec<_> = store.events().unwrap().into_iter().map(|(_, event)| event.document).collect();
    assert!(documents.contains(&b"all of it".to_vec()) && documents.contains(&b"step 1900".to_vec()));
    assert!(!documents.contains(&b"step 1899".to_vec()));
    // A base that is refused changes nothing.
    assert!(store.compact(1950, |_| Err("no".into())).is_err());
    assert_eq!(store.state().next, done.events.1);
}

#[test]
fn readers_keep_their_view_while_the_writer_goes_on() {
    let (mut world, words) = World::new(3, 4, 6);
    let mut store = Store::in_memory();
    store.commit(&[words], 0).unwrap();
    let puts: Vec<Event> = (0..600).map(|id| world.put(id, 1)).collect();
    store.commit(&puts, 1).unwrap();
    let reader = store.reader();
    let before = reader.view();
    let place = before.position(7).unwrap();
    let source = world.words.source;
    store
        .commit(&[Event::new(2, source, 1.0, vec![Op::Move(7, [9.0, 9.0, 9.0], [0.0; 3]), Op::Remove(8)])], 2)
        .unwrap();
    assert_eq!(before.position(7), Some(place));
    assert!(before.row(8).is_some());
    let after = reader.view();
    assert_eq!(after.position(7), Some([9.0, 9.0, 9.0]));
    assert_eq!(after.row(8), None);
    assert_eq!(after.nearest([9.0; 3], 1, 0.1, None), [(7, 0.0)]);
    assert_eq!(store.state().as_of(7, 1, 2).unwrap().position, place);
}

#[test]
fn a_refused_batch_leaves_nothing_behind() {
    let (mut world, words) = World::new(4, 2, 3);
    let mut store = Store::in_memory();
    store.commit(&[words], 0).unwrap();
    let source = world.words.source;
    let put = world.put(1, 1);
    for bad in [
        Op::Move(2, [0.0; 3], [0.0; 3]),
        Op::Move(1, [f32::NAN, 0.0, 0.0], [0.0; 3]),
        Op::State(1, world.words.regions[0], Sure::Yes),
        Op::Define(acm_store::Kind::Region, "room-0".into()),
        Op::Region(1, 4000),
    ] {
        let events = [put.clone(), Event::new(1, source, 1.0, vec![bad])];
        assert!(store.commit(&events, 1).is_err());
        assert_eq!((store.state().next, store.state().table.live), (1, 0));
    }
    store.commit(&[put], 5).unwrap();
    assert!(store.commit(&[world.put(2, 4)], 4).unwrap_err().to_string().contains("comes after"));
    let mut draw = Draw::new(1);
    assert_ne!(draw.bits(), draw.bits());
}
