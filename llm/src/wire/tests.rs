//! What each format sends, compared with golden files, and what it makes of replies written by hand after the formats'
//! own types. `ACM_BLESS=1` writes the golden files anew. The same files are checked against the types of the official
//! clients by `tests/servers.rs`.

use super::*;
use crate::chat::tests::request as plain;
use std::{fs, path::PathBuf};

fn golden(name: &str, value: &Value) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src/wire/golden").join(format!("{name}.json"));
    let text = serde_json::to_string_pretty(value).unwrap() + "\n";
    if std::env::var_os("ACM_BLESS").is_some() {
        fs::write(&path, &text).unwrap();
    }
    let kept = fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(text, kept, "{}: run with ACM_BLESS=1 if the new body is right", path.display());
}

/// A question with a picture and a repair.
fn asked() -> ChatRequest {
    let mut asked = plain("How many cubes?");
    asked.turns[0].parts.push(Part::Image(Image::new("image/png", &b"\x89PNG"[..])));
    asked.turns.push(Turn::assistant("many"));
    asked.turns.push(Turn::user("That is no JSON."));
    asked
}

fn profile(wire: Wire, structured: Structured) -> Profile {
    Profile { structured, ..Profile::new(wire, "model-1") }
}

fn replied(wire: Wire, body: &Value) -> Result<Said, CallError> {
    reply(&Profile::new(wire, "m"), 200, &Headers::new(), body.to_string().as_bytes())
}

fn streamed(wire: Wire, body: &str) -> Result<Said, CallError> {
    reply(&Profile { stream: true, ..Profile::new(wire, "m") }, 200, &Headers::new(), body.as_bytes())
}

fn usage(input: u64, output: u64, reasoning: u64, cached: u64) -> Usage {
    Usage { input, output, reasoning, cached }
}

#[test]
fn every_format_sends_its_golden_body_in_every_way_of_telling_a_schema() {
    let ways = [
        ("json_schema", Structured::JsonSchema),
        ("forced_tool", Structured::ForcedTool),
        ("json_object", Structured::JsonObject),
        ("prompt_only", Structured::PromptOnly),
    ];
    for wire in Wire::ALL {
        for (name, way) in ways {
            let made = request(&asked(), &profile(wire, way)).unwrap();
            golden(&format!("{wire}.{name}"), &serde_json::to_value(&made).unwrap());
        }
        // The models behind `anthropic` take no sampling.
        let sampling = Sampling { temperature: Some(0.0), top_p: Some(0.9), seed: Some(7) };
        let all = Profile {
            stream: true,
            reasoning: Some("low".into()),
            sampling: if wire == Wire::Anthropic { Sampling::default() } else { sampling },
            max_output_tokens: Some(50),
            ..profile(wire, Structured::JsonSchema)
        };
        let made = request(&plain("How many cubes?"), &all).unwrap();
        golden(&format!("{wire}.all_set"), &serde_json::to_value(&made).unwrap());
    }
}

#[test]
fn nothing_of_sampling_is_sent_unless_it_is_set() {
    for wire in Wire::ALL {
        let text = request(&plain("x"), &Profile::new(wire, "m")).unwrap().body.to_string();
        for name in ["temperature", "top_p", "topP", "seed", "effort", "think", "null"] {
            assert!(!text.contains(name), "{wire}: {text}");
        }
    }
}

#[test]
fn a_backend_without_eyes_and_a_picture_without_pixels_are_refused() {
    let blind = Profile { images: false, ..Profile::new(Wire::Gemini, "m") };
    assert!(matches!(request(&asked(), &blind), Err(CallError::Unable { reason }) if reason.contains("caps.images")));
    let read: ChatRequest = serde_json::from_slice(&asked().canonical().unwrap()).unwrap();
    assert!(matches!(request(&read, &Profile::new(Wire::Gemini, "m")), Err(CallError::Unable { .. })));
}

#[test]
fn extra_fields_go_over_the_body_and_learned_ones_out_of_it() {
    let mut profile = Profile::new(Wire::Gemini, "m");
    profile.sampling.seed = Some(7);
    profile.extra_body = serde_json::from_str(r#"{"generationConfig": {"topK": 3}, "x": 1}"#).unwrap();
    let body = request(&plain("x"), &profile).unwrap().body;
    assert_eq!((&body["generationConfig"]["topK"], &body["generationConfig"]["seed"]), (&3.into(), &7.into()));
    let told = profile.learned.clone().learn(&profile, &body, "seed", "").unwrap();
    assert!(told.contains("generationConfig.seed"), "{told}");
    let mut learned = Learned::default();
    assert!(learned.learn(&profile, &body, "seed", "").is_some());
    assert_eq!(learned.learn(&profile, &body, "contents", ""), None, "nothing is asked without it");
    assert_eq!(learned.learn(&profile, &body, "nonsense", ""), None);
    profile.learned = learned;
    assert!(request(&plain("x"), &profile).unwrap().body["generationConfig"].get("seed").is_none());
}

#[test]
fn a_refused_way_of_telling_the_schema_leaves_the_prompt() {
    for (wire, parameter) in [
        (Wire::OpenaiChat, "response_format"),
        (Wire::OpenaiResponses, "text.format"),
        (Wire::Anthropic, "output_config.format"),
        (Wire::Gemini, "generationConfig.responseJsonSchema"),
    ] {
        let mut profile = Profile::new(wire, "m");
        let body = request(&plain("x"), &profile).unwrap().body;
        assert!(!body.to_string().contains("Answer with one JSON object"));
        let mut learned = Learned::default();
        assert!(learned.learn(&profile, &body, parameter, "").is_some(), "{wire}");
        profile.learned = learned;
        let body = request(&plain("x"), &profile).unwrap().body.to_string();
        assert!(body.contains("Answer with one JSON object") && !body.contains("json_schema"), "{body}");
    }
    let mut profile = Profile::new(Wire::OpenaiChat, "m");
    let body = request(&plain("x"), &profile).unwrap().body;
    let mut learned = Learned::default();
    assert_eq!(learned.learn(&profile, &body, "max_tokens", "too large"), None);
    assert!(learned.learn(&profile, &body, "max_tokens", "Use 'max_completion_tokens' instead.").is_some());
    profile.learned = learned;
    let body = request(&plain("x"), &profile).unwrap().body;
    assert!(body.get("max_tokens").is_none() && body["max_completion_tokens"] == 100);
}

#[test]
fn whole_replies_are_read() {
    let chat = json!({"model": "gpt", "choices": [{"finish_reason": "stop", "message": {"content": "{}", "refusal": null}}],
        "usage": {"prompt_tokens": 10, "completion_tokens": 6, "prompt_tokens_details": {"cached_tokens": 4},
        "completion_tokens_details": {"reasoning_tokens": 5}}});
    let said = replied(Wire::OpenaiChat, &chat).unwrap();
    assert_eq!((said.text.as_str(), said.usage, said.end), ("{}", usage(10, 6, 5, 4), EndReason::Complete));
    let refused = json!({"choices": [{"finish_reason": "stop", "message": {"content": null, "refusal": "no"}}]});
    assert_eq!(replied(Wire::OpenaiChat, &refused).unwrap().end, EndReason::Refused);

    let responses = json!({"status": "incomplete", "incomplete_details": {"reason": "max_output_tokens"}, "model": "gpt",
        "output": [{"type": "reasoning", "summary": [{"type": "summary_text", "text": "hm"}]},
            {"type": "message", "content": [{"type": "output_text", "text": "{\"a\""}]}],
        "usage": {"input_tokens": 9, "output_tokens": 8, "input_tokens_details": {"cached_tokens": 3},
            "output_tokens_details": {"reasoning_tokens": 7}}});
    let said = replied(Wire::OpenaiResponses, &responses).unwrap();
    assert_eq!((said.text.as_str(), said.usage, said.end), ("{\"a\"", usage(9, 8, 7, 3), EndReason::MaxTokens));
    assert_eq!(said.reasoning.as_deref(), Some("hm"));

    let messages = json!({"model": "claude", "stop_reason": "tool_use", "content": [
            {"type": "thinking", "thinking": "hm"}, {"type": "tool_use", "name": "parse", "input": {"count": 2}}],
        "usage": {"input_tokens": 5, "cache_read_input_tokens": 20, "cache_creation_input_tokens": 3, "output_tokens": 4}});
    let said = replied(Wire::Anthropic, &messages).unwrap();
    assert_eq!((said.text.as_str(), said.usage), ("{\"count\":2}", usage(28, 4, 0, 20)));
    let full = json!({"stop_reason": "model_context_window_exceeded", "content": []});
    assert!(matches!(replied(Wire::Anthropic, &full), Err(CallError::ContextTooLong { .. })));

    let gemini = json!({"modelVersion": "gemini", "candidates": [{"finishReason": "STOP", "content": {"parts": [
            {"text": "hm", "thought": true}, {"text": "{\"a\":"}, {"text": "1}"}]}}],
        "usageMetadata": {"promptTokenCount": 11, "candidatesTokenCount": 3, "thoughtsTokenCount": 6, "cachedContentTokenCount": 2}});
    let said = replied(Wire::Gemini, &gemini).unwrap();
    assert_eq!((said.text.as_str(), said.usage), ("{\"a\":1}", usage(11, 9, 6, 2)));
    let blocked = json!({"promptFeedback": {"blockReason": "SAFETY"}});
    assert_eq!(replied(Wire::Gemini, &blocked).unwrap().end, EndReason::Refused);

    let ollama = json!({"model": "qwen", "done": true, "done_reason": "length", "prompt_eval_count": 12, "eval_count": 13,
        "message": {"role": "assistant", "content": "{", "thinking": "hm"}});
    let said = replied(Wire::Ollama, &ollama).unwrap();
    assert_eq!(
        (said.usage, said.end, said.reasoning.as_deref()),
        (usage(12, 13, 0, 0), EndReason::MaxTokens, Some("hm"))
    );
}

#[test]
fn what_is_no_reply_is_an_error_and_never_an_empty_answer() {
    for wire in Wire::ALL {
        for body in ["", "<html>", "[]", "{}", "null", "{\"choices\": []}", "\u{7f}\u{0}"] {
            let whole = reply(&Profile::new(wire, "m"), 200, &Headers::new(), body.as_bytes());
            assert!(whole.is_err(), "{wire}: {body} gave {whole:?}");
            let streamed = streamed(wire, body);
            assert!(streamed.is_err(), "{wire}: {body} gave {streamed:?}");
        }
    }
}

/// Streams with each event on a line of its own.
const STREAMS: [(Wire, &str); 5] = [
    (
        Wire::OpenaiChat,
        r#"data: {"model":"m","choices":[{"delta":{"role":"assistant","content":""}}]}

data: {"choices":[{"delta":{"content":"{\"a\""}}]}

data: {"choices":[{"delta":{"content":":1}"}}]}

data: {"choices":[{"delta":{},"finish_reason":"stop"}]}

data: {"choices":[],"usage":{"prompt_tokens":3,"completion_tokens":2}}

data: [DONE]

"#,
    ),
    (
        Wire::OpenaiResponses,
        r#"event: response.created
data: {"type":"response.created","response":{"status":"in_progress","output":[]}}

event: response.output_text.delta
data: {"type":"response.output_text.delta","delta":"{\"a\":1}"}

event: response.completed
data: {"type":"response.completed","response":{"status":"completed","output":[{"type":"message","content":[{"type":"output_text","text":"{\"a\":1}"}]}],"usage":{"input_tokens":3,"output_tokens":2}}}

"#,
    ),
    (
        Wire::Anthropic,
        r#"event: message_start
data: {"type":"message_start","message":{"model":"m","content":[],"stop_reason":null,"usage":{"input_tokens":3,"output_tokens":1}}}

event: content_block_start
data: {"type":"content_block_start","index":0,"content_block":{"type":"tool_use","name":"parse","input":{}}}

event: ping
data: {"type":"ping"}

event: content_block_delta
data: {"type":"content_block_delta","index":0,"delta":{"type":"input_json_delta","partial_json":"{\"a\""}}

event: content_block_delta
data: {"type":"content_block_delta","index":0,"delta":{"type":"input_json_delta","partial_json":":1}"}}

event: content_block_stop
data: {"type":"content_block_stop","index":0}

event: message_delta
data: {"type":"message_delta","delta":{"stop_reason":"tool_use","stop_sequence":null},"usage":{"output_tokens":2}}

event: message_stop
data: {"type":"message_stop"}

"#,
    ),
    (
        Wire::Gemini,
        r#"data: {"candidates":[{"content":{"role":"model","parts":[{"text":"{\"a\""}]}}],"modelVersion":"m"}

data: {"candidates":[{"content":{"role":"model","parts":[{"text":":1}"}]},"finishReason":"STOP"}],"usageMetadata":{"promptTokenCount":3,"candidatesTokenCount":2}}

"#,
    ),
    (
        Wire::Ollama,
        r#"{"model":"m","message":{"content":"{\"a\""},"done":false}
{"model":"m","message":{"content":":1}"},"done":false}
{"model":"m","message":{"content":""},"done":true,"done_reason":"stop","prompt_eval_count":3,"eval_count":2}
"#,
    ),
];

#[test]
fn streamed_replies_are_read_and_a_stream_that_is_cut_anywhere_is_no_answer() {
    for (wire, stream) in STREAMS {
        let said = streamed(wire, stream).unwrap();
        assert_eq!(
            (said.text.as_str(), said.usage, said.end),
            ("{\"a\":1}", usage(3, 2, 0, 0), EndReason::Complete),
            "{wire}"
        );
        // From the event on that tells the end the answer is whole.
        let ending = ["\"stop\"", "response.completed\",", "\"stop_reason\":\"tool_use\"", "\"STOP\"", "\"done\":true"];
        let end = ending.into_iter().filter_map(|words| stream.rfind(words)).max().unwrap();
        for at in (0..end).filter(|at| stream.is_char_boundary(*at)) {
            let cut = streamed(wire, &stream[..at]);
            assert!(matches!(cut, Err(CallError::BrokenOff { .. })), "{wire} cut at {at}: {cut:?}");
        }
        let damaged = stream.replacen(":1}", "", 1).replacen("\"model\"", "\"model", 1).replacen(
            "response\":{\"st",
            "response",
            1,
        );
        let damaged = damaged.replacen("{\"candidates", "{candidates", 1);
        assert!(matches!(streamed(wire, &damaged), Err(CallError::BrokenOff { .. })), "{wire}");
    }
    let failed = "data: {\"type\":\"error\",\"error\":{\"type\":\"overloaded_error\",\"message\":\"Overloaded\"}}\n\n";
    assert_eq!(streamed(Wire::Anthropic, failed), Err(CallError::Overloaded));
}

#[test]
fn a_fence_round_the_whole_answer_is_taken_off_where_the_schema_was_told_in_words() {
    for (text, inside) in [
        ("```json\n{\"a\": 1}\n```\n", "{\"a\": 1}"),
        ("{\"a\": 1}", "{\"a\": 1}"),
        ("Here: ```\n{}\n```", "Here: ```\n{}\n```"),
        ("```\n{}\n```\nor\n```\n{}\n```", "```\n{}\n```\nor\n```\n{}\n```"),
    ] {
        let body = json!({"choices": [{"finish_reason": "stop", "message": {"content": text}}]}).to_string();
        let said = |way| reply(&profile(Wire::OpenaiChat, way), 200, &Headers::new(), body.as_bytes()).unwrap().text;
        assert_eq!(said(Structured::PromptOnly), inside);
        assert_eq!(said(Structured::JsonSchema), text);
    }
}

#[test]
fn a_damaged_event_is_noticed_as_it_comes_and_a_sound_one_never() {
    for (wire, stream) in STREAMS {
        let mut watch = Watch::new(wire);
        for at in 0..=stream.len() {
            assert_eq!(watch.look(&stream.as_bytes()[..at]), Ok(()), "{wire} at {at}");
        }
        let damaged = format!("{stream}{}", if wire == Wire::Ollama { "{\"a\n" } else { "data: {\"a\n\n" });
        assert!(watch.look(damaged.as_bytes()).is_err(), "{wire}");
    }
}
