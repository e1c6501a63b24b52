//! Each invariant of ARCHITECTURE.md names tests that exist or a lint, or says that it has no proof yet.

use super::{files, read, root};
use anyhow::Result;

/// What an invariant says that no test proves: it has no proof, or the compiler refuses what would break it.
const WITHOUT_TEST: [&str; 2] = ["no proof yet", "lint: `clippy.toml`"];

/// The `file.rs::test_name` references of a line, in back ticks.
fn references(line: &str) -> Vec<(&str, &str)> {
    let quoted = line.split('`').skip(1).step_by(2);
    quoted.filter_map(|text| text.split_once("::").filter(|(file, _)| file.ends_with(".rs"))).collect()
}

/// Whether a source has a test of this name: a function whose attributes include one that ends in `test`.
fn has_test(source: &str, name: &str) -> bool {
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    let defines = |line: &str| {
        let rest = line.strip_prefix("async ").unwrap_or(line);
        rest.strip_prefix("fn ").and_then(|rest| rest.strip_prefix(name)).is_some_and(|rest| rest.starts_with('('))
    };
    let is_test = |at: usize| {
        let above = lines.iter().take(at).rev().take_while(|line| line.starts_with("#[") || line.starts_with("//"));
        above.into_iter().any(|line| line.starts_with("#[test]") || line.starts_with("#[tokio::test"))
    };
    lines.iter().enumerate().any(|(at, line)| defines(line) && is_test(at))
}

/// One sentence for each invariant whose proof cannot be found among the sources (path, text).
fn unproved(document: &str, sources: &[(String, String)]) -> Vec<String> {
    let mut complaints = Vec::new();
    for line in document.lines().filter(|line| line.starts_with("Architecture Invariant:")) {
        let references = references(line);
        if references.is_empty() && !WITHOUT_TEST.iter().any(|words| line.contains(words)) {
            complaints.push(format!("names no test and says none of {WITHOUT_TEST:?}: {line}"));
        }
        for (file, test) in references {
            let suffix = format!("/{file}");
            let found = sources.iter().any(|(path, text)| path.ends_with(&suffix) && has_test(text, test));
            if !found {
                complaints.push(format!("there is no test {file}::{test}, which proves: {line}"));
            }
        }
    }
    complaints
}

#[test]
fn each_invariant_names_a_test_that_exists() -> Result<()> {
    let document = read(&root().join("ARCHITECTURE.md"))?;
    let sources = files(&root(), "rs")?;
    let sources: Vec<(String, String)> =
        sources.iter().map(|path| Ok((path.display().to_string(), read(path)?))).collect::<Result<_>>()?;
    assert!(document.contains("\nArchitecture Invariant:"), "ARCHITECTURE.md has no invariant");
    assert_eq!(unproved(&document, &sources), Vec::<String>::new());
    Ok(())
}

#[test]
fn a_missing_proof_is_noticed() {
    let source = "#[test]\n// Why.\nfn holds() {}\n\nfn helper() {}\n#[tokio::test]\nasync fn waits() {}\n";
    let sources = [("/a/room/src/door.rs".to_owned(), source.to_owned())];
    let complaints = |line: &str| unproved(&format!("x\nArchitecture Invariant: {line}\ny"), &sources);
    assert_eq!(complaints("doors close (`door.rs::holds`)."), Vec::<String>::new());
    assert_eq!(complaints("doors close (`room/src/door.rs::waits`)."), Vec::<String>::new());
    assert_eq!(complaints("doors close (no proof yet)."), Vec::<String>::new());
    assert_eq!(complaints("doors close.").len(), 1);
    assert_eq!(complaints("doors close (`door.rs::hold`).").len(), 1);
    assert_eq!(complaints("doors close (`door.rs::helper`).").len(), 1);
    assert_eq!(complaints("doors close (`oor.rs::holds`).").len(), 1);
}
