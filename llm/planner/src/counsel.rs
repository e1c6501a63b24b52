//! Decisions about which a language model may be asked: which of several ways to take, and how to go on after a failure.
//!
//! The planner finds the ways, and its search has simulated each of them on what memory believes, so that whatever is
//! chosen can be carried out. The model chooses by name and gives a reason. Its texts and schemas are data in `prompts/`.

use crate::{
    decision::{Decision, GiveUpCause, PlanOptions, Situation, Step, Unknown},
    explanation::{Explanation, Grounds},
    hybrid::TaskPrompt,
    planner::Planner,
    prompt_file::{self, PromptFile},
    task::Task,
};
use acm_concept::ids::ObjectId;
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Transition, TransitionResult},
};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeSet;

/// Most ways that are offered.
const MAX_WAYS: usize = 4;
/// Most things and tries that a model is told of.
const MAX_TOLD: usize = 40;
/// Names of what may be done beside taking a way.
const LOOK: &str = "look";
const GIVE_UP: &str = "give-up";

/// A skill on an object that a decision leaves out, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Avoided {
    /// Skill name.
    pub skill: String,
    /// The object.
    pub object: ObjectId,
    /// Why.
    pub reason: String,
}

/// What a model may be asked about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// Which of several ways to take.
    Select,
    /// How to go on after a failure.
    Reflect,
}

impl Question {
    /// The stage's name.
    pub fn stage(self) -> &'static str {
        match self {
            Question::Select => "select",
            Question::Reflect => "reflect",
        }
    }
}

/// A decision that is open: the ways there are, the planner's own first.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// What is asked.
    pub question: Question,
    /// The question in words, with the schema of its answer.
    pub prompt: TaskPrompt,
    /// The planner's own way.
    own: Way,
    others: Vec<Way>,
    /// Whether another look is still to be had.
    may_look: bool,
}

/// A plan's first step, and why it leads to the goal.
type Way = (Step, Explanation);

/// What a model chose.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// What to do.
    pub decision: Decision,
    /// Why, in the model's words.
    pub reason: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Answer {
    #[serde(default)]
    diagnosis: Option<String>,
    reason: String,
    way: String,
}

fn file(question: Question) -> Option<&'static (PromptFile, Value)> {
    static SELECT: prompt_file::Cell = prompt_file::Cell::new();
    static REFLECT: prompt_file::Cell = prompt_file::Cell::new();
    match question {
        Question::Select => prompt_file::read(
            &SELECT,
            include_str!("../prompts/select.toml"),
            include_str!("../prompts/select.schema.json"),
        ),
        Question::Reflect => prompt_file::read(
            &REFLECT,
            include_str!("../prompts/reflect.toml"),
            include_str!("../prompts/reflect.schema.json"),
        ),
    }
}

impl Planner {
    /// The question that a decision leaves open, if it is one about which a model of these stages may be asked: `None`
    /// where there is one way alone and nothing has failed.
    pub fn choice(
        &self,
        task: &Task,
        view: &dyn MemoryView,
        situation: &Situation,
        options: &PlanOptions,
        may_ask: impl Fn(Question) -> bool,
    ) -> Option<Choice> {
        let tries = tries(view);
        // Once for each failure: a look that follows it is not asked about anew.
        let failed = tries.last().is_some_and(|last| matches!(last.result, TransitionResult::Failed { .. }));
        let question = match failed && situation.looks == 0 && may_ask(Question::Reflect) {
            true => Question::Reflect,
            false if may_ask(Question::Select) => Question::Select,
            false => return None,
        };
        let mut ways = self.ways(task, view, situation, options);
        if ways.is_empty() || (question == Question::Select && ways.len() < 2) {
            return None;
        }
        let may_look = situation.looks < crate::decide::MAX_LOOKS;
        let prompt = prompt(question, task, view, &tries, &ways, may_look)?;
        let others = ways.split_off(1);
        Some(Choice { question, prompt, own: ways.pop()?, others, may_look })
    }

    /// Plans that lead to the current goal and begin otherwise, the planner's own first.
    fn ways(&self, task: &Task, view: &dyn MemoryView, situation: &Situation, options: &PlanOptions) -> Vec<Way> {
        let (mut ways, mut avoided) = (Vec::new(), Vec::new());
        while ways.len() < MAX_WAYS {
            let Decision::Act { step, explanation } = self.decide_without(task, view, situation, options, &avoided)
            else {
                break;
            };
            let (skill, object) = (step.candidate.skill.clone(), step.candidate.part.object);
            avoided.push(Avoided { skill, object, reason: "another way is looked for".into() });
            ways.push((step, explanation));
        }
        ways
    }
}

impl Choice {
    /// The decision of an answer that is of the schema; else what in it does not fit.
    ///
    /// # Errors
    /// It names what is not offered.
    pub fn understand(&self, answer: &Value) -> Result<Chosen, Vec<String>> {
        let answer: Answer = serde_json::from_value(answer.clone()).map_err(|error| vec![error.to_string()])?;
        let reason = match &answer.diagnosis {
            Some(diagnosis) => format!("{diagnosis} {}", answer.reason),
            None => answer.reason.clone(),
        };
        let decision = match answer.way.as_str() {
            LOOK if self.question == Question::Reflect && self.may_look => {
                Decision::Look { reason: reason.clone(), grounds: Grounds::default() }
            }
            GIVE_UP if self.question == Question::Reflect => {
                let unknown = Unknown { cause: GiveUpCause::Plan, text: format!("after a failure: {reason}") };
                Decision::GiveUp { unknown, grounds: Grounds::default() }
            }
            way => {
                let names = names(self.question, 1 + self.others.len(), self.may_look);
                let mut ways = names.iter().zip(std::iter::once(&self.own).chain(&self.others));
                let Some((_, chosen)) = ways.find(|(name, _)| *name == way) else {
                    return Err(vec![format!("there is no way `{way}`: there are {}", names.join(", "))]);
                };
                act(chosen)
            }
        };
        Ok(Chosen { decision, reason })
    }

    /// What the planner would do by itself.
    pub fn own(&self) -> Decision {
        act(&self.own)
    }
}

fn act((step, explanation): &Way) -> Decision {
    Decision::Act { step: step.clone(), explanation: explanation.clone() }
}

/// What was tried for the current subtask, oldest first.
fn tries(view: &dyn MemoryView) -> Vec<&Transition> {
    let (current, since) = (view.progress().current(), view.progress().current_since());
    view.transitions().iter().filter(|t| t.subtask == Some(current) && t.moment >= since).collect()
}

/// Names of what may be answered: the ways in order, then what is no way.
fn names(question: Question, ways: usize, may_look: bool) -> Vec<String> {
    let mut names: Vec<String> = (1..=ways).map(|number| format!("W{number}")).collect();
    if question == Question::Reflect {
        names.extend(may_look.then(|| LOOK.to_owned()));
        names.push(GIVE_UP.to_owned());
    }
    names
}

fn prompt(
    question: Question,
    task: &Task,
    view: &dyn MemoryView,
    tries: &[&Transition],
    ways: &[Way],
    may_look: bool,
) -> Option<TaskPrompt> {
    let (file, schema) = file(question)?;
    let goal = ways.first().map(|(_, explanation)| explanation.goal.as_str()).unwrap_or_default();
    let near: BTreeSet<ObjectId> = ways.iter().map(|(step, _)| step.candidate.part.object).collect();
    // What the ways act on goes first, so that it is told of however many things there are.
    let (first, rest): (Vec<_>, Vec<_>) = view.objects().iter().partition(|entry| near.contains(&entry.id));
    let things: Vec<String> = first.into_iter().chain(rest).take(MAX_TOLD).map(thing_line).collect();
    let names = names(question, ways.len(), may_look);
    let ways: Vec<String> = names.iter().zip(ways).map(|(name, (step, why))| way_line(name, step, why)).collect();
    let skipped = tries.len().saturating_sub(MAX_TOLD);
    let tries: Vec<String> = tries.iter().skip(skipped).map(|transition| try_line(transition)).collect();
    let user = file
        .user
        .replace("{goal}", goal)
        .replace("{tries}", &tries.join("\n"))
        .replace("{things}", &things.join("\n"))
        .replace("{ways}", &ways.join("\n"))
        // Last, as it is a stranger's text.
        .replace("{instruction}", &task.instruction);
    Some(TaskPrompt {
        id: file.id.clone(),
        version: file.version,
        system: file.system.clone(),
        user: user.trim_end().to_owned(),
        schema: filled(schema.clone(), &names),
        max_output_tokens: file.max_output_tokens,
    })
}

fn thing_line(entry: &ObjectEntry) -> String {
    let at = entry.pose().map_or_else(
        || "its place is not known".to_owned(),
        |pose| format!("at ({:.2}, {:.2}, {:.2})", pose.translation.x, pose.translation.y, pose.translation.z),
    );
    let presence = format!("{:?}", entry.presence).to_lowercase();
    let sure = if entry.verified { "" } else { ", seen once and not confirmed" };
    format!("- {} {}: {presence}, {at}{sure}", entry.id, entry.category)
}

fn way_line(name: &str, step: &Step, why: &Explanation) -> String {
    let chance = &step.prediction;
    let failed =
        if step.attempt > 0 { format!(", {} failed tries of its first step", step.attempt) } else { String::new() };
    format!(
        "- {name}: {} (first step: {:.2} expected from {} tries{failed})",
        why.plan.join(" > "),
        chance.success,
        chance.tries
    )
}

fn try_line(transition: &Transition) -> String {
    let result = match &transition.result {
        TransitionResult::Verified => "it worked".to_owned(),
        TransitionResult::Failed { reason, .. } => format!("it failed: {reason}"),
        TransitionResult::CannotTell | TransitionResult::Pending => "it cannot be told".to_owned(),
    };
    format!("- {} {}: {result}", transition.skill(), transition.object())
}

/// A schema with the names in place of `{ways}`.
fn filled(schema: Value, names: &[String]) -> Value {
    match schema {
        Value::Array(items) => Value::Array(
            items
                .into_iter()
                .flat_map(|item| match item.as_str() {
                    Some("{ways}") => names.iter().map(|name| Value::from(name.as_str())).collect(),
                    _ => vec![filled(item, names)],
                })
                .collect(),
        ),
        Value::Object(fields) => {
            Value::Object(fields.into_iter().map(|(name, value)| (name, filled(value, names))).collect())
        }
        plain => plain,
    }
}

#[cfg(test)]
mod tests;
