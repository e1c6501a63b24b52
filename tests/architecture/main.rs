//! What must hold of the whole house, whatever its rooms do inside. ARCHITECTURE.md says it in words.
//!
//! | module | proves |
//! |---|---|
//! | `arrows` | which crate may know which other |
//! | `licences` | that everything we build on fits Apache-2.0 OR MIT |
//! | `names` | that the agent's source names no scenario and no object of the simulator |
//! | `models` | that the simulator's object models share nothing with the agent's templates |
//! | `invariants` | that each proof which ARCHITECTURE.md names is a test that exists |
//! | `guides` | that the examples and tables of docs/ are true |

mod arrows;
mod guides;
mod invariants;
mod licences;
mod models;
mod names;

use anyhow::{Context, Result};
use cargo_metadata::{CargoOpt, Metadata, MetadataCommand};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// The root of the repository.
fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The workspace with all features and everything it is built on, on every platform.
fn metadata() -> Result<Metadata> {
    MetadataCommand::new()
        .current_dir(root())
        .features(CargoOpt::AllFeatures)
        .other_options(["--offline".to_owned(), "--locked".to_owned()])
        .exec()
        .context("cargo metadata failed; run `cargo fetch --locked` once, so that every platform's sources are there")
}

/// The files below a folder whose names end with `.extension`, in the order of their paths; none if there is no
/// such folder.
fn files(folder: &Path, extension: &str) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    if !folder.is_dir() {
        return Ok(found);
    }
    for entry in fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))? {
        let entry = entry?;
        let path = entry.path();
        // Links are not followed: they could lead in a circle.
        if entry.file_type()?.is_dir() {
            if entry.file_name() != "target" && entry.file_name() != ".git" {
                found.extend(files(&path, extension)?);
            }
        } else if path.extension().is_some_and(|found| found == extension) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}
