//! The default behind every trait: the pipeline's own steps.

use super::{
    asked::{Detector, ParamEstimator, PartRecogniser, PartView, PoseEstimator, Prompts, Request, Segmenter, Tool},
    found::{Detection, Mask, ParamBelief, PartHypothesis, PoseBelief},
    outcome::{Identity, Outcome, Reason, ToolError},
};
use crate::grounder::{Grounder, Refusal, Single};
use acm_concept::{camera::RgbdFrame, expectation::Expectation, object::PixelSupport, template::TemplateLibrary};

/// Geometry without learned weights. It knows no clock: the same request always has the same answer, and the one who
/// asks tells whether it came in time. Of a part it sees that one mask alone, so earlier beliefs change nothing: the
/// answer is a measurement of its own.
#[derive(Debug, Clone)]
pub struct Geometric {
    grounder: Grounder,
}

/// Odds smaller than this are not told apart.
const LEAST_PROBABILITY: f64 = 1e-30;

impl Geometric {
    /// The steps of a grounder.
    pub fn new(grounder: Grounder) -> Geometric {
        Geometric { grounder }
    }

    fn single<T>(
        &self,
        frame: &RgbdFrame,
        mask: &PixelSupport,
        library: &TemplateLibrary,
        take: impl FnOnce(Single) -> T,
    ) -> Outcome<T> {
        match self.grounder.single(frame, mask, library) {
            Ok(single) => Outcome::Ok(take(single)),
            Err(Refusal::Blind(blindness)) => Outcome::Abstain(Reason::Blind(blindness)),
            Err(Refusal::NothingFits) => Outcome::Abstain(Reason::NothingFound),
            Err(Refusal::Mask(reason)) => Outcome::Failed(ToolError::bad_request("mask", reason)),
        }
    }
}

impl Tool for Geometric {
    fn identity(&self) -> Identity {
        Identity { tool: "geometric".into(), version: env!("CARGO_PKG_VERSION").into(), model_digest: None }
    }
}

impl Detector for Geometric {
    fn detect(&self, request: &Request, nouns: &[String]) -> Outcome<Vec<Detection>> {
        let expectation = Expectation { nouns: nouns.to_vec(), ..Expectation::default() };
        let percepts = self.grounder.ground(request.frame, &expectation);
        if let Some(blindness) = percepts.blindness {
            return Outcome::Abstain(Reason::Blind(blindness));
        }
        let detection = |object: acm_concept::object::GroundedObject| Detection {
            bounds: object.support.bounds,
            labels: object.categories.into_iter().map(|(noun, p)| (noun, p * object.confidence)).collect(),
        };
        Outcome::Ok(percepts.objects.into_iter().map(detection).collect())
    }
}

impl Segmenter for Geometric {
    fn segment(&self, request: &Request, prompts: &Prompts) -> Outcome<Vec<Mask>> {
        match self.grounder.masks(request.frame, prompts.nouns) {
            Ok(masks) => Outcome::Ok(masks),
            Err(blindness) => Outcome::Abstain(Reason::Blind(blindness)),
        }
    }
}

impl PartRecogniser for Geometric {
    fn recognise(
        &self,
        request: &Request,
        mask: &PixelSupport,
        library: &TemplateLibrary,
    ) -> Outcome<Vec<PartHypothesis>> {
        let hypothesis = |(template, probability): (String, f64)| PartHypothesis {
            template,
            log_likelihood: probability.max(LEAST_PROBABILITY).ln(),
        };
        self.single(request.frame, mask, library, |single| single.odds.into_iter().map(hypothesis).collect())
    }
}

impl PoseEstimator for Geometric {
    fn pose(&self, request: &Request, part: &PartView, _prior: Option<&PoseBelief>) -> Outcome<PoseBelief> {
        let library = TemplateLibrary::of_one(part.template.clone());
        self.single(request.frame, part.mask, &library, |single| single.pose)
    }
}

impl ParamEstimator for Geometric {
    fn params(&self, request: &Request, part: &PartView, _prior: Option<&ParamBelief>) -> Outcome<ParamBelief> {
        let library = TemplateLibrary::of_one(part.template.clone());
        self.single(request.frame, part.mask, &library, |single| single.params)
    }
}
