//! What the engine costs at N objects: `cargo run --release -p acm-store --features testing --example measure -- 1000000`.

#![allow(clippy::unwrap_used)] // it stops where it fails

use acm_store::{
    Event, Op, Store, execute,
    testing::{Draw, worlds::World},
};
use std::hint::black_box;

/// Processor time of this thread.
struct Instant(f64);

impl Instant {
    fn now() -> Instant {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Instant(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
    }
    fn elapsed(&self) -> std::time::Duration {
        std::time::Duration::from_secs_f64((Instant::now().0 - self.0).max(0.0))
    }
}

fn percentiles(mut times: Vec<f64>) -> (f64, f64) {
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], times[times.len() * 99 / 100])
}

fn main() {
    let count: u32 = std::env::args().nth(1).map_or(100_000, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let mut store = Store::open(folder.path()).unwrap();
    let (mut world, words) = World::new(1, 64, 200);
    store.commit(&[words], 0).unwrap();
    let puts: Vec<Event> = (0..count).map(|id| world.put(id, 1000)).collect();
    let began = Instant::now();
    for batch in puts.chunks(1000) {
        store.enqueue(batch, 1000).unwrap();
        store.flush().unwrap();
    }
    let took = began.elapsed().as_secs_f64();
    println!("ingest of objects: {:.0}/s", f64::from(count) / took);
    drop(puts);
    let began = Instant::now();
    let view = store.view();
    println!("settle {:.1} ms", began.elapsed().as_secs_f64() * 1e3);
    for (name, scoped) in [("scoped", 0), ("unscoped near", 1), ("unscoped", 2)] {
        let queries: Vec<_> = (0..2000)
            .map(|_| {
                if scoped == 0 {
                    world.scoped()
                } else {
                    let mut q = world.unscoped();
                    let near = world.scoped().near;
                    q.near = if scoped == 1 { near } else { None };
                    q
                }
            })
            .collect();
        let (mut scored, mut hits) = (0, 0);
        let mut times = Vec::new();
        for _ in 0..3 {
            times.clear();
            for query in &queries {
                let began = Instant::now();
                let answer = black_box(execute::answer(&view, query));
                times.push(began.elapsed().as_secs_f64() * 1e6);
                (scored, hits) = (scored + answer.scored, hits + answer.hits.len());
            }
        }
        println!("{name}: {:?} us, scored {} hits {}", percentiles(times), scored / 6000, hits / 6000);
    }
    let places: Vec<_> = (0..2000)
        .map(|_| {
            let room = world.draw.below(64);
            world.place(room)
        })
        .collect();
    let mut times = Vec::new();
    for _ in 0..3 {
        times.clear();
        for at in &places {
            let began = Instant::now();
            black_box(view.nearest(*at, 10, f32::INFINITY, None));
            times.push(began.elapsed().as_secs_f64() * 1e6);
        }
    }
    println!("nearest: {:?} us", percentiles(times));
    drop(view);
    println!(
        "table {} space {} bytes/object",
        store.state().table.bytes() / count as usize,
        store.state().space.bytes() / count as usize
    );
    let touched = (count as usize / 10).max(1000);
    // As in `acm bench memory`: what is slid along stays upright.
    let slide = |n: u32| {
        let mut event = world.change(touched, 2_000_000 + u64::from(n / 1000) * 1000);
        for op in &mut event.ops {
            if let Op::Move(_, _, rotation) = op {
                *rotation = [0.0; 3];
            }
        }
        event
    };
    let changes: Vec<Event> = (0..count).map(slide).collect();
    let began = Instant::now();
    for batch in changes.chunks(1000) {
        store.enqueue(batch, batch.last().unwrap().valid).unwrap();
        store.flush().unwrap();
    }
    let took = began.elapsed().as_secs_f64();
    let mut settled = store.state().clone();
    settled.settle(true);
    let bytes = settled.history.bytes() as f64 / f64::from(count);
    println!("changes: {:.0}/s, history {bytes:.1} bytes/event", f64::from(count) / took);
    let mut draw = Draw::new(7);
    let mut times = Vec::new();
    for _ in 0..20000 {
        let (id, t) = (draw.below(touched) as u32, 2_000_000 + draw.below(count as usize) as u64);
        let began = Instant::now();
        black_box(settled.as_of(id, t, u64::MAX));
        times.push(began.elapsed().as_secs_f64() * 1e6);
    }
    println!("as of: {:?} us", percentiles(times));
    drop(settled);
    drop(store);
    let began = Instant::now();
    let mut store = Store::open(folder.path()).unwrap();
    println!("open from log of {} events: {:.3} s", store.state().next, began.elapsed().as_secs_f64());
    let began = Instant::now();
    store.snapshot(b"").unwrap();
    println!("snapshot written {:.1} ms", began.elapsed().as_secs_f64() * 1e3);
    drop(store);
    for _ in 0..3 {
        let began = Instant::now();
        let store = Store::open(folder.path()).unwrap();
        let answer = execute::answer(store.state(), &world.scoped());
        println!(
            "open from snapshot to first query: {:.1} ms ({} hits)",
            began.elapsed().as_secs_f64() * 1e3,
            answer.hits.len()
        );
    }
}
