//! Takes what the robot did: transitions, the beliefs that they bring, and what the verifier made of them.

use crate::{
    belief, consolidate,
    draft::{Draft, Stage},
    entry::{ObjectEntry, PlaceCause, Presence, Transition, TransitionResult},
    event::Change,
    identity::predict::{HAND_SIGMA_M, carried},
    observation::{Executed, Outcome, Verdict},
    observe::lose_grip,
    scene,
    state::State,
};
use acm_concept::{
    ids::{ObjectId, TransitionId},
    literal::{Evidence, Literal, Term, Truth},
    skill::{FailureCause, SkillReport},
};
use glam::DVec3;

/// Felt literals below this confidence are not taken as felt.
const FELT: f64 = 0.5;
/// Most literals that are asked of an object because an action once felt them.
const MAX_FOUND: usize = 32;

/// Keeps a finished skill and applies what the robot felt as beliefs that have yet to be verified.
pub(crate) fn record(draft: &mut Draft<'_>, executed: &Executed) -> TransitionId {
    let report = &executed.report;
    draft.at(report.ended);
    let id = TransitionId(draft.state.next.transition);
    let transition = Transition {
        id,
        moment: draft.moment(),
        subtask: executed.subtask,
        before: state_before(draft, executed),
        predicted: executed.predicted.clone(),
        after: Vec::new(),
        result: TransitionResult::Pending,
        report: report.clone(),
    };
    let evidence = [Evidence::Transition(id)];
    draft.emit(Vec::new(), Change::Transition(Box::new(transition)));
    let mut stage = Stage::default();
    apply_report(draft, &mut stage, report, id);
    scene::settle_supports(&mut stage, &draft.state, draft.library, PlaceCause::Own(id));
    draft.emit_stage(stage, &evidence);
    id
}

/// What is believed before of all that the skill's conditions and predicted effects speak of.
fn state_before(draft: &Draft<'_>, executed: &Executed) -> Vec<Literal> {
    let object = executed.report.invocation.part.object;
    let mut about: Vec<Literal> = executed.predicted.iter().map(positive).collect();
    about.extend(draft.state.object(object).into_iter().flat_map(|entry| entry.state.iter()).map(positive));
    about.extend(found_of(&draft.state, object));
    about.push(Literal::new("hand-empty", Vec::new()));
    about.push(Literal::new("clear", vec![Term::Object(object)]));
    if let Some(support) = draft.state.object(object).and_then(|entry| entry.support) {
        about.push(Literal::new("on", vec![Term::Object(object), Term::Object(support)]));
    }
    let mut before: Vec<Literal> = Vec::new();
    for literal in about {
        let literal = match belief::belief(&draft.state, draft.library, &literal).truth {
            Truth::Yes => literal,
            Truth::No => literal.negate(),
            Truth::Unknown => continue,
        };
        if !before.contains(&literal) {
            before.push(literal);
        }
    }
    before
}

fn positive(literal: &Literal) -> Literal {
    Literal { negated: false, ..literal.clone() }
}

/// What own actions of this run felt or found of the object itself, latest first.
fn found_of(state: &State, object: ObjectId) -> Vec<Literal> {
    let mut found: Vec<Literal> = Vec::new();
    let own = state.transitions.iter().rev().take_while(|t| t.moment.episode == state.next.episode);
    let literals = own.flat_map(|t| t.report.felt.iter().map(|(literal, _)| literal).chain(&t.after));
    for literal in literals.filter(|literal| literal.arguments.len() == 1 && literal.subject() == Some(object)) {
        let literal = positive(literal);
        if found.len() < MAX_FOUND && !found.contains(&literal) {
            found.push(literal);
        }
    }
    found
}

fn apply_report(draft: &Draft<'_>, stage: &mut Stage, report: &SkillReport, id: TransitionId) {
    let state = &draft.state;
    let target = report.invocation.part.object;
    let held_now = held_after(report);
    if let Some(before) = state.held().map(|entry| entry.id)
        && held_now != Some(before)
        && grip_ended(report, before, held_now)
        && let Some(staged) = stage.touch(state, before)
    {
        lose_grip(staged);
    }
    if let (Some(pose), true) = (report.left_at.filter(|pose| pose.is_valid()), held_now != Some(target))
        && let Some(staged) = stage.touch(state, target)
    {
        let moved = staged.entry.presence != Presence::Present || shifted(&staged.entry, pose.translation);
        staged.entry.parts = carried(&staged.entry.parts, &pose);
        spread(&mut staged.entry, HAND_SIGMA_M);
        staged.entry.presence = Presence::Present;
        staged.entry.verified = false;
        staged.track = crate::event::Track { unconfirmed: Some(id), ..staged.track.moved() };
        staged.placed = moved.then_some(PlaceCause::Own(id));
    }
    if let Some(held) = held_now
        && let Some(staged) = stage.touch(state, held)
    {
        staged.left = (staged.entry.presence != Presence::Held).then_some(PlaceCause::Grasped(id));
        staged.entry.presence = Presence::Held;
        staged.entry.support = None;
        let grip = report.held.filter(|(id, pose)| *id == held && pose.is_valid()).map(|(_, pose)| pose);
        staged.track = crate::event::Track { grip: grip.or(staged.track.grip), ..staged.track.moved() };
    } else if report.failure.is_some()
        && report.left_at.is_none()
        && let Some(staged) = stage.touch(state, target)
    {
        // A hand that failed at something may have pushed it.
        staged.track.disturbed |= staged.entry.presence == Presence::Present;
    }
}

/// What the report says to be in the hand.
fn held_after(report: &SkillReport) -> Option<ObjectId> {
    report.held.map(|(object, _)| object).or_else(|| {
        felt(report).find(|literal| literal.predicate == "holding" && !literal.negated).and_then(Literal::subject)
    })
}

/// Whether the report says that `before` is no longer in the hand: it says so, or it was put down, or something
/// else is held. A report that does not speak of it changes nothing.
fn grip_ended(report: &SkillReport, before: ObjectId, held_now: Option<ObjectId>) -> bool {
    let says_empty = felt(report).any(|literal| match literal.predicate.as_str() {
        "hand-empty" => !literal.negated,
        "holding" => literal.negated && literal.subject() == Some(before),
        _ => false,
    });
    let lost = report.failure.as_ref().is_some_and(|(cause, _)| *cause == FailureCause::Grasp);
    says_empty || lost || report.left_at.is_some() || held_now.is_some()
}

fn felt(report: &SkillReport) -> impl Iterator<Item = &Literal> {
    report.felt.iter().filter(|(_, confidence)| *confidence >= FELT).map(|(literal, _)| literal)
}

fn shifted(entry: &ObjectEntry, to: DVec3) -> bool {
    entry.pose().is_none_or(|pose| pose.translation.distance(to) > crate::observe::MOVED_M)
}

/// Sets all positions to the hand's uncertainty.
fn spread(entry: &mut ObjectEntry, sigma_m: f64) {
    for part in &mut entry.parts {
        part.pose.position_sigma_m = DVec3::splat(sigma_m);
        part.pose.yaw_sigma_rad = part.pose.yaw_sigma_rad.max(0.1);
    }
}

/// Writes the verifier's answer: result, literals after, what it verifies or undoes, and the skill's statistics.
pub(crate) fn settle(draft: &mut Draft<'_>, transition: &Transition, verdict: &Verdict) {
    let evidence = [Evidence::Transition(transition.id)];
    let result = result(transition, verdict);
    let after = verdict.literals.iter().filter_map(|literal| {
        let positive = literal.literal.clone();
        match literal.observed.truth {
            Truth::Yes => Some(positive),
            Truth::No => Some(positive.negate()),
            Truth::Unknown => None,
        }
    });
    let after: Vec<Literal> = after.collect();
    let settled = Change::Settled { transition: transition.id, result: result.clone(), after };
    draft.emit(evidence.to_vec(), settled);
    let mut stage = Stage::default();
    let object = transition.object();
    let denied = |predicate: &str| {
        let is = |l: &&crate::observation::LiteralVerdict| l.literal.predicate == predicate && !l.literal.negated;
        verdict.literals.iter().filter(is).any(|l| l.outcome == Outcome::Contradicted)
    };
    if let Some(entry) = draft.state.object(object).cloned() {
        let held = entry.presence == Presence::Held;
        match result {
            TransitionResult::Verified if !entry.verified && entry.presence != Presence::Missing => {
                if let Some(staged) = stage.touch(&draft.state, object) {
                    staged.entry.verified = true;
                }
            }
            TransitionResult::Failed { .. } if held && denied("holding") => {
                if let Some(staged) = stage.touch(&draft.state, object) {
                    lose_grip(staged);
                }
            }
            _ => {}
        }
    }
    draft.emit_stage(stage, &evidence);
    consolidate::count(draft, transition);
}

fn result(transition: &Transition, verdict: &Verdict) -> TransitionResult {
    let failed = |cause| TransitionResult::Failed { cause, reason: verdict.reason.clone() };
    match (verdict.outcome, &transition.report.failure) {
        (Outcome::Verified, _) => TransitionResult::Verified,
        (Outcome::Contradicted, Some((cause, _))) => failed(*cause),
        (Outcome::Contradicted, None) => failed(cause_of(verdict)),
        (Outcome::CannotTell, Some((cause, reason))) => {
            TransitionResult::Failed { cause: *cause, reason: reason.clone() }
        }
        (Outcome::CannotTell, None) => TransitionResult::CannotTell,
    }
}

/// The kind of failure that a contradicted literal speaks of.
fn cause_of(verdict: &Verdict) -> FailureCause {
    let contradicted = verdict.literals.iter().find(|literal| literal.outcome == Outcome::Contradicted);
    match contradicted.map(|literal| literal.literal.predicate.as_str()) {
        Some("holding" | "hand-empty") => FailureCause::Grasp,
        Some("at" | "on") => FailureCause::Place,
        Some("pressed") => FailureCause::Press,
        _ => FailureCause::Plan,
    }
}
