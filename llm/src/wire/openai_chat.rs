//! `openai-chat`: chat completions, as OpenAI, DashScope, vLLM, llama.cpp, LM Studio and others serve them.

use super::{
    Profile, Said, Structured, WireRequest, data_url, form_name, list_at, number_at, object, parts, put, system,
    text_at, tool_words, unreadable,
};
use crate::chat::{CallError, ChatRequest, EndReason, Part, Speaker, Turn, Usage};
use serde_json::{Value, json};

pub(super) fn request(asked: &ChatRequest, profile: &Profile) -> WireRequest {
    let mut messages = vec![json!({ "role": "system", "content": system(asked, profile) })];
    messages.extend(asked.turns.iter().map(|turn| json!({ "role": role(turn), "content": content(turn) })));
    let mut body = json!({ "model": profile.model, "messages": messages });
    let sampling = profile.sampling;
    put(
        &mut body,
        [
            (profile.tokens_field(), profile.most_tokens(asked.parameters.max_output_tokens).into()),
            ("temperature", sampling.temperature.into()),
            ("top_p", sampling.top_p.into()),
            ("seed", sampling.seed.into()),
            ("reasoning_effort", profile.reasoning.clone().into()),
        ],
    );
    let (name, schema) = (form_name(asked), &asked.schema);
    match profile.structured() {
        Structured::JsonSchema => {
            let form = json!({ "name": name, "schema": schema, "strict": true });
            put(&mut body, [("response_format", json!({ "type": "json_schema", "json_schema": form }))]);
        }
        Structured::ForcedTool => {
            let mut function = tool_words(asked);
            put(&mut function, [("parameters", schema.clone())]);
            let choice = json!({ "type": "function", "function": { "name": name } });
            put(&mut body, [("tools", json!([{ "type": "function", "function": function }])), ("tool_choice", choice)]);
        }
        Structured::JsonObject => put(&mut body, [("response_format", json!({ "type": "json_object" }))]),
        Structured::PromptOnly => {}
    }
    if profile.stream {
        put(&mut body, [("stream", true.into()), ("stream_options", json!({ "include_usage": true }))]);
    }
    WireRequest { path: "/chat/completions".into(), headers: Vec::new(), body }
}

fn role(turn: &Turn) -> &'static str {
    match turn.who {
        Speaker::User => "user",
        Speaker::Assistant => "assistant",
    }
}

/// Words alone are a text, which every server takes.
fn content(turn: &Turn) -> Value {
    if turn.parts.iter().all(|part| matches!(part, Part::Text(_))) {
        return turn.text().into();
    }
    parts(
        turn,
        |words| json!({ "type": "text", "text": words }),
        |image| json!({ "type": "image_url", "image_url": { "url": data_url(image) } }),
    )
}

pub(super) fn reply(value: &Value) -> Result<Said, CallError> {
    let choice = value.pointer("/choices/0").ok_or_else(|| unreadable("it has no `choices`"))?;
    let usage = Usage {
        input: number_at(value, "/usage/prompt_tokens"),
        output: number_at(value, "/usage/completion_tokens"),
        reasoning: number_at(value, "/usage/completion_tokens_details/reasoning_tokens"),
        cached: number_at(value, "/usage/prompt_tokens_details/cached_tokens"),
    };
    let refusal = text_at(choice, "/message/refusal").filter(|words| !words.is_empty());
    let end = match text_at(choice, "/finish_reason") {
        _ if refusal.is_some() => EndReason::Refused,
        Some("stop" | "tool_calls" | "function_call") => EndReason::Complete,
        Some("length") => EndReason::MaxTokens,
        Some("content_filter") => EndReason::Refused,
        other => return Err(super::failure::no_end(other)),
    };
    let called = list_at(choice, "/message/tool_calls").find_map(|call| text_at(call, "/function/arguments"));
    let said = text_at(choice, "/message/content").filter(|words| !words.is_empty());
    let reasoning = ["/message/reasoning_content", "/message/reasoning"].into_iter().find_map(|at| text_at(choice, at));
    Ok(Said {
        text: refusal.or(called).or(said).unwrap_or_default().into(),
        reasoning: reasoning.filter(|words| !words.is_empty()).map(Into::into),
        usage,
        end,
        model: text_at(value, "/model").map(Into::into),
    })
}

/// The pieces of a streamed reply as a whole one.
pub(super) fn assemble(events: &[Value]) -> Value {
    let (mut text, mut reasoning, mut refusal, mut arguments) = Default::default();
    let add = |to: &mut String, piece: Option<&str>| to.push_str(piece.unwrap_or_default());
    let (mut end, mut usage, mut model) = (Value::Null, Value::Null, Value::Null);
    for event in events {
        add(&mut text, text_at(event, "/choices/0/delta/content"));
        add(&mut reasoning, text_at(event, "/choices/0/delta/reasoning_content"));
        add(&mut refusal, text_at(event, "/choices/0/delta/refusal"));
        for call in list_at(event, "/choices/0/delta/tool_calls") {
            if number_at(call, "/index") == 0 {
                add(&mut arguments, text_at(call, "/function/arguments"));
            }
        }
        for (kept, at) in [(&mut end, "/choices/0/finish_reason"), (&mut usage, "/usage"), (&mut model, "/model")] {
            if let Some(value) = event.pointer(at).filter(|value| !value.is_null()) {
                *kept = value.clone();
            }
        }
    }
    let mut message = object([("content", text.into())]);
    let calls = (!arguments.is_empty()).then(|| json!([{ "function": { "arguments": arguments } }]));
    put(&mut message, [("tool_calls", calls.into())]);
    put(&mut message, [("reasoning_content", reasoning.into()), ("refusal", refusal.into())]);
    json!({ "model": model, "usage": usage, "choices": [{ "message": message, "finish_reason": end }] })
}
