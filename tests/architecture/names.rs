//! The agent's source names no scenario and no object of the simulator: nothing in it can branch on one.

use super::{files, read, root};
use anyhow::{Context, Result};
use std::{collections::BTreeSet, path::Path};

/// Rooms of the agent's side.
const AGENT_ROOMS: [&str; 4] = ["actors", "llm", "memory", "perception"];
/// Scenarios, and the simulator's own object models in a folder below.
const WORLD_DATA: &str = "sim/scenarios";

/// The names that a file of the simulator's gives away: its own, the scenario's, and those of the models it declares.
fn names(path: &Path, text: &str) -> Result<BTreeSet<String>> {
    let table: toml::Table = text.parse().with_context(|| format!("cannot read {}", path.display()))?;
    let models = table.get("model").and_then(|model| model.as_array()).into_iter().flatten();
    let declared = models.filter_map(|model| model.get("model")).chain(table.get("model")).chain(table.get("scenario"));
    let mut names: BTreeSet<String> = declared.filter_map(|name| name.as_str()).map(str::to_owned).collect();
    names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
    Ok(names)
}

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
    let mut world_names = BTreeSet::new();
    for path in files(&root().join(WORLD_DATA), "toml")? {
        world_names.extend(names(&path, &read(&path)?)?);
    }
    assert!(!world_names.is_empty(), "there are no files in {WORLD_DATA}: correct the path here");
    let mut sources = Vec::new();
    for room in AGENT_ROOMS {
        sources.extend(files(&root().join(room), "rs")?);
    }
    sources.retain(|path| !is_test_file(path.strip_prefix(root()).unwrap_or(path)));
    assert!(sources.len() > 20, "found {} files only: correct the rooms here", sources.len());
    let mut complaints = Vec::new();
    for path in &sources {
        for (line, name) in quoted(product(&read(path)?), &world_names) {
            complaints.push(format!("{}:{line} names `{name}` of {WORLD_DATA}", path.display()));
        }
    }
    assert_eq!(complaints, Vec::<String>::new());
    Ok(())
}

#[test]
fn the_names_of_a_scenario_file_are_all_found() -> Result<()> {
    let text = "scenario = \"tidy-desk\"\n[[object]]\nmodel = \"tray\"\n[[model]]\nmodel = \"odd-tray\"\n";
    let found: Vec<String> = names(Path::new("a/desk.toml"), text)?.into_iter().collect();
    assert_eq!(found, ["desk", "odd-tray", "tidy-desk"]);
    let found: Vec<String> = names(Path::new("objects/tray.toml"), "model = \"tray-2\"")?.into_iter().collect();
    assert_eq!(found, ["tray", "tray-2"]);
    assert!(names(Path::new("x.toml"), "model = ").is_err());
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
