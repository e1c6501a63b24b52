//! `acm bench rmbench` from outside: what was run is kept, gone on with, and shown on a page that needs nothing else.

use super::{acm, refuses};
use std::{fs, path::Path};

const BENCH: [&str; 8] = ["bench", "rmbench", "--tasks", "put-back-block", "--on-unknown", "abstain", "--workers", "2"];

fn run(out: &Path, more: &[&str]) -> (Option<i32>, String) {
    let output = acm().args(BENCH).args(["--out", out.to_str().unwrap()]).args(more).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
fn what_was_run_is_gone_on_with() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let memories = ["--memories", "reactive", "--seeds", "2"];
    let (code, text) = run(&out, &[&memories[..], &["--episodes", "1"]].concat());
    assert!(code == Some(1) && text.contains("1 of 2 episodes were not run"), "{code:?}: {text}");
    let results = out.join("results.jsonl");
    let first = fs::read_to_string(&results).unwrap();
    assert_eq!(first.lines().count(), 2, "a head and one episode: {first}");
    assert!(first.contains("\"scenario\":\"put-back-block\"") && first.contains("\"seed\":100000"), "{first}");

    // Cut within the second episode's line, as by a power failure.
    fs::write(&results, format!("{first}{{\"scenario\":\"put-ba")).unwrap();
    let (code, text) = run(&out, &memories);
    assert_eq!(code, Some(0), "{text}");
    let both = fs::read_to_string(&results).unwrap();
    assert!(both.starts_with(&first) && both.lines().count() == 3, "{both}");
    assert!(text.contains("gave_up 1") && text.contains("strict 0 "), "without a past nothing is put back: {text}");

    let page = fs::read_to_string(out.join("page.html")).unwrap();
    for part in ["reactive", "<svg", "another simulator", "What stays unfair"] {
        assert!(page.contains(part), "no `{part}` on the page");
    }
    for outside in ["http://", "https://", "<script", "@import", "<link"] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn mistakes_are_one_line_and_run_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out").display().to_string();
    let refuse = |more: &[&str], parts: &[&str]| refuses(&[&["bench", "rmbench", "--out", &out], more].concat(), parts);
    refuse(&["--memories", "windows"], &["no method `windows`", "did you mean `window`?"]);
    refuse(&["--tasks", "swap-tea"], &["swap-tea", "did you mean `swap-t`?"]);
    refuse(&["--blocks", "fresh", "--fresh-from", "100050"], &["--fresh-from 100050", "100100"]);
    assert!(!Path::new(&out).exists());
}
