//! Tells what the asked agent decides, does and verifies.

use crate::words;
use acm_actors::message::Message;
use acm_concept::{embodiment::Feedback, ids::ObjectId, literal::Truth, skill::SkillReport};
use acm_memory::{
    MemoryView,
    observation::{Outcome, Verdict},
    query::{PlaceReference, Recall},
};
use acm_planner::{Decision, Explanation, Step};
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use std::{
    io::Write,
    sync::{Mutex, PoisonError},
};

/// Listens to the agent that is asked.
pub struct Deed {
    told: Mutex<Told>,
}

struct Told {
    sink: Box<dyn Write + Send>,
    view: Option<acm_actors::message::View>,
    decided: bool,
    acted: bool,
    /// Strongest force on a finger pad in the skill that runs, newtons.
    grip_n: f64,
    ended: Option<SkillReport>,
    /// Command with which the decision can be looked into.
    why: String,
}

impl Deed {
    /// Tells into `sink`; `why` is the command with which the decision can be looked into.
    pub fn new(sink: Box<dyn Write + Send>, why: String) -> Deed {
        let told = Told { sink, view: None, decided: false, acted: false, grip_n: 0.0, ended: None, why };
        Deed { told: Mutex::new(told) }
    }
}

impl Journal<Message> for Deed {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        for line in told.lines(&message.body) {
            writeln!(told.sink, "{line}").map_err(|e| JournalError(e.to_string()))?;
        }
        told.sink.flush().map_err(|e| JournalError(e.to_string()))
    }
}

impl Told {
    fn lines(&mut self, message: &Message) -> Vec<String> {
        match message {
            Message::Parse { instruction } => vec![super::headed("3 ASK", &format!("\"{instruction}\""))],
            Message::Decide { view, .. } => {
                self.view = Some(view.clone());
                Vec::new()
            }
            Message::Decided { decision, .. } => self.decision(decision),
            Message::Execute(_) => {
                self.grip_n = 0.0;
                Vec::new()
            }
            Message::Moved(feedback) => {
                self.grip_n = self.grip_n.max(pad_force_n(feedback));
                Vec::new()
            }
            Message::SkillEnded(report) => {
                self.ended = Some((**report).clone());
                Vec::new()
            }
            Message::Settle { verdict, .. } => self.settled(verdict).into_iter().collect(),
            Message::ActorFailed { role, reason, .. } => vec![super::below(&format!("actor {role} failed: {reason}"))],
            _ => Vec::new(),
        }
    }

    fn decision(&mut self, decision: &Decision) -> Vec<String> {
        match decision {
            Decision::Act { step, explanation } if !self.decided => {
                self.decided = true;
                let view = self.view.as_ref().map(|view| &*view.0);
                let mut lines: Vec<String> = reasons(explanation, view).iter().map(|line| super::below(line)).collect();
                lines.push(super::below(&plan(step, explanation)));
                lines.push(super::below(&format!("why?    {}", self.why)));
                lines
            }
            Decision::GiveUp { unknown } => vec![super::below(&format!("GIVES UP: \"{}\"", unknown.text))],
            _ => Vec::new(),
        }
    }

    fn settled(&mut self, verdict: &Verdict) -> Option<String> {
        let report = self.ended.take()?;
        let primitives: Vec<String> = report.primitives.iter().map(|p| p.primitive.to_string()).collect();
        let invocation = &report.invocation;
        let felt = report.held.map_or_else(String::new, |_| format!("   {:.0} N at the fingers", self.grip_n));
        let done = format!("{} {}   {}{felt}", invocation.skill, invocation.part.object, primitives.join(" "));
        // What was compared with a frame, rather than with the hand.
        let looked = verdict.literals.iter().map(|l| &l.observed.reason).find(|reason| reason.contains(" mm "));
        let looked = looked.map_or_else(String::new, |reason| format!("   looked again: {}", short(reason)));
        let word = match verdict.outcome {
            Outcome::Verified => "VERIFIED",
            Outcome::Contradicted => "CONTRADICTED",
            Outcome::CannotTell => "CANNOT TELL",
        };
        let heading = if self.acted { "" } else { "4 ACT" };
        self.acted = true;
        Some(super::headed(heading, &format!("{done}{looked}   {word}")))
    }
}

/// Which object and which place are meant, and why.
pub fn reasons(explanation: &Explanation, view: Option<&dyn MemoryView>) -> Vec<String> {
    let mut lines = Vec::new();
    for reference in &explanation.references {
        if let (Some(object), Some(retrieval)) = (reference.object, &reference.retrieval) {
            let others = retrieval.hits.iter().map(|hit| hit.object).filter(|other| *other != object);
            let not: Vec<String> = others.filter_map(|other| why_not(other, view?)).collect();
            let not = if not.is_empty() { format!(": {}", reference.how) } else { format!(", {}", not.join(", ")) };
            lines.push(format!("which?  {object}{not}"));
        }
        if let (Some(place), Some(Recall::Known { confidence, evidence, .. })) = (&reference.place, &reference.recall) {
            let evidence: Vec<String> = evidence.iter().map(crate::demo::evidence_words).collect();
            let spot = words::spot(place.pose.translation);
            lines.push(format!("where?  {spot}, {confidence:.2} sure, by {}", evidence.join(" and ")));
        }
    }
    lines
}

/// Why a thing that fits the words as well is not meant: what memory says of its past.
fn why_not(other: ObjectId, view: &dyn MemoryView) -> Option<String> {
    match view.recall_place(other, PlaceReference::BeforeMoved) {
        Recall::Unknown { reason, .. } => {
            Some(format!("not {other}: \"{}\"", reason.split(':').next().unwrap_or(&reason)))
        }
        Recall::Known { .. } => None,
    }
}

fn plan(step: &Step, explanation: &Explanation) -> String {
    let conditions = &explanation.applicability.conditions;
    let hold = conditions.iter().filter(|(_, belief)| belief.truth == Truth::Yes).count();
    format!(
        "plan    {}; {hold} of {} preconditions hold; predicted {:.2}",
        explanation.plan.join(", then "),
        conditions.len(),
        step.prediction.success
    )
}

fn pad_force_n(feedback: &Feedback) -> f64 {
    feedback.pad_force_n.iter().map(|force| force.length()).fold(0.0, f64::max)
}

/// A reason without what stands in brackets.
fn short(reason: &str) -> &str {
    reason.split(" (").next().unwrap_or(reason)
}
