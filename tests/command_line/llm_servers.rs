//! `acm run --llm ID`, `acm llm` and `acm config` with backends behind servers: a server of a few lines that answers, hangs
//! up, floods and lies.

use crate::{acm, refuses, trace::prints};
use serde_json::{Value, json};
use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
};

const VARIABLE: &str = "ACM_TEST_KEY";
const SECRET: &str = "sk-that-must-not-be-seen-42";

/// What the server does with each call.
#[derive(Clone)]
enum Does {
    Says(String),
    HangsUp,
    Floods,
    Refuses(&'static str),
}

/// The address of a server that does these things in turn, and the last one for ever.
#[expect(clippy::disallowed_methods, reason = "the server is another program, and this one ends with the test's")]
fn peer(does: Vec<Does>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/v1", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for at in 0.. {
            let (mut stream, _) = listener.accept().unwrap();
            serve(&mut stream, does.get(at).or(does.last()).unwrap()).ok();
        }
    });
    address
}

fn serve(stream: &mut TcpStream, does: &Does) -> std::io::Result<()> {
    let (mut reader, mut length, mut authorized) = (BufReader::new(stream.try_clone()?), 0, false);
    loop {
        let mut line = String::new();
        reader.read_line(&mut line)?;
        let lower = line.to_lowercase();
        length = lower.strip_prefix("content-length:").map_or(length, |text| text.trim().parse().unwrap());
        authorized |= line.trim().ends_with(&format!("Bearer {SECRET}"));
        if line.trim().is_empty() {
            break;
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body)?;
    let asked: Value = serde_json::from_slice(&body).unwrap();
    assert_eq!(asked["model"], "tiny");
    let reply = |status: &str, body: &str| {
        format!("HTTP/1.1 {status}\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n{body}", body.len())
    };
    let text = match does {
        _ if !authorized => reply("401 Unauthorized", "{\"error\": {\"message\": \"no key\"}}"),
        Does::Says(text) => {
            let message = json!({ "content": text, "reasoning_content": format!("my key is {SECRET}") });
            let usage = json!({ "prompt_tokens": 1000, "completion_tokens": 50 });
            reply(
                "200 OK",
                &json!({ "model": "tiny-1", "choices": [{ "finish_reason": "stop", "message": message }],
                "usage": usage })
                .to_string(),
            )
        }
        Does::HangsUp => "HTTP/1.1 200 OK\r\ncontent-length: 500\r\n\r\n{\"choices\"".into(),
        Does::Floods => format!("HTTP/1.1 200 OK\r\n\r\n{}", "x".repeat(10 << 20)),
        Does::Refuses(status) => {
            reply(status, &json!({ "error": { "message": format!("bad key {SECRET}") } }).to_string())
        }
    };
    stream.write_all(text.as_bytes())
}

/// A configuration with a backend `near` at an address.
fn config(dir: &Path, address: &str, more: &str) -> PathBuf {
    let path = dir.join("models.toml");
    let text = format!(
        "[llm.limits]\nmax_usd_per_episode = 1.0\n{more}\n[llm.backend.near]\nwire = \"openai-chat\"\nmodel = \"tiny\"\n\
         base_url = \"{address}\"\nkey_env = \"{VARIABLE}\"\nretry = {{ attempts = 2, base_ms = 1 }}\n\
         price = {{ input_per_mtok = 1.0, output_per_mtok = 10.0 }}\n"
    );
    fs::write(&path, text).unwrap();
    path
}

struct Ran {
    told: String,
    code: Option<i32>,
    /// Everything that was left behind.
    left: Vec<u8>,
    parsed: Value,
    notes: Value,
}

fn run(dir: &Path, config: &Path, more: &[&str]) -> Ran {
    let (trace, cassette) = (dir.join("run.mcap"), dir.join("run.jsonl"));
    let words =
        ["run", "put-back-block", "--seed", "3", "--no-motion", "--config", config.to_str().unwrap(), "--trace"];
    let output = acm().env(VARIABLE, SECRET).args(words).arg(&trace).args(more).output().unwrap();
    let told = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(trace.exists(), "{told}");
    let shown: Value = serde_json::from_str(&prints(&["trace", "show", trace.to_str().unwrap(), "--json"])).unwrap();
    prints(&["trace", "export", trace.to_str().unwrap(), "--cassette", cassette.to_str().unwrap()]);
    let of = |kind: &str| shown["messages"].as_array().unwrap().iter().find(|m| m["kind"] == kind).cloned();
    let parsed = of("parsed").unwrap()["body"].clone();
    let notes = of("llm-replied").map_or(Value::Null, |message| message["body"]["reply"]["notes"].clone());
    // The trace is compressed: what is shown of it is all that it holds.
    let left = [fs::read(&cassette).unwrap(), shown.to_string().into_bytes(), told.clone().into_bytes()].concat();
    Ran { told, code: output.status.code(), left, parsed, notes }
}

fn holds(bytes: &[u8], words: &str) -> bool {
    bytes.windows(words.len()).any(|window| window == words.as_bytes())
}

#[test]
fn a_server_reads_the_instruction_and_its_run_is_replayed_without_it() {
    let dir = tempfile::tempdir().unwrap();
    let right = crate::llm::answer(&crate::llm::instruction());
    let walrus = right.replacen("the cube", "the walrus", 1);
    let address = peer(vec![Does::HangsUp, Does::Says(walrus), Does::Says(right)]);
    let file = config(dir.path(), &address, "");
    let ran = run(dir.path(), &file, &["--llm", "near", "--trace-frames", "full"]);
    assert!(
        ran.told.contains("read by the model tiny-1 (openai-chat); 2 calls, 2000 tokens in, 100 out"),
        "{}",
        ran.told
    );
    assert_eq!(ran.parsed["reading"]["faults"][0]["kind"], "ungrounded", "what is not there is found");
    assert!(ran.notes[0].as_str().unwrap().contains("asked again"), "{}", ran.notes);
    assert!(holds(&ran.left, "my key is ***") && !holds(&ran.left, SECRET));
    let trace = dir.path().join("run.mcap");
    assert!(prints(&["trace", "replay", trace.to_str().unwrap()]).starts_with("identical: "));
    // The configuration or the variable may name it too, and the command line goes before both.
    for (more, names, variable) in [
        ("[llm]\ndefault = \"near\"", None, None),
        ("", None, Some("near")),
        ("[llm]\ndefault = \"near\"", Some("rules"), Some("near")),
    ] {
        let text = fs::read_to_string(config(dir.path(), &address, "")).unwrap();
        fs::write(&file, format!("{more}\n{text}")).unwrap();
        let mut command = acm();
        command
            .args(["run", "put-back-block", "--no-motion", "--config", file.to_str().unwrap()])
            .env(VARIABLE, SECRET);
        command.args(names.into_iter().flat_map(|name| ["--llm", name]));
        command.envs(variable.map(|name| ("ACM_LLM", name)));
        let told = String::from_utf8(command.output().unwrap().stdout).unwrap();
        assert_eq!(told.contains("read by the model tiny-1"), names.is_none(), "{told}");
    }
}

#[test]
fn a_server_that_fails_in_every_way_is_survived_and_its_key_is_nowhere() {
    let dir = tempfile::tempdir().unwrap();
    for (does, why) in [
        (Does::HangsUp, "the model's reply broke off"),
        (Does::Floods, "it has more than 8388608 bytes"),
        (Does::Refuses("401 Unauthorized"), "refuses whoever asks: bad key ***"),
        (Does::Refuses("404 Not Found"), "status 404"),
        (Does::Refuses("500 Oops"), "failed with status 500: bad key ***"),
        (Does::Says("{\"things\": [".into()), "no JSON"),
        (Does::Says("{\"plan\": 1}".into()), "not of the schema"),
    ] {
        let file = config(dir.path(), &peer(vec![does]), "");
        let ran = run(dir.path(), &file, &["--llm", "near"]);
        assert!(
            ran.told.contains("READ BY RULES INSTEAD OF THE MODEL") && ran.told.contains(why),
            "{why}: {}",
            ran.told
        );
        assert_eq!(ran.parsed["Ok"]["subtasks"].as_array().unwrap().len(), 3, "the rules read it all the same");
        assert!(matches!(ran.code, Some(1 | 3)), "{why}: it goes on to its end: {:?}", ran.code);
        assert!(!holds(&ran.left, SECRET), "{why}");
    }
    // Nobody there; and what may be spent is spent.
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let nobody = format!("http://{}", taken.local_addr().unwrap());
    drop(taken);
    let ran = run(dir.path(), &config(dir.path(), &nobody, ""), &["--llm", "near"]);
    assert!(ran.told.contains("the model cannot be reached"), "{}", ran.told);
    let file = config(dir.path(), &peer(vec![Does::Says("no".into())]), "max_calls_per_episode = 1");
    let ran = run(dir.path(), &file, &["--llm", "near"]);
    assert!(ran.told.contains("1 of 1 calls"), "{}", ran.told);
}

#[test]
fn what_is_no_backend_and_what_has_no_key_is_refused_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let file = config(dir.path(), "http://127.0.0.1:9/v1", "");
    let path = file.to_str().unwrap();
    let run = |llm| ["run", "put-back-block", "--config", path, "--llm", llm];
    refuses(&run("naer"), &["`naer`", "did you mean `near`", "scripted=FILE"]);
    refuses(&run("near"), &["`near`", VARIABLE, "is not set"]);
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replace("key_env", "api_key")).unwrap();
    refuses(&["config", "check", path], &["models.toml", "line", "unknown field `api_key`"]);
    refuses(&["config", "check", "no-such.toml"], &["no-such.toml"]);
}

#[test]
fn backends_are_listed_and_tried_and_a_configuration_is_shown() {
    let dir = tempfile::tempdir().unwrap();
    let heeds = Does::Says("{\"word\": \"hello\", \"polite\": true}".into());
    let file = config(dir.path(), &peer(vec![heeds.clone(), Does::Says("{\"color\": \"red\"}".into())]), "");
    let path = file.to_str().unwrap();
    let command = |words: &[&str], key: bool| {
        let mut command = acm();
        command.args(words).env_remove("ACM_LLM").envs(key.then_some((VARIABLE, SECRET)));
        let output = command.output().unwrap();
        (String::from_utf8(output.stdout).unwrap(), output.status.code())
    };
    let (told, code) = command(&["llm", "list", "--config", path], false);
    assert!(
        code == Some(0) && told.contains("openai-chat tiny at http://127.0.0.1") && told.contains("KEY MISSING"),
        "{told}"
    );
    let (told, code) = command(&["llm", "check", "near", "--config", path], true);
    let parts = ["near: usable", "tiny-1", "heeded, though", "red square is called red", "1000 tokens in", "0.0015"];
    assert!(code == Some(0) && parts.iter().all(|part| told.contains(part)), "{told}");
    let ignoring = config(dir.path(), &peer(vec![Does::Says("Hello!".into()), heeds, Does::Refuses("500 Oops")]), "");
    let (told, code) = command(&["llm", "check", "--json", "--config", ignoring.to_str().unwrap()], true);
    let found: Value = serde_json::from_str(&told).unwrap();
    let found = &found["backends"][0];
    assert!(code == Some(0) && found["usable"] == true && found["repairs"] == 1, "{told}");
    assert!(found["schema"].as_str().unwrap().contains("NOT HEEDED") && !told.contains(SECRET), "{told}");
    let (told, code) = command(&["llm", "check", "--config", path], false);
    assert!(code == Some(1) && told.contains("NOT USABLE") && told.contains(VARIABLE), "{told}");
    let (told, code) = command(&["config", "check", path], false);
    assert!(code == Some(0) && told.contains("sound, 1 language models") && told.contains("is not set"), "{told}");
    let (told, code) = command(&["config", "show", "--config", path], false);
    assert!(
        code == Some(0) && told.contains("max_calls_per_episode = 60") && told.contains("[llm.backend.near"),
        "{told}"
    );
}
