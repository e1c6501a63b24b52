//! Streamed replies: server-sent events, or lines of JSON. A reply is read to its end before anything is made of it.

use super::{Wire, anthropic, gemini, ollama, openai_chat, openai_responses, text_at};
use crate::chat::{CallError, shortened};
use serde_json::Value;

/// How much of what cannot be read is told, characters.
const MAX_TOLD: usize = 80;
/// What ends a stream of openai-chat.
const DONE: &str = "[DONE]";

/// A streamed reply as the whole one that it stands for.
pub(super) fn assemble(wire: Wire, body: &[u8]) -> Result<Value, CallError> {
    let values = events(wire, body)?;
    if values.is_empty() {
        return Err(broken("it has no event"));
    }
    Ok(match wire {
        Wire::OpenaiChat => openai_chat::assemble(&values),
        Wire::OpenaiResponses => {
            let ends = ["response.completed", "response.incomplete", "response.failed"];
            if !values.iter().any(|event| text_at(event, "/type").is_some_and(|kind| ends.contains(&kind))) {
                return Err(broken("it has no last event"));
            }
            openai_responses::assemble(&values)
        }
        Wire::Anthropic => anthropic::assemble(&values),
        Wire::Gemini => gemini::assemble(&values),
        Wire::Ollama => ollama::assemble(&values),
    })
}

/// Looks at the events of a stream as they come, so that a damaged one ends the call at once.
pub(crate) struct Watch {
    wire: Wire,
    seen: usize,
}

impl Watch {
    pub(crate) fn new(wire: Wire) -> Watch {
        Watch { wire, seen: 0 }
    }

    /// Takes all that has come so far.
    pub(crate) fn look(&mut self, body: &[u8]) -> Result<(), CallError> {
        let new = body.get(self.seen..).unwrap_or_default();
        let ends = |end: &[u8]| new.windows(end.len()).rposition(|window| window == end).map(|at| at + end.len());
        let end = match self.wire {
            Wire::Ollama => ends(b"\n"),
            _ => ends(b"\n\n").max(ends(b"\r\n\r\n")),
        };
        let Some(end) = end else { return Ok(()) };
        events(self.wire, new.get(..end).unwrap_or_default())?;
        self.seen += end;
        Ok(())
    }
}

/// The events of a stream that came whole.
fn events(wire: Wire, body: &[u8]) -> Result<Vec<Value>, CallError> {
    let text = std::str::from_utf8(body).map_err(|_invalid| broken("it is no UTF-8"))?;
    let events: Vec<String> = match wire {
        Wire::Ollama => text.lines().map(str::trim).filter(|line| !line.is_empty()).map(str::to_owned).collect(),
        _ => data(text),
    };
    let value = |event: &String| {
        let value: Value = serde_json::from_str(event)
            .map_err(|_invalid| broken(format!("an event is no JSON: {}", shortened(event, MAX_TOLD))))?;
        refuse_error(&value)?;
        Ok(value)
    };
    events.iter().filter(|event| *event != DONE).map(value).collect()
}

/// The data of server-sent events, in order. An event that no empty line ends is none.
fn data(text: &str) -> Vec<String> {
    let (mut events, mut lines) = (Vec::new(), Vec::new());
    for line in text.lines() {
        if let Some(data) = line.strip_prefix("data:") {
            lines.push(data.strip_prefix(' ').unwrap_or(data));
        } else if line.is_empty() && !lines.is_empty() {
            events.push(lines.join("\n"));
            lines.clear();
        }
    }
    events
}

/// A server that fails after it has begun says so in an event.
fn refuse_error(event: &Value) -> Result<(), CallError> {
    let error = event.get("error").filter(|error| !error.is_null());
    let Some(error) = error else { return Ok(()) };
    if text_at(error, "/type") == Some("overloaded_error") {
        return Err(CallError::Overloaded);
    }
    let words = text_at(error, "/message").or(error.as_str()).unwrap_or("it does not say why");
    Err(broken(format!("the server says: {}", shortened(words, 3 * MAX_TOLD))))
}

fn broken(reason: impl Into<String>) -> CallError {
    CallError::BrokenOff { reason: reason.into() }
}
