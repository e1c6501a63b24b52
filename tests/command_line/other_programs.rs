//! A trace in the hands of programs that are not ours.

use crate::trace::{full_trace, prints, trace};
use std::{
    path::{Path, PathBuf},
    process::Command,
};

/// A program that `scripts/setup.sh`, or a person, has put beside the build; else says that a test is skipped.
fn installed(program: &str, otherwise: &str) -> Option<PathBuf> {
    let build = Path::new(env!("CARGO_BIN_EXE_acm")).ancestors().nth(2).unwrap();
    let path = build.join("python/bin").join(program);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {} is missing; {otherwise}", path.display());
    None
}

/// One of our scripts with other people's libraries.
pub fn script(name: &str) -> Option<Command> {
    let python = installed("python", "scripts/setup.sh makes it where Python and a network are there")?;
    let mut command = Command::new(python);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name));
    Some(command)
}

/// The JSON that a script prints.
pub fn answer(script: &mut Command) -> serde_json::Value {
    let output = script.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The project's own reader and the one that others use must agree. `scripts/setup.sh` installs the latter.
#[test]
fn another_programs_reader_finds_the_same_messages() {
    let Some(mut script) = script("read_trace.py") else { return };
    let read = answer(script.arg(trace()));
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

#[test]
fn every_message_for_viewers_is_decoded_and_each_cloud_lies_on_its_depth_image() {
    let Some(mut script) = script("read_points.py") else { return };
    let found = answer(script.arg(full_trace()));
    let ours: serde_json::Value =
        serde_json::from_str(&prints(&["trace", "show", full_trace().to_str().unwrap(), "--json"])).unwrap();
    let messages = ours["messages"].as_array().unwrap();
    let frames = messages.iter().filter(|message| message["kind"] == "frame").count();
    assert_eq!(found["foxglove.Log"], messages.len());
    assert_eq!(found["foxglove.RawImage"], 2 * frames);
    for each in ["foxglove.PointCloud", "foxglove.CameraCalibration"] {
        assert_eq!(found[each], frames, "{each}");
    }
}

#[test]
fn what_keeps_no_pixels_keeps_no_points() {
    let topics = |file: &Path| {
        let mut reader = acm_runtime::trace::TraceReader::open(file).unwrap();
        let mut topics = std::collections::BTreeSet::new();
        while let Some(item) = reader.next_item() {
            if let acm_runtime::trace::Item::Message(message) = item {
                topics.insert(message.topic().to_owned());
            }
        }
        topics
    };
    assert!(topics(full_trace()).contains("/camera/head/points"));
    assert!(!topics(trace()).contains("/camera/head/points"));
}

/// Rerun's viewer decodes messages by their schemas and wants each topic in order.
#[test]
fn rerun_finds_nothing_wrong_with_a_full_trace() {
    let wanted = "target/python/bin/pip install --no-deps -r scripts/trace_viewer_requirements.txt (170 MB)";
    let Some(rerun) = installed("rerun", wanted) else { return };
    // With no folder of its own it neither knows an earlier session nor sends anything about this one.
    let home = tempfile::tempdir().unwrap();
    let check = |more: &[&str]| {
        let mut command = Command::new(&rerun);
        command.args(["mcap", "check"]).args(more).arg(full_trace());
        let output = command.env("HOME", home.path()).env_remove("XDG_CONFIG_HOME").output().unwrap();
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{printed} {}", String::from_utf8_lossy(&output.stderr));
        printed
    };
    for more in [&[][..], &["--full"]] {
        let printed = check(more);
        let topics: Vec<&str> = printed.lines().filter(|line| line.contains(" /")).collect();
        assert!(topics.len() > 20 && topics.iter().any(|line| line.contains("/camera/head/points")), "{printed}");
        assert!(topics.iter().all(|line| line.starts_with("ok ")), "{printed}");
    }
}
