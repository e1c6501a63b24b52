//! The semantic and template libraries: the embedded one, or a folder of template files.

use acm_concept::template::{MAX_TEMPLATE_BYTES, TemplateError, TemplateLibrary};
use include_dir::{Dir, include_dir};
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
    /// A template file that makes no sense.
    #[error(transparent)]
    Template(#[from] TemplateError),
}

/// The library that ships inside the program.
///
/// ```
/// let library = acm_memory::default_library().unwrap();
/// assert!(library.with_noun("cube").any(|template| template.name == "box"));
/// ```
pub fn default_library() -> Result<TemplateLibrary, TemplateError> {
    let texts = EMBEDDED.files().filter_map(|file| {
        let name = file.path().file_name()?.to_str()?;
        name.ends_with(".toml").then(|| Some((name, file.contents_utf8()?))).flatten()
    });
    TemplateLibrary::parse(texts)
}

/// The library in a folder: every file `*.toml` in it is a template.
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
    }

    #[test]
    fn an_empty_or_missing_folder_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(library_from_dir(folder.path()), Err(LibraryError::Size { .. })));
        assert!(matches!(library_from_dir(&folder.path().join("none")), Err(LibraryError::Io { .. })));
    }
}
