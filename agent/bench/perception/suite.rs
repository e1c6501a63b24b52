//! The fixed rendered suite: tables that perception has never seen, drawn from seeds, against what is true of them.
//!
//! | module | holds |
//! |---|---|
//! | `plan` | the suite file: what scenes are drawn from |
//! | `thing`, `deviation`, `outline` | things, things that are a little off, how far things are apart |
//! | `scene`, `view` | a table of things from a seed; what a camera sees of it |
//! | `labelled` | clouds of such things with what is true of them, for `acm learn` |
//! | `crowd` | how long frames with many things take |
//! | `overwrites` | what one bad frame changes of what memory has verified |
//! | `score`, `tally` | one answer against the truth; the figures of many |
//!
//! Perception gets the noisy frame, the nominal calibration and an empty expectation; of the second frame of a crowd what
//! memory expects after the first. The truth stays here.

pub mod crowd;
mod deviation;
#[cfg(feature = "learned")]
pub mod labelled;
mod outline;
pub mod overwrites;
mod picture;
mod plan;
mod scene;
mod score;
mod tally;
#[cfg(test)]
mod tests;
mod thing;
mod view;

use crate::{
    bench::{
        BenchResult, Row, progress,
        targets::{Targets, Verdict},
    },
    cli::PerceptionArgs,
};
use acm_concept::{expectation::Expectation, template::TemplateLibrary};
use acm_perception::{Grounder, GrounderConfig};
use acm_render::Renderer;
use anyhow::{Context, bail};
use plan::{Plan, RowKind};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use scene::{Scene, Wanted};
use score::Fate;
use std::{collections::BTreeMap, fs::OpenOptions, io::Write, path::Path, sync::Arc};
use tally::Tally;
use thing::Workshop;
use view::{Eye, View};

/// On foreign meshes floors are this times lower and ceilings as much higher.
const FOREIGN: f64 = 0.8;

/// Measures the three rows.
pub fn measure(args: &PerceptionArgs, targets: &Targets, result: &mut BenchResult) -> anyhow::Result<()> {
    let Some(mut bench) = Bench::new(args, result)? else { return Ok(()) };
    let asked = args.common.episodes.unwrap_or(bench.plan.scenes).min(bench.plan.scenes);
    let scenes: Vec<(RowKind, u64, bool)> = bench.plan.scenes().take(quick(args, asked)).collect();
    let bar = progress("suite", scenes.len() as u64);
    let data = std::env::var_os("ACM_DATA").is_some();
    let mut tallies: BTreeMap<RowKind, Tally> = BTreeMap::new();
    for &(kind, seed, touching) in &scenes {
        if kind != RowKind::Foreign || data {
            let tally = bench.play(Wanted { kind, touching }, seed)?;
            tallies.entry(kind).or_default().add(&tally);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let mut pooled = Tally::default();
    for kind in [RowKind::Exact, RowKind::Perturbed, RowKind::Foreign] {
        match tallies.get(&kind) {
            Some(tally) => {
                tell(kind, tally, targets, result);
                if kind != RowKind::Foreign {
                    pooled.add(tally);
                }
            }
            None if kind == RowKind::Foreign && !data => {
                result.rows.push(Row::skipped(kind.name(), "no data: the variable ACM_DATA is not set"));
            }
            None => result.rows.push(Row::skipped(kind.name(), "none of its scenes was asked for")),
        }
    }
    for (name, value) in pooled.figures() {
        result.figure(name, value);
    }
    result.notes.push(
        "The suite's figures are those of the rows exact and perturbed together; shares of templates, parts, intervals \
         and angles are of what was found."
            .into(),
    );
    if let (Some((_, first, _)), Some((_, last, _))) = (scenes.first(), scenes.last()) {
        result.seeds = vec![*first, *last];
    }
    Ok(())
}

/// Measures the small cubes.
pub fn measure_small_cubes(args: &PerceptionArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let Some(mut bench) = Bench::new(args, result)? else { return Ok(()) };
    let plan = bench.plan.small_cubes.clone();
    let count = quick(args, args.common.episodes.unwrap_or(plan.scenes).min(plan.scenes));
    let bar = progress("small cubes", count as u64);
    let mut tally = Tally::default();
    for seed in (plan.first_seed..).take(count) {
        tally.add(&bench.play(Wanted { kind: RowKind::SmallCubes, touching: false }, seed)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let row = |values: Vec<(&'static str, f64)>| Row::new(RowKind::SmallCubes.name(), values);
    let shares = tally.figures().into_iter().filter(|(name, _)| !name.starts_with("relative"));
    let all = shares.chain(tally.small_cube_figures()).collect();
    result.rows.push(row(all));
    result.rows.push(Row { group: Some("counts".into()), ..row(tally.counts()) });
    for (name, value) in tally.small_cube_figures() {
        result.figure(name, value);
    }
    Ok(())
}

/// A tenth, and one at least, if that is asked for.
fn quick(args: &PerceptionArgs, count: usize) -> usize {
    if args.common.quick { count.div_ceil(10) } else { count }
}

/// A row's figures, its counts, and which of its targets it misses.
fn tell(kind: RowKind, tally: &Tally, targets: &Targets, result: &mut BenchResult) {
    let figures = tally.figures();
    let short = |(name, value): &(&'static str, f64)| {
        let target = targets.of(result.bench, name)?;
        let target = if kind == RowKind::Foreign { target.loosened(FOREIGN) } else { *target };
        (target.verdict(*value) != Verdict::Reached).then_some(*name)
    };
    let missed: Vec<&str> = figures.iter().filter_map(short).collect();
    let verdict =
        if missed.is_empty() { "every target is reached".into() } else { format!("short in {}", missed.join(", ")) };
    result.notes.push(format!("{}: {verdict}.", kind.name()));
    result.rows.push(Row::new(kind.name(), figures));
    result.rows.push(Row { group: Some("counts".into()), ..Row::new(kind.name(), tally.counts()) });
}

/// What all scenes of a run share.
struct Bench {
    plan: Plan,
    library: Arc<TemplateLibrary>,
    grounder: Grounder,
    eye: Eye,
    /// Kept from scene to scene: foreign meshes are read once.
    foreign: thing::Foreign,
    pictures: Option<std::path::PathBuf>,
}

impl Bench {
    /// `None`, and a row that says why, without a renderer.
    fn new(args: &PerceptionArgs, result: &mut BenchResult) -> anyhow::Result<Option<Bench>> {
        let library = Arc::new(acm_memory::default_library()?);
        let mut plan = Plan::own(&library)?;
        if let Some(first) = args.seed_from {
            (plan.first_seed, plan.small_cubes.first_seed, plan.crowd.first_seed) = (first, first, first);
        }
        let renderer = match Renderer::new() {
            Ok(renderer) => renderer,
            Err(error) => {
                result.rows.push(Row::skipped("suite", error.to_string()));
                return Ok(None);
            }
        };
        if let Some(folder) = &args.pictures {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("the folder {} cannot be made", folder.display()))?;
        }
        let grounder = Grounder::new(Arc::clone(&library), GrounderConfig::default());
        let foreign = thing::Foreign::default();
        Ok(Some(Bench { plan, library, grounder, eye: Eye::new(renderer), foreign, pictures: args.pictures.clone() }))
    }

    fn play(&mut self, wanted: Wanted, seed: u64) -> anyhow::Result<Tally> {
        let (scene, view) = draw(&self.plan, &self.library, &mut self.foreign, &mut self.eye, wanted, seed)?;
        let percepts = self.grounder.ground(&view.frames[0], &Expectation::default());
        let scored = score::score(&scene, &view.labels, &percepts, &self.library);
        if let Some(folder) = &self.pictures {
            let path = folder.join(format!("{}-{seed:04}.png", wanted.kind.name().replace(' ', "-")));
            picture::draw(&view, &percepts, &scored.fates, &self.library)
                .save(&path)
                .with_context(|| format!("the picture {} cannot be written", path.display()))?;
            self.list(folder, wanted, seed, &scene, &scored.fates)?;
        }
        Ok(scored.tally)
    }

    /// Adds to the table beside the pictures what became of each thing of a scene.
    fn list(&self, folder: &Path, wanted: Wanted, seed: u64, scene: &Scene, fates: &[Fate]) -> anyhow::Result<()> {
        let path = folder.join("fates.tsv");
        let cannot = || format!("the table {} cannot be written", path.display());
        let mut table = OpenOptions::new().create(true).append(true).open(&path).with_context(cannot)?;
        for (at, (thing, fate)) in scene.things.iter().zip(fates).enumerate() {
            let place = if thing.touches.is_some() { "touching" } else { "spaced" };
            let kind = thing.template.as_ref().map_or("foreign", |truth| truth.template.as_str());
            writeln!(table, "{}\t{seed}\t{at}\t{kind}\t{place}\t{}", wanted.kind.name(), fate.name())
                .with_context(cannot)?;
        }
        Ok(())
    }
}

/// The scene of a seed and the view of it: the first that can be judged.
fn draw(
    plan: &Plan,
    library: &TemplateLibrary,
    foreign: &mut thing::Foreign,
    eye: &mut Eye,
    wanted: Wanted,
    seed: u64,
) -> anyhow::Result<(Scene, View)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut workshop = Workshop::new(plan, library, foreign);
    let small = wanted.kind == RowKind::SmallCubes;
    let least_pixels = if small { plan.small_cubes.least_pixels } else { plan.layout.least_pixels };
    for _ in 0..plan.attempts {
        let Some(scene) = Scene::draw(plan, wanted, &mut workshop, &mut rng)? else { continue };
        if let Some(view) = eye.view(plan, &scene, Some(least_pixels), seed)? {
            return Ok((scene, view));
        }
    }
    bail!("suite, row {}, seed {seed}: no scene in {} attempts; loosen the layout", wanted.kind.name(), plan.attempts)
}
