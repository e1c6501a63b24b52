//! The executor actor: runs a skill's controller tick by tick against the host.

use crate::message::{EPISODE, HOST, Message};
use acm_concept::{
    embodiment::{Command, Feedback, RobotDescription},
    skill::{FailureCause, SkillInvocation, SkillReport},
};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
};
use acm_skills::{Controller, Retreat, RetreatTick, Tick};
use std::collections::BTreeMap;

/// Most ticks of one skill: 2 minutes at 50 Hz. A controller has limits of its own; this one guards against a bug.
const MAX_TICKS: u32 = 6000;

/// The executor actor.
pub struct ExecutorActor {
    robot: RobotDescription,
    work: Option<Work>,
}

/// What is being run.
struct Work {
    job: Job,
    running: Option<Running>,
    ticks: u32,
    began: Option<Feedback>,
}

enum Job {
    Skill(Box<SkillInvocation>),
    Retreat,
}

enum Running {
    Skill(Box<dyn Controller>),
    Retreat(Box<Retreat>),
}

impl Running {
    /// The next command, or the message that ends the job.
    fn tick(&mut self, feedback: &Feedback) -> Result<Command, Box<Message>> {
        match self {
            Running::Skill(controller) => match controller.tick(feedback) {
                Tick::Act(command) => Ok(command),
                Tick::Finished(report) => Err(Box::new(Message::SkillEnded(report))),
            },
            Running::Retreat(retreat) => match retreat.tick(feedback) {
                RetreatTick::Act(command) => Ok(command),
                RetreatTick::Finished(report) => Err(Box::new(Message::Retreated { failure: report.failure })),
            },
        }
    }
}

impl ExecutorActor {
    /// An actor that drives the given robot.
    pub fn new(robot: RobotDescription) -> ExecutorActor {
        ExecutorActor { robot, work: None }
    }

    fn tick(&mut self, feedback: Feedback, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        let Some(mut work) = self.work.take() else { return Err(CoreError("feedback without a skill".into())) };
        let mut running = match work.running.take() {
            Some(running) => running,
            None => {
                work.began = Some(feedback.clone());
                match self.start(&work.job, &feedback) {
                    Ok(running) => running,
                    Err(reason) => {
                        outbox.send(EPISODE, failed(work, &feedback, FailureCause::Motion, reason));
                        return Ok(());
                    }
                }
            }
        };
        work.ticks += 1;
        if work.ticks > MAX_TICKS {
            let reason = format!("the controller did not end within {MAX_TICKS} ticks");
            outbox.send(EPISODE, failed(work, &feedback, FailureCause::Motion, reason));
            return Ok(());
        }
        match running.tick(&feedback) {
            Ok(command) => {
                work.running = Some(running);
                self.work = Some(work);
                outbox.send(HOST, Message::Command(command));
            }
            Err(end) => outbox.send(EPISODE, *end),
        }
        Ok(())
    }

    fn start(&self, job: &Job, feedback: &Feedback) -> Result<Running, String> {
        match job {
            Job::Skill(invocation) => {
                let controller = acm_skills::start(invocation, &self.robot, feedback);
                controller.map(Running::Skill).map_err(|error| error.to_string())
            }
            Job::Retreat => Ok(Running::Retreat(Box::new(acm_skills::retreat(&self.robot, feedback)))),
        }
    }
}

impl Core<Message> for ExecutorActor {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        let job = match message.body {
            Message::Moved(feedback) => return self.tick(feedback, outbox),
            Message::Refused { reason, .. } => {
                let Some(work) = self.work.take() else { return Err(CoreError(reason)) };
                let Some(began) = work.began.clone() else { return Err(CoreError(reason)) };
                outbox.send(EPISODE, failed(work, &began, FailureCause::Motion, reason));
                return Ok(());
            }
            Message::Execute(invocation) => Job::Skill(invocation),
            Message::Retreat => Job::Retreat,
            other => return Err(CoreError(format!("executor cannot handle {other:?}"))),
        };
        self.work = Some(Work { job, running: None, ticks: 0, began: None });
        outbox.send(HOST, Message::Sense);
        Ok(())
    }

    fn state(&self) -> Option<String> {
        let job = self.work.as_ref().map(|work| match &work.job {
            Job::Skill(invocation) => format!("{} {}", invocation.skill, invocation.part),
            Job::Retreat => "retreat".to_owned(),
        });
        let ticks = self.work.as_ref().map(|work| work.ticks);
        Some(serde_json::json!({ "runs": job, "ticks": ticks }).to_string())
    }
}

/// The message that ends a job which its controller could not end.
fn failed(work: Work, feedback: &Feedback, cause: FailureCause, reason: String) -> Message {
    match work.job {
        Job::Retreat => Message::Retreated { failure: Some(reason) },
        Job::Skill(invocation) => Message::SkillEnded(Box::new(SkillReport {
            invocation: *invocation,
            failure: Some((cause, reason)),
            primitives: Vec::new(),
            started: work.began.map_or(feedback.time, |began| began.time),
            ended: feedback.time,
            measured: BTreeMap::new(),
            felt: Vec::new(),
            left_at: None,
            held: None,
        })),
    }
}
