//! The real binary on bad input: one clear line and exit code 2, nothing lost.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a failed unwrap is the test's verdict

#[path = "command_line/chromium.rs"]
mod chromium;
#[path = "command_line/debugging.rs"]
mod debugging;
#[path = "command_line/demo.rs"]
mod demo;
#[path = "command_line/export.rs"]
mod export;
#[path = "command_line/live.rs"]
mod live;
#[path = "command_line/llm.rs"]
mod llm;
#[path = "command_line/llm_servers.rs"]
mod llm_servers;
#[path = "command_line/long.rs"]
mod long;
#[path = "command_line/other_programs.rs"]
mod other_programs;
#[path = "command_line/otlp.rs"]
mod otlp;
#[path = "command_line/perceive.rs"]
mod perceive;
#[path = "command_line/real_frames.rs"]
mod real_frames;
#[path = "command_line/replay.rs"]
mod replay;
#[path = "command_line/rmbench.rs"]
mod rmbench;
#[path = "command_line/synthetic.rs"]
mod synthetic;
#[path = "command_line/trace.rs"]
mod trace;
#[path = "command_line/viewer.rs"]
mod viewer;
#[path = "command_line/why.rs"]
mod why;

use assert_cmd::Command;
use std::{fs, path::Path};

fn acm() -> Command {
    Command::new(assert_cmd::cargo::cargo_bin!("acm"))
}

/// Runs `acm` and expects exit code 2 and a message with all of `parts`, on one line.
fn refuses(arguments: &[&str], parts: &[&str]) {
    let output = acm().args(arguments).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    for part in parts {
        assert!(message.contains(part), "{arguments:?}: no `{part}` in: {message}");
    }
    assert!(message.trim_end().lines().count() <= 1, "{arguments:?}: more than one line: {message}");
}

fn scenario_text() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("sim/scenarios/put-back-block.toml");
    fs::read_to_string(path).unwrap()
}

#[test]
fn a_scenario_that_does_not_exist_is_named_with_a_suggestion() {
    refuses(&["run", "put-back-blok"], &["put-back-blok", "did you mean `put-back-block`"]);
    refuses(&["scenario", "check", "no/such/file.toml"], &["no/such/file.toml"]);
}

#[test]
fn an_unknown_field_is_named_with_a_suggestion() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("odd.toml");
    fs::write(&file, scenario_text().replacen("summary", "sumary", 1)).unwrap();
    refuses(&["scenario", "check", file.to_str().unwrap()], &["sumary", "did you mean `summary`"]);
}

#[test]
fn an_unknown_object_model_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("odd.toml");
    let text = scenario_text();
    let model = text.lines().find(|line| line.starts_with("model")).expect("a scenario with a model");
    fs::write(&file, text.replacen(model, "model = \"unicorn\"", 1)).unwrap();
    refuses(&["scenario", "check", file.to_str().unwrap()], &["unicorn"]);
}

#[test]
fn missing_and_damaged_frames_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let missing = dir.path().join("missing.png");
    let (missing, broken) = (missing.to_str().unwrap(), dir.path().join("broken.png"));
    fs::write(&broken, b"\x89PNG\r\n\x1a\nrest is missing").unwrap();
    let common = ["--intrinsics", "525,525,319.5,239.5"];
    let run = |color: &str, depth: &str, parts: &[&str]| {
        refuses(&[&["perceive", "--color", color, "--depth", depth][..], &common[..]].concat(), parts);
    };
    run(missing, missing, &["missing.png"]);
    run(broken.to_str().unwrap(), missing, &["broken.png"]);
}

#[test]
fn templates_are_listed_by_group() {
    let out = acm().args(["library", "core", "blocks"]).output().unwrap();
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(out.status.success() && text.contains("core       box") && text.contains("blocks     l-block"), "{text}");
    refuses(&["library", "blcks"], &["`blcks`", "blocks"]);
}

#[test]
fn a_method_that_does_not_exist_is_named() {
    refuses(&["run", "put-back-block", "--method", "reactve"], &["reactve", "reactive"]);
}

#[test]
fn a_robot_that_is_not_there_or_cannot_do_what_is_asked_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let address = format!("unix://{}", dir.path().join("nobody.sock").display());
    refuses(&["run", "--robot", &address], &["nobody.sock", "acm sim serve"]);
    refuses(&["run", "--robot", &address, "--inject", "slip@1"], &["slip@N", "acm sim serve --inject"]);
    refuses(&["run", "--robot", &address, "--seed", "1..2"], &["one seed"]);
    refuses(&["sim", "serve", "put-back-block", "--inject", "black-frames"], &["slip@N", "acm run"]);
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", taken.local_addr().unwrap());
    refuses(&["sim", "serve", "put-back-block", "--listen", &address], &[&address, "another host"]);
}

#[test]
fn a_library_file_with_a_parameter_out_of_range_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("memory/library");
    for entry in fs::read_dir(library).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        fs::write(dir.path().join(path.file_name().unwrap()), text.replacen("max = 0.6", "max = 60.0", 1)).unwrap();
    }
    let dir = dir.path().to_str().unwrap();
    refuses(&["run", "put-back-block", "--library", dir], &["box.toml", "`length`", "60"]);
}

#[test]
fn a_memory_folder_of_another_format_is_refused_and_kept() {
    let dir = tempfile::tempdir().unwrap();
    let memory = dir.path().join("memory");
    drop(acm_memory::AcmMemory::open(&memory, acm_memory::default_library().unwrap().into()).unwrap());
    let header = header_file(&memory);
    let text = fs::read(&header).unwrap();
    let other = String::from_utf8(text).unwrap().replacen('2', "7", 1);
    fs::write(&header, &other).unwrap();
    refuses(&["run", "put-back-block", "--memory", memory.to_str().unwrap()], &["format 7", "format 2"]);
    assert_eq!(fs::read_to_string(&header).unwrap(), other);
}

/// The file that holds the format number: the one that is readable text.
fn header_file(memory: &Path) -> std::path::PathBuf {
    let files = fs::read_dir(memory).unwrap().map(|entry| entry.unwrap().path());
    let mut readable = files.filter(|path| fs::read_to_string(path).is_ok_and(|text| text.starts_with("acm-memory")));
    readable.next().expect("a header file")
}

#[test]
fn an_instruction_with_an_unknown_noun_is_refused_by_its_words() {
    let output = acm()
        .args(["run", "put-back-block", "--seed", "1", "--instruction", "Bring the walrus to the middle."])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stdout).contains("walrus"));
}
