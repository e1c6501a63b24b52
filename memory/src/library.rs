//! The semantic and template libraries: the embedded one, or a folder of template files.

use acm_concept::template::{MAX_TEMPLATE_BYTES, TemplateError, TemplateLibrary};
use include_dir::{Dir, File, include_dir};
use std::{
    fs, io,
    path::{Path, PathBuf},
};
use thiserror::Error;

static EMBEDDED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/library");

/// Most template files that a library folder may hold.
pub const MAX_TEMPLATE_FILES: usize = 1_000;

/// Why a library folder was refused.
#[derive(Debug, Error)]
pub enum LibraryError {
    /// The folder or a file in it cannot be read.
    #[error("template library {path}: {source}")]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// The operating system's complaint.
        source: io::Error,
    },
    /// The folder holds no template file, or too many, or one that is too large.
    #[error("template library {path}: {reason}")]
    Size {
        /// The folder or file.
        path: PathBuf,
        /// What is wrong and what is allowed.
        reason: String,
    },
    /// A group that the library does not have.
    #[error("template library: there is no group `{group}`; the groups are {known}")]
    UnknownGroup {
        /// The group.
        group: String,
        /// The groups there are.
        known: String,
    },
    /// A template file that makes no sense.
    #[error(transparent)]
    Template(#[from] TemplateError),
}

/// The group of the files that lie in the library's folder itself: what perception tries on every segment, unless it is
/// told otherwise. Every other group is a folder in it.
pub const CORE: &str = "core";

/// The library that ships inside the program, as far as it is used unless something else is asked for: the group
/// [`CORE`].
///
/// ```
/// let library = acm_memory::default_library().unwrap();
/// assert!(library.with_noun("cube").any(|template| template.name == "box"));
/// ```
pub fn default_library() -> Result<TemplateLibrary, TemplateError> {
    TemplateLibrary::parse(texts(&EMBEDDED))
}

/// The library that ships inside the program, as an agent uses it that may be told of anything: the group [`CORE`], and all
/// other groups on call.
///
/// ```
/// let library = acm_memory::whole_library().unwrap();
/// assert!(library.get("tray").unwrap().on_call && !library.get("box").unwrap().on_call);
/// ```
pub fn whole_library() -> Result<TemplateLibrary, LibraryError> {
    Ok(default_library()?.with_on_call(library_of(&library_groups())?))
}

/// The groups of the library that ships inside the program, [`CORE`] first.
pub fn library_groups() -> Vec<&'static str> {
    let mut groups: Vec<&str> = EMBEDDED.dirs().filter_map(|dir| dir.path().to_str()).collect();
    groups.sort_unstable();
    groups.insert(0, CORE);
    groups
}

/// These groups of the library that ships inside the program, together.
///
/// ```
/// let library = acm_memory::library_of(&["core", "tableware"]).unwrap();
/// assert!(library.get("mug").is_some() && library.get("hammer").is_none());
/// assert!(acm_memory::library_of(&["tablewear"]).unwrap_err().to_string().contains("tableware"));
/// ```
pub fn library_of(groups: &[&str]) -> Result<TemplateLibrary, LibraryError> {
    let mut files = Vec::new();
    for group in groups {
        let folder = if *group == CORE { Some(&EMBEDDED) } else { EMBEDDED.get_dir(group) };
        let unknown = || LibraryError::UnknownGroup { group: (*group).into(), known: library_groups().join(", ") };
        files.extend(texts(folder.ok_or_else(unknown)?));
    }
    Ok(TemplateLibrary::parse(files)?)
}

/// The template files that lie in a folder itself: name and text.
fn texts(folder: &'static Dir<'_>) -> impl Iterator<Item = (&'static str, &'static str)> {
    let read = |file: &'static File<'_>| Some((file.path().to_str()?, file.contents_utf8()?));
    folder.files().filter_map(read).filter(|(name, _)| name.ends_with(".toml"))
}

/// The library in a folder: every file `*.toml` in it is a template. Folders in it are groups, each a library of its own.
pub fn library_from_dir(dir: &Path) -> Result<TemplateLibrary, LibraryError> {
    let io_error = |path: &Path, source| LibraryError::Io { path: path.into(), source };
    let size_error = |path: &Path, reason: String| LibraryError::Size { path: path.into(), reason };
    let mut paths = Vec::new();
    for entry in fs::read_dir(dir).map_err(|source| io_error(dir, source))? {
        let path = entry.map_err(|source| io_error(dir, source))?.path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            paths.push(path);
        }
        if paths.len() > MAX_TEMPLATE_FILES {
            return Err(size_error(dir, format!("more than {MAX_TEMPLATE_FILES} template files")));
        }
    }
    if paths.is_empty() {
        return Err(size_error(dir, "no file ends in .toml; a library holds one template a file".into()));
    }
    paths.sort();
    let mut texts = Vec::with_capacity(paths.len());
    for path in &paths {
        let bytes = fs::metadata(path).map_err(|source| io_error(path, source))?.len();
        if bytes > MAX_TEMPLATE_BYTES as u64 {
            return Err(size_error(path, format!("{bytes} bytes, at most {MAX_TEMPLATE_BYTES} are read")));
        }
        texts.push(fs::read_to_string(path).map_err(|source| io_error(path, source))?);
    }
    let names = paths.iter().map(|path| path.file_name().and_then(|name| name.to_str()).unwrap_or("template"));
    Ok(TemplateLibrary::parse(names.zip(texts.iter().map(String::as_str)))?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn a_folder_gives_the_same_library_as_the_embedded_files() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("library");
        let embedded = default_library().unwrap();
        assert_eq!(library_from_dir(&folder).unwrap(), embedded);
        assert!(embedded.iter().count() >= 4);
        for group in library_groups().into_iter().filter(|group| *group != CORE) {
            assert_eq!(library_from_dir(&folder.join(group)).unwrap(), library_of(&[group]).unwrap());
        }
    }

    #[test]
    fn all_groups_fit_together_and_what_is_tried_by_default_are_the_plain_ones() {
        let all = library_of(&library_groups()).unwrap();
        assert!(all.iter().filter(|template| template.stands_alone).count() >= 50);
        assert!(default_library().unwrap().iter().all(|template| template.stands_alone));
        assert_eq!(library_of(&[CORE]).unwrap(), default_library().unwrap());
    }

    #[test]
    fn an_empty_or_missing_folder_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(library_from_dir(folder.path()), Err(LibraryError::Size { .. })));
        assert!(matches!(library_from_dir(&folder.path().join("none")), Err(LibraryError::Io { .. })));
    }
}
