//! The planner actor: reads the instruction and decides what to do next. It keeps nothing between messages.

use crate::{
    message::{EPISODE, Message},
    settings::Turning,
};
use acm_concept::{embodiment::RobotDescription, template::TemplateLibrary};
use acm_planner::{Decision, GiveUpCause, Grounds, PlanOptions, Planner, Unknown};
use acm_runtime::{
    core::{Core, CoreError, Outbox},
    envelope::Envelope,
};
use std::sync::Arc;

/// The planner actor.
pub struct PlannerActor {
    planner: Arc<Planner>,
    library: Arc<TemplateLibrary>,
    robot: RobotDescription,
    options: Turning<PlanOptions>,
}

impl PlannerActor {
    /// An actor that decides with `planner`.
    pub fn new(
        planner: Arc<Planner>,
        library: Arc<TemplateLibrary>,
        robot: RobotDescription,
        options: Turning<PlanOptions>,
    ) -> PlannerActor {
        PlannerActor { planner, library, robot, options }
    }
}

impl Core<Message> for PlannerActor {
    fn handle(&mut self, message: Envelope<Message>, outbox: &mut Outbox<Message>) -> Result<(), CoreError> {
        let answer = match message.body {
            Message::Parse { instruction } => {
                let task = self.planner.parse(&instruction, &self.library);
                Message::Parsed(task.map(Arc::new).map_err(|error| error.to_string()))
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
}
