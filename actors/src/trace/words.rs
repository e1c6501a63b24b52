//! One line for a person on every message: what a reader of the trace wants to know of it.

use crate::{message::Message, report::Ending};
use acm_concept::{embodiment::Feedback, pose::Pose, skill::SkillReport};
use acm_llm::Answer;
use acm_memory::observation::{Displaced, Displacement, Grounding, Note, Outcome, Verdict};
use acm_planner::Decision;

/// How much a line matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// One of a long series.
    Routine,
    /// The ordinary course of things.
    Normal,
    /// Something did not come out as wished.
    Trouble,
}

/// Most objects that one line names.
const MAX_NAMED: usize = 8;
/// Most of a prompt or a reply that one line has, characters.
const MAX_QUOTED: usize = 100;

/// A message in one line.
pub fn line(message: &Message) -> (Level, String) {
    let level = match message {
        Message::Command(_) | Message::Moved(_) | Message::Sense => Level::Routine,
        Message::Interrupt | Message::Wipe | Message::Transplant | Message::Refused { .. } | Message::Broken { .. } => {
            Level::Trouble
        }
        Message::ActorFailed { .. }
        | Message::Retreated { failure: Some(_) }
        | Message::Parsed { task: Err(_), .. } => Level::Trouble,
        Message::Parsed { reading: Some(reading), .. } if reading.fallback.is_some() => Level::Trouble,
        Message::LlmReplied(answer) if matches!(**answer, Answer::Error(_)) => Level::Trouble,
        Message::Updated { blindness: Some(_), .. } => Level::Trouble,
        Message::Verdict { verdict, .. } if verdict.outcome != Outcome::Verified => Level::Trouble,
        Message::SkillEnded(report) if report.failure.is_some() => Level::Trouble,
        Message::Decided { decision, .. } if matches!(**decision, Decision::GiveUp { .. }) => Level::Trouble,
        Message::Ended(report) if report.ending != Ending::Done => Level::Trouble,
        _ => Level::Normal,
    };
    (level, text(message))
}

/// Whether a person who watches the run wants to be told of it: what was asked, seen, decided, done and found, and
/// whatever went wrong. The rest is how the actors ask each other.
pub fn worth_telling(message: &Message) -> bool {
    matches!(
        message,
        Message::Parse { .. }
            | Message::AskLlm { .. }
            | Message::LlmReplied(_)
            | Message::Parsed { .. }
            | Message::Updated { .. }
            | Message::Decided { .. }
            | Message::SkillEnded(_)
            | Message::Verdict { .. }
            | Message::Ended(_)
    ) || line(message).0 == Level::Trouble
}

fn text(message: &Message) -> String {
    match message {
        Message::Begin => "begin".into(),
        Message::Interrupt => "end as soon as possible".into(),
        Message::Look { reason, nouns } => {
            format!("look: {reason}{}", listed(" (nouns ", nouns.iter().cloned(), ")"))
        }
        Message::Expected(expectation) => {
            let names = expectation.objects.iter().map(|object| format!("{} {}", object.id, object.category));
            format!("expects {} objects{}", expectation.objects.len(), listed(": ", names, ""))
        }
        Message::Capture => "take a frame".into(),
        Message::Frame { header, feedback } => {
            let size = (header.intrinsics.width, header.intrinsics.height);
            format!("{} of {}, {}x{}; {}", header.id, header.camera, size.0, size.1, arm(feedback))
        }
        Message::Percepts { percepts, .. } => match percepts.blindness {
            Some(why) => format!("{} shows nothing: {why:?}", percepts.frame.id),
            None => {
                let things = percepts.objects.iter().map(|object| {
                    let at = object.pose().map_or_else(String::new, |pose| format!(" {}", spot(&pose.pose)));
                    format!("{}{at} {:.2}", object.category, object.confidence)
                });
                format!("{} shows {}{}", percepts.frame.id, percepts.objects.len(), listed(": ", things, ""))
            }
        },
        Message::Updated { grounding, blindness, view, .. } => {
            let blind = blindness.map_or_else(String::new, |why| format!("saw nothing ({why:?}); "));
            format!("{blind}{}{} objects known", changes(grounding), view.0.objects().len())
        }
        Message::Note(note) => note_words(note),
        Message::Wipe => "forget everything".into(),
        Message::Transplant => "forget everything and believe what another memory came to".into(),
        Message::Record(executed) => format!("keep: {}", skill_words(&executed.report)),
        Message::Settle { transition, verdict } => format!("{transition} {}", verdict_words(verdict)),
        Message::Kept { transition, view } => {
            let kept = transition.map_or_else(|| "kept".into(), |id| format!("{id} kept"));
            format!("{kept}; {} objects, {} transitions", view.0.objects().len(), view.0.transitions().len())
        }
        Message::Parse { instruction } => format!("read \"{instruction}\""),
        Message::AskLlm { request } => {
            let last = request.turns.last().map(acm_llm::Turn::text).unwrap_or_default();
            let again = if request.turns.len() > 1 { ", again" } else { "" };
            format!("prompt {}{again}: {}", request.prompt, short(&last))
        }
        Message::LlmReplied(answer) => match &**answer {
            Answer::Reply(reply) => {
                format!("{} ({}), {}: {}", reply.model, reply.backend, reply.usage, short(&reply.text))
            }
            Answer::Error(error) => format!("no reply: {error}"),
        },
        Message::Parsed { task, reading } => {
            let read = reading.as_ref().map_or_else(String::new, |reading| format!("; {reading}"));
            match task {
                Ok(task) => {
                    let subtasks = task.subtasks.iter().enumerate().map(|(i, s)| format!("{} \"{}\"", i + 1, s.text));
                    let corrections = listed("; ", task.corrections.iter().map(ToString::to_string), "");
                    format!("{} subtasks{}{corrections}{read}", task.subtasks.len(), listed(": ", subtasks, ""))
                }
                Err(reason) => format!("not understood: {reason}{read}"),
            }
        }
        Message::Decide { situation, .. } => {
            format!("what next? {} looks in a row, {} skills left", situation.looks, situation.skills_left)
        }
        Message::Decided { decision, counsel, .. } => {
            let counsel = counsel.as_ref().map_or_else(String::new, |counsel| format!("; {counsel}"));
            format!("{}{counsel}", decision_words(decision))
        }
        Message::Execute(skill) => {
            let attempt = if skill.attempt > 0 { format!(", attempt {}", skill.attempt + 1) } else { String::new() };
            format!("run {} on {} by {}{attempt}", skill.skill, skill.part, skill.kind)
        }
        Message::Retreat => "bring the hand out of the way".into(),
        Message::Sense => "what does the arm report?".into(),
        Message::Command(command) => format!(
            "hand to {}, opening {:.0} mm, grip {:.0} N",
            spot3(&command.tcp),
            1000.0 * command.opening_m,
            command.grip_force_n
        ),
        Message::Moved(feedback) => arm(feedback),
        Message::Refused { reason, fatal } => {
            format!("refused{}: {reason}", if *fatal { " for good" } else { "" })
        }
        Message::SkillEnded(report) => skill_words(report),
        Message::Retreated { failure: None } => "the hand is out of the way".into(),
        Message::Retreated { failure: Some(reason) } => format!("the hand may be in the way: {reason}"),
        Message::Verify { transition, predicted, .. } => {
            format!("is {transition} as predicted?{}", listed(" ", predicted.iter().map(ToString::to_string), ""))
        }
        Message::Verdict { transition, verdict } => format!("{transition} {}", verdict_words(verdict)),
        Message::Wait { seconds } => format!("wait {seconds} s"),
        Message::Waited => "time has passed".into(),
        Message::Broken { reason } => format!("broken: {reason}"),
        Message::ActorFailed { role, reason, restarted } => {
            format!("actor {role} failed ({reason}); {}restarted", if *restarted { "" } else { "not " })
        }
        Message::Ended(report) => {
            format!("{}; {} skills, {} frames", report.ending, report.steps.len(), report.frames_perceived)
        }
    }
}

/// The beginning of a text, on one line.
fn short(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MAX_QUOTED) {
        Some((end, _)) => format!("{}...", line.get(..end).unwrap_or_default()),
        None => line,
    }
}

/// A decision in a line.
fn decision_words(decision: &Decision) -> String {
    match decision {
        Decision::Act { step, explanation } => format!("{step}; plan: {}", explanation.plan.join(" > ")),
        Decision::Look { reason, .. } => format!("look again: {reason}"),
        Decision::SubtaskDone { index, reason, .. } => format!("subtask {} is done: {reason}", index + 1),
        Decision::Done { reason } => format!("all is done: {reason}"),
        Decision::GiveUp { unknown, .. } => format!("give up: {unknown}"),
    }
}

fn changes(grounding: &Grounding) -> String {
    let new: Vec<String> = grounding.resolved.iter().filter(|r| r.new).map(|r| r.object.to_string()).collect();
    let held_back = grounding.resolved.iter().filter(|r| !r.accepted).map(|r| r.object.to_string());
    let mut text = format!("{} seen; ", grounding.resolved.len());
    for (word, list) in [
        ("new", new),
        ("not yet believed", held_back.collect()),
        ("moved", grounding.moved.iter().map(ToString::to_string).collect()),
        ("missing", grounding.missing.iter().map(ToString::to_string).collect()),
    ] {
        text += &listed(&format!("{word} "), list.into_iter(), "; ");
    }
    match &grounding.displaced {
        Some(Displaced { by: Displacement::Camera(_), undone: true, .. }) => {
            text + "the camera was moved: accounted for"
        }
        Some(Displaced { by: Displacement::Camera(_), .. }) => text + "the camera was moved: nothing taken over",
        Some(Displaced { by: Displacement::Depth(factor), .. }) => {
            text + &format!("depths are wrong by a factor of {factor:.2}: nothing taken over")
        }
        None => text,
    }
}

fn note_words(note: &Note) -> String {
    match note {
        Note::EpisodeBegan => "note: a run began".into(),
        Note::Instructed { text, .. } => format!("note: instructed \"{text}\""),
        Note::SubtaskDone { index, .. } => format!("note: subtask {} is done", index + 1),
    }
}

fn skill_words(report: &SkillReport) -> String {
    let primitives: Vec<String> = report.primitives.iter().map(|p| p.primitive.to_string()).collect();
    let took_s = report.ended.seconds_since(report.started);
    let did = format!(
        "{} {}: {} in {took_s:.1} s",
        report.invocation.skill,
        report.invocation.part.object,
        primitives.join(", ")
    );
    match &report.failure {
        None => did,
        Some((cause, reason)) => format!("{did}; FAILED ({}): {reason}", cause.word()),
    }
}

fn verdict_words(verdict: &Verdict) -> String {
    match verdict.outcome {
        Outcome::Verified => format!("verified: {}", verdict.reason),
        Outcome::Contradicted => format!("CONTRADICTED: {}", verdict.reason),
        Outcome::CannotTell => format!("cannot tell: {}", verdict.reason),
    }
}

fn arm(feedback: &Feedback) -> String {
    let [left, right] = feedback.pad_force_n;
    let pads = (left.length(), right.length());
    format!(
        "hand at {}, opening {:.0} mm, pads {:.1} and {:.1} N, wrist {:.1} N",
        spot3(&feedback.tcp),
        1000.0 * feedback.opening_m,
        pads.0,
        pads.1,
        feedback.wrist_force_n.length()
    )
}

fn spot(pose: &Pose) -> String {
    let at = pose.translation;
    format!("({:.2}, {:.2})", rounded(at.x, 100.0), rounded(at.y, 100.0))
}

fn spot3(pose: &Pose) -> String {
    let at = pose.translation;
    let [x, y, z] = at.to_array().map(|metres| rounded(metres, 1000.0));
    format!("({x:.3}, {y:.3}, {z:.3})")
}

/// Rounded before it is printed, so that no zero has a sign.
fn rounded(metres: f64, steps: f64) -> f64 {
    (metres * steps).round() / steps + 0.0
}

/// A list between two texts; nothing for an empty list, the rest counted for a long one.
fn listed(before: &str, items: impl Iterator<Item = String>, after: &str) -> String {
    let items: Vec<String> = items.collect();
    if items.is_empty() {
        return String::new();
    }
    let more = items.len().saturating_sub(MAX_NAMED);
    let named = items.get(..items.len() - more).unwrap_or_default().join(", ");
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{before}{named}{rest}{after}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_have_an_end_and_empty_ones_leave_no_trace() {
        assert_eq!(listed("new ", std::iter::empty(), "; "), "");
        let many = (0..10).map(|i| i.to_string());
        assert_eq!(listed("new ", many, "; "), "new 0, 1, 2, 3, 4, 5, 6, 7 and 2 more; ");
    }

    #[test]
    fn what_went_wrong_is_told_as_trouble() {
        assert_eq!(line(&Message::Capture), (Level::Normal, "take a frame".into()));
        let broken = line(&Message::Broken { reason: "no camera".into() });
        assert_eq!(broken, (Level::Trouble, "broken: no camera".into()));
    }
}
