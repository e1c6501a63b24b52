//! Training: AdamW on the likelihood of the samples under the estimated means and deviations.

use crate::{
    cloud::group,
    config::Origin,
    net::{Answer, Batch, Net},
    samples::{Sample, Samples},
};
use candle_core::{DType, Device, Result, Tensor, backprop::GradStore};
use candle_nn::optim::{AdamW, Optimizer, ParamsAdamW};
use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use std::{f64::consts::PI, ops::ControlFlow};

/// How long and how fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Steps.
    pub steps: usize,
    /// Samples of a step.
    pub batch: usize,
    /// Largest learning rate; it rises over the first steps and falls along a cosine.
    pub learning_rate: f64,
    /// Seed of the order of the samples and of how clouds are cut.
    pub seed: u64,
}

/// Share of the steps over which the learning rate rises.
const RISE: f64 = 0.04;
/// What of the largest learning rate is left at the end.
const LEFT: f64 = 0.01;
const WEIGHT_DECAY: f64 = 0.02;
/// A longer gradient is shortened to this.
const LONGEST_GRADIENT: f64 = 1.0;

/// How a training goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Steps that were taken.
    pub step: usize,
    /// What the estimates missed the step's samples by, nats an output; see [`Loss::nats`].
    pub nats: f64,
}

impl Plan {
    /// What is written beside the weights after some steps.
    pub fn origin(&self, samples: &Samples, steps: usize) -> Origin {
        let count = samples.samples.len();
        Origin { seed: self.seed, scenes: samples.scenes, samples: count, steps, batch: self.batch }
    }

    fn learning_rate_at(&self, step: usize) -> f64 {
        let share = (step as f64 + 0.5) / self.steps as f64;
        let falling = LEFT + (1.0 - LEFT) * 0.5 * (1.0 + (PI * share).cos());
        self.learning_rate * falling * (share / RISE).min(1.0)
    }
}

/// Lets every head begin at the mean and the deviation of its targets: the first steps are not spent on them.
///
/// # Errors
/// The tensors do not fit: a mistake of ours.
pub fn begin(net: &Net, samples: &Samples) -> Result<()> {
    let statistics: Vec<(Vec<f32>, Vec<f32>)> = (0..samples.heads.len())
        .map(|head| {
            let of_head: Vec<&Sample> = samples.samples.iter().filter(|s| s.head == head).collect();
            let outputs = samples.heads.get(head).map_or(0, |spec| spec.outputs());
            let column = |at: usize| of_head.iter().filter_map(move |s| s.targets.get(at)).map(|t| f64::from(*t));
            let count = of_head.len().max(1) as f64;
            let moments = |at: usize| {
                let mean = column(at).sum::<f64>() / count;
                let variance = column(at).map(|t| (t - mean).powi(2)).sum::<f64>() / count;
                (mean as f32, variance.sqrt() as f32)
            };
            (0..outputs).map(moments).unzip()
        })
        .collect();
    net.begin_heads_at(&statistics)
}

/// Trains a network in place. After every step `report` is told, and may end it: the network can be used at any time.
///
/// # Errors
/// The loss is no number any more: the learning rate is too high.
pub fn train(
    net: &Net,
    samples: &Samples,
    plan: &Plan,
    mut report: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<()> {
    let variables: Vec<_> = net.weights().all().map(|(_, var)| var.clone()).collect();
    let settings = ParamsAdamW { lr: 0.0, weight_decay: WEIGHT_DECAY, ..ParamsAdamW::default() };
    let mut optimiser = AdamW::new(variables, settings)?;
    let mut rng = ChaCha8Rng::seed_from_u64(plan.seed);
    let mut order: Vec<usize> = Vec::new();
    for step in 0..plan.steps {
        let mut chosen = Vec::with_capacity(plan.batch);
        while chosen.len() < plan.batch {
            if order.is_empty() {
                order.extend(0..samples.samples.len());
                order.shuffle(&mut rng);
            }
            let Some(next) = order.pop().and_then(|at| samples.samples.get(at)) else {
                candle_core::bail!("there is nothing to learn from");
            };
            chosen.push(next);
        }
        let Loss { descended, nats } = loss(net, &chosen, &mut rng)?;
        if !nats.is_finite() {
            candle_core::bail!("the loss of step {step} is no number: lower the learning rate");
        }
        let mut gradients = descended.backward()?;
        shorten(net, &mut gradients)?;
        optimiser.set_learning_rate(plan.learning_rate_at(step));
        optimiser.step(&gradients)?;
        if report(Progress { step: step + 1, nats }).is_break() {
            break;
        }
    }
    Ok(())
}

/// Shortens a gradient that is too long as a whole.
fn shorten(net: &Net, gradients: &mut GradStore) -> Result<()> {
    let mut squares = 0.0;
    for (_, var) in net.weights().all() {
        if let Some(gradient) = gradients.get(var) {
            squares += f64::from(gradient.sqr()?.sum_all()?.to_scalar::<f32>()?);
        }
    }
    let length = squares.sqrt();
    if length <= LONGEST_GRADIENT {
        return Ok(());
    }
    for (_, var) in net.weights().all() {
        if let Some(gradient) = gradients.remove(var) {
            gradients.insert(var, (gradient * (LONGEST_GRADIENT / length))?);
        }
    }
    Ok(())
}

/// What a network misses some samples by.
#[derive(Debug)]
pub struct Loss {
    /// What training descends: the negative logarithm of the estimated density, weighted by the deviation that is claimed
    /// (Seitzer et al., "On the Pitfalls of Heteroscedastic Uncertainty Estimation", with their beta at 1/2). Without the
    /// weight what is hard is not learned at all, because a large deviation excuses it. Its value says little: weights
    /// shrink as estimates get better.
    pub descended: Tensor,
    /// The same without weights: an output's, on average, up to a constant. It falls by 1 where errors and claimed
    /// deviations shrink e times.
    pub nats: f64,
}

/// What a network misses some samples by. Clouds are cut anew each time.
///
/// # Errors
/// A sample has no points, or targets that do not fit its head.
pub fn loss(net: &Net, samples: &[&Sample], rng: &mut ChaCha8Rng) -> Result<Loss> {
    let mut clouds = Vec::with_capacity(samples.len());
    for sample in samples {
        let Some(groups) = group(&sample.points, net.shape(), rng) else {
            candle_core::bail!("a sample has no points")
        };
        clouds.push((groups, sample.context));
    }
    let features = net.features(&Batch::new(&clouds, net.shape())?)?;
    let mut heads: Vec<usize> = samples.iter().map(|sample| sample.head).collect();
    heads.sort_unstable();
    heads.dedup();
    let mut descended = Tensor::zeros((), DType::F32, &Device::Cpu)?;
    let mut nats = 0.0;
    for head in heads {
        let own = || samples.iter().enumerate().filter(|(_, sample)| sample.head == head);
        let rows: Vec<u32> = own().map(|(row, _)| row as u32).collect();
        let targets: Vec<f32> = own().flat_map(|(_, sample)| sample.targets.iter().copied()).collect();
        let (count, outputs) = (rows.len(), targets.len() / rows.len().max(1));
        let targets = Tensor::from_vec(targets, (count, outputs), &Device::Cpu)?;
        let rows = Tensor::from_vec(rows, count, &Device::Cpu)?;
        let answer = net.answer(head, &features.index_select(&rows, 0)?)?;
        let missed = missed(&answer, &targets)?;
        let weighted = (&missed * answer.log_deviation.exp()?.detach())?;
        let share = count as f64 / samples.len() as f64;
        descended = (descended + (weighted.mean_all()? * share)?)?;
        nats += share * f64::from(missed.mean_all()?.to_scalar::<f32>()?);
    }
    Ok(Loss { descended, nats })
}

/// The negative logarithm of the estimated normal density at the truth, of each output, up to a constant.
fn missed(answer: &Answer, targets: &Tensor) -> Result<Tensor> {
    let reduced = ((targets - &answer.mean)? / answer.log_deviation.exp()?)?;
    (reduced.sqr()? * 0.5)? + &answer.log_deviation
}
