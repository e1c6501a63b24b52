//! `gemini`: generateContent.

use super::{
    Profile, Said, Structured, WireRequest, base64, form_name, joined, list_at, number_at, object, parts, put, system,
    text_at, tool_words,
};
use crate::chat::{CallError, ChatRequest, EndReason, Speaker, Turn, Usage};
use serde_json::{Value, json};

pub(super) fn request(asked: &ChatRequest, profile: &Profile) -> WireRequest {
    let contents: Vec<Value> = asked.turns.iter().map(turn).collect();
    let sampling = profile.sampling;
    let mut config = object([
        ("maxOutputTokens", profile.most_tokens(asked.parameters.max_output_tokens).into()),
        ("temperature", sampling.temperature.into()),
        ("topP", sampling.top_p.into()),
        ("seed", sampling.seed.into()),
        ("thinkingConfig", profile.reasoning.as_ref().map(|level| json!({ "thinkingLevel": level })).into()),
    ]);
    let mut body =
        json!({ "contents": contents, "systemInstruction": { "parts": [{ "text": system(asked, profile) }] } });
    let json_type = ("responseMimeType", Value::from("application/json"));
    match profile.structured() {
        Structured::JsonSchema => put(&mut config, [json_type, ("responseJsonSchema", asked.schema.clone())]),
        Structured::JsonObject => put(&mut config, [json_type]),
        Structured::ForcedTool => {
            let mut tool = tool_words(asked);
            put(&mut tool, [("parametersJsonSchema", asked.schema.clone())]);
            let calling = json!({ "mode": "ANY", "allowedFunctionNames": [form_name(asked)] });
            put(
                &mut body,
                [
                    ("tools", json!([{ "functionDeclarations": [tool] }])),
                    ("toolConfig", json!({ "functionCallingConfig": calling })),
                ],
            );
        }
        Structured::PromptOnly => {}
    }
    put(&mut body, [("generationConfig", config)]);
    let way = if profile.stream { "streamGenerateContent?alt=sse" } else { "generateContent" };
    WireRequest { path: format!("/v1beta/models/{}:{way}", profile.model), headers: Vec::new(), body }
}

fn turn(turn: &Turn) -> Value {
    let role = match turn.who {
        Speaker::User => "user",
        Speaker::Assistant => "model",
    };
    let parts = parts(
        turn,
        |words| json!({ "text": words }),
        |image| json!({ "inlineData": { "mimeType": image.media_type, "data": base64(image) } }),
    );
    json!({ "role": role, "parts": parts })
}

pub(super) fn reply(value: &Value) -> Result<Said, CallError> {
    let said = |thought: bool| {
        let parts = list_at(value, "/candidates/0/content/parts");
        let wanted = parts.filter(move |part| part.get("thought").and_then(Value::as_bool).unwrap_or(false) == thought);
        joined(wanted.filter_map(|part| text_at(part, "/text")))
    };
    let called = list_at(value, "/candidates/0/content/parts").find_map(|part| part.pointer("/functionCall/args"));
    let end = match (text_at(value, "/candidates/0/finishReason"), text_at(value, "/promptFeedback/blockReason")) {
        // What is malformed is for the check of the answer to find, and to ask for again.
        (Some("STOP" | "MALFORMED_FUNCTION_CALL" | "MALFORMED_RESPONSE" | "UNEXPECTED_TOOL_CALL"), _) => {
            EndReason::Complete
        }
        (Some("MAX_TOKENS"), _) => EndReason::MaxTokens,
        (
            Some(
                "SAFETY"
                | "RECITATION"
                | "LANGUAGE"
                | "BLOCKLIST"
                | "PROHIBITED_CONTENT"
                | "SPII"
                | "IMAGE_SAFETY"
                | "IMAGE_PROHIBITED_CONTENT"
                | "IMAGE_RECITATION",
            ),
            _,
        )
        | (None, Some(_)) => EndReason::Refused,
        (other, _) => return Err(super::failure::no_end(other)),
    };
    let thoughts = number_at(value, "/usageMetadata/thoughtsTokenCount");
    Ok(Said {
        text: called.map(Value::to_string).or_else(|| said(false)).unwrap_or_default(),
        reasoning: said(true),
        usage: Usage {
            input: number_at(value, "/usageMetadata/promptTokenCount"),
            // Thoughts are counted beside the candidates.
            output: number_at(value, "/usageMetadata/candidatesTokenCount").saturating_add(thoughts),
            reasoning: thoughts,
            cached: number_at(value, "/usageMetadata/cachedContentTokenCount"),
        },
        end,
        model: text_at(value, "/modelVersion").map(Into::into),
    })
}

/// The pieces of a streamed reply as a whole one: each has the form of a whole one.
pub(super) fn assemble(events: &[Value]) -> Value {
    let mut whole = json!({});
    let mut parts = Vec::new();
    for event in events {
        parts.extend(list_at(event, "/candidates/0/content/parts").cloned());
        super::merge(&mut whole, event);
    }
    if let Some(content) = whole.pointer_mut("/candidates/0/content") {
        super::merge(content, &json!({ "parts": parts }));
    }
    whole
}
