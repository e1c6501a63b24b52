//! Whether one bad frame overwrites what memory has verified.
//!
//! A table is seen until memory has verified what stands there. Then comes one frame in which nothing has changed but the
//! camera: it shows nothing, too little, or something wrong. Whatever is verified has to be as it was.

use super::{Bench, draw, plan::RowKind, progress, quick, scene::Wanted};
use crate::{
    bench::{BenchResult, Row},
    cli::PerceptionArgs,
    perceive::no_robot,
};
use acm_concept::{
    camera::RgbdFrame,
    embodiment::Feedback,
    object::{Observability, Percepts},
    pose::Pose,
    template::{TemplateLibrary, YawSymmetry},
};
use acm_memory::{
    AcmMemory, Memory,
    entry::ObjectEntry,
    observation::{Note, Observation},
};
use anyhow::Context;
use glam::{DQuat, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// A place, a heading and a size that change by no more than this were averaged, not overwritten: metres, radians.
const PLACE_M: f64 = 0.01;
const HEADING_RAD: f64 = 0.1;
const SIZE_M: f64 = 0.006;

/// What is wrong with the last frame.
#[derive(Debug, Clone, Copy)]
enum Fault {
    Black,
    White,
    Millimetres,
    HalfMissing,
    /// The camera was pushed: it stands 6 cm and 6 degrees from where it is said to be.
    Pushed,
    /// Depths are an eighth too long.
    Stretched,
    /// Red and blue are exchanged.
    OtherColors,
    /// Something near hides a third of the view.
    Covered,
    /// Depths vary by 3 cm.
    Noisy,
}

const FAULTS: [(Fault, &str); 9] = [
    (Fault::Black, "black"),
    (Fault::White, "saturated"),
    (Fault::Millimetres, "depth in millimetres"),
    (Fault::HalfMissing, "half of the depth missing"),
    (Fault::Pushed, "camera pushed"),
    (Fault::Stretched, "depth an eighth too long"),
    (Fault::OtherColors, "red and blue exchanged"),
    (Fault::Covered, "a third covered"),
    (Fault::Noisy, "noise of 3 cm"),
];

/// What became of all scenes with one fault.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    frames: f64,
    blind: f64,
    verified: f64,
    doubted: f64,
    overwritten: f64,
    invented: f64,
}

/// Measures: the figure is how many verified things were overwritten by a bad frame, or verified though only it shows them.
pub fn measure(args: &PerceptionArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let Some(mut bench) = Bench::new(args, result)? else { return Ok(()) };
    bench.plan = bench.plan.crowded();
    let count = quick(args, args.common.episodes.unwrap_or(bench.plan.crowd.scenes).min(bench.plan.crowd.scenes));
    let bar = progress("overwrites", count as u64);
    let mut counts = [Count::default(); FAULTS.len()];
    for seed in (bench.plan.crowd.first_seed..).take(count) {
        let wanted = Wanted { kind: RowKind::Exact, touching: false };
        let (_, view) = draw(&bench.plan, &bench.library, &mut bench.foreign, &mut bench.eye, wanted, seed)?;
        let Some((last, good)) = view.frames.split_last() else { continue };
        let seen = Seen::look(&bench, good)?;
        for ((fault, name), count) in FAULTS.into_iter().zip(&mut counts) {
            let frame = spoil(last, fault, seed)?;
            let mut memory = seen.memory(&bench.library)?;
            let before: Vec<ObjectEntry> = memory.view().objects().to_vec();
            let percepts = bench.grounder.ground(&frame, &memory.expect(frame.header.time));
            show(&mut memory, &percepts, &frame, &seen.feedback)?;
            count.frames += 1.0;
            count.blind += f64::from(percepts.blindness.is_some());
            let view = memory.view();
            for entry in before.iter().filter(|entry| entry.verified) {
                count.verified += 1.0;
                // What memory holds stays as it is, but is to be looked at again: that is no overwriting.
                count.doubted += f64::from(view.object(entry.id).is_some_and(|now| !now.verified));
                if let Some(what) = overwritten(entry, view.object(entry.id), &bench.library) {
                    count.overwritten += 1.0;
                    result
                        .notes
                        .push(format!("Overwritten: seed {seed}, {name}, {} {}: {what}.", entry.id, entry.category));
                }
            }
            let known = |entry: &&ObjectEntry| before.iter().any(|known| known.id == entry.id && known.verified);
            count.invented += view.objects().iter().filter(|entry| entry.verified && !known(entry)).count() as f64;
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let all: f64 = counts.iter().map(|count| count.overwritten + count.invented).sum();
    if counts[0].verified == 0.0 {
        result.rows.push(Row::skipped("overwrites", "memory verified nothing in the scenes that were asked for"));
        return Ok(());
    }
    result.figure("unverified_overwrites", all);
    for ((_, name), count) in FAULTS.into_iter().zip(&counts) {
        let values = [
            ("frames", count.frames),
            ("blind", count.blind),
            ("verified", count.verified),
            ("doubted", count.doubted),
            ("overwritten", count.overwritten),
            ("invented", count.invented),
        ];
        result.rows.push(Row { group: Some("one bad frame".into()), ..Row::new(name, values) });
    }
    Ok(())
}

/// Good looks at a table, as memory is shown them.
struct Seen {
    looks: Vec<(Percepts, RgbdFrame)>,
    feedback: Feedback,
}

impl Seen {
    fn look(bench: &Bench, frames: &[RgbdFrame]) -> anyhow::Result<Seen> {
        let first = frames.first().context("the plan of a crowd has one frame only")?;
        let mut memory = AcmMemory::in_memory(Arc::clone(&bench.library));
        memory.note(&Note::EpisodeBegan)?;
        let mut seen = Seen { looks: Vec::new(), feedback: no_robot(&first.header) };
        for frame in frames {
            let percepts = bench.grounder.ground(frame, &memory.expect(frame.header.time));
            show(&mut memory, &percepts, frame, &seen.feedback)?;
            seen.looks.push((percepts, frame.clone()));
        }
        Ok(seen)
    }

    /// The memory after these looks.
    fn memory(&self, library: &Arc<TemplateLibrary>) -> anyhow::Result<AcmMemory> {
        let mut memory = AcmMemory::in_memory(Arc::clone(library));
        memory.note(&Note::EpisodeBegan)?;
        for (percepts, frame) in &self.looks {
            show(&mut memory, percepts, frame, &self.feedback)?;
        }
        Ok(memory)
    }
}

fn show(memory: &mut AcmMemory, percepts: &Percepts, frame: &RgbdFrame, feedback: &Feedback) -> anyhow::Result<()> {
    memory.observe(&Observation { percepts, frame, feedback })?;
    Ok(())
}

/// What of a verified entry is no longer as it was.
fn overwritten(before: &ObjectEntry, after: Option<&ObjectEntry>, library: &TemplateLibrary) -> Option<&'static str> {
    let Some(after) = after else { return Some("it is gone") };
    if after.presence != before.presence {
        return Some("whether it is there");
    }
    if after.category != before.category {
        return Some("its category");
    }
    if after.history.len() != before.history.len() {
        return Some("its history");
    }
    if after.parts.len() != before.parts.len() {
        return Some("its parts");
    }
    for (old, new) in before.parts.iter().zip(&after.parts) {
        if old.template != new.template {
            return Some("its template");
        }
        let (a, b) = (&old.pose.pose, &new.pose.pose);
        if a.translation.distance(b.translation) > PLACE_M {
            return Some("its place");
        }
        let symmetry = library.get(&old.template).and_then(|template| template.yaw_symmetry(&old.values()).ok());
        if symmetry.unwrap_or(YawSymmetry::Fold(1)).difference(a.yaw(), b.yaw()).abs() > HEADING_RAD {
            return Some("its heading");
        }
        let observed = old.parameters.iter().filter(|value| value.observability == Observability::Observed);
        for value in observed {
            if new.value(&value.name).is_none_or(|now| (now - value.value).abs() > SIZE_M) {
                return Some("its size");
            }
        }
    }
    None
}

/// The frame with a fault; noise is drawn from the seed.
fn spoil(frame: &RgbdFrame, fault: Fault, seed: u64) -> anyhow::Result<RgbdFrame> {
    let mut header = frame.header.clone();
    let (mut color, mut depth) = (frame.color.to_vec(), frame.depth.to_vec());
    let width = header.intrinsics.width as usize;
    match fault {
        Fault::Black => {
            color.fill(0);
            depth.fill(0.0);
        }
        Fault::White => color.fill(255),
        Fault::Millimetres => depth.iter_mut().for_each(|z| *z *= 1000.0),
        Fault::HalfMissing => {
            (0..depth.len()).filter(|at| at % width >= width / 2).for_each(|at| depth[at] = 0.0);
        }
        Fault::Pushed => {
            let push = Pose::new(DVec3::new(0.05, 0.03, 0.0), DQuat::from_rotation_z(6f64.to_radians()));
            header.camera_pose = push * header.camera_pose;
        }
        Fault::Stretched => depth.iter_mut().for_each(|z| *z *= 1.125),
        Fault::OtherColors => color.chunks_exact_mut(3).for_each(|pixel| pixel.swap(0, 2)),
        Fault::Covered => {
            for at in (0..depth.len()).filter(|at| (width / 3..2 * width / 3).contains(&(at % width))) {
                depth[at] = 0.35;
                color[3 * at..3 * at + 3].copy_from_slice(&[180, 140, 120]);
            }
        }
        Fault::Noisy => {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            depth.iter_mut().filter(|z| **z > 0.0).for_each(|z| *z += rng.random_range(-0.03..0.03));
        }
    }
    RgbdFrame::new(header, color.into(), depth.into()).context("a spoilt frame")
}
