//! `acm scenario`: list, check, describe, draw.

use crate::cli::{Exit, ScenarioCommand, Seeds};
use acm_sim::{Scenario, Setting, SimOptions, Simulation};
use anyhow::Context;
use std::{
    collections::BTreeSet,
    io::Write,
    path::Path,
    sync::{Arc, Mutex},
};

/// Runs `acm scenario`.
pub fn run(command: &ScenarioCommand) -> anyhow::Result<Exit> {
    match command {
        ScenarioCommand::List => list()?,
        ScenarioCommand::Check { file } => {
            let scenario = Scenario::open(file)?;
            println!("{file}: scenario `{}` is well formed: {}", scenario.name(), scenario.summary());
        }
        ScenarioCommand::Schema => println!("{}", Scenario::schema()),
        ScenarioCommand::Worlds { file, seed } => worlds(file, *seed)?,
        ScenarioCommand::Preview { file, seed, set, out, info } => preview(file, *seed, set, out, *info)?,
    }
    Ok(Exit::Success)
}

fn list() -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    let mut write = |names: Vec<String>| -> anyhow::Result<()> {
        for name in names {
            let scenario = Scenario::open(&name)?;
            writeln!(out, "{name:<28} {}", scenario.summary())?;
        }
        Ok(())
    };
    write(Scenario::names())?;
    for suite in Scenario::suites() {
        write(Scenario::suite(&suite))?;
    }
    Ok(())
}

/// Things that a start does not show, such as what a gauge will say, are not counted.
fn worlds(file: &str, seeds: Seeds) -> anyhow::Result<()> {
    let scenario = Scenario::open(file)?;
    let bar = indicatif::ProgressBar::new(seeds.last - seeds.first + 1);
    let mut digests = BTreeSet::new();
    for seed in seeds.first..=seeds.last {
        let options = SimOptions { seed, ..SimOptions::default() };
        digests.insert(Simulation::without_renderer(&scenario, &options)?.world_digest());
        bar.inc(1);
    }
    bar.finish_and_clear();
    let (count, seeds) = (digests.len(), seeds.last - seeds.first + 1);
    println!("{}: {count} different start worlds in {seeds} seeds", scenario.name());
    Ok(())
}

fn preview(file: &str, seed: u64, set: &[Setting], out: &Path, info: bool) -> anyhow::Result<()> {
    let scenario = Scenario::open_with(file, set)?;
    let renderer = Arc::new(Mutex::new(acm_render::Renderer::new()?));
    let options = SimOptions { seed, motion: true, ..SimOptions::default() };
    let simulation = Simulation::new(&scenario, &options, renderer)?;
    simulation
        .preview(None)?
        .color
        .save(out)
        .with_context(|| format!("the picture {} cannot be written", out.display()))?;
    println!("{} seed {seed} -> {}", scenario.name(), out.display());
    if info {
        for (object, (_, lines)) in simulation.truth().into_iter().zip(simulation.inventory()) {
            let at = object.pose.translation;
            println!(
                "  {:<12} {:<14} at ({:.3}, {:.3}, {:.3}) heading {:.1} deg",
                object.name,
                object.model,
                at.x,
                at.y,
                at.z,
                object.pose.yaw().to_degrees()
            );
            for line in lines {
                println!("    {line}");
            }
        }
    }
    Ok(())
}
