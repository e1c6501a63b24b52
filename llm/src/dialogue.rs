//! A question whose answer is checked here, whatever a server promises, with a bounded number of repairs.

use crate::chat::{Answer, ChatReply, ChatRequest, EndReason, Turn, Usage, shortened};
use jsonschema::Validator;
use serde::Serialize;
use serde_json::Value;
use std::fmt;
use thiserror::Error;

/// Longest answer that is read, bytes.
const MAX_ANSWER_BYTES: usize = 256 << 10;
/// Most bytes of a wrong answer that are held against the model when it is asked again.
const MAX_QUOTED_BYTES: usize = 16 << 10;
/// Most faults of one answer that are told.
const MAX_FAULTS: usize = 6;
/// Longest wording of a fault, characters.
const MAX_FAULT_CHARS: usize = 300;

/// A schema that is none.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the schema of the answer is no JSON Schema: {0}")]
pub struct SchemaError(pub String);

/// What is wrong with a reply.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", content = "faults", rename_all = "kebab-case")]
pub enum Fault {
    /// The model ran out of tokens.
    Truncated,
    /// The model declined.
    Refused,
    /// The answer is no JSON, and why.
    Malformed(String),
    /// It is not of the schema: where, and why not.
    Schema(Vec<String>),
    /// It speaks of what is not there.
    Ungrounded(Vec<String>),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Fault::Truncated => f.write_str("the answer was cut off at its most tokens"),
            Fault::Refused => f.write_str("the model declined to answer"),
            Fault::Malformed(why) => write!(f, "the answer is no JSON: {why}"),
            Fault::Schema(faults) => write!(f, "the answer is not of the schema: {}", faults.join("; ")),
            Fault::Ungrounded(faults) => write!(f, "the answer does not fit: {}", faults.join("; ")),
        }
    }
}

/// What comes after a reply.
#[derive(Debug, Clone, PartialEq)]
pub enum Next<T> {
    /// The answer holds.
    Accepted(T),
    /// Ask [`Dialogue::request`] again: it tells the model what was wrong.
    Ask,
    /// There is no answer, and why.
    GaveUp(String),
}

/// A question under way. It does not ask by itself, so whoever does can write down each request and each reply.
#[derive(Debug)]
pub struct Dialogue {
    request: ChatRequest,
    schema: Validator,
    repairs_left: u32,
    calls: u32,
    usage: Usage,
    faults: Vec<Fault>,
    answered_by: Option<(String, String)>,
}

impl Dialogue {
    /// A question with at most so many repairs.
    ///
    /// # Errors
    /// The request's schema is none.
    pub fn new(request: ChatRequest, repairs: u32) -> Result<Dialogue, SchemaError> {
        let schema = jsonschema::validator_for(&request.schema).map_err(|error| SchemaError(error.to_string()))?;
        Ok(Dialogue {
            request,
            schema,
            repairs_left: repairs,
            calls: 0,
            usage: Usage::default(),
            faults: Vec::new(),
            answered_by: None,
        })
    }

    /// What to ask now.
    pub fn request(&self) -> &ChatRequest {
        &self.request
    }
    /// How often was asked and answered.
    pub fn calls(&self) -> u32 {
        self.calls
    }
    /// What all replies cost.
    pub fn usage(&self) -> Usage {
        self.usage
    }
    /// What was wrong with the replies, in order.
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }
    /// Backend and model of the last reply.
    pub fn answered_by(&self) -> Option<(&str, &str)> {
        self.answered_by.as_ref().map(|(backend, model)| (backend.as_str(), model.as_str()))
    }

    /// Takes the answer to [`Dialogue::request`]. `ground` makes something of JSON that is of the schema, or says what
    /// in it does not fit.
    pub fn take<T>(&mut self, answer: &Answer, ground: impl FnOnce(&Value) -> Result<T, Vec<String>>) -> Next<T> {
        self.calls += 1;
        let reply = match answer {
            Answer::Reply(reply) => reply,
            Answer::Error(error) => return Next::GaveUp(error.to_string()),
        };
        self.usage += reply.usage;
        self.answered_by = Some((reply.backend.clone(), reply.model.clone()));
        let fault = match self.check(reply, ground) {
            Ok(value) => return Next::Accepted(value),
            Err(fault) => fault,
        };
        self.faults.push(fault.clone());
        if self.repairs_left == 0 || fault == Fault::Refused {
            return Next::GaveUp(fault.to_string());
        }
        self.repairs_left -= 1;
        self.repair(reply, &fault);
        Next::Ask
    }

    fn check<T>(&self, reply: &ChatReply, ground: impl FnOnce(&Value) -> Result<T, Vec<String>>) -> Result<T, Fault> {
        match reply.end {
            EndReason::Complete => {}
            EndReason::MaxTokens => return Err(Fault::Truncated),
            EndReason::Refused => return Err(Fault::Refused),
        }
        if reply.text.len() > MAX_ANSWER_BYTES {
            return Err(Fault::Malformed(format!("it has more than {MAX_ANSWER_BYTES} bytes")));
        }
        let value: Value = serde_json::from_str(&reply.text).map_err(|error| Fault::Malformed(error.to_string()))?;
        let mut faults: Vec<String> = self.schema.iter_errors(&value).map(|error| fault_words(&error)).collect();
        if !faults.is_empty() {
            // The validator promises no order.
            faults.sort();
            return Err(Fault::Schema(bounded(faults)));
        }
        ground(&value).map_err(|faults| Fault::Ungrounded(bounded(faults)))
    }

    /// Says what was wrong in two further turns. An answer that was cut off is asked for again with twice the room.
    fn repair(&mut self, reply: &ChatReply, fault: &Fault) {
        if *fault == Fault::Truncated {
            let most = &mut self.request.parameters.max_output_tokens;
            *most = most.saturating_mul(2);
            return;
        }
        let quoted = reply.text.char_indices().take_while(|(at, _)| *at < MAX_QUOTED_BYTES).map(|(_, sign)| sign);
        self.request.turns.push(Turn::assistant(quoted.collect::<String>()));
        let words = format!("That cannot be used: {fault}.\nAnswer again with the whole JSON object and nothing else.");
        self.request.turns.push(Turn::user(words));
    }
}

fn fault_words(error: &jsonschema::ValidationError<'_>) -> String {
    let path = error.instance_path().to_string();
    let path = if path.is_empty() { "/".to_owned() } else { path };
    format!("at {path}: {}", shortened(&error.to_string(), MAX_FAULT_CHARS))
}

fn bounded(mut faults: Vec<String>) -> Vec<String> {
    let more = faults.len().saturating_sub(MAX_FAULTS);
    faults.truncate(MAX_FAULTS);
    if more > 0 {
        faults.push(format!("and {more} more"));
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chat::{
        CallError,
        tests::{reply, request},
    };

    fn dialogue() -> Dialogue {
        Dialogue::new(request("how many?"), 2).unwrap()
    }

    fn small(json: &Value) -> Result<u64, Vec<String>> {
        json["count"].as_u64().filter(|count| *count < 10).ok_or_else(|| vec!["there are fewer than 10".into()])
    }

    #[test]
    fn a_wrong_answer_goes_back_with_what_is_wrong_and_a_right_one_is_taken() {
        let mut dialogue = dialogue();
        let wrong = [("three", "no JSON"), (r#"{"count": 0}"#, "/count")];
        for (at, (text, told)) in wrong.into_iter().enumerate() {
            assert_eq!(dialogue.take(&Answer::Reply(reply(text)), small), Next::Ask);
            let turns = &dialogue.request().turns;
            assert_eq!(turns.len(), 1 + 2 * (at + 1));
            assert_eq!(turns[turns.len() - 2], Turn::assistant(text));
            assert!(turns[turns.len() - 1].text().contains(told), "{turns:?}");
        }
        assert_eq!(dialogue.take(&Answer::Reply(reply(r#"{"count": 3}"#)), small), Next::Accepted(3));
        assert_eq!((dialogue.calls(), dialogue.usage().input, dialogue.faults().len()), (3, 21, 2));
    }

    #[test]
    fn what_stays_wrong_is_given_up_after_two_repairs() {
        let mut dialogue = dialogue();
        let far = Answer::Reply(reply(r#"{"count": 12}"#));
        assert_eq!(dialogue.take(&far, small), Next::Ask);
        assert_eq!(dialogue.take(&far, small), Next::Ask);
        let Next::GaveUp(why) = dialogue.take(&far, small) else { panic!("a third repair") };
        assert!(why.contains("fewer than 10"), "{why}");
    }

    #[test]
    fn a_cut_answer_gets_more_room_and_a_refusal_or_an_error_ends_it() {
        let mut dialogue = dialogue();
        let cut = ChatReply { end: EndReason::MaxTokens, ..reply(r#"{"count": "#) };
        assert_eq!(dialogue.take(&Answer::Reply(cut), small), Next::Ask);
        assert_eq!((dialogue.request().parameters.max_output_tokens, dialogue.request().turns.len()), (200, 1));
        let refused = ChatReply { end: EndReason::Refused, ..reply("no") };
        assert!(matches!(dialogue.take(&Answer::Reply(refused), small), Next::GaveUp(_)));
        let error = Answer::Error(CallError::Overloaded);
        assert_eq!(self::dialogue().take(&error, small), Next::GaveUp("the model is overloaded".into()));
    }

    #[test]
    fn a_schema_that_is_none_is_refused() {
        let mut asked = request("x");
        asked.schema = serde_json::json!({ "type": "objekt" });
        assert!(Dialogue::new(asked, 2).is_err());
    }
}
