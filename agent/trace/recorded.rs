//! A trace read for being run again.

use super::{
    calls,
    picture::{self, Picture},
    recording::{DONOR_FOLDER, MEMORY_FOLDER},
    replay::run_arguments,
    run_file::{Entry, Header, RunFile},
};
use crate::{cli::RunArgs, inject::Injection, llm::LlmId};
use acm_actors::{
    host::Outside,
    message::HOST,
    replay::{Answer, outside},
    settings::Settings,
};
use acm_concept::{embodiment::RobotDescription, ids::FrameId, task::TaskSpec, time::Time};
use acm_llm::Cassette;
use acm_runtime::trace::{Item, TraceReader};
use anyhow::{Context, bail};
use serde::{Deserialize, de::DeserializeOwned};
use std::{collections::BTreeMap, path::Path, sync::Arc};

/// Most bytes of frames that are held.
const MAX_PIXEL_BYTES: usize = 8 << 30;

/// All that a replay needs of a trace.
#[derive(Debug, Clone, Default)]
pub struct Recorded {
    about: BTreeMap<String, String>,
    /// The messages in order.
    pub entries: Vec<Entry>,
    /// Why the trace ends too early, if it does.
    pub cut: Option<String>,
    attached: BTreeMap<String, Vec<u8>>,
    /// Colour and depth of the frames that are kept in full.
    pixels: BTreeMap<FrameId, (Vec<u8>, Vec<f32>)>,
}

#[derive(Deserialize)]
struct Options {
    #[serde(default)]
    arguments: Vec<String>,
    #[serde(default)]
    keeps_memory: bool,
    settings: Option<Settings>,
}

impl Recorded {
    /// Reads a trace as far as it goes.
    ///
    /// # Errors
    /// The file is no trace, or too large.
    pub fn read(path: &Path) -> anyhow::Result<Recorded> {
        let run = RunFile::read(path)?;
        let mut recorded = Recorded { about: run.about, entries: run.entries, cut: run.cut, ..Recorded::default() };
        let mut reader = TraceReader::open(path)?;
        while let Some(item) = reader.next_item() {
            if let Item::Attachment { name, data, .. } = item {
                recorded.attached.insert(name, data);
            }
        }
        let mut held = 0;
        picture::each(path, |frame, picture| {
            let Picture::Full { color, depth } = picture else { return Ok(()) };
            held += color.len() + size_of_val(depth.as_slice());
            if held > MAX_PIXEL_BYTES {
                bail!("{} has more than {MAX_PIXEL_BYTES} bytes of frames", path.display());
            }
            recorded.pixels.insert(frame, (color.into_raw(), depth));
            Ok(())
        })?;
        if recorded.entries.is_empty() {
            bail!("{} holds no message: there is nothing to replay", path.display());
        }
        Ok(recorded)
    }

    /// A value of what is known of the run; `?` where it is not.
    pub fn about(&self, name: &str) -> &str {
        self.about.get(name).map_or("?", String::as_str)
    }

    /// The run's seed.
    ///
    /// # Errors
    /// The trace does not say it.
    pub fn seed(&self) -> anyhow::Result<u64> {
        self.about("seed").parse().context("the trace does not say the run's seed")
    }

    /// What the agent was told.
    ///
    /// # Errors
    /// It is missing or malformed.
    pub fn task(&self) -> anyhow::Result<TaskSpec> {
        self.file("task.json")
    }

    /// What the run was told on the command line, with `donor` in the place of the folder of a memory that a fault put
    /// into the place of the run's own: the folder itself may have changed or gone.
    ///
    /// # Errors
    /// The run was not started there.
    pub fn arguments(&self, donor: Option<&Path>) -> anyhow::Result<RunArgs> {
        let options: Options = self.file("options.json")?;
        if options.arguments.is_empty() {
            bail!("the trace does not say how its run was started: it was not started by `acm run`");
        }
        let mut run = run_arguments(&options.arguments)?;
        for injection in &mut run.inject {
            if let (Injection::TransplantMemory { donor: folder, .. }, Some(donor)) = (injection, donor) {
                *folder = donor.to_path_buf();
            }
        }
        Ok(run)
    }

    /// What the agent went by; none in a trace that does not say it.
    ///
    /// # Errors
    /// It is malformed.
    pub fn settings(&self) -> anyhow::Result<Option<Settings>> {
        Ok(self.file::<Options>("options.json")?.settings)
    }

    /// The model that replies as it did in a run with `id`; `None` where the rules read the instructions.
    ///
    /// # Errors
    /// A call has another form.
    pub fn llm(&self, id: LlmId) -> anyhow::Result<Option<Arc<Cassette>>> {
        if id == LlmId::Rules {
            return Ok(None);
        }
        Ok(Some(Arc::new(calls::cassette(&self.entries, "the trace")?)))
    }

    /// A folder with the memory that the run began with; `None` where it began with an empty one.
    ///
    /// # Errors
    /// The memory was too large for the trace, or the folder cannot be written.
    pub fn memory(&self) -> anyhow::Result<Option<tempfile::TempDir>> {
        let options: Options = self.file("options.json")?;
        options.keeps_memory.then(|| self.folder(MEMORY_FOLDER)).transpose()
    }

    /// A folder with the memory that a fault put into the place of the run's own; `None` where there was no such fault.
    ///
    /// # Errors
    /// As [`Recorded::memory`].
    pub fn donor(&self) -> anyhow::Result<Option<tempfile::TempDir>> {
        let attached = self.attached.keys().any(|name| name.starts_with(DONOR_FOLDER));
        attached.then(|| self.folder(DONOR_FOLDER)).transpose()
    }

    /// The attached files whose names begin with a folder, in a folder of their own.
    fn folder(&self, of: &str) -> anyhow::Result<tempfile::TempDir> {
        let folder = tempfile::tempdir()?;
        if self.attached.contains_key(super::recording::MEMORY_LEFT_OUT) {
            bail!("the memory that the run began with was too large for its trace: the run cannot be repeated");
        }
        let files = self.attached.iter().filter_map(|(name, data)| Some((name.strip_prefix(of)?, data)));
        for (name, data) in files {
            // Of a name from a file only the last part is trusted.
            let name = Path::new(name).file_name().context("a file of the memory has no name")?;
            std::fs::write(folder.path().join(name), data)?;
        }
        Ok(folder)
    }

    /// The world that answers as it did.
    ///
    /// # Errors
    /// The trace does not keep what it answered.
    pub fn outside(&self) -> anyhow::Result<Outside> {
        let robot: RobotDescription = self.file("robot.json")?;
        let began = self.entries.first().map_or(0, |entry| entry.header.t);
        let mut answers = Vec::new();
        for entry in self.entries.iter().filter(|entry| is_answer(&entry.header)) {
            answers.push(self.answer(entry)?);
        }
        Ok(outside(robot, self.task()?.cameras, Time(began), answers))
    }

    fn answer(&self, entry: &Entry) -> anyhow::Result<Answer> {
        Answer::read(entry.record()?, |header| self.pixels.get(&header.id).cloned())
            .context("record with `--trace-frames full`, or replay with `--resim`, which draws the frames anew")
    }

    fn file<T: DeserializeOwned>(&self, name: &str) -> anyhow::Result<T> {
        let data = self.attached.get(name).with_context(|| format!("the trace has no `{name}`"))?;
        serde_json::from_slice(data).with_context(|| format!("the trace's `{name}` is malformed"))
    }
}

fn is_answer(header: &Header) -> bool {
    header.from == HOST.0
}
