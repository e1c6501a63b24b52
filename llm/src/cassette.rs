//! A recording of requests and what came of them, and the backend that gives the same again.
//!
//! A cassette is a text file of JSON lines: a header, then a line for each call with the request's key, the request, and
//! the reply or the error.

use crate::{
    backend::{Backend, Reply},
    chat::{Answer, CallError, ChatRequest, shortened},
    file::{self, FileError},
};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Arc, Mutex, PoisonError},
};

/// The schema that a header names.
pub const SCHEMA: &str = "acm.cassette/1";
/// Most calls of a cassette.
const MAX_CALLS: usize = 100_000;
/// How much of each of two texts that differ is told, characters.
const MAX_TOLD: usize = 60;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    schema: String,
}

/// One recorded call.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Call {
    key: String,
    request: ChatRequest,
    answer: Answer,
}

/// Recorded calls in order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cassette {
    name: String,
    calls: Vec<Call>,
}

impl Cassette {
    /// An empty recording of this name.
    pub fn new(name: impl Into<String>) -> Cassette {
        Cassette { name: name.into(), calls: Vec::new() }
    }

    /// Adds a call.
    ///
    /// # Errors
    /// The request has no JSON.
    pub fn add(&mut self, request: ChatRequest, answer: Answer) -> Result<(), serde_json::Error> {
        self.calls.push(Call { key: request.key()?, request, answer });
        Ok(())
    }

    /// How many calls it holds.
    pub fn len(&self) -> usize {
        self.calls.len()
    }
    /// Whether it holds none.
    pub fn is_empty(&self) -> bool {
        self.calls.is_empty()
    }

    /// Reads a cassette.
    ///
    /// # Errors
    /// The file cannot be read or is no cassette.
    pub fn read(path: &Path) -> Result<Cassette, FileError> {
        Cassette::parse(&path.display().to_string(), &file::read(path)?)
    }

    /// A cassette from the text of a file of this name.
    ///
    /// # Errors
    /// The text is none, or a request is not the one that its key says.
    pub fn parse(name: &str, text: &str) -> Result<Cassette, FileError> {
        let mut lines = file::lines(text);
        let Some((line, header)) = lines.next() else { return Err(FileError::new(name, None, "it is empty")) };
        let failed = |line, reason: String| FileError::new(name, Some(line), reason);
        let header =
            serde_json::from_str::<Header>(header).map_err(|error| failed(line, format!("no header: {error}")))?;
        if header.schema != SCHEMA {
            return Err(failed(line, format!("`schema` is `{}`, not `{SCHEMA}`", header.schema)));
        }
        let mut cassette = Cassette::new(name);
        for (line, text) in lines {
            let call: Call = serde_json::from_str(text).map_err(|error| failed(line, error.to_string()))?;
            if call.request.key().ok().as_ref() != Some(&call.key) {
                return Err(failed(line, "`key` is not the hash of `request`: one of them was changed".into()));
            }
            if cassette.len() == MAX_CALLS {
                return Err(failed(line, format!("a cassette has at most {MAX_CALLS} calls")));
            }
            cassette.calls.push(call);
        }
        Ok(cassette)
    }

    /// The cassette as the text of a file.
    ///
    /// # Errors
    /// A request has no JSON.
    pub fn text(&self) -> Result<String, serde_json::Error> {
        let mut text = serde_json::to_string(&Header { schema: SCHEMA.into() })? + "\n";
        for call in &self.calls {
            text += &serde_json::to_string(call)?;
            text.push('\n');
        }
        Ok(text)
    }

    /// A model that answers as was recorded.
    pub fn backend(self: &Arc<Self>) -> Recorded {
        Recorded { cassette: Arc::clone(self), given: Mutex::default() }
    }

    /// In what the recorded request that is most like this one differs from it.
    fn difference(&self, request: &ChatRequest) -> String {
        let Ok(asked) = serde_json::to_value(request) else { return "the request has no JSON".into() };
        let recorded = self.calls.iter().filter_map(|call| serde_json::to_value(&call.request).ok());
        let nearest = recorded
            .map(|recorded| {
                let mut fields = Vec::new();
                differences("", &recorded, &asked, &mut fields);
                fields
            })
            .min_by_key(Vec::len);
        match nearest {
            None => "it is empty".into(),
            Some(fields) => format!("the nearest one differs in {}", fields.join(", and in ")),
        }
    }
}

/// Adds a line for each field in which two values differ.
fn differences(path: &str, recorded: &Value, asked: &Value, out: &mut Vec<String>) {
    match (recorded, asked) {
        (Value::Object(a), Value::Object(b)) => {
            let names: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            for name in names {
                let of = |fields: &serde_json::Map<String, Value>| fields.get(name).cloned().unwrap_or_default();
                differences(&format!("{path}/{name}"), &of(a), &of(b), out);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (at, (a, b)) in a.iter().zip(b).enumerate() {
                differences(&format!("{path}/{at}"), a, b, out);
            }
        }
        (a, b) if a == b => {}
        (Value::Array(a), Value::Array(b)) => out.push(format!("{path} ({} recorded, {} now)", a.len(), b.len())),
        (a, b) => out.push(format!("{path} (recorded {}, now {})", told(a, b), told(b, a))),
    }
}

/// A value from where it begins to differ from another one.
fn told(value: &Value, other: &Value) -> String {
    let (Value::String(text), Value::String(other)) = (value, other) else {
        return shortened(&value.to_string(), MAX_TOLD);
    };
    let same = text.chars().zip(other.chars()).take_while(|(a, b)| a == b).count();
    let rest: String = text.chars().skip(same.saturating_sub(12)).collect();
    let dots = if same > 12 { "..." } else { "" };
    format!("\"{dots}{}\"", shortened(&rest, MAX_TOLD))
}

/// A model that answers as was recorded. Of several answers to one request each is given in turn, and the last one from
/// then on.
#[derive(Debug)]
pub struct Recorded {
    cassette: Arc<Cassette>,
    /// How often each request was answered.
    given: Mutex<BTreeMap<String, usize>>,
}

impl Recorded {
    fn answer(&self, request: &ChatRequest) -> Answer {
        let miss =
            |difference| Answer::Error(CallError::ReplayMiss { cassette: self.cassette.name.clone(), difference });
        let Ok(key) = request.key() else { return miss("the request has no JSON".into()) };
        let answers: Vec<&Answer> =
            self.cassette.calls.iter().filter(|call| call.key == key).map(|call| &call.answer).collect();
        let mut given = self.given.lock().unwrap_or_else(PoisonError::into_inner);
        let times = given.entry(key).or_default();
        let answer = answers.get(*times).or(answers.last());
        *times += 1;
        answer.map_or_else(|| miss(self.cassette.difference(request)), |answer| (*answer).clone())
    }
}

impl Backend for Recorded {
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a> {
        Box::pin(async move { self.answer(request).into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chat::tests::{reply, request};

    fn cassette() -> Cassette {
        let mut cassette = Cassette::new("c.jsonl");
        let answers = [Answer::Reply(reply("1")), Answer::Error(CallError::Overloaded), Answer::Reply(reply("3"))];
        for (words, answer) in ["take the cube", "take the cube", "press the button"].into_iter().zip(answers) {
            cassette.add(request(words), answer).unwrap();
        }
        cassette
    }

    #[test]
    fn a_cassette_comes_back_and_answers_in_turn() {
        let read = Cassette::parse("c.jsonl", &cassette().text().unwrap()).unwrap();
        assert_eq!(read, cassette());
        let backend = Arc::new(read).backend();
        let given: Vec<Answer> = (0..3).map(|_| backend.answer(&request("take the cube"))).collect();
        assert_eq!(given[0], Answer::Reply(reply("1")));
        assert!(given[1] == Answer::Error(CallError::Overloaded) && given[2] == given[1]);
    }

    #[test]
    fn a_miss_shows_what_differs_from_the_nearest_request() {
        let backend = Arc::new(cassette()).backend();
        let Answer::Error(error) = backend.answer(&request("take the can")) else { panic!("a hit") };
        let told = error.to_string();
        assert!(told.contains("/turns/0/parts/0/text") && told.contains("cube") && told.contains("can"), "{told}");
        assert!(!told.contains("/schema") && told.lines().count() == 1, "{told}");
        let empty = Arc::new(Cassette::new("e.jsonl")).backend();
        assert!(
            matches!(empty.answer(&request("x")), Answer::Error(CallError::ReplayMiss { difference, .. }) if difference == "it is empty")
        );
    }

    #[test]
    fn what_is_no_cassette_is_told_in_one_line_with_its_place() {
        let text = cassette().text().unwrap();
        for (text, parts) in [
            (String::new(), &["c.jsonl", "empty"][..]),
            (text.replace("acm.cassette/1", "acm.cassette/9"), &["c.jsonl line 1", "acm.cassette/9"]),
            (text.replacen("take the cube", "take the can", 1), &["c.jsonl line 2", "`key`"]),
            (text.replacen("\"answer\"", "\"anser\"", 1), &["c.jsonl line 2", "anser"]),
        ] {
            let error = Cassette::parse("c.jsonl", &text).unwrap_err().to_string();
            assert!(parts.iter().all(|part| error.contains(part)) && error.lines().count() == 1, "{error}");
        }
    }
}
