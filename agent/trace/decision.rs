//! One step of a run: what was considered, decided, predicted, done and found.

use super::run_file::{Delta, Entry, RunFile};
use acm_concept::{
    literal::{Belief, Evidence, Literal, Truth},
    skill::SkillReport,
};
use acm_memory::{
    observation::{Outcome, Verdict},
    query::Recall,
};
use acm_planner::{Decision, Explanation, ResolvedReference, Step};
use anyhow::bail;
use serde::de::DeserializeOwned;
use std::io::{self, Write};

/// Most hits of a retrieval that are printed.
const MAX_HITS: usize = 6;
/// Most changes of memory that are printed.
const MAX_DELTAS: usize = 24;

/// The messages of a step, as places in [`RunFile::entries`]: from the decision up to the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepSpan {
    first: usize,
    end: usize,
}

/// The steps of a run: each decision to act begins one.
pub fn steps(run: &RunFile) -> Vec<StepSpan> {
    let acts = |entry: &Entry| {
        entry.header.kind == "decided" && entry.raw().windows(16).any(|bytes| bytes == br#""decision":{"act"#)
    };
    let firsts: Vec<usize> = (0..).zip(&run.entries).filter(|(_, entry)| acts(entry)).map(|(at, _)| at).collect();
    let ends = firsts.iter().skip(1).copied().chain([run.entries.len()]);
    firsts.iter().zip(ends).map(|(&first, end)| StepSpan { first, end }).collect()
}

impl StepSpan {
    /// The message with the decision.
    pub fn decision<'a>(&self, run: &'a RunFile) -> Option<&'a Entry> {
        run.entries.get(self.first)
    }

    /// The last message before the next decision to act.
    pub fn last_seq(&self, run: &RunFile) -> u64 {
        self.entries(run).last().map_or(0, |entry| entry.header.seq)
    }

    /// What the verifier found in the end.
    pub fn verdict(&self, run: &RunFile) -> Option<Verdict> {
        self.last(run, "verdict", Some("verdict"))
    }

    /// The executor's report.
    pub fn report(&self, run: &RunFile) -> Option<SkillReport> {
        self.last(run, "skill-ended", None)
    }

    fn entries<'a>(&self, run: &'a RunFile) -> &'a [Entry] {
        run.entries.get(self.first..self.end).unwrap_or_default()
    }

    /// The body of the last message of a kind in this step, where it has the form expected.
    fn last<T: DeserializeOwned>(&self, run: &RunFile, kind: &str, field: Option<&str>) -> Option<T> {
        let entry = self.entries(run).iter().rev().find(|entry| entry.header.kind == kind)?;
        let mut body = entry.record().ok()?.body;
        let body = match field {
            Some(field) => body.get_mut(field)?.take(),
            None => body,
        };
        serde_json::from_value(body).ok()
    }

    /// Why the step failed, if it did: what the controller said, else what the verifier found.
    pub fn failure(&self, run: &RunFile) -> Option<String> {
        if let Some((cause, reason)) = self.report(run).and_then(|report| report.failure) {
            return Some(format!("{}: {reason}", cause.word()));
        }
        let verdict = self.verdict(run)?;
        (verdict.outcome == Outcome::Contradicted).then_some(verdict.reason)
    }
}

/// The decision in a message of the kind `decided`.
///
/// # Errors
/// The message has another form.
pub fn read(entry: &Entry) -> anyhow::Result<Decision> {
    let decision = entry.record()?.body.get_mut("decision").map(serde_json::Value::take).unwrap_or_default();
    serde_json::from_value(decision)
        .map_err(|e| anyhow::anyhow!("the decision of message {} cannot be read: {e}", entry.header.seq))
}

/// Prints the decision behind the nth step (from 1).
pub fn show(run: &RunFile, number: usize, out: &mut impl Write) -> anyhow::Result<()> {
    let steps = steps(run);
    let Some(span) = number.checked_sub(1).and_then(|index| steps.get(index)) else {
        bail!("there is no step {number}: the run has {} steps, numbered from 1", steps.len());
    };
    let entries = span.entries(run);
    let Some(first) = entries.first() else { bail!("step {number} is empty") };
    let Decision::Act { step, explanation } = read(first)? else { bail!("step {number} is no decision to act") };
    writeln!(
        out,
        "step {number} of {}: {step}   t {:.2} s, message {}",
        steps.len(),
        first.seconds(),
        first.header.seq
    )?;
    why(&step, &explanation, out)?;
    outcome(span, run, out)?;
    let (from, to) = (first.header.seq, entries.last().map_or(first.header.seq, |last| last.header.seq));
    let deltas: Vec<&Delta> = run.deltas.iter().filter(|d| (from..=to).contains(&d.seq)).collect();
    memory(&deltas, out)?;
    Ok(())
}

fn why(step: &Step, explanation: &Explanation, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{:<14}{}", "goal", explanation.goal)?;
    writeln!(out, "{:<14}\"{}\"", "asked for by", explanation.subtask)?;
    for reference in &explanation.references {
        reference_lines(reference, out)?;
    }
    section(out, "goal state", explanation.literals.iter().map(belief_words))?;
    section(out, "preconditions", explanation.applicability.conditions.iter().map(belief_words))?;
    writeln!(out, "{:<14}{} candidates inspected", "considered", explanation.candidates_inspected)?;
    section(
        out,
        "rejected",
        explanation.rejected.iter().map(|rejected| {
            // The reason mostly says already which precondition it is.
            let failed =
                rejected.failed.as_ref().filter(|(literal, _)| !rejected.reason.contains(&literal.to_string()));
            let failed = failed.map_or_else(String::new, |failed| format!("; {}", belief_words(failed)));
            format!("{}: {}{failed}", rejected.candidate, rejected.reason)
        }),
    )?;
    section(out, "plan", explanation.plan.iter().cloned())?;
    section(out, "notes", explanation.notes.iter().cloned())?;
    let prediction = &step.prediction;
    section(
        out,
        "predicted",
        prediction.effects.iter().map(|(literal, probability)| format!("{literal}  {probability:.2}")),
    )?;
    writeln!(
        out,
        "{:<14}{:.2} ({} of {} tries of this skill on this template)",
        "success", prediction.success, prediction.successes, prediction.tries
    )
}

fn reference_lines(reference: &ResolvedReference, out: &mut impl Write) -> io::Result<()> {
    let guessed = if reference.guessed { " (DRAWN)" } else { "" };
    writeln!(out, "{:<14}\"{}\" is {}{guessed}", "reference", reference.phrase, reference.how)?;
    if let Some(retrieval) = &reference.retrieval {
        let hits = retrieval.hits.iter().take(MAX_HITS).map(|hit| {
            let terms: Vec<String> = hit.terms.iter().map(|(name, value)| format!("{name} {value:.2}")).collect();
            format!("{} {:.3} ({})", hit.object, hit.score, terms.join(", "))
        });
        section(out, "  retrieved", hits)?;
        let dropped = retrieval.dropped.iter().map(|(object, filter)| format!("{object} by {filter}"));
        let dropped: Vec<String> = dropped.collect();
        if !dropped.is_empty() {
            writeln!(out, "{:<14}{}", "  dropped", dropped.join(", "))?;
        }
    }
    match &reference.recall {
        Some(Recall::Known { confidence, evidence, .. }) => {
            let evidence: Vec<String> = evidence.iter().map(evidence_words).collect();
            writeln!(out, "{:<14}known, {confidence:.2}, by {}", "  recalled", evidence.join(" and "))
        }
        Some(Recall::Unknown { reason, candidates }) => {
            writeln!(out, "{:<14}unknown: {reason}; {} candidates", "  recalled", candidates.len())
        }
        None => Ok(()),
    }
}

fn outcome(span: &StepSpan, run: &RunFile, out: &mut impl Write) -> io::Result<()> {
    match span.report(run) {
        Some(report) => {
            let primitives: Vec<String> = report.primitives.iter().map(|p| p.primitive.to_string()).collect();
            let ended = match &report.failure {
                None => "ended as it should".into(),
                Some((cause, reason)) => format!("FAILED ({}): {reason}", cause.word()),
            };
            let took_s = report.ended.seconds_since(report.started);
            writeln!(out, "{:<14}{} in {took_s:.1} s; {ended}", "ran", primitives.join(", "))?;
            let measured = report.measured.iter().map(|(name, value)| format!("{name} {value:.4}"));
            section(out, "measured", measured)?;
        }
        None => writeln!(out, "{:<14}the trace does not have the end of this skill", "ran")?,
    }
    let Some(verdict) = span.verdict(run) else {
        return writeln!(out, "{:<14}none in the trace", "verdict");
    };
    writeln!(out, "{:<14}{}: {}", "verdict", outcome_word(verdict.outcome), verdict.reason)?;
    section(
        out,
        "",
        verdict
            .literals
            .iter()
            .map(|l| format!("{}  {}: {}", l.literal, outcome_word(l.outcome).to_lowercase(), l.observed.reason)),
    )
}

fn memory(deltas: &[&Delta], out: &mut impl Write) -> io::Result<()> {
    let changed: Vec<String> = deltas.iter().filter_map(|delta| delta_words(delta)).collect();
    let left_out = changed.len().saturating_sub(MAX_DELTAS);
    section(out, "memory", changed.into_iter().take(MAX_DELTAS))?;
    match left_out {
        0 => Ok(()),
        more => writeln!(out, "{:<14}and {more} further changes", ""),
    }
}

/// A change in a line; none where what a person would see stays the same.
pub fn delta_words(delta: &Delta) -> Option<String> {
    let object = delta.object.as_deref().unwrap_or("");
    if delta.change != "object" {
        return match delta.change.as_str() {
            "frame" | "support" => None,
            change => Some(format!("{change} {object} {}", shortened(&delta.after))),
        };
    }
    if delta.before.is_null() {
        return Some(format!("new {object} {}", shortened(&delta.after)));
    }
    let fields = delta.after.as_object()?.iter().filter_map(|(name, after)| {
        let before = delta.before.get(name)?;
        let same = before == after || matches!(name.as_str(), "views" | "confidence" | "yaw_deg");
        let near = match (before.as_array(), after.as_array()) {
            (Some(before), Some(after)) if name == "at" => {
                let distance = |(a, b): (&serde_json::Value, &serde_json::Value)| {
                    (a.as_f64().unwrap_or(0.0) - b.as_f64().unwrap_or(0.0)).abs()
                };
                // Below this it is the camera's noise.
                before.iter().zip(after).all(|pair| distance(pair) < 0.005)
            }
            _ => false,
        };
        (!same && !near).then(|| format!("{name} {} -> {}", shortened(before), shortened(after)))
    });
    let fields: Vec<String> = fields.collect();
    (!fields.is_empty()).then(|| format!("{object} {}", fields.join(", ")))
}

/// A value with its numbers rounded to what a person reads.
pub fn shortened(value: &serde_json::Value) -> String {
    use serde_json::Value;
    match value {
        Value::Number(number) if number.is_f64() => format!("{:.3}", number.as_f64().unwrap_or(0.0) + 0.0),
        Value::Array(items) => format!("({})", items.iter().map(shortened).collect::<Vec<_>>().join(", ")),
        Value::Object(fields) => {
            let told = fields.iter().filter(|(_, value)| !value.is_null());
            told.map(|(name, value)| format!("{name} {}", shortened(value))).collect::<Vec<_>>().join(", ")
        }
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

fn section(out: &mut impl Write, title: &str, lines: impl Iterator<Item = String>) -> io::Result<()> {
    for (index, line) in lines.enumerate() {
        writeln!(out, "{:<14}{line}", if index == 0 { title } else { "" })?;
    }
    Ok(())
}

/// A literal with what is believed of it.
pub fn belief_words((literal, belief): &(Literal, Belief)) -> String {
    let truth = match belief.truth {
        Truth::Yes => "holds",
        Truth::No => "DOES NOT HOLD",
        Truth::Unknown => "UNKNOWN",
    };
    format!("{literal}  {truth} {:.2}: {}", belief.confidence, belief.reason)
}

/// What a belief rests on, in words.
pub fn evidence_words(evidence: &Evidence) -> String {
    match evidence {
        Evidence::Frame(frame) => format!("frame {frame}"),
        Evidence::Transition(transition) => format!("own move {transition}"),
        Evidence::Inferred(how) => how.clone(),
    }
}

/// The word for what a verifier found.
pub fn outcome_word(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Verified => "VERIFIED",
        Outcome::Contradicted => "CONTRADICTED",
        Outcome::CannotTell => "CANNOT TELL",
    }
}
