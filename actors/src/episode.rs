//! The closed loop (the paper's Algorithm 1) as one actor: look, decide, act, verify, write back.

mod asked;
mod state;

use crate::{
    message::{EXECUTOR, HOST, MEMORY, Message, PLANNER, VERIFIER, View},
    report::{Ending, EpisodeReport, StepRecord},
};
use acm_concept::{
    embodiment::Feedback,
    ids::TransitionId,
    skill::{FailureCause, SkillInvocation, SkillReport},
    task::TaskSpec,
    time::Time,
};
use acm_memory::observation::{Executed, Grounding, Note, Outcome, Verdict};
use acm_planner::{Decision, GiveUpCause, Situation, Step};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::{Envelope, OUTSIDE},
};
use asked::Asked;
use state::{Doing, Pending};
pub use state::{FaultEvent, ParseEventError, Until, Upheavals};

/// How many frames may be taken to decide one verification.
const MAX_VERIFY_LOOKS: u32 = 2;
/// Seconds between two looks at an unchanged scene, so that noise and motion differ.
const LOOK_PAUSE_S: f64 = 0.2;
/// Seconds between two frames while the agent watches before its instruction (10 Hz).
const WATCH_PAUSE_S: f64 = 0.1;
/// How many failed actors an episode survives.
const MAX_RESTARTS: u32 = 4;

/// The episode loop's core.
pub struct Episode {
    asked: Asked,
    upheavals: Upheavals,
    until: Option<Until>,
    doing: Doing,
    task: Option<std::sync::Arc<acm_planner::Task>>,
    view: Option<View>,
    feedback: Option<Feedback>,
    /// Looks taken in a row without acting.
    looks: u32,
    /// The skill that is being run, with the step behind it.
    step: Option<(Step, Box<SkillInvocation>)>,
    /// The transition that waits for its verdict.
    pending: Option<Pending>,
    report: EpisodeReport,
}

impl Episode {
    /// An episode of the given task, with what is to befall memory.
    pub fn new(task_spec: TaskSpec, upheavals: Upheavals) -> Episode {
        Episode {
            asked: Asked::new(task_spec),
            upheavals,
            until: None,
            doing: Doing::Starting,
            task: None,
            view: None,
            feedback: None,
            looks: 0,
            step: None,
            pending: None,
            report: EpisodeReport {
                ending: Ending::Interrupted,
                steps: Vec::new(),
                instructions_done: 0,
                subtasks_done: 0,
                subtasks: 0,
                frames_perceived: 0,
                ended: Time::ZERO,
                restarts: 0,
                readings: Vec::new(),
                counsels: Vec::new(),
            },
        }
    }

    /// Ends the run at an event instead of going on.
    pub fn until(mut self, until: Option<Until>) -> Episode {
        self.until = until;
        self
    }

    fn dispatch(&mut self, message: Message, out: &mut Outbox<Message>) -> Result<(), CoreError> {
        match message {
            Message::Begin => self.send(Doing::Beginning, MEMORY, Message::Note(Note::EpisodeBegan), out),
            Message::Interrupt => self.end(Ending::Interrupted, out),
            Message::Broken { reason } => self.end(Ending::Broken { reason }, out),
            Message::ActorFailed { role, reason, restarted } => self.recover(role, reason, restarted, out),
            Message::Waited => self.look("time has passed", out),
            Message::Retreated { failure } => self.retreated(failure, out),
            Message::Updated { feedback, view, grounding, .. } => self.updated(feedback, view, &grounding, out),
            Message::Parsed { task, reading } => {
                self.report.readings.extend(reading.map(|reading| *reading));
                self.parsed(task, out);
            }
            Message::Decided { decision, invocation, counsel } => {
                self.report.counsels.extend(counsel.map(|counsel| *counsel));
                self.decided(*decision, invocation, out)?;
            }
            Message::SkillEnded(report) => self.skill_ended(report, out),
            Message::Kept { transition, view } => self.kept(transition, view, out),
            Message::Verdict { transition, verdict } => self.judged(transition, verdict, out),
            other => return Err(CoreError(format!("episode cannot handle {other:?}"))),
        }
        Ok(())
    }

    fn send(&mut self, doing: Doing, to: acm_runtime::envelope::Role, message: Message, out: &mut Outbox<Message>) {
        self.doing = doing;
        out.send(to, message);
    }

    fn end(&mut self, ending: Ending, out: &mut Outbox<Message>) {
        if self.doing == Doing::Ended {
            return;
        }
        self.report.ending = ending;
        self.report.ended = Time(out.time_ns());
        self.report.subtasks_done = self.view.as_ref().map_or(0, |view| view.0.progress().current());
        let report = Box::new(self.report.clone());
        self.send(Doing::Ended, OUTSIDE, Message::Ended(report), out);
    }

    fn give_up(&mut self, cause: GiveUpCause, unknown: String, out: &mut Outbox<Message>) {
        self.end(Ending::GaveUp { cause, unknown }, out);
    }

    // --- looking -----------------------------------------------------------------------------------------------

    /// Clears the camera's view, then takes a frame into account.
    fn look(&mut self, reason: &str, out: &mut Outbox<Message>) {
        // Before an instruction nothing is asked that could use a budget up.
        if self.asked.frames_left(self.report.frames_perceived) == 0 {
            let frames = self.asked.frames();
            return self.give_up(GiveUpCause::Budget, format!("the budget of {frames} frames is used up"), out);
        }
        let nouns = self.task.as_ref().map(|task| task.nouns.clone()).unwrap_or_default();
        self.send(Doing::Looking, MEMORY, Message::Look { reason: reason.into(), nouns }, out);
    }

    fn retreated(&mut self, failure: Option<String>, out: &mut Outbox<Message>) {
        // A hand that could not be brought home may hide something; looking is still better than not looking.
        let reason = failure.map_or("the hand is out of the way".into(), |f| format!("the hand may be in view: {f}"));
        self.look(&reason, out);
    }

    fn updated(&mut self, feedback: Feedback, view: View, _: &Grounding, out: &mut Outbox<Message>) {
        self.report.frames_perceived += 1;
        (self.feedback, self.view) = (Some(feedback), Some(view));
        if !self.instruction_is_due(out) {
            return self.send(Doing::Waiting, HOST, Message::Wait { seconds: WATCH_PAUSE_S }, out);
        }
        if self.task.is_none() {
            return self.parse(out);
        }
        match self.pending.is_some() {
            true => self.verify(out),
            false => self.decide(out),
        }
    }

    // --- understanding ------------------------------------------------------------------------------------------

    fn instruction_is_due(&self, out: &Outbox<Message>) -> bool {
        self.asked.is_due(Time(out.time_ns()))
    }

    fn parse(&mut self, out: &mut Outbox<Message>) {
        if let Some(event @ Until::Instruction) = self.until {
            return self.end(Ending::Until { event }, out);
        }
        let instruction = self.asked.text().to_owned();
        self.send(Doing::Parsing, PLANNER, Message::Parse { instruction }, out);
    }

    fn parsed(&mut self, task: Result<std::sync::Arc<acm_planner::Task>, String>, out: &mut Outbox<Message>) {
        match task {
            Err(reason) => self.end(Ending::NotUnderstood { reason }, out),
            Ok(task) => {
                self.report.subtasks = task.subtasks.len() as u32;
                self.task = Some(task);
                self.instruct(out);
            }
        }
    }

    fn instruct(&mut self, out: &mut Outbox<Message>) {
        let (time, text) = (Time(out.time_ns()), self.asked.text().to_owned());
        self.send(Doing::Instructing, MEMORY, Message::Note(Note::Instructed { time, text }), out);
    }

    /// What was asked is done: the next instruction, or the end.
    fn instruction_done(&mut self, out: &mut Outbox<Message>) {
        let used = (self.report.frames_perceived, self.report.steps.len() as u32);
        self.report.instructions_done = self.asked.done_before() + 1;
        if !self.asked.go_on(Time(out.time_ns()), used) {
            return self.end(Ending::Done, out);
        }
        (self.task, self.looks) = (None, 0);
        self.clear_view(out);
    }

    // --- deciding -----------------------------------------------------------------------------------------------

    fn decide(&mut self, out: &mut Outbox<Message>) {
        let (Some(task), Some(view), Some(feedback)) = (self.task.clone(), self.view.clone(), self.feedback.clone())
        else {
            return self.look("nothing has been seen yet", out);
        };
        let situation = Box::new(Situation {
            time: Time(out.time_ns()),
            feedback,
            looks: self.looks,
            deadline: self.asked.deadline(),
            skills_left: self.asked.skills_left(self.report.steps.len() as u32),
        });
        self.send(Doing::Deciding, PLANNER, Message::Decide { task, situation, view }, out);
    }

    fn decided(
        &mut self,
        decision: Decision,
        invocation: Option<Box<SkillInvocation>>,
        out: &mut Outbox<Message>,
    ) -> Result<(), CoreError> {
        match decision {
            Decision::Act { step, explanation } => {
                let invocation = invocation.ok_or_else(|| CoreError("an action without a bound skill".into()))?;
                self.looks = 0;
                self.report.steps.push(StepRecord {
                    subtask: step.subtask,
                    skill: invocation.skill.clone(),
                    object: invocation.part.object,
                    attempt: step.attempt,
                    guessed: step.guessed,
                    ended: Time::ZERO,
                    failure: None,
                    outcome: None,
                    entries_scored: explanation
                        .references
                        .iter()
                        .filter_map(|r| r.retrieval.as_ref())
                        .map(|r| r.scored)
                        .sum(),
                    candidates_inspected: explanation.candidates_inspected,
                });
                self.step = Some((step, invocation.clone()));
                self.send(Doing::Executing, EXECUTOR, Message::Execute(invocation), out);
            }
            Decision::Look { .. } => {
                self.looks += 1;
                self.clear_view(out);
            }
            Decision::SubtaskDone { index, .. } => {
                let note = Note::SubtaskDone { time: Time(out.time_ns()), index };
                self.send(Doing::Noting, MEMORY, Message::Note(note), out);
            }
            Decision::Done { .. } => self.instruction_done(out),
            Decision::GiveUp { unknown, .. } => self.give_up(unknown.cause, unknown.text, out),
        }
        Ok(())
    }

    /// Before a repeated look: the hand goes home; a hand that is home stays, and only time passes.
    fn clear_view(&mut self, out: &mut Outbox<Message>) {
        if self.report.steps.is_empty() {
            return self.send(Doing::Waiting, HOST, Message::Wait { seconds: LOOK_PAUSE_S }, out);
        }
        self.send(Doing::Retreating, EXECUTOR, Message::Retreat, out);
    }

    // --- acting and verifying -----------------------------------------------------------------------------------

    fn skill_ended(&mut self, report: Box<SkillReport>, out: &mut Outbox<Message>) {
        let Some((step, _)) = self.step.take() else { return self.look("a skill ended that nobody waits for", out) };
        if let Some(record) = self.report.steps.last_mut() {
            (record.ended, record.failure) = (report.ended, report.failure.clone());
        }
        let predicted = step.prediction.effects.iter().map(|(literal, _)| literal.clone()).collect();
        let executed = Executed { report: *report, subtask: Some(step.subtask), predicted };
        self.pending = Some(Pending { transition: None, executed: executed.clone(), looks: 0 });
        self.send(Doing::Recording, MEMORY, Message::Record(Box::new(executed)), out);
    }

    fn verify(&mut self, out: &mut Outbox<Message>) {
        let (Some(pending), Some(view)) = (&self.pending, self.view.clone()) else { return self.decide(out) };
        let Some(transition) = pending.transition else { return self.decide(out) };
        let (predicted, report) = (pending.executed.predicted.clone(), Box::new(pending.executed.report.clone()));
        self.send(Doing::Verifying, VERIFIER, Message::Verify { transition, predicted, report, view }, out);
    }

    fn judged(&mut self, transition: TransitionId, verdict: Verdict, out: &mut Outbox<Message>) {
        if let (Outcome::CannotTell, Some(pending)) = (verdict.outcome, &mut self.pending)
            && pending.looks < MAX_VERIFY_LOOKS
        {
            pending.looks += 1;
            return self.clear_view(out);
        }
        if let Some(record) = self.report.steps.last_mut() {
            record.outcome = Some(verdict.outcome);
        }
        self.send(Doing::Settling(verdict.outcome), MEMORY, Message::Settle { transition, verdict }, out);
    }

    /// Memory has kept something: go on from where that was asked for.
    fn kept(&mut self, transition: Option<TransitionId>, view: View, out: &mut Outbox<Message>) {
        self.view = Some(view);
        match self.doing {
            Doing::Beginning if self.instruction_is_due(out) => {
                // Who joins a world after that moment is told now, and has the whole budget from now on.
                self.asked.begins_late(Time(out.time_ns()));
                self.parse(out);
            }
            Doing::Beginning => self.look("watching before the instruction", out),
            Doing::Instructing => {
                if !self.upheaval(&FaultEvent::Instruction, out) {
                    self.look("the instruction was given", out);
                }
            }
            Doing::Noting => self.decide(out),
            Doing::Recording => {
                if let Some(pending) = &mut self.pending {
                    pending.transition = transition;
                }
                self.verify(out);
            }
            Doing::Settling(outcome) => self.settled(outcome, out),
            Doing::Wiping => self.instruct(out),
            Doing::Transplanting => self.send(Doing::Wiping, MEMORY, Message::Note(Note::EpisodeBegan), out),
            _ => self.look("memory kept something", out),
        }
    }

    fn settled(&mut self, outcome: Outcome, out: &mut Outbox<Message>) {
        let pending = self.pending.take();
        let looked = pending.as_ref().is_some_and(|p| p.looks > 0);
        if let (Outcome::Verified, Some(pending)) = (outcome, &pending) {
            let event = FaultEvent::FirstVerified(pending.executed.report.invocation.skill.clone());
            if self.upheaval(&event, out) {
                return;
            }
        }
        // After a contradiction the world is not as believed: look before deciding, unless a look showed it.
        match outcome == Outcome::Contradicted && !looked {
            true => self.clear_view(out),
            false => self.decide(out),
        }
    }

    // --- faults -------------------------------------------------------------------------------------------------

    /// Lets happen to memory what is to happen at an event; tells whether anything is. But for the task's text the agent
    /// goes on with nothing else than what memory holds then.
    fn upheaval(&mut self, event: &FaultEvent, out: &mut Outbox<Message>) -> bool {
        let (doing, fault) = if self.upheavals.wipe_at.take_if(|at| at == event).is_some() {
            (Doing::Wiping, Message::Wipe)
        } else if self.upheavals.transplant_at.take_if(|at| at == event).is_some() {
            (Doing::Transplanting, Message::Transplant)
        } else {
            return false;
        };
        (self.looks, self.step, self.pending) = (0, None, None);
        self.send(doing, MEMORY, fault, out);
        true
    }

    /// An actor failed: what it was doing is lost; memory is not. A skill that was running counts as failed.
    fn recover(&mut self, role: &str, reason: String, restarted: bool, out: &mut Outbox<Message>) {
        self.report.restarts += 1;
        if !restarted || self.report.restarts > MAX_RESTARTS {
            return self.end(Ending::Broken { reason: format!("the {role} actor failed: {reason}") }, out);
        }
        if let (Doing::Executing, Some((_, invocation))) = (&self.doing, &self.step) {
            let failure = Some((FailureCause::Motion, format!("the {role} actor failed while the skill ran")));
            let report = state::lost_report(invocation.clone(), failure, Time(out.time_ns()));
            return self.skill_ended(Box::new(report), out);
        }
        match (&self.doing, &self.task) {
            _ if !self.instruction_is_due(out) => self.look("an actor was restarted", out),
            (Doing::Beginning | Doing::Parsing | Doing::Instructing, _) | (_, None) => self.parse(out),
            _ => self.look("an actor was restarted", out),
        }
    }
}

impl Core<Message> for Episode {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        if self.doing == Doing::Ended {
            return Ok(());
        }
        self.dispatch(message.body, outbox)
    }

    fn state(&self) -> Option<String> {
        let pending = self
            .pending
            .as_ref()
            .map(|pending| serde_json::json!({ "transition": pending.transition, "looks": pending.looks }));
        let state = serde_json::json!({
            "waits_for": format!("{:?}", self.doing).to_lowercase(),
            "looks": self.looks,
            "frames_perceived": self.report.frames_perceived,
            "steps": self.report.steps.len(),
            "step": self.step.as_ref().map(|(step, _)| step.to_string()),
            "to_be_verified": pending,
            "subtasks": self.task.as_ref().map(|task| task.subtasks.len()),
            "restarts": self.report.restarts,
        });
        Some(state.to_string())
    }
}

#[cfg(test)]
mod tests;
