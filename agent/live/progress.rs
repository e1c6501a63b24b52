//! How far a run has come, told from its messages alone.

use acm_actors::{message::Message, trace::words};
use acm_planner::Decision;
use acm_runtime::envelope::{Envelope, OUTSIDE, Payload};

/// How far a run has come.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Progress {
    title: String,
    time_s: f64,
    /// When the instruction's time is over, and how many skills may still be run, once the planner was told.
    budget: Option<(f64, u32)>,
    at_work: String,
    subtasks: Vec<String>,
    /// The subtask of the moment, from 0.
    subtask: usize,
    /// Steps that were decided, and the last of them with what has become of it.
    steps: u32,
    step: Option<(String, &'static str)>,
    decided: String,
    messages: u64,
    frames: u64,
    objects: usize,
}

impl Progress {
    /// A run that has not begun.
    pub(super) fn of(title: &str) -> Progress {
        Progress { title: plain(title), at_work: "nobody yet".into(), ..Progress::default() }
    }

    /// Takes a message in; gives the line that tells of it, if it is worth one.
    pub(super) fn take(&mut self, message: &Envelope<Message>) -> Option<String> {
        self.time_s = message.time_ns as f64 * 1e-9;
        self.messages += 1;
        self.at_work = match message.to {
            OUTSIDE => "nobody: the run has ended".into(),
            to => format!("{to}, with {}", message.body.kind()),
        };
        let (_, text) = words::line(&message.body);
        self.count(&message.body, &text);
        let told = words::worth_telling(&message.body);
        told.then(|| plain(&format!("{:>7.1} s  {:<12} {text}", self.time_s, message.body.kind())))
    }

    fn count(&mut self, message: &Message, text: &str) {
        match message {
            Message::Frame { .. } => self.frames += 1,
            Message::Updated { view, .. } | Message::Kept { view, .. } => self.objects = view.0.objects().len(),
            Message::Parsed { task: Ok(task), .. } => {
                self.subtasks = task.subtasks.iter().map(|subtask| subtask.text.clone()).collect();
                (self.subtask, self.step) = (0, None);
            }
            Message::Decide { situation, .. } => {
                self.budget = Some((situation.deadline.seconds(), situation.skills_left));
            }
            Message::Decided { decision, .. } => {
                text.clone_into(&mut self.decided);
                match &**decision {
                    Decision::Act { step, .. } => {
                        self.steps += 1;
                        (self.subtask, self.step) = (step.subtask as usize, Some((step.to_string(), "decided")));
                    }
                    Decision::SubtaskDone { index, .. } => {
                        (self.subtask, self.step) = (*index as usize + 1, None);
                    }
                    Decision::Look { .. } | Decision::Done { .. } | Decision::GiveUp { .. } => {}
                }
            }
            Message::Execute(_) => self.becomes("running"),
            Message::SkillEnded(report) if report.failure.is_some() => self.becomes("failed"),
            Message::SkillEnded(_) => self.becomes("ended, not yet verified"),
            Message::Verdict { verdict, .. } => self.becomes(match verdict.outcome {
                acm_memory::observation::Outcome::Verified => "verified",
                acm_memory::observation::Outcome::Contradicted => "contradicted",
                acm_memory::observation::Outcome::CannotTell => "cannot be told",
            }),
            _ => {}
        }
    }

    fn becomes(&mut self, state: &'static str) {
        if let Some((_, was)) = &mut self.step {
            *was = state;
        }
    }

    /// The run in a few lines.
    pub(super) fn lines(&self) -> Vec<String> {
        let left = self.budget.map_or_else(String::new, |(deadline_s, skills)| {
            format!(", {:.1} s and {skills} skills left", (deadline_s - self.time_s).max(0.0))
        });
        let subtask = match self.subtasks.get(self.subtask) {
            Some(text) => format!("{} of {}: {text}", self.subtask + 1, self.subtasks.len()),
            None if self.subtasks.is_empty() => "none yet".into(),
            None => format!("all {} done", self.subtasks.len()),
        };
        let step = self.step.as_ref().map_or_else(
            || format!("{} so far", self.steps),
            |(step, state)| format!("{}: {step}, {state}", self.steps),
        );
        let decided = if self.decided.is_empty() { "nothing yet" } else { &self.decided };
        let lines = [
            self.title.clone(),
            format!("  time      {:.1} s{left}", self.time_s),
            format!("  at work   {}", self.at_work),
            format!("  subtask   {subtask}"),
            format!("  step      {step}"),
            format!("  decided   {decided}"),
            format!("  so far    {} messages, {} frames, {} objects known", self.messages, self.frames, self.objects),
        ];
        lines.iter().map(|line| plain(line)).collect()
    }
}

/// A text that moves no cursor: an instruction or a name may hold anything.
pub(super) fn plain(text: &str) -> String {
    text.chars().map(|sign| if sign.is_control() { ' ' } else { sign }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_actors::message::{EPISODE, EXECUTOR, HOST, PLANNER};
    use acm_concept::embodiment::Feedback;
    use acm_runtime::envelope::Role;

    fn sent(to: Role, time_ns: u64, body: Message) -> Envelope<Message> {
        Envelope { seq: 1, cause: None, episode: 1, from: EPISODE, to, time_ns, body }
    }

    #[test]
    fn ticks_are_counted_and_not_told() {
        let mut progress = Progress::of("tidy seed 3");
        assert_eq!(progress.take(&sent(EXECUTOR, 2_000_000_000, Message::Moved(Feedback::default()))), None);
        let refused = Message::Refused { reason: "too far".into(), fatal: false };
        let told = progress.take(&sent(EXECUTOR, 2_500_000_000, refused));
        assert_eq!(told.as_deref(), Some("    2.5 s  refused      refused: too far"));
        assert_eq!(progress.take(&sent(HOST, 3_000_000_000, Message::Sense)), None);
        let lines = progress.lines();
        assert_eq!(lines[..3], ["tidy seed 3", "  time      3.0 s", "  at work   host, with sense"]);
        assert_eq!(lines[6], "  so far    3 messages, 0 frames, 0 objects known");
    }

    #[test]
    fn no_text_of_a_run_moves_the_cursor() {
        let mut progress = Progress::of("tidy\u{1b}[2J");
        let told = progress.take(&sent(PLANNER, 0, Message::Parse { instruction: "put\u{1b}[31m\r\nit".into() }));
        let told = told.unwrap_or_default();
        assert!(told.contains("put [31m  it"), "{told}");
        assert!(progress.lines().iter().chain([&told]).all(|line| !line.contains(|sign: char| sign.is_control())));
    }
}
