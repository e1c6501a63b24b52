//! The planner actor: reads the instruction and decides what to do next.
//!
//! With a language model (mode `hybrid`) the model reads the instruction: it is asked for goals in a fixed form, its
//! answer is checked, and what stays wrong is read by the rules, which is said. All that follows is the same planner. Only
//! while the model is asked does the actor keep anything between messages: the question under way, one at a time.

use crate::{
    message::{EPISODE, LLM, Message},
    report::Reading,
    settings::Turning,
};
use acm_concept::{embodiment::RobotDescription, template::TemplateLibrary};
use acm_llm::{Answer, ChatRequest, Dialogue, Next, Parameters, PromptId, Turn};
use acm_planner::{Decision, GiveUpCause, Grounds, PlanOptions, Planner, Unknown};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
};
use std::sync::Arc;

/// How often a wrong answer goes back to the model.
const MAX_REPAIRS: u32 = 2;

/// The planner actor.
pub struct PlannerActor {
    planner: Arc<Planner>,
    library: Arc<TemplateLibrary>,
    robot: RobotDescription,
    options: Turning<PlanOptions>,
    /// Whether a language model reads the instruction.
    hybrid: bool,
    asked: Option<Asked>,
}

/// An instruction about which the model is being asked.
struct Asked {
    instruction: String,
    dialogue: Dialogue,
}

impl PlannerActor {
    /// An actor that decides with `planner`.
    pub fn new(
        planner: Arc<Planner>,
        library: Arc<TemplateLibrary>,
        robot: RobotDescription,
        options: Turning<PlanOptions>,
    ) -> PlannerActor {
        PlannerActor { planner, library, robot, options, hybrid: false, asked: None }
    }

    /// Lets a language model read the instruction.
    pub fn hybrid(self, hybrid: bool) -> PlannerActor {
        PlannerActor { hybrid, ..self }
    }

    fn read(&mut self, instruction: String, outbox: &mut Outbox<Message>) {
        // A question that was under way is lost with the actor that was to answer it.
        self.asked = None;
        if !self.hybrid {
            return outbox.send(EPISODE, self.by_rules(&instruction, None));
        }
        match self.question(&instruction) {
            Ok(dialogue) => self.ask(Asked { instruction, dialogue }, outbox),
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
        let request = ChatRequest {
            stage: "parse".into(),
            prompt: PromptId { id: prompt.id, version: prompt.version },
            system: prompt.system,
            turns: vec![Turn::user(prompt.user)],
            schema: prompt.schema,
            parameters: Parameters { max_output_tokens: prompt.max_output_tokens },
        };
        Dialogue::new(request, MAX_REPAIRS).map_err(|error| error.to_string())
    }

    fn ask(&mut self, asked: Asked, outbox: &mut Outbox<Message>) {
        outbox.send(LLM, Message::AskLlm { request: Box::new(asked.dialogue.request().clone()) });
        self.asked = Some(asked);
    }

    fn replied(&mut self, answer: &Answer, outbox: &mut Outbox<Message>) {
        // An answer that nobody waits for any more: the question was asked anew since.
        let Some(mut asked) = self.asked.take() else { return };
        let next = asked.dialogue.take(answer, |json| self.planner.understand(&asked.instruction, &self.library, json));
        let (task, fallback) = match next {
            Next::Ask => return self.ask(asked, outbox),
            Next::Accepted(task) => (Some(task), None),
            Next::GaveUp(reason) => (None, Some(reason)),
        };
        let dialogue = &asked.dialogue;
        let reading = Reading {
            calls: dialogue.calls(),
            answered_by: dialogue.answered_by().map(|(backend, model)| (backend.into(), model.into())),
            usage: dialogue.usage(),
            faults: dialogue.faults().to_vec(),
            fallback,
        };
        let parsed = match task {
            Some(task) => Message::Parsed { task: Ok(Arc::new(task)), reading: Some(Box::new(reading)) },
            None => self.by_rules(&asked.instruction, Some(reading)),
        };
        outbox.send(EPISODE, parsed);
    }
}

impl Core<Message> for PlannerActor {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        let answer = match message.body {
            Message::Parse { instruction } => {
                self.read(instruction, outbox);
                return Ok(());
            }
            Message::LlmReplied(answer) => {
                self.replied(&answer, outbox);
                return Ok(());
            }
            Message::Decide { task, situation, view } => {
                let decision = self.planner.decide(&task, &*view.0, &situation, self.options.now());
                match &decision {
                    Decision::Act { step, .. } => match self.planner.bind(step, &*view.0, &self.robot) {
                        Ok(invocation) => {
                            Message::Decided { decision: Box::new(decision), invocation: Some(Box::new(invocation)) }
                        }
                        Err(error) => {
                            let unknown = Unknown { cause: GiveUpCause::Plan, text: error.to_string() };
                            let grounds = Grounds::default();
                            let decision = Box::new(Decision::GiveUp { unknown, grounds });
                            Message::Decided { decision, invocation: None }
                        }
                    },
                    _ => Message::Decided { decision: Box::new(decision), invocation: None },
                }
            }
            other => return Err(CoreError(format!("planner cannot handle {other:?}"))),
        };
        outbox.send(EPISODE, answer);
        Ok(())
    }

    fn state(&self) -> Option<String> {
        // Without a model it keeps nothing.
        self.hybrid.then_some(())?;
        let asked = self.asked.as_ref().map(|asked| {
            let (calls, faults) = (asked.dialogue.calls(), asked.dialogue.faults());
            serde_json::json!({ "instruction": asked.instruction, "calls": calls, "faults": faults })
        });
        Some(serde_json::json!({ "asks_the_model": asked }).to_string())
    }
}
