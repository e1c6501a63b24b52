//! The trace of a run while it is being written.

use crate::episode::{EpisodeConfig, EpisodeResult};
use acm_actors::trace::{FrameDetail, Trace};
use acm_runtime::trace::{TraceOptions, TraceWriter, hash};
use anyhow::Context;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Name of the metadata record about the run.
pub const RUN: &str = "acm.run";
/// Name of the metadata record about its result.
pub const RESULT: &str = "acm.result";

/// How the names of attachments with the memory that a run began with begin.
pub const MEMORY_FOLDER: &str = "memory/";
/// The same of the memory that a fault puts into its place.
pub const DONOR_FOLDER: &str = "donor/";
/// An attachment in place of a memory that is too large to be kept.
pub const MEMORY_LEFT_OUT: &str = "memory-left-out";
/// Most bytes of such a memory.
const MAX_MEMORY_BYTES: u64 = 48 << 20;

/// Where a run's trace goes and what it keeps of frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TraceRequest {
    /// The file.
    pub path: PathBuf,
    /// What is kept of each frame.
    pub frames: FrameDetail,
}

impl TraceRequest {
    /// The request for one seed. In a folder (one that exists, or a path that ends with a slash) each run has a file
    /// named after its world, method and seed; of a range, each run has its seed before the file's extension.
    pub fn for_seed(
        target: &Path,
        frames: FrameDetail,
        config: &EpisodeConfig,
        world: &str,
        seed: u64,
        range: bool,
    ) -> TraceRequest {
        let folder = target.is_dir() || target.to_string_lossy().ends_with(std::path::MAIN_SEPARATOR);
        let path = match (folder, range) {
            (true, _) => target.join(format!("{world}-{}-{seed}.mcap", config.method)),
            (false, true) => numbered(target, seed),
            (false, false) => target.to_path_buf(),
        };
        TraceRequest { path, frames }
    }
}

fn numbered(path: &Path, seed: u64) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = match path.extension() {
        Some(extension) => format!("{stem}-{seed}.{}", extension.to_string_lossy()),
        None => format!("{stem}-{seed}"),
    };
    path.with_file_name(name)
}

/// Where a run takes place, as its trace tells of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stage<'a> {
    /// The scenario, or the address of a robot.
    pub world: &'a str,
    /// The sensor profile.
    pub sensor: &'a str,
    /// What draws the pictures.
    pub renderer: &'a str,
}

/// A trace that is open for one run.
pub struct Recording {
    trace: Arc<Trace>,
}

impl Recording {
    /// Opens the file and says in it what is about to be run. Fails before the episode if nothing can be written.
    pub fn begin(
        request: &TraceRequest,
        stage: &Stage<'_>,
        seed: u64,
        config: &EpisodeConfig,
    ) -> anyhow::Result<Recording> {
        let folder = request.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("the folder {} cannot be made", folder.display()))?;
        }
        let writer = Arc::new(TraceWriter::create(&request.path, TraceOptions::default())?);
        let options = serde_json::to_vec_pretty(&options(stage.world, config))?;
        let about = [
            ("version", env!("CARGO_PKG_VERSION")),
            ("commit", option_env!("ACM_COMMIT").unwrap_or("unknown")),
            ("scenario", stage.world),
            ("method", &config.method),
            ("seed", &seed.to_string()),
            ("sensor", stage.sensor),
            ("renderer", stage.renderer),
            ("config_blake3", &hash(&options)),
        ];
        let about: BTreeMap<String, String> = about.map(|(name, value)| (name.into(), value.into())).into();
        writer.metadata(RUN, about)?;
        writer.attach("options.json", "application/json", &options)?;
        let donor = config.faults.transplant.as_ref().map(|(donor, _)| donor);
        for (folder, name) in [(config.memory.as_ref(), MEMORY_FOLDER), (donor, DONOR_FOLDER)] {
            if let Some(folder) = folder {
                attach_memory(&writer, folder, name)?;
            }
        }
        writer.flush()?;
        Ok(Recording { trace: Arc::new(Trace::new(writer, request.frames)?) })
    }

    /// The trace, for the agent.
    pub fn trace(&self) -> Arc<Trace> {
        Arc::clone(&self.trace)
    }

    /// Says how the run ended and finishes the file.
    pub fn end(&self, outcome: &anyhow::Result<EpisodeResult>) -> anyhow::Result<()> {
        let pairs: Vec<(&str, String)> = match outcome {
            Ok(result) => vec![
                ("ending", result.report.ending.to_string()),
                ("solved", result.solved.to_string()),
                ("false_success", result.false_success.to_string()),
                ("strict", result.verdict.strict.to_string()),
                ("judge", result.verdict.explanation.clone()),
                ("wall_s", format!("{:.3}", result.wall_s)),
            ],
            Err(error) => vec![("error", format!("{error:#}"))],
        };
        let values = pairs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        self.trace.writer().metadata(RESULT, values)?;
        self.trace.writer().finish()?;
        Ok(())
    }
}

/// Keeps a memory that a run goes on with, so that it can be run again.
fn attach_memory(writer: &TraceWriter, folder: &Path, as_folder: &str) -> anyhow::Result<()> {
    // A memory that is not there yet is made by the run.
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect();
    files.retain(|path| path.is_file());
    files.sort();
    let size = |path: &PathBuf| std::fs::metadata(path).map_or(0, |about| about.len());
    if files.iter().map(size).sum::<u64>() > MAX_MEMORY_BYTES {
        return Ok(writer.attach(MEMORY_LEFT_OUT, "text/plain", b"")?);
    }
    for path in files {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let data = std::fs::read(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        writer.attach(&format!("{as_folder}{name}"), "application/octet-stream", &data)?;
    }
    Ok(())
}

/// What the run was told, but for its seed: equal for runs that may be compared seed by seed.
fn options(world: &str, config: &EpisodeConfig) -> serde_json::Value {
    serde_json::json!({
        "scenario": world,
        "arguments": config.arguments,
        "method": config.method,
        "settings": config.settings,
        "instruction": config.instruction,
        "keeps_memory": config.memory.is_some(),
        "faults": format!("{:?}", config.faults),
        "no_motion": config.no_motion,
        "sensor": config.sensor,
        "panic_at": config.panic_at,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_or_a_folder_has_a_file_for_each_seed() {
        let config = EpisodeConfig { method: "acm".into(), ..EpisodeConfig::default() };
        let path = |target: &str, range| {
            TraceRequest::for_seed(Path::new(target), FrameDetail::Hash, &config, "tidy", 7, range).path
        };
        assert_eq!(path("a/t.mcap", false), Path::new("a/t.mcap"));
        assert_eq!(path("a/t.mcap", true), Path::new("a/t-7.mcap"));
        assert_eq!(path("t", true), Path::new("t-7"));
        assert_eq!(path("no-such-folder/", false), Path::new("no-such-folder/tidy-acm-7.mcap"));
    }
}
