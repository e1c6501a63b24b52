//! `acm trace`: looks into the traces that `acm run --trace` writes. The file is described in docs/trace.md.
//!
//! | module | holds |
//! |---|---|
//! | [`recording`] | the trace of a run while it is being written |
//! | [`run_file`] | a trace read back: who ran what, and every message |
//! | [`list`] | `acm trace ls`: one line a run |
//! | [`show`] | `acm trace show`: the messages as a table |
//! | [`decision`] | one step: what was considered, decided, predicted and found |

pub mod decision;
pub mod list;
pub mod recording;
pub mod run_file;
pub mod show;

use crate::cli::{Exit, TraceCommand};

/// Runs `acm trace`.
pub fn run(command: &TraceCommand) -> anyhow::Result<Exit> {
    match command {
        TraceCommand::Ls(args) => list::run(args),
        TraceCommand::Show(args) => show::run(args),
    }
}
