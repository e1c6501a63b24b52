//! The pipeline with tools beside it: their masks, rankings, poses and sizes go into the same fits as geometry's own.

use super::{Grounder, assemble, beliefs};
use crate::{
    fit::Evidence,
    hypotheses::{Context, Hypothesis, advised},
    scene::Scene,
    segments::{NONE, Segments},
    tools::{Answer, Mask, Outcome, PartView, Prompts, Request, ToolCall, ToolError, Tools},
};
use acm_concept::{
    camera::RgbdFrame,
    expectation::Expectation,
    object::{Percepts, PixelSupport},
};
use std::sync::atomic::{AtomicU64, Ordering};

/// A grounder with tools. What a tool answers goes into the pipeline in place of, or beside, what geometry found, and is
/// fitted and judged like it: a tool is never the last word. Where a tool abstains, fails or is not there, geometry
/// goes on alone, and [`Assisted::calls`] says so.
///
/// | tool | what becomes of its answer |
/// |---|---|
/// | detector | its boxes are prompts for the segmenter |
/// | segmenter | its masks take the place of the segments of what stands on the surface; a partial answer leaves geometry's segments where it has none |
/// | part recogniser | its ranking raises and lowers the odds of the templates that fit, up to a limit |
/// | pose and parameter estimator | one more start of the best template's fit; the better fit is kept |
///
/// It is a type of its own because tools are effects: whoever grounds with a plain [`Grounder`] needs nothing but the
/// frame and the expectation to do the same again.
#[derive(Debug)]
pub struct AssistedGrounder {
    grounder: Grounder,
    tools: Tools,
    /// Requests so far: each has a number of its own.
    asked: AtomicU64,
}

/// What a frame shows, and what the tools had to do with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Assisted {
    /// What the frame shows.
    pub percepts: Percepts,
    /// Every call, in order, with what was made of the answer.
    pub calls: Vec<ToolCall>,
}

impl Grounder {
    /// The grounder with tools beside it.
    pub fn with_tools(self, tools: Tools) -> AssistedGrounder {
        AssistedGrounder { grounder: self, tools, asked: AtomicU64::new(0) }
    }
}

impl AssistedGrounder {
    /// Says what a frame shows, as [`Grounder::ground`] does, with the help of the tools. Never fails: without a word
    /// from any tool the percepts are those of the grounder alone.
    pub fn ground(&self, frame: &RgbdFrame, expectation: &Expectation) -> Assisted {
        let mut aid = Aid { with: Some((self, frame)), ..Aid::none() };
        let percepts = self.grounder.ground_with(frame, expectation, &mut aid);
        Assisted { percepts, calls: aid.calls }
    }
}

/// A mask of a tool counts if at least this share of it stands on the surface: the surface itself, the robot and what
/// lies beyond are not things.
const STANDING: f64 = 0.5;

/// The tools at work on one frame, or none.
pub(super) struct Aid<'a> {
    with: Option<(&'a AssistedGrounder, &'a RgbdFrame)>,
    calls: Vec<ToolCall>,
    /// Questions to which nobody answered in time: they are not asked again in this frame, or one server that hangs
    /// would cost its deadline for each segment.
    given_up: Vec<&'static str>,
}

impl<'a> Aid<'a> {
    /// Nobody to ask.
    pub fn none() -> Aid<'static> {
        Aid { with: None, calls: Vec::new(), given_up: Vec::new() }
    }

    /// Whether there is nobody to ask.
    pub fn is_none(&self) -> bool {
        self.with.is_none()
    }

    /// Whom to ask, if there is anybody, and a request with a number of its own.
    fn request(&self) -> Option<(&'a Tools, Request<'a>)> {
        let (assisted, frame) = self.with?;
        let id = assisted.asked.fetch_add(1, Ordering::Relaxed);
        Some((&assisted.tools, Request { id, frame, limit: assisted.tools.limit }))
    }

    /// Lets the segmenter cut out what stands on the surface. Geometry's segments stay where it gives none.
    pub fn cut(&mut self, scene: &Scene, nouns: &[String], segments: &mut Segments) {
        let Some((tools, request)) = self.request().filter(|(tools, _)| tools.segmenter.is_some()) else { return };
        let detected = self.request().and_then(|(tools, request)| tools.detect(&request, nouns));
        let boxes = detected.as_ref().and_then(|answer| answer.outcome.value()).map_or(&[][..], Vec::as_slice);
        if let Some(answer) = &detected {
            let made = answer.outcome.value().map_or("segmented without boxes", |_| "boxes for the segmenter");
            self.calls.push(ToolCall::new("detect", answer, made));
        }
        let Some(answer) = tools.segment(&request, &Prompts { nouns, boxes }) else { return };
        let made = match &answer.outcome {
            Outcome::Ok(masks) => lay(scene, masks, false, segments),
            Outcome::Partial { value, .. } => lay(scene, value, true, segments),
            Outcome::Abstain(_) | Outcome::Failed(_) => "geometry's segments".into(),
        };
        self.calls.push(ToolCall::new("segment", &answer, made));
    }

    /// Lets the other tools have a say in what a segment is. What memory recognised is not asked about.
    pub fn advise(
        &mut self,
        scene: &Scene,
        context: Context,
        evidence: &Evidence,
        pixels: &[usize],
        ranked: &mut [Hypothesis],
    ) {
        let Some((tools, request)) = self.request() else { return };
        let asked =
            tools.part_recogniser.is_some() || tools.pose_estimator.is_some() || tools.param_estimator.is_some();
        if !asked || ranked.first().is_none_or(|best| best.tracked.is_some()) {
            return;
        }
        let mut set = vec![false; scene.grid.len()];
        pixels.iter().for_each(|&pixel| set[pixel] = true);
        let Some(mask) = PixelSupport::from_mask(&set, scene.grid.width) else { return };
        if let Some(answer) = self.still("recognise", || tools.recognise(&request, &mask, context.library)) {
            let said: Option<Vec<(String, f64)>> = answer
                .outcome
                .value()
                .map(|found| found.iter().map(|h| (h.template.clone(), h.log_likelihood)).collect());
            said.iter().for_each(|said| advised::weigh(ranked, said));
            self.note("recognise", &answer, "odds of the templates", "geometry's odds");
        }
        self.start(scene, context, evidence, &mask, pixels, ranked);
    }

    /// One more start of the best template's fit, where the tools place or measure it.
    fn start(
        &mut self,
        scene: &Scene,
        context: Context,
        evidence: &Evidence,
        mask: &PixelSupport,
        pixels: &[usize],
        ranked: &mut [Hypothesis],
    ) {
        let Some((tools, request)) = self.request() else { return };
        if tools.pose_estimator.is_none() && tools.param_estimator.is_none() {
            return;
        }
        let Some(best) = ranked.first() else { return };
        let object = assemble::object(scene, context, std::slice::from_ref(best), evidence, pixels, 1.0);
        let Some(fitted) = object.as_ref().and_then(|object| object.parts.first()) else { return };
        let pose = beliefs::pose(best, fitted, context.config);
        let params = beliefs::params(best, fitted, evidence, mask.count);
        let part = |values| PartView { mask, template: best.model.template, values };
        let measured_by_tool = self.still("params", || tools.params(&request, &part(&params.mean), Some(&params)));
        let values = measured_by_tool.as_ref().and_then(|answer| answer.outcome.value()).map(|belief| &belief.mean);
        let begin = values.unwrap_or(&params.mean).clone();
        let placed_by_tool = self
            .request()
            .and_then(|(tools, request)| self.still("pose", || tools.pose(&request, &part(&begin), Some(&pose))));
        let place = placed_by_tool.as_ref().and_then(|answer| answer.outcome.value()).map(|belief| belief.pose);
        let made = match (values, place) {
            (None, None) => "geometry's fit".to_owned(),
            (_, place) => {
                let start = (begin.as_slice(), &place.unwrap_or(pose.pose));
                match advised::restart(scene, evidence, ranked, start) {
                    Ok(true) => "a better fit".into(),
                    Ok(false) => "a start that fits no better".into(),
                    Err(reason) => format!("no start: {reason}"),
                }
            }
        };
        if let Some(answer) = &measured_by_tool {
            self.note("params", answer, &made, "geometry's fit");
        }
        if let Some(answer) = &placed_by_tool {
            self.note("pose", answer, &made, "geometry's fit");
        }
    }

    /// What a question brings, unless it was given up.
    fn still<T>(&self, asked: &'static str, ask: impl FnOnce() -> Option<T>) -> Option<T> {
        if self.given_up.contains(&asked) { None } else { ask() }
    }

    fn note<T>(&mut self, asked: &'static str, answer: &Answer<T>, used: &str, unused: &str) {
        let lost =
            matches!(answer.outcome, Outcome::Failed(ToolError::TimedOut { .. } | ToolError::Unreachable { .. }));
        let made = match answer.outcome.value() {
            Some(_) => used.to_owned(),
            None if lost => format!("{unused}, and not asked again in this frame"),
            None => unused.to_owned(),
        };
        if lost {
            self.given_up.push(asked);
        }
        self.calls.push(ToolCall::new(asked, answer, made));
    }
}

/// Puts a tool's masks in place of segments; `beside` keeps what they leave uncovered. Says how many counted: if none
/// does, the tool saw nothing of what stands here, and geometry's segments stay.
fn lay(scene: &Scene, masks: &[Mask], beside: bool, segments: &mut Segments) -> String {
    let stands = |mask: &Mask| {
        let pixels = mask.support.indices();
        let standing: Vec<usize> = pixels.iter().copied().filter(|&pixel| scene.rising[pixel]).collect();
        // Where nothing was measured nothing speaks against a mask.
        let known = pixels.iter().filter(|&&pixel| scene.is_known(pixel)).count();
        let counts = standing.len() as f64 >= STANDING * known as f64 && standing.len() >= scene.config.min_segment_px;
        counts.then_some(standing)
    };
    let things: Vec<Vec<usize>> = masks.iter().filter_map(stands).collect();
    if things.is_empty() {
        return format!("geometry's segments: none of {} masks stands on the surface", masks.len());
    }
    if !beside {
        segments.labels.fill(NONE);
        segments.count = 0;
    }
    for thing in &things {
        segments.lay(thing);
    }
    // What is left of a segment that a mask cut into may be a sliver.
    let kept: Vec<bool> = segments.pixels().iter().map(|pixels| pixels.len() >= scene.config.min_segment_px).collect();
    segments.keep(&kept);
    format!("{} of {} masks, those that stand on the surface", things.len(), masks.len())
}
