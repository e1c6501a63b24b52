//! `acm perceive`: grounds real frames one after the other over one memory; no simulator.

pub mod input;
pub mod report;
pub mod sample;

use crate::{
    cli::{Exit, PerceiveArgs},
    config, tools,
};
use acm_actors::settings::Settings;
use acm_concept::{
    camera::{FrameHeader, RgbdFrame},
    embodiment::Feedback,
    ids::FrameId,
    object::Percepts,
    pose::Pose,
    template::TemplateLibrary,
    time::Time,
};
use acm_memory::{
    Memory,
    observation::{Note, Observation},
};
use acm_perception::{Assisted, AssistedGrounder, Grounder, GrounderConfig, frames, labels, overlay};
use anyhow::Context;
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use input::{Input, Pictures};
use report::{FrameReport, Report};
use std::{
    io::{IsTerminal, Write},
    path::Path,
    sync::Arc,
};

/// Files do not say when they were taken: frames count as this far apart, seconds.
const FRAME_INTERVAL_S: f64 = 1.0;

/// Runs `acm perceive`. It ends with 3 if a frame could not be grounded (black, without depth, without a surface): such
/// a frame says so in its report and changes nothing in memory; the others are grounded all the same.
pub fn run(args: &PerceiveArgs) -> anyhow::Result<Exit> {
    let input = Input::read(args)?;
    let pictures = Pictures::prepare(args, input.frames.len())?;
    let library = Arc::new(acm_memory::default_library()?);
    let memory: Box<dyn Memory> = match &args.memory {
        Some(dir) => Box::new(acm_memory::AcmMemory::open(dir, Arc::clone(&library))?),
        None => Box::new(acm_memory::AcmMemory::in_memory(Arc::clone(&library))),
    };
    let unknown = GrounderConfig::of_unknown_camera();
    let settings = match args.config.as_deref() {
        Some(path) => config::read_over(&unknown, path)?.settings,
        None => Settings { perception: unknown, ..Settings::default() },
    };
    let file = args.config.as_deref().map_or_else(String::new, |path| path.display().to_string());
    let tools = tools::open(&file, &settings.tools)?;
    let grounder = Grounder::new(Arc::clone(&library), settings.perception).with_tools(tools);
    let mut session = Session { input: &input, pictures, library, memory, grounder };
    session.memory.note(&Note::EpisodeBegan)?;
    let progress = Progress::new(input.frames.len());
    let mut reports = Vec::new();
    let mut blind = false;
    for index in 0..input.frames.len() {
        let report = session.perceive(index)?;
        blind |= report.blindness.is_some();
        progress.done(index);
        match args.json {
            true => reports.push(report),
            false => progress.beside(|| report.print(&session.library, &mut std::io::stdout().lock()))?,
        }
    }
    progress.bar.finish_and_clear();
    if args.json {
        let mut out = std::io::stdout().lock();
        serde_json::to_writer_pretty(&mut out, &Report::new(&reports))?;
        writeln!(out)?;
    }
    Ok(if blind { Exit::GaveUp } else { Exit::Success })
}

/// What all frames of one call share.
struct Session<'a> {
    input: &'a Input,
    pictures: Pictures,
    library: Arc<TemplateLibrary>,
    memory: Box<dyn Memory>,
    grounder: AssistedGrounder,
}

impl Session<'_> {
    fn perceive(&mut self, index: usize) -> anyhow::Result<FrameReport> {
        let files = &self.input.frames[index];
        let (intrinsics, scale) = (self.input.intrinsics, self.input.depth_scale_m);
        let id = FrameId(index as u64);
        let time = Time::from_seconds(FRAME_INTERVAL_S * index as f64);
        let frame = frames::read_pair(&files.color, &files.depth, intrinsics, scale, files.camera_pose, id, time)?;
        let Assisted { percepts, calls } = self.grounder.ground(&frame, &self.memory.expect(time));
        let observation = Observation { percepts: &percepts, frame: &frame, feedback: &no_robot(&frame.header) };
        let grounding = self.memory.observe(&observation)?;
        let report = FrameReport::new(files, &percepts, calls, &grounding, self.memory.view().as_ref());
        self.draw(&files.stem, &frame, &percepts, &report)?;
        Ok(report)
    }

    fn draw(&self, stem: &str, frame: &RgbdFrame, percepts: &Percepts, report: &FrameReport) -> anyhow::Result<()> {
        if let Some(path) = self.pictures.overlay(stem) {
            let mut picture = overlay::draw(frame, percepts, &report.names(), &self.library);
            overlay::note(&mut picture, &report.remarks());
            save(&path, "picture", picture.save(&path))?;
        }
        if let Some(path) = self.pictures.labels(stem) {
            save(&path, "label image", labels::draw(percepts).save(&path))?;
        }
        Ok(())
    }
}

fn save(path: &Path, what: &str, result: image::ImageResult<()>) -> anyhow::Result<()> {
    result.with_context(|| format!("the {what} {} cannot be written; check that its folder exists", path.display()))
}

/// There is no robot in front of a photograph.
pub(crate) fn no_robot(header: &FrameHeader) -> Feedback {
    Feedback {
        time: header.time,
        tcp: Pose::IDENTITY,
        joints: Vec::new(),
        opening_m: 0.0,
        commanded_opening_m: 0.0,
        pad_force_n: [DVec3::ZERO; 2],
        wrist_force_n: DVec3::ZERO,
        ..Feedback::default()
    }
}

/// Counted progress on standard error: a bar on a terminal, now and then a line elsewhere.
struct Progress {
    bar: ProgressBar,
    count: usize,
}

impl Progress {
    /// Fewer frames than this are done before anyone wonders.
    const LONG: usize = 8;

    fn new(count: usize) -> Progress {
        if count < Progress::LONG {
            return Progress { bar: ProgressBar::hidden(), count };
        }
        let bar = ProgressBar::new(count as u64);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} frames {elapsed} eta {eta}");
        let bar = match style {
            Ok(style) => bar.with_style(style),
            Err(_template) => bar,
        };
        Progress { bar, count }
    }
    fn done(&self, index: usize) {
        self.bar.inc(1);
        let (done, step) = (index + 1, (self.count / 10).max(1));
        if self.count >= Progress::LONG && done.is_multiple_of(step) && !std::io::stderr().is_terminal() {
            eprintln!("acm: {done} of {} frames", self.count);
        }
    }
    /// Prints without tearing the bar.
    fn beside(&self, print: impl FnOnce() -> std::io::Result<()>) -> std::io::Result<()> {
        self.bar.suspend(print)
    }
}
