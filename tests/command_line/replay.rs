//! `acm trace diff`, `check`, `replay` and `repair`.

use crate::{acm, refuses, trace::prints};
use acm_runtime::trace::{Item, TraceOptions, TraceReader, TraceWriter, reader::TraceMessage};
use std::{
    fs,
    path::{Path, PathBuf},
    sync::OnceLock,
};

struct Runs {
    _dir: tempfile::TempDir,
    /// Seed 3 with all pixels, seed 3 again, seed 4, and seed 3 on the memory that a run before it left.
    full: PathBuf,
    again: PathBuf,
    other: PathBuf,
    later: PathBuf,
}

fn runs() -> &'static Runs {
    static RUNS: OnceLock<Runs> = OnceLock::new();
    RUNS.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        let run = |seed: &str, name: &str, more: &[&str]| {
            let words = ["run", "put-back-block", "--seed", seed, "--inject", "slip@1", "--json", "--trace"];
            let output = acm().args(words).arg(path(name)).args(more).output().unwrap();
            assert!(path(name).exists(), "{}", String::from_utf8_lossy(&output.stderr));
            path(name)
        };
        let memory = path("memory");
        let memory = ["--memory", memory.to_str().unwrap(), "--trace-frames", "full"];
        let full = run("3", "full.mcap", &["--trace-frames", "full"]);
        let again = run("3", "again.mcap", &["--trace-frames", "full"]);
        let other = run("4", "other.mcap", &["--trace-frames", "full"]);
        run("4", "before.mcap", &memory);
        let later = run("3", "later.mcap", &memory);
        Runs { full, again, other, later, _dir: dir }
    })
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// What `acm` prints where it ends with exit code 1.
fn finds(arguments: &[&str]) -> String {
    let output = acm().args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Every message of a trace.
fn messages(path: &Path) -> (Vec<TraceMessage>, bool) {
    let mut reader = TraceReader::open(path).unwrap();
    let mut messages = Vec::new();
    while let Some(item) = reader.next_item() {
        if let Item::Message(message) = item {
            messages.push(message);
        }
    }
    (messages, reader.cut().is_none())
}

/// Writes a trace once more, its messages changed by `change`.
fn rewritten(from: &Path, to: &Path, mut change: impl FnMut(&mut TraceMessage)) {
    let writer = TraceWriter::create(to, TraceOptions::default()).unwrap();
    let mut reader = TraceReader::open(from).unwrap();
    while let Some(item) = reader.next_item() {
        match item {
            Item::Metadata { name, values } => writer.metadata(&name, values).unwrap(),
            Item::Attachment { name, media_type, data } => writer.attach(&name, &media_type, &data).unwrap(),
            Item::Message(mut message) => {
                change(&mut message);
                let channel = writer.channel(message.topic(), &message.channel.schema()).unwrap();
                writer.put(channel, u64::from(message.sequence), message.time_ns, &message.data).unwrap();
            }
        }
    }
    writer.finish().unwrap();
}

#[test]
fn two_runs_of_one_seed_are_equal_and_of_two_seeds_part() {
    let runs = runs();
    assert_eq!(prints(&["trace", "diff", text(&runs.full), text(&runs.again)]), "equal\n");
    let told = finds(&["trace", "diff", text(&runs.full), text(&runs.other)]);
    assert!(told.contains("they part after") && told.contains("/effect/frame"), "{told}");
    assert!(told.contains("/color_blake3"), "{told}");
    refuses(&["trace", "diff", text(&runs.full), "no-such.mcap"], &["no-such.mcap"]);
}

#[test]
fn a_recorded_run_is_replayed_from_its_trace_alone_and_with_its_world() {
    let full = text(&runs().full);
    let told = prints(&["trace", "replay", full]);
    assert!(told.starts_with("identical: ") && !told.contains("identical: 0"), "{told}");
    assert_eq!(prints(&["trace", "replay", full, "--resim"]), told);
    assert_eq!(
        prints(&["trace", "replay", full, "--until", "12"]),
        "identical up to message 12, where it was to stop\n"
    );
    let stepped = prints(&["trace", "replay", full, "--until", "5", "--step"]);
    assert!(stepped.lines().count() == 6 && stepped.contains("episode -> planner  parse"), "{stepped}");
    // The memory that it began with is in the trace, and the one on disk is not touched.
    assert!(prints(&["trace", "replay", text(&runs().later)]).starts_with("identical: "));
}

#[test]
fn a_fork_is_the_recorded_run_up_to_a_message_and_another_one_from_there() {
    let dir = tempfile::tempdir().unwrap();
    let (full, forked) = (&runs().full, dir.path().join("forked.mcap"));
    let words = ["trace", "replay", text(full), "--fork", "900", "--inject", "black-frames", "--trace", text(&forked)];
    let output = acm().args(words).output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(3), "a robot that sees nothing gives up: {told}");
    assert!(told.starts_with("as recorded up to message 900, then live"), "{told}");
    let messages = |path| {
        let (all, _) = messages(path);
        let of = |message: TraceMessage| (message.topic().to_owned(), message.data);
        let is_message = |message: &TraceMessage| message.channel.schema == "acm.Message";
        all.into_iter().filter(is_message).map(of).collect::<Vec<_>>()
    };
    let (before, after) = (messages(full), messages(&forked));
    assert!(before[..900] == after[..900] && before != after);
    // What matters before the fork is told, and is no fork.
    let told = finds(&["trace", "replay", text(full), "--fork", "900", "--set", "robot.model=\"panda\""]);
    assert!(told.contains("before message 900"), "{told}");
    refuses(&["trace", "replay", text(full), "--fork", "999999"], &["999999", "messages 1 to"]);
}

#[test]
fn a_fork_goes_by_other_settings_from_its_message_on() {
    let dir = tempfile::tempdir().unwrap();
    let settings = dir.path().join("blind.toml");
    // No depth is ever so complete: every frame counts as blind.
    fs::write(&settings, "[perception]\nmin_depth_fraction = 1.0\n").unwrap();
    let words = ["trace", "replay", text(&runs().full), "--fork", "900", "--config", text(&settings)];
    let output = acm().args(words).output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.starts_with("as recorded up to message 900, then live"), "{told}");
    assert_eq!(output.status.code(), Some(3), "{told}");
    // What changes nothing changes nothing.
    let guess = ["trace", "replay", text(&runs().full), "--fork", "900", "--on-unknown", "guess"];
    assert!(prints(&guess).starts_with("as recorded up to message 900, then live"));
    fs::write(&settings, "[perception]\nmin_depth_fractoin = 1.0\n").unwrap();
    refuses(&words, &["line 2", "min_depth_fractoin"]);
}

#[test]
fn a_run_with_a_configuration_is_replayed_without_its_file() {
    let dir = tempfile::tempdir().unwrap();
    let (settings, path) = (dir.path().join("sure.toml"), dir.path().join("sure.mcap"));
    fs::write(&settings, "on_unknown = \"guess\"\n[perception]\nmin_confidence = 0.5\n").unwrap();
    let words =
        ["run", "put-back-block", "--seed", "3", "--json", "--trace-frames", "full", "--config", text(&settings)];
    let output = acm().args(words).arg("--trace").arg(&path).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stdout).contains("\"on_unknown\": \"guess\""));
    fs::remove_file(&settings).unwrap();
    assert!(prints(&["trace", "replay", text(&path)]).starts_with("identical: "));
}

#[test]
fn a_fork_goes_on_with_another_memory_and_is_replayed_without_its_folder() {
    let dir = tempfile::tempdir().unwrap();
    let (donor, forked) = (dir.path().join("donor"), dir.path().join("forked.mcap"));
    acm().args(["run", "put-back-block", "--seed", "4", "--json", "--memory", text(&donor)]).output().unwrap();
    let fault = format!("transplant-memory={}@first-verified-place", donor.display());
    let words = ["trace", "replay", text(&runs().full), "--fork", "700", "--inject", &fault, "--trace", text(&forked)];
    let output = acm().args(words).output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.starts_with("as recorded up to message 700, then live"), "{told}");
    assert!(prints(&["trace", "show", text(&forked), "--kind", "transplant"]).contains("episode > memory"));

    let path = dir.path().join("transplanted.mcap");
    let words = ["run", "put-back-block", "--seed", "3", "--json", "--trace-frames", "full", "--inject", &fault];
    acm().args(words).arg("--trace").arg(&path).output().unwrap();
    fs::remove_dir_all(&donor).unwrap();
    assert!(prints(&["trace", "replay", text(&path)]).starts_with("identical: "));
    refuses(&words, &["holds no memory", text(&donor)]);
}

#[test]
fn a_trace_without_pixels_is_replayed_with_its_world_only() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("hash.mcap");
    let words = ["run", "put-back-block", "--seed", "5", "--json", "--trace-frames", "hash", "--trace"];
    acm().args(words).arg(&path).output().unwrap();
    refuses(&["trace", "replay", text(&path)], &["--trace-frames full", "--resim"]);
    assert!(prints(&["trace", "replay", text(&path), "--resim"]).starts_with("identical: "));
}

/// What a build would leave that goes over what it drops in the order of a hash: the same objects, in another order.
#[test]
fn an_order_that_is_not_the_runs_own_is_caught_and_located() {
    let dir = tempfile::tempdir().unwrap();
    let (path, mut swapped) = (dir.path().join("swapped.mcap"), None);
    rewritten(&runs().full, &path, |message| {
        if swapped.is_some() || message.topic() != "/episode/decided" {
            return;
        }
        let mut record: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
        let references = record.pointer_mut("/body/decision/act/explanation/references").and_then(|r| r.as_array_mut());
        let dropped = references.into_iter().flatten().find_map(|reference| {
            let dropped = reference.pointer_mut("/retrieval/dropped").and_then(|dropped| dropped.as_array_mut());
            dropped.filter(|dropped| dropped.len() > 1)
        });
        if let Some(dropped) = dropped {
            dropped.swap(0, 1);
            swapped = record["seq"].as_u64();
            message.data = serde_json::to_vec(&record).unwrap();
        }
    });
    let seq = swapped.expect("a decision that dropped two objects");
    let told = finds(&["trace", "replay", text(&path)]);
    assert!(told.starts_with(&format!("DIVERGED at message {seq}\n")), "{told}");
    assert!(
        told.contains("/body/decision/act/explanation/references/") && told.contains("/retrieval/dropped/0/0: "),
        "{told}"
    );
    let told = finds(&["trace", "diff", text(&runs().full), text(&path)]);
    assert!(told.contains(&format!("message {seq}")), "{told}");
}

/// What the journal of a run looks like that somebody ended from outside: nothing makes a replay end at the same instant.
#[test]
fn a_run_that_was_interrupted_is_replayed_up_to_there() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("interrupted.mcap");
    rewritten(&runs().full, &path, |message| {
        if message.channel.schema == "acm.Message" && message.sequence == 901 {
            let mut record: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
            let (from, kind, body) = ("outside".into(), "interrupt".into(), serde_json::Value::Null);
            (record["from"], record["kind"], record["body"]) = (from, kind, body);
            message.data = serde_json::to_vec(&record).unwrap();
        }
    });
    let told = prints(&["trace", "replay", text(&path)]);
    assert_eq!(told, "identical up to message 900, where the run was interrupted by hand\n");
}

#[test]
fn a_cut_trace_is_repaired_up_to_its_last_whole_message() {
    let dir = tempfile::tempdir().unwrap();
    let (whole, cut, out) = (dir.path().join("whole.mcap"), dir.path().join("cut.mcap"), dir.path().join("out.mcap"));
    // Without the pixels, so that a thousand cuts are soon made.
    let full = &runs().full;
    let writer = TraceWriter::create(&whole, TraceOptions::default()).unwrap();
    let (all, _) = messages(full);
    for message in all.iter().filter(|message| !message.topic().starts_with("/camera/")).take(700) {
        let channel = writer.channel(message.topic(), &message.channel.schema()).unwrap();
        writer.put(channel, u64::from(message.sequence), message.time_ns, &message.data).unwrap();
        if message.sequence.is_multiple_of(5) {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
    let (all, _) = messages(&whole);
    let bytes = fs::read(&whole).unwrap();
    // The end of each chunk, and how many messages stand in the file up to there.
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut chunks: Vec<(usize, usize)> = Vec::new();
    for chunk in &summary.chunk_indexes {
        let before = chunks.last().map_or(0, |(_, before)| *before);
        let end = chunk.chunk_start_offset + chunk.chunk_length;
        chunks.push((end as usize, before + summary.stream_chunk(&bytes, chunk).unwrap().count()));
    }
    assert!(chunks.len() > 20 && chunks.last().unwrap().1 == all.len());
    let mut place = 7usize;
    for _ in 0..1000 {
        place = (place.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407)) % bytes.len();
        fs::write(&cut, &bytes[..place]).unwrap();
        let Ok(repaired) = acm::trace::repair::repair(&cut, &out) else {
            assert!(place < 100, "{place} bytes hold a header");
            continue;
        };
        let least = chunks.iter().take_while(|(end, _)| *end <= place).last().map_or(0, |(_, count)| *count);
        assert!(repaired.messages as usize >= least, "{place}: {repaired:?}, {least} stand in whole chunks");
        if repaired.cut.is_some() {
            let (kept, is_whole) = messages(&out);
            assert!(is_whole && kept == all[..kept.len()] && kept.len() == repaired.messages as usize, "{place}");
        }
    }
    let before = fs::read(&cut).unwrap();
    refuses(&["trace", "repair", text(&cut), "--out", text(&cut)], &["another one"]);
    assert_eq!(fs::read(&cut).unwrap(), before);
}

#[test]
fn what_stands_in_a_cut_chunk_is_kept_as_far_as_it_can_be_unpacked() {
    let dir = tempfile::tempdir().unwrap();
    let (cut, out) = (dir.path().join("cut.mcap"), dir.path().join("out.mcap"));
    let writer = TraceWriter::create(&cut, TraceOptions::default()).unwrap();
    let schema = acm_runtime::trace::journal::json_schema("acm.Test", "{}");
    let channel = writer.channel("/test", &schema).unwrap();
    // Numbers that hardly get smaller by packing: more than one block of the packer.
    let mut number = 1u64;
    for sequence in 0..40u64 {
        let mut words = Vec::new();
        for _ in 0..1000 {
            number = number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            words.push(number);
        }
        writer.put(channel, sequence, sequence, &serde_json::to_vec(&words).unwrap()).unwrap();
    }
    writer.finish().unwrap();
    let bytes = fs::read(&cut).unwrap();
    fs::write(&cut, &bytes[..bytes.len() * 7 / 10]).unwrap();
    let repaired = acm::trace::repair::repair(&cut, &out).unwrap();
    let (kept, is_whole) = messages(&out);
    assert!(is_whole && (20..30).contains(&kept.len()) && kept.len() as u64 == repaired.messages, "{repaired:?}");
}

#[test]
fn rules_are_kept_or_broken() {
    let dir = tempfile::tempdir().unwrap();
    let rules = dir.path().join("rules.toml");
    let check = |text_of_rules: &str| {
        fs::write(&rules, text_of_rules).unwrap();
        ["trace", "check", text(&runs().full), text(&rules)].map(str::to_owned)
    };
    let kept = check(
        "[[rule]]\nname = 'each skill is judged'\neach = { kind = 'skill-ended' }\nthen = { kind = 'verdict' }\n",
    );
    assert_eq!(prints(&kept.each_ref().map(String::as_str)), "ok      each skill is judged\n");
    let broken =
        check("[[rule]]\nname = 'no press'\nnever = { kind = 'execute', body = { '/kind' = 'press-down' } }\n");
    assert!(finds(&broken.each_ref().map(String::as_str)).starts_with("BROKEN  no press: message "));
    let wrong = check("[[rule]]\nname = 'x'\nnevr = {}\n");
    refuses(&wrong.each_ref().map(String::as_str), &["rules.toml", "nevr"]);
}
