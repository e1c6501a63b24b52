//! `acm learn train`: training, with checkpoints.

use super::Interrupt;
use crate::cli::{Exit, learn::LearnTrainArgs};
use acm_learned::{
    config::{Description, SCHEMA},
    estimator::Estimator,
    net::Net,
    samples::Samples,
    train::{Plan, begin, train},
};
use anyhow::{bail, ensure};
use indicatif::{ProgressBar, ProgressStyle};
use std::ops::ControlFlow;

/// Steps between two checkpoints.
const CHECKPOINT: usize = 100;
/// Share of the last loss in the one that is shown: single steps differ a lot.
const SMOOTH: f64 = 0.02;

/// Trains and writes the weights.
///
/// # Errors
/// A folder cannot be read or written, or the learning rate is too high.
pub fn run(args: &LearnTrainArgs) -> anyhow::Result<Exit> {
    ensure!(
        args.learning_rate.is_finite() && args.learning_rate > 0.0,
        "--learning-rate is {}, but must be positive",
        args.learning_rate
    );
    let interrupt = Interrupt::new()?;
    let samples = Samples::read(&args.data)?;
    let net = match &args.from {
        None => {
            let net = Net::drawn(args.size.shape(), &samples.heads, args.seed)?;
            begin(&net, &samples)?;
            net
        }
        Some(folder) => {
            let estimator = Estimator::read(folder)?;
            if estimator.description().heads != samples.heads {
                bail!("{} and {} are of different templates", folder.display(), args.data.display());
            }
            estimator.net().clone()
        }
    };
    let plan = Plan {
        steps: args.steps as usize,
        batch: args.batch as usize,
        learning_rate: args.learning_rate,
        seed: args.seed,
    };
    println!("{} samples, {} weights", samples.samples.len(), net.weights().count());
    let write = |steps: usize| {
        let origin = plan.origin(&samples, steps);
        let heads = samples.heads.clone();
        let description = Description { schema: SCHEMA.into(), shape: *net.shape(), origin, heads };
        Estimator::new(description, net.clone()).write(&args.out)
    };
    // Before hours are spent, so that a folder that cannot be written is told at once.
    write(0)?;
    let bar = bar(plan.steps as u64);
    let (mut shown, mut steps, mut written) = (None, 0, Ok(()));
    train(&net, &samples, &plan, |progress| {
        let before = shown.unwrap_or(progress.nats);
        let loss = before + SMOOTH.max(1.0 / progress.step as f64) * (progress.nats - before);
        shown = Some(loss);
        steps = progress.step;
        bar.set_position(progress.step as u64);
        bar.set_message(format!("{loss:.4}"));
        if steps.is_multiple_of(CHECKPOINT) {
            written = write(steps);
        }
        if interrupt.is_pressed() || written.is_err() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    bar.finish_and_clear();
    written?;
    write(steps)?;
    println!("{steps} steps, loss {:.4}, weights in {}", shown.unwrap_or(f64::NAN), args.out.display());
    Ok(if interrupt.is_pressed() { Exit::Interrupted } else { Exit::Success })
}

fn bar(steps: u64) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    let style = "steps {bar:30} {pos}/{len} loss {msg} {elapsed} eta {eta}";
    match ProgressStyle::with_template(style) {
        Ok(style) => bar.with_style(style),
        Err(_template) => bar,
    }
}
