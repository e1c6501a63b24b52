//! A model that answers as the rules would, and wrongly at a given rate: what errors cost, without asking a real one.

use acm_concept::template::TemplateLibrary;
use acm_llm::{Backend, CallError, ChatReply, ChatRequest, EndReason, Reply, Turn, Usage};
use acm_planner::Planner;
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex, PoisonError};

/// How long a call has that ends in a timeout, milliseconds: told, not waited for.
const LIMIT_MS: u64 = 90_000;
/// What stands before the instruction in the prompt.
const BEFORE: &str = "Instruction: ";
/// Ways to be wrong.
const WRONGS: [Wrong; 6] =
    [Wrong::Object, Wrong::Skill, Wrong::MissingStep, Wrong::Malformed, Wrong::Refusal, Wrong::Timeout];

#[derive(Debug, Clone, Copy, PartialEq)]
enum Wrong {
    Object,
    Skill,
    MissingStep,
    Malformed,
    Refusal,
    Timeout,
}

/// Such a model.
pub struct Degraded {
    planner: Planner,
    library: Arc<TemplateLibrary>,
    rate: f64,
    random: Mutex<ChaCha8Rng>,
}

impl Degraded {
    /// A model that is wrong in this share of its answers, drawn from a seed.
    pub fn new(planner: Planner, library: Arc<TemplateLibrary>, rate: f64, seed: u64) -> Degraded {
        Degraded { planner, library, rate, random: Mutex::new(ChaCha8Rng::seed_from_u64(seed)) }
    }

    fn answer(&self, request: &ChatRequest) -> Result<ChatReply, CallError> {
        let mut random = self.random.lock().unwrap_or_else(PoisonError::into_inner);
        let wrong = if random.random_bool(self.rate) { WRONGS.choose(&mut *random).copied() } else { None };
        let right = self.right(request);
        let text = match wrong {
            Some(Wrong::Timeout) => return Err(CallError::Timeout { limit_ms: LIMIT_MS }),
            Some(Wrong::Refusal) => {
                return Ok(ChatReply { end: EndReason::Refused, ..reply("I would rather not.".into(), request) });
            }
            Some(Wrong::Malformed) => {
                let text = right.to_string();
                text.chars().take(text.chars().count() / 2).collect()
            }
            Some(wrong) => spoiled(right, wrong, request, &mut random).to_string(),
            None => right.to_string(),
        };
        Ok(reply(text, request))
    }

    /// What the rules would answer: the goals that they read, or the planner's own way.
    fn right(&self, request: &ChatRequest) -> Value {
        let ways = ways(request);
        if let Some(first) = ways.first() {
            let reason = "It is the planner's own.";
            let fields = request.schema.pointer("/properties").and_then(Value::as_object);
            let names = fields.into_iter().flat_map(|fields| fields.keys());
            return names.map(|name| (name.clone(), Value::from(if name == "way" { first } else { reason }))).collect();
        }
        let words = request.turns.first().map(Turn::text).unwrap_or_default();
        let instruction = words.trim().strip_prefix(BEFORE).unwrap_or_default();
        match self.planner.parse(instruction, &self.library) {
            Ok(task) => serde_json::to_value(self.planner.answer(&task)).unwrap_or_default(),
            Err(error) => json!({ "things": [], "steps": [], "untouched": [], "unclear": error.to_string() }),
        }
    }
}

fn ways(request: &ChatRequest) -> Vec<String> {
    let names = request.schema.pointer("/properties/way/enum").and_then(Value::as_array);
    names.into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect()
}

/// An answer of the schema's form that says something else.
fn spoiled(mut answer: Value, wrong: Wrong, request: &ChatRequest, random: &mut ChaCha8Rng) -> Value {
    if let (Some(other), Some(way)) = (ways(request).choose(random), answer.get_mut("way")) {
        *way = other.as_str().into();
        return answer;
    }
    let things = answer.pointer("/things").and_then(Value::as_array).map_or(0, Vec::len);
    let names = |pointer: &str| {
        let names = request.schema.pointer(pointer).and_then(Value::as_array);
        names.into_iter().flatten().filter(|name| !name.is_null()).cloned().collect::<Vec<_>>()
    };
    let functions = names("/properties/steps/items/properties/function/enum");
    let Some(steps) = answer.pointer_mut("/steps").and_then(Value::as_array_mut) else { return answer };
    if steps.is_empty() {
        return answer;
    }
    let at = random.random_range(0..steps.len());
    if wrong == Wrong::MissingStep {
        steps.remove(at);
        return answer;
    }
    let Some(step) = steps.get_mut(at) else { return answer };
    match wrong {
        Wrong::Object => step["thing"] = random.random_range(0..things.max(2)).into(),
        _ if step["goal"] == "performed" => step["function"] = functions.choose(random).cloned().unwrap_or_default(),
        _ => (step["goal"], step["to"]) = ("holding".into(), Value::Null),
    }
    answer
}

/// A reply with as many tokens as its text has words of four letters.
fn reply(text: String, request: &ChatRequest) -> ChatReply {
    let input: usize = request.system.len() + request.turns.iter().map(|turn| turn.text().len()).sum::<usize>();
    let usage = Usage { input: input as u64 / 4, output: text.len() as u64 / 4, ..Usage::default() };
    ChatReply { usage, ..ChatReply::new(text, "degraded", "rules") }
}

impl Backend for Degraded {
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a> {
        Box::pin(async move { self.answer(request) })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;
    use acm_llm::{Parameters, PromptId};

    #[test]
    fn without_errors_it_is_the_rules_and_with_errors_it_is_not() {
        let (planner, library) = (Planner::new().unwrap(), Arc::new(acm_memory::default_library().unwrap()));
        let text = "Bring the cube to the middle, press the button, then return it to where it came from.";
        let prompt = planner.prompt(text, &library).unwrap();
        let request = ChatRequest {
            stage: "parse".into(),
            prompt: PromptId { id: prompt.id, version: prompt.version },
            system: prompt.system,
            turns: vec![Turn::user(prompt.user)],
            schema: prompt.schema,
            parameters: Parameters { max_output_tokens: 4000 },
        };
        let model = |rate| Degraded::new(Planner::new().unwrap(), Arc::clone(&library), rate, 7);
        let task = planner.parse(text, &library).unwrap();
        let right = model(0.0).answer(&request).unwrap();
        let read = |reply: &ChatReply| {
            let json = serde_json::from_str(&reply.text).ok()?;
            planner.understand(text, &library, &json).ok().filter(|_| reply.end == EndReason::Complete)
        };
        assert_eq!(read(&right), Some(task.clone()));
        let wrong = model(1.0);
        let answers: Vec<_> = (0..60).map(|_| wrong.answer(&request)).collect();
        let as_read = answers.iter().filter(|answer| answer.as_ref().ok().and_then(read) == Some(task.clone())).count();
        let others =
            answers.iter().filter_map(|answer| read(answer.as_ref().ok()?)).filter(|other| *other != task).count();
        assert!(as_read < 12, "a thing drawn anew may be the same one: {as_read}");
        assert!(others > 5, "some errors pass every check: {others}");
        assert!(answers.iter().any(Result::is_err));
    }
}
