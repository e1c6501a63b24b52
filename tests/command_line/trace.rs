//! `acm run --trace` and `--video`, and `acm trace` over what they wrote.

use crate::{acm, refuses};
use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    process::Stdio,
    sync::OnceLock,
};

/// A trace of one run, for all tests.
pub fn trace() -> &'static Path {
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

/// A trace of one run with all pixels, for all tests.
pub fn full_trace() -> &'static Path {
    static TRACE: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = TRACE.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("full.mcap");
        let run = ["run", "put-back-block", "--seed", "3", "--json", "--trace-frames", "full", "--trace"];
        assert!(acm().args(run).arg(&path).output().unwrap().status.success());
        (dir, path)
    });
    path
}

pub fn prints(arguments: &[&str]) -> String {
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
fn keyframes_are_what_the_changes_add_up_to() {
    let run = acm::trace::run_file::RunFile::read(trace()).unwrap();
    assert!(run.keyframes.len() >= 5, "{}", run.keyframes.len());
    let (mut believed, mut deltas) = (std::collections::BTreeMap::new(), run.deltas.iter().peekable());
    for keyframe in &run.keyframes {
        while let Some(delta) = deltas.next_if(|delta| delta.event <= keyframe.event) {
            if delta.change == "object" {
                believed.insert(delta.object.clone().unwrap(), delta.after.clone());
            }
        }
        assert_eq!(keyframe.objects, believed, "at message {}", keyframe.seq);
    }
    assert!(!believed.is_empty());
}

#[test]
fn what_actors_kept_is_told_with_a_message() {
    let file = trace().to_str().unwrap();
    let run = acm::trace::run_file::RunFile::read(trace()).unwrap();
    let moved = run.entries.iter().find(|entry| entry.header.kind == "moved").unwrap().header.seq;
    let told = prints(&["trace", "show", file, "--seq", &moved.to_string()]);
    assert!(told.contains("executor kept before: runs pick") && told.contains("waits_for executing"), "{told}");
    let told: serde_json::Value =
        serde_json::from_str(&prints(&["trace", "show", file, "--seq", &moved.to_string(), "--json"])).unwrap();
    assert_eq!(told["states_before"]["episode"]["waits_for"], "executing");
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

/// A limit of the file size stands for a disk that fills up while the run goes on.
#[cfg(unix)]
#[test]
fn a_disk_that_fills_up_ends_the_run_with_one_clear_error() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("full.mcap");
    let output = std::process::Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 100; exec \"$0\" run put-back-block --json --trace \"$1\""])
        .arg(assert_cmd::cargo::cargo_bin!("acm"))
        .arg(&path)
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("full.mcap cannot be written: File too large"), "{message}");
    // What was written until then can be read.
    assert!(prints(&["trace", "show", path.to_str().unwrap()]).lines().count() > 10);
}

#[test]
fn a_video_is_a_gif_of_a_bounded_size_and_bad_requests_cost_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.gif");
    let output = acm().args(["run", "put-back-block", "--seed", "3", "--json", "--video"]).arg(&path).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let video = fs::read(&path).unwrap();
    assert!(video.starts_with(b"GIF89a") && video.len() < 5_000_000, "{} bytes", video.len());
    let mut decoder = gif::DecodeOptions::new().read_info(video.as_slice()).unwrap();
    let mut pictures = 0;
    while decoder.read_next_frame().unwrap().is_some() {
        pictures += 1;
    }
    // Five skills, each decided and judged, and the frames between them.
    assert!(pictures > 12, "{pictures} pictures");
    let run = |arguments: &[&str], parts: &[&str]| refuses(&[&["run", "put-back-block"], arguments].concat(), parts);
    run(&["--video", "run.mp4"], &["run.mp4", ".gif"]);
    run(&["--video", "no/such/run.gif"], &["no/such/run.gif", "cannot be created"]);
    run(&["--seed", "0..3", "--video", "run.gif"], &["one --seed"]);
}

#[test]
fn the_bench_of_the_runtime_measures_every_figure_that_has_a_target() {
    let dir = tempfile::tempdir().unwrap();
    let (path, targets) = (dir.path().join("runtime.json"), dir.path().join("targets.toml"));
    // Targets that nothing can miss: the speed of this machine is not what is tested.
    fs::write(&targets, "[runtime]\nactor_restart_ms = { min = 0 }\n").unwrap();
    let bench = |extra: &[&str]| {
        let arguments = ["bench", "runtime", "--quick", "--episodes", "1", "--against", targets.to_str().unwrap()];
        acm().args(arguments).args(extra).output().unwrap()
    };
    let output = bench(&["--json", path.to_str().unwrap()]);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{printed} {}", String::from_utf8_lossy(&output.stderr));
    assert!(printed.contains("What iceoryx2 buys") && printed.contains("What it does not buy"), "{printed}");
    let result: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    assert_eq!((&result["schema"], &result["bench"]), (&"acm.bench/1".into(), &"runtime".into()));
    let own: toml::Table = include_str!("../../agent/figures.toml").parse().unwrap();
    for name in own["runtime"].as_table().unwrap().keys() {
        assert!(result["figures"][name].is_number(), "no figure {name} in {}", result["figures"]);
    }
    fs::write(&targets, "[runtime]\nactor_restart_ms = 3\n").unwrap();
    assert_eq!(bench(&[]).status.code(), Some(2));
}
