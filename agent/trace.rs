//! `acm trace`: looks into the traces that `acm run --trace` writes. The file is described in docs/trace.md.
//!
//! | module | holds |
//! |---|---|
//! | [`recording`] | the trace of a run while it is being written |
//! | [`run_file`] | a trace read back: who ran what, and every message |
//! | [`list`] | `acm trace ls`: one line a run |
//! | [`show`] | `acm trace show`: the messages as a table |
//! | [`decision`] | one step: what was considered, decided, predicted and found |
//! | [`diff`] | `acm trace diff`: where two runs part |
//! | [`check`] | `acm trace check`: rules that a run must keep |
//! | [`recorded`] | a trace read for being run again |
//! | [`replay`] | `acm trace replay`: a recorded run once more, compared message by message |
//! | [`repair`] | `acm trace repair`: what is left of a cut file as a whole one |

pub mod check;
pub mod decision;
pub mod diff;
pub mod list;
pub mod recorded;
pub mod recording;
pub mod repair;
pub mod replay;
pub mod run_file;
pub mod show;

use crate::cli::{Exit, TraceCommand};

/// Runs `acm trace`.
pub fn run(command: &TraceCommand) -> anyhow::Result<Exit> {
    match command {
        TraceCommand::Ls(args) => list::run(args),
        TraceCommand::Show(args) => show::run(args),
        TraceCommand::Diff(args) => diff::run(args),
        TraceCommand::Check(args) => check::run(args),
        TraceCommand::Replay(args) => replay::run(args),
        TraceCommand::Repair(args) => repair::run(args),
    }
}
