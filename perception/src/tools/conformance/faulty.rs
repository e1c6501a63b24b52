//! Tools that are broken on purpose, in this process.

use crate::tools::{
    Detection, Detector, Geometric, Identity, Mask, Outcome, ParamBelief, ParamEstimator, PartHypothesis,
    PartRecogniser, PartView, PoseBelief, PoseEstimator, Prompts, Request, Segmenter, Stopwatch, Tool, ToolError,
    Tools,
};
use acm_concept::{object::PixelSupport, template::TemplateLibrary};
use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

/// A way to be broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The answer is sound and comes after the deadline.
    Late,
    /// There is nothing in it.
    Empty,
    /// It is of an image, or a template, of another size.
    WrongSize,
    /// It is of another kind than was asked for.
    Garbage,
    /// It ends too early.
    Truncated,
    /// A number in it is not finite.
    NotANumber,
    /// Two masks share pixels; two entries that exclude each other.
    Overlapping,
    /// It leaves the image, or the range of what there is.
    Outside,
    /// There is nobody to ask.
    Refused,
}

impl Fault {
    /// Every fault.
    pub const ALL: [Fault; 9] = [
        Fault::Late,
        Fault::Empty,
        Fault::WrongSize,
        Fault::Garbage,
        Fault::Truncated,
        Fault::NotANumber,
        Fault::Overlapping,
        Fault::Outside,
        Fault::Refused,
    ];
    /// Its name, as the faulty servers of the tests take it.
    pub fn name(self) -> &'static str {
        match self {
            Fault::Late => "late",
            Fault::Empty => "empty",
            Fault::WrongSize => "wrong-size",
            Fault::Garbage => "garbage",
            Fault::Truncated => "truncated",
            Fault::NotANumber => "nan",
            Fault::Overlapping => "overlapping",
            Fault::Outside => "outside",
            Fault::Refused => "refused",
        }
    }
}

/// A stopwatch that is moved by hand.
#[derive(Debug, Clone, Default)]
pub struct HandStopwatch(Arc<AtomicU64>);

impl HandStopwatch {
    /// Lets time pass.
    pub fn pass(&self, time: Duration) {
        self.0.fetch_add(time.as_millis() as u64, Ordering::SeqCst);
    }
}

impl Stopwatch for HandStopwatch {
    fn elapsed(&self) -> Duration {
        Duration::from_millis(self.0.load(Ordering::SeqCst))
    }
}

/// Geometry whose answers are spoilt in one way.
pub struct Faulty {
    inner: Geometric,
    fault: Fault,
    stopwatch: HandStopwatch,
}

impl Faulty {
    /// A bundle of tools that are all broken in the same way.
    pub fn tools(inner: Geometric, fault: Fault) -> Tools {
        let stopwatch = HandStopwatch::default();
        let faulty = Arc::new(Faulty { inner, fault, stopwatch: stopwatch.clone() });
        Tools {
            detector: Some(faulty.clone()),
            segmenter: Some(faulty.clone()),
            part_recogniser: Some(faulty.clone()),
            pose_estimator: Some(faulty.clone()),
            param_estimator: Some(faulty),
            stopwatch: Arc::new(stopwatch),
            ..Tools::default()
        }
    }

    /// The faults that are alike for all answers; the others change the answer itself.
    fn spoil<T>(&self, request: &Request, sound: Outcome<T>, change: impl FnOnce(&mut T)) -> Outcome<T> {
        match self.fault {
            Fault::Late => {
                self.stopwatch.pass(request.limit + Duration::from_millis(1));
                sound
            }
            Fault::Refused => Outcome::Failed(ToolError::Unreachable { reason: "refused on purpose".into() }),
            _ => sound.map(|mut value| {
                change(&mut value);
                value
            }),
        }
    }
}

impl Tool for Faulty {
    fn identity(&self) -> Identity {
        Identity { tool: format!("faulty ({})", self.fault.name()), ..self.inner.identity() }
    }
}

impl Detector for Faulty {
    fn detect(&self, request: &Request, nouns: &[String]) -> Outcome<Vec<Detection>> {
        let size = request.frame.header.intrinsics;
        self.spoil(request, self.inner.detect(request, nouns), |found| match self.fault {
            Fault::Empty => found.clear(),
            Fault::NotANumber => found.iter_mut().for_each(|d| d.labels = vec![("thing".into(), f64::NAN)]),
            Fault::Overlapping => found.iter_mut().for_each(|d| d.labels = vec![("a".into(), 0.9), ("b".into(), 0.9)]),
            Fault::Truncated => found.iter_mut().for_each(|d| d.bounds = [9, 9, 3, 3]),
            _ => found.iter_mut().for_each(|d| d.bounds = [0, 0, size.width, size.height]),
        })
    }
}

impl Segmenter for Faulty {
    fn segment(&self, request: &Request, prompts: &Prompts) -> Outcome<Vec<Mask>> {
        let pixels = request.frame.header.intrinsics.pixels() as u32;
        self.spoil(request, self.inner.segment(request, prompts), |masks| match self.fault {
            Fault::Empty => masks.clear(),
            Fault::NotANumber => masks.iter_mut().for_each(|mask| mask.score = f64::NAN),
            Fault::Overlapping => masks.extend_from_within(..),
            Fault::Garbage => masks.iter_mut().for_each(|mask| mask.support.runs = vec![3, 0, 0, u32::MAX]),
            Fault::Truncated => masks.iter_mut().for_each(|mask| mask.support.runs.truncate(2)),
            Fault::WrongSize => masks.iter_mut().for_each(|mask| mask.support.runs = vec![10, 10, 4 * pixels]),
            _ => masks.iter_mut().for_each(|mask| mask.support.runs = vec![pixels, 5]),
        })
    }
}

impl PartRecogniser for Faulty {
    fn recognise(
        &self,
        request: &Request,
        mask: &PixelSupport,
        library: &TemplateLibrary,
    ) -> Outcome<Vec<PartHypothesis>> {
        self.spoil(request, self.inner.recognise(request, mask, library), |found| match self.fault {
            Fault::Empty => found.clear(),
            Fault::NotANumber => found.iter_mut().for_each(|h| h.log_likelihood = f64::NAN),
            Fault::Outside => found.iter_mut().for_each(|h| h.log_likelihood = f64::INFINITY),
            Fault::Overlapping => found.extend_from_within(..),
            Fault::Truncated => found.iter_mut().for_each(|h| h.template.truncate(1)),
            _ => found.iter_mut().for_each(|h| h.template = "no-such-template".into()),
        })
    }
}

impl PoseEstimator for Faulty {
    fn pose(&self, request: &Request, part: &PartView, prior: Option<&PoseBelief>) -> Outcome<PoseBelief> {
        self.spoil(request, self.inner.pose(request, part, prior), |belief| match self.fault {
            Fault::NotANumber => belief.pose.translation.x = f64::NAN,
            Fault::Outside => belief.pose.translation.x = 1e6,
            Fault::Truncated => belief.pose.rotation.w *= 0.5,
            Fault::Overlapping => belief.covariance[0][1] = 1.0,
            Fault::WrongSize => belief.covariance[5][5] = -1.0,
            _ => belief.pose.rotation *= 0.0,
        })
    }
}

impl ParamEstimator for Faulty {
    fn params(&self, request: &Request, part: &PartView, prior: Option<&ParamBelief>) -> Outcome<ParamBelief> {
        self.spoil(request, self.inner.params(request, part, prior), |belief| match self.fault {
            Fault::NotANumber => belief.mean.iter_mut().for_each(|value| *value = f64::NAN),
            Fault::Outside => belief.mean.iter_mut().for_each(|value| *value = 1e6),
            Fault::Truncated => belief.covariance.truncate(1),
            Fault::WrongSize => belief.mean.push(0.1),
            Fault::Overlapping => belief.covariance[0][1] += 1.0,
            Fault::Empty => belief.mean.clear(),
            _ => belief.observability.clear(),
        })
    }
}
