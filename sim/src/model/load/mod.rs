//! Objects from robotics formats: URDF and MJCF with their meshes.
//!
//! | module | holds |
//! |---|---|
//! | `urdf`, `mjcf` | the two formats, parsed by `urdf-rs` and `mjcf-rs` |
//! | `builder` | links in one frame, whatever the format |
//! | `mesh`, `convex` | triangles from files, and convex bodies made of them |

mod builder;
mod convex;
mod mesh;
mod mjcf;
mod urdf;

use super::ObjectModel;
use std::path::{Component, Path, PathBuf};

/// Where the files are that are named with `data:`.
const DATA_VARIABLE: &str = "ACM_DATA";
/// Largest model file that is read, bytes.
const MAX_BYTES: u64 = 4 * 1024 * 1024;

/// What of an object is wanted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// What is seen and what is felt.
    #[default]
    Whole,
    /// What is seen alone: meshes are not cut into convex bodies, which takes long.
    Surfaces,
}

/// Reads `NAME`, a path relative to `folder`, or relative to the data folder with `data:` before it. An MJCF file can
/// be followed by `#BODY` for one of its bodies.
///
/// # Errors
/// One line with the file and what of it is wrong.
pub(crate) fn load(name: &str, folder: &Path, wanted: Wanted) -> Result<ObjectModel, String> {
    let (path, part) = match name.split_once('#') {
        Some((path, part)) => (path, Some(part)),
        None => (name, None),
    };
    let path = resolve(path, folder)?;
    let text = read_text(&path)?;
    let loaded = match path.extension().and_then(|ending| ending.to_str()) {
        Some("urdf") if part.is_some() => {
            Err("a URDF file has no bodies to choose from; leave out what follows `#`".into())
        }
        Some("urdf") => urdf::read(&path, &text, wanted),
        Some("xml" | "mjcf") => mjcf::read(&path, &text, part, wanted),
        _ => Err("ends neither in .urdf nor in .xml or .mjcf".into()),
    };
    let model = loaded.map_err(|reason| format!("{}: {reason}", path.display()))?;
    Ok(ObjectModel { model: name.into(), ..model })
}

fn resolve(path: &str, folder: &Path) -> Result<PathBuf, String> {
    let Some(path) = path.strip_prefix("data:") else { return Ok(folder.join(path)) };
    let data = std::env::var_os(DATA_VARIABLE)
        .ok_or_else(|| format!("`data:{path}` lies in the data folder; name that in the variable {DATA_VARIABLE}"))?;
    Ok(Path::new(&data).join(path))
}

fn read_text(path: &Path) -> Result<String, String> {
    let wrong = |e: std::io::Error| format!("{} cannot be read: {e}", path.display());
    let length = std::fs::metadata(path).map_err(wrong)?.len();
    if length > MAX_BYTES {
        return Err(format!("{}: {length} bytes, the limit is {MAX_BYTES}", path.display()));
    }
    std::fs::read_to_string(path).map_err(wrong)
}

/// The path without `x/..`: formats walk through folders that need not exist.
fn tidy(path: &Path) -> PathBuf {
    let mut tidied = PathBuf::new();
    for component in path.components() {
        let inside = matches!(tidied.components().next_back(), Some(Component::Normal(_)));
        match component {
            Component::ParentDir if inside => {
                tidied.pop();
            }
            other => tidied.push(other),
        }
    }
    tidied
}

/// A name as the judge's variables need it: lower-case letters, digits and underscores.
fn plain_name(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let mut made: String = name.chars().map(plain).take(32).collect();
    if !made.starts_with(|c: char| c.is_ascii_lowercase()) {
        made.insert_str(0, "part_");
    }
    made
}

#[cfg(test)]
mod tests;
