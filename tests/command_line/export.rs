//! `acm trace export`: what other tools read is what the trace has.

use crate::{
    refuses,
    trace::{full_trace, prints, trace},
};
use serde_json::Value;
use std::{collections::BTreeMap, fs};

#[test]
fn lines_of_json_are_the_messages_the_effects_and_the_changes() {
    let file = trace().to_str().unwrap();
    let all: Value = serde_json::from_str(&prints(&["trace", "show", file, "--json"])).unwrap();
    let lines = prints(&["trace", "export", file, "--jsonl", "-"]);
    let mut by_topic: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for line in lines.lines() {
        let mut record: Value = serde_json::from_str(line).unwrap();
        let topic = record.as_object_mut().unwrap().remove("topic").unwrap().as_str().unwrap().to_owned();
        let group = if record.get("kind").is_some() { "message".to_owned() } else { topic };
        by_topic.entry(group).or_default().push(record);
    }
    assert_eq!(Value::from(by_topic["message"].clone()), all["messages"]);
    let topics: Vec<&str> = by_topic.keys().map(String::as_str).collect();
    assert_eq!(topics, ["/effect/frame", "/memory/delta", "message"]);
    // The same lines again, and none of the time of day.
    assert_eq!(lines, prints(&["trace", "export", file, "--jsonl", "-"]));
    assert!(!lines.contains("unix_ns"));
}

#[test]
fn chrome_gets_a_slice_for_each_message_and_an_arrow_for_each_cause() {
    let dir = tempfile::tempdir().unwrap();
    let (file, path) = (trace().to_str().unwrap(), dir.path().join("run.json"));
    prints(&["trace", "export", file, "--chrome", path.to_str().unwrap()]);
    let whole: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    let events = whole["traceEvents"].as_array().unwrap();
    let of = |phase: &str| events.iter().filter(|event| event["ph"] == phase).collect::<Vec<_>>();
    let all: Value = serde_json::from_str(&prints(&["trace", "show", file, "--json"])).unwrap();
    let messages = all["messages"].as_array().unwrap();
    assert_eq!(of("X").len() + of("i").len(), messages.len());
    assert!(of("X").len() > messages.len() / 2, "almost nothing was handled");
    let slices: BTreeMap<u64, &Value> = of("X").into_iter().map(|e| (e["args"]["seq"].as_u64().unwrap(), e)).collect();
    let caused =
        messages.iter().filter(|m| m["cause"].as_u64().is_some_and(|cause| slices.contains_key(&cause))).count();
    assert_eq!((of("s").len(), of("f").len()), (caused, caused));
    for start in of("s") {
        // It begins within the slice of the cause, on the same track.
        let message = &messages[start["id"].as_u64().unwrap() as usize - 1];
        let cause = slices[&message["cause"].as_u64().unwrap()];
        let (at, from) = (start["ts"].as_f64().unwrap(), cause["ts"].as_f64().unwrap());
        assert!(at >= from && at <= from + cause["dur"].as_f64().unwrap(), "{start} and {cause}");
        assert_eq!(start["tid"], cause["tid"]);
    }
}

/// Vertices of a binary PLY file.
fn vertices(bytes: &[u8]) -> Vec<([f32; 3], [u8; 3])> {
    let end = bytes.windows(11).position(|part| part == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let count: usize = header.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap().parse().unwrap();
    let body = &bytes[end..];
    assert_eq!(body.len(), 15 * count, "{header}");
    let float = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
    let vertex = |v: &[u8]| ([float(&v[..4]), float(&v[4..8]), float(&v[8..12])], [v[12], v[13], v[14]]);
    body.chunks(15).map(vertex).collect()
}

#[test]
fn point_clouds_stand_where_the_things_stand() {
    let dir = tempfile::tempdir().unwrap();
    let clouds = dir.path().join("clouds");
    let (file, folder) = (full_trace().to_str().unwrap(), clouds.to_str().unwrap());
    prints(&["trace", "export", file, "--points", folder, "--frame", "F0"]);
    let files: Vec<_> = fs::read_dir(&clouds).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(files, ["F0.ply"]);
    let points = vertices(&fs::read(clouds.join("F0.ply")).unwrap());
    assert!(points.len() > 100_000, "{} points", points.len());
    // The frame's own percepts say where the table is and how the things look.
    let percepts: Value =
        serde_json::from_str(&prints(&["trace", "show", file, "--kind", "percepts", "--json"])).unwrap();
    let percepts = &percepts["messages"][0]["body"]["percepts"];
    let plane = &percepts["support"];
    let component = |value: &Value, index: usize| value[index].as_f64().unwrap() as f32;
    let distance = |p: &[f32; 3]| {
        let along: f32 = (0..3).map(|axis| component(&plane["normal"], axis) * p[axis]).sum();
        (along - plane["offset_m"].as_f64().unwrap() as f32).abs()
    };
    let on_plane = points.iter().filter(|(at, _)| distance(at) < 0.01).count();
    assert!(on_plane > points.len() / 4, "{on_plane} of {} points lie on the table", points.len());
    for object in percepts["objects"].as_array().unwrap() {
        let at = &object["parts"][0]["pose"]["pose"]["translation"];
        let near = |p: &[f32; 3]| (0..2).all(|axis| (component(at, axis) - p[axis]).abs() < 0.03);
        assert!(points.iter().any(|(p, _)| near(p)), "no point at {object}");
    }
    let colors: std::collections::BTreeSet<[u8; 3]> = points.iter().map(|(_, color)| *color).collect();
    assert!(colors.len() > 100, "{} colours", colors.len());
    refuses(&["trace", "export", file, "--points", folder, "--frame", "F999"], &["no frame F999", "F0 to "]);
    // The viewer makes its pictures of full frames.
    let page = dir.path().join("run.html");
    prints(&["trace", "export", file, "--html", page.to_str().unwrap()]);
    assert!(fs::read_to_string(page).unwrap().contains("data:image/jpeg;base64,"));
}

#[test]
fn what_cannot_be_exported_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let file = trace().to_str().unwrap();
    refuses(
        &["trace", "export", file, "--points", dir.path().to_str().unwrap()],
        &["run.mcap keeps no depth", "--trace-frames full"],
    );
    refuses(&["trace", "export", file], &["--html FILE", "--points FOLDER"]);
    refuses(&["trace", "export", file, "--jsonl", "no/such/folder/x"], &["no/such/folder/x cannot be written"]);
    refuses(&["trace", "export", "no/such.mcap", "--chrome", "-"], &["no/such.mcap"]);
}
