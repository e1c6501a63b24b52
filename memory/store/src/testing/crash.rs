//! The power fails anywhere: what was acknowledged is there afterwards, and of what was not all or nothing.

use crate::{
    Event, Id, State, Store,
    forget::Forget,
    testing::{Draw, faults::FaultDisk, worlds::World},
};

/// What came of many failures.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Failures.
    pub points: u64,
    /// After which something acknowledged was gone, or a batch was there in part.
    pub lost: u64,
    /// After which the folder could not be opened.
    pub refused: u64,
    /// The first of them, in words.
    pub first: Option<String>,
}

/// Everything that can be read from a state, as a checksum.
pub fn digest(state: &State) -> u32 {
    let mut check = crc32c::crc32c(&state.table.live.to_le_bytes());
    let mut add = |text: String| check = crc32c::crc32c_append(check, text.as_bytes());
    for id in state.ids() {
        add(format!("{:?}", state.object(id)));
        let last = state.head(id).map_or(0, |(heads, at)| heads.of[at].last);
        add(format!("{:?}", state.history.changes(last)));
    }
    state.relations.forth.iter().for_each(|edge| add(format!("{edge:?}")));
    check
}

/// Fails at `points` operations, drawn from a seed; `tick` is called after each.
pub fn run(points: u64, seed: u64, mut tick: impl FnMut()) -> Outcome {
    let mut outcome = Outcome { points, ..Outcome::default() };
    for point in 0..points {
        let mut draw = Draw::new(seed.wrapping_mul(1_000_003).wrapping_add(point));
        match one(&mut draw) {
            Ok(()) => {}
            Err(Fault::Lost(reason)) => {
                outcome.lost += 1;
                outcome.first.get_or_insert(format!("point {point}: {reason}"));
            }
            Err(Fault::Refused(reason)) => {
                outcome.refused += 1;
                outcome.first.get_or_insert(format!("point {point}: {reason}"));
            }
        }
        tick();
    }
    outcome
}

enum Fault {
    Lost(String),
    Refused(String),
}

fn one(draw: &mut Draw) -> Result<(), Fault> {
    let refused = |error: crate::StoreError| Fault::Refused(error.to_string());
    let disk = FaultDisk::default();
    let (mut store, _) = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).map_err(refused)?;
    let (mut world, words) = World::new(draw.bits(), 4, 6);
    store.commit(&[words], 0).map_err(refused)?;
    disk.fail_at(disk.operations() + 1 + draw.below(60) as u64);
    // What must be there, and what may be.
    let mut sure = digest(store.state());
    let mut maybe = sure;
    let mut next: Id = 0;
    for step in 1..200u64 {
        let time = step * 1000;
        let result = match draw.below(20) {
            0 => store.snapshot(b"document"),
            1 if next > 0 => {
                let what = Forget { objects: vec![draw.below(next as usize) as Id], ..Forget::default() };
                rewritten(&mut store, &|store| store.forget(&what, |_, _| None).map(drop), &mut sure, &mut maybe)
            }
            2 => {
                let horizon = draw.below(step as usize) as u64 * 1000;
                let compact = |store: &mut Store| store.compact(horizon, |_| Ok(Vec::new())).map(drop);
                rewritten(&mut store, &compact, &mut sure, &mut maybe)
            }
            grouped => {
                let events = batch(&mut world, draw, &mut next, time);
                let result = store.enqueue(&events, time);
                maybe = digest(store.state());
                if grouped < 5 && result.is_ok() {
                    continue;
                }
                result.and_then(|()| store.flush())
            }
        };
        if result.is_err() {
            break;
        }
        maybe = digest(store.state());
        sure = maybe;
    }
    drop(store);
    // The power may fail again while the folder is being opened.
    let mut disk = disk.restart(draw);
    if draw.chance(0.3) {
        disk.fail_at(draw.below(6) as u64);
        drop(Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())));
        disk = disk.restart(draw);
    }
    let (store, _) = Store::open_on(Box::new(disk), |_, _, _| Ok(())).map_err(refused)?;
    let found = digest(store.state());
    if found == sure || found == maybe {
        Ok(())
    } else {
        Err(Fault::Lost(format!(
            "{} events are there, which is neither what was acknowledged nor one batch more",
            store.state().next
        )))
    }
}

/// Forgetting and compaction go from what was there to what shall be there in one step.
fn rewritten(
    store: &mut Store,
    rewrite: &dyn Fn(&mut Store) -> Result<(), crate::StoreError>,
    sure: &mut u32,
    maybe: &mut u32,
) -> Result<(), crate::StoreError> {
    store.flush()?;
    *sure = digest(store.state());
    // What it would come to, on a disk that does not fail.
    let events = store.events()?;
    let mut batches: Vec<(u64, Vec<Event>)> = Vec::new();
    for (time, event) in events {
        match batches.last_mut() {
            Some((known, batch)) if *known == time => batch.push(event),
            _ => batches.push((time, vec![event])),
        }
    }
    let mut twin = Store::in_memory();
    twin.rewrite(&batches)?;
    rewrite(&mut twin)?;
    *maybe = digest(twin.state());
    rewrite(store)
}

fn batch(world: &mut World, draw: &mut Draw, next: &mut Id, time: u64) -> Vec<Event> {
    let mut events = Vec::new();
    for _ in 0..1 + draw.below(6) {
        if *next < 3 || draw.chance(0.5) {
            events.push(world.put(*next, time));
            *next += 1;
        } else {
            // Forgotten objects cannot change.
            events.push(world.put(draw.below(*next as usize) as Id, time));
        }
    }
    events
}
