//! The verbs of `acm learn` and their arguments.

use super::Seeds;
use acm_learned::config::Shape;
use clap::{Args, Subcommand, ValueEnum};
use std::path::PathBuf;

/// The verbs of `acm learn`.
#[derive(Debug, Subcommand)]
pub enum LearnCommand {
    /// Draw labelled clouds of rendered things into a folder.
    Data(LearnDataArgs),
    /// Train an estimator on them. Ctrl-C ends it early and keeps what was learned.
    Train(LearnTrainArgs),
    /// Compare an estimator with the geometric first guess on the same clouds, before and after the same fit.
    Compare(LearnCompareArgs),
    /// Write an estimator as ONNX, for other runtimes.
    Export(LearnExportArgs),
}

/// Arguments of `acm learn data`.
#[derive(Debug, Args)]
pub struct LearnDataArgs {
    /// Seeds of the scenes, one of several things each. 0..199 are those that `acm bench perception` reports; 7000..7999
    /// are for comparisons.
    #[arg(long, value_name = "A..B", default_value = "1000..4999")]
    pub seeds: Seeds,
    /// The folder that receives them.
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `acm learn train`.
#[derive(Debug, Args)]
pub struct LearnTrainArgs {
    /// The folder of samples.
    #[arg(long, value_name = "DIR")]
    pub data: PathBuf,
    /// The folder that receives the weights; they are written now and then, and at the end.
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
    /// How large the network is.
    #[arg(long, value_enum, default_value = "small")]
    pub size: Size,
    /// Steps; with fewer the learning rate falls faster.
    #[arg(long, value_name = "N", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(1..))]
    pub steps: u32,
    /// Samples of a step.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub batch: u32,
    /// Largest learning rate.
    #[arg(long, value_name = "RATE", default_value_t = 1e-3)]
    pub learning_rate: f64,
    /// Seed of the first weights, of the order of the samples and of how clouds are cut.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Begin with the weights of this folder instead of drawn ones; --size is theirs then.
    #[arg(long, value_name = "DIR", conflicts_with = "size")]
    pub from: Option<PathBuf>,
}

/// Arguments of `acm learn compare`.
#[derive(Debug, Args)]
pub struct LearnCompareArgs {
    /// The folder of weights.
    #[arg(long, value_name = "DIR")]
    pub weights: PathBuf,
    /// Seeds of the scenes; none of them may have been learned from.
    #[arg(long, value_name = "A..B", default_value = "7000..7199")]
    pub seeds: Seeds,
    /// Write the result, with all rows, into this file.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `acm learn export`.
#[derive(Debug, Args)]
pub struct LearnExportArgs {
    /// The folder of weights.
    #[arg(long, value_name = "DIR")]
    pub weights: PathBuf,
    /// The ONNX file to write.
    #[arg(short, long, value_name = "FILE")]
    pub out: PathBuf,
}

/// How large a network is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Size {
    /// The paper's: 128 groups of 32 points, 12 layers of 6 heads. Days on two processors.
    Paper,
    /// 64 groups of 32 points, 4 layers. Within an hour on two processors.
    Small,
    /// 32 groups of 16 points, 3 layers. Minutes.
    Tiny,
}

impl Size {
    /// The encoder's shape.
    pub fn shape(self) -> Shape {
        match self {
            Size::Paper => Shape::PAPER,
            Size::Small => Shape::SMALL,
            Size::Tiny => Shape::TINY,
        }
    }
}
