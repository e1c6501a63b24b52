//! The story of an episode, told from its messages as they are delivered.

use acm_actors::message::Message;
use acm_concept::{ids::ObjectId, object::GroundedPart, skill::SkillReport};
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Presence},
    observation::{Outcome, Verdict},
};
use acm_planner::Decision;
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use std::{
    collections::BTreeMap,
    io::Write,
    sync::{Mutex, PoisonError},
};

/// Prints what the agent sees, remembers, decides, does and verifies. It only listens: the episode is the same
/// without it.
pub struct Narrator {
    told: Mutex<Told>,
}

struct Told {
    sink: Box<dyn Write + Send>,
    /// Where each object was when it was last told of.
    places: BTreeMap<ObjectId, String>,
    /// The end of a skill, until its verdict is known: both are told in one line.
    ended: Option<String>,
    /// Whether nothing is told yet.
    silent: bool,
}

impl Narrator {
    /// A narrator that writes to `sink`.
    pub fn new(sink: Box<dyn Write + Send>) -> Narrator {
        Narrator { told: Mutex::new(Told { sink, places: BTreeMap::new(), ended: None, silent: false }) }
    }
}

impl Narrator {
    /// Tells nothing before the first fault that was set.
    pub fn from_first_fault(self) -> Narrator {
        self.told.lock().unwrap_or_else(PoisonError::into_inner).silent = true;
        self
    }
}

impl Journal<Message> for Narrator {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let lines = told.lines(message);
        told.silent &= !matches!(message.body, Message::Wipe | Message::ActorFailed { .. });
        let told = &mut *told;
        for line in lines.iter().filter(|_| !told.silent) {
            writeln!(told.sink, "{line}").map_err(|e| JournalError(e.to_string()))?;
        }
        told.sink.flush().map_err(|e| JournalError(e.to_string()))
    }
}

impl Told {
    fn lines(&mut self, message: &Envelope<Message>) -> Vec<String> {
        let at = message.time_ns as f64 * 1e-9;
        match &message.body {
            Message::Parse { instruction } => vec![format!("told      \"{instruction}\"")],
            Message::Updated { view, blindness, .. } => {
                let mut lines: Vec<String> =
                    blindness.iter().map(|why| format!("saw       nothing: {why:?}")).collect();
                lines.extend(self.changes(&*view.0));
                lines
            }
            Message::Wipe => {
                self.places.clear();
                vec!["fault     memory wiped: objects, places, moves and progress are gone; the task is not".into()]
            }
            Message::Decided { decision, .. } => decision_lines(decision),
            Message::SkillEnded(report) => {
                self.ended = Some(skill_words(report, at));
                Vec::new()
            }
            Message::Settle { verdict, .. } => {
                let ended = self.ended.take().unwrap_or_default();
                vec![format!("act       {ended}  {}", verdict_words(verdict))]
            }
            Message::ActorFailed { role, reason, restarted } => {
                vec![format!(
                    "fault     actor {role} failed ({reason}); {}",
                    if *restarted { "restarted" } else { "not restarted" }
                )]
            }
            Message::Ended(report) => vec![format!("end       {}", crate::run::ending_words(&report.ending))],
            _ => Vec::new(),
        }
    }

    /// What changed since it was last told.
    fn changes(&mut self, view: &dyn MemoryView) -> Vec<String> {
        let mut lines = Vec::new();
        for object in view.objects() {
            let place = place_words(object);
            match self.places.insert(object.id, place.clone()) {
                None => lines.push(format!("saw       {} {} {place}", object.id, looks(object))),
                Some(before) if before != place => {
                    lines.push(format!("saw       {} {} now {place}", object.id, object.category))
                }
                Some(_) => {}
            }
        }
        lines
    }
}

/// Category and size of an object.
pub fn looks(object: &ObjectEntry) -> String {
    let size = object.parts.first().map(size_words).unwrap_or_default();
    format!("{} {size}", object.category)
}

fn size_words(part: &GroundedPart) -> String {
    let numbers: Vec<String> = part.parameters.iter().map(|p| format!("{} {:.1}", p.name, 100.0 * p.value)).collect();
    format!("({} cm)", numbers.join(", "))
}

fn place_words(object: &ObjectEntry) -> String {
    match (object.presence, object.pose(), object.support) {
        (Presence::Held, _, _) => "in the hand".into(),
        (Presence::Missing, _, _) => "is gone from its place".into(),
        // To the centimetre: noise below that is no news.
        (_, Some(pose), support) => {
            let on = support.map_or(String::new(), |id| format!(" on {id}"));
            format!("at ({:.2}, {:.2}){on}", pose.translation.x + 0.0, pose.translation.y + 0.0)
        }
        (_, None, _) => "somewhere".into(),
    }
}

fn decision_lines(decision: &Decision) -> Vec<String> {
    match decision {
        Decision::Act { explanation, .. } => vec![format!("decide    {explanation}")],
        Decision::Look { reason } => vec![format!("look      {reason}")],
        Decision::SubtaskDone { index, reason } => vec![format!("done      subtask {}: {reason}", index + 1)],
        Decision::Done { reason } => vec![format!("done      {reason}")],
        Decision::GiveUp { unknown } => vec![format!("give up   {}", unknown.text)],
    }
}

fn skill_words(report: &SkillReport, at_s: f64) -> String {
    let primitives: Vec<String> = report.primitives.iter().map(|p| p.primitive.to_string()).collect();
    let measured: Vec<String> = report.measured.iter().map(|(name, value)| format!("{name} {value:.3}")).collect();
    format!(
        "{} {}: {} [{}] at {at_s:.1} s",
        report.invocation.skill,
        report.invocation.part.object,
        primitives.join(", "),
        measured.join(", ")
    )
}

fn verdict_words(verdict: &Verdict) -> String {
    match verdict.outcome {
        Outcome::Verified => "VERIFIED".into(),
        Outcome::Contradicted => format!("CONTRADICTED: {}", verdict.reason),
        Outcome::CannotTell => format!("CANNOT TELL: {}", verdict.reason),
    }
}
