//! What is said of a frame: objects with identities, what became of those that memory knew, as text and as JSON.

use super::input::FramePair;
use acm_concept::{
    color::Appearance,
    ids::ObjectId,
    object::{
        Blindness, GroundedObject, GroundedPart, Observability, ParameterEstimate, Percepts, SupportPlane, Visibility,
    },
    pose::Pose,
    reading::Reading,
    template::{TemplateLibrary, Unit},
};
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Presence},
    observation::{Grounding, Resolved},
};
use acm_perception::tools::ToolCall;
use glam::DVec3;
use serde::Serialize;
use std::{
    io::{self, Write},
    path::PathBuf,
};

/// A part whose own z axis is farther from the vertical than this cosine lies on its side.
const UPRIGHT_COSINE: f64 = 0.9;

/// What a frame says of an object's identity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Memory did not know it.
    New,
    /// Memory knew it.
    Kept,
    /// It is one of several that memory knows; the candidates have probabilities.
    Ambiguous,
    /// Memory held it for a false alarm or for a piece of something else.
    Dropped,
    /// Memory knew it, and it is no longer where it was.
    Missing,
    /// Memory knows it, and this frame cannot tell: covered, out of view, or without depth.
    Unseen,
}

impl Status {
    fn word(self) -> &'static str {
        match self {
            Status::New => "new",
            Status::Kept => "kept",
            Status::Ambiguous => "ambiguous",
            Status::Dropped => "dropped",
            Status::Missing => "missing",
            Status::Unseen => "unseen",
        }
    }
}

/// An identity that an object may have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// The identity.
    pub id: ObjectId,
    /// Its probability, 0-1.
    pub probability: f64,
}

/// An object that the frame shows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SeenObject {
    /// Its identity; none if memory dropped it.
    pub id: Option<ObjectId>,
    /// What memory made of it.
    pub status: Status,
    /// The identities that it may have, the chosen one first; empty for a new one.
    pub candidates: Vec<Candidate>,
    /// Whether memory took the view over; if not, it waits for a second view that agrees.
    pub accepted: bool,
    /// Most likely category.
    pub category: String,
    /// Probabilities of the nouns that fit, best first.
    pub categories: Vec<(String, f64)>,
    /// The parts as this frame shows them: template, parameters with uncertainty, pose in the world.
    pub parts: Vec<GroundedPart>,
    /// Mean colour.
    pub appearance: Appearance,
    /// Probability that this is an object and its grounding is right, 0-1.
    pub confidence: f64,
    /// Whether something cuts its outline off.
    pub truncated: bool,
    /// What is written or shown on it.
    pub readings: Vec<Reading>,
    /// Its value in the label image.
    pub label: u16,
    /// Number of its pixels.
    pub pixels: u32,
    /// First column, first row, last column, last row, both included.
    pub bounds: [u32; 4],
}

/// An object that memory knows and the frame does not show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AbsentObject {
    /// Its identity.
    pub id: ObjectId,
    /// Missing or unseen.
    pub status: Status,
    /// Whether this frame is the first that found it missing.
    pub since_now: bool,
    /// Its category.
    pub category: String,
    /// Pose of its main part when it was last seen.
    pub last_pose: Option<Pose>,
}

/// Everything that is said of one frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameReport {
    /// What the frame's files share.
    pub stem: String,
    /// The colour image.
    pub color: PathBuf,
    /// The depth image.
    pub depth: PathBuf,
    /// Pose of the camera in the world: as given, or over the plane.
    pub camera_pose: Pose,
    /// Why nothing could be grounded, if so.
    pub blindness: Option<Blindness>,
    /// Share of the pixels with a depth, 0-1.
    pub depth_fraction: f64,
    /// The surface on which things stand.
    pub support: Option<SupportPlane>,
    /// What the frame shows, largest first.
    pub objects: Vec<SeenObject>,
    /// What memory knows and the frame does not show.
    pub absent: Vec<AbsentObject>,
    /// What tools were asked, what came of it, and what was made of their answers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tools: Vec<ToolCall>,
}

/// The JSON document of `acm perceive --json`.
#[derive(Debug, Serialize)]
pub struct Report<'a> {
    schema: &'static str,
    frames: &'a [FrameReport],
}

impl<'a> Report<'a> {
    /// The document of some frames.
    pub fn new(frames: &'a [FrameReport]) -> Report<'a> {
        Report { schema: "acm.perceive/2", frames }
    }
}

impl FrameReport {
    /// Joins what perception saw with what memory made of it.
    pub fn new(
        files: &FramePair,
        percepts: &Percepts,
        calls: Vec<ToolCall>,
        grounding: &Grounding,
        memory: &dyn MemoryView,
    ) -> FrameReport {
        let resolved = |index| grounding.resolved.iter().find(|resolved| resolved.percept == index);
        let objects = percepts.objects.iter().enumerate();
        FrameReport {
            stem: files.stem.clone(),
            color: files.color.clone(),
            depth: files.depth.clone(),
            camera_pose: percepts.frame.camera_pose,
            blindness: percepts.blindness,
            depth_fraction: percepts.depth_fraction,
            support: percepts.support,
            objects: objects.map(|(i, object)| seen(i, object, resolved(i), memory)).collect(),
            absent: memory.objects().iter().filter_map(|entry| absent(entry, percepts, grounding)).collect(),
            tools: calls,
        }
    }

    /// The names of the objects for a picture, in their order: id, and what is to be said of it.
    pub fn names(&self) -> Vec<Option<String>> {
        let name = |object: &SeenObject| {
            let id = object.id.map_or_else(|| "-".into(), |id| id.to_string());
            match object.status {
                Status::Ambiguous => format!("{id}?"),
                Status::New | Status::Kept | Status::Dropped | Status::Missing | Status::Unseen => id,
            }
        };
        self.objects.iter().map(|object| Some(name(object))).collect()
    }
    /// What a picture says below: what is not in it.
    pub fn remarks(&self) -> Vec<String> {
        let of = |status: Status| {
            let ids: Vec<String> =
                self.absent.iter().filter(|a| a.status == status).map(|a| format!("{} {}", a.id, a.category)).collect();
            (!ids.is_empty()).then(|| format!("{}: {}", status.word(), ids.join(", ")))
        };
        [of(Status::Missing), of(Status::Unseen)].into_iter().flatten().collect()
    }

    /// What the tools had to do with it: a line for each question and each outcome of it.
    fn tool_lines(&self) -> Vec<String> {
        let mut lines: Vec<(String, usize)> = Vec::new();
        for call in &self.tools {
            let remark = call.remark.as_ref().map_or_else(String::new, |remark| format!(", {remark}"));
            let line =
                format!("{} asked to {}: {}{remark}; {}", call.meta.identity.tool, call.asked, call.outcome, call.made);
            match lines.iter_mut().find(|(known, _)| *known == line) {
                Some((_, count)) => *count += 1,
                None => lines.push((line, 1)),
            }
        }
        let times = |(line, count)| if count > 1 { format!("{line} ({count} times)") } else { line };
        lines.into_iter().map(times).collect()
    }

    /// Writes a heading, a line for every object that is seen, and one for every object that is not. The library knows
    /// the units of the parameters.
    pub fn print(&self, library: &TemplateLibrary, out: &mut dyn Write) -> io::Result<()> {
        let percent = 100.0 * self.depth_fraction;
        match self.blindness {
            Some(blindness) => writeln!(out, "{}: nothing can be grounded: {}", self.stem, blind_words(blindness))?,
            None => writeln!(
                out,
                "{}: {} object{}; depth on {percent:.0} % of the pixels",
                self.stem,
                self.objects.len(),
                if self.objects.len() == 1 { "" } else { "s" }
            )?,
        }
        for object in &self.objects {
            let id = object.id.map_or_else(|| "-".into(), |id| id.to_string());
            writeln!(out, "  {id:<4} {:<9} {}", object.status.word(), object.line(library))?;
            for reading in &object.readings {
                writeln!(out, "  {:<14} reads {reading} at {}", "", place(&Pose::from_translation(reading.position)))?;
            }
        }
        for object in &self.absent {
            let last = object.last_pose.map_or_else(String::new, |pose| format!(" last at {}", place(&pose)));
            writeln!(out, "  {:<4} {:<9} {:<9}{last}", object.id.to_string(), object.status.word(), object.category)?;
        }
        for line in self.tool_lines() {
            writeln!(out, "  {line}")?;
        }
        Ok(())
    }
}

impl SeenObject {
    /// Category, templates with their sizes and uncertainty, place, confidence, and what is in doubt.
    fn line(&self, library: &TemplateLibrary) -> String {
        let parts: Vec<String> = self.parts.iter().map(|part| shape(part, library)).collect();
        let at = self.parts.first().map_or_else(String::new, |part| place(&part.pose.pose));
        let mut line = format!("{:<9} {} at {at}, confidence {:.2}", self.category, parts.join("; "), self.confidence);
        if self.truncated {
            line += ", cut off";
        }
        if self.status == Status::Ambiguous {
            let candidates: Vec<String> =
                self.candidates.iter().map(|c| format!("{} {:.2}", c.id, c.probability)).collect();
            line += &format!(", may be {}", candidates.join(" or "));
        } else if self.status == Status::Kept && !self.accepted {
            line += ", to be seen again";
        }
        line
    }
}

fn seen(index: usize, object: &GroundedObject, resolved: Option<&Resolved>, memory: &dyn MemoryView) -> SeenObject {
    let doubts = resolved.and_then(|r| memory.object(r.object)).map_or(&[][..], |entry| &entry.ambiguous_with);
    let status = match resolved {
        None => Status::Dropped,
        Some(_) if !doubts.is_empty() => Status::Ambiguous,
        Some(resolved) if resolved.new => Status::New,
        Some(_) => Status::Kept,
    };
    let known = resolved.filter(|resolved| !resolved.new || !doubts.is_empty());
    let chosen = known.map(|resolved| Candidate { id: resolved.object, probability: resolved.probability });
    let others = doubts.iter().map(|(id, probability)| Candidate { id: *id, probability: *probability });
    SeenObject {
        id: resolved.map(|resolved| resolved.object),
        status,
        candidates: chosen.into_iter().chain(others).collect(),
        accepted: resolved.is_some_and(|resolved| resolved.accepted),
        category: object.category.clone(),
        categories: object.categories.clone(),
        parts: object.parts.clone(),
        appearance: object.appearance,
        confidence: object.confidence,
        truncated: object.truncated,
        readings: object.readings.clone(),
        label: u16::try_from(index + 1).unwrap_or(u16::MAX),
        pixels: object.support.count,
        bounds: object.support.bounds,
    }
}

fn absent(entry: &ObjectEntry, percepts: &Percepts, grounding: &Grounding) -> Option<AbsentObject> {
    if grounding.resolved.iter().any(|resolved| resolved.object == entry.id) {
        return None;
    }
    let view = percepts.expected.iter().find(|view| view.object == entry.id).map(|view| view.visibility);
    let status = match (entry.presence, view) {
        (Presence::Missing, _) | (_, Some(Visibility::SeenThrough)) => Status::Missing,
        _ => Status::Unseen,
    };
    Some(AbsentObject {
        id: entry.id,
        status,
        since_now: grounding.missing.contains(&entry.id),
        category: entry.category.clone(),
        last_pose: entry.pose(),
    })
}

fn blind_words(blindness: Blindness) -> &'static str {
    match blindness {
        Blindness::NoDepth => "almost no depth from 0.12 to 6 m: the depth image is empty, or --depth-scale is wrong",
        Blindness::DepthScale => "the depth is nearly all nearer than 0.12 or farther than 6 m: --depth-scale is wrong",
        Blindness::NoColor => "the colour image is black",
        Blindness::Overexposed => "the colour image is white",
        Blindness::Frozen => "the camera has stopped: the picture is the last one again",
        Blindness::NoSupport => {
            "no level surface on which things could stand: there is none, or the intrinsics or the pose are wrong"
        }
    }
}

fn place(pose: &Pose) -> String {
    let at = pose.translation;
    format!("({:.3}, {:.3}, {:.3}) m", at.x, at.y, at.z)
}

/// A part's template and sizes; lengths in centimetres, angles in degrees.
fn shape(part: &GroundedPart, library: &TemplateLibrary) -> String {
    let unit = |name: &str| {
        let spec = library.get(&part.template).and_then(|t| t.parameters.iter().find(|spec| spec.name == name));
        spec.map_or(Unit::One, |spec| spec.unit)
    };
    let sizes: Vec<String> = part.parameters.iter().map(|p| size(p, unit(&p.name))).collect();
    let lies = part.pose.pose.transform_vector(DVec3::Z).z < UPRIGHT_COSINE;
    format!("{:<9} {}{}", part.template, sizes.join(", "), if lies { ", on its side," } else { "" })
}

fn size(parameter: &ParameterEstimate, unit: Unit) -> String {
    let (factor, name) = match unit {
        Unit::M => (100.0, " cm"),
        Unit::Rad => (1f64.to_degrees(), " deg"),
        Unit::One => (1.0, ""),
    };
    let mark = match parameter.observability {
        Observability::Observed => format!("+-{:.1}", factor * parameter.sigma),
        Observability::Interval { low, high } => format!(" in [{:.1}, {:.1}]", factor * low, factor * high),
        Observability::PriorOnly => " (not measured)".into(),
    };
    format!("{} {:.1}{mark}{name}", parameter.name, factor * parameter.value)
}
