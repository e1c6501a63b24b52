//! What a trace costs.

use super::{Scratch, messages::Ball, now_ns};
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
    episode::{EpisodeConfig, Runner},
    statistics::median_and,
    trace::recording::TraceRequest,
};
use acm_actors::trace::FrameDetail;
use acm_runtime::{
    envelope::{Envelope, Role},
    journal::{Journal, NoJournal},
    trace::{TraceJournal, TraceOptions, TraceWriter, record},
};
use acm_sim::Scenario;
use std::{collections::BTreeMap, fs::File, io::BufWriter, sync::Arc};

const MESSAGES: u32 = 300_000;
/// The scenario of the episodes. Its result plays no part here.
const SCENARIO: &str = "put-back-block";
const EPISODES: usize = 8;
const FIRST_SEED: u64 = 200;

/// Measures messages a second and a trace's share of an episode.
pub fn measure(args: &BenchArgs, folder: &Scratch, result: &mut BenchResult) -> anyhow::Result<()> {
    let count = if args.quick { MESSAGES / 10 } else { MESSAGES };
    let (ours, bytes) = traced(count, folder)?;
    let raw = plain(count, folder)?;
    let row = |name: &str, rate| Row::new(name, [("messages_per_s", rate), ("bytes_per_message", bytes)]);
    result.rows.push(row("one thread: JSON, CRC, zstd, to disk", ours));
    result.rows.push(row("the same bytes by the mcap crate alone", raw));
    result.figure("traced_messages_per_s", ours);
    result.figure("traced_messages_over_plain_mcap", ours / raw);
    let episodes = args.episodes.unwrap_or(if args.quick { 2 } else { EPISODES }).clamp(1, 1000);
    overhead(episodes, folder, result)
}

fn envelope(seq: u64, body: Ball) -> Envelope<Ball> {
    let (from, to) = (Role("asker"), Role("answerer"));
    Envelope { seq, cause: seq.checked_sub(1), episode: 1, from, to, time_ns: seq * 20_000_000, body }
}

/// Messages a second through the journal, and the bytes of one.
fn traced(count: u32, folder: &Scratch) -> anyhow::Result<(f64, f64)> {
    let writer = Arc::new(TraceWriter::create(&folder.path().join("rate.mcap"), TraceOptions::default())?);
    let journal = TraceJournal::new(Arc::clone(&writer));
    let began = now_ns();
    let mut bytes = 0;
    for number in 0..count {
        let message = envelope(u64::from(number) + 1, Ball::question(number, true));
        if number == 0 {
            bytes = record::encode(&message)?.len();
        }
        journal.record(&message)?;
    }
    writer.finish()?;
    Ok((rate(count, began), bytes as f64))
}

/// The same with the bytes made beforehand, by the library that we stand on.
fn plain(count: u32, folder: &Scratch) -> anyhow::Result<f64> {
    let message = record::encode(&envelope(1, Ball::question(0, true)))?;
    let file = BufWriter::new(File::create(folder.path().join("plain.mcap"))?);
    let mut writer = mcap::WriteOptions::new().compression_threads(0).create(file)?;
    let schema = writer.add_schema(record::NAME, "jsonschema", record::SCHEMA.as_bytes())?;
    let channel = writer.add_channel(schema, "/answerer/ask", "json", &BTreeMap::new())?;
    let began = now_ns();
    for number in 0..count {
        let log_time = u64::from(number) * 20_000_000;
        let header =
            mcap::records::MessageHeader { channel_id: channel, sequence: number, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &message)?;
    }
    writer.finish()?;
    Ok(rate(count, began))
}

fn rate(count: u32, began_ns: u64) -> f64 {
    f64::from(count) / (now_ns().saturating_sub(began_ns).max(1) as f64 * 1e-9)
}

/// What a trace (frames by hash) takes of an episode. The figure is the time spent in writing over the time of the rest,
/// both measured in the same episode. The difference of two episodes' processor times says the same with much more
/// noise; it is printed to compare.
fn overhead(episodes: usize, folder: &Scratch, result: &mut BenchResult) -> anyhow::Result<()> {
    let (runner, scenario) = (Runner::new()?, Scenario::open(SCENARIO)?);
    let run = |seed: u64, traced: bool| -> anyhow::Result<Cost> {
        let path = folder.path().join(format!("{seed}.mcap"));
        let trace = traced.then_some(TraceRequest { path, frames: FrameDetail::Hash });
        let config = EpisodeConfig { method: "acm".into(), trace, ..EpisodeConfig::default() };
        let before_s = cpu_s();
        let episode = runner.run(&scenario, seed, &config, Arc::new(NoJournal))?;
        let cpu_s = cpu_s().zip(before_s).map(|(after, before)| after - before);
        let of = |name: &str| episode.spent_s.get(name).copied().unwrap_or(0.0);
        Ok(Cost { cpu_s, trace_s: of("trace"), rest_s: episode.wall_s - of("trace") - of("world-building") })
    };
    // The first episode of a process pays for what is made once.
    run(FIRST_SEED, true)?;
    let (mut with, mut without) = (Vec::new(), Vec::new());
    let seeds = FIRST_SEED..FIRST_SEED + episodes as u64;
    for seed in seeds.clone() {
        // They take turns in going first.
        for traced in [seed % 2 == 0, seed % 2 != 0] {
            let cost = run(seed, traced)?;
            if traced { with.push(cost) } else { without.push(cost) }
        }
    }
    let mean = |costs: &[Cost], of: fn(&Cost) -> f64| costs.iter().map(of).sum::<f64>() / costs.len().max(1) as f64;
    let (trace_s, rest_s) = (mean(&with, |cost| cost.trace_s), mean(&with, |cost| cost.rest_s));
    let mut values = vec![("trace_s", trace_s), ("rest_s", rest_s), ("episodes", episodes as f64)];
    if with.iter().chain(&without).all(|cost| cost.cpu_s.is_some()) {
        let cpu = |costs| mean(costs, |cost| cost.cpu_s.unwrap_or_default());
        values.extend([("cpu_traced_s", cpu(&with)), ("cpu_untraced_s", cpu(&without))]);
    }
    result.rows.push(Row { group: Some(SCENARIO.into()), ..Row::new("a trace's share, each episode", values) });
    // The middle of the episodes' own fractions: whatever else the machine did then weighs little.
    let fractions: Vec<f64> = with.iter().map(|cost| cost.trace_s / cost.rest_s).collect();
    result.figure("trace_overhead_fraction", median_and(1.0, &fractions).0);
    result.seeds = vec![seeds.start, seeds.end - 1];
    Ok(())
}

/// What one episode cost, seconds.
struct Cost {
    cpu_s: Option<f64>,
    trace_s: f64,
    rest_s: f64,
}

/// Processor time of all threads of this process, seconds; `None` where the system does not tell it this way.
fn cpu_s() -> Option<f64> {
    // Ticks of a hundredth of a second on every Linux that we know of: small beside several episodes.
    const TICKS_PER_S: f64 = 100.0;
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let (_, fields) = text.rsplit_once(')')?;
    let ticks = |index: usize| fields.split_whitespace().nth(index)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / TICKS_PER_S)
}
