//! `acm trace why`: from a message back to the frames on which it rests.

use crate::{
    refuses,
    trace::{prints, trace},
};
use serde_json::Value;
use std::{collections::BTreeSet, fs};

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&prints(arguments)).unwrap()
}

fn list<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value[name].as_array().unwrap_or_else(|| panic!("no list {name} in {value}"))
}

fn of_kind<'a>(why: &'a Value, kind: &str) -> Vec<&'a Value> {
    list(why, "nodes").iter().filter(|node| node["kind"] == kind).collect()
}

/// The nodes that can be reached over links from where the question begins.
fn reached(why: &Value) -> BTreeSet<String> {
    let mut reached = BTreeSet::from([format!("m{}", why["seq"])]);
    for _ in list(why, "nodes") {
        let links = list(why, "links").iter().filter(|link| reached.contains(link["from"].as_str().unwrap()));
        let next: Vec<String> = links.map(|link| link["to"].as_str().unwrap().to_owned()).collect();
        reached.extend(next);
    }
    reached
}

#[test]
fn an_action_leads_back_to_its_decision_the_entries_it_read_and_the_frames_they_come_from() {
    let file = trace().to_str().unwrap();
    let messages = json(&["trace", "show", file, "--json"]);
    let messages = list(&messages, "messages");
    let ran = messages.iter().find(|message| message["kind"] == "execute").unwrap();
    let decided = messages.iter().find(|message| message["kind"] == "decided").unwrap();
    let why = json(&["trace", "why", file, &(ran["seq"].as_u64().unwrap() + 30).to_string(), "--json"])["why"].clone();
    assert_eq!(why["step"], 1);
    let ids: BTreeSet<String> =
        list(&why, "nodes").iter().map(|node| node["id"].as_str().unwrap().to_owned()).collect();
    assert_eq!(reached(&why), ids, "nodes that nothing leads to, or links to no node");
    for kind in ["decision", "instruction", "reference", "belief", "rejected", "entry", "change", "frame", "outcome"] {
        assert!(!of_kind(&why, kind).is_empty(), "no {kind}");
    }
    assert_eq!(of_kind(&why, "decision")[0]["seq"], decided["seq"]);
    // Nothing that came later explains anything, but for what came of it.
    let later = |node: &&&Value| node["seq"].as_u64() > decided["seq"].as_u64();
    let kinds: BTreeSet<&str> =
        list(&why, "nodes").iter().filter(|node| later(&node)).map(|node| node["kind"].as_str().unwrap()).collect();
    assert!(kinds.iter().all(|kind| ["message", "messages"].contains(kind)), "{kinds:?}");
    // The object that is acted on, and where the frame showed it: what perception and memory said themselves.
    let part = &decided["body"]["decision"]["act"]["step"]["candidate"]["part"];
    let object = part.as_str().unwrap().split('.').next().unwrap().replacen('P', "O", 1);
    let crops = of_kind(&why, "frame").into_iter().flat_map(|frame| list(frame, "crops"));
    let crop = crops.clone().find(|crop| crop["object"] == object.as_str() && crop["how"] == "seen").unwrap();
    let percepts = messages
        .iter()
        .find(|m| m["kind"] == "percepts" && m["body"]["percepts"]["frame"]["id"] == crop["frame"])
        .unwrap();
    let updated = messages.iter().find(|m| m["kind"] == "updated" && m["cause"] == percepts["seq"]).unwrap();
    let resolved =
        list(&updated["body"]["grounding"], "resolved").iter().find(|r| r["object"] == object.as_str()).unwrap();
    let percept = &percepts["body"]["percepts"]["objects"][resolved["percept"].as_u64().unwrap() as usize];
    assert_eq!(crop["bounds"], percept["support"]["bounds"]);
}

#[test]
fn the_answer_is_told_in_words_with_the_pixels_in_question_as_files() {
    let dir = tempfile::tempdir().unwrap();
    let file = trace().to_str().unwrap();
    let told = prints(&["trace", "why", file, "--step", "1", "--crops", dir.path().to_str().unwrap()]);
    for part in [
        "why ",
        "decided       step 1 of",
        "asked by",
        "meant ",
        "believed ",
        "not chosen",
        "came out      CONTRADICTED",
        "memory read",
        "written by",
        "seen in",
        "seen as cube",
    ] {
        assert!(told.contains(part), "no `{part}` in: {told}");
    }
    let files: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(!files.is_empty(), "{told}");
    for path in files {
        let (width, height) = image::image_dimensions(&path).unwrap();
        assert!(width >= 120 && height >= 20, "{}: {width}x{height}", path.display());
        assert!(told.contains(path.to_str().unwrap()));
    }
}

#[test]
fn what_the_trace_does_not_hold_is_said_and_bad_questions_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let file = trace().to_str().unwrap();
    let told = prints(&["trace", "why", file, "6"]);
    assert!(told.contains("no decision stands among the causes of message 6"), "{told}");
    refuses(&["trace", "why", file, "999999"], &["no message 999999", "the trace has 1 to "]);
    refuses(&["trace", "why", file, "--step", "99"], &["no step 99"]);
    refuses(&["trace", "why", "no/such.mcap", "1"], &["no/such.mcap"]);
    let other = dir.path().join("other.mcap");
    fs::write(&other, "a letter").unwrap();
    refuses(&["trace", "why", other.to_str().unwrap(), "1"], &["other.mcap is no trace"]);
    refuses(&["trace", "export", other.to_str().unwrap(), "--jsonl", "-"], &["other.mcap is no trace"]);
    refuses(&["trace", "view", other.to_str().unwrap()], &["other.mcap is no trace"]);
    let bytes = fs::read(trace()).unwrap();
    let part = dir.path().join("part.mcap");
    fs::write(&part, &bytes[..bytes.len() / 2]).unwrap();
    let told = prints(&["trace", "why", part.to_str().unwrap(), "--step", "1"]);
    assert!(told.lines().last().unwrap().starts_with("CUT: "), "{told}");
}

#[test]
fn a_decision_to_give_up_names_what_was_seen_last() {
    let dir = tempfile::tempdir().unwrap();
    for (fault, told) in
        [("black-frames", "shows nothing: no-depth"), ("freeze-frames", "bit for bit the picture of F0")]
    {
        let path = dir.path().join("run.mcap");
        let file = path.to_str().unwrap();
        let run = ["run", "put-back-block", "--seed", "3", "--json", "--inject", fault, "--trace", file];
        crate::acm().args(run).output().unwrap();
        let messages = json(&["trace", "show", file, "--kind", "decided", "--json"]);
        let last = list(&messages, "messages").last().unwrap()["seq"].to_string();
        let why = prints(&["trace", "why", file, &last]);
        assert!(why.contains(told), "{fault}: no `{told}` in: {why}");
    }
}
