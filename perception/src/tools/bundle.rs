//! The tools of one agent, and how they are asked.

use super::{
    asked::{
        Detector, NoStopwatch, ParamEstimator, PartRecogniser, PartView, PoseEstimator, Prompts, Request, Segmenter,
        Stopwatch, Tool,
    },
    check,
    found::{Detection, Mask, ParamBelief, PartHypothesis, PoseBelief},
    outcome::{Answer, Outcome, Reason, ToolError, ToolMeta},
};
use acm_concept::{object::PixelSupport, template::TemplateLibrary};
use serde::Serialize;
use std::{fmt, sync::Arc, time::Duration};

/// The tools that help perception. Where there is none, geometry works alone.
#[derive(Clone)]
pub struct Tools {
    /// Finds things; its boxes and nouns are prompts for the segmenter.
    pub detector: Option<Arc<dyn Detector>>,
    /// Cuts things out.
    pub segmenter: Option<Arc<dyn Segmenter>>,
    /// Names templates.
    pub part_recogniser: Option<Arc<dyn PartRecogniser>>,
    /// Places things.
    pub pose_estimator: Option<Arc<dyn PoseEstimator>>,
    /// Measures things.
    pub param_estimator: Option<Arc<dyn ParamEstimator>>,
    /// How long each call may take.
    pub limit: Duration,
    /// By which lateness is told.
    pub stopwatch: Arc<dyn Stopwatch>,
}

impl Default for Tools {
    /// No tools.
    fn default() -> Tools {
        Tools {
            detector: None,
            segmenter: None,
            part_recogniser: None,
            pose_estimator: None,
            param_estimator: None,
            limit: Tools::DEFAULT_LIMIT,
            stopwatch: Arc::new(NoStopwatch),
        }
    }
}

impl fmt::Debug for Tools {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut names = f.debug_struct("Tools");
        let mut name = |field, tool: Option<&dyn Tool>| {
            names.field(field, &tool.map(|tool| tool.identity().tool));
        };
        name("detector", self.detector.as_deref().map(|tool| tool as &dyn Tool));
        name("segmenter", self.segmenter.as_deref().map(|tool| tool as &dyn Tool));
        name("part_recogniser", self.part_recogniser.as_deref().map(|tool| tool as &dyn Tool));
        name("pose_estimator", self.pose_estimator.as_deref().map(|tool| tool as &dyn Tool));
        name("param_estimator", self.param_estimator.as_deref().map(|tool| tool as &dyn Tool));
        names.field("limit", &self.limit).finish_non_exhaustive()
    }
}

/// What came of one call, as a report says it. An answer that could not be used says so here: perception then goes on
/// with geometry.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ToolCall {
    /// What was asked for: `segment`, `pose`.
    pub asked: &'static str,
    /// Whom, and how long it took.
    #[serde(flatten)]
    pub meta: ToolMeta,
    /// `ok`, `partial`, `abstain` or `failed`.
    pub outcome: &'static str,
    /// What is missing, or why.
    pub remark: Option<String>,
    /// What perception made of it.
    pub made: String,
}

impl ToolCall {
    /// The record of an answer, and what was made of it.
    pub fn new<T>(asked: &'static str, answer: &Answer<T>, made: impl Into<String>) -> ToolCall {
        let (outcome, remark) = (answer.outcome.word(), answer.outcome.remark());
        ToolCall { asked, meta: answer.meta.clone(), outcome, remark, made: made.into() }
    }
}

impl Tools {
    /// Time of a call where nothing else is said.
    pub const DEFAULT_LIMIT: Duration = Duration::from_millis(500);

    /// Whether there is any.
    pub fn is_empty(&self) -> bool {
        self.detector.is_none()
            && self.segmenter.is_none()
            && self.part_recogniser.is_none()
            && self.pose_estimator.is_none()
            && self.param_estimator.is_none()
    }

    /// Asks the detector, if there is one.
    pub fn detect(&self, request: &Request, nouns: &[String]) -> Option<Answer<Vec<Detection>>> {
        let tool = self.detector.as_deref()?;
        let check = |found: &Vec<Detection>| check::detections(found, &request.frame.header.intrinsics);
        Some(something(self.ask(tool, request, || tool.detect(request, nouns), check)))
    }
    /// Asks the segmenter, if there is one.
    pub fn segment(&self, request: &Request, prompts: &Prompts) -> Option<Answer<Vec<Mask>>> {
        let tool = self.segmenter.as_deref()?;
        let check = |found: &Vec<Mask>| check::masks(found, &request.frame.header.intrinsics);
        Some(something(self.ask(tool, request, || tool.segment(request, prompts), check)))
    }
    /// Asks the part recogniser, if there is one.
    pub fn recognise(
        &self,
        request: &Request,
        mask: &PixelSupport,
        library: &TemplateLibrary,
    ) -> Option<Answer<Vec<PartHypothesis>>> {
        let tool = self.part_recogniser.as_deref()?;
        let check = |found: &Vec<PartHypothesis>| check::hypotheses(found, library);
        let call = || of_a_mask(request, mask, || tool.recognise(request, mask, library));
        Some(something(self.ask(tool, request, call, check)))
    }
    /// Asks the pose estimator, if there is one.
    pub fn pose(&self, request: &Request, part: &PartView, prior: Option<&PoseBelief>) -> Option<Answer<PoseBelief>> {
        let tool = self.pose_estimator.as_deref()?;
        let check = |found: &PoseBelief| check::pose(found, &request.frame.header);
        Some(self.ask(tool, request, || of_a_mask(request, part.mask, || tool.pose(request, part, prior)), check))
    }
    /// Asks the parameter estimator, if there is one.
    pub fn params(
        &self,
        request: &Request,
        part: &PartView,
        prior: Option<&ParamBelief>,
    ) -> Option<Answer<ParamBelief>> {
        let tool = self.param_estimator.as_deref()?;
        let check = |found: &ParamBelief| check::params(found, part);
        Some(self.ask(tool, request, || of_a_mask(request, part.mask, || tool.params(request, part, prior)), check))
    }

    /// Asks, and believes neither a late answer nor one that makes no sense.
    fn ask<T>(
        &self,
        tool: &(impl Tool + ?Sized),
        request: &Request,
        call: impl FnOnce() -> Outcome<T>,
        check: impl FnOnce(&T) -> Result<(), ToolError>,
    ) -> Answer<T> {
        let began = self.stopwatch.elapsed();
        let outcome = call();
        let latency = self.stopwatch.elapsed().saturating_sub(began);
        let outcome = match outcome.value().map_or(Ok(()), check) {
            _ if latency > request.limit => {
                Outcome::Failed(ToolError::TimedOut { limit_ms: request.limit.as_millis() as u64 })
            }
            Err(error) => Outcome::Failed(error),
            Ok(()) => outcome,
        };
        let (identity, frame) = (tool.identity(), request.frame.header.id);
        Answer { meta: ToolMeta { identity, request: request.id, frame, latency }, outcome }
    }
}

/// No tool is asked about a mask that is none of the frame.
fn of_a_mask<T>(request: &Request, mask: &PixelSupport, call: impl FnOnce() -> Outcome<T>) -> Outcome<T> {
    match Mask::from_runs(mask.runs.clone(), &request.frame.header.intrinsics, 1.0) {
        Ok(read) if read.support == *mask => call(),
        Ok(_) => Outcome::Failed(ToolError::bad_request("mask", "has another count or other bounds than its runs")),
        Err(error) => Outcome::Failed(ToolError::bad_request("mask", error.to_string())),
    }
}

/// An empty list is no whole answer: who finds nothing abstains, and geometry goes on.
fn something<T>(answer: Answer<Vec<T>>) -> Answer<Vec<T>> {
    match answer.outcome {
        Outcome::Ok(found) if found.is_empty() => Answer { outcome: Outcome::Abstain(Reason::NothingFound), ..answer },
        _ => answer,
    }
}
