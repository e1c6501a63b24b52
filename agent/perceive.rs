//! `acm perceive`: grounds one real frame and writes it to memory; no simulator.

use crate::cli::{Exit, PerceiveArgs};
use acm_concept::{
    camera::{FrameHeader, RgbdFrame},
    embodiment::Feedback,
    ids::{FrameId, ObjectId},
    object::{GroundedObject, Observability, Percepts},
    pose::Pose,
    template::TemplateLibrary,
    time::Time,
};
use acm_memory::{
    Memory,
    observation::{Grounding, Note, Observation},
};
use acm_perception::{Grounder, GrounderConfig, frames, labels, overlay};
use anyhow::{Context, bail};
use glam::DVec3;
use serde::Serialize;
use std::{io::Write, sync::Arc};

/// Runs `acm perceive`.
pub fn run(args: &PerceiveArgs) -> anyhow::Result<Exit> {
    let &[fx, fy, cx, cy] = args.intrinsics.as_slice() else {
        bail!("--intrinsics needs four numbers fx,fy,cx,cy, got {}", args.intrinsics.len());
    };
    let library = Arc::new(acm_memory::default_library()?);
    let mut memory: Box<dyn Memory> = match &args.memory {
        Some(dir) => Box::new(acm_memory::AcmMemory::open(dir, Arc::clone(&library))?),
        None => Box::new(acm_memory::AcmMemory::in_memory(Arc::clone(&library))),
    };
    let id = FrameId(u64::from(memory.view().frames_seen()));
    let frame = frames::read_pair(&args.color, &args.depth, (fx, fy, cx, cy), args.depth_scale, None, id, Time::ZERO)?;
    let frame = level(frame);
    let grounder = Grounder::new(Arc::clone(&library), GrounderConfig::default());
    let percepts = grounder.ground(&frame, &memory.expect(Time::ZERO));
    memory.note(&Note::EpisodeBegan)?;
    let grounding =
        memory.observe(&Observation { percepts: &percepts, frame: &frame, feedback: &no_robot(&frame.header) })?;
    let ids = ids(&percepts, &grounding);
    if let Some(path) = &args.overlay {
        let names: Vec<Option<String>> = ids.iter().map(|id| id.map(|id| id.to_string())).collect();
        let image = overlay::draw(&frame, &percepts, &names, &library);
        image.save(path).with_context(|| format!("the picture {} cannot be written", path.display()))?;
    }
    if let Some(path) = &args.labels {
        let image = labels::draw(&percepts);
        image.save(path).with_context(|| format!("the label image {} cannot be written", path.display()))?;
    }
    match args.json {
        true => print_json(&percepts, &ids, &library)?,
        false => print_text(&percepts, &ids, &library)?,
    }
    Ok(if percepts.blindness.is_some() { Exit::GaveUp } else { Exit::Success })
}

/// Without a camera pose the world is the surface's: z = 0 on the plane, x to the camera's right.
fn level(mut frame: RgbdFrame) -> RgbdFrame {
    if let Some(pose) = acm_perception::level(&frame, &GrounderConfig::default()) {
        frame.header.camera_pose = pose;
    }
    frame
}

/// There is no robot in front of a photograph.
fn no_robot(header: &FrameHeader) -> Feedback {
    Feedback {
        time: header.time,
        tcp: Pose::IDENTITY,
        joints: Vec::new(),
        opening_m: 0.0,
        commanded_opening_m: 0.0,
        pad_force_n: [DVec3::ZERO; 2],
        wrist_force_n: DVec3::ZERO,
    }
}

fn ids(percepts: &Percepts, grounding: &Grounding) -> Vec<Option<ObjectId>> {
    let of = |index| grounding.resolved.iter().find(|resolved| resolved.percept == index).map(|r| r.object);
    (0..percepts.objects.len()).map(of).collect()
}

fn print_text(percepts: &Percepts, ids: &[Option<ObjectId>], library: &TemplateLibrary) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    if let Some(blindness) = percepts.blindness {
        writeln!(out, "nothing can be grounded: {blindness:?} ({:.0} % depth)", 100.0 * percepts.depth_fraction)?;
    }
    writeln!(
        out,
        "{} objects; depth on {:.0} % of the pixels",
        percepts.objects.len(),
        100.0 * percepts.depth_fraction
    )?;
    for (object, id) in percepts.objects.iter().zip(ids) {
        let name = id.map_or_else(|| "-".into(), |id| id.to_string());
        writeln!(out, "{name:<4} {}", describe(object, library))?;
    }
    Ok(())
}

/// One object in a line: category, dimensions in centimetres, place, confidence.
pub fn describe(object: &GroundedObject, _library: &TemplateLibrary) -> String {
    let dimensions = object.parts.first().map(|part| {
        let one = |p: &acm_concept::object::ParameterEstimate| {
            let mark = match p.observability {
                Observability::Observed => format!("+-{:.1}", 100.0 * p.sigma),
                Observability::Interval { low, high } => format!(" in [{:.1}, {:.1}]", 100.0 * low, 100.0 * high),
                Observability::PriorOnly => " (not seen)".into(),
            };
            format!("{} {:.1}{mark}", p.name, 100.0 * p.value)
        };
        part.parameters.iter().map(one).collect::<Vec<_>>().join(", ")
    });
    let at = object.pose().map_or(DVec3::NAN, |pose| pose.pose.translation);
    format!(
        "{:<10} {} cm at ({:.3}, {:.3}, {:.3}) m, {} pixels, confidence {:.2}{}",
        object.category,
        dimensions.unwrap_or_default(),
        at.x,
        at.y,
        at.z,
        object.support.count,
        object.confidence,
        if object.truncated { ", cut off" } else { "" }
    )
}

#[derive(Serialize)]
struct Perceived<'a> {
    schema: &'static str,
    objects: Vec<Line<'a>>,
    percepts: &'a Percepts,
}

#[derive(Serialize)]
struct Line<'a> {
    id: Option<ObjectId>,
    category: &'a str,
    summary: String,
}

fn print_json(percepts: &Percepts, ids: &[Option<ObjectId>], library: &TemplateLibrary) -> anyhow::Result<()> {
    let line = |(object, id): (&'_ GroundedObject, &Option<ObjectId>)| (*id, describe(object, library));
    let objects = percepts
        .objects
        .iter()
        .zip(ids)
        .map(|pair| {
            let (id, summary) = line(pair);
            Line { id, category: &pair.0.category, summary }
        })
        .collect();
    serde_json::to_writer_pretty(std::io::stdout().lock(), &Perceived { schema: "acm.perceive/1", objects, percepts })?;
    println!();
    Ok(())
}
