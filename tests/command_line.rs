//! The real binary on bad input: one clear line and exit code 2, nothing lost.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a failed unwrap is the test's verdict

use assert_cmd::Command;
use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    process::Stdio,
    sync::OnceLock,
};

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
fn a_method_that_does_not_exist_is_named() {
    refuses(&["run", "put-back-block", "--method", "reactve"], &["reactve", "reactive"]);
}

#[test]
fn a_library_file_with_a_parameter_out_of_range_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("memory/library");
    for entry in fs::read_dir(library).unwrap() {
        let path = entry.unwrap().path();
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
    let other = String::from_utf8(text).unwrap().replacen('1', "7", 1);
    fs::write(&header, &other).unwrap();
    refuses(&["run", "put-back-block", "--memory", memory.to_str().unwrap()], &["format 7", "format 1"]);
    assert_eq!(fs::read_to_string(&header).unwrap(), other);
}

/// The file that holds the format number: the one that is readable text.
fn header_file(memory: &Path) -> std::path::PathBuf {
    let files = fs::read_dir(memory).unwrap().map(|entry| entry.unwrap().path());
    let mut readable = files.filter(|path| fs::read_to_string(path).is_ok_and(|text| text.contains('1')));
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

/// A trace of one run, for all tests here.
fn trace() -> &'static Path {
    static TRACE: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = TRACE.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let output = acm()
            .args(["run", "put-back-block", "--seed", "3", "--inject", "slip@1", "--json", "--trace"])
            .arg(&path)
            .output()
            .unwrap();
        assert!(path.exists(), "{}", String::from_utf8_lossy(&output.stderr));
        (dir, path)
    });
    path
}

fn prints(arguments: &[&str]) -> String {
    let output = acm().args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_trace_is_listed_and_shown_as_a_table() {
    let file = trace().to_str().unwrap();
    let list = prints(&["trace", "ls", trace().parent().unwrap().to_str().unwrap()]);
    let line = list.lines().find(|line| line.starts_with("run.mcap")).unwrap();
    for part in ["put-back-block", " 3 ", " acm ", "first failure: "] {
        assert!(line.contains(part), "no `{part}` in: {line}");
    }
    let table = prints(&["trace", "show", file]);
    assert!(table.lines().skip(1).all(|line| line.chars().count() <= 100), "{table}");
    // The ticks of a skill are one line: a run of two thousand messages is read in two hundred.
    assert!(table.lines().count() < 300 && table.contains("messages up to"), "{table}");
    assert!(table.lines().any(|line| line.contains("planner > episode") && line.contains("decided")));

    let decided = prints(&["trace", "show", file, "--kind", "decided", "--actor", "planner"]);
    assert!(decided.lines().skip(2).all(|line| line.contains(" decided ")), "{decided}");
    let mats = prints(&["trace", "show", file, "--kind", "percepts", "--text", "MAT"]);
    assert!(mats.lines().count() > 2, "{mats}");
}

#[test]
fn a_step_tells_what_was_considered_predicted_and_found() {
    let step = prints(&["trace", "show", trace().to_str().unwrap(), "--step", "1"]);
    for part in
        ["step 1 of ", "goal ", "preconditions ", "holds", "candidates inspected", "predicted ", "ran ", "verdict "]
    {
        assert!(step.contains(part), "no `{part}` in: {step}");
    }
    refuses(&["trace", "show", trace().to_str().unwrap(), "--step", "99"], &["no step 99", "steps"]);
}

#[test]
fn a_message_is_shown_in_full_and_a_selection_as_json() {
    let file = trace().to_str().unwrap();
    let json = |arguments: &[&str]| -> serde_json::Value { serde_json::from_str(&prints(arguments)).unwrap() };
    let all = json(&["trace", "show", file, "--json"]);
    let messages = all["messages"].as_array().unwrap();
    assert!(messages.iter().zip(1..).all(|(message, seq)| message["seq"] == seq));
    let percepts = messages.iter().find(|message| message["kind"] == "percepts").unwrap();
    let seq = percepts["seq"].to_string();
    let one = json(&["trace", "show", file, "--seq", &seq, "--json"]);
    assert_eq!(one["message"], *percepts);
    assert!(!one["memory"].as_array().unwrap().is_empty(), "the first frame changed nothing in memory");
    assert!(prints(&["trace", "show", file, "--seq", &seq]).contains("\"objects\""));
    refuses(&["trace", "show", file, "--seq", "999999"], &["no message 999999"]);
    refuses(&["trace", "show", file, "--actor", "plumber"], &["`plumber`", "planner"]);
    refuses(&["trace", "show", file, "--kind", "decide-d"], &["`decide-d`", "decided"]);
}

#[test]
fn a_cut_trace_is_shown_as_far_as_it_goes_and_other_files_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = fs::read(trace()).unwrap();
    let part = dir.path().join("part.mcap");
    let mut lines = 0;
    for tenths in 1..10 {
        fs::write(&part, &bytes[..bytes.len() * tenths / 10]).unwrap();
        let table = prints(&["trace", "show", part.to_str().unwrap()]);
        assert!(table.lines().last().unwrap().starts_with("CUT: "), "{table}");
        assert!(table.lines().count() >= lines);
        lines = table.lines().count();
        assert!(prints(&["trace", "ls", part.to_str().unwrap()]).contains("; CUT"));
    }
    assert!(lines > 50, "nine tenths of the file gave {lines} lines");
    let other = dir.path().join("other.mcap");
    let path = other.to_str().unwrap();
    for (content, complaint) in
        [(&b"no trace at all, but some text"[..], "no MCAP file"), (b"", "0 bytes"), (&bytes[..12], "12 bytes")]
    {
        fs::write(&other, content).unwrap();
        refuses(&["trace", "show", path], &["other.mcap is no trace", complaint]);
        refuses(&["trace", "ls", path], &["other.mcap is no trace"]);
    }
    refuses(&["trace", "show", "no/such.mcap"], &["no/such.mcap"]);
    refuses(&["trace", "ls", tempfile::tempdir().unwrap().path().to_str().unwrap()], &["has no trace"]);
    assert!(prints(&["trace", "ls", dir.path().to_str().unwrap()]).contains("left out: "));
}

#[test]
fn a_reader_that_has_seen_enough_of_a_trace_is_no_failure() {
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("acm"))
        .args(["trace", "show", trace().to_str().unwrap(), "--json"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = [0; 10];
    child.stdout.take().unwrap().read_exact(&mut first).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn a_trace_that_cannot_be_written_is_told_before_the_episode() {
    let dir = tempfile::tempdir().unwrap();
    let letter = dir.path().join("letter.txt");
    fs::write(&letter, "dear reader").unwrap();
    let run = |path: &str, parts: &[&str]| refuses(&["run", "put-back-block", "--json", "--trace", path], parts);
    run(letter.to_str().unwrap(), &["letter.txt", "is no trace"]);
    assert_eq!(fs::read_to_string(&letter).unwrap(), "dear reader");
    run("/dev/full", &["/dev/full", "No space left"]);
    let output = acm().args(["run", "put-back-block", "--trace-frames", "all"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("`all` is no frame detail"));
}

/// The project's own reader and the one that others use must agree. `scripts/setup.sh` installs the latter.
#[test]
fn another_programs_reader_finds_the_same_messages() {
    let build = Path::new(env!("CARGO_BIN_EXE_acm")).ancestors().nth(2).unwrap();
    let python = build.join("python/bin/python");
    if !python.exists() {
        println!(
            "skipped: {} is missing; scripts/setup.sh makes it where Python and a network are there",
            python.display()
        );
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_trace.py");
    let output = std::process::Command::new(python).arg(script).arg(trace()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let ours: serde_json::Value =
        serde_json::from_str(&prints(&["trace", "show", trace().to_str().unwrap(), "--json"])).unwrap();
    assert_eq!(read["messages"], ours["messages"]);
    assert_eq!(read["run"], ours["run"]);
    assert_eq!(read["attachments"], serde_json::json!(["options.json", "robot.json", "task.json"]));
    let frames = read["frames"].as_array().unwrap();
    assert!(!frames.is_empty() && frames.len() == read["thumbnails"].as_array().unwrap().len());
    assert!(read["thumbnails"].as_array().unwrap().iter().all(|size| *size == serde_json::json!([160, 120])));
    assert_eq!(read["lines"], ours["messages"].as_array().unwrap().len());
}
