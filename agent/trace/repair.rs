//! `acm trace repair`: what is left of a cut trace as a whole file.

use crate::cli::{Exit, trace::TraceRepairArgs};
use acm_runtime::trace::{Item, TraceOptions, TraceReader, TraceWriter};
use anyhow::bail;
use std::path::{Path, PathBuf};

/// What a repair kept.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repaired {
    /// Messages on all channels.
    pub messages: u64,
    /// What was wrong with the file; `None` where it was whole.
    pub cut: Option<String>,
}

/// Runs `acm trace repair`.
pub fn run(args: &TraceRepairArgs) -> anyhow::Result<Exit> {
    let out = args.out.clone().unwrap_or_else(|| beside(&args.file));
    let repaired = repair(&args.file, &out)?;
    match &repaired.cut {
        None => println!("{} is whole: {} messages, nothing to repair", args.file.display(), repaired.messages),
        Some(cut) => println!("{}: {cut}\n{}: {} messages", args.file.display(), out.display(), repaired.messages),
    }
    Ok(Exit::Success)
}

/// `run.mcap` becomes `run-repaired.mcap`.
fn beside(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|extension| format!(".{}", extension.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}-repaired{extension}"))
}

/// Writes every whole message before the cut into a new file. A whole file is left as it is, and nothing is written.
///
/// # Errors
/// The file is no trace, or the new one cannot be written.
pub fn repair(from: &Path, to: &Path) -> anyhow::Result<Repaired> {
    if same_file(from, to) {
        bail!("the repaired file must be another one than {}: what is left is not overwritten", from.display());
    }
    let mut repaired = Repaired::default();
    let mut reader = TraceReader::open(from)?;
    while let Some(item) = reader.next_item() {
        repaired.messages += u64::from(matches!(item, Item::Message(_)));
    }
    repaired.cut = reader.cut().map(str::to_owned);
    if repaired.cut.is_none() {
        return Ok(repaired);
    }
    let writer = TraceWriter::create(to, TraceOptions::default())?;
    let mut reader = TraceReader::open(from)?;
    while let Some(item) = reader.next_item() {
        match item {
            Item::Metadata { name, values } => writer.metadata(&name, values)?,
            Item::Attachment { name, media_type, data } => writer.attach(&name, &media_type, &data)?,
            Item::Message(message) => {
                let channel = writer.channel(message.topic(), &message.channel.schema())?;
                writer.put(channel, u64::from(message.sequence), message.time_ns, &message.data)?;
            }
        }
    }
    writer.finish()?;
    Ok(repaired)
}

fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}
