//! The agent's source names no scenario and no object of the simulator: nothing in it can branch on one.

use super::{files, read, root};
use anyhow::Result;
use std::{collections::BTreeSet, path::Path};

/// Rooms of the agent's side.
const AGENT_ROOMS: [&str; 4] = ["actors", "llm", "memory", "perception"];
/// Scenarios and the simulator's own object models, one a file.
const WORLD_DATA: &str = "sim/scenarios";

/// The part of a source that is compiled into the product: unit tests stand at a file's end.
fn product(source: &str) -> &str {
    source.find("#[cfg(test)]").and_then(|at| source.get(..at)).unwrap_or(source)
}

/// Whether a file holds tests alone.
fn is_test_file(path: &Path) -> bool {
    let mut folders = path.components().map(|part| part.as_os_str());
    path.file_name().is_some_and(|name| name == "tests.rs") || folders.any(|name| name == "tests" || name == "benches")
}

/// The names that stand in a source as whole string literals, with the number of the line.
fn quoted<'a>(source: &str, names: &'a BTreeSet<String>) -> Vec<(usize, &'a str)> {
    let mut found = Vec::new();
    for (index, line) in source.lines().enumerate() {
        let hits = names.iter().filter(|name| line.contains(&format!("\"{name}\"")));
        found.extend(hits.map(|name| (index + 1, name.as_str())));
    }
    found
}

#[test]
fn agent_source_names_no_scenario_and_no_object_model() -> Result<()> {
    let stem = |path: &Path| path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let names: BTreeSet<String> = files(&root().join(WORLD_DATA), "toml")?.iter().filter_map(|p| stem(p)).collect();
    assert!(!names.is_empty(), "there are no files in {WORLD_DATA}: correct the path here");
    let (mut read_files, mut complaints) = (0, Vec::new());
    for room in AGENT_ROOMS {
        for path in files(&root().join(room), "rs")?
            .iter()
            .filter(|path| !is_test_file(path.strip_prefix(root()).unwrap_or(path)))
        {
            read_files += 1;
            for (line, name) in quoted(product(&read(path)?), &names) {
                complaints.push(format!("{}:{line} names `{name}` of {WORLD_DATA}", path.display()));
            }
        }
    }
    assert!(read_files > 20, "found {read_files} files only: correct the rooms here");
    assert_eq!(complaints, Vec::<String>::new());
    Ok(())
}

#[test]
fn a_name_in_agent_source_is_noticed() {
    let names = BTreeSet::from(["tidy-desk".to_owned()]);
    let source = "fn a(t: &str) {\n    if t == \"tidy-desk\" { cheat() }\n}\n#[cfg(test)]\nmod tests { const T: &str = \"tidy-desk\"; }\n";
    assert_eq!(quoted(product(source), &names), [(2, "tidy-desk")]);
    assert_eq!(quoted("// as in tidy-desk, or \"tidy-desk-2\"", &names), []);
    assert!(is_test_file(Path::new("memory/tests/log.rs")) && is_test_file(Path::new("memory/src/log/tests.rs")));
    assert!(!is_test_file(Path::new("memory/src/log.rs")));
}
