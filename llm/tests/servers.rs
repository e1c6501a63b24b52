//! The adapters against servers and types that are not ours. `scripts/llm_servers.sh` installs them; without them each test
//! says that it is skipped.
#![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict

use acm_llm::{
    Answer, Backend, CallError, ChatReply, ChatRequest, Dialogue, Fault, Next, Parameters, PromptId, Server,
    ServerConfig, Turn, Usage,
    server::RetryPolicy,
    wire::{Profile, Structured, Wire},
};
use serde_json::{Value, json};
use std::{
    io::{BufRead, BufReader},
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    time::Duration,
};

/// The four formats that llmock serves, each with what follows its address, and with a way of telling the schema that it
/// heeds.
const SERVED: [(Wire, &str, Structured); 4] = [
    (Wire::OpenaiChat, "/v1", Structured::JsonSchema),
    (Wire::OpenaiResponses, "/v1", Structured::JsonSchema),
    (Wire::Anthropic, "/anthropic", Structured::ForcedTool),
    (Wire::Gemini, "/gemini", Structured::JsonSchema),
];

/// A program of a folder beside the build; else says that a test is skipped.
fn installed(folder: &str, program: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join(folder).join(program);
    if path.exists() {
        return Some(path);
    }
    println!(
        "skipped: {} is missing; scripts/llm_servers.sh installs it where Python and a network are there",
        path.display()
    );
    None
}

/// A server that ends with the test.
struct Peer {
    process: Child,
    address: String,
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap()
}

/// llmock on a port that was free a moment ago.
fn llmock() -> Option<Peer> {
    let program = installed("python-llm", "bin/llmock")?;
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let mut command = Command::new(program);
    // Pieces come one by one, as those of a real server do: so a call can be ended in the middle of a stream.
    command
        .args(["serve", "--stream-chunk-delay-ms", "5", "--port", &port.to_string()])
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let peer = Peer { process: command.spawn().unwrap(), address: format!("http://127.0.0.1:{port}") };
    runtime().block_on(async {
        for _ in 0..600 {
            if tokio::net::TcpStream::connect(("127.0.0.1", port)).await.is_ok() {
                return;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        panic!("llmock does not begin to listen");
    });
    Some(peer)
}

impl Peer {
    fn control(&self, method: reqwest::Method, path: &str, body: &Value) -> Value {
        // The adapters' own client brings the ciphers that this one needs to begin.
        drop(Server::new(ServerConfig::new(&self.address, Profile::new(Wire::Ollama, "m"))).unwrap());
        let client = reqwest::Client::builder().no_proxy().build().unwrap();
        let call = client.request(method, format!("{}/_llmock/{path}", self.address)).body(body.to_string());
        runtime().block_on(async move {
            let response = call.header("content-type", "application/json").send().await.unwrap();
            assert!(response.status().is_success(), "{:?}", response.text().await);
            serde_json::from_str(&response.text().await.unwrap()).unwrap_or_default()
        })
    }

    /// Forgets what was, and does these things with what comes.
    fn will(&self, behaviors: Value) {
        self.control(reqwest::Method::POST, "reset", &json!({}));
        self.control(reqwest::Method::POST, "scenario", &json!({ "behaviors": behaviors }));
    }

    fn verdict(&self) -> Value {
        self.control(reqwest::Method::GET, "verdict", &json!({}))
    }
}

fn server(peer: &Peer, wire: Wire, base: &str, structured: Structured, stream: bool) -> Server {
    let profile = Profile { structured, stream, ..Profile::new(wire, "mock-model") };
    let mut config = ServerConfig::new(format!("{}{base}", peer.address), profile);
    config.retry = RetryPolicy { base: Duration::from_millis(100), ..RetryPolicy::default() };
    config.limits.idle = Duration::from_secs(3);
    Server::new(config).unwrap()
}

/// A question of the kind that the agent asks: nested, with enumerations and nulls.
fn question() -> ChatRequest {
    ChatRequest {
        stage: "parse".into(),
        prompt: PromptId { id: "parse".into(), version: 1 },
        system: "You read instructions for a robot.".into(),
        turns: vec![Turn::user("Put the red cube back.")],
        schema: json!({
            "type": "object", "additionalProperties": false, "required": ["things", "steps", "unclear"],
            "properties": {
                "things": { "type": "array", "items": {
                    "type": "object", "additionalProperties": false, "required": ["noun", "color"],
                    "properties": {
                        "noun": { "type": "string", "enum": ["cube", "button"] },
                        "color": { "type": ["string", "null"], "enum": ["red", "blue", null] }
                    }
                } },
                "steps": { "type": "array", "items": { "type": "integer" } },
                "unclear": { "type": ["string", "null"] }
            }
        }),
        parameters: Parameters { max_output_tokens: 400 },
    }
}

/// What a question with its repairs came to.
struct Outcome {
    accepted: Option<Value>,
    faults: Vec<Fault>,
    usage: Usage,
    last: Answer,
}

fn ask(server: &Server, question: ChatRequest) -> Outcome {
    let mut dialogue = Dialogue::new(question, 2).unwrap();
    let runtime = runtime();
    loop {
        let last: Answer = runtime.block_on(server.chat(dialogue.request())).into();
        let accepted = match dialogue.take(&last, |json| Ok(json.clone())) {
            Next::Ask => continue,
            Next::Accepted(value) => Some(value),
            Next::GaveUp(_) => None,
        };
        return Outcome { accepted, faults: dialogue.faults().to_vec(), usage: dialogue.usage(), last };
    }
}

fn reply(outcome: &Outcome) -> &ChatReply {
    match &outcome.last {
        Answer::Reply(reply) => reply,
        Answer::Error(error) => panic!("{error}"),
    }
}

#[test]
fn every_format_gives_an_answer_of_the_schema_whole_or_in_pieces() {
    let Some(peer) = llmock() else { return };
    for (wire, base, structured) in SERVED {
        for stream in [false, true] {
            let outcome = ask(&server(&peer, wire, base, structured, stream), question());
            assert!(outcome.accepted.is_some(), "{wire}, stream {stream}: {:?}, {:?}", outcome.faults, outcome.last);
            assert!(outcome.faults.is_empty(), "{wire}: {:?}", outcome.faults);
            assert!(outcome.usage.input > 0 && outcome.usage.output > 0, "{wire}: {:?}", outcome.usage);
            assert_eq!(reply(&outcome).backend, wire.name());
        }
    }
    // Here the schema is not heeded: the answer is prose, which is found here and never passed on.
    let outcome = ask(&server(&peer, Wire::Anthropic, "/anthropic", Structured::JsonSchema, false), question());
    assert!(outcome.accepted.is_none() && outcome.faults.len() == 3, "{:?}", outcome.faults);
    assert!(matches!(outcome.faults[0], Fault::Malformed(_)), "{:?}", outcome.faults);
}

#[test]
fn every_fault_is_met_as_the_servers_judge_would_have_it() {
    let Some(peer) = llmock() else { return };
    let fail = |status: u16, more: Value| {
        let mut fail = json!({ "type": "fail", "status": status });
        fail.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        fail
    };
    let broken = |kind: &str| json!({ "type": "stream_fault", "kind": kind, "after_chunks": 2, "stall_seconds": 8.0 });
    for (wire, base, structured) in SERVED {
        for (name, behaviors, faults) in [
            ("429 with Retry-After", json!([fail(429, json!({ "retry_after": 0.6, "times": 2 }))]), 0),
            ("overloaded", json!([fail(529, json!({ "times": 2 }))]), 0),
            ("server error", json!([fail(500, json!({}))]), 0),
            ("truncated stream", json!([broken("truncate")]), 0),
            ("stalled read", json!([broken("stall")]), 0),
            ("dropped connection", json!([broken("disconnect")]), 0),
            ("damaged piece", json!([broken("malformed")]), 0),
            ("malformed JSON", json!([{ "type": "reply", "text": "{\"things\": [" }]), 1),
            ("ignored schema", json!([{ "type": "reply", "text": "{\"plan\": \"go\"}" }]), 1),
        ] {
            peer.will(behaviors);
            let outcome = ask(&server(&peer, wire, base, structured, true), question());
            let verdict = peer.verdict();
            assert!(outcome.accepted.is_some(), "{wire}, {name}: {:?} {:?}", outcome.faults, outcome.last);
            assert_eq!(outcome.faults.len(), faults, "{wire}, {name}: {:?}", outcome.faults);
            assert_eq!((&verdict["errors"], &verdict["warnings"]), (&json!(0), &json!(0)), "{wire}, {name}: {verdict}");
            let injected = verdict["faults_injected"].as_u64().unwrap_or(0);
            assert!(injected > 0 || faults > 0, "{wire}, {name}: nothing was broken: {verdict}");
        }
    }
}

#[test]
fn what_fails_for_good_is_asked_once_and_what_never_heals_is_given_up() {
    let Some(peer) = llmock() else { return };
    for (wire, base, structured) in SERVED {
        for status in [400, 401, 403, 404, 422] {
            peer.will(json!([{ "type": "fail", "status": status, "times": null }]));
            let outcome = ask(&server(&peer, wire, base, structured, false), question());
            let refused = |error: &CallError| matches!(error, CallError::Auth { .. } | CallError::BadRequest { .. });
            assert!(
                matches!(&outcome.last, Answer::Error(error) if refused(error)),
                "{wire} {status}: {:?}",
                outcome.last
            );
            let verdict = peer.verdict();
            assert_eq!(
                (&verdict["errors"], &verdict["attempts"]),
                (&json!(0), &json!(1)),
                "{wire} {status}: {verdict}"
            );
        }
        peer.will(json!([{ "type": "fail", "status": 503, "times": null }]));
        let outcome = ask(&server(&peer, wire, base, structured, false), question());
        assert_eq!(outcome.last, Answer::Error(CallError::Overloaded), "{wire}");
        let verdict = peer.verdict();
        assert_eq!((&verdict["errors"], &verdict["warnings"], &verdict["attempts"]), (&json!(0), &json!(0), &json!(3)));
    }
}

#[test]
fn the_official_clients_types_take_every_golden_body() {
    let Some(python) = installed("python-llm", "bin/python") else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut script = Command::new(python);
    let output = script.arg(root.join("tests/sdk_types.py")).arg(root.join("src/wire/golden")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(told["faults"], json!([]));
    assert_eq!(told["checked"], json!(25), "five formats, five bodies each");
}

/// A real model of 135 million weights behind llama.cpp. Its answers are poor, and two of its formats ignore the schema: what
/// is asserted is that nothing wrong is taken for an answer, and that with an enforced schema an answer comes.
#[test]
fn a_real_model_is_validated_and_repaired_over_three_formats() {
    let Some(python) = installed("python-llm-real", "bin/python") else { return };
    let Some(weights) = installed("python-llm-real", "smollm2.gguf") else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/llm_server_smollm2.py");
    let mut command = Command::new(python);
    let mut process = command.arg(script).arg(weights).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let mut peer = Peer { process, address: String::new() };
    peer.address = line.trim().strip_prefix("listening on ").unwrap().to_owned();
    for (wire, base) in [(Wire::OpenaiChat, "/v1"), (Wire::OpenaiResponses, "/v1"), (Wire::Anthropic, "")] {
        let profile = Profile::new(wire, "smollm2");
        let mut config = ServerConfig::new(format!("{}{base}", peer.address), profile);
        config.limits.idle = Duration::from_secs(300);
        config.limits.call = Duration::from_secs(300);
        let mut asked = question();
        asked.parameters.max_output_tokens = 120;
        // No list: such a small model does not find the end of one.
        asked.schema = asked.schema.pointer("/properties/things/items").cloned().unwrap();
        let outcome = ask(&Server::new(config).unwrap(), asked.clone());
        let told = reply(&outcome);
        println!("{wire}: accepted {}, faults {:?}, {}", outcome.accepted.is_some(), outcome.faults, told.usage);
        assert!(told.usage.input > 0 && told.usage.output > 0, "{wire}: {told:?}");
        if let Some(value) = &outcome.accepted {
            assert!(jsonschema::is_valid(&asked.schema, value), "{wire}: {value}");
        } else {
            assert_eq!(outcome.faults.len(), 3, "{wire}: two repairs were tried: {:?}", outcome.faults);
        }
        // This format's grammar makes it so.
        assert!(outcome.accepted.is_some() || wire != Wire::OpenaiChat, "{:?}", outcome.faults);
    }
}
