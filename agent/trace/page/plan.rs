//! What the page tells of each step: the decision, the plan, what was considered, what came of it, and why.

use crate::trace::{
    decision::{self, StepSpan},
    run_file::RunFile,
    why::{Inquiry, Why},
};
use acm_concept::literal::{Belief, Literal};
use acm_planner::{Decision, Explanation};
use serde::Serialize;

/// A step.
#[derive(Debug, Serialize)]
pub struct Step {
    seq: u64,
    last: u64,
    t: f64,
    title: String,
    /// What went wrong, if anything did.
    failure: Option<String>,
    /// What the verifier found, in a word; none where the trace ends before.
    outcome: Option<&'static str>,
    goal: String,
    subtask: String,
    plan: Vec<String>,
    notes: Vec<String>,
    inspected: u32,
    conditions: Vec<Condition>,
    rejected: Vec<[String; 2]>,
    /// Each predicted effect with its probability, what the verifier found of it and why.
    predicted: Vec<Effect>,
    success: f64,
    tries: u32,
    successes: u32,
    why: Why,
}

/// A literal with what is believed of it.
#[derive(Debug, Serialize)]
struct Condition {
    /// `goal` or `precondition`.
    role: &'static str,
    literal: String,
    truth: acm_concept::literal::Truth,
    confidence: f64,
    reason: String,
}

#[derive(Debug, Serialize)]
struct Effect {
    literal: String,
    probability: f64,
    outcome: Option<&'static str>,
    observed: Option<String>,
}

/// The steps of a run.
///
/// # Errors
/// A decision has a form that cannot be read.
pub fn steps(run: &RunFile, inquiry: &Inquiry<'_>) -> anyhow::Result<Vec<Step>> {
    let decided = inquiry.steps().iter().filter_map(|span| Some((span, span.decision(run)?)));
    let mut steps = Vec::new();
    for (span, entry) in decided {
        let Decision::Act { step, explanation } = decision::read(entry)? else { continue };
        let seq = entry.header.seq;
        steps.push(told(span, run, (&step, &explanation), (seq, entry.seconds()), inquiry.why(seq)?));
    }
    Ok(steps)
}

fn told(
    span: &StepSpan,
    run: &RunFile,
    (step, explanation): (&acm_planner::Step, &Explanation),
    (seq, t): (u64, f64),
    why: Why,
) -> Step {
    let prediction = &step.prediction;
    let verdict = span.verdict(run);
    let effect = |(literal, probability): &(Literal, f64)| {
        let found = verdict.iter().flat_map(|verdict| &verdict.literals).find(|found| found.literal == *literal);
        Effect {
            literal: literal.to_string(),
            probability: *probability,
            outcome: found.map(|found| decision::outcome_word(found.outcome)),
            observed: found.map(|found| found.observed.reason.clone()),
        }
    };
    let condition = |role: &'static str| {
        move |(literal, belief): &(Literal, Belief)| Condition {
            role,
            literal: literal.to_string(),
            truth: belief.truth,
            confidence: belief.confidence,
            reason: belief.reason.clone(),
        }
    };
    let goals = explanation.literals.iter().map(condition("goal"));
    Step {
        seq,
        last: span.last_seq(run),
        t,
        title: step.to_string(),
        failure: span.failure(run),
        outcome: verdict.as_ref().map(|verdict| decision::outcome_word(verdict.outcome)),
        goal: explanation.goal.clone(),
        subtask: explanation.subtask.clone(),
        plan: explanation.plan.clone(),
        notes: explanation.notes.clone(),
        inspected: explanation.candidates_inspected,
        conditions: goals.chain(explanation.applicability.conditions.iter().map(condition("precondition"))).collect(),
        rejected: explanation.rejected.iter().map(|r| [r.candidate.clone(), r.reason.clone()]).collect(),
        predicted: prediction.effects.iter().map(effect).collect(),
        success: prediction.success,
        tries: prediction.tries,
        successes: prediction.successes,
        why,
    }
}
