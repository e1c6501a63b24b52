//! What is said of each span, by the names of OpenTelemetry's conventions for generative AI (of 2026, in development);
//! what they have no name for begins with `acm.`.

use super::{
    spans::{Call, Interval, Marked},
    wire::{AnyValue, Attribute, CLIENT, INTERNAL, Status},
};
use crate::trace::run_file::{Entry, RunFile};
use serde_json::{Value, json};

/// Who provides what has no provider of its own.
const PROVIDER: &str = "acm";

/// What is said of one span.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// Its name.
    pub name: String,
    /// Which side of a call it is.
    pub kind: u8,
    /// More about it.
    pub attributes: Vec<Attribute>,
    /// How it came out.
    pub status: Status,
}

/// What is said of the process: what ran, and in which world.
pub fn resource(run: &RunFile) -> Vec<Attribute> {
    let mut attributes =
        vec![Attribute::new("service.name", "acm"), Attribute::new("service.version", run.about("version"))];
    attributes.extend(
        ["commit", "scenario", "method", "seed", "sensor"]
            .map(|name| Attribute::new(format!("acm.{name}"), run.about(name))),
    );
    attributes
}

/// What is said of a span. `content` tells whether prompts, replies and arguments may be.
pub fn of(run: &RunFile, interval: &Interval, content: bool) -> Said {
    match &interval.marked {
        Marked::Episode => episode(run),
        Marked::Subtask { number, text, done } => Said {
            name: "subtask".into(),
            kind: INTERNAL,
            attributes: vec![
                Attribute::new("acm.subtask.number", *number as u64),
                Attribute::new("acm.subtask.text", text.as_str()),
            ],
            status: if *done { Status::well() } else { Status::default() },
        },
        Marked::Step { number, failure } => Said {
            name: "step".into(),
            kind: INTERNAL,
            attributes: vec![
                Attribute::new("acm.step.number", *number as u64),
                Attribute::new("acm.step.decision", line(run.entry(interval.first))),
            ],
            status: failure.as_ref().map_or_else(Status::well, Status::failed),
        },
        Marked::Call { call, answered } => {
            let answer = run.entry(interval.last).filter(|_| *answered);
            let mut said = one_call(call, run.entry(interval.first), answer, content);
            if !answered {
                said.status = Status::failed("no answer came");
                said.attributes.push(Attribute::new("error.type", "no-answer"));
            }
            said
        }
    }
}

fn line(entry: Option<&Entry>) -> &str {
    entry.map_or("", |entry| &entry.line)
}

fn episode(run: &RunFile) -> Said {
    let ending = run.ending();
    let mut attributes = vec![
        Attribute::new("gen_ai.operation.name", "invoke_agent"),
        Attribute::new("gen_ai.provider.name", PROVIDER),
        Attribute::new("gen_ai.agent.name", "acm"),
        Attribute::new("gen_ai.agent.version", run.about("version")),
        Attribute::new("acm.ending", ending.as_str()),
    ];
    let result = |name: &str| run.result.get(name).map_or("", String::as_str);
    let status = match (result("ending"), result("solved")) {
        (_, "true") => Status::well(),
        // Nobody judged it, or the judge has another view: that is no error of the agent's program.
        ("done", _) => Status::default(),
        _ => {
            // Up to the colon it is one of a few.
            let kind = ending.split(':').next().unwrap_or_default().to_owned();
            attributes.push(Attribute::new("error.type", kind));
            Status::failed(ending)
        }
    };
    Said { name: "invoke_agent acm".into(), kind: INTERNAL, attributes, status }
}

fn one_call(call: &Call, asked: Option<&Entry>, answer: Option<&Entry>, content: bool) -> Said {
    let body = |entry: Option<&Entry>| {
        entry.and_then(|entry| entry.record().ok()).map(|record| record.body).unwrap_or_default()
    };
    let (question, reply) = (body(asked), body(answer));
    let mut said = Said { name: call.name.into(), kind: INTERNAL, attributes: Vec::new(), status: Status::default() };
    // The lines of a chat hold the prompt's words and the reply's.
    if content || call.operation != Some("chat") {
        said.put("acm.asked", line(asked));
        said.put("acm.answered", line(answer));
    }
    if let Some(operation) = call.operation {
        said.put("gen_ai.operation.name", operation);
    }
    if let Some(store) = call.store {
        said.put("gen_ai.memory.store.id", store);
    }
    match call.operation {
        Some("chat") => said.chat(&question, &reply, content),
        Some("execute_tool") => {
            said.tool(call, asked.map_or(0, |entry| entry.header.seq), &question, &reply, content);
        }
        Some("plan") => said.put("gen_ai.provider.name", PROVIDER),
        _ => {}
    }
    // What memory counts: what it expects, or what it took in.
    let counted = ["/objects", "/grounding/resolved"].iter().find_map(|pointer| reply.pointer(pointer)?.as_array());
    if let (Some(_), Some(records)) = (call.store, counted) {
        said.put("gen_ai.memory.record.count", records.len() as u64);
    }
    if let (Some(_), Some(id)) = (call.store, reply.get("transition").and_then(text_of)) {
        said.put("gen_ai.memory.record.id", id);
    }
    if let Some("contradicted") = reply.pointer("/verdict/outcome").and_then(Value::as_str) {
        said.fails("contradicted", text(&reply, "/verdict/reason"));
    }
    said
}

impl Said {
    fn put(&mut self, key: &str, value: impl Into<AnyValue>) {
        self.attributes.push(Attribute::new(key, value));
    }

    fn fails(&mut self, kind: &str, reason: &str) {
        self.put("error.type", kind);
        self.status = Status::failed(reason);
    }

    /// A skill. One that the robot carries out itself, such as getting out of the way, has the name of its message.
    fn tool(&mut self, call: &Call, seq: u64, question: &Value, reply: &Value, content: bool) {
        let tool = question.get("skill").and_then(Value::as_str).unwrap_or(call.asks);
        self.name = format!("execute_tool {tool}");
        self.put("gen_ai.tool.name", tool);
        self.put("gen_ai.tool.type", "function");
        self.put("gen_ai.tool.call.id", seq.to_string());
        if content {
            self.put("gen_ai.tool.call.arguments", question.to_string());
            self.put("gen_ai.tool.call.result", reply.to_string());
        }
        match reply.get("failure") {
            // The cause and the words for it; where it has but one cause, the words alone.
            Some(Value::Array(failure)) => {
                let part = |at: usize| failure.get(at).and_then(Value::as_str).unwrap_or_default();
                self.fails(part(0), part(1));
            }
            Some(Value::String(reason)) => self.fails("motion", reason),
            _ => {}
        }
    }

    /// A question to a language model.
    fn chat(&mut self, question: &Value, reply: &Value, content: bool) {
        let none = Value::Null;
        let request = question.get("request").unwrap_or(&none);
        let said = reply.get("reply").unwrap_or(&none);
        let (backend, model) = (text(said, "/backend"), text(said, "/model"));
        self.kind = CLIENT;
        self.name = format!("chat {model}").trim_end().to_owned();
        self.put("gen_ai.provider.name", if backend.is_empty() { "unknown" } else { backend });
        self.put("gen_ai.output.type", "json");
        self.put("acm.llm.stage", text(request, "/stage"));
        if !model.is_empty() {
            self.put("gen_ai.request.model", model);
            self.put("gen_ai.response.model", model);
        }
        for (key, value) in [
            ("gen_ai.request.max_tokens", request.pointer("/parameters/max_output_tokens")),
            ("gen_ai.usage.input_tokens", said.pointer("/usage/input")),
            ("gen_ai.usage.output_tokens", said.pointer("/usage/output")),
            ("gen_ai.usage.reasoning.output_tokens", said.pointer("/usage/reasoning")),
            ("gen_ai.usage.cache_read.input_tokens", said.pointer("/usage/cached")),
        ] {
            if let Some(count) = value.and_then(Value::as_u64) {
                self.put(key, count);
            }
        }
        let end = match text(said, "/end") {
            "complete" => "stop",
            "max-tokens" => "length",
            "refused" => "content_filter",
            other => other,
        };
        if !end.is_empty() {
            self.put("gen_ai.response.finish_reasons", vec![AnyValue::from(end)]);
        }
        if content {
            self.put("gen_ai.system_instructions", parts(text(request, "/system")).to_string());
            self.put("gen_ai.input.messages", turns(request).to_string());
            let output = json!([{ "role": "assistant", "parts": parts(text(said, "/text")), "finish_reason": end }]);
            self.put("gen_ai.output.messages", output.to_string());
        }
        if let Some(error) = reply.get("error") {
            self.fails(text(error, "/kind"), &error.to_string());
        }
    }
}

/// The turns of a conversation as the conventions write them.
fn turns(request: &Value) -> Value {
    let part = |part: &Value| match (part.get("text").and_then(Value::as_str), part.get("image")) {
        (Some(text), _) => json!({ "type": "text", "content": text }),
        (None, image) => json!({ "type": "image", "blake3": image.and_then(|image| image.get("blake3")) }),
    };
    let turn = |turn: &Value| {
        let parts: Vec<Value> = turn["parts"].as_array().into_iter().flatten().map(part).collect();
        json!({ "role": turn["who"], "parts": parts })
    };
    request["turns"].as_array().into_iter().flatten().map(turn).collect()
}

fn parts(content: &str) -> Value {
    json!([{ "type": "text", "content": content }])
}

/// The text at a pointer; empty without one.
fn text<'a>(value: &'a Value, pointer: &str) -> &'a str {
    value.pointer(pointer).and_then(Value::as_str).unwrap_or_default()
}

/// An id as text, written as text or as number.
fn text_of(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHAT: Call = Call { asks: "a", answers: "b", name: "chat", operation: Some("chat"), store: None };

    fn entry(body: &Value) -> Option<Entry> {
        let record = json!({
            "seq": 4, "cause": 3, "episode": 1, "from": "planner", "to": "llm", "kind": "a", "t": 0, "body": body,
        });
        Entry::parse(record.to_string().into_bytes())
    }

    fn said(reply: &Value, content: bool) -> Said {
        let question = json!({ "request": {
            "stage": "parse", "system": "be brief", "parameters": { "max_output_tokens": 900 },
            "turns": [{ "who": "user", "parts": [{ "text": "secret words" }] }],
        }});
        one_call(&CHAT, entry(&question).as_ref(), entry(reply).as_ref(), content)
    }

    fn value(said: &Said, key: &str) -> Option<AnyValue> {
        said.attributes.iter().find(|attribute| attribute.key == key).map(|attribute| attribute.value.clone())
    }

    #[test]
    fn a_chat_tells_its_model_and_its_tokens_and_its_words_only_if_wanted() {
        let reply = json!({ "reply": {
            "text": "secret answer", "reasoning": null, "backend": "ollama", "model": "m-7b", "end": "max-tokens",
            "usage": { "input": 120, "output": 30, "reasoning": 10, "cached": 0 },
        }});
        let quiet = said(&reply, false);
        assert_eq!((quiet.name.as_str(), quiet.kind, quiet.status.code), ("chat m-7b", CLIENT, 0));
        assert_eq!(value(&quiet, "gen_ai.provider.name"), Some("ollama".into()));
        assert_eq!(value(&quiet, "gen_ai.request.max_tokens"), Some(900.into()));
        assert_eq!(value(&quiet, "gen_ai.usage.input_tokens"), Some(120.into()));
        assert_eq!(value(&quiet, "gen_ai.response.finish_reasons"), Some(vec![AnyValue::from("length")].into()));
        assert!(!format!("{quiet:?}").contains("secret"), "{quiet:?}");
        let told = format!("{:?}", said(&reply, true));
        assert!(told.contains("secret words") && told.contains("secret answer") && told.contains("be brief"), "{told}");
    }

    #[test]
    fn a_model_that_gives_no_reply_is_an_error_of_its_kind() {
        let failed = said(&json!({ "error": { "kind": "rate-limited", "retry_after_ms": 500 } }), false);
        assert_eq!((failed.name.as_str(), failed.status.code), ("chat", 2));
        assert_eq!(value(&failed, "error.type"), Some("rate-limited".into()));
        assert_eq!(value(&failed, "gen_ai.response.model"), None);
    }
}
