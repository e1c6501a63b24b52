//! How long a frame with many things takes: one that memory explains, and one in which two of them are new.

use super::{Bench, draw, plan::RowKind, progress, quick, scene::Wanted};
use crate::{
    bench::{BenchResult, Row, perception::timed},
    cli::PerceptionArgs,
    perceive::no_robot,
    statistics::median_and,
};
use acm_concept::expectation::Expectation;
use acm_memory::{
    AcmMemory, Memory,
    observation::{Note, Observation},
};
use std::sync::Arc;

/// Things that memory does not know yet in the second of the two figures.
const NEW: usize = 2;

/// Measures both, and what the first and the second sight of everything take. Milliseconds, medians over the scenes.
pub fn measure(args: &PerceptionArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let Some(mut bench) = Bench::new(args, result)? else { return Ok(()) };
    bench.plan = bench.plan.crowded();
    let count = quick(args, args.common.episodes.unwrap_or(bench.plan.crowd.scenes).min(bench.plan.crowd.scenes));
    let bar = progress("crowd", count as u64);
    let (mut first, mut second) = (Vec::new(), Vec::new());
    let (mut known, mut new, mut things) = (Vec::new(), Vec::new(), Vec::new());
    for seed in (bench.plan.crowd.first_seed..).take(count) {
        let wanted = Wanted { kind: RowKind::Exact, touching: false };
        let (_, view) = draw(&bench.plan, &bench.library, &mut bench.foreign, &mut bench.eye, wanted, seed)?;
        let Some((now, before)) = view.frames.split_last() else { continue };
        let mut memory = AcmMemory::in_memory(Arc::clone(&bench.library));
        memory.note(&Note::EpisodeBegan)?;
        let (mut expectation, mut looks) = (Expectation::default(), Vec::new());
        for (look, next) in before.iter().zip(view.frames.iter().skip(1)) {
            let (percepts, ms) = timed(&bench.grounder, look, &expectation);
            looks.push(ms);
            let feedback = no_robot(&look.header);
            memory.observe(&Observation { percepts: &percepts, frame: look, feedback: &feedback })?;
            expectation = memory.expect(next.header.time);
        }
        first.extend(looks.first());
        second.extend(looks.get(1));
        let mut fewer = expectation.clone();
        fewer.objects.truncate(expectation.objects.len().saturating_sub(NEW));
        known.push(timed(&bench.grounder, now, &expectation).1);
        new.push(timed(&bench.grounder, now, &fewer).1);
        things.push(expectation.objects.len() as f64);
        bar.inc(1);
    }
    bar.finish_and_clear();
    if known.is_empty() {
        result.rows.push(Row::skipped("crowd", "none of its scenes was asked for"));
        return Ok(());
    }
    let figures = [
        ("frame_known_ms", median_and(0.9, &known)),
        ("frame_new_ms", median_and(0.9, &new)),
        ("first_sight_ms", median_and(0.9, &first)),
        ("second_sight_ms", median_and(0.9, &second)),
        ("things", median_and(0.9, &things)),
    ];
    for (name, (median, _)) in &figures[..2] {
        result.figure(name, *median);
    }
    result.rows.push(Row::new("crowd", figures.map(|(name, (median, _))| (name, median)).to_vec()));
    result.rows.push(Row {
        group: Some("p90".into()),
        ..Row::new("crowd", figures.map(|(name, (_, p90))| (name, p90)).to_vec())
    });
    Ok(())
}
