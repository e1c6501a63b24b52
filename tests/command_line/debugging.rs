//! docs/debugging.md: a wrong placement under an injected fault of the camera, followed back to frame and memory entry.

use crate::acm;
use serde_json::Value;
use std::{fs, path::Path};

/// The commands of the guide's shell blocks, in order.
fn commands(guide: &str) -> Vec<Vec<&str>> {
    let blocks = guide.split("```sh\n").skip(1).filter_map(|rest| rest.split("\n```").next());
    blocks.flat_map(str::lines).map(|line| line.split_whitespace().skip(1).collect()).collect()
}

/// What a command of the guide prints, run in `folder`.
fn run(folder: &Path, words: &[&str], code: i32) -> String {
    let output = acm().current_dir(folder).args(words).output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_wrong_placement_leads_to_the_frame_and_the_memory_entry_at_fault() {
    let guide = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/debugging.md")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let mut whys = 0;
    for words in commands(&guide) {
        match words.get(..2).unwrap() {
            ["run", _] => {
                let told = run(dir.path(), &words, 1);
                assert!(told.contains("strict: no success"), "the agent was not misled: {told}");
            }
            ["trace", "why"] => {
                let told = run(dir.path(), &words, 0);
                // What the page quotes is what is printed, but for the dots that shorten it.
                let quoted = guide.split("```text\n").skip(2).filter_map(|rest| rest.split("\n```").next());
                for line in quoted.flat_map(str::lines) {
                    let line = line.trim_start_matches("meant").trim_start_matches("written by");
                    let line = line.trim_start_matches("seen in").trim();
                    assert!(told.contains(line), "the guide says `{line}`, but:\n{told}");
                }
                faults(dir.path(), &words);
                whys += 1;
            }
            // A server, and a file that the guide leaves to its reader.
            ["trace", "view" | "check"] => {}
            ["trace", "replay"] if words.contains(&"--fork") => {
                let told = run(dir.path(), &words, 3);
                assert!(told.starts_with("as recorded up to message"), "{told}");
            }
            ["trace", "replay"] => assert!(run(dir.path(), &words, 0).starts_with("identical: ")),
            _ => drop(run(dir.path(), &words, 0)),
        }
    }
    assert_eq!(whys, 1);
}

/// The same as data: the frame that is at odds with all others is the one with the fault, and the decision rests on an
/// entry that was written from it.
fn faults(folder: &Path, words: &[&str]) {
    let told: Value = serde_json::from_str(&run(folder, &[words, &["--json"]].concat(), 0)).unwrap();
    let nodes = told["why"]["nodes"].as_array().unwrap();
    let lines =
        |node: &Value| node["lines"].as_array().unwrap().iter().map(|line| line.as_str().unwrap()).collect::<String>();
    let of = |kind: &'static str| nodes.iter().filter(move |node| node["kind"] == kind);
    let at_odds: Vec<&Value> = of("frame").filter(|node| lines(node).contains("AT ODDS")).collect();
    assert_eq!(at_odds.len(), 1, "{at_odds:?}");
    assert_eq!(at_odds[0]["id"], "F0");
    let entry = of("change")
        .find(|node| lines(node) == "by frame F0" && node["title"].as_str().unwrap().starts_with("history"));
    let entry = entry.expect("a line of the cube's history that rests on the frame").clone();
    let links = told["why"]["links"].as_array().unwrap();
    assert!(links.iter().any(|link| link["from"] == entry["id"] && link["to"] == "F0"));
}
