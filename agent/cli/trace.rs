//! The verbs of `acm trace` and their arguments.

use super::OnUnknownArg;
use crate::{inject::Injection, llm::LlmId};
use acm_concept::ids::FrameId;
use acm_sim::Setting;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// The verbs of `acm trace`.
#[derive(Debug, Subcommand)]
pub enum TraceCommand {
    /// One line for each run in a folder: what was run, and how it ended.
    Ls(TraceLsArgs),
    /// The messages of a run as a table; or one step's decision; or one message in full.
    Show(TraceShowArgs),
    /// Where two runs part: the first record that differs, its fields, and memory there. Exit 0 equal, 1 different, 2
    /// unusable.
    Diff(TraceDiffArgs),
    /// Hold a run against rules, for tests. Exit 0 kept, 1 broken, 2 unusable.
    Check(TraceCheckArgs),
    /// Run a recorded run again and compare it message by message. Exit 0 identical, 1 diverged, 2 unusable.
    Replay(TraceReplayArgs),
    /// Make a whole file of what is left of a cut one.
    Repair(TraceRepairArgs),
    /// Why a message was sent: the decision behind it, what that rested on, what wrote that, and the frames seen.
    Why(TraceWhyArgs),
    /// The run for other tools: a page, lines of JSON, Chrome's trace events, point clouds, spans.
    Export(TraceExportArgs),
    /// The viewer, served to the browser on this machine.
    View(TraceViewArgs),
}

/// Arguments of `acm trace diff`.
#[derive(Debug, Args)]
pub struct TraceDiffArgs {
    /// A trace.
    pub a: PathBuf,
    /// Another one.
    pub b: PathBuf,
    /// Print JSON instead of text: null if they are equal.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `acm trace check`.
#[derive(Debug, Args)]
pub struct TraceCheckArgs {
    /// The trace.
    pub file: PathBuf,
    /// The rules, a TOML file (docs/trace.md).
    pub rules: PathBuf,
    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `acm trace replay`.
#[derive(Debug, Args)]
pub struct TraceReplayArgs {
    /// The trace.
    pub file: PathBuf,
    /// Run physics and renderer again too, instead of taking what they gave from the trace.
    #[arg(long)]
    pub resim: bool,
    /// Stop after the message of this number.
    #[arg(long, value_name = "N")]
    pub until: Option<u64>,
    /// Print each message, and wait for Enter before it is handled; `q` ends.
    #[arg(long)]
    pub step: bool,
    /// Go on live after the message of this number, with what is set otherwise below. Up to it the run must be the
    /// recorded one; physics and renderer run again.
    #[arg(long, value_name = "N", conflicts_with_all = ["until", "step"])]
    pub fork: Option<u64>,
    /// What a fork sets otherwise.
    #[command(flatten)]
    pub otherwise: Otherwise,
}

/// What a fork sets otherwise.
#[derive(Debug, Clone, Default, Args)]
#[group(requires = "fork")]
pub struct Otherwise {
    /// A further fault. Those of the cameras begin at the fork, and count frames from there.
    #[arg(long, value_name = "FAULT")]
    pub inject: Vec<Injection>,
    /// What the agent goes by from the fork on: a TOML file, as `acm run --config`.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// What to do from the fork on when memory cannot decide.
    #[arg(long, value_enum)]
    pub on_unknown: Option<OnUnknownArg>,
    /// Another language model for what is asked after the fork, as `acm run --llm`; the run's own if absent.
    #[arg(long, value_name = "ID")]
    pub llm: Option<LlmId>,
    /// A field of the scenario, as `acm run --set`.
    #[arg(long, value_name = "PATH=VALUE")]
    pub set: Vec<Setting>,
    /// Write the forked run into this trace.
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
}

/// Arguments of `acm trace repair`.
#[derive(Debug, Args)]
pub struct TraceRepairArgs {
    /// The cut trace. It is left as it is.
    pub file: PathBuf,
    /// The whole file; FILE-repaired.mcap beside it if absent.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// Arguments of `acm trace ls`.
#[derive(Debug, Args)]
pub struct TraceLsArgs {
    /// A folder with traces, or one trace.
    #[arg(default_value = ".")]
    pub path: PathBuf,
    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `acm trace show`.
#[derive(Debug, Args)]
pub struct TraceShowArgs {
    /// The trace.
    pub file: PathBuf,
    /// The decision behind the Nth skill that was run: candidates, preconditions, prediction, verdict.
    #[arg(long, value_name = "N", conflicts_with_all = ["seq", "json"])]
    pub step: Option<usize>,
    /// The message of this number, in full.
    #[arg(long, value_name = "N")]
    pub seq: Option<u64>,
    /// Only messages from or to this actor.
    #[arg(long, value_name = "A")]
    pub actor: Option<String>,
    /// Only messages of this kind.
    #[arg(long, value_name = "K")]
    pub kind: Option<String>,
    /// Only messages whose line or body has this word, small or capital.
    #[arg(long, value_name = "WORD")]
    pub text: Option<String>,
    /// Print JSON instead of text: the messages in full.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `acm trace why`.
#[derive(Debug, Args)]
pub struct TraceWhyArgs {
    /// The trace.
    pub file: PathBuf,
    /// The message.
    #[arg(required_unless_present = "step", conflicts_with = "step")]
    pub seq: Option<u64>,
    /// The decision behind the Nth skill that was run.
    #[arg(long, value_name = "N")]
    pub step: Option<usize>,
    /// Write the pixels in question into this folder, one PNG for each frame and object.
    #[arg(long, value_name = "FOLDER")]
    pub crops: Option<PathBuf>,
    /// Print JSON instead of text: the nodes and their links.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `acm trace export`. `-` stands for standard output.
#[derive(Debug, Args)]
pub struct TraceExportArgs {
    /// The trace.
    pub file: PathBuf,
    /// The viewer as one HTML file that needs no network.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// One line of JSON for each message, effect and change of memory.
    #[arg(long, value_name = "FILE")]
    pub jsonl: Option<PathBuf>,
    /// Trace events for Perfetto or chrome://tracing.
    #[arg(long, value_name = "FILE")]
    pub chrome: Option<PathBuf>,
    /// What a language model was asked and replied, as a cassette for `acm run --llm replay=FILE`.
    #[arg(long, value_name = "FILE")]
    pub cassette: Option<PathBuf>,
    /// Spans of OpenTelemetry, sent to the collector at this http:// address, or written to this file as OTLP/JSON.
    #[arg(long, value_name = "URL|FILE")]
    pub otlp: Option<String>,
    /// A point cloud (PLY) of each frame; needs a trace with --trace-frames full.
    #[arg(long, value_name = "FOLDER")]
    pub points: Option<PathBuf>,
    /// The point cloud of this frame alone, such as F3.
    #[arg(long, value_name = "F", requires = "points")]
    pub frame: Option<FrameId>,
}

/// Arguments of `acm trace view`.
#[derive(Debug, Args)]
pub struct TraceViewArgs {
    /// The trace.
    pub file: PathBuf,
    /// The port on 127.0.0.1; 0 takes a free one.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port: u16,
}
