//! `acm trace ls`: one line a run.

use super::{decision, run_file::RunFile};
use crate::cli::{Exit, trace::TraceLsArgs};
use anyhow::{Context, bail};
use serde::Serialize;
use std::{
    io::Write,
    path::{Path, PathBuf},
};

/// Most files of a folder that are looked into.
const MAX_FILES: usize = 10_000;

/// One run.
#[derive(Debug, Serialize)]
struct Line {
    file: String,
    scenario: String,
    seed: String,
    method: String,
    steps: usize,
    ending: String,
    first_failure: Option<String>,
    messages: u64,
    bytes: u64,
    cut: Option<String>,
}

/// Runs `acm trace ls`.
pub fn run(args: &TraceLsArgs) -> anyhow::Result<Exit> {
    let files = files(&args.path)?;
    let (mut lines, mut foreign) = (Vec::new(), Vec::new());
    for file in &files {
        match RunFile::read(file) {
            Ok(run) => lines.push(line(file, &run)),
            Err(error) if args.path.is_dir() => foreign.push(format!("{error:#}")),
            Err(error) => return Err(error),
        }
    }
    let mut out = std::io::stdout().lock();
    if args.json {
        let list = serde_json::json!({ "schema": "acm.trace-list/1", "runs": lines, "left_out": foreign });
        serde_json::to_writer_pretty(&mut out, &list).map_err(std::io::Error::from)?;
        writeln!(out)?;
        return Ok(Exit::Success);
    }
    table(&mut out, &lines)?;
    for error in &foreign {
        writeln!(out, "left out: {error}")?;
    }
    Ok(Exit::Success)
}

fn files(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_path_buf()]);
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).with_context(|| format!("the folder {} cannot be read", path.display()))? {
        let file = entry?.path();
        if file.extension().is_some_and(|extension| extension == "mcap") && file.is_file() {
            files.push(file);
        }
        if files.len() > MAX_FILES {
            bail!("{} has more than {MAX_FILES} traces: name a smaller folder", path.display());
        }
    }
    if files.is_empty() {
        bail!("{} has no trace (a file *.mcap): write one with acm run SCENARIO --trace FILE", path.display());
    }
    files.sort();
    Ok(files)
}

fn line(file: &Path, run: &RunFile) -> Line {
    let steps = decision::steps(run);
    Line {
        file: file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned(),
        scenario: run.about("scenario").into(),
        seed: run.about("seed").into(),
        method: run.about("method").into(),
        steps: steps.len(),
        ending: run.ending(),
        first_failure: steps.iter().find_map(|step| step.failure(run)),
        messages: run.messages,
        bytes: run.bytes,
        cut: run.cut.clone(),
    }
}

fn table(out: &mut impl Write, lines: &[Line]) -> std::io::Result<()> {
    let width = |title: &str, of: fn(&Line) -> &str, most: usize| {
        lines.iter().map(|line| of(line).chars().count()).max().unwrap_or(0).clamp(title.len(), most)
    };
    let (file, scenario) = (width("file", |l| &l.file, 44), width("scenario", |l| &l.scenario, 28));
    let (method, seed) = (width("method", |l| &l.method, 16), width("seed", |l| &l.seed, 8));
    writeln!(
        out,
        "{:<file$} {:<scenario$} {:>seed$} {:<method$} {:>5} {:>8} {:>8}  ending",
        "file", "scenario", "seed", "method", "steps", "messages", "size"
    )?;
    for line in lines {
        let failure = line.first_failure.as_ref().map_or_else(String::new, |why| format!("; first failure: {why}"));
        let cut = if line.cut.is_some() { "; CUT" } else { "" };
        writeln!(
            out,
            "{:<file$} {:<scenario$} {:>seed$} {:<method$} {:>5} {:>8} {:>8}  {}{failure}{cut}",
            line.file,
            line.scenario,
            line.seed,
            line.method,
            line.steps,
            line.messages,
            size(line.bytes),
            line.ending
        )?;
    }
    Ok(())
}

/// A size in the unit that a person reads.
fn size(bytes: u64) -> String {
    match bytes {
        0..10_000 => format!("{bytes} B"),
        10_000..10_000_000 => format!("{} kB", bytes / 1000),
        _ => format!("{} MB", bytes / 1_000_000),
    }
}
