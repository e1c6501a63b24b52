//! The planner actor: reads the instruction and decides what to do next.
//!
//! With a language model (mode `hybrid`) the model reads the instruction: it is asked for goals in a fixed form, its
//! answer is checked, and what stays wrong is read by the rules, which is said. All that follows is the same planner. It may
//! also be asked which of several ways to take, and how to go on after a failure: the planner finds the ways, and where no
//! answer holds it takes its own, which is said too. Only while the model is asked does the actor keep anything between
//! messages: the question under way, one at a time.

use crate::{
    message::{EPISODE, LLM, Message, View},
    report::{Counsel, Reading},
    settings::{Stage, Turning},
};
use acm_concept::{embodiment::RobotDescription, template::TemplateLibrary};
use acm_llm::{Answer, ChatRequest, Dialogue, Next, Parameters, PromptId, Turn};
use acm_planner::{
    Choice, Decision, GiveUpCause, Grounds, PlanOptions, Planner, Question, Situation, Task, TaskPrompt, Unknown,
};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
};
use std::{collections::BTreeSet, sync::Arc};

/// How often a wrong answer goes back to the model.
const MAX_REPAIRS: u32 = 2;

/// The planner actor.
pub struct PlannerActor {
    planner: Arc<Planner>,
    library: Arc<TemplateLibrary>,
    robot: RobotDescription,
    options: Turning<PlanOptions>,
    /// What a language model is asked for.
    stages: BTreeSet<Stage>,
    /// Whether a wrong answer is asked for again, and replaced by the planner's own where it stays wrong.
    aided: bool,
    asked: Option<Asked>,
}

/// A question under way.
struct Asked {
    about: About,
    dialogue: Dialogue,
}

enum About {
    Instruction(String),
    /// A decision that is open, and what memory believed when it was.
    Choice(Box<Choice>, View),
}

impl PlannerActor {
    /// An actor that decides with `planner`.
    pub fn new(
        planner: Arc<Planner>,
        library: Arc<TemplateLibrary>,
        robot: RobotDescription,
        options: Turning<PlanOptions>,
    ) -> PlannerActor {
        PlannerActor { planner, library, robot, options, stages: BTreeSet::new(), aided: true, asked: None }
    }

    /// Asks a language model for these things.
    pub fn asking(self, stages: BTreeSet<Stage>) -> PlannerActor {
        PlannerActor { stages, ..self }
    }

    /// Leaves a model to itself if `false`: a wrong answer ends the instruction. To measure what the aid is worth.
    pub fn aided(self, aided: bool) -> PlannerActor {
        PlannerActor { aided, ..self }
    }

    fn read(&mut self, instruction: String, outbox: &mut Outbox<Message>) {
        // A question that was under way is lost with the actor that was to answer it.
        self.asked = None;
        if !self.stages.contains(&Stage::Parse) {
            return outbox.send(EPISODE, self.by_rules(&instruction, None));
        }
        match self.question(&instruction) {
            Ok(dialogue) => self.ask(Asked { about: About::Instruction(instruction), dialogue }, outbox),
            Err(reason) => {
                let reading = Reading { fallback: Some(reason), ..Reading::default() };
                outbox.send(EPISODE, self.by_rules(&instruction, Some(reading)));
            }
        }
    }

    fn by_rules(&self, instruction: &str, reading: Option<Reading>) -> Message {
        let task = self.planner.parse(instruction, &self.library);
        Message::Parsed { task: task.map(Arc::new).map_err(|e| e.to_string()), reading: reading.map(Box::new) }
    }

    fn question(&self, instruction: &str) -> Result<Dialogue, String> {
        let prompt = self.planner.prompt(instruction, &self.library).map_err(|error| error.to_string())?;
        self.dialogue(Stage::Parse.name(), prompt)
    }

    /// A question to a model.
    fn dialogue(&self, stage: &str, prompt: TaskPrompt) -> Result<Dialogue, String> {
        let request = ChatRequest {
            stage: stage.into(),
            prompt: PromptId { id: prompt.id, version: prompt.version },
            system: prompt.system,
            turns: vec![Turn::user(prompt.user)],
            schema: prompt.schema,
            parameters: Parameters { max_output_tokens: prompt.max_output_tokens },
        };
        Dialogue::new(request, if self.aided { MAX_REPAIRS } else { 0 }).map_err(|error| error.to_string())
    }

    fn ask(&mut self, asked: Asked, outbox: &mut Outbox<Message>) {
        outbox.send(LLM, Message::AskLlm { request: Box::new(asked.dialogue.request().clone()) });
        self.asked = Some(asked);
    }

    fn replied(&mut self, answer: &Answer, outbox: &mut Outbox<Message>) {
        // An answer that nobody waits for any more: the question was asked anew since.
        let Some(mut asked) = self.asked.take() else { return };
        let message = match &asked.about {
            About::Instruction(instruction) => {
                let next =
                    asked.dialogue.take(answer, |json| self.planner.understand(instruction, &self.library, json));
                let (task, fallback) = match next {
                    Next::Ask => return self.ask(asked, outbox),
                    Next::Accepted(task) => (Some(task), None),
                    Next::GaveUp(reason) => (None, Some(reason)),
                };
                let reading = how_asked(&asked.dialogue, fallback);
                match task {
                    Some(task) => Message::Parsed { task: Ok(Arc::new(task)), reading: Some(Box::new(reading)) },
                    None if self.aided => self.by_rules(instruction, Some(reading)),
                    None => {
                        let reason = reading.fallback.clone().unwrap_or_default();
                        Message::Parsed { task: Err(reason), reading: Some(Box::new(reading)) }
                    }
                }
            }
            About::Choice(choice, view) => {
                let stage = choice.question.stage();
                let next = asked.dialogue.take(answer, |json| choice.understand(json));
                let (decision, reason, fallback) = match next {
                    Next::Ask => return self.ask(asked, outbox),
                    Next::Accepted(chosen) => (chosen.decision, Some(chosen.reason), None),
                    Next::GaveUp(why) if self.aided => (choice.own(), None, Some(why)),
                    Next::GaveUp(why) => {
                        let unknown = Unknown { cause: GiveUpCause::Plan, text: why.clone() };
                        (Decision::GiveUp { unknown, grounds: Grounds::default() }, None, Some(why))
                    }
                };
                let counsel = Counsel { stage, asked: how_asked(&asked.dialogue, fallback), reason };
                self.decided(decision, view, Some(counsel))
            }
        };
        outbox.send(EPISODE, message);
    }

    fn decide(&mut self, task: &Task, situation: &Situation, view: View, outbox: &mut Outbox<Message>) {
        self.asked = None;
        let may_ask = |question| {
            self.stages.contains(match question {
                Question::Select => &Stage::Select,
                Question::Reflect => &Stage::Reflect,
            })
        };
        let options = self.options.now();
        if let Some(choice) = self.planner.choice(task, &*view.0, situation, options, may_ask) {
            match self.dialogue(choice.question.stage(), choice.prompt.clone()) {
                Ok(dialogue) => {
                    return self.ask(Asked { about: About::Choice(Box::new(choice), view), dialogue }, outbox);
                }
                Err(reason) => {
                    let asked = Reading { fallback: Some(reason), ..Reading::default() };
                    let counsel = Counsel { stage: choice.question.stage(), asked, reason: None };
                    return outbox.send(EPISODE, self.decided(choice.own(), &view, Some(counsel)));
                }
            }
        }
        let decision = self.planner.decide(task, &*view.0, situation, options);
        outbox.send(EPISODE, self.decided(decision, &view, None));
    }

    /// A decision, bound to what is perceived where it is to act.
    fn decided(&self, mut decision: Decision, view: &View, counsel: Option<Counsel>) -> Message {
        let counsel = counsel.map(Box::new);
        let mut invocation = None;
        if let Decision::Act { step, explanation } = &mut decision {
            explanation.notes.extend(counsel.iter().map(ToString::to_string));
            match self.planner.bind(step, &*view.0, &self.robot) {
                Ok(bound) => invocation = Some(Box::new(bound)),
                Err(error) => {
                    let unknown = Unknown { cause: GiveUpCause::Plan, text: error.to_string() };
                    decision = Decision::GiveUp { unknown, grounds: Grounds::default() };
                }
            }
        }
        Message::Decided { decision: Box::new(decision), invocation, counsel }
    }
}

fn how_asked(dialogue: &Dialogue, fallback: Option<String>) -> Reading {
    Reading {
        calls: dialogue.calls(),
        answered_by: dialogue.answered_by().map(|(backend, model)| (backend.into(), model.into())),
        usage: dialogue.usage(),
        faults: dialogue.faults().to_vec(),
        fallback,
    }
}

impl Core<Message> for PlannerActor {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        match message.body {
            Message::Parse { instruction } => self.read(instruction, outbox),
            Message::LlmReplied(answer) => self.replied(&answer, outbox),
            Message::Decide { task, situation, view } => self.decide(&task, &situation, view, outbox),
            other => return Err(CoreError(format!("planner cannot handle {other:?}"))),
        }
        Ok(())
    }

    fn state(&self) -> Option<String> {
        // Without a model it keeps nothing.
        (!self.stages.is_empty()).then_some(())?;
        let asked = self.asked.as_ref().map(|asked| {
            let (calls, faults) = (asked.dialogue.calls(), asked.dialogue.faults());
            match &asked.about {
                About::Instruction(instruction) => {
                    serde_json::json!({ "instruction": instruction, "calls": calls, "faults": faults })
                }
                About::Choice(choice, _) => {
                    serde_json::json!({ "stage": choice.question.stage(), "calls": calls, "faults": faults })
                }
            }
        });
        Some(serde_json::json!({ "asks_the_model": asked }).to_string())
    }
}
