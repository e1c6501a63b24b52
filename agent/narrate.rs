//! The story of an episode, told from its messages as they are delivered.

use acm_actors::{message::Message, report::Ending};
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
    /// The plan as it was last announced.
    plan: Vec<String>,
    gave_up: bool,
}

impl Narrator {
    /// A narrator that writes to `sink`.
    pub fn new(sink: Box<dyn Write + Send>) -> Narrator {
        Narrator {
            told: Mutex::new(Told {
                sink,
                places: BTreeMap::new(),
                ended: None,
                silent: false,
                plan: Vec::new(),
                gave_up: false,
            }),
        }
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
            Message::Decided { decision, .. } => self.decision_lines(decision),
            Message::SkillEnded(report) => {
                self.ended = Some(skill_words(report, at));
                Vec::new()
            }
            Message::Settle { verdict, .. } => {
                let ended = self.ended.take().unwrap_or_default();
                vec![format!("act       {ended}  {}", verdict_words(verdict))]
            }
            Message::ActorFailed { role, reason, restarted } => {
                let outcome = if *restarted { "restarted" } else { "not restarted" };
                vec![format!("fault     actor {role} failed ({reason}); {outcome}")]
            }
            Message::Ended(report) => match &report.ending {
                Ending::Done => Vec::new(),
                Ending::GaveUp { .. } if self.gave_up => Vec::new(),
                other => vec![format!("end       {}", crate::run::ending_words(other))],
            },
            _ => Vec::new(),
        }
    }

    /// What changed since it was last told: new things by category, then each thing that is elsewhere.
    fn changes(&mut self, view: &dyn MemoryView) -> Vec<String> {
        let (mut new, mut moved): (BTreeMap<&str, Vec<&ObjectEntry>>, Vec<String>) = Default::default();
        for object in view.objects() {
            let place = place_words(object);
            match self.places.insert(object.id, place.clone()) {
                None => new.entry(&object.category).or_default().push(object),
                Some(before) if before != place => {
                    moved.push(format!("saw       {} {} now {place}", object.id, object.category))
                }
                Some(_) => {}
            }
        }
        let group = |(category, objects): (&&str, &Vec<&ObjectEntry>)| {
            let each: Vec<String> = objects.iter().map(|o| format!("{} {}", o.id, place_words(o))).collect();
            let size = objects.first().and_then(|o| o.parts.first()).map(size_words).unwrap_or_default();
            format!("saw       {} {category} {size}: {}", objects.len(), each.join(", "))
        };
        new.iter().map(group).chain(moved).collect()
    }

    /// A step that was announced as part of a plan is not announced again.
    fn decision_lines(&mut self, decision: &Decision) -> Vec<String> {
        match decision {
            Decision::Act { step, explanation } => {
                let announced = self.plan.get(1..).is_some_and(|rest| rest == explanation.plan);
                self.plan.clone_from(&explanation.plan);
                if announced && step.attempt == 0 {
                    return Vec::new();
                }
                let past = explanation.references.iter().filter(|r| r.recall.is_some());
                let past: String = past.map(|r| format!("; \"{}\" is {}", r.phrase, r.how)).collect();
                vec![format!("decide    {}{past}", explanation.plan.join(", then "))]
            }
            Decision::Look { reason } => vec![format!("look      {reason}")],
            Decision::SubtaskDone { index, reason } => vec![format!("done      subtask {}: {reason}", index + 1)],
            Decision::Done { .. } => Vec::new(),
            Decision::GiveUp { unknown } => {
                self.gave_up = true;
                vec![format!("give up   {}", unknown.text)]
            }
        }
    }
}

/// The part's parameters in the order of its template, lengths in centimetres.
fn size_words(part: &GroundedPart) -> String {
    let numbers: Vec<String> = part.parameters.iter().map(|p| format!("{:.1}", 100.0 * p.value)).collect();
    format!("{} cm", numbers.join("x"))
}

fn place_words(object: &ObjectEntry) -> String {
    match (object.presence, object.pose(), object.support) {
        (Presence::Held, _, _) => "in the hand".into(),
        (Presence::Missing, _, _) => "is gone from its place".into(),
        // To the centimetre: noise below that is no news.
        (_, Some(pose), support) => {
            let on = support.map_or(String::new(), |id| format!(" on {id}"));
            format!("({:.2}, {:.2}){on}", pose.translation.x + 0.0, pose.translation.y + 0.0)
        }
        (_, None, _) => "somewhere".into(),
    }
}

fn skill_words(report: &SkillReport, at_s: f64) -> String {
    let primitives: Vec<String> = report.primitives.iter().map(|p| p.primitive.to_string()).collect();
    let invocation = &report.invocation;
    format!("{} {}: {}, {at_s:.0} s", invocation.skill, invocation.part.object, primitives.join(", "))
}

fn verdict_words(verdict: &Verdict) -> String {
    match verdict.outcome {
        Outcome::Verified => "VERIFIED".into(),
        Outcome::Contradicted => format!("CONTRADICTED: {}", verdict.reason),
        Outcome::CannotTell => format!("CANNOT TELL: {}", verdict.reason),
    }
}
