//! What is on disk when a call returns, how fast, and how fast it is read again.

use super::{BenchResult, Row, SEED, row, wall_us};
use crate::{bench::progress, statistics::median_and};
use acm_store::{
    Event, Op, Store,
    forget::Forget,
    testing::{crash, worlds::World},
};
use anyhow::Context;
use std::{fs, io::Write, path::Path};

/// Events of one batch.
const BATCH: u64 = 1000;
/// Power failures.
const POINTS: u64 = 10_000;

/// Measures commits, ingest, recovery, failures and forgetting.
pub fn measure(size: u32, quick: bool, result: &mut BenchResult) -> anyhow::Result<()> {
    commits(quick, result)?;
    let folder = tempfile::tempdir()?;
    ingest(size, folder.path(), result)?;
    recovery(size, folder.path(), result)?;
    failures(quick, result);
    forgetting(result)
}

/// Single commits beside a plain append and fdatasync of as many bytes, taking turns.
fn commits(quick: bool, result: &mut BenchResult) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let mut store = Store::open(&folder.path().join("store"))?;
    let (mut world, words) = World::new(SEED, 64, 200);
    store.commit(&[words], 0)?;
    let puts: Vec<Event> = (0..1000).map(|id| world.put(id, 1)).collect();
    store.commit(&puts, 1)?;
    let mut plain = fs::File::create(folder.path().join("plain"))?;
    let (mut own, mut other) = (Vec::new(), Vec::new());
    for number in 0..if quick { 200 } else { 2000u64 } {
        let event = world.change(1000, 2 + number);
        let began = wall_us();
        store.commit(std::slice::from_ref(&event), 2 + number)?;
        let middle = wall_us();
        plain.write_all(&[7; 512])?;
        plain.sync_data()?;
        own.push(middle - began);
        other.push(wall_us() - middle);
    }
    result.rows.push(row("durable commit of one event", 1000, &own));
    result.rows.push(row("512 B and fdatasync", 1000, &other));
    result.figure("durable_commit_over_fdatasync", median_and(0.5, &own).0 / median_and(0.5, &other).0.max(1e-9));
    Ok(())
}

/// Changes of objects that are there, a thousand in a batch, each batch on disk before the next.
fn ingest(size: u32, path: &Path, result: &mut BenchResult) -> anyhow::Result<()> {
    let mut store = Store::open(path)?;
    let (mut world, words) = World::new(SEED, 64, 200);
    store.commit(&[words], 0)?;
    let objects = size / 10;
    let puts: Vec<Event> = (0..objects).map(|id| world.put(id, 1)).collect();
    for batch in puts.chunks(BATCH as usize) {
        store.commit(batch, 1)?;
    }
    let count = u64::from(size - objects);
    let changes: Vec<Event> = (0..count).map(|n| world.change(objects as usize, 2 + n / BATCH)).collect();
    let (wall, cpu) = (wall_us(), super::cpu_us());
    for batch in changes.chunks(BATCH as usize) {
        store.commit(batch, batch.last().map_or(0, |event| event.valid))?;
    }
    let (wall, cpu) = (wall_us() - wall, super::cpu_us() - cpu);
    let values = [
        ("events_per_s", count as f64 / wall * 1e6),
        ("events_per_cpu_s", count as f64 / cpu * 1e6),
        ("bytes_per_event", store.disk_bytes()? as f64 / f64::from(size)),
        ("objects", f64::from(objects)),
    ];
    result
        .rows
        .push(Row { group: Some("ingest".into()), ..Row::new("1,000 events a batch, each synchronised", values) });
    result.figure("durable_events_per_s", count as f64 / wall * 1e6);
    Ok(())
}

/// Opening from the log alone, and from a snapshot with a tail of 50,000 events.
fn recovery(size: u32, path: &Path, result: &mut BenchResult) -> anyhow::Result<()> {
    let open = || -> anyhow::Result<(f64, f64, Store)> {
        let (wall, cpu) = (wall_us(), super::cpu_us());
        let store = Store::open(path).context("the measured folder cannot be opened again")?;
        let mut world = World::new(SEED, 64, 200).0;
        std::hint::black_box(acm_store::execute::answer(store.state(), &world.scoped()));
        Ok((wall_us() - wall, super::cpu_us() - cpu, store))
    };
    let (mut walls, mut cpus) = (Vec::new(), Vec::new());
    let mut events = 0;
    for _ in 0..3 {
        let (wall, cpu, store) = open()?;
        events = store.state().next;
        walls.push(wall * 1e-6);
        cpus.push(cpu * 1e-6);
    }
    let values =
        [("wall_s", median_and(0.5, &walls).0), ("cpu_s", median_and(0.5, &cpus).0), ("events", events as f64)];
    result.rows.push(Row { group: Some("recovery".into()), ..Row::new("from the log", values) });
    result.figure("recover_log_1e6_s", median_and(0.5, &walls).0);
    // A snapshot of as many objects as the world has.
    let (_, _, mut store) = open()?;
    let (mut world, _) = World::new(SEED + 1, 64, 200);
    let first = size / 10;
    for start in (first..size).step_by(BATCH as usize) {
        let time = store.state().now;
        let puts: Vec<Event> = (start..(start + BATCH as u32).min(size)).map(|id| world.put(id, time)).collect();
        store.enqueue(&puts, time)?;
    }
    store.snapshot(&[])?;
    drop(store);
    let (mut walls, mut cpus) = (Vec::new(), Vec::new());
    for _ in 0..5 {
        let (wall, cpu, _) = open()?;
        walls.push(wall * 1e-3);
        cpus.push(cpu * 1e-3);
    }
    let values =
        [("wall_ms", median_and(0.5, &walls).0), ("cpu_ms", median_and(0.5, &cpus).0), ("objects", f64::from(size))];
    result.rows.push(Row { group: Some("recovery".into()), ..Row::new("from a snapshot to the first answer", values) });
    result.figure("recover_snapshot_ms", median_and(0.5, &walls).0);
    Ok(())
}

fn failures(quick: bool, result: &mut BenchResult) {
    let points = if quick { POINTS / 10 } else { POINTS };
    let bar = progress("power failures", points);
    let outcome = crash::run(points, SEED, || bar.inc(1));
    bar.finish_and_clear();
    let values =
        [("points", outcome.points as f64), ("lost", outcome.lost as f64), ("refused", outcome.refused as f64)];
    result.rows.push(Row { group: Some("failures".into()), ..Row::new("power fails anywhere", values) });
    result.errors.extend(outcome.first.map(|reason| format!("a power failure: {reason}")));
    result.figure("lost_commits", (outcome.lost + outcome.refused) as f64);
}

/// Bytes of forgotten objects, regions and sources that are still in the folder.
fn forgetting(result: &mut BenchResult) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let mut store = Store::open(folder.path())?;
    let (mut world, words) = World::new(SEED, 8, 20);
    store.commit(&[words], 0)?;
    let guest = store.state().symbols.next();
    store
        .commit(&[Event::new(0, 0, 1.0, vec![Op::Define(acm_store::Kind::Source, "guest-of-the-house".into())])], 0)?;
    let mut needles: Vec<Vec<u8>> = vec![b"guest-of-the-house".to_vec(), b"room-3".to_vec()];
    let region = world.words.regions.get(3).copied().unwrap_or_default();
    let mut objects = Vec::new();
    for id in 0..500u32 {
        let put = world.put(id, 1);
        if let Some(Op::Put(object)) = put.ops.first()
            && (object.region == region || id % 10 == 0)
        {
            needles.push(bytemuck_bytes(object.position));
            objects.extend((id % 10 == 0).then_some(id));
        }
        store.commit(&[put], 1)?;
    }
    for number in 0..200u32 {
        let place = [1000.5 + number as f32, 2000.25, 3000.125 + number as f32];
        needles.push(bytemuck_bytes(place));
        store.commit(&[Event::new(2, guest, 1.0, vec![Op::Move(1 + number % 9, place, [0.0; 3])])], 2)?;
    }
    store.snapshot(&[])?;
    let found = |needles: &[Vec<u8>]| -> anyhow::Result<usize> {
        let mut bytes = Vec::new();
        for entry in fs::read_dir(folder.path())? {
            bytes.extend(fs::read(entry?.path())?);
        }
        Ok(needles
            .iter()
            .filter(|needle| bytes.windows(needle.len()).any(|window| window == needle.as_slice()))
            .count())
    };
    let before = found(&needles)?;
    store.forget(&Forget { objects, regions: vec![region], sources: vec![guest] }, |_, _| None)?;
    let after_log = found(&needles)?;
    store.snapshot(&[])?;
    let after = after_log + found(&needles)?;
    let values = [("patterns", needles.len() as f64), ("found_before", before as f64), ("found_after", after as f64)];
    result.rows.push(Row { group: Some("forgetting".into()), ..Row::new("an object, a region, a source", values) });
    result.figure("forgotten_bytes_found", after as f64);
    Ok(())
}

fn bytemuck_bytes(place: [f32; 3]) -> Vec<u8> {
    place.iter().flat_map(|value| value.to_le_bytes()).collect()
}
