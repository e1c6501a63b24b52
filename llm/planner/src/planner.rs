//! The planner as the agent uses it.

use crate::{
    bind::{self, BindError},
    counsel::Avoided,
    decide,
    decision::{Decision, PlanOptions, Situation, Step, Unknown},
    ground::Grounder,
    hybrid::{self, TaskPrompt},
    language::{self, ParseError},
    lexicon::{Lexicon, LexiconError},
    task::{ReferenceIndex, Task},
};
use acm_concept::{
    embodiment::RobotDescription,
    ids::{ObjectId, PartId},
    skill::SkillInvocation,
    template::TemplateLibrary,
};
use acm_memory::MemoryView;
use include_dir::{Dir, include_dir};
use std::collections::{BTreeMap, BTreeSet};

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
/// # use acm_planner::{Planner, Goal, Times};
/// # use acm_concept::template::TemplateLibrary;
/// # let button = include_str!("../../../memory/library/button.toml");
/// let library = TemplateLibrary::parse([("button.toml", button)]).unwrap();
/// let task = Planner::new().unwrap().parse("Press the button twice.", &library).unwrap();
/// assert!(matches!(task.subtasks[0].goal, Goal::Performed { times: Times::Count(2), .. }));
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
    /// The names of the rules of language that the reading of an instruction rests on: verb frames, modifiers, kinds of
    /// phrases.
    ///
    /// # Errors
    /// The instruction cannot be read.
    pub fn rules(&self, instruction: &str, library: &TemplateLibrary) -> Result<BTreeSet<String>, ParseError> {
        language::rules(&self.lexicon, library, instruction)
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
    /// The object that a reference of a task means as memory stands, and the part of it where one is meant.
    ///
    /// # Errors
    /// Why no object, or more than one, fits.
    pub fn meant(
        &self,
        task: &Task,
        view: &dyn MemoryView,
        options: &PlanOptions,
        reference: ReferenceIndex,
    ) -> Result<(ObjectId, Option<PartId>), Unknown> {
        let grounder = Grounder::new(&self.lexicon, task, view, options, false);
        let object = grounder.object(reference).map_err(|stuck| stuck.unknown)?;
        let part = grounder.part(reference).map_err(|stuck| stuck.unknown)?;
        Ok((object.value, part))
    }
    /// What it knows of language.
    pub fn lexicon(&self) -> &Lexicon {
        &self.lexicon
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
