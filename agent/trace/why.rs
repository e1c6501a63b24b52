//! Why a message was sent: back over its causes to the decision, what that rested on, what wrote it, and what was seen.
//!
//! | module | holds |
//! |---|---|
//! | [`inquiry`] | the answer put together: the decision, and what it says of itself |
//! | [`chain`] | the causes of a message |
//! | [`read`] | what was read of memory, what had written it, and the frames behind that |
//! | [`text`] | the answer for a person |
//! | [`crops`] | the pixels in question as files |
//!
//! The answer is one small graph, [`Why`]. What the trace does not hold stands in [`Why::lacks`]; nothing is guessed.

pub mod chain;
pub mod crops;
pub mod inquiry;
pub mod read;
pub mod text;

use super::{decision, run_file::RunFile};
use crate::cli::{Exit, trace::TraceWhyArgs};
use acm_concept::ids::{FrameId, ObjectId};
use anyhow::{Context, bail};
pub use inquiry::Inquiry;
use serde::Serialize;
use std::io::{self, Write};

/// The answer: nodes and how they hang together.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Why {
    /// The message that was asked about.
    pub seq: u64,
    /// Number of the step (from 1) whose decision stands behind it.
    pub step: Option<usize>,
    /// What has to do with it, in the order in which it is best read.
    pub nodes: Vec<Node>,
    /// Each leads from what is explained to what explains it.
    pub links: Vec<Link>,
    /// What the trace does not hold.
    pub lacks: Vec<String>,
}

/// Something that has to do with a message.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Node {
    /// Its name within the answer.
    pub id: String,
    /// What it is.
    pub kind: Kind,
    /// The message by which it is found in the trace.
    pub seq: Option<u64>,
    /// Virtual time, seconds.
    pub t: Option<f64>,
    /// It in a line.
    pub title: String,
    /// Further lines.
    pub lines: Vec<String>,
    /// The pixels in question, of a frame.
    pub crops: Vec<Crop>,
}

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A message.
    Message,
    /// Many messages in a row.
    Messages,
    /// What the planner decided.
    Decision,
    /// What was asked for.
    Instruction,
    /// What a model was asked and said.
    Model,
    /// What a phrase was taken to mean.
    Reference,
    /// A literal with what was believed of it.
    Belief,
    /// What was considered and not chosen.
    Rejected,
    /// What came of it.
    Outcome,
    /// An entry of memory.
    Entry,
    /// A change of memory.
    Change,
    /// A frame.
    Frame,
}

/// From what is explained to what explains it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Link {
    /// What is explained.
    pub from: String,
    /// What explains it.
    pub to: String,
    /// How.
    pub role: &'static str,
}

/// Where an object is in a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Crop {
    /// The frame.
    pub frame: FrameId,
    /// The object.
    pub object: ObjectId,
    /// First column, first row, last column, last row; pixels of the whole frame. None where the camera does not cover
    /// the place, or no place is known.
    pub bounds: Option<[u32; 4]>,
    /// How these pixels are known.
    pub how: How,
    /// What perception took it for, or what the frame says of it.
    pub label: String,
    /// The file that it was written into.
    pub file: Option<String>,
}

/// How an object's pixels in a frame are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum How {
    /// Perception grounded it on these pixels.
    Seen,
    /// It was believed there, and the camera's calibration and pose say where that is.
    Projected,
}

/// Runs `acm trace why`.
pub fn run(args: &TraceWhyArgs) -> anyhow::Result<Exit> {
    let run = RunFile::read(&args.file)?;
    let seq = match (args.seq, args.step) {
        (Some(seq), _) => seq,
        (None, Some(step)) => step_seq(&run, step)?,
        (None, None) => bail!("which message? give its number, or --step N"),
    };
    let mut why = Inquiry::new(&run).why(seq)?;
    if let Some(folder) = &args.crops {
        crops::write(&mut why, &args.file, &run, folder)?;
    }
    let out = &mut io::stdout().lock();
    if args.json {
        let all = serde_json::json!({ "schema": "acm.trace-why/1", "why": why, "cut": run.cut });
        serde_json::to_writer_pretty(&mut *out, &all).map_err(io::Error::from)?;
        writeln!(out)?;
        return Ok(Exit::Success);
    }
    text::print(&why, out)?;
    if let Some(reason) = &run.cut {
        writeln!(out, "CUT: {reason}; what stands before is shown")?;
    }
    Ok(Exit::Success)
}

fn step_seq(run: &RunFile, step: usize) -> anyhow::Result<u64> {
    let steps = decision::steps(run);
    let span = step.checked_sub(1).and_then(|index| steps.get(index));
    let decided = span.and_then(|span| span.decision(run));
    let decided = decided
        .with_context(|| format!("there is no step {step}: the run has {} steps, numbered from 1", steps.len()))?;
    Ok(decided.header.seq)
}
