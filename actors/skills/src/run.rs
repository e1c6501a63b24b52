//! Performs a function primitive by primitive, keeps every loop bounded, and writes the report.

use crate::{
    controller::{Controller, Tick},
    hand::Hand,
    motion::{Pace, Path},
    primitives::{Failure, Outcome, Primitive, Step},
};
use acm_concept::{
    embodiment::Feedback,
    ids::ObjectId,
    literal::{Literal, Term},
    pose::Pose,
    skill::{FailureCause, PrimitiveReport, SkillInvocation, SkillReport},
    time::Time,
};
use std::collections::BTreeMap;

/// Most primitives of one skill: a guard against a function that never ends.
const MAX_PRIMITIVES: usize = 16;
/// How sure the fingers are that they hold nothing.
const EMPTY_CONFIDENCE: f64 = 0.95;

/// A manipulation function: says which primitive comes next and what its outcome means.
pub(crate) trait Function: Send {
    /// The next primitive, given the outcome of the last one; `None` at the beginning.
    fn next(&mut self, hand: &Hand, feedback: &Feedback, last: Option<Outcome>, notes: &mut Notes) -> Next;
    /// The TCP height to which the hand withdraws after a failure, metres.
    fn withdraw_height_m(&self) -> f64;
    /// The object that is, or was to be, in the hand.
    fn object(&self) -> ObjectId;
}

/// What a function wants next.
pub(crate) enum Next {
    Begin(Box<dyn Primitive>),
    Done,
    Failed(Failure),
}

/// What goes into the report besides the primitives.
#[derive(Debug, Clone, Default)]
pub(crate) struct Notes {
    pub measured: BTreeMap<String, f64>,
    pub felt: Vec<(Literal, f64)>,
    pub left_at: Option<Pose>,
    pub held: Option<(ObjectId, Pose)>,
}

impl Notes {
    pub fn measure(&mut self, name: &str, value: f64) {
        self.measured.insert(name.into(), value);
    }
    pub fn feel(&mut self, literal: Literal, confidence: f64) {
        self.felt.push((literal, confidence));
    }
    /// The fingers hold the object, sitting in the hand like this.
    pub fn feel_held(&mut self, object: ObjectId, base_in_tcp: Pose, confidence: f64) {
        self.held = Some((object, base_in_tcp));
        self.feel(Literal::new("holding", vec![Term::Object(object)]), confidence);
        self.feel(Literal::new("hand-empty", vec![]).negate(), confidence);
    }
    /// The fingers hold nothing, in particular not the object.
    pub fn feel_empty(&mut self, object: ObjectId) {
        self.held = None;
        self.feel(Literal::new("holding", vec![Term::Object(object)]).negate(), EMPTY_CONFIDENCE);
        self.feel(Literal::new("hand-empty", vec![]), EMPTY_CONFIDENCE);
    }
}

struct Running {
    primitive: Box<dyn Primitive>,
    started: Time,
    ticks: u32,
    limit_ticks: u32,
}

/// The controller of a function.
pub(crate) struct Run<F> {
    invocation: SkillInvocation,
    hand: Hand,
    function: F,
    notes: Notes,
    running: Option<Running>,
    primitives: Vec<PrimitiveReport>,
    started: Option<Time>,
    failure: Option<(FailureCause, String)>,
    withdrawal: Option<Path>,
    report: Option<Box<SkillReport>>,
}

impl<F: Function> Run<F> {
    pub fn new(invocation: &SkillInvocation, hand: Hand, function: F) -> Run<F> {
        let held = invocation.held.as_ref().map(|(object, pose, _)| (*object, *pose));
        Run {
            invocation: invocation.clone(),
            hand,
            function,
            notes: Notes { held, ..Notes::default() },
            running: None,
            primitives: Vec::new(),
            started: None,
            failure: None,
            withdrawal: None,
            report: None,
        }
    }

    /// Runs the present primitive for a tick, and begins the next ones where it ends.
    fn advance(&mut self, feedback: &Feedback) -> Tick {
        let mut last = None;
        loop {
            if let Some(running) = &mut self.running {
                running.ticks += 1;
                let step = if running.ticks > running.limit_ticks {
                    let (kind, limit_s) = (running.primitive.kind(), running.primitive.limit_s());
                    let reason = format!("{kind} was not done after {limit_s:.1} s");
                    Step::Failed(Failure::new(FailureCause::Motion, reason))
                } else {
                    running.primitive.tick(&mut self.hand, feedback)
                };
                match step {
                    Step::Act => {
                        let command = self.hand.command();
                        match self.hand.fault() {
                            Some(reason) => return self.fail(feedback, Failure::new(FailureCause::Motion, reason)),
                            None => return Tick::Act(command),
                        }
                    }
                    Step::Done(outcome) => {
                        self.close_primitive(feedback, None);
                        last = Some(outcome);
                    }
                    Step::Failed(failure) => return self.fail(feedback, failure),
                }
            }
            match self.function.next(&self.hand, feedback, last, &mut self.notes) {
                Next::Done => return self.finish(feedback),
                Next::Failed(failure) => return self.fail(feedback, failure),
                Next::Begin(primitive) => {
                    if self.primitives.len() >= MAX_PRIMITIVES {
                        let reason = format!("the skill did not end within {MAX_PRIMITIVES} primitives");
                        return self.fail(feedback, Failure::new(FailureCause::Motion, reason));
                    }
                    let limit_ticks = self.hand.ticks(primitive.limit_s());
                    self.running = Some(Running { primitive, started: feedback.time, ticks: 0, limit_ticks });
                }
            }
        }
    }

    fn close_primitive(&mut self, feedback: &Feedback, failure: Option<String>) {
        if let Some(running) = self.running.take() {
            let (primitive, started) = (running.primitive.kind(), running.started);
            self.primitives.push(PrimitiveReport { primitive, started, ended: feedback.time, failure });
        }
    }

    fn fail(&mut self, feedback: &Feedback, failure: Failure) -> Tick {
        self.close_primitive(feedback, Some(failure.reason.clone()));
        if failure.empty_handed {
            self.hand.command.vacuum = false;
            self.notes.feel_empty(self.function.object());
        }
        self.failure = Some((failure.cause, failure.reason));
        let (from, robot) = (self.hand.command.tcp, &self.hand.robot);
        let height_m = self.function.withdraw_height_m().min(robot.workspace_max.z).max(from.translation.z);
        self.withdrawal = Some(Path::vertical(from, height_m, Pace::carrying(robot), robot.tick_s));
        self.withdraw(feedback)
    }

    /// Straight up, with the fingers as they are and whatever is felt; as long as the path, and no longer.
    fn withdraw(&mut self, feedback: &Feedback) -> Tick {
        let flying = self.withdrawal.as_mut().is_some_and(|path| self.hand.follow(path));
        let command = self.hand.command();
        if flying && self.hand.fault().is_none() { Tick::Act(command) } else { self.finish(feedback) }
    }

    fn finish(&mut self, feedback: &Feedback) -> Tick {
        let report = Box::new(SkillReport {
            invocation: self.invocation.clone(),
            failure: self.failure.clone(),
            primitives: self.primitives.clone(),
            started: self.started.unwrap_or(feedback.time),
            ended: feedback.time,
            measured: self.notes.measured.clone(),
            felt: self.notes.felt.clone(),
            left_at: self.notes.left_at,
            held: self.notes.held,
        });
        self.report = Some(report.clone());
        Tick::Finished(report)
    }
}

impl<F: Function> Controller for Run<F> {
    fn tick(&mut self, feedback: &Feedback) -> Tick {
        if let Some(report) = &self.report {
            return Tick::Finished(report.clone());
        }
        self.started.get_or_insert(feedback.time);
        // At first another arm may have been the last to move.
        let feedback = feedback.of_arm(self.hand.command.arm).unwrap_or(feedback);
        self.hand.observe(feedback);
        if self.withdrawal.is_some() { self.withdraw(feedback) } else { self.advance(feedback) }
    }
}
