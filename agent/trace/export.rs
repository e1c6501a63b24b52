//! `acm trace export`: a trace in the forms of other tools.
//!
//! | module | form |
//! |---|---|
//! | [`lines`] | JSON, one record a line |
//! | [`chrome`] | trace events of Chrome, which Perfetto reads |
//! | [`super::calls`] | the calls of a language model as a cassette |
//! | [`points`] | point clouds in the world, as PLY |
//! | [`otlp`] | spans of OpenTelemetry, in a file or sent to a collector |
//! | [`super::page`] | the viewer as one HTML file |

pub mod chrome;
pub mod lines;
pub mod otlp;
pub mod points;

use super::{calls, page, run_file::RunFile};
use crate::cli::{Exit, trace::TraceExportArgs};
use anyhow::{Context, bail};
use std::{
    fs::File,
    io::{BufWriter, Write},
    path::Path,
};

/// Runs `acm trace export`.
pub fn run(args: &TraceExportArgs) -> anyhow::Result<Exit> {
    let TraceExportArgs { file, html, jsonl, chrome, cassette, points, frame, otlp } = args;
    if [html, jsonl, chrome, cassette, points].iter().all(|form| form.is_none()) && otlp.is_none() {
        bail!(
            "say in which form: --html FILE, --jsonl FILE, --chrome FILE, --cassette FILE, --points FOLDER or --otlp URL"
        );
    }
    let mut cut = None;
    if let Some(path) = html {
        let page = page::Page::read(file)?;
        cut = page.cut().map(str::to_owned);
        let html = page.html()?;
        write_to(path, |out| Ok(out.write_all(html.as_bytes())?))?;
    }
    if let Some(path) = jsonl {
        write_to(path, |out| {
            cut = lines::write(file, out)?;
            Ok(())
        })?;
    }
    if let Some(path) = chrome {
        let run = RunFile::read(file)?;
        cut.clone_from(&run.cut);
        let took = chrome::wall(file)?;
        write_to(path, |out| chrome::write(&run, &took, out))?;
    }
    if let Some(path) = cassette {
        let run = RunFile::read(file)?;
        cut.clone_from(&run.cut);
        let cassette = calls::cassette(&run.entries, &path.display().to_string())?;
        if cassette.is_empty() {
            bail!("{}: no language model was asked in this run", file.display());
        }
        let text = cassette.text()?;
        write_to(path, |out| Ok(out.write_all(text.as_bytes())?))?;
    }
    if let Some(folder) = points {
        let written = points::write(file, folder, *frame)?;
        eprintln!("acm: {written} point clouds in {}", folder.display());
    }
    if let Some(target) = otlp {
        cut = otlp::export(file, target)?;
    }
    if let Some(reason) = cut {
        eprintln!("acm: {} is cut ({reason}); what stands before is written", file.display());
    }
    Ok(Exit::Success)
}

/// Writes a file, or standard output for `-`.
fn write_to(path: &Path, write: impl FnOnce(&mut dyn Write) -> anyhow::Result<()>) -> anyhow::Result<()> {
    if path == Path::new("-") {
        let mut out = BufWriter::new(std::io::stdout().lock());
        write(&mut out)?;
        return Ok(out.flush()?);
    }
    let named = || format!("{} cannot be written", path.display());
    let mut out = BufWriter::new(File::create(path).with_context(named)?);
    write(&mut out)?;
    out.flush().with_context(named)
}
