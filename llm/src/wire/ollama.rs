//! `ollama`: Ollama's own chat, which has options that its OpenAI-like one lacks, such as `num_ctx`.

use super::{Profile, Said, Structured, WireRequest, base64, number_at, put, system, text_at, tool_words, unreadable};
use crate::chat::{CallError, ChatRequest, EndReason, Part, Speaker, Turn, Usage};
use serde_json::{Value, json};

pub(super) fn request(asked: &ChatRequest, profile: &Profile) -> WireRequest {
    let mut messages = vec![json!({ "role": "system", "content": system(asked, profile) })];
    messages.extend(asked.turns.iter().map(turn));
    let mut options = Value::Object(profile.options.clone());
    let sampling = profile.sampling;
    put(
        &mut options,
        [
            ("num_predict", profile.most_tokens(asked.parameters.max_output_tokens).into()),
            ("temperature", sampling.temperature.into()),
            ("top_p", sampling.top_p.into()),
            ("seed", sampling.seed.into()),
        ],
    );
    let mut body =
        json!({ "model": profile.model, "messages": messages, "options": options, "stream": profile.stream });
    // Several of its models heed the schema only where nothing is said of thinking, so nothing is said by default.
    put(&mut body, [("think", profile.reasoning.as_deref().map(think).into())]);
    match profile.structured() {
        Structured::JsonSchema => put(&mut body, [("format", asked.schema.clone())]),
        Structured::JsonObject => put(&mut body, [("format", "json".into())]),
        // It has no field that forces a tool: the model may or may not call it.
        Structured::ForcedTool => {
            let mut function = tool_words(asked);
            put(&mut function, [("parameters", asked.schema.clone())]);
            put(&mut body, [("tools", json!([{ "type": "function", "function": function }]))]);
        }
        Structured::PromptOnly => {}
    }
    WireRequest { path: "/api/chat".into(), headers: Vec::new(), body }
}

fn think(words: &str) -> Value {
    match words {
        "true" => true.into(),
        "false" => false.into(),
        level => level.into(),
    }
}

fn turn(turn: &Turn) -> Value {
    let role = match turn.who {
        Speaker::User => "user",
        Speaker::Assistant => "assistant",
    };
    let mut message = json!({ "role": role, "content": turn.text() });
    let images: Vec<Value> = turn
        .parts
        .iter()
        .filter_map(|part| if let Part::Image(image) = part { Some(base64(image).into()) } else { None })
        .collect();
    let images = (!images.is_empty()).then_some(images);
    put(&mut message, [("images", images.into())]);
    message
}

pub(super) fn reply(value: &Value) -> Result<Said, CallError> {
    let message = value.get("message").ok_or_else(|| unreadable("it has no `message`"))?;
    let end = match (value.get("done").and_then(Value::as_bool), text_at(value, "/done_reason")) {
        (Some(true), Some("length")) => EndReason::MaxTokens,
        (Some(true), Some("stop") | None) => EndReason::Complete,
        (_, other) => return Err(super::failure::no_end(other)),
    };
    let called = message.pointer("/tool_calls/0/function/arguments").map(Value::to_string);
    let reasoning = text_at(message, "/thinking").filter(|words| !words.is_empty());
    Ok(Said {
        text: called.or(text_at(message, "/content").map(Into::into)).unwrap_or_default(),
        reasoning: reasoning.map(Into::into),
        usage: Usage {
            input: number_at(value, "/prompt_eval_count"),
            output: number_at(value, "/eval_count"),
            ..Usage::default()
        },
        end,
        model: text_at(value, "/model").map(Into::into),
    })
}

/// The pieces of a streamed reply as a whole one.
pub(super) fn assemble(events: &[Value]) -> Value {
    let mut whole = events.last().cloned().unwrap_or_else(|| json!({}));
    let text = |at: &str| events.iter().filter_map(|event| text_at(event, at)).collect::<String>();
    let calls = events.iter().find_map(|event| event.pointer("/message/tool_calls")).cloned();
    let mut message = json!({ "content": text("/message/content"), "thinking": text("/message/thinking") });
    put(&mut message, [("tool_calls", calls.into())]);
    put(&mut whole, [("message", message)]);
    whole
}
