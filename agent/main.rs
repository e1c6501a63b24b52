//! The `acm` command.

use acm::cli::{Cli, Exit};
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are answers; everything else is unusable input.
            let code = if error.use_stderr() { Exit::Unusable } else { Exit::Success };
            return match error.print() {
                Ok(()) => code.into(),
                Err(_broken_pipe) => Exit::Success.into(),
            };
        }
    };
    match acm::cli::run(cli) {
        Ok(exit) => exit.into(),
        Err(error) if is_broken_pipe(&error) => Exit::Success.into(),
        Err(error) => {
            eprintln!("acm: {error:#}");
            Exit::Unusable.into()
        }
    }
}

/// A reader that has seen enough, such as `head`, is no failure.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
        .any(|io| io.kind() == std::io::ErrorKind::BrokenPipe)
}
