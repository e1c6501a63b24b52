//! What every implementation of the tool traits must pass, in whatever process it works: sound answers about a plain
//! scene, typed outcomes for requests that cannot be answered, and no harm done by faulty answers.
//!
//! It is plain code so that other crates' tests can use it; each check returns what it found wrong.

mod faulty;
mod trial;

pub use faulty::{Fault, Faulty, HandStopwatch};
pub use trial::{Thing, Trial};

use super::{Geometric, Outcome, PartView, Prompts, Reason, Request, ToolError, Tools};
use crate::{Grounder, GrounderConfig};
use acm_concept::{camera::RgbdFrame, expectation::Expectation, object::PixelSupport};
use std::sync::Arc;

/// What a tool did that it must not do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{tool}, {asked}: {what}")]
pub struct Breach {
    /// The tool.
    pub tool: String,
    /// What it was asked for.
    pub asked: &'static str,
    /// What it did.
    pub what: String,
}

/// One call of a check and its outcome, without its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// What was asked for.
    pub asked: &'static str,
    /// The tool.
    pub tool: String,
    /// The outcome.
    pub outcome: Outcome<()>,
}

/// Least overlap (intersection over union) of a mask with the thing that it is of.
const OVERLAP: f64 = 0.5;
/// Farthest that a pose may be from the truth, metres: three times the suite's smallest thing would still pass as its
/// neighbour, so this is half of the smallest.
const NEAR_M: f64 = 0.025;

/// The geometric default behind every trait.
pub fn geometric(trial: &Trial) -> Tools {
    let geometric = Arc::new(Geometric::new(grounder(trial)));
    Tools {
        detector: Some(geometric.clone()),
        segmenter: Some(geometric.clone()),
        part_recogniser: Some(geometric.clone()),
        pose_estimator: Some(geometric.clone()),
        param_estimator: Some(geometric),
        ..Tools::default()
    }
}

/// A grounder that knows the trial's templates.
pub fn grounder(trial: &Trial) -> Grounder {
    Grounder::new(Arc::clone(&trial.library), GrounderConfig::default())
}

/// Asks every tool of a bundle about the trial. Abstaining is sound; what is answered must be right: every thing covered
/// by a mask and a box, its own template ranked first, its pose near the truth. Returns what each tool said.
///
/// # Errors
/// A failure, or an answer that is wrong.
pub fn answers(tools: &Tools, trial: &Trial) -> Result<Vec<Told>, Breach> {
    ask_all(tools, trial, &trial.frame, None, &mut |told, right| match (&told.outcome, right) {
        (Outcome::Failed(error), _) => Err(format!("failed: {error}")),
        (_, Err(wrong)) => Err(wrong),
        _ => Ok(()),
    })
}

/// Asks what cannot be answered. About masks that are none of the frame no tool says anything; in frames that show
/// nothing a tool may see what it likes, and perception with it still sees nothing.
///
/// # Errors
/// A tool that answers all the same, or something in the percepts of a frame that shows nothing.
pub fn unfit_requests(tools: &Tools, trial: &Trial) -> Result<Vec<Told>, Breach> {
    let mut all = Vec::new();
    for mask in trial.unfit_masks() {
        let mut judge = |told: &Told, _: Result<(), String>| match told.asked {
            "detect" | "segment" => Ok(()),
            _ => no_value(told),
        };
        all.extend(ask_all(tools, trial, &trial.frame, Some(&mask), &mut judge)?);
    }
    for frame in trial.blind_frames() {
        all.extend(ask_all(tools, trial, &frame, None, &mut |_, _| Ok(()))?);
        let percepts = grounder(trial).with_tools(tools.clone()).ground(&frame, &Expectation::default()).percepts;
        if percepts.blindness.is_none() || !percepts.objects.is_empty() {
            let what = format!("{} objects in a frame that shows nothing", percepts.objects.len());
            return Err(Breach { tool: format!("{tools:?}"), asked: "ground", what });
        }
    }
    Ok(all)
}

fn no_value(told: &Told) -> Result<(), String> {
    match told.outcome {
        Outcome::Abstain(_) | Outcome::Failed(_) => Ok(()),
        _ => Err("answered what cannot be answered".into()),
    }
}

/// Asks tools that are broken in one way: each outcome has the type that the fault calls for, and perception with them
/// says exactly what geometry says alone, and that it had no help.
///
/// # Errors
/// Another outcome, other percepts, or silence about the tool.
pub fn withstands(tools: &Tools, trial: &Trial, fault: Fault) -> Result<Vec<Told>, Breach> {
    let told = ask_all(tools, trial, &trial.frame, None, &mut |told, _| {
        if fault.calls_for(&told.outcome) {
            return Ok(());
        }
        Err(format!("under the fault {fault:?} it said {:?}", told.outcome))
    })?;
    let expectation = Expectation::default();
    let alone = grounder(trial).ground(&trial.frame, &expectation);
    let assisted = grounder(trial).with_tools(tools.clone()).ground(&trial.frame, &expectation);
    let breach = |what: String| Breach { tool: format!("{tools:?}"), asked: "ground", what };
    if assisted.percepts != alone {
        return Err(breach(format!("the fault {fault:?} reached the percepts")));
    }
    let silent = assisted.calls.is_empty() || assisted.calls.iter().any(|call| call.remark.is_none());
    if silent {
        return Err(breach(format!("nothing is said of the fault {fault:?}: {:?}", assisted.calls)));
    }
    Ok(told)
}

/// What a check makes of one outcome, and of whether its value is right.
type Judge<'a> = dyn FnMut(&Told, Result<(), String>) -> Result<(), String> + 'a;

/// Asks every tool there is: of each thing of the trial, or of `mask` in the place of the things' own masks.
fn ask_all(
    tools: &Tools,
    trial: &Trial,
    frame: &RgbdFrame,
    mask: Option<&PixelSupport>,
    judge: &mut Judge,
) -> Result<Vec<Told>, Breach> {
    let (mut all, mut id) = (Vec::new(), 0);
    let mut request = || {
        id += 1;
        Request { id, frame, limit: tools.limit }
    };
    let mut take = |asked: &'static str, tool: String, outcome: Outcome<()>, right: Result<(), String>| {
        let told = Told { asked, tool, outcome };
        judge(&told, right).map_err(|what| Breach { tool: told.tool.clone(), asked, what })?;
        all.push(told);
        Ok(())
    };
    /// The judgement of a value, where there is one.
    fn right<T>(outcome: &Outcome<T>, check: impl FnOnce(&T) -> Result<(), String>) -> Result<(), String> {
        outcome.value().map_or(Ok(()), check)
    }
    if let Some(answer) = tools.detect(&request(), &[]) {
        let found = right(&answer.outcome, |found| {
            let boxes: Vec<[u32; 4]> = found.iter().map(|detection| detection.bounds).collect();
            trial.boxed(&boxes)
        });
        take("detect", answer.meta.identity.tool, answer.outcome.map(|_| ()), found)?;
    }
    if let Some(answer) = tools.segment(&request(), &Prompts::default()) {
        let found = right(&answer.outcome, |masks| trial.covered(masks, OVERLAP));
        take("segment", answer.meta.identity.tool, answer.outcome.map(|_| ()), found)?;
    }
    for thing in &trial.things {
        let template = trial.template(thing);
        let mask = mask.unwrap_or(&thing.mask);
        if let Some(answer) = tools.recognise(&request(), mask, &trial.library) {
            let found = right(&answer.outcome, |ranked| {
                let best = ranked.iter().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
                match best.filter(|best| best.template == thing.template) {
                    Some(_) => Ok(()),
                    None => Err(format!("takes a {} for {best:?}", thing.template)),
                }
            });
            take("recognise", answer.meta.identity.tool, answer.outcome.map(|_| ()), found)?;
        }
        let part = PartView { mask, template, values: &thing.values };
        if let Some(answer) = tools.pose(&request(), &part, None) {
            let found = right(&answer.outcome, |belief| {
                let off = belief.pose.translation.distance(thing.pose.translation);
                if off < NEAR_M { Ok(()) } else { Err(format!("places the {} {off:.3} m off", thing.template)) }
            });
            take("pose", answer.meta.identity.tool, answer.outcome.map(|_| ()), found)?;
        }
        if let Some(answer) = tools.params(&request(), &part, None) {
            let found = right(&answer.outcome, |belief| {
                let off = thing.values.iter().zip(&belief.mean).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                if off < NEAR_M { Ok(()) } else { Err(format!("measures the {} {off:.3} m off", thing.template)) }
            });
            take("params", answer.meta.identity.tool, answer.outcome.map(|_| ()), found)?;
        }
    }
    Ok(all)
}

impl Fault {
    /// Whether an outcome is the one that this fault must end in.
    fn calls_for(self, outcome: &Outcome<()>) -> bool {
        match self {
            Fault::Late => matches!(outcome, Outcome::Failed(ToolError::TimedOut { .. })),
            Fault::Refused => matches!(outcome, Outcome::Failed(ToolError::Unreachable { .. })),
            Fault::Empty => {
                matches!(outcome, Outcome::Abstain(Reason::NothingFound) | Outcome::Failed(ToolError::Invalid { .. }))
            }
            _ => matches!(outcome, Outcome::Failed(ToolError::Invalid { .. })),
        }
    }
}

#[cfg(test)]
mod tests;
