//! `openai-responses`: OpenAI's Responses. Nothing is stored there: scenes are nobody else's business.

use super::{
    Profile, Said, Structured, WireRequest, data_url, form_name, joined, list_at, number_at, parts, put, system,
    text_at, tool_words, unreadable,
};
use crate::chat::{CallError, ChatRequest, EndReason, Speaker, Turn, Usage};
use serde_json::{Value, json};

pub(super) fn request(asked: &ChatRequest, profile: &Profile) -> WireRequest {
    let input: Vec<Value> = asked.turns.iter().map(turn).collect();
    let mut body = json!({
        "model": profile.model,
        "instructions": system(asked, profile),
        "input": input,
        "max_output_tokens": profile.most_tokens(asked.parameters.max_output_tokens),
        "store": false,
    });
    let sampling = profile.sampling;
    put(
        &mut body,
        [
            ("temperature", sampling.temperature.into()),
            ("top_p", sampling.top_p.into()),
            ("reasoning", profile.reasoning.as_ref().map(|effort| json!({ "effort": effort })).into()),
            ("stream", profile.stream.then_some(true).into()),
        ],
    );
    let (name, schema) = (form_name(asked), &asked.schema);
    match profile.structured() {
        Structured::JsonSchema => {
            let format = json!({ "type": "json_schema", "name": name, "schema": schema, "strict": true });
            put(&mut body, [("text", json!({ "format": format }))]);
        }
        Structured::ForcedTool => {
            let mut tool = tool_words(asked);
            put(&mut tool, [("type", "function".into()), ("parameters", schema.clone()), ("strict", true.into())]);
            put(&mut body, [("tools", json!([tool])), ("tool_choice", json!({ "type": "function", "name": name }))]);
        }
        Structured::JsonObject => put(&mut body, [("text", json!({ "format": { "type": "json_object" } }))]),
        Structured::PromptOnly => {}
    }
    WireRequest { path: "/responses".into(), headers: Vec::new(), body }
}

fn turn(turn: &Turn) -> Value {
    let (role, kind) = match turn.who {
        Speaker::User => ("user", "input_text"),
        // Without its type llama.cpp does not know it.
        Speaker::Assistant => return json!({ "type": "message", "role": "assistant", "content": turn.text() }),
    };
    let content = parts(
        turn,
        |words| json!({ "type": kind, "text": words }),
        |image| json!({ "type": "input_image", "image_url": data_url(image), "detail": "auto" }),
    );
    json!({ "role": role, "content": content })
}

pub(super) fn reply(value: &Value) -> Result<Said, CallError> {
    if value.get("output").is_none() {
        return Err(unreadable("it has no `output`"));
    }
    let content = |kind: &'static str| {
        let messages = list_at(value, "/output").filter(|item| text_at(item, "/type") == Some("message"));
        messages.flat_map(|item| list_at(item, "/content")).filter(move |part| text_at(part, "/type") == Some(kind))
    };
    let text = joined(content("output_text").filter_map(|part| text_at(part, "/text")));
    let refusal = joined(content("refusal").filter_map(|part| text_at(part, "/refusal")));
    let called = list_at(value, "/output").find(|item| text_at(item, "/type") == Some("function_call"));
    let called = called.and_then(|call| text_at(call, "/arguments")).map(str::to_owned);
    let thoughts = list_at(value, "/output").filter(|item| text_at(item, "/type") == Some("reasoning"));
    let reasoning =
        joined(thoughts.flat_map(|item| list_at(item, "/summary")).filter_map(|part| text_at(part, "/text")));
    let end = match (text_at(value, "/status"), text_at(value, "/incomplete_details/reason")) {
        _ if refusal.is_some() => EndReason::Refused,
        (Some("completed"), _) => EndReason::Complete,
        (Some("incomplete"), Some("max_output_tokens")) => EndReason::MaxTokens,
        (Some("incomplete"), Some("content_filter")) => EndReason::Refused,
        (Some("failed"), _) => {
            let reason = text_at(value, "/error/message").unwrap_or("it does not say why").into();
            return Err(CallError::Server { status: 200, reason });
        }
        (other, _) => return Err(super::failure::no_end(other)),
    };
    Ok(Said {
        text: refusal.or(called).or(text).unwrap_or_default(),
        reasoning,
        usage: Usage {
            input: number_at(value, "/usage/input_tokens"),
            output: number_at(value, "/usage/output_tokens"),
            reasoning: number_at(value, "/usage/output_tokens_details/reasoning_tokens"),
            cached: number_at(value, "/usage/input_tokens_details/cached_tokens"),
        },
        end,
        model: text_at(value, "/model").map(Into::into),
    })
}

/// The last event has the whole reply.
pub(super) fn assemble(events: &[Value]) -> Value {
    let ends = ["response.completed", "response.incomplete", "response.failed"];
    let last = events.iter().rev().find(|event| text_at(event, "/type").is_some_and(|kind| ends.contains(&kind)));
    last.and_then(|event| event.get("response")).cloned().unwrap_or_else(|| json!({ "output": [] }))
}
