//! The simulator's object models and the agent's templates have nothing in common but the world that they describe.
//! That neither crate can name the other is proven in `arrows`.

use super::{files, read, root};
use anyhow::{Context, Result};
use std::{collections::BTreeSet, path::Path};
use toml::Value;

/// What each side describes its things with.
const WORLD_DATA: &str = "sim/scenarios";
const TEMPLATES: &str = "memory/library";
/// Source of the side that may not read the other's data.
const WORLD_SOURCE: &str = "sim";
const AGENT_SOURCES: [&str; 4] = ["actors", "llm", "memory", "perception"];

/// Every solid of a file, without its colour, in one form.
fn solids(table: &toml::Table) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (key, value) in table {
        match value {
            Value::Array(items) => {
                for item in items.iter().filter_map(Value::as_table) {
                    if key == "solid" {
                        let geometry = item.iter().filter(|(field, _)| !["color", "part"].contains(&field.as_str()));
                        found.insert(Value::Table(geometry.map(|(k, v)| (k.clone(), v.clone())).collect()).to_string());
                    }
                    found.extend(solids(item));
                }
            }
            Value::Table(inner) => found.extend(solids(inner)),
            _ => {}
        }
    }
    found
}

/// Solids of all files below a folder, and the files' names.
fn described(folder: &Path) -> Result<(BTreeSet<String>, usize)> {
    let paths = files(folder, "toml")?;
    let mut all = BTreeSet::new();
    for path in &paths {
        let table: toml::Table = read(path)?.parse().with_context(|| format!("cannot read {}", path.display()))?;
        all.extend(solids(&table));
    }
    Ok((all, paths.len()))
}

/// Sources below a folder that mention a folder of data.
fn mentions(folder: &str, data: &str) -> Result<Vec<String>> {
    let mut found = Vec::new();
    for path in files(&root().join(folder), "rs")? {
        // Doc comments may speak of it; code that reads it names it outside them.
        let code = read(&path)?.lines().any(|line| !line.trim_start().starts_with("//") && line.contains(data));
        if code {
            found.push(path.display().to_string());
        }
    }
    Ok(found)
}

#[test]
fn object_models_and_templates_share_no_file_and_no_solid() -> Result<()> {
    let (models, model_files) = described(&root().join(WORLD_DATA))?;
    let (templates, template_files) = described(&root().join(TEMPLATES))?;
    assert!(model_files >= 5 && template_files >= 5, "correct the folders here");
    assert!(models.len() >= 5 && templates.len() >= 5, "no solids are found: {models:?} {templates:?}");
    assert_eq!(models.intersection(&templates).collect::<Vec<_>>(), Vec::<&String>::new());
    assert_eq!(mentions(WORLD_SOURCE, "memory/library")?, Vec::<String>::new());
    assert_eq!(mentions(WORLD_SOURCE, "/library")?, Vec::<String>::new());
    for folder in AGENT_SOURCES {
        assert_eq!(mentions(folder, "sim/scenarios")?, Vec::<String>::new());
        assert_eq!(mentions(folder, "scenarios/objects")?, Vec::<String>::new());
    }
    for path in files(&root().join(WORLD_DATA), "toml")?.iter().chain(&files(&root().join(TEMPLATES), "toml")?) {
        assert!(!std::fs::symlink_metadata(path)?.is_symlink(), "{} stands for another file", path.display());
    }
    Ok(())
}

#[test]
fn a_solid_that_both_sides_have_is_found_whatever_its_colour() -> Result<()> {
    let parse = |text: &str| text.parse::<toml::Table>();
    let model = solids(&parse("[[model]]\n[[model.solid]]\nshape = 'box'\nsize = [1, 2, 3]\ncolor = '#000000'")?);
    let template = solids(&parse("[[solid]]\nsize = [1, 2, 3]\nshape = 'box'\npart = 'lid'")?);
    let other = solids(&parse("[[solid]]\nsize = [1, 2, 4]\nshape = 'box'")?);
    assert_eq!(model, template);
    assert!(model.is_disjoint(&other) && model.len() == 1);
    Ok(())
}
