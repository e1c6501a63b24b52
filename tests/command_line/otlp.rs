//! `acm trace export --otlp`: spans for the tools of OpenTelemetry.

use crate::{
    other_programs::{answer, script},
    refuses,
    trace::{prints, trace},
};
use serde_json::Value;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    io::{BufRead, BufReader, Read},
    net::TcpListener,
    process::Stdio,
};

fn messages() -> Vec<Value> {
    let all: Value = serde_json::from_str(&prints(&["trace", "show", trace().to_str().unwrap(), "--json"])).unwrap();
    all["messages"].as_array().unwrap().clone()
}

/// The spans of the run in which a grasp slips.
fn spans() -> Vec<Value> {
    let text = prints(&["trace", "export", trace().to_str().unwrap(), "--otlp", "-"]);
    let request: Value = serde_json::from_str(&text).unwrap();
    request["resourceSpans"][0]["scopeSpans"][0]["spans"].as_array().unwrap().clone()
}

fn attribute<'a>(span: &'a Value, key: &str) -> &'a Value {
    let pair = span["attributes"].as_array().unwrap().iter().find(|pair| pair["key"] == key);
    pair.map_or(&Value::Null, |pair| pair["value"].as_object().unwrap().values().next().unwrap())
}

fn nanoseconds(span: &Value, end: &str) -> u64 {
    span[format!("{end}TimeUnixNano")].as_str().unwrap().parse().unwrap()
}

#[test]
fn spans_lie_within_each_other_as_the_work_did() {
    let spans = spans();
    let by_id: BTreeMap<&str, &Value> = spans.iter().map(|span| (span["spanId"].as_str().unwrap(), span)).collect();
    assert_eq!(by_id.len(), spans.len());
    let (roots, within): (Vec<_>, Vec<_>) = spans.iter().partition(|span| span.get("parentSpanId").is_none());
    assert_eq!(roots.len(), 1);
    assert_eq!(attribute(roots[0], "gen_ai.operation.name"), "invoke_agent");
    let parent = |span: &Value| by_id[span["parentSpanId"].as_str().unwrap()];
    for span in &within {
        assert_eq!(span["traceId"], roots[0]["traceId"]);
        let (outer, inner) = (parent(span), span);
        assert!(nanoseconds(outer, "start") <= nanoseconds(inner, "start"), "{inner} in {outer}");
        assert!(nanoseconds(outer, "end") >= nanoseconds(inner, "end"), "{inner} in {outer}");
        for link in span.get("links").and_then(Value::as_array).into_iter().flatten() {
            assert!(by_id.contains_key(link["spanId"].as_str().unwrap()), "{span}");
        }
    }
    // Each skill lies in the step that decided on it, and that in a subtask.
    let skills: Vec<&&Value> = within.iter().filter(|span| attribute(span, "gen_ai.tool.name") == "pick").collect();
    assert!(skills.len() > 2, "{} picks", skills.len());
    for skill in skills {
        let step = parent(skill);
        assert_eq!((&step["name"], &parent(step)["name"]), (&"step".into(), &"subtask".into()));
        assert!(attribute(step, "acm.step.decision").as_str().unwrap().starts_with("pick "), "{step}");
    }
}

#[test]
fn there_is_a_span_for_each_call_and_what_failed_says_so() {
    let (spans, messages) = (spans(), messages());
    let of = |key: &str, value: &str| spans.iter().filter(|span| attribute(span, key) == value).collect::<Vec<_>>();
    let sent = |kinds: &[&str]| messages.iter().filter(|m| kinds.contains(&m["kind"].as_str().unwrap())).count();
    for (operation, kinds) in [
        ("execute_tool", &["execute", "retreat"][..]),
        ("plan", &["parse", "decide"]),
        ("search_memory", &["look"]),
        ("update_memory", &["percepts", "note", "record", "settle"]),
    ] {
        assert_eq!(of("gen_ai.operation.name", operation).len(), sent(kinds), "{operation}");
    }
    // As long as the skill took in the robot's world.
    let execute = messages.iter().find(|message| message["kind"] == "execute").unwrap();
    let ended = messages.iter().find(|message| message["kind"] == "skill-ended").unwrap();
    let skill = of("gen_ai.tool.call.id", &execute["seq"].to_string())[0];
    let took = ended["t"].as_u64().unwrap() - execute["t"].as_u64().unwrap();
    assert_eq!(nanoseconds(skill, "end") - nanoseconds(skill, "start"), took);
    assert_eq!(skill["name"], format!("execute_tool {}", execute["body"]["skill"].as_str().unwrap()));
    // The grasp that slipped: its step failed, and the spans say of what.
    let failed: Vec<&Value> = spans.iter().filter(|span| span["status"]["code"] == 2).collect();
    assert!(failed.iter().any(|span| span["name"] == "step"), "{failed:#?}");
    assert!(failed.iter().all(|span| !span["status"]["message"].as_str().unwrap().is_empty()));
    assert!(failed.iter().any(|span| attribute(span, "error.type").is_string()), "{failed:#?}");
}

#[test]
fn a_trace_gives_the_same_spans_again_and_no_content_unasked() {
    let spans = spans();
    assert_eq!(spans, self::spans());
    let keys: BTreeSet<&str> = spans
        .iter()
        .flat_map(|span| span["attributes"].as_array().unwrap())
        .map(|pair| pair["key"].as_str().unwrap())
        .collect();
    assert!(!keys.contains("gen_ai.tool.call.arguments"), "{keys:?}");
    let output = crate::acm()
        .args(["trace", "export", trace().to_str().unwrap(), "--otlp", "-"])
        .env("OTEL_INSTRUMENTATION_GENAI_CAPTURE_MESSAGE_CONTENT", "true")
        .output()
        .unwrap();
    assert!(String::from_utf8(output.stdout).unwrap().contains("gen_ai.tool.call.arguments"));
}

/// What comes over the wire is parsed with OpenTelemetry's own message types; `scripts/setup.sh` installs them.
#[test]
fn a_collector_takes_the_spans() {
    let Some(mut collector) = script("take_spans.py") else { return };
    let mut child = collector.stdout(Stdio::piped()).spawn().unwrap();
    let mut printed = BufReader::new(child.stdout.take().unwrap());
    let mut port = String::new();
    printed.read_line(&mut port).unwrap();
    prints(&["trace", "export", trace().to_str().unwrap(), "--otlp", &format!("http://127.0.0.1:{}", port.trim())]);
    let mut found = String::new();
    printed.read_to_string(&mut found).unwrap();
    assert!(child.wait().unwrap().success());
    let found: Value = serde_json::from_str(&found).unwrap();
    assert_eq!(found["resource"]["acm.scenario"], "put-back-block");
    // The same as in a file, for them and for us.
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("spans.json");
    prints(&["trace", "export", trace().to_str().unwrap(), "--otlp", path.to_str().unwrap()]);
    let Some(mut reader) = script("take_spans.py") else { return };
    assert_eq!(found, answer(reader.arg(&path)));
    let ours = spans();
    let theirs = found["spans"].as_array().unwrap();
    assert_eq!(theirs.len(), ours.len());
    for (theirs, ours) in theirs.iter().zip(&ours) {
        assert_eq!(theirs["id"], ours["spanId"]);
        assert_eq!(theirs["parent"], *ours.get("parentSpanId").unwrap_or(&Value::Null));
        assert_eq!(theirs["start"].as_u64().unwrap(), nanoseconds(ours, "start"));
        assert_eq!(theirs["attributes"]["acm.seq"].to_string(), attribute(ours, "acm.seq").as_str().unwrap());
    }
}

/// A collector that gives each post the same answer.
#[expect(clippy::disallowed_methods, reason = "a collector is another program, and this one ends with the test's")]
fn collector(status: u16, body: &'static str) -> String {
    let server = tiny_http::Server::http("127.0.0.1:0").unwrap();
    let address = format!("http://{}", server.server_addr());
    std::thread::spawn(move || {
        for mut request in server.incoming_requests() {
            std::io::copy(request.as_reader(), &mut std::io::sink()).unwrap();
            request.respond(tiny_http::Response::from_string(body).with_status_code(status)).unwrap();
        }
    });
    address
}

#[test]
fn a_collector_that_is_not_there_or_refuses_is_one_clear_error() {
    let export = |target: &str, parts: &[&str]| {
        refuses(&["trace", "export", trace().to_str().unwrap(), "--otlp", target], parts);
    };
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    export(&format!("http://{nobody}"), &[&nobody.to_string(), "cannot be reached", "refused"]);
    export(&collector(503, "too busy\njust now"), &["refuses the spans", "503", "too busy just now"]);
    let partial = r#"{"partialSuccess":{"rejectedSpans":"7","errorMessage":"too old"}}"#;
    export(&collector(200, partial), &["did not take 7 spans: too old"]);
    export("https://far.example", &["https://far.example", "without encryption"]);
    export("http://no host", &["http://no host", "http://HOST:PORT"]);
    export("no/such/folder/spans.json", &["no/such/folder/spans.json cannot be written"]);
    // One that takes everything.
    let taken = collector(200, "{}");
    prints(&["trace", "export", trace().to_str().unwrap(), "--otlp", &taken]);
    assert!(!fs::exists("spans.json").unwrap());
}
