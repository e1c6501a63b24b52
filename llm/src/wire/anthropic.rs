//! `anthropic`: Messages.

use super::{
    Profile, Said, Structured, WireRequest, base64, form_name, joined, list_at, number_at, parts, put, system, text_at,
    tool_words, unreadable,
};
use crate::chat::{CallError, ChatRequest, EndReason, Speaker, Turn, Usage};
use serde_json::{Map, Value, json};

const VERSION: &str = "2023-06-01";
/// Bounds of a schema that the server does not take; they are checked here all the same.
const UNTAKEN: [&str; 11] = [
    "minimum",
    "maximum",
    "exclusiveMinimum",
    "exclusiveMaximum",
    "multipleOf",
    "minLength",
    "maxLength",
    "minItems",
    "maxItems",
    "uniqueItems",
    "pattern",
];

pub(super) fn request(asked: &ChatRequest, profile: &Profile) -> WireRequest {
    let messages: Vec<Value> = asked.turns.iter().map(turn).collect();
    let mut body = json!({
        "model": profile.model,
        "max_tokens": profile.most_tokens(asked.parameters.max_output_tokens),
        "system": system(asked, profile),
        "messages": messages,
    });
    let mut output = Value::Object(Map::new());
    put(&mut output, [("effort", profile.reasoning.clone().into())]);
    match profile.structured() {
        Structured::JsonSchema => {
            put(&mut output, [("format", json!({ "type": "json_schema", "schema": unbounded(&asked.schema) }))]);
        }
        Structured::ForcedTool => {
            let mut tool = tool_words(asked);
            put(&mut tool, [("input_schema", asked.schema.clone())]);
            let choice = json!({ "type": "tool", "name": form_name(asked) });
            put(&mut body, [("tools", json!([tool])), ("tool_choice", choice)]);
        }
        Structured::JsonObject | Structured::PromptOnly => {}
    }
    let output = output.as_object().is_some_and(|fields| !fields.is_empty()).then_some(output);
    put(
        &mut body,
        [
            ("output_config", output.into()),
            ("temperature", profile.sampling.temperature.into()),
            ("top_p", profile.sampling.top_p.into()),
            ("stream", profile.stream.then_some(true).into()),
        ],
    );
    WireRequest { path: "/v1/messages".into(), headers: vec![("anthropic-version", VERSION.into())], body }
}

fn turn(turn: &Turn) -> Value {
    let role = match turn.who {
        Speaker::User => "user",
        Speaker::Assistant => "assistant",
    };
    let content = parts(
        turn,
        |words| json!({ "type": "text", "text": words }),
        |image| {
            let source = json!({ "type": "base64", "media_type": image.media_type, "data": base64(image) });
            json!({ "type": "image", "source": source })
        },
    );
    json!({ "role": role, "content": content })
}

/// A schema without the bounds that the server does not take.
fn unbounded(schema: &Value) -> Value {
    match schema {
        Value::Object(fields) => {
            let kept = fields.iter().filter(|(name, value)| {
                // A property may have such a name: its value is a schema.
                !UNTAKEN.contains(&name.as_str()) || value.is_object()
            });
            Value::Object(kept.map(|(name, value)| (name.clone(), unbounded(value))).collect())
        }
        Value::Array(items) => Value::Array(items.iter().map(unbounded).collect()),
        plain => plain.clone(),
    }
}

pub(super) fn reply(value: &Value) -> Result<Said, CallError> {
    if !value.get("content").is_some_and(Value::is_array) {
        return Err(unreadable("it has no `content`"));
    }
    let blocks = |kind: &'static str| list_at(value, "/content").filter(move |b| text_at(b, "/type") == Some(kind));
    let called = blocks("tool_use").find_map(|block| block.get("input")).map(Value::to_string);
    let text = joined(blocks("text").filter_map(|block| text_at(block, "/text")));
    let end = match text_at(value, "/stop_reason") {
        Some("end_turn" | "stop_sequence" | "tool_use") => EndReason::Complete,
        Some("max_tokens") => EndReason::MaxTokens,
        Some("refusal") => EndReason::Refused,
        Some("model_context_window_exceeded") => {
            return Err(CallError::ContextTooLong { reason: "model_context_window_exceeded".into() });
        }
        other => return Err(super::failure::no_end(other)),
    };
    let cached = number_at(value, "/usage/cache_read_input_tokens");
    let written = number_at(value, "/usage/cache_creation_input_tokens");
    Ok(Said {
        text: called.or(text).unwrap_or_default(),
        reasoning: joined(blocks("thinking").filter_map(|block| text_at(block, "/thinking"))),
        usage: Usage {
            // What came from a cache or went into one is not in `input_tokens`.
            input: number_at(value, "/usage/input_tokens").saturating_add(cached).saturating_add(written),
            output: number_at(value, "/usage/output_tokens"),
            reasoning: number_at(value, "/usage/output_tokens_details/thinking_tokens"),
            cached,
        },
        end,
        model: text_at(value, "/model").map(Into::into),
    })
}

/// The pieces of a streamed reply as a whole one.
pub(super) fn assemble(events: &[Value]) -> Value {
    let mut message = events.iter().find_map(|event| event.get("message")).cloned().unwrap_or_else(|| json!({}));
    let mut blocks: Vec<(Value, String)> = Vec::new();
    for event in events {
        match text_at(event, "/type") {
            Some("content_block_start") => {
                blocks.push((event.get("content_block").cloned().unwrap_or_default(), String::new()));
            }
            Some("content_block_delta") => {
                let pieces = ["/delta/text", "/delta/partial_json", "/delta/thinking"];
                if let Some((_, pieced)) = blocks.last_mut() {
                    pieced.push_str(pieces.into_iter().find_map(|at| text_at(event, at)).unwrap_or_default());
                }
            }
            Some("message_delta") => {
                super::merge(&mut message, event.get("delta").unwrap_or(&Value::Null));
                if let Some(usage) = event.get("usage") {
                    super::merge(&mut message, &json!({ "usage": usage }));
                }
            }
            _ => {}
        }
    }
    let content: Vec<Value> = blocks.into_iter().map(|(block, pieced)| finished(block, pieced)).collect();
    super::merge(&mut message, &json!({ "content": content }));
    message
}

fn finished(mut block: Value, pieced: String) -> Value {
    let (field, value) = match text_at(&block, "/type") {
        // Arguments that are no JSON stay a text, and are no object of any schema.
        Some("tool_use") => ("input", serde_json::from_str(&pieced).unwrap_or(Value::String(pieced))),
        Some("thinking") => ("thinking", pieced.into()),
        _ => ("text", pieced.into()),
    };
    put(&mut block, [(field, value)]);
    block
}
