//! `acm trace`: looks into the traces that `acm run --trace` writes. The file is described in docs/trace.md.
//!
//! | module | holds |
//! |---|---|
//! | [`recording`] | the trace of a run while it is being written |
//! | [`run_file`] | a trace read back: who ran what, and every message |
//! | [`calls`] | what a language model was asked and replied |
//! | [`list`] | `acm trace ls`: one line a run |
//! | [`show`] | `acm trace show`: the messages as a table |
//! | [`decision`] | one step: what was considered, decided, predicted and found |
//! | [`diff`] | `acm trace diff`: where two runs part |
//! | [`check`] | `acm trace check`: rules that a run must keep |
//! | [`recorded`] | a trace read for being run again |
//! | [`replay`] | `acm trace replay`: a recorded run once more, compared message by message |
//! | [`repair`] | `acm trace repair`: what is left of a cut file as a whole one |
//! | [`belief`] | what memory believed of each object, and the changes by which it came to that |
//! | [`sight`] | what the cameras saw, and what was made of it |
//! | [`picture`] | the pictures of a trace |
//! | [`why`] | `acm trace why`: from a message back to the frames on which it rests |
//! | [`export`] | `acm trace export`: other tools' forms |
//! | [`page`] | the viewer as one HTML page |
//! | [`view`] | `acm trace view`: the viewer on this machine |

pub mod belief;
pub mod calls;
pub mod check;
pub mod decision;
pub mod diff;
pub mod export;
pub mod list;
pub mod page;
pub mod picture;
pub mod recorded;
pub mod recording;
pub mod repair;
pub mod replay;
pub mod run_file;
pub mod show;
pub mod sight;
pub mod view;
pub mod why;

use crate::cli::{Exit, trace::TraceCommand};

/// Runs `acm trace`.
pub fn run(command: &TraceCommand) -> anyhow::Result<Exit> {
    match command {
        TraceCommand::Ls(args) => list::run(args),
        TraceCommand::Show(args) => show::run(args),
        TraceCommand::Diff(args) => diff::run(args),
        TraceCommand::Check(args) => check::run(args),
        TraceCommand::Replay(args) => replay::run(args),
        TraceCommand::Repair(args) => repair::run(args),
        TraceCommand::Why(args) => why::run(args),
        TraceCommand::Export(args) => export::run(args),
        TraceCommand::View(args) => view::run(args),
    }
}
