//! The planner as the agent uses it.

use crate::{
    bind::{self, BindError},
    counsel::Avoided,
    decide,
    decision::{Decision, PlanOptions, Situation, Step},
    hybrid::{self, TaskPrompt},
    language::{self, ParseError},
    lexicon::{Lexicon, LexiconError},
    task::Task,
};
use acm_concept::{embodiment::RobotDescription, skill::SkillInvocation, template::TemplateLibrary};
use acm_memory::MemoryView;
use include_dir::{Dir, include_dir};
use std::collections::BTreeMap;

static LEXICON: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/lexicon");

/// The texts of the lexicon that ships inside the binary, by file name: what [`Lexicon::parse`] reads.
pub fn embedded_lexicon() -> BTreeMap<String, String> {
    let text =
        |file: &include_dir::File<'_>| Some((file.path().to_str()?.to_owned(), file.contents_utf8()?.to_owned()));
    LEXICON.files().filter_map(text).collect()
}

/// Turns language into goals and goals into the next step. It keeps nothing between calls: where the agent is
/// in its instruction, what it did and what it believes is read from memory each time, so a wiped memory wipes
/// progress too, and the same memory always gives the same decision.
///
/// ```
/// # use acm_planner::{Planner, Goal};
/// # use acm_concept::template::TemplateLibrary;
/// # let button = include_str!("../../../memory/library/button.toml");
/// let library = TemplateLibrary::parse([("button.toml", button)]).unwrap();
/// let task = Planner::new().unwrap().parse("Press the button twice.", &library).unwrap();
/// assert!(matches!(task.subtasks[0].goal, Goal::Performed { times: 2, .. }));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Planner {
    lexicon: Lexicon,
}

impl Planner {
    /// A planner with the lexicon that ships inside the binary.
    pub fn new() -> Result<Planner, LexiconError> {
        Ok(Planner::with_lexicon(Lexicon::parse(&embedded_lexicon())?))
    }
    /// A planner with another lexicon.
    pub fn with_lexicon(lexicon: Lexicon) -> Planner {
        Planner { lexicon }
    }
    /// Reads an instruction. Nouns are those of the library's synopses. What cannot be read is an error that names
    /// the span; nothing is guessed.
    pub fn parse(&self, instruction: &str, library: &TemplateLibrary) -> Result<Task, ParseError> {
        language::parse(&self.lexicon, library, instruction)
    }
    /// What a language model is asked in order to read an instruction.
    ///
    /// # Errors
    /// The instruction is empty or too long: no model is asked then.
    pub fn prompt(&self, instruction: &str, library: &TemplateLibrary) -> Result<TaskPrompt, ParseError> {
        hybrid::prompt(&self.lexicon, library, instruction)
    }
    /// The task that a model's answer to [`Planner::prompt`] stands for; else what in it does not fit the instruction
    /// or the library.
    pub fn understand(
        &self,
        instruction: &str,
        library: &TemplateLibrary,
        answer: &serde_json::Value,
    ) -> Result<Task, Vec<String>> {
        hybrid::understand(&self.lexicon, library, instruction, answer)
    }
    /// The answer that stands for a task.
    pub fn answer(&self, task: &Task) -> hybrid::TaskForm {
        hybrid::TaskForm::new(&self.lexicon, task)
    }
    /// The next step of a task as memory stands.
    pub fn decide(&self, task: &Task, view: &dyn MemoryView, situation: &Situation, options: &PlanOptions) -> Decision {
        self.decide_without(task, view, situation, options, &[])
    }
    /// The same, with some skills on some objects left out.
    pub(crate) fn decide_without(
        &self,
        task: &Task,
        view: &dyn MemoryView,
        situation: &Situation,
        options: &PlanOptions,
        avoided: &[Avoided],
    ) -> Decision {
        decide::decide(&self.lexicon, task, view, situation, options, avoided)
    }
    /// Binds a step to the perceived geometry of its part.
    pub fn bind(
        &self,
        step: &Step,
        view: &dyn MemoryView,
        robot: &RobotDescription,
    ) -> Result<SkillInvocation, BindError> {
        bind::bind(step, view, robot)
    }
}
