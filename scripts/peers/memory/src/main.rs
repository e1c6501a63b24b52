//! redb and roaring beside `acm bench memory`: the same objects and questions. Arguments: objects, seed, quick. Prints JSON.

use acm_store::{Event, Op, Query, testing::worlds::World};
use redb::{Database, TableDefinition};
use roaring::RoaringBitmap;
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::{collections::BTreeMap, error::Error, hint::black_box};

const ROWS: TableDefinition<u64, &[u8]> = TableDefinition::new("events");

fn time_us(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 * 1e6 + time.tv_nsec as f64 * 1e-3
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, size, seed, quick] = arguments.as_slice() else { return Err("usage: memory-peers OBJECTS SEED QUICK".into()) };
    let (size, seed, quick): (u32, u64, bool) = (size.parse()?, seed.parse()?, quick.parse()?);
    let mut rows = redb_rows(quick)?;
    rows.push(roaring_row(size, seed));
    println!("{}", json!({ "rows": rows }));
    Ok(())
}

/// Durable puts of 160 bytes: one and a thousand a transaction, wall time.
fn redb_rows(quick: bool) -> Result<Vec<Value>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let base = Database::create(folder.path().join("base.redb"))?;
    let mut key = 0u64;
    let mut put = |count: u64| -> Result<f64, Box<dyn Error>> {
        let began = time_us(ClockId::Monotonic);
        let write = base.begin_write()?;
        {
            let mut table = write.open_table(ROWS)?;
            for _ in 0..count {
                key += 1;
                table.insert(key, [7u8; 160].as_slice())?;
            }
        }
        write.commit()?;
        Ok(time_us(ClockId::Monotonic) - began)
    };
    put(1000)?;
    let mut single = (0..if quick { 50 } else { 500 }).map(|_| put(1)).collect::<Result<Vec<f64>, _>>()?;
    single.sort_by(f64::total_cmp);
    let batches = if quick { 100 } else { 1000 };
    let mut wall = 0.0;
    for _ in 0..batches {
        wall += put(1000)?;
    }
    Ok(vec![
        json!({"name": "redb, one put a transaction", "values": {"p50_us": single[single.len() / 2], "repetitions": single.len()}}),
        json!({"name": "redb, 1,000 puts a transaction", "values": {"events_per_s": batches as f64 * 1e9 / wall}}),
    ])
}

/// Scoped questions over roaring postings and arrays, processor time.
fn roaring_row(size: u32, seed: u64) -> Value {
    let (mut world, _) = World::new(seed, 64, 200);
    let mut postings: BTreeMap<u16, RoaringBitmap> = BTreeMap::new();
    let mut columns: Vec<([f32; 3], f32)> = Vec::with_capacity(size as usize);
    for id in 0..size {
        let Event { ops, .. } = world.put(id, 1000);
        let Some(Op::Put(object)) = ops.first() else { continue };
        let words = [object.category, object.region].into_iter().chain(object.states.iter().copied());
        let affordances = object.parts.iter().flat_map(|part| part.affordances).filter(|word| *word > 0);
        words.chain(affordances).for_each(|word| drop(postings.entry(word).or_default().insert(id)));
        columns.push((object.position, object.confidence.ln()));
    }
    let questions: Vec<Query> = (0..4000).map(|_| world.scoped()).collect();
    let mut times = Vec::new();
    for _ in 0..2 {
        times.clear();
        for query in &questions {
            let began = time_us(ClockId::ThreadCPUTime);
            black_box(answer(&postings, &columns, query));
            times.push(time_us(ClockId::ThreadCPUTime) - began);
        }
    }
    times.sort_by(f64::total_cmp);
    let (p50, p99) = (times[times.len() / 2], times[times.len() * 99 / 100]);
    json!({"name": "roaring, scoped", "values": {"p50_us": p50, "p99_us": p99, "repetitions": times.len(), "objects": size}})
}

fn answer(postings: &BTreeMap<u16, RoaringBitmap>, columns: &[([f32; 3], f32)], query: &Query) -> Vec<(f32, u32)> {
    let words = query.categories.iter().chain(&query.region).chain(&query.affordances);
    let words = words.chain(query.states.iter().map(|(word, _)| word));
    let mut sets: Vec<&RoaringBitmap> = words.filter_map(|word| postings.get(word)).collect();
    sets.sort_by_key(|set| set.len());
    let mut all = sets[0] & sets[1];
    sets[2..].iter().for_each(|set| all &= *set);
    let near = query.near.unwrap();
    let score = |id: u32| {
        let (place, weight) = columns[id as usize];
        let [x, y, z] = [0, 1, 2].map(|axis| place[axis] - near.at[axis]);
        (weight - (x * x + y * y + z * z).sqrt() / near.scale_m, id)
    };
    let mut found: Vec<(f32, u32)> = all.iter().map(score).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(10);
    found
}
