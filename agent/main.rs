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
            eprintln!("acm: {}", one_line(&story(&error)));
            acm::cli::exit_of_error(&error).into()
        }
    }
}

/// An error and its causes, those left out that the error before them has told already.
fn story(error: &anyhow::Error) -> String {
    let mut story: Vec<String> = Vec::new();
    for cause in error.chain().map(ToString::to_string) {
        if !story.last().is_some_and(|told| told.contains(&cause)) {
            story.push(cause);
        }
    }
    story.join(": ")
}

/// A message on one line: what parsers print of the file itself, under a bar, is left out.
fn one_line(message: &str) -> String {
    let is_excerpt = |line: &str| line.trim_start_matches(|c: char| c.is_ascii_digit() || c == ' ').starts_with('|');
    let lines: Vec<&str> = message.lines().map(str::trim).filter(|l| !l.is_empty() && !is_excerpt(l)).collect();
    lines.join(": ")
}

/// A reader that has seen enough, such as `head`, is no failure.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
        .any(|io| io.kind() == std::io::ErrorKind::BrokenPipe)
}
