//! The story of an episode, told from its messages as they are delivered.

use crate::words;
use acm_actors::{message::Message, report::Ending};
use acm_concept::{ids::ObjectId, object::Blindness, skill::SkillReport};
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

/// A thing that stays for so long has come to rest, seconds.
const REST_S: f64 = 1.0;

/// Prints what the agent sees, remembers, decides, does and verifies. It only listens: the episode is the same
/// without it.
pub struct Narrator {
    told: Mutex<Told>,
}

struct Told {
    sink: Box<dyn Write + Send>,
    places: BTreeMap<ObjectId, Whereabouts>,
    /// Since when nothing can be seen, seconds, and in how many frames.
    blind: Option<(f64, u32)>,
    /// The end of a skill, until its verdict is known: both are told in one line.
    ended: Option<String>,
    /// Whether nothing is told yet.
    silent: bool,
    /// The plan as it was last announced.
    plan: Vec<String>,
    gave_up: bool,
}

/// Where an object is, and what of it is told. Of a thing on its way the start, a loss and the end are told.
struct Whereabouts {
    category: String,
    place: String,
    told: String,
    /// When it last was elsewhere, seconds.
    changed_s: f64,
    moving: bool,
}

impl Narrator {
    /// A narrator that writes to `sink`.
    pub fn new(sink: Box<dyn Write + Send>) -> Narrator {
        Narrator {
            told: Mutex::new(Told {
                sink,
                places: BTreeMap::new(),
                blind: None,
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
        told.silent &= !matches!(message.body, Message::Wipe | Message::Transplant | Message::ActorFailed { .. });
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
            Message::Parse { instruction } => {
                let mut lines = self.at_rest(f64::INFINITY);
                lines.push(format!("told      \"{instruction}\""));
                lines
            }
            Message::Parsed { task, reading } => {
                let corrections = task.iter().flat_map(|task| &task.corrections).map(ToString::to_string);
                let told = reading.iter().map(ToString::to_string).chain(corrections);
                told.map(|told| format!("read      {told}")).collect()
            }
            Message::Updated { view, blindness, .. } => {
                let mut lines: Vec<String> = self.blindness(*blindness, at).into_iter().collect();
                lines.extend(self.changes(&*view.0, at));
                lines.extend(self.at_rest(at));
                lines
            }
            Message::Wipe => {
                self.places.clear();
                vec!["fault     memory wiped: objects, places, moves and progress are gone; the task is not".into()]
            }
            Message::Transplant => {
                self.places.clear();
                vec!["fault     another memory has taken the place of the run's own; the task is still known".into()]
            }
            Message::Decided { decision, counsel, .. } => {
                let mut lines = self.at_rest(f64::INFINITY);
                lines.extend(counsel.iter().map(|counsel| format!("asked     {counsel}")));
                lines.extend(self.decision_lines(decision));
                lines
            }
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

    /// The first frame without sight, and the first one after it.
    fn blindness(&mut self, why: Option<Blindness>, at_s: f64) -> Option<String> {
        match (why, &mut self.blind) {
            (Some(_), Some((_, frames))) => {
                *frames += 1;
                None
            }
            (Some(why), blind @ None) => {
                *blind = Some((at_s, 1));
                Some(format!("saw       nothing: {why:?}"))
            }
            (None, blind) => {
                let (since_s, frames) = blind.take()?;
                Some(format!("saw       again, after {:.1} s and {frames} frames without sight", at_s - since_s))
            }
        }
    }

    /// What changed since it was last told: new things by category, then each thing that is elsewhere.
    fn changes(&mut self, view: &dyn MemoryView, at_s: f64) -> Vec<String> {
        let (mut new, mut moved): (BTreeMap<&str, Vec<&ObjectEntry>>, Vec<String>) = Default::default();
        for object in view.objects() {
            let place = place_words(object);
            let Some(known) = self.places.get_mut(&object.id) else {
                let category = object.category.clone();
                let (told, changed_s, moving) = (place.clone(), f64::NEG_INFINITY, false);
                self.places.insert(object.id, Whereabouts { category, place, told, changed_s, moving });
                new.entry(&object.category).or_default().push(object);
                continue;
            };
            if known.place == place {
                continue;
            }
            (known.changed_s, known.place) = (at_s, place);
            let stands = object.presence == Presence::Present;
            if !(known.moving && stands) {
                moved.push(format!("saw       {} {} now {}", object.id, object.category, known.place));
                known.told.clone_from(&known.place);
            }
            known.moving = stands;
        }
        let group = |(category, objects): (&&str, &Vec<&ObjectEntry>)| {
            let each: Vec<String> = objects.iter().map(|o| format!("{} {}", o.id, place_words(o))).collect();
            let size = objects.first().map(|object| words::size(object, view.library())).unwrap_or_default();
            format!("saw       {} {category} {size}: {}", objects.len(), each.join(", "))
        };
        new.iter().map(group).chain(moved).collect()
    }

    /// What has come to rest by now.
    fn at_rest(&mut self, at_s: f64) -> Vec<String> {
        let mut lines = Vec::new();
        for (id, known) in self.places.iter_mut().filter(|(_, known)| known.moving && at_s - known.changed_s >= REST_S)
        {
            known.moving = false;
            if known.told != known.place {
                lines.push(format!("saw       {id} {} comes to rest at {}", known.category, known.place));
                known.told.clone_from(&known.place);
            }
        }
        lines
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
            Decision::Look { reason, .. } => vec![format!("look      {reason}")],
            Decision::SubtaskDone { index, reason, .. } => vec![format!("done      subtask {}: {reason}", index + 1)],
            Decision::Done { .. } => Vec::new(),
            Decision::GiveUp { unknown, .. } => {
                self.gave_up = true;
                vec![format!("give up   {}", unknown.text)]
            }
        }
    }
}

fn place_words(object: &ObjectEntry) -> String {
    match (object.presence, object.pose(), object.support) {
        (Presence::Held, _, _) => "in the hand".into(),
        (Presence::Missing, _, _) => "gone from its place".into(),
        (_, Some(pose), support) => {
            let on = support.map_or(String::new(), |id| format!(" on {id}"));
            format!("{}{on}", words::spot(pose.translation))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_without_sight_are_told_in_two_lines() {
        let narrator = Narrator::new(Box::new(std::io::sink()));
        let mut told = narrator.told.lock().unwrap_or_else(PoisonError::into_inner);
        let frames = [(0.0, None), (0.1, Some(Blindness::NoDepth)), (0.2, Some(Blindness::NoDepth)), (0.5, None)];
        let lines: Vec<String> = frames.into_iter().filter_map(|(at_s, why)| told.blindness(why, at_s)).collect();
        let after = "saw       again, after 0.4 s and 2 frames without sight";
        assert_eq!(lines, ["saw       nothing: NoDepth", after]);
    }

    #[test]
    fn what_moves_is_told_when_it_has_come_to_rest() {
        let narrator = Narrator::new(Box::new(std::io::sink()));
        let mut told = narrator.told.lock().unwrap_or_else(PoisonError::into_inner);
        let thing = |place: &str, changed_s| Whereabouts {
            category: "box".into(),
            place: place.into(),
            told: "here".into(),
            changed_s,
            moving: true,
        };
        told.places.extend([(ObjectId(1), thing("there", 2.0)), (ObjectId(2), thing("here", 2.0))]);
        assert!(told.at_rest(2.5).is_empty());
        assert_eq!(told.at_rest(3.0), ["saw       O1 box comes to rest at there"]);
        assert!(told.at_rest(9.0).is_empty());
    }
}
