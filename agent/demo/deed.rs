//! Tells what the asked agent decides, does and verifies.

use super::page::{Card, Cards};
use crate::words;
use acm_actors::message::Message;
use acm_concept::{
    embodiment::Feedback,
    ids::ObjectId,
    literal::{Evidence, Truth},
    skill::SkillReport,
};
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
    sync::{Arc, Mutex, PoisonError},
};

/// Listens to the agent that is asked.
pub struct Deed {
    told: Mutex<Told>,
    cards: Arc<Cards>,
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
    /// Tells into `sink`, and keeps the reasons for the page; `why` is the command with which the decision can be looked
    /// into.
    pub fn new(sink: Box<dyn Write + Send>, cards: Arc<Cards>, why: String) -> Deed {
        let told = Told { sink, view: None, decided: false, acted: false, grip_n: 0.0, ended: None, why };
        Deed { told: Mutex::new(told), cards }
    }
}

impl Journal<Message> for Deed {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        for line in told.lines(&message.body, &self.cards) {
            writeln!(told.sink, "{line}").map_err(|e| JournalError(e.to_string()))?;
        }
        told.sink.flush().map_err(|e| JournalError(e.to_string()))
    }
}

impl Told {
    fn lines(&mut self, message: &Message, cards: &Cards) -> Vec<String> {
        match message {
            Message::Parse { instruction } => vec![super::headed("3 ASK", &format!("\"{instruction}\""))],
            Message::Decide { view, .. } => {
                self.view = Some(view.clone());
                Vec::new()
            }
            Message::Decided { decision, .. } => self.decision(decision, cards),
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

    fn decision(&mut self, decision: &Decision, cards: &Cards) -> Vec<String> {
        match decision {
            Decision::Act { step, explanation } if !self.decided => {
                self.decided = true;
                let view = self.view.as_ref().map(|view| &*view.0);
                let mut lines: Vec<String> =
                    reasons(explanation, view, cards).iter().map(|line| super::below(line)).collect();
                lines.push(super::below(&plan(step, explanation)));
                lines.push(super::below(&format!("why?    {}", self.why)));
                lines
            }
            Decision::GiveUp { unknown, .. } => vec![super::below(&format!("GIVES UP: \"{}\"", unknown.text))],
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
fn reasons(explanation: &Explanation, view: Option<&dyn MemoryView>, cards: &Cards) -> Vec<String> {
    let (mut lines, mut meant) = (Vec::new(), None);
    for reference in &explanation.references {
        if let (Some(object), Some(retrieval)) = (reference.object, &reference.retrieval) {
            meant = Some(object);
            let mut not = Vec::new();
            for other in retrieval.hits.iter().map(|hit| hit.object).filter(|other| *other != object) {
                let Some(why) = view.and_then(|view| why_not(other, view)) else { continue };
                cards.add(Card::latest(other, &format!("why not {other}?"), &why));
                not.push(format!("not {other}: \"{why}\""));
            }
            let not = if not.is_empty() { format!(": {}", reference.how) } else { format!(", {}", not.join(", ")) };
            lines.push(format!("which?  {object}{not}"));
        }
        if let (Some(place), Some(Recall::Known { confidence, evidence, .. })) = (&reference.place, &reference.recall) {
            let grounds: Vec<String> = evidence.iter().map(super::evidence_words).collect();
            let (spot, grounds) = (words::spot(place.pose.translation), grounds.join(" and "));
            let first = evidence.iter().find_map(|evidence| match evidence {
                Evidence::Frame(frame) => Some(*frame),
                _ => None,
            });
            if let (Some(object), Some(frame)) = (meant, first) {
                let text = format!("{object} was at {spot} before it was moved, {confidence:.2} sure, by {grounds}");
                cards.add(Card::new(object, frame, "so it belongs there", &text));
            }
            lines.push(format!("where?  {spot}, {confidence:.2} sure, by {grounds}"));
        }
    }
    lines
}

/// Why a thing that fits the words as well is not meant: what memory says of its past.
fn why_not(other: ObjectId, view: &dyn MemoryView) -> Option<String> {
    match view.recall_place(other, PlaceReference::BeforeMoved) {
        Recall::Unknown { reason, .. } => Some(reason.split(':').next().unwrap_or(&reason).to_string()),
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
