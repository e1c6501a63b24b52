//! The tool traits and what a tool is told.

use super::{
    found::{Detection, Mask, ParamBelief, PartHypothesis, PoseBelief},
    outcome::{Identity, Outcome},
};
use acm_concept::{
    camera::RgbdFrame,
    object::PixelSupport,
    template::{Template, TemplateLibrary},
};
use std::time::Duration;

/// What every request holds.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Number of the request among those of one agent.
    pub id: u64,
    /// The frame that is asked about, with nominal calibration.
    pub frame: &'a RgbdFrame,
    /// How long the tool has for its answer. A tool that waits for something gives up by then.
    pub limit: Duration,
}

/// What a segmenter may go by besides the pixels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Prompts<'a> {
    /// Nouns of the instruction.
    pub nouns: &'a [String],
    /// Boxes in which a detector found something.
    pub boxes: &'a [Detection],
}

/// A thing whose template is given.
#[derive(Debug, Clone, Copy)]
pub struct PartView<'a> {
    /// Its visible pixels.
    pub mask: &'a PixelSupport,
    /// The template that it is taken for.
    pub template: &'a Template,
    /// Values of the template's parameters to begin with, in its order: with them the template is a solid.
    pub values: &'a [f64],
}

/// What all tools have in common.
pub trait Tool: Send + Sync {
    /// Which tool it is.
    fn identity(&self) -> Identity;
}

/// Finds things in the image.
pub trait Detector: Tool {
    /// The things in a frame. Nouns of the instruction say what matters; without any everything does.
    fn detect(&self, request: &Request, nouns: &[String]) -> Outcome<Vec<Detection>>;
}

/// Cuts things out of the image.
pub trait Segmenter: Tool {
    /// The visible pixels of every thing that stands on the surface. Masks share no pixel.
    fn segment(&self, request: &Request, prompts: &Prompts) -> Outcome<Vec<Mask>>;
}

/// Names the template of a thing.
pub trait PartRecogniser: Tool {
    /// The templates of the library that a thing may be, the likeliest first.
    fn recognise(
        &self,
        request: &Request,
        mask: &PixelSupport,
        library: &TemplateLibrary,
    ) -> Outcome<Vec<PartHypothesis>>;
}

/// Places a thing whose template is given.
pub trait PoseEstimator: Tool {
    /// The pose of a thing, beginning from an earlier belief where there is one.
    fn pose(&self, request: &Request, part: &PartView, prior: Option<&PoseBelief>) -> Outcome<PoseBelief>;
}

/// Measures a thing whose template is given.
pub trait ParamEstimator: Tool {
    /// The parameters of a thing, beginning from an earlier belief where there is one.
    fn params(&self, request: &Request, part: &PartView, prior: Option<&ParamBelief>) -> Outcome<ParamBelief>;
}

/// Wall time as the shell measures it; perception has no clock of its own.
pub trait Stopwatch: Send + Sync {
    /// Time since some fixed moment.
    fn elapsed(&self) -> Duration;
}

/// A stopwatch that stands still: nothing is late. For tools that keep to their limit by themselves, and for tests.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoStopwatch;

impl Stopwatch for NoStopwatch {
    fn elapsed(&self) -> Duration {
        Duration::ZERO
    }
}
