//! `acm demo`: what it prints, its page and its traces say the same.

use crate::{acm, refuses};
use serde_json::Value;
use std::{collections::BTreeSet, fs, path::Path};

#[test]
fn the_demo_leaves_a_page_of_the_episode_that_it_told() {
    let dir = tempfile::tempdir().unwrap();
    let picture = dir.path().join("picture.jpg");
    let output = acm()
        .args(["demo", "--more-seeds", "0", "--out", dir.path().to_str().unwrap()])
        .arg("--picture")
        .arg(&picture)
        .output()
        .unwrap();
    let told = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{told}{}", String::from_utf8_lossy(&output.stderr));
    let lines: Vec<&str> = told.lines().collect();
    assert!(lines.len() <= 30 && lines.iter().all(|line| line.len() <= 160), "{told}");
    for heading in ["1 WATCH", "2 RESTART", "3 ASK", "4 ACT", "5 JUDGE", "6 NOW WITHOUT MEMORY"] {
        assert!(lines.iter().any(|line| line.starts_with(heading)), "no `{heading}` in {told}");
    }
    assert!(told.contains("success, ") && told.contains("HONEST FAILURE"), "{told}");
    assert!(fs::metadata(&picture).unwrap().len() < 300_000);

    let html = fs::read_to_string(dir.path().join("index.html")).unwrap();
    for outside in ["http://", "https://", "src=", "@import", "<link", "fetch("] {
        assert!(!html.contains(outside), "the page asks for something outside: {outside}");
    }
    let data = html.split(r#"id="data">"#).nth(1).unwrap().split("</script>").next().unwrap();
    let page: Value = serde_json::from_str(data).unwrap();
    assert_eq!(page["facts"]["solved"], true);
    let steps = page["runs"][0]["steps"].as_array().unwrap();
    assert!(steps.iter().all(|step| !step["image"].is_null() || !step["same_as"].is_null()));
    let shown: BTreeSet<&str> =
        steps.iter().flat_map(|s| s["objects"].as_array().unwrap()).map(|o| o["id"].as_str().unwrap()).collect();
    let remembered = ids_of_the_trace(&dir.path().join("run.mcap"));
    assert_eq!(shown, remembered.iter().map(String::as_str).collect());
    for card in page["why"].as_array().unwrap() {
        assert!(remembered.contains(card["object"].as_str().unwrap()), "{card}");
        assert!(card["image"].as_str().unwrap().starts_with("data:image/jpeg;base64,"), "a card without its proof");
    }
}

/// The objects that memory had when the asked agent looked last.
fn ids_of_the_trace(trace: &Path) -> BTreeSet<String> {
    let output = acm().args(["trace", "show", "--kind", "updated", "--json"]).arg(trace).output().unwrap();
    let shown: Value = serde_json::from_slice(&output.stdout).unwrap();
    let last = shown["messages"].as_array().unwrap().last().unwrap();
    let objects = last["body"]["view"]["objects"].as_array().unwrap();
    objects.iter().map(|object| object["id"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_folder_with_another_memory_is_not_emptied() {
    let dir = tempfile::tempdir().unwrap();
    let kept = dir.path().join("memory/kept.txt");
    fs::create_dir(dir.path().join("memory")).unwrap();
    fs::write(&kept, "mine").unwrap();
    refuses(&["demo", "--out", dir.path().to_str().unwrap()], &["was not made by a demo", "--out"]);
    assert_eq!(fs::read_to_string(&kept).unwrap(), "mine");
}
