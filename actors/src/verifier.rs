//! The verifier actor: compares what was predicted with what was felt and seen since.

use crate::message::{EPISODE, Message};
use acm_concept::{
    literal::{Belief, Evidence, Literal, Truth},
    skill::SkillReport,
};
use acm_memory::{
    MemoryView,
    observation::{LiteralVerdict, Outcome, Verdict},
};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
};

/// A felt literal decides from this confidence on; below it the camera has to look.
const FELT_ENOUGH: f64 = 0.8;
/// A belief decides from this confidence on.
const SEEN_ENOUGH: f64 = 0.8;

/// The verifier actor: stateless.
#[derive(Debug, Default, Clone, Copy)]
pub struct VerifierActor;

impl Core<Message> for VerifierActor {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        let Message::Verify { transition, predicted, report, view } = message.body else {
            return Err(CoreError(format!("verifier cannot handle {:?}", message.body)));
        };
        let verdict = verify(&predicted, &report, &*view.0);
        outbox.send(EPISODE, Message::Verdict { transition, verdict });
        Ok(())
    }
}

/// Compares predicted literals with what the robot felt during the skill and with what memory believes from
/// frames taken after it. What was merely predicted never verifies itself.
pub fn verify(predicted: &[Literal], report: &SkillReport, view: &dyn MemoryView) -> Verdict {
    let literals: Vec<LiteralVerdict> = predicted.iter().map(|literal| verify_one(literal, report, view)).collect();
    let first = |outcome| literals.iter().find(|l| l.outcome == outcome);
    let (outcome, reason) = if let Some((cause, reason)) = &report.failure {
        (Outcome::Contradicted, format!("{}: {reason}", cause.word()))
    } else if let Some(l) = first(Outcome::Contradicted) {
        (Outcome::Contradicted, format!("predicted {}, but {}", l.literal, l.observed.reason))
    } else if let Some(l) = first(Outcome::CannotTell) {
        (Outcome::CannotTell, format!("cannot tell whether {}: {}", l.literal, l.observed.reason))
    } else {
        (Outcome::Verified, "all predicted effects were felt or seen".into())
    };
    Verdict { outcome, literals, reason }
}

fn verify_one(literal: &Literal, report: &SkillReport, view: &dyn MemoryView) -> LiteralVerdict {
    let observed = felt(literal, report).unwrap_or_else(|| seen(literal, report, view));
    let outcome = match observed.truth {
        Truth::Yes => Outcome::Verified,
        Truth::No => Outcome::Contradicted,
        Truth::Unknown => Outcome::CannotTell,
    };
    LiteralVerdict { literal: literal.clone(), observed, outcome }
}

/// What the robot felt of a literal, if it felt it clearly.
fn felt(literal: &Literal, report: &SkillReport) -> Option<Belief> {
    let (felt, confidence) = report.felt.iter().find(|(felt, confidence)| {
        felt.predicate == literal.predicate && felt.arguments == literal.arguments && *confidence >= FELT_ENOUGH
    })?;
    let truth = if felt.negated == literal.negated { Truth::Yes } else { Truth::No };
    let evidence = vec![Evidence::Inferred("felt by the hand".into())];
    Some(Belief { truth, confidence: *confidence, evidence, reason: format!("the hand felt {felt}") })
}

/// What memory believes of a literal from frames taken after the skill ended.
fn seen(literal: &Literal, report: &SkillReport, view: &dyn MemoryView) -> Belief {
    let looked = literal.subject().is_none_or(|id| {
        view.object(id).is_some_and(|object| object.last_seen.time >= report.ended && object.last_frame.is_some())
    });
    if !looked {
        return Belief::unknown("it has not been seen since");
    }
    let belief = view.belief(literal);
    if belief.truth != Truth::Unknown && belief.confidence < SEEN_ENOUGH {
        return Belief { truth: Truth::Unknown, ..belief };
    }
    belief
}
